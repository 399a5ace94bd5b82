"""Gas of elastic disks: verdicts on engines, collisions counted, drift against the step, defects that must be seen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.impact.gas import CASE, expected_collisions
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.harness.engines.siconos.adapter import ENGINE as SICONOS
from ninedisk.harness.selftest.declared import Declared


@pytest.mark.parametrize("seed", [2, 3])
def test_other_gases_pass(run_cell, seed):
    for engine in (PYMUNK, DEM):
        assert run_cell(CASE, engine, {"seed": seed, "rows": 4, "spacing": 3.5, "duration": 2.0}).failures == []


def test_as_many_collisions_as_kinetic_theory_says(run_cell):
    params = {"dt": 2.5e-3}
    cell = run_cell(CASE, PYMUNK, params)
    v = cell.history.v
    struck = np.abs(np.diff(v, axis=0)).max(axis=2) > 1e-9
    hits = expected_collisions(cell.params, cell.setup)
    assert struck.sum() == pytest.approx(2.0 * hits.pairs + hits.walls, rel=0.3)


def test_the_springs_drift_falls_with_the_square_of_the_phase(run_cell):
    drifts = [
        np.mean(
            [
                abs(run_cell(CASE, DEM, {"phase": p, "seed": s}).observed.scalars["energy_final"][1] - 1.0)
                for s in range(6)
            ]
        )
        for p in (0.2, 0.025)
    ]
    assert 1.4 < np.log2(drifts[0] / drifts[1]) / 3.0 < 2.6


def test_newton_s_law_in_contact_dynamics_keeps_the_energy_where_contacts_join_a_step_by_others_impulses(run_cell):
    cell = run_cell(
        CASE, CD, {"impact": "newton", "duration": 1.2}
    )  # a wall throws a disk into another within step 212
    assert cell.failures == []
    assert {check.quantity for check in cell.checks} >= {"kinetic", "kinetic_final"}


def test_soft_contacts_may_lose_energy_and_gain_none(run_cell):
    params = {"rows": 4, "spacing": 3.5, "duration": 1.0}
    assert run_cell(CASE, Declared("soft"), params).failures == []
    lost = run_cell(CASE, Declared("soft"), params, lambda h: h.v[99:].__imul__(1.0 - 1e-4)).seen
    assert not {"kinetic", "energy_gain"} & lost
    assert "energy_gain" in run_cell(CASE, Declared("soft"), params, lambda h: h.v.__imul__(1.0 + 1e-9)).seen


@pytest.mark.long
@pytest.mark.skipif(not SICONOS.info().installed, reason="siconos is not installed")
def test_siconos_gains_energy_first_order_in_the_step(run_cell, judge_history):
    gains = []
    for dt in (5e-3, 1.25e-3):
        cell = run_cell(CASE, SICONOS, {"dt": dt, "duration": 2.0})
        assert cell.failures == []
        gains.append(cell.observed.scalars["kinetic_final"][1] - 1.0)
    assert 0.5 < np.log2(gains[0] / gains[1]) / 2.0 < 1.6
    other = dataclasses.replace(SICONOS.info(), differences={})
    assert "kinetic" in judge_history(CASE, other, {"dt": 1.25e-3, "duration": 2.0}, cell.history).seen


@pytest.mark.parametrize(
    ("spoil", "quantities"),
    [
        (lambda h: h.v.__imul__(np.exp(-1e-9 * h.t)[:, None, None]), {"kinetic", "kinetic_final", "momentum_jump"}),
        (lambda h: h.v[::7, 4].__iadd__(1e-9), {"momentum_jump"}),
        (lambda h: h.x.__iadd__(0.2), {"outside"}),
        (lambda h: h.omega.__iadd__(1e-9), {"spin"}),
        (lambda h: h.v.__setitem__((300, 4, 0), np.nan), {"kinetic", "momentum_jump", "angular_jump"}),
    ],
    ids=["drag", "kick", "escape", "spin", "missing"],
)
def test_defects_are_seen(run_cell, spoil, quantities):
    assert quantities <= run_cell(CASE, PYMUNK, {}, spoil).seen


def test_a_restitution_that_is_not_quite_one_is_seen(run_cell):
    assert {"kinetic", "kinetic_final"} <= run_cell(CASE, PYMUNK, {}, law={"restitution": 1.0 - 1e-9}).seen


def test_a_dashpot_is_seen(run_cell):
    assert {"energy", "energy_final"} <= run_cell(CASE, DEM, {"phase": 0.05}, law={"beta": 1e-3}).seen


def test_impossible_variants_are_refused():
    with pytest.raises(ParameterError, match="kn = 1000 N/m"):
        CASE.build(resolve(CASE, {"kn": 1000}).params)
    with pytest.raises(ParameterError, match=r"dt = 0\.1 s"):
        CASE.build(resolve(CASE, {"dt": 0.1}).params)
