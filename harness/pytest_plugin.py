"""pytest as a way in: one test per case variant, engine and check.

A test module asks for the fixture ``ninedisk_check`` and calls ``ninedisk_check.verify()``; the plugin makes one test
of it for each check of the matrix, plus one called ``cell`` for each variant and engine, which fails if the engine
crashed or if the checks that were measured are not those that were collected. Collecting runs no engine: the checks are
enumerated on a history without numbers (`ninedisk.harness.dry_run`). A cell is run when its first test needs it and
kept for the others; with pytest-xdist use ``--dist loadgroup`` so that a cell's tests stay in one process (without it
each process runs the cells that it needs).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from ninedisk.harness.dry_run import check_ids, dry_checks
from ninedisk.harness.engine import SupportLevel
from ninedisk.harness.plan import Cell, plan_matrix
from ninedisk.harness.protocol.given import engines_given
from ninedisk.harness.registry import match_cases
from ninedisk.harness.results import CaseResult, Row
from ninedisk.harness.runner import last_lines, run_cell

CELL = "cell"
"""Name of the test that stands for the cell as a whole."""

Results = dict[tuple[str, str, str], CaseResult]

_CELLS = pytest.StashKey[list[tuple[Cell, list[str]]]]()
_RESULTS = pytest.StashKey[Results]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--engine ID``, ``--engine-cmd COMMAND`` and ``--case GLOB``, all repeatable; none means all."""
    group = parser.getgroup("ninedisk", "verification of granular engines")
    group.addoption("--engine", action="append", default=[], metavar="ID", help="engine to verify; repeat for several")
    group.addoption(
        "--engine-cmd", action="append", default=[], metavar="COMMAND", help="engine by its command; repeat for several"
    )
    group.addoption("--case", action="append", default=[], metavar="GLOB", help="cases to run; repeat for several")


def pytest_configure(config: pytest.Config) -> None:
    """The marker by which pytest-xdist keeps a cell's tests together."""
    config.addinivalue_line("markers", "xdist_group(name): tests that run in the same process under --dist loadgroup")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test per check for every test function that takes ``ninedisk_check``."""
    if "ninedisk_check" in metafunc.fixturenames:
        metafunc.parametrize("ninedisk_check", list(_parameters(metafunc.config)))


def _parameters(config: pytest.Config) -> Iterator[object]:
    if _CELLS not in config.stash:
        cases = config.getoption("--case")
        try:
            engines = engines_given(config.getoption("--engine"), config.getoption("--engine-cmd"))
            planned = plan_matrix(match_cases(cases), engines, {})
        except ValueError as error:
            raise pytest.UsageError(str(error)) from error
        config.stash[_CELLS] = [(cell, [*_collect(cell), CELL]) for cell in planned]
        config.stash[_RESULTS] = {}
    results = config.stash[_RESULTS]
    for cell, names in config.stash[_CELLS]:
        group = f"{cell.case.id}[{cell.variant.id}]-{cell.engine_id}"
        for name in names:
            check = CellCheck(cell, name, tuple(names[:-1]), results)
            yield pytest.param(check, id=f"{group}-{name}", marks=pytest.mark.xdist_group(group))


def _collect(cell: Cell) -> list[str]:
    """Ids of the cell's checks; none where it cannot run, since the test of the cell then says why."""
    if isinstance(cell.setup, Exception) or isinstance(cell.engine, Exception):
        return []
    try:
        info = cell.engine.info()
        if not info.installed:
            return []
        if cell.engine.supports(cell.setup.scene, cell.setup.numerics).level is SupportLevel.NO:
            return []
        return check_ids((check.quantity, check.truth) for check in dry_checks(cell, info))
    except Exception:  # the test of the cell tells why
        return []


@dataclass(frozen=True)
class CellCheck:
    """One check of a cell, or the cell as a whole."""

    cell: Cell
    name: str
    collected: tuple[str, ...]
    results: Results = field(repr=False)

    def result(self) -> CaseResult:
        """The cell's result, computed once a process."""
        key = (self.cell.case.id, self.cell.variant.id, self.cell.engine_id)
        if key not in self.results:
            self.results[key] = run_cell(self.cell)
        return self.results[key]

    def verify(self) -> None:
        """Pass, skip, xfail or fail as the status says; a failure tells value, reference, tolerance and its reason."""
        __tracebackhide__ = True
        result = self.result()
        if result.status in ("unsupported", "not-installed"):
            pytest.skip(f"{result.status}: {result.reason}")
        if result.status in ("error", "timeout"):
            pytest.fail(f"{self.cell.name}: {result.status}: {result.reason}", pytrace=False)
        measured = check_ids((row["quantity"], row["truth"]) for row in result.rows if row["quantity"])
        if self.name == CELL:
            self._verify_cell(measured)
        elif self.name not in measured:
            pytest.fail(f"{self.cell.name}: {self.name} was collected but not measured", pytrace=False)
        else:
            _verdict(self.cell.name, result.rows[measured.index(self.name)])

    def _verify_cell(self, measured: list[str]) -> None:
        if tuple(measured) != self.collected:
            pytest.fail(
                f"{self.cell.name}: {self._why_they_differ()}; collected {list(self.collected)}, measured {measured}",
                pytrace=False,
            )
        if not measured:
            pytest.skip("no-truth: no truth binds this engine on this variant")

    def _why_they_differ(self) -> str:
        try:
            if not isinstance(self.cell.engine, Exception):
                dry_checks(self.cell, self.cell.engine.info())
        except Exception as error:
            return f"the case cannot list its checks for a history without numbers: {last_lines(error)}"
        return "the checks depend on what the engine computed"


def _verdict(name: str, row: Row) -> None:
    __tracebackhide__ = True
    if row["status"] == "known-gap":
        pytest.xfail(f"known-gap: {row['reason']}")
    if row["status"] == "no-truth":
        pytest.skip(f"no-truth: {row['reason']}")
    if row["status"] == "fail":
        pytest.fail(failure_text(name, row), pytrace=False)


def failure_text(name: str, row: Row) -> str:
    """Everything that one needs to judge a failed check."""
    unit = row["unit"] if row["unit"] not in ("", "-") else ""
    allowed = row["atol"] + (row["rtol"] * row["scale"] if row["rtol"] else 0.0)
    lines = [
        f"{name}: {row['quantity']} against {row['truth']}: {row['reason']}",
        f"  value      {row['value']!r} {unit}".rstrip()
        + (f" at step {row['worst_step']}" if row["worst_step"] >= 0 else ""),
        f"  reference  {row['expected']!r} {unit}".rstrip() + f" (+- {row['uncertainty']:.3g}; {row['source']})",
        f"  error      {row['abs_error']:.6g} {unit}".rstrip() + f" (relative {row['rel_error']:.3g})",
        f"  tolerance  {allowed:.6g} {unit}".rstrip() + f" = {row['atol']:g} + {row['rtol']:g} x {row['scale']:.6g}",
        f"  because    {row['why']}",
    ]
    if row["first_divergence_step"] >= 0:
        lines.append(f"  diverges   first at step {row['first_divergence_step']}")
    return "\n".join(lines)
