"""Engines in single precision: a right one is not accused, and a wrong one is not excused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.harness.api.case import Check
from ninedisk.harness.api.engine import EngineError, EngineInfo
from ninedisk.harness.api.registry import case_table, get_case
from ninedisk.harness.run.plan import Cell, plan_case
from ninedisk.harness.run.precision import BLIND, in_single_precision
from ninedisk.harness.run.runner import run_cell
from ninedisk.harness.selftest.mutants import MUTANTS
from ninedisk.harness.selftest.panel import panel_cells
from ninedisk.harness.selftest.rounded import ROUNDED, Rounded
from ninedisk.harness.selftest.run import EngineWithResult, altered_report, outcomes


def failures(cell: Cell) -> list[str]:
    """Checks that fail, and how the cell ended if it broke."""
    result = run_cell(cell)
    wrong = [f"{cell.name}: {result.cell['reason']}"] if result.cell["status"] in ("error", "timeout") else []
    return wrong + [
        f"{cell.name} {row['quantity']} ({row['truth']}): {row['reason']}"
        for row in result.rows
        if row["status"] == "fail"
    ]


QUICK: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
    ("impulse", "binary-collision", {"kind": "plastic"}),
    ("impulse", "impact/oblique", {"restitution": 0.5}),
    ("cd", "binary-collision", {"kind": "elastic", "gap": 0.5025}),
    ("cd", "impact/bouncing-disk", {"restitution": 0.5}),
    ("cd", "impact/oblique", {"impact": "newton", "sliding": "coulomb", "vt": 4.01}),
    ("cd", "slip-to-roll", {}),
    ("dem", "nine-disk/compression", {"xi": 0.0}),
    ("dem", "contact/reopening", {"pair": "wall"}),
    ("dem", "spheres/turned", {"kind": "plane"}),
    ("dem", "nine-disk/distortion", {"ks_over_kn": 2.0 / 3.0, "walls": "corner-pivot-caps-translate", "wall_mu": "mu"}),
    ("cd", "binary-collision", {"kind": "elastic", "mass": 1.0, "mass_2": 3.0, "radius": 0.4, "radius_2": 0.7}),
    ("dem", "nurbs/overlap", {"shape": "disk"}),
    ("cd", "nurbs/overlap", {"shape": "ellipse"}),
    ("impulse", "nurbs/settle", {"slope": 0.0}),
    ("cd", "contact/orbit", {"arm": "radius"}),
    ("cd", "contact/holding", {"kind": "row"}),
    ("impulse", "contact/holding", {"kind": "adhesion"}),
    ("cd", "energy/budget", {"contacts": "rigid"}),
)


@pytest.mark.parametrize(("kind", "case", "params"), QUICK)
def test_a_right_engine_that_rounds_is_not_accused(kind: str, case: str, params: Mapping[str, Any]) -> None:
    assert failures(plan_case(case, Rounded(kind), params)) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", ROUNDED)
@pytest.mark.parametrize("case", list(case_table()))
def test_no_check_of_the_matrix_fails_in_single_precision(kind: str, case: str) -> None:
    engine = Rounded(kind)
    cells = [plan_case(case, engine, overrides) for overrides in get_case(case).matrix()]
    assert [each for cell in cells for each in failures(replace(cell, user_set=False))] == []


class Single(EngineWithResult):
    """A result that its engine declares as one of single precision."""

    def info(self) -> EngineInfo:
        return replace(super().info(), precision="float32", reference=False)


BELOW_ROUNDING = {
    "dem/damping-lagged": "forces off by 5e-3, where the swing of 200 steps loses as much to rounded places",
    "dem/first-kick": "a velocity off by 1.4e-4, in 1e4 steps each of which rounds by 6e-8 of it",
    "dem/rolling-stiffness": "a speed off by 1.8e-3 where the spring's swing is slower than the rate by which places are rounded",
}
"""Defects whose witness cannot show them in single precision, and why."""

WITNESSED = [
    each
    for each in MUTANTS
    if not each.hole and (each.engine in ("impulse", "soft") or (each.engine == "dem" and each.kind != "kernel"))
]


@pytest.mark.slow
@pytest.mark.parametrize("defect", WITNESSED, ids=lambda defect: defect.id)
def test_a_wrong_engine_is_caught_in_single_precision(defect: Any) -> None:
    """On its witness alone."""
    [cell] = panel_cells(defect.engine, [defect.witness])
    assert not isinstance(cell.engine, Exception)
    [found] = outcomes(defect, [cell])
    outcome = altered_report(defect, found)
    if isinstance(outcome, EngineError):
        pytest.skip("it ends without an answer")
    with np.errstate(all="ignore"):
        double, single = (
            failures(replace(cell, engine=made(cell.engine, outcome))) for made in (EngineWithResult, Single)
        )
    assert double
    assert bool(single) == (defect.id not in BELOW_ROUNDING)


def test_a_check_that_rounding_alone_decides_says_nothing() -> None:
    """A spring of 1e8 N/m on a disk at 1 m: a unit of its place is a fifth of the weight."""
    engine = Rounded("dem")
    cell = plan_case("slip-to-roll", engine, {})
    assert not isinstance(cell.setup, Exception)
    observed = run_observed(cell)
    checks = [
        Check(quantity=name, norm="scalar", truth="analytic", expected=expected, source="", why="", atol=1e-9)
        for name, expected in (("vx_final", 2.0 / 3.0), ("gap_final", 1e-7))
    ]
    held = {check.quantity: check for check in in_single_precision(checks, cell.setup, observed, engine.info())}
    assert 1e-9 < held["vx_final"].atol < BLIND
    assert math.isnan(float(held["gap_final"].expected))
    assert in_single_precision(checks, cell.setup, observed, replace(engine.info(), precision="float64")) == checks


def run_observed(cell: Cell) -> Any:
    """Quantities of a history without numbers."""
    from ninedisk.harness.run.judge import blank_history

    assert not isinstance(cell.setup, Exception)
    return cell.case.observe(cell.variant.params, cell.setup, blank_history(cell.setup))
