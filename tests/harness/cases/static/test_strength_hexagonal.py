"""Rowe's cell: engines with and without springs, the stress ratio, friction that is missing or has the wrong sign."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.static.strength_hexagonal import CASE
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.references.analytic.assembly.wedge import wedge

PARTS, CLOSES = {"speed": 0.01}, {"speed": -0.01}
CELL = {"g": 10.0, "mass": 1.0, "chord": 1.0, "half_width": 0.57}


def test_friction_holds_the_cell_together_and_resists_its_closing(run_cell):
    tilt, phi = math.radians(35.0), math.atan(0.3)
    for params, sign in ((PARTS, -1.0), (CLOSES, 1.0)):
        for engine in (DEM, PYMUNK):
            wall = run_cell(CASE, engine, params).observed.scalars["fn_wall_mean"][1]
            assert wall == pytest.approx(5.0 * math.tan(tilt + sign * phi), rel=0.04)


def test_a_contact_that_hops_reports_the_impulse_of_its_last_touch(run_cell):
    """Chipmunk would add up the impulses of all touches since the contact began."""
    cell = run_cell(CASE, PYMUNK, PARTS)
    assert float(np.nanmax(cell.observed.series["fn_side"][1])) < 12.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.fn[:, 2:4].__imul__(1.05), {"fn_wall_mean"}),
        (lambda h: h.fn[:, 0:2].__imul__(1.05), {"fn_side_mean", "mobilised"}),
        (lambda h: h.fs.__imul__(1.001), {"mobilised"}),
        (lambda h: h.x[:, 2, 1].__iadd__(1e-3 * h.t), {"y"}),
        (lambda h: h.fn[-1:].__imul__(np.nan), {"fn_wall_mean", "fn_floor_mean"}),
    ],
    ids=["wall", "side", "friction", "way", "missing"],
)
def test_defects_are_seen(run_cell, spoil, seen):
    for engine in (DEM, PYMUNK):
        assert seen <= run_cell(CASE, engine, PARTS, spoil).seen, engine.id


def test_smooth_disks_give_the_ratio_of_statics_and_rowe_s_with_friction():
    smooth = wedge(0.0, mu=0.0, speed=1e-9, **CELL)
    assert float(smooth.wall) == pytest.approx(5.0 * math.tan(math.asin(0.57)))
    rough = wedge(0.0, mu=0.4, speed=1e-9, **CELL)
    beta = 0.5 * math.pi - math.asin(0.57)
    assert 5.0 / float(rough.wall) == pytest.approx(math.tan(math.atan(0.4) + beta))


def test_power_is_lost_to_friction_alone():
    """Gravity's and the walls' power, the growth of kinetic energy, and friction times slip balance at a speed that matters."""
    for speed in (0.5, -0.5):
        t, h = 0.02, 1e-5
        now, later = wedge([t, t + h], mu=0.3, speed=speed, **CELL), wedge(t, mu=0.3, speed=speed, **CELL)
        vy = float(later.vy)
        slip = abs(speed) / math.cos(float(later.angle))
        kinetic = 0.5 * (now.vy[1] ** 2 - now.vy[0] ** 2) / h
        given = -10.0 * vy - 2.0 * float(later.wall) * speed
        assert given == pytest.approx(kinetic + 2.0 * 0.3 * float(later.side) * slip, rel=1e-3)


def test_cells_that_hold_or_fall_apart_are_refused():
    with pytest.raises(ParameterError, match="would hold"):
        CASE.build(resolve(CASE, {"mu": 0.8}).params)
    with pytest.raises(ParameterError, match="falls through"):
        CASE.build(resolve(CASE, {"speed": 0.1, "steps": 9000}).params)
