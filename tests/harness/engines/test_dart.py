"""The DART adapter: rigid contacts up to DART's constraint force mixing, pair coefficients, signs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene, Wall, WallSegment
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError, SupportLevel, run_session
from ninedisk.harness.engines import package
from ninedisk.harness.engines.dart import adapter as adapter
from ninedisk.harness.engines.dart.adapter import ENGINE, FORCE_MIXING

G = 10.0
INFO = ENGINE.info()
needs_dart = pytest.mark.skipif(not INFO.installed, reason=f"DART: {INFO.not_installed_because}")

SOFT = 2.0 * FORCE_MIXING
"""A contact gives way by FORCE_MIXING of a step's change of velocity; the sum of two such contacts, or 1 + e of it."""


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"dart.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    """Run in this process: what is tested is the session; the process around it has tests of its own."""
    from ninedisk.harness.engines.dart.session import DartSession

    return run_session(DartSession, scene, numerics(n_steps, dt, **options), watch)


def test_facts():
    assert isinstance(ENGINE, Engine)
    assert (INFO.contact, INFO.licence) == ("soft", "BSD-2-Clause")
    assert Capability.LINEAR_CONTACT not in INFO.capabilities


def test_the_regularisation_is_said(rigid, on_plane):
    support = ENGINE.supports(on_plane(rigid(mu=0.3)), numerics(1))
    assert support.level is SupportLevel.APPROXIMATE
    assert "1e-05" in support.notes[-1]


def test_what_the_smaller_friction_cannot_express_is_refused(rigid):
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], radius=0.5, mass=2.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.2), walls=(floor,))
    support = ENGINE.supports(scene, numerics(1))
    assert support.level is SupportLevel.NO
    assert "wall 'floor' cannot have 0.5 where disks have 0.2" in support.notes[0]
    assert ENGINE.supports(scene.replace(disk_disk=rigid(mu=0.5)), numerics(1)).level is SupportLevel.APPROXIMATE


def test_what_a_product_of_factors_below_1_cannot_express_is_refused(rigid):
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], radius=0.5, mass=2.0)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(restitution=0.6))
    scene = Scene(disks=disks, disk_disk=rigid(restitution=0.25), walls=(floor,))
    support = ENGINE.supports(scene, numerics(1))
    assert support.level is SupportLevel.NO
    assert "wall 'floor' cannot have 0.6 where disks have 0.25" in support.notes[0]
    assert ENGINE.supports(scene.replace(disk_disk=rigid(restitution=0.36)), numerics(1)).level is not SupportLevel.NO


def test_a_prescribed_spin_is_refused(rigid, on_plane):
    support = ENGINE.supports(on_plane(rigid(mu=0.3), omega=1.0), numerics(1))
    assert support.level is SupportLevel.NO
    assert "disk 0 spins" in support.notes[0]
    assert ENGINE.supports(on_plane(rigid(mu=0.3), omega=1.0, rotating=True), numerics(1)).level is not SupportLevel.NO


@needs_dart
@pytest.mark.parametrize("degrees", [*range(0, 360, 45), 7.3, 111.1])
def test_a_touching_disk_is_in_contact_from_the_first_step(rigid, on_plane, degrees):
    slope, mu = 0.5, 0.3
    history = run(on_plane(rigid(mu=mu), degrees=degrees, slope=slope)).history
    down, normal = G * (math.sin(slope) - mu * math.cos(slope)), 2.0 * G * math.cos(slope)
    np.testing.assert_allclose(history.fn[1:, 0], normal, rtol=SOFT)
    np.testing.assert_allclose(history.fs[1:, 0], -mu * normal, rtol=SOFT)
    assert -SOFT * G * 0.01 < history.gap[:, 0].min() <= history.gap[:, 0].max() < 1e-12
    np.testing.assert_allclose(np.hypot(*history.v[-1, 0]), down, rtol=SOFT)


@needs_dart
@pytest.mark.parametrize("detector", ["dart", "fcl", "ode", "bullet"])
@pytest.mark.parametrize("solver", ["dantzig", "nsgs"])
def test_detectors_and_solvers_agree(rigid, on_plane, detector, solver):
    scene = on_plane(rigid(mu=0.3), slope=0.5, degrees=20.0)
    history = run(scene, collision_detector=detector, solver=solver).history
    np.testing.assert_allclose(history.v[-1], run(scene).history.v[-1], rtol=1e-6)


@needs_dart
def test_forces_follow_the_scene_s_signs_and_are_step_means(rigid, on_plane):
    history = run(on_plane(rigid(mu=0.4), v=(-1.0, 0.0)), 3).history
    assert history.force_meaning == "step-mean"
    assert np.isnan(history.fn[0, 0])
    # n points from the disk down into the wall, t = +x; the disk slides to the left, friction pushes it to the right.
    forces = history.fn[1, 0], history.fs[1, 0]
    assert forces == (pytest.approx(20.0, rel=SOFT), pytest.approx(8.0, rel=SOFT))
    np.testing.assert_allclose(history.wall_force[1, 0], [-8.0, -20.0], rtol=SOFT)
    np.testing.assert_allclose(history.v[1, 0], [-0.96, 0.0], atol=SOFT * G * 0.01)


@needs_dart
def test_each_pair_has_its_own_friction_and_restitution(rigid):
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], v=[[4.0, 0.0], [0.0, 0.0]], radius=0.5, mass=[2.0, 3.0], rotating=False)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.25))
    back = Wall(name="back", point=(3.7, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.4, restitution=0.3), walls=(floor, back), gravity=(0.0, -G))
    history = run(scene, 400, dt=0.0025, watch=((0, 1), (0, 2), (1, 2), (1, 3))).history
    speed, fall = history.v[:, :, 0], 0.25 * G * 0.0025
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    assert speed[0, 0] - speed[hit - 1, 0] == pytest.approx((hit - 1) * fall, rel=SOFT)
    parted, met = speed[hit, 1] - speed[hit, 0], speed[hit - 1, 0] - speed[hit - 1, 1]
    assert parted / met == pytest.approx(0.3, abs=0.02)  # the floor's friction over the step of the impact
    turn = int(np.flatnonzero(history.fn[:, 3] > 0)[0])
    assert -speed[turn, 1] / speed[turn - 1, 1] == pytest.approx(0.5, abs=0.02)


@needs_dart
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("height", [0.05, 0.0525])
def test_restitution_of_a_wall_wherever_in_the_step_it_is_met(rigid, on_plane, restitution, height):
    scene = on_plane(rigid(restitution=restitution), v=(0.0, -1.0), height=height, g=0.0)
    assert run(scene, 12).history.v[-1, 0, 1] == pytest.approx(restitution, abs=SOFT)


@needs_dart
def test_momentum_stays_and_the_mixing_shows(rigid):
    disks = Disks(x=[[0.0, 0.0], [2.001, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=1.0, mass=[1.0, 3.0])
    v = run(Scene(disks=disks, disk_disk=rigid(restitution=1.0)), 3).history.v[-1]
    assert v[0, 0] + 3.0 * v[1, 0] == pytest.approx(1.0, abs=1e-14)
    lost = 1.0 - (v[1, 0] - v[0, 0])
    assert lost == pytest.approx(SOFT, rel=1e-3)  # (1 + e) of it: were DART to change it, FORCE_MIXING would be wrong


@needs_dart
def test_split_impulses_leave_no_momentum_behind(rigid, on_plane, monkeypatch):
    import dartpy

    scene = on_plane(rigid(), v=(0.0, -1.0), height=0.0525, g=0.0)
    assert abs(run(scene, 12).history.v[-1, 0, 1]) < SOFT
    solver = dartpy.constraint.ConstraintSolver
    monkeypatch.setattr(solver, "setSplitImpulseEnabled", lambda _self, _on: None, raising=True)
    assert run(scene, 12).history.v[-1, 0, 1] > 1e-4


@needs_dart
def test_a_stack_carries_its_weight(rigid):
    disks = Disks(x=[[0.0, 0.5], [0.0, 1.5], [0.0, 2.5]], radius=0.5, mass=[1.0, 2.0, 3.0])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.5), walls=(floor,), gravity=(0.0, -G))
    weights, watch = np.array([60.0, 50.0, 30.0]), ((0, 3), (0, 1), (1, 2))
    history = run(scene, 20, watch=watch).history
    # The first step moves the stack by the mixing, summed over three contacts of up to six times a disk's weight each.
    np.testing.assert_allclose(history.fn[1], weights, rtol=18 * FORCE_MIXING)
    np.testing.assert_allclose(history.fn[-1], weights, rtol=1e-9)
    dantzig = run(scene, 20, watch=watch, solver="dantzig").history
    assert abs(dantzig.fn[1, 0] - 60.0) > 0.5  # why it is not the default
    np.testing.assert_allclose(dantzig.fn[-1], weights, rtol=1e-6)


@needs_dart
def test_moving_and_turning_walls_carry_the_disk(rigid, on_plane):
    motion = (
        WallSegment(duration=0.25, velocity=(0.3, 0.2)),
        WallSegment(duration=0.25, amplitude=(0.0, 0.05), frequency=3.0),
    )
    history = run(on_plane(rigid(mu=2.0), motion=motion), 60).history
    np.testing.assert_allclose(history.wall_point[-1, 0], [0.075, 0.05 + 0.05 * math.sin(0.75)], atol=1e-14)
    np.testing.assert_allclose(history.v[2:25, 0], [[0.3, 0.2]] * 23, atol=SOFT)
    motion = (WallSegment(angular_velocity=0.5, pivot=(-1.0, 0.0)),)
    history = run(on_plane(rigid(mu=2.0), motion=motion), 40).history
    # Velocity-level contacts leave the second-order drift of a straight step along a circle: omega^2 r dt^2/2 a step.
    assert np.abs(history.gap[:, 0]).max() < 40 * 0.5 * (0.5 * 0.01) ** 2 * 1.5


@needs_dart
def test_a_disk_has_its_own_inertia_and_turns_on(rigid, on_plane):
    scene = on_plane(rigid(mu=0.3), v=(1.0, 0.0), rotating=True)
    assert run(scene).history.omega[-1, 0] == pytest.approx(-2.0 / 3.0 / 0.5, rel=SOFT)  # a sphere would roll at 5/7
    free = run(on_plane(rigid(), height=1.0, g=0.0, rotating=True, omega=40.0)).history
    np.testing.assert_allclose(free.angle[-1, 0], 40.0, rtol=1e-12)


@needs_dart
def test_nothing_falls_asleep(rigid, on_plane):
    history = run(on_plane(rigid(mu=0.4), slope=math.radians(20.0)), 300).history
    np.testing.assert_allclose(history.fn[1:, 0], 20.0 * math.cos(math.radians(20.0)), rtol=SOFT)
    assert np.all(history.v[1:, 0, 0] > 0.0)  # the creep of the mixing goes on


@needs_dart
def test_settings_are_recorded_and_runs_repeat_to_the_bit(rigid, on_plane):
    scene = on_plane(rigid(mu=0.3), slope=0.5, degrees=33.0)
    one, two = (run(scene, 50) for _ in range(2))
    wanted = {"solver": "nsgs", "collision_detector": "dart", "split_impulse": True, "deactivation": False}
    assert {f"dart.{name}": value for name, value in wanted.items()}.items() <= one.settings.items()
    np.testing.assert_array_equal(one.history.x, two.history.x)


@needs_dart
@pytest.mark.parametrize(
    ("option", "words"),
    [({"solver": "lemke"}, "use one of nsgs, dantzig"), ({"cfm": 0.0}, "'dart.cfm' is unknown")],
)
def test_bad_settings_are_refused_before_a_process_starts(rigid, on_plane, option, words):
    with pytest.raises(InvalidNumericsError, match=words):
        ENGINE.run(on_plane(rigid()), numerics(1, **option), [])


@needs_dart
def test_a_state_that_is_no_longer_finite_is_an_error(rigid, on_plane, monkeypatch):
    from ninedisk.harness.engines.dart.session import DartSession

    monkeypatch.setattr(DartSession, "advance", lambda self, _n: self.disks[0].setVelocities([math.nan, 0.0]))
    with pytest.raises(EngineError, match="no longer finite"):
        run(on_plane(rigid()), 2)


def test_without_dartpy_the_adapter_says_how_to_get_it(rigid, on_plane, monkeypatch):
    monkeypatch.setattr(package, "package_version", lambda name: (None, f"no {name}"))
    assert not ENGINE.info().installed
    with pytest.raises(EngineNotInstalledError, match="pip install dartpy"):
        ENGINE.run(on_plane(rigid()), numerics(1), [])


@needs_dart
@pytest.mark.parametrize(
    ("kind", "e"), [({"kind": "elastic"}, 1.0), ({"kind": "plastic"}, 0.0), ({"restitution": 0.5}, 0.5)]
)
def test_collisions(kind, e):
    result = run_case("binary-collision", engine="dart", params=kind)
    assert result.status == "pass"
    assert result.observed.scalars["restitution_effective"][1] == pytest.approx(e, abs=SOFT)


@needs_dart
@pytest.mark.parametrize("dt", [0.01, 0.0025])
def test_the_incline_is_that_of_semi_implicit_euler(dt):
    result = run_case("incline-block", engine="dart", params={"mu": 0.36, "dt": dt})
    assert set(result.measurements.status) <= {"pass", "known-gap"}
    scalars, gravity = result.observed.scalars, 10.0
    assert scalars["vx_final"][1] == pytest.approx(3.730799842741606e-2, abs=FORCE_MIXING * gravity * dt)
    assert scalars["x_final"][1] == pytest.approx(1.865399921370803e-2 * (1.0 + dt), abs=FORCE_MIXING * gravity * dt)
    stuck = run_case("incline-block", engine="dart", params={"mu": 0.4, "dt": dt})
    assert stuck.status == "pass"
    assert stuck.observed.scalars["creep_rate"][1] == pytest.approx(FORCE_MIXING * gravity * dt * 0.342, rel=1e-2)


@needs_dart
@pytest.mark.parametrize(("dt", "onset"), [(0.01, 0.12), (0.005, 0.115), (0.0025, 0.1125)])
def test_slip_ends_in_the_right_step(dt, onset):
    result = run_case("slip-to-roll", engine="dart", params={"mu": 0.3, "dt": dt})
    assert result.status == "pass"
    assert result.observed.scalars["slip_end"][1] == pytest.approx(onset, abs=1e-12)
    assert result.observed.scalars["vx_final"][1] == pytest.approx(2.0 / 3.0, rel=SOFT)
