"""Grains on an incline: the DEM meets the truths, errors fall with the overlap, and defects are seen."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.nurbs.shapes import regular_polygon
from ninedisk.core.scene import Scene
from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.matched import with_slip_at
from ninedisk.harness.cases.nurbs.rolling import APOTHEM, CASE, crossing_time
from ninedisk.harness.engines.dem.adapter import ENGINE

Judge = Callable[..., Any]
SQUARE = {"faces": 4, "roundness": 0.0}


def found(judge: Judge, params: dict[str, Any], change: Callable[[Scene], Scene]) -> set[str]:
    """Quantities that fail on another scene than the case asks for."""
    setup = CASE.build(resolve(CASE, params).params)
    history = ENGINE.run(change(setup.scene), setup.numerics, setup.watch).history
    return {text.split(" (")[0] for text in judge(CASE, ENGINE.info(), params, history, setup).failures}


@pytest.mark.parametrize("steepness", [0.98, 1.02])
def test_the_slope_that_tips_is_bracketed_by_two_in_a_hundred(run_cell: Judge, steepness: float) -> None:
    """Grains rest and roll where they should, and disks always roll."""
    for kind in (SQUARE, {"faces": 12, "roundness": 0.3}):
        cell = run_cell(CASE, ENGINE, {**kind, "steepness": steepness, "kn": 1e8})
        assert cell.failures == []
        assert cell.observed.scalars["rolls"][1] == (steepness > 1.0)
        assert cell.observed.series["x_disk"][1][-1] > 2.5


def errors(run_cell: Judge, params: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Largest unbalance and error of the time to roll over half a face, of a run that passes."""
    cell = run_cell(CASE, ENGINE, {**params, "steepness": 1.05})
    assert cell.failures == []
    time = next(check for check in cell.checks if check.quantity == "t_half")
    largest = float(np.nanmax(np.abs(cell.observed.series["unbalance"][1])))
    return np.array([largest, abs(cell.observed.scalars["t_half"][1] - time.expected)])


def unbalance(slip_at: Any, step: float) -> float:
    """Largest unbalance of a rolling ellipse with contact steps of this length."""
    params = resolve(CASE, {"grain": "ellipse", "contact_dt": step, "steepness": 1.05}).params
    setup = CASE.build(params)
    history = ENGINE.run(with_slip_at(setup.scene, slip_at), setup.numerics, setup.watch).history
    return float(np.nanmax(np.abs(CASE.observe(params, setup, history).series["unbalance"][1])))


def test_errors_of_rolling_fall_with_overlap_and_step(run_cell: Judge) -> None:
    """Order 1 in the overlap of the weight, less the logarithm of the chord's middle; order 2 in the step, 1 with slip of its end.

    Slip of the middle of the step is the midpoint rule in leap-frog, whose error is even in the step: what the step adds to the overlap's
    error, seen in differences of three steps, falls by four with half the step. The normal of the step's end adds ``(dt/2) r' phi' dt``.
    """
    fine = 0.005 / 400
    for kind in (SQUARE, {"grain": "ellipse", "contact_dt": fine}):
        soft, stiff = (errors(run_cell, {**kind, "kn": kn}) for kn in (1e5, 1e6))
        assert np.log10(soft / stiff) == pytest.approx(1.0, abs=0.2), kind
    for slip_at, order in (("middle", 2.0), ("end", 1.0)):
        found = [unbalance(slip_at, many * fine) for many in (4.0, 2.0, 1.0)]
        assert np.log2((found[0] - found[1]) / (found[1] - found[2])) == pytest.approx(order, abs=0.1), slip_at


def test_defects_of_rolling_are_seen(judge_history: Judge) -> None:
    """One part in a thousand of the inertia, friction that is too small, a dashpot's worth of damping, a disk that is a ring."""
    above = {"steepness": 1.05}

    def turning(factor: float, body: int) -> Callable[[Scene], Scene]:
        def change(scene: Scene) -> Scene:
            inertia = scene.disks.inertia.copy()
            inertia[body] *= factor
            return scene.replace(disks=replace(scene.disks, inertia=inertia))

        return change

    assert {"unbalance"} <= found(judge_history, above, turning(1.001, 0)) <= {"unbalance", "t_half"}
    assert found(judge_history, above, turning(1.001, 1)) == {"x_disk"}
    assert {"unbalance", "x_disk"} <= found(judge_history, above, lambda scene: scene.replace(xi=1e-3))

    def slippery(scene: Scene) -> Scene:
        walls = tuple(replace(wall, law=replace(wall.law, mu=0.4)) for wall in scene.walls)
        return scene.replace(walls=walls, initial_shear={})

    assert "unbalance" in found(judge_history, above, slippery)


def test_defects_of_rest_are_seen(judge_history: Judge) -> None:
    """Corners rounder by half, a slope that tips, a stiffness off by a millionth."""

    def rounder(scene: Scene) -> Scene:
        return scene.replace(outlines=(regular_polygon(6, APOTHEM, roundness=0.16),))

    def steeper(scene: Scene) -> Scene:
        return scene.replace(gravity=(1.15 * scene.gravity[0], scene.gravity[1]))

    def softer(scene: Scene) -> Scene:
        walls = tuple(replace(wall, law=replace(wall.law, kn=wall.law.kn * (1.0 - 1e-6))) for wall in scene.walls)
        return scene.replace(walls=walls)

    assert {"rolls", "turned"} <= found(judge_history, {}, rounder)
    assert {"rolls", "turned"} <= found(judge_history, {}, steeper)
    assert "turned" in found(judge_history, {}, softer)
    assert {"rolls"} <= found(judge_history, {"grain": "ellipse"}, steeper)


def test_slopes_at_the_threshold_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"steepness = 1\.01.*at most 0\.98"):
        CASE.build(resolve(CASE, {"steepness": 1.01}).params)
    with pytest.raises(ParameterError, match=r"rolling over half a face .* is over at 1\.12"):
        CASE.build(resolve(CASE, {"steepness": 1.05, "duration": 0.5}).params)


def test_crossing_time_is_exact_for_a_cubic() -> None:
    t = np.linspace(0.0, 1.0, 11)
    assert crossing_time(t, t**3, 3.0 * t**2, 0.2) == pytest.approx(0.2 ** (1.0 / 3.0), rel=1e-12)
    assert math.isnan(crossing_time(t, t**3, 3.0 * t**2, 2.0))
