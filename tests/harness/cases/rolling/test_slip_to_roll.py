"""Slip to roll: verdicts on engines, end of slip, the springs' overshoot, defects that must be seen."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.rolling.slip_to_roll import CASE
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK


@pytest.mark.parametrize(("dt", "onset"), [(0.01, 0.12), (0.005, 0.115), (0.0025, 0.1125)])
def test_pymunk_rolls_at_two_thirds(run_cell, dt, onset):
    cell = run_cell(CASE, PYMUNK, {"dt": dt})
    values = cell.observed.scalars
    assert values["vx_final"][1] == pytest.approx(2 / 3, abs=1e-12)
    assert values["spin_final"][1] == pytest.approx(2 / 3, abs=1e-12)
    assert values["slip_end"][1] == pytest.approx(onset, abs=1e-12)
    assert cell.margin("x_final", "exact-step") < 1e-2


def test_the_springs_overshoot_fills_its_tolerance(run_cell):
    for params in ({}, {"kn": 1e6}, {"rotating": False}):
        assert 0.9 < run_cell(CASE, DEM, params).margin("vx", "analytic") <= 1.0


def test_no_phase_of_the_end_of_slip_swings_beyond_the_spring(run_cell):
    # The speed shifts the end of slip within a coarse contact step, omega dt = 0.24; the samples see every contact step.
    for speed in 1.0 + np.linspace(0.0, 2.25e-4, 8, endpoint=False):
        params = {"speed": speed, "dt": 2.5e-5, "contact_dt": 2.5e-5, "duration": 0.115}
        assert run_cell(CASE, DEM, params).margin("vx", "analytic") <= 1.0


def test_the_overshoot_falls_with_the_square_root_of_the_shear_stiffness(run_cell):
    swings = []
    for ks in (1e6, 1e8):
        cell = run_cell(CASE, DEM, {"kn": 1e8, "ks": ks})
        vx = cell.observed.series["vx"][1][cell.observed.t > 0.2]
        swings.append(np.ptp(vx))
        assert cell.failures == []
    assert swings[0] / swings[1] == pytest.approx(10.0, rel=0.1)


def test_a_disk_that_cannot_turn_stops(run_cell):
    for engine in (PYMUNK, DEM):
        values = run_cell(CASE, engine, {"rotating": False}).observed.scalars
        assert values["spin_final"][1] == 0.0
        assert values["slip_end"][1] == pytest.approx(0.34, abs=1e-12)


@pytest.mark.parametrize("engine", [PYMUNK, DEM], ids=lambda engine: engine.id)
def test_a_dilated_start_ends_at_the_same_rolling_speed(run_cell, engine):
    cell = run_cell(CASE, engine, {"start": "dilated"})
    assert cell.failures == []
    assert {check.quantity for check in cell.checks} == {"vx_final", "spin_final", "slip_final"}
    assert cell.observed.series["gap"][1][0] == pytest.approx(0.3 * 0.01)


def test_a_slip_that_never_ends_is_no_number(run_cell):
    cell = run_cell(CASE, PYMUNK, {"duration": 0.05})
    assert np.isnan(cell.observed.scalars["slip_end"][1])
    assert any(text.startswith("slip_end") for text in cell.failures)


def test_wrong_friction_is_seen(run_cell):
    names = run_cell(CASE, PYMUNK, {}, law={"mu": 0.225}).seen
    assert {"vx", "x", "spin", "slip_end"} <= names
    assert "vx_final" not in names


@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.omega.__imul__(-1.0), {"spin", "spin_final", "slip_end"}),
        (lambda h: h.v.__imul__(1 + 1e-10), {"vx", "vx_final"}),
        (lambda h: h.omega.__imul__(0.8), {"spin_final", "slip_final"}),
        (lambda h: h.x.__setitem__((..., 0), h.x[..., 0] * (1 + 1e-9)), {"x_final"}),
        (lambda h: h.gap.__iadd__(1e-11), {"gap"}),
        (lambda h: h.omega.__setitem__((..., 0), np.nan), {"spin", "slip_end"}),
    ],
    ids=["sense", "speed", "sphere", "position", "gap", "missing"],
)
def test_defects_are_seen(run_cell, spoil, seen):
    assert seen <= run_cell(CASE, PYMUNK, {}, spoil).seen


def test_a_plane_too_soft_to_carry_the_disk_is_refused():
    with pytest.raises(ParameterError, match="kn = 20 N/m"):
        CASE.build(resolve(CASE, {"kn": 20}).params)


def test_durations_shorter_than_a_step():
    fast = {"mu": 1.5, "g": 30.0, "speed": 0.2, "dt": 0.016}
    assert CASE.build(resolve(CASE, fast).params).numerics.n_steps == 1
    with pytest.raises(ParameterError, match=r"duration = 0\.001 s"):
        CASE.build(resolve(CASE, {"duration": 0.001}).params)
