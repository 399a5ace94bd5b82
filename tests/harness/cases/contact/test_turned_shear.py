"""Contacts that stick and turn: the DEM's order, and what a force that turns otherwise is off by."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.harness.api.engine import Difference
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.cases.contact.turned_shear import KS, LOADED, RADIUS
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM

CASE = get_case("spheres/turned")


@pytest.mark.parametrize(("kind", "ratio"), [("passed", 4.0), ("spun", 4.0)])
def test_the_error_falls_with_the_order_of_the_scheme(run_cell: Any, kind: str, ratio: float) -> None:
    """Second order, also where slip feeds a spring that twists."""
    errors = []
    for steps in (1000, 2000):
        cell = run_cell(CASE, DEM, {"kind": kind, "steps": steps})
        assert cell.failures == []
        errors.append(cell.observed.scalars["astray"][1])
    assert errors[0] / errors[1] == pytest.approx(ratio, rel=0.01)


def test_slip_of_the_end_does_not_twist(run_cell: Any) -> None:
    """That form turns springs with the normal alone: right about an axis across it, and a force that stays behind about another."""
    assert run_cell(CASE, DEM, {"kind": "plane"}, law={"slip_at": "end"}).failures == []
    cell = run_cell(CASE, DEM, {"kind": "plane", "axis": "skew"}, law={"slip_at": "end"})
    assert cell.failures
    # The mean spin about the normal is two thirds of it: 4 pi/3 behind after a turn, a chord of root three.
    assert cell.observed.scalars["astray"][1] == pytest.approx(np.sqrt(3.0), abs=0.06)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["plane", "spun", "passed"])
def test_a_force_that_keeps_its_direction_is_known_and_twice_its_opposite_is_not(
    judge_history: Any, run_cell: Any, kind: str
) -> None:
    """Slip summed along fixed axes by the rule of mid-points, a hundred in each sample."""
    cell = run_cell(CASE, DEM, {"kind": kind})
    spheres, dt = cell.setup.scene.spheres, float(cell.history.t[1]) / 100.0
    spring, kept = np.zeros(3), [np.zeros(3)]
    for k in range(100 * (len(cell.history.t) - 1)):
        t = (k + 0.5) * dt
        if kind == "plane":
            n, v, spin = np.array([0.0, 0.0, -1.0]), np.zeros(3), spheres.omega[0] * (t < LOADED)
        else:
            n, v = spheres.x[1] - spheres.x[0] + t * (spheres.v[1] - spheres.v[0]), spheres.v[1] - spheres.v[0]
            n, spin = n / np.linalg.norm(n), spheres.omega.sum(axis=0)
        spring = spring + dt * (v - (v @ n) * n - RADIUS * np.cross(spin, n))
        if (k + 1) % 100 == 0:
            kept.append(spring)
    frames = CASE._truth(cell.params, cell.setup, cell.history.t)[1]
    flat = np.einsum("sj,skj,ski->si", np.array(kept), frames, frames)  # across the normal
    info = replace(DEM.info(), differences={Difference.SHEAR_KEEPS_DIRECTION: "as told"})
    for size, known in ((1.0, True), (-2.0, False)):
        shear = cell.history.fs.copy()
        shear[:, 0] = KS * size * flat
        judged = judge_history(CASE, info, {"kind": kind}, replace(cell.history, fs=shear), cell.setup)
        assert (judged.failures == []) is known
        assert judge_history(CASE, DEM.info(), {"kind": kind}, replace(cell.history, fs=shear), cell.setup).failures
