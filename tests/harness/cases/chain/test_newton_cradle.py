"""Row of disks: verdicts on engines, laws that differ, order of the springs' error, defects that must be seen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.chain.newton_cradle import CASE
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.mujoco.adapter import ENGINE as MUJOCO
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK


@pytest.mark.parametrize("params", [{"n": 2}, {"n": 4, "gap": 0.01}, {"gap": 0.0, "restitution": 0.4}, {"gap": 1e-3}])
def test_other_rows_pass(run_cell, params):
    engines = (DEM, CD) if params.get("gap") == 1e-3 else (PYMUNK, DEM, CD)
    for engine in engines:
        assert run_cell(CASE, engine, params).failures == []


def test_one_row_three_laws(run_cell):
    touching = {"n": 3, "gap": 0.0}
    springs, newton = (run_cell(CASE, engine, touching).history.v[-1, :, 0] for engine in (DEM, PYMUNK))
    np.testing.assert_allclose(springs, [-0.1303, 0.1502, 0.9800], atol=2e-4)
    np.testing.assert_allclose(newton, [-1 / 3, 2 / 3, 2 / 3], atol=1e-12)
    apart = [run_cell(CASE, engine, {}).history.v[-1, :, 0] for engine in (DEM, PYMUNK)]
    np.testing.assert_allclose(apart, [[0.0, 0.0, 1.0]] * 2, atol=2e-4)


def test_each_law_fails_on_the_other_s_engine(run_cell, judge_history):
    touching = {"n": 3, "gap": 0.0}
    for ran, judged in ((DEM, PYMUNK), (PYMUNK, DEM)):
        cell = judge_history(CASE, judged.info(), touching, run_cell(CASE, ran, touching).history)
        assert {"vx_1", "vx_2", "vx_3", "handed_on"} <= cell.seen
        assert "momentum_x" not in cell.seen


@pytest.mark.skipif(not MUJOCO.info().installed, reason="mujoco is not installed")
def test_mujoco_s_impacts_are_those_of_springs(run_cell, judge_history):
    touching = {"n": 3, "gap": 0.0}
    cell = run_cell(CASE, MUJOCO, touching)
    assert cell.failures == []
    other = dataclasses.replace(MUJOCO.info(), differences={})
    assert "handed_on" in judge_history(CASE, other, touching, cell.history).seen


def test_the_springs_error_is_second_order(run_cell):
    errors = []
    for contact_dt in (4e-5, 1e-5):
        cell = run_cell(CASE, DEM, {"n": 5, "gap": 0.0, "contact_dt": contact_dt})
        assert cell.failures == []
        check = next(c for c in cell.checks if c.quantity == "vx_4_final")
        errors.append(abs(cell.observed.scalars["vx_4_final"][1] - check.expected))
    assert 1.5 < np.log2(errors[0] / errors[1]) / 2.0 < 2.5


@pytest.mark.parametrize(
    ("spoil", "quantities"),
    [
        (lambda h: h.v.__setitem__((-1, 2, 0), 1.0 - 1e-9), {"vx_3_final", "momentum_x", "handed_on"}),
        (lambda h: h.v.__setitem__((slice(-4, None), slice(None), 0), h.v[-4:, ::-1, 0]), {"vx_1", "vx_3"}),
        (lambda h: h.v.__setitem__((3, 0, 1), 1e-9), {"speed_across"}),
        (lambda h: h.v.__setitem__((-1, 0, 0), np.nan), {"vx_1_final", "energy"}),
    ],
    ids=["loss", "swapped", "sideways", "missing"],
)
def test_defects_are_seen(run_cell, spoil, quantities):
    assert quantities <= run_cell(CASE, PYMUNK, {}, spoil).seen


def test_a_run_that_ends_before_the_last_collision_is_refused():
    with pytest.raises(ParameterError, match="duration"):
        CASE.build(resolve(CASE, {"duration": 0.03}).params)
