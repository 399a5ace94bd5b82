"""What engines say of themselves (precision, softness, dilation, scheme) decides tolerances; each is seen to fail on a defect."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ninedisk.core.simulate import simulate
from ninedisk.harness.api.engine import SOFTEST, SupportLevel
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case, get_engine
from ninedisk.harness.api.support import NOTE_SLIP_END
from ninedisk.harness.cases.common import contact_softness, single, slack_time, with_slop
from ninedisk.harness.cases.differences import follows_associated_rule
from ninedisk.harness.cases.impact.binary import CASE as COLLISION
from ninedisk.harness.cases.incline.block import CASE as INCLINE
from ninedisk.harness.cases.nine_disk.compression import CASE as COMPRESSION
from ninedisk.harness.cases.nine_disk.distortion import CASE as DISTORTION
from ninedisk.harness.cases.rolling.slip_to_roll import CASE as ROLLING
from ninedisk.harness.cases.sliding.dynamic import CASE as SLIDING
from ninedisk.harness.engines.box2d.adapter import ENGINE as BOX2D
from ninedisk.harness.engines.dart.adapter import ENGINE as DART
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.drake.adapter import ENGINES as DRAKES
from ninedisk.harness.engines.lammps.adapter import ENGINE as LAMMPS
from ninedisk.harness.engines.mujoco.adapter import ENGINE as MUJOCO
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.harness.engines.siconos.adapter import ENGINE as SICONOS
from ninedisk.harness.engines.yade.adapter import ENGINE as YADE
from ninedisk.harness.selftest.panel import RIGID_PANEL

DRAKE, SAP, LAGGED = DRAKES


def needs(engine):
    return pytest.mark.skipif(not engine.info().installed, reason=f"{engine.id} is not installed")


def test_round_off_of_single_precision(scheme_info):
    double = scheme_info("semi-implicit-euler", "impulse")
    half = dataclasses.replace(double, precision="float32")
    assert single(double, 1.0, 100) == 0.0
    unit = float(np.spacing(np.float32(1.0)))
    assert single(half, 1.0, 100) == 50.0 * unit
    assert single(half, -1.0, 1) == 4.0 * unit  # eight roundings at least


def test_softness_acts_for_a_step(scheme_info):
    known = dataclasses.replace(scheme_info("some", "soft"), softness=1e-3, softness_why="measured")
    v = 0.0
    for _ in range(9):
        v = contact_softness(known) * (v + 10.0 * 0.01)
    assert v == pytest.approx(10.0 * slack_time(known, 0.01), rel=1e-12)
    assert contact_softness(scheme_info("some", "impulse")) == 0.0


@pytest.mark.parametrize("name", RIGID_PANEL)
def test_silence_allows_what_the_softest_may_state_and_flight_nothing(scheme_info, judge_history, name):
    """Whatever a check's tolerance, it grows with the softness that is stated, and silence is no way around it."""
    silent = scheme_info("some", "soft")
    case, params = get_case(RIGID_PANEL[name].case), RIGID_PANEL[name].params

    def tolerances(softness):
        info = dataclasses.replace(silent, softness=softness)
        cell = judge_history(case, info, params, None)
        assert len({(c.quantity, c.norm, c.truth) for c in cell.checks}) == len(cell.checks)
        return {(c.quantity, c.truth): c.atol for c in cell.checks}

    none, least, less, most = (tolerances(each) for each in (None, 0.0, 1e-3, SOFTEST))
    assert none == most
    assert all(least[key] <= less[key] <= most[key] for key in none)
    in_flight = {"drift_in_flight", "momentum_x", "partner_x", "wall_place"}
    assert all(least[key] == most[key] for key in none if key[0] in in_flight)


@pytest.mark.parametrize("softness", [1.0, 0.011, -1e-9, math.nan])
def test_a_softness_that_cannot_be_is_refused(scheme_info, softness):
    with pytest.raises(ValueError, match=f"softness = {softness!r} is not allowed: it must lie between 0 and 0.01"):
        dataclasses.replace(scheme_info("some", "soft"), softness=softness)
    with pytest.raises(ValueError, match="not allowed where contact is 'impulse'"):
        dataclasses.replace(scheme_info("some", "impulse"), softness=1e-3)


@pytest.mark.parametrize("name", ["roll", "slide", "stick", "bounce"])
def test_slop_loosens_gaps_and_heights_alone(scheme_info, judge_history, name):
    """An engine that leaves overlaps of 75 micrometres and states it is not held to round-off in gaps; nothing else changes."""
    exact = scheme_info("semi-implicit-euler", "impulse")
    case, params = get_case(RIGID_PANEL[name].case), RIGID_PANEL[name].params
    before = judge_history(case, exact, params, None)
    after = with_slop(before.checks, before.observed, dataclasses.replace(exact, slop=7.5e-5))
    grown = {old.quantity for old, new in zip(before.checks, after, strict=True) if new.atol != old.atol}
    assert any(each.startswith(("gap", "apex")) for each in grown)
    assert all(
        new.atol - old.atol == pytest.approx(7.5e-5, rel=1e-6)
        for old, new in zip(before.checks, after, strict=True)
        if old.quantity in grown
    )
    assert not {each for each in grown if each.startswith(("x", "v", "fn", "fs", "spin", "energy"))}


@pytest.mark.parametrize(
    ("contact", "slop"), [("impulse", 0.011), ("impulse", -1e-9), ("impulse", math.nan), ("spring", 1e-4)]
)
def test_a_slop_that_cannot_be_is_refused(scheme_info, contact, slop):
    with pytest.raises(ValueError, match=r"slop = .* is not allowed"):
        dataclasses.replace(scheme_info("some", contact), slop=slop)


def test_who_follows_the_associated_rule(scheme_info):
    numerics = INCLINE.build(resolve(INCLINE, {}).params).numerics
    coulomb = numerics.replace(sliding="coulomb")
    theta = scheme_info("theta", "cd")
    assert follows_associated_rule(theta, numerics)
    assert not follows_associated_rule(theta, coulomb)
    assert not follows_associated_rule(scheme_info("some", "soft"), numerics)
    assert follows_associated_rule(dataclasses.replace(scheme_info("some", "soft"), dilates=True), coulomb)


@needs(BOX2D)
@pytest.mark.parametrize("case", [COLLISION, INCLINE, ROLLING, SLIDING], ids=lambda case: case.id)
def test_single_precision_passes_and_a_wrong_velocity_does_not(run_cell, case):
    assert run_cell(case, BOX2D, {}).failures == []

    def one_percent(history):
        history.v[1:] *= 1.01

    assert {"vx", "momentum_x"} & run_cell(case, BOX2D, {}, one_percent).seen


@needs(DART)
def test_a_creep_of_microns_a_second_is_seen(run_cell):
    def creep(history):
        history.v[:, 0, 0] += 5e-6
        history.x[:, 0, 0] += 5e-6 * history.t

    assert run_cell(INCLINE, DART, {"mu": 0.4}).failures == []
    assert {"x", "vx", "creep_rate"} <= run_cell(INCLINE, DART, {"mu": 0.4}, creep).seen


@needs(DART)
def test_an_impact_that_misses_a_ten_thousandth_is_seen(run_cell):
    def weak(history):
        history.v[-1, :, 0] += (1e-4, -1e-4)

    assert run_cell(COLLISION, DART, {}).failures == []
    assert "restitution_effective" in run_cell(COLLISION, DART, {}, weak).seen


@needs(MUJOCO)
def test_friction_that_is_one_percent_off_is_seen(run_cell):
    def slippery(history):
        gain = 0.01 * 0.36 * 10.0 * math.cos(math.radians(20.0))
        history.v[:, 0, 0] += gain * history.t
        history.x[:, 0, 0] += 0.5 * gain * history.t**2

    assert run_cell(INCLINE, MUJOCO, {"mu": 0.36}).failures == []
    assert {"x", "vx", "vx_final"} <= run_cell(INCLINE, MUJOCO, {"mu": 0.36}, slippery).seen


@needs(SAP)
def test_a_convex_engine_has_to_dilate(run_cell):
    def flat(history):
        history.gap[:] = np.minimum(history.gap, 0.0)

    cell = run_cell(INCLINE, SAP, {"mu": 0.36})
    assert cell.failures == []
    quantities = {check.quantity for check in cell.checks}
    assert {"fn_mean", "fs_mean", "dilation_peak"} <= quantities
    assert "dilation" not in quantities
    assert cell.known["fn"] == "drake-sap/sliding-lifts"  # forces swing from nothing to twice the weight
    assert "dilation_peak" in run_cell(INCLINE, SAP, {"mu": 0.36}, flat).seen
    touching = run_cell(SLIDING, SAP, {"g0": 0.0})
    assert touching.failures == []
    assert touching.observed.scalars["du_y_1"][1] == pytest.approx(0.3 * 0.01 / (1.0 + 0.3**2), rel=2e-3)


@needs(SAP)
def test_means_of_forces_see_a_wrong_weight(run_cell):
    def heavy(history):
        history.fn[:] *= 1.05

    assert "fn_mean" in run_cell(INCLINE, SAP, {"mu": 0.36}, heavy).seen


@needs(LAGGED)
def test_friction_that_lags_costs_the_first_step_of_a_start_without_load_only(run_cell):
    assert run_cell(INCLINE, LAGGED, {"mu": 0.36, "preload": False}).failures == []

    def two_steps(history):
        history.v[:, 0, 0] += 0.36 * 10.0 * math.cos(math.radians(20.0)) * 0.01

    assert "vx" in run_cell(INCLINE, LAGGED, {"mu": 0.36, "preload": False}, two_steps).seen
    assert "vx" in run_cell(INCLINE, LAGGED, {"mu": 0.36}, two_steps).seen


def test_runge_kutta_s_bound_reports_its_step_from_the_cycle(judge_history):
    """The in-house DEM at one step a cycle is 1e-2 of the swing from the continuous solution: far beyond third order."""
    params = {"load_case": "a1", "xi": 0.0}
    setup = COMPRESSION.build(resolve(COMPRESSION, params).params)
    history = simulate(setup.scene, setup.numerics, setup.watch)
    names = judge_history(COMPRESSION, DRAKE.info(), params, history).seen
    assert {"fn_wall_mid", "fn_disk_disk_centre"} <= names


@needs(DRAKE)
def test_runge_kutta_passes_and_a_fading_swing_does_not(run_cell, judge_history):
    params = {"load_case": "a1", "xi": 0.0}
    cell = run_cell(COMPRESSION, DRAKE, params)
    assert cell.failures == []
    cell.history.fn[:] += 1e-3 * (cell.history.fn.mean(axis=0) - cell.history.fn)
    assert "fn_wall_mid" in judge_history(COMPRESSION, DRAKE.info(), params, cell.history).seen


@pytest.mark.parametrize("case", [INCLINE, ROLLING], ids=lambda case: case.id)
def test_moreau_jean_s_theta_weighs_the_positions(run_cell, judge_history, case):
    """pymunk's positions are those of theta = 0: they are no Moreau-Jean scheme's."""
    cell = run_cell(case, PYMUNK, {})
    against = judge_history(case, SICONOS.info(), {}, cell.history)
    failing = {(text.split()[0], text.split()[1]) for text in against.failures}
    assert ("x", "(exact-step):") in failing
    assert ("vx", "(exact-step):") not in failing


@needs(SICONOS)
@pytest.mark.parametrize("theta", [0.5, 0.75, 1.0])
@pytest.mark.parametrize("case", ["incline-block", "slip-to-roll"])
def test_siconos_meets_the_exact_steps_of_its_theta(case, theta):
    from ninedisk.harness import run_case

    result = run_case(case, engine="siconos", options={"siconos.theta": theta})
    exact = result.measurements[result.measurements.truth == "exact-step"]
    assert len(exact)
    assert set(exact.status) == {"pass"}


@pytest.mark.sampled(1)
@needs(LAMMPS)
@pytest.mark.parametrize(("phi", "ratio"), [(15.0, 1.0), (30.0, 2.0 / 3.0)])
def test_lammps_meets_the_core_with_its_own_lever_arm(run_cell, phi, ratio):
    params = {"phi_deg": phi, "ks_over_kn": ratio, "lever_arm": "torque-overlap-disks"}
    cell = run_cell(DISTORTION, LAMMPS, params)
    assert cell.failures == []
    consensus = [check for check in cell.checks if check.truth == "consensus"]
    assert {check.quantity for check in consensus} == {"fn_up", "fs_up", "fn_right", "fs_right"}
    assert all(check.rtol == 1e-9 for check in consensus)


def test_another_arm_is_named_in_both_directions(judge_history):
    def why(engine, arm):
        cell = judge_history(DISTORTION, engine.info(), {"lever_arm": arm}, None)
        return next(check.why for check in cell.checks if check.truth == "consensus")

    assert "asks for the lever arm R, the engine has R - overlap/2:" in why(YADE, "radius")
    assert "asks for the lever arm R - overlap/2, the engine has R or R - overlap/2 of the torque" in why(
        LAMMPS, "overlap"
    )
    assert "lever arm" not in why(LAMMPS, "radius")


@pytest.mark.parametrize(
    ("engine_id", "arm"), [("yade", "overlap"), ("lammps", "radius"), ("kratos", "radius"), ("liggghts", "radius")]
)
def test_slip_in_the_middle_of_the_step_is_the_same_physics_discretised_otherwise(engine_id, arm):
    engine = get_engine(engine_id)
    own, other = (
        engine.supports(setup.scene, setup.numerics)
        for slip_at in ("end", "middle")
        for setup in [COMPRESSION.build(resolve(COMPRESSION, {"lever_arm": arm, "slip_at": slip_at}).params)]
    )
    assert own.level is SupportLevel.EXACT
    assert (other.level, other.missing) == (SupportLevel.EQUIVALENT, ())
    assert set(other.notes) - set(own.notes) == {NOTE_SLIP_END}


def test_the_core_has_every_lever_arm():
    from ninedisk.harness.api.capabilities import LEVER_ARMS

    assert set(LEVER_ARMS.values()) <= DEM.info().capabilities
