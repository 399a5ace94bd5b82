"""Every case variant on every engine against every truth, on the tree at hand: the suite that outsiders run, one test a cell.

`ninedisk.harness.suite` has a test for each check, some ten a cell: to collect, send and report them all takes longer than to judge
them. Here a cell's test judges all of its checks and tells of each that fails. The suite's options hold here as well, but for
``--known-gaps``: what is known of our own engines is in their cases.

A store that a run of this very code has left is judged, all of it. Without one every cell has to run, which takes as long as the main
job: then those beyond the first variant of each case are slow.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ninedisk.harness.run.plan import Cell
from ninedisk.harness.suite.items import CellCheck, Plan, make_plan, place

Verdicts = dict[str, list[str]]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "planned" not in metafunc.fixturenames:
        return
    names = ("case", "engine", "engine_cmd", "store")
    cases, engines, commands, store = (metafunc.config.getoption(f"ninedisk_{name}") for name in names)
    plan = make_plan(cases, engines, commands, None, store)
    levels, cells = plan.tiers(), []
    for cell in plan.cells:
        tiers = levels[place(cell)]
        marks = [getattr(pytest.mark, tier) for tier in tiers]
        marks.append(pytest.mark.xdist_group(f"{cell.case.id}-{cell.engine_id}"))
        if not plan.stored.cells and "smoke" not in tiers:
            marks.append(pytest.mark.slow)
        name = f"{cell.case.id}[{cell.variant.id}]-{cell.engine_id}"
        cells.append(pytest.param((plan, cell), id=name, marks=marks))
    metafunc.parametrize("planned", cells)


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


def test_cell(planned: tuple[Plan, Cell]) -> None:
    """Every check passes, or has no truth or a known gap; the cell's own test passes as well."""
    plan, cell = planned
    judge_cell(plan.checks(cell))


def judge_cell(checks: list[CellCheck]) -> None:
    said = verdicts(checks)
    if said["failed"]:
        pytest.fail("\n\n".join(said["failed"]), pytrace=False)
    if said["xfailed"]:
        pytest.xfail("; ".join(dict.fromkeys(said["xfailed"])))
    # What passes besides the cell itself is a number that was held against a truth.
    if not set(said["passed"]) - {checks[-1].name}:
        pytest.skip("; ".join(dict.fromkeys(said["skipped"])))


def says(name: str, outcome: Exception | None = None) -> Any:
    def verify() -> None:
        if outcome is not None:
            raise outcome

    return SimpleNamespace(name=name, verify=verify)


def test_a_cell_is_what_its_checks_say() -> None:
    passes, cell, skips = says("x"), says("cell"), says("y", pytest.skip.Exception("no truth"))
    known, fails = says("z", pytest.xfail.Exception("known")), says("w", pytest.fail.Exception("off", pytrace=False))
    judge_cell([passes, skips, cell])
    with pytest.raises(pytest.skip.Exception, match="no truth"):
        judge_cell([skips, cell])
    with pytest.raises(pytest.xfail.Exception, match="known"):
        judge_cell([passes, known, cell])
    with pytest.raises(pytest.fail.Exception, match="off"):
        judge_cell([fails, passes, known, skips, cell])
    with pytest.raises(pytest.fail.Exception, match="other checks"):
        judge_cell([passes, says("cell", pytest.fail.Exception("other checks"))])
    with pytest.raises(RuntimeError, match="broken"):
        judge_cell([passes, says("cell", RuntimeError("broken"))])
