"""Hold and creep: defects of friction that must be seen, and what soft contacts and lagged friction are allowed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.incline.hold import CASE, CLEAR, RATIOS
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.harness.selftest.declared import Declared

HOLD = tuple(f"speed_{ratio:g}" for ratio in RATIOS if ratio < 1.0)
SLIDE = tuple(f"speed_{ratio:g}" for ratio in RATIOS if ratio > 1.0)


@pytest.mark.parametrize("mu", [0.05, 0.5, 2.0])
def test_no_block_reaches_a_plane_that_is_not_its_own(mu):
    scene = CASE.build(resolve(CASE, {"mu": mu}).params).scene
    gap = np.array([(scene.disks.x - wall.point) @ wall.normal - scene.disks.radius for wall in scene.walls])
    others = gap[~np.eye(len(RATIOS), dtype=bool)]
    assert np.abs(np.diag(gap)).max() < 2e-5
    assert others.min() > 0.99 * CLEAR


@pytest.mark.parametrize("engine", [DEM, CD, PYMUNK, Declared("soft")], ids=lambda engine: engine.id)
@pytest.mark.parametrize(
    ("law", "names"),
    [
        ({"mu": 0.49}, {*HOLD[-1:], "first_slip"}),  # slides at 0.99 of the tangent
        ({"mu": 0.51}, {"speed_1.01", "first_slip", "cone_largest"}),
    ],
    ids=["less", "more"],
)
def test_two_per_cent_of_friction_are_seen(run_cell, engine, law, names):
    if engine is DEM or engine.info().contact == "soft":
        names = names - {
            "cone_largest"
        }  # the preload is that of the right friction; a softness of 1e-2 excuses as much
    assert names <= run_cell(CASE, engine, {"mass": 1.0}, law=law).seen


@pytest.mark.parametrize("mass", [0.01, 100.0])
def test_creep_of_any_speed_is_seen_and_is_no_slip(run_cell, mass):
    """A creep of 1e-7 m/s, a hundred times less than what some regularised frictions have."""

    def creep(history):
        down = np.column_stack([[wall.normal[1] for wall in scene.walls], [-wall.normal[0] for wall in scene.walls]])
        history.x[:] += 1e-7 * history.t[:, None, None] * down

    scene = CASE.build(resolve(CASE, {"mass": mass}).params).scene
    for engine in (DEM, CD, PYMUNK):
        assert run_cell(CASE, engine, {"mass": mass}, creep).seen == set(HOLD)


def test_friction_beyond_the_cone_is_seen(run_cell):
    for engine in (DEM, CD, PYMUNK):
        assert run_cell(CASE, engine, {}, lambda history: history.fs[3:].__imul__(1.0 + 1e-6)).seen == {"cone_largest"}


def test_what_friction_lets_through_is_excused_and_twice_as_much_is_not(run_cell):
    """A steady creep of the size that a softness of 1e-2 represents."""
    step = 0.01
    let_through = 10.0 * 0.01 / 0.99 * step
    scene = CASE.build(resolve(CASE, {}).params).scene
    down = np.array([(wall.normal[1], -wall.normal[0]) for wall in scene.walls])
    slope = np.array([wall.normal[0] for wall in scene.walls]) * (np.arange(len(RATIOS)) >= len(SLIDE))

    def creep(part):
        def change(history):
            history.x[:] += part * let_through * history.t[:, None, None] * (slope[:, None] * down)

        return change

    soft = Declared("soft")
    assert run_cell(CASE, soft, {}, creep(0.9)).failures == []
    assert run_cell(CASE, soft, {}, creep(0.9)).known == dict.fromkeys(HOLD, f"{soft.info().id}/creeps-at-rest")
    assert run_cell(CASE, soft, {}, creep(2.0)).seen == set(HOLD)


def test_first_slip_is_the_middle_between_the_last_that_holds_and_the_first_that_slides(run_cell):
    observed = run_cell(CASE, PYMUNK, {}).observed
    assert observed.scalars["first_slip"][1] == 1.0
    a = 10.0 * (math.sin(math.atan(0.505)) - 0.5 * math.cos(math.atan(0.505)))
    assert observed.scalars["speed_1.01"][1] == pytest.approx(0.375 * a, rel=0.03)
