"""Every case variant on every engine against every truth, on the tree at hand: the suite that outsiders run, one test a cell.

`ninedisk.harness.suite` has a test for each check, some ten a cell: to collect, send and report them all takes longer than to judge
them. Here a cell's test judges all of its checks and tells of each that fails. The suite's options hold here as well, but for
``--known-gaps``: what is known of our own engines is in their cases.
"""

from __future__ import annotations

from itertools import groupby
from types import SimpleNamespace
from typing import Any

import pytest

from ninedisk.harness.suite.items import CellCheck, make_plan, parameters, place

Verdicts = dict[str, list[str]]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "checks" not in metafunc.fixturenames:
        return
    names = ("case", "engine", "engine_cmd", "store")
    cases, engines, commands, store = (metafunc.config.getoption(f"ninedisk_{name}") for name in names)
    plan = make_plan(cases, engines, commands, None, store)
    cells = []
    for (case, variant, engine), checks in groupby(parameters(plan), lambda check: place(check.values[0].cell)):
        found = list(checks)
        shared = [mark for mark in found[-1].marks if mark.name != "xdist_group"]
        cells.append(pytest.param([check.values[0] for check in found], id=f"{case}[{variant}]-{engine}", marks=shared))
    metafunc.parametrize("checks", cells)


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


def test_cell(checks: list[CellCheck]) -> None:
    """Every check passes, or has no truth or a known gap; the cell's own test passes as well."""
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
    test_cell([passes, skips, cell])
    with pytest.raises(pytest.skip.Exception, match="no truth"):
        test_cell([skips, cell])
    with pytest.raises(pytest.xfail.Exception, match="known"):
        test_cell([passes, known, cell])
    with pytest.raises(pytest.fail.Exception, match="off"):
        test_cell([fails, passes, known, skips, cell])
    with pytest.raises(pytest.fail.Exception, match="other checks"):
        test_cell([passes, says("cell", pytest.fail.Exception("other checks"))])
    with pytest.raises(RuntimeError, match="broken"):
        test_cell([passes, says("cell", RuntimeError("broken"))])
