"""Impacts of spheres: the DEM's order against closed forms and integrated laws, and values that no matrix has."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ninedisk.harness.api.registry import get_case
from ninedisk.harness.engines.bullet.adapter import ENGINE as BULLET
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.siconos.adapter import ENGINE as SICONOS


@pytest.mark.parametrize(
    ("case_id", "params", "quantity", "least"),
    [
        ("spheres/chung-ooi/1", {}, "overlap_max", 3.7),
        ("spheres/chung-ooi/2", {"material": "magnesium"}, "duration", 3.7),
        ("spheres/hertz-chain", {}, "v_14", 3.7),
        # Where the touch falls in a step matters to a dashpot and to the first slip: 5/4 is what is left of the order.
        ("spheres/chung-ooi/6", {"spin": 7.0}, "spin_final", 2.0**1.25),
    ],
)
def test_the_error_falls_with_the_order_of_the_scheme(
    run_cell: Any, case_id: str, params: dict[str, Any], quantity: str, least: float
) -> None:
    errors = []
    for substeps in (2, 32):
        cell = run_cell(get_case(case_id), DEM, {**params, "substeps": substeps})
        assert cell.failures == []
        check = next(check for check in cell.checks if check.quantity == quantity)
        seen = cell.observed.series[quantity][1] if check.norm == "max" else cell.observed.scalars[quantity][1]
        errors.append(float(abs(seen - check.expected).max()) if check.norm == "max" else abs(seen - check.expected))
    # Sixteen times finer: four halvings.
    assert errors[0] / errors[1] > least**4


@pytest.mark.parametrize("change", [{"mu": 0.41}, {"beta": 0.2}, {"g_star": 3e10}, {"e_star": 1e11}])
def test_a_wrong_law_is_seen(run_cell: Any, change: dict[str, float]) -> None:
    """Of a spinning sphere: all that enters the law enters its rebound."""
    assert run_cell(get_case("spheres/chung-ooi/6"), DEM, {"spin": 7.0}, law=change).failures


def test_arms_of_springs_excuse_no_rigid_contact() -> None:
    """Where nothing overlaps, no arm is shorter by half the overlap, whatever arms an engine declares."""
    case = get_case("spheres/thornton")
    for variant in case.matrix():
        params = {parameter.name: parameter.default for parameter in case.parameters} | variant
        for engine in (SICONOS, BULLET):
            known = [
                check.known for check in case.checks(params, case.build(params), None, engine.info()) if check.known
            ]
            assert not [each for each in known if each.finding.endswith("one-lever-arm")], variant


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "params"),
    [(4, {"angle": 17.5}), (5, {"angle": 30.0}), (6, {"spin": 3.0}), (7, {"spin": 5.0}), (8, {"spin": 2.2})],
)
def test_the_papers_figures_are_drawn_through_what_an_engine_does(
    run_cell: Any, number: int, params: dict[str, Any]
) -> None:
    """Signs, arms and axes of the curves are those of what is observed, at a place where the contact sticks and slips."""
    case = get_case(f"spheres/chung-ooi/{number}")
    cell = run_cell(case, DEM, params)
    assert cell.failures == []
    seen = {name: value for name, (_, value) in cell.observed.scalars.items()} | params
    drawn = 0
    for figure in case.figures:
        for quantity in figure.quantities:
            curve = next(each for each in figure.curves if each.label == quantity.label and not each.reader)
            assert np.interp(seen[quantity.at], curve.x, curve.y) == pytest.approx(
                seen[quantity.name], rel=2e-3, abs=2e-5
            )
            drawn += 1
    assert drawn >= 2


def test_hertz_curve_of_force_over_overlap_is_the_engines(run_cell: Any) -> None:
    case = get_case("spheres/chung-ooi/2")
    cell = run_cell(case, DEM, {"material": "magnesium"})
    curve = next(each for each in case.figures[0].curves if "magnesium" in each.name)
    overlap, force = (cell.observed.series[name][1] for name in ("overlap", "force"))
    # The first chord, over a fortieth, lies above the curve by (4/27)/40^1.5 = 5.9e-4 of its top.
    assert abs(np.interp(overlap, curve.x, curve.y) - force).max() < 6e-4 * force.max()
