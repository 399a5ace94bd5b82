"""Every case variant on every engine against every truth, on the tree at hand: the suite that outsiders run, one test a case and engine.

`ninedisk.harness.suite` has a test for each check, some ten a cell and ten cells of a case: to collect, send and report them all takes
longer than to judge them. Here one test judges all checks of a case on an engine and gives for each that fails. The suite's options hold
here as well, but for ``--known-gaps``: what is known of our own engines is in their cases.

A store that a run of this very code has left is judged, all of it. Without one every cell has to run, which takes as long as the main
job: then those beyond the first variant of each case are slow, and so are other programs, whose adapters have their own tests.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from ninedisk.harness.run.plan import Cell
from ninedisk.harness.suite.items import CellCheck, Plan, make_plan, place
from ninedisk.harness.wire.external import ExternalEngine

Verdicts = dict[str, list[str]]


@dataclass(frozen=True)
class Planned:
    """What one test judges; pytest prints it with every expected failure, and a plan is long."""

    cells: list[Cell] = field(default_factory=list, repr=False)
    plan: Plan = field(repr=False, kw_only=True)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "planned" not in metafunc.fixturenames:
        return
    names = ("case", "engine", "engine_cmd", "store")
    cases, engines, commands, store = (metafunc.config.getoption(f"ninedisk_{name}") for name in names)
    plan = make_plan(cases, engines, commands, None, store)
    levels, chosen = plan.tiers(), engines or commands
    tests: dict[str, Planned] = {}
    for cell in plan.cells:
        here = chosen or not isinstance(cell.engine, ExternalEngine)
        soon = plan.stored.cells or (here and "smoke" in levels[place(cell)])
        name = f"{cell.case.id}-{cell.engine_id}{'' if soon else '-slow'}"
        tests.setdefault(name, Planned(plan=plan)).cells.append(cell)
    marks = {name: [pytest.mark.xdist_group(name), *[pytest.mark.slow] * name.endswith("-slow")] for name in tests}
    metafunc.parametrize("planned", [pytest.param(tests[name], id=name, marks=marks[name]) for name in tests])


def verdicts(checks: list[CellCheck]) -> Verdicts:
    """What each check says, by its outcome."""
    said: Verdicts = {"passed": [], "failed": [], "skipped": [], "xfailed": []}
    for check in checks:
        try:
            check.verify()
        except pytest.xfail.Exception as outcome:  # first, since it is a kind of failure to pytest
            said["xfailed"].append(str(outcome))
        except pytest.fail.Exception as outcome:
            said["failed"].append(str(outcome))
        except pytest.skip.Exception as outcome:
            said["skipped"].append(str(outcome))
        else:
            said["passed"].append(check.name)
    return said


def test_cells(planned: Planned) -> None:
    """Every check passes, or has no truth or a known gap; the cells' own tests pass as well."""
    judge_cells([planned.plan.checks(cell) for cell in planned.cells])


def judge_cells(cells: list[list[CellCheck]]) -> None:
    __tracebackhide__ = True
    said: Verdicts = {"passed": [], "failed": [], "skipped": [], "xfailed": []}
    for checks in cells:
        for outcome, texts in verdicts(checks).items():
            # What passes besides the cell itself is a number that was held against a truth.
            said[outcome] += [text for text in texts if (outcome, text) != ("passed", checks[-1].name)]
    if said["failed"]:
        pytest.fail("\n\n".join(said["failed"]), pytrace=False)
    if said["xfailed"]:
        pytest.xfail("; ".join(dict.fromkeys(said["xfailed"])))
    if not said["passed"]:
        pytest.skip("; ".join(dict.fromkeys(said["skipped"])))


def says(name: str, outcome: Exception | None = None) -> Any:
    def verify() -> None:
        if outcome is not None:
            raise outcome

    return SimpleNamespace(name=name, verify=verify)


def test_cells_are_what_their_checks_say() -> None:
    passes, cell, skips = says("x"), says("cell"), says("y", pytest.skip.Exception("no truth"))
    known, fails = says("z", pytest.xfail.Exception("known")), says("w", pytest.fail.Exception("off", pytrace=False))
    judge_cells([[passes, skips, cell], [skips, cell]])
    with pytest.raises(pytest.skip.Exception, match="no truth"):
        judge_cells([[skips, cell], [skips, cell]])
    with pytest.raises(pytest.xfail.Exception, match="known"):
        judge_cells([[passes, cell], [passes, known, cell]])
    with pytest.raises(pytest.fail.Exception, match="off"):
        judge_cells([[fails, passes, known, skips, cell], [passes, cell]])
    with pytest.raises(pytest.fail.Exception, match="other checks"):
        judge_cells([[passes, says("cell", pytest.fail.Exception("other checks"))]])
    with pytest.raises(RuntimeError, match="broken"):
        judge_cells([[passes, says("cell", RuntimeError("broken"))]])
