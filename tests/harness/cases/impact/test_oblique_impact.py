"""Oblique impact: verdicts on engines, sharpness and order of the tolerances, defects that must be seen."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.impact.oblique import CASE
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK


@pytest.mark.parametrize(
    "params", [{"vt": 3.0}, {"vt": 0.2}, {"vt": 1.0}, {"vt": -0.4, "spin": 1.5, "restitution": 0.3}]
)
@pytest.mark.parametrize("engine", [PYMUNK, DEM], ids=lambda engine: engine.id)
def test_other_angles_and_spins_pass(run_cell, engine, params):
    assert run_cell(CASE, engine, params).failures == []


@pytest.mark.parametrize("gap", [2e-3, 2.3e-3, 2.7e-3])
@pytest.mark.parametrize(
    "params",
    [{"vt": 3.0}, {"vt": 0.3, "restitution": 0.5}, {"impact": "newton"}, {"impact": "newton", "sliding": "coulomb"}],
)
def test_contact_dynamics_meets_its_exact_steps_at_any_phase(run_cell, params, gap):
    cell = run_cell(CASE, CD, {**params, "gap": gap})
    assert cell.failures == []
    assert {check.truth for check in cell.checks} >= {"exact-step"}


def test_a_sliding_impact_has_the_ratio_mu(run_cell):
    for engine in (PYMUNK, DEM):
        assert run_cell(CASE, engine, {}).observed.scalars["impulse_ratio"][1] == pytest.approx(0.3, abs=1e-9)


def test_springs_reverse_the_slip_where_rigid_disks_stop_it(run_cell):
    rigid, springs = (run_cell(CASE, engine, {"vt": 0.3}).observed.scalars["slip_final"][1] for engine in (PYMUNK, DEM))
    assert abs(rigid) < 1e-14
    assert springs < -0.1


def test_what_the_shear_spring_adds_falls_with_the_step(run_cell):
    """The stretch at touch is first order; phases are averaged over, for the error of one impact jumps with them."""
    means = []
    for contact_dt in (4e-6, 2e-6, 1e-6):
        errors = []
        for phase in np.linspace(0.0, 1.0, 5, endpoint=False):
            cell = run_cell(CASE, DEM, {"vt": 0.1, "contact_dt": contact_dt, "gap": 2e-3 + phase * contact_dt})
            assert cell.failures == []
            check = next(c for c in cell.checks if c.quantity == "vx_final")
            errors.append(abs(cell.observed.scalars["vx_final"][1] - check.expected))
        means.append(np.mean(errors))
    assert 0.6 < np.log2(means[0] / means[2]) / 2.0 < 1.6


def test_the_tolerance_is_the_error_s_own_bound(run_cell):
    margins = [
        run_cell(CASE, DEM, {"vt": 0.1, "gap": 2e-3 + phase * 2e-6, "contact_dt": 2e-6}).margin("vx_final", "analytic")
        for phase in np.linspace(0.0, 1.0, 6, endpoint=False)
    ]
    assert 0.1 < max(margins) <= 1.0


def test_wrong_laws_are_seen(run_cell):
    assert {"vx_final", "spin_final", "impulse_ratio"} <= run_cell(CASE, PYMUNK, {}, law={"mu": 0.2999}).seen
    assert {"vy_final", "restitution_effective", "vx_final"} <= run_cell(
        CASE, PYMUNK, {}, law={"restitution": 0.999}
    ).seen


def test_a_sphere_s_inertia_is_seen(run_cell):
    def heavier(history):
        history.omega[:] *= 1.25

    assert {"spin", "slip"} <= run_cell(CASE, DEM, {"vt": 0.3}, heavier).seen


@pytest.mark.parametrize(
    ("spoil", "quantities"),
    [
        (
            lambda h: h.v.__setitem__((slice(-3, None), 0, 1), h.v[-3:, 0, 1] * (1 + 1e-11)),
            {"vy", "restitution_effective"},
        ),
        (lambda h: h.omega.__imul__(-1.0), {"spin", "slip"}),
        (lambda h: h.v.__setitem__((0, 0, 0), 3.1), {"vx", "energy"}),
        (lambda h: h.v.__setitem__((-1, 0, 0), np.nan), {"vx_final", "impulse_ratio"}),
    ],
    ids=["restitution", "sense", "before", "missing"],
)
def test_defects_are_seen(run_cell, spoil, quantities):
    assert quantities <= run_cell(CASE, PYMUNK, {}, spoil).seen


def test_exact_steps_see_a_part_in_1e9(run_cell):
    def off(history):
        history.v[-1, 0, 0] *= 1 + 1e-9

    assert "vx" in run_cell(CASE, CD, {}, off).seen


GRAZING = {"vt": 28.64}


@pytest.mark.parametrize("engine", [PYMUNK, DEM, CD], ids=lambda engine: engine.id)
def test_energy_that_grows_at_grazing_angles_is_seen(run_cell, engine):
    def gain(history):
        history.v[-3:, 0, 0] = 28.64 * (1.0 + 1e-4)

    assert {"energy_gain", "tangential_restitution"} <= run_cell(CASE, engine, GRAZING, gain).seen
    assert "rebound_spin" in run_cell(CASE, engine, GRAZING, lambda h: h.omega[-3:].__imul__(1.01)).seen


def test_a_start_at_another_angle_is_seen(run_cell):
    assert "incidence" in run_cell(CASE, PYMUNK, GRAZING, lambda h: h.v[0].__imul__((1.0 + 1e-9, 1.0))).seen


def test_disks_that_slide_through_lie_on_thornton_s_curve(run_cell):
    """1 - 2/x and twice: for spheres 1 - 2/x and 5/2, from 7 on in place of 6."""
    for vt in (1.81, 11.43):
        for engine in (PYMUNK, DEM):
            reported = {name: value for name, (_, value) in run_cell(CASE, engine, {"vt": vt}).observed.scalars.items()}
            assert reported["incidence"] == pytest.approx(vt / 0.3)
            assert reported["tangential_restitution"] == pytest.approx(1.0 - 2.0 / reported["incidence"], abs=2e-3)
            assert reported["rebound_spin"] == pytest.approx(2.0, abs=1e-2)


def test_impossible_variants_are_refused():
    with pytest.raises(ParameterError, match="kn = 2 N/m"):
        CASE.build(resolve(CASE, {"kn": 2}).params)
    with pytest.raises(ParameterError, match="duration"):
        CASE.build(resolve(CASE, {"duration": 0.002}).params)
