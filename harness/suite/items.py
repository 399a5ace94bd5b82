"""The tests of the suite: which there are, found without running an engine, how each is judged, and what a failed one reports.

How much of a case's matrix a test belongs to: ``-m smoke``, ``-m core`` or ``-m full``.

- ``smoke``: the first variant of each case, the one that its source shows first: does the engine speak at all?
- ``core``: those, and the variants that differ from the first in one parameter alone: one cause for each difference.
- ``full``: every variant.

Each tier holds the one before it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from ninedisk.harness.api.case import Variant
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import match_cases
from ninedisk.harness.api.support import support_of
from ninedisk.harness.results.schema import Row, row_tolerance
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.gaps import GapFile, KnownGap, read_gaps
from ninedisk.harness.run.plan import Cell, plan_matrix, run_command
from ninedisk.harness.run.runner import Patience, check_ids, dry_checks, last_lines, run_cell
from ninedisk.harness.suite.reuse import StoredCells, open_store
from ninedisk.harness.wire.command import engines_given

CELL = "cell"
"""Name of the test that represents the cell as a whole."""

CheckName = tuple[str, str, str]
"""Id, quantity and kind of truth of a collected check."""


TIERS = {
    "smoke": "the first variant of each case",
    "core": "variants that differ from the first of their case in at most one parameter",
    "full": "every variant of every case",
}


@dataclass(frozen=True)
class Plan:
    """The cells of a session, and what is shared by their tests."""

    cells: Sequence[Cell]
    gaps: GapFile
    stored: StoredCells
    collected: dict[CheckName, list[CheckName]] = field(default_factory=dict)
    results: dict[CheckName, CaseResult] = field(default_factory=dict)
    patience: Patience = field(default_factory=Patience)

    def idle_gaps(self) -> list[KnownGap]:
        """Gaps that explain no check of the session."""
        return self.gaps.idle(
            (*place(cell), quantity, truth) for cell in self.cells for _, quantity, truth in self.names(cell)
        )

    def names(self, cell: Cell) -> list[CheckName]:
        """The checks of a cell, found once."""
        key = place(cell)
        if key not in self.collected:
            self.collected[key] = _collect(cell)
        return self.collected[key]

    def checks(self, cell: Cell) -> list[CellCheck]:
        """A cell's tests: one for each check, and one for the cell as a whole."""
        collected = tuple(name for name, _, _ in self.names(cell))
        return [CellCheck(cell, name, collected, self) for name in (*collected, CELL)]

    def tiers(self) -> dict[CheckName, tuple[str, ...]]:
        """Names of the tiers of each cell, by its place."""
        variants: dict[str, list[Cell]] = {}
        for cell in self.cells:
            variants.setdefault(cell.case.id, []).append(cell)
        levels = {case: tiers([cell.variant for cell in cells]) for case, cells in variants.items()}
        return {place(cell): levels[cell.case.id][cell.variant.id] for cell in self.cells}


def make_plan(
    cases: Sequence[str], engines: Sequence[str], commands: Sequence[str], gaps: Path | None, store: Path | None
) -> Plan:
    """Plan the tests of a session.

    Raises
    ------
    UsageError
        Unknown ids, or a file of gaps that cannot be read.
    """
    known = read_gaps(gaps) if gaps is not None else GapFile()
    planned = plan_matrix(match_cases(cases), engines_given(engines, commands), {})
    stored = open_store(store) if store is not None else StoredCells("")
    return Plan(planned, known, stored)


def parameters(plan: Plan) -> Iterator[object]:
    """A `pytest.param` for each check, and one for each cell as a whole."""
    levels = plan.tiers()
    for cell in plan.cells:
        group = f"{cell.case.id}[{cell.variant.id}]-{cell.engine_id}"
        together = group.replace("[", " ").replace("]", " ")  # pytest-xdist looks for a group after the last bracket
        shared = [pytest.mark.xdist_group(together), *(getattr(pytest.mark, tier) for tier in levels[place(cell)])]
        for check in plan.checks(cell):
            yield pytest.param(check, id=f"{group}-{check.name}", marks=shared)


def place(cell: Cell) -> CheckName:
    """Case, variant and engine of a cell."""
    return cell.case.id, cell.variant.id, cell.engine_id


def _collect(cell: Cell) -> list[CheckName]:
    """The cell's checks; none where it cannot run, since the test of the cell then says why."""
    if isinstance(cell.setup, Exception) or isinstance(cell.engine, Exception):
        return []
    try:
        info = cell.engine.info()
        if not info.installed:
            return []
        if support_of(cell.engine, cell.setup.scene, cell.setup.numerics).level is SupportLevel.NO:
            return []
        pairs = [(check.quantity, check.truth) for check in dry_checks(cell, info)]
        return [(name, *pair) for name, pair in zip(check_ids(pairs), pairs, strict=True)]
    except Exception:  # the test of the cell shows why
        return []


@dataclass(frozen=True)
class CellCheck:
    """One check of a cell, or the cell as a whole.

    pytest prints it with every failure, expected ones as well: a cell with its scene takes longer to print than to judge.
    """

    cell: Cell = field(repr=False)
    name: str
    collected: tuple[str, ...] = field(repr=False)
    plan: Plan = field(repr=False)

    def result(self) -> CaseResult:
        """The cell's result: a stored one that still holds, or computed once a process."""
        results, key = self.plan.results, place(self.cell)
        if key not in results:
            stored = self.plan.stored.find(self.cell)
            # Checks may depend on more than the sources, on digitised curves for instance: run the cell then.
            if stored is not None and tuple(_measured(stored)) != self.collected:
                stored = None
            patience = self.plan.patience
            results[key] = run_cell(self.cell, given_up=patience.given_up(self.cell)) if stored is None else stored
            patience.record_outcome(self.cell, results[key])
        return results[key]

    def verify(self) -> None:
        """Pass, skip, xfail or fail as the status says; a failure reports value, reference, tolerance and its reason."""
        __tracebackhide__ = True
        result = self.result()
        if result.status in ("unsupported", "not-installed"):
            pytest.skip(f"{result.status}: {result.reason}")
        if result.status in ("error", "timeout"):
            self._fail(f"{self.cell.name}: {result.status}: {result.reason}")
        measured = _measured(result)
        if self.name == CELL:
            self._verify_cell(measured)
        elif self.name not in measured:
            self._fail(f"{self.cell.name}: {self.name} was collected but not measured")
        else:
            self._verdict(result.rows[measured.index(self.name)])

    def _verify_cell(self, measured: list[str]) -> None:
        __tracebackhide__ = True
        if tuple(measured) != self.collected:
            self._fail(
                f"{self.cell.name}: {self._why_they_differ()}; collected {list(self.collected)}, measured {measured}"
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

    def _verdict(self, measured: Row) -> None:
        __tracebackhide__ = True
        (row,) = self.plan.gaps.judged([measured])
        if row["status"] == "gap-closed" != measured["status"]:
            self._fail(f"{self.cell.name}: {row['quantity']} against {row['truth']}: {row['reason']}")
        if row["status"] in ("known-gap", "known-difference"):
            pytest.xfail(f"{row['status']}: {row['reason']}")
        if row["status"] in ("no-truth", "not-observed"):
            pytest.skip(f"{row['status']}: {row['reason']}")
        if row["status"] == "fail":
            self._fail(failure_text(self.cell.name, row))

    def _fail(self, text: str) -> None:
        __tracebackhide__ = True
        pytest.fail(f"{text}\n{where_to_look(self.cell)}", pytrace=False)


def _measured(result: CaseResult) -> list[str]:
    return check_ids((row["quantity"], row["truth"]) for row in result.rows if row["quantity"])


def failure_text(name: str, row: Row) -> str:
    """Value, reference, error, tolerance and its reason of a failed check."""
    unit = row["unit"] if row["unit"] not in ("", "-") else ""
    lines = [
        f"{name}: {row['quantity']} against {row['truth']}: {row['reason']}",
        f"  value      {row['value']!r} {unit}".rstrip()
        + (f" at step {row['worst_step']}" if row["worst_step"] >= 0 else ""),
        f"  reference  {row['expected']!r} {unit}".rstrip() + f" (+- {row['uncertainty']:.3g}; {row['source']})",
        f"  error      {row['abs_error']:.6g} {unit}".rstrip() + f" (relative {row['rel_error']:.3g})",
        f"  tolerance  {row_tolerance(row):.6g} {unit}".rstrip()
        + f" = {row['atol']:g} + {row['rtol']:g} x {row['scale']:.6g}",
        f"  because    {row['why']}",
    ]
    if row["first_divergence_step"] >= 0:
        lines.append(f"  diverges   first at step {row['first_divergence_step']}")
    return "\n".join(lines)


def where_to_look(cell: Cell) -> str:
    """The case in words, its page in a report, and the command that runs the cell again."""
    return "\n".join(
        (
            f"  case       ninedisk list cases {cell.case.id}; {page(cell.case.id)} of a report",
            f"  again      {run_command(cell)}",
        )
    )


def page(case_id: str) -> str:
    """Place of a case's errors, relative to the folder of a report."""
    slug = re.sub(r"[^a-z0-9]+", "-", case_id.lower()).strip("-")[:60]
    return f"case/{slug}.html#errors"


def tiers(variants: Sequence[Variant]) -> dict[str, tuple[str, ...]]:
    """Names of the tiers of each variant, by its id; ``variants`` are those of one case in the order of its matrix."""
    found: dict[str, tuple[str, ...]] = {}
    names = tuple(TIERS)
    for variant in variants:
        first = variants[0].params
        differ = sum(value != first[name] for name, value in variant.params.items())
        found.setdefault(variant.id, names[min(differ, 2) :])
    return found
