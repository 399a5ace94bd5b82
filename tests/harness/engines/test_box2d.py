"""The Box2D adapter: units, pair coefficients, sign conventions, and single precision's round-off against exact steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError, SupportLevel, run_session
from ninedisk.harness.engines import process
from ninedisk.harness.engines.box2d.adapter import ENGINE, Box2DEngine

G = 10.0
EPS = float(np.finfo(np.float32).eps)

needs_box2d = pytest.mark.skipif(not ENGINE.info().installed, reason=f"Box2D: {ENGINE.info().not_installed_because}")


def rigid(mu=0.0, restitution=0.0) -> ContactLaw:
    return ContactLaw(kn=1e8, ks=1e8, mu=mu, restitution=restitution, regularised=True)


def on_plane(law, *, degrees=0.0, slope=0.0, scale=1.0, g=G, motion=(), rotating=False, v=(0.0, 0.0), omega=0.0):
    """A disk of radius ``scale``/2 and mass 2 that touches a plane; all turned by ``degrees``, gravity by ``slope`` more."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    foot = np.array([3.0, 2.0]) * scale if degrees else np.zeros(2)
    return Scene(
        disks=Disks(
            x=[foot + turn @ [0.0, 0.5 * scale]],
            v=[turn @ np.array(v)],
            omega=omega,
            radius=0.5 * scale,
            mass=2.0,
            rotating=rotating,
        ),
        disk_disk=rigid(),
        walls=(Wall(name="plane", point=tuple(foot), normal=tuple(turn @ [0.0, 1.0]), law=law, motion=motion),),
        gravity=tuple(turn @ [g * math.sin(slope), -g * math.cos(slope)]),
    )


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"box2d.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    """Run in this process: what is tested is the session; the process around it has tests of its own."""
    from ninedisk.harness.engines.box2d.session import Box2DSession

    return run_session(Box2DSession, scene, numerics(n_steps, dt, **options), watch)


def test_facts():
    info = ENGINE.info()
    assert isinstance(ENGINE, Engine)
    assert (info.scheme, info.contact, info.precision, info.licence) == (
        "semi-implicit-euler",
        "impulse",
        "float32",
        "zlib",
    )


def test_what_is_not_installed_says_how_to_get_it(monkeypatch):
    def missing(_name):
        raise process.metadata.PackageNotFoundError

    process.package_version.cache_clear()
    monkeypatch.setattr(process.metadata, "version", missing)
    try:
        assert not Box2DEngine().info().installed
        with pytest.raises(EngineNotInstalledError, match="pip install Box2D"):
            Box2DEngine().run(on_plane(rigid()), numerics(1), [])
    finally:
        process.package_version.cache_clear()


def test_a_stiffness_that_matters_is_refused_by_name():
    support = ENGINE.supports(on_plane(ContactLaw(kn=1e6, ks=1e6, mu=0.3, beta=0.1)), numerics(1))
    assert support.level is SupportLevel.NO
    assert {Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(support.missing)
    assert ENGINE.supports(on_plane(rigid()), numerics(1)).level is SupportLevel.EXACT


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"velocity_iterations": 0}, "box2d.velocity_iterations = 0"),
        ({"position_iterations": 2.5}, "whole number"),
        ({"slop": 1.0}, "'box2d.slop' is unknown"),
    ],
)
def test_bad_settings_are_refused_before_anything_starts(option, words):
    with pytest.raises(InvalidNumericsError, match=words):
        ENGINE.run(on_plane(rigid()), numerics(1, **option), [])


def errors(case, variant, truth):
    """Largest error of each quantity against one kind of truth, relative to the quantity's largest value."""
    result = run_case(case, engine="box2d", params=variant)
    assert result.status in {"pass", "fail", "known-gap"}, result.reason
    rows = result.measurements[(result.measurements.truth == truth) & (result.measurements.norm == "max")]
    assert len(rows)
    return {row.quantity: (row.abs_error, row.scale) for row in rows.itertuples()}


@needs_box2d
@pytest.mark.parametrize("dt", [0.01, 0.0025])
@pytest.mark.parametrize("mu", [0.36, 0.4])
def test_incline_is_semi_implicit_euler_to_single_precision(mu, dt):
    found = errors("incline-block", {"mu": mu, "dt": dt}, "exact-step")
    steps, weight = 1.0 / dt, 7.854 * 10.0
    pull = 10.0 * math.sin(math.radians(20.0))
    # In each step the velocity is a sum of terms of the size of pull dt, each rounded; positions are sums of velocities.
    speed = steps * EPS * (pull * dt + (0.038 if mu == 0.36 else 0.0)) + 4.0 * EPS
    assert found["vx"][0] < speed
    assert found["x"][0] < speed + steps * EPS * 0.02
    assert max(found["fn"][0], found["fs"][0]) < 4.0 * EPS * weight
    assert found["gap"][0] < 4.0 * EPS


@needs_box2d
@pytest.mark.parametrize("dt", [0.01, 0.0025])
def test_rolling_is_semi_implicit_euler_to_single_precision(dt):
    found = errors("slip-to-roll", {"mu": 0.3, "dt": dt}, "exact-step")
    steps = 1.0 / dt
    for quantity in ("x", "vx", "spin"):
        error, scale = found[quantity]
        assert error < 0.5 * steps * EPS * max(scale, 1.0)  # half a unit in the last place a step


@needs_box2d
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_collision_at_a_speed_that_box2d_would_take_as_plastic(restitution):
    # b2_velocityThreshold is 1: the case's impact of 1 m/s has its restitution only in the adapter's own units.
    found = errors("binary-collision", {"kind": "elastic", "restitution": restitution}, "analytic")
    assert max(found[name][0] for name in ("vx_1", "vx_2", "energy", "momentum_x")) < 4.0 * EPS


@needs_box2d
def test_without_own_units_the_impact_is_plastic(monkeypatch):
    from ninedisk.harness.engines.box2d import session as box2d_session

    monkeypatch.setattr(box2d_session, "units_of", lambda *_: box2d_session.Units(length=1.0, time=1.0, mass=1.0))
    scene = on_plane(rigid(restitution=1.0), v=(0.0, -0.9), g=0.0)
    assert abs(run(scene, 5).history.v[-1, 0, 1]) < 1e-6
    monkeypatch.undo()
    assert run(scene, 5).history.v[-1, 0, 1] == pytest.approx(0.9, rel=4.0 * EPS)


@needs_box2d
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_units_fit_scenes_of_any_size(scale):
    scene = on_plane(rigid(mu=0.3), slope=0.5, scale=scale, g=G * scale)
    finished = run(scene)
    down = G * scale * (math.sin(0.5) - 0.3 * math.cos(0.5))
    assert finished.history.v[-1, 0, 0] == pytest.approx(down, rel=100 * EPS)
    for name in ("length", "time", "mass"):
        assert math.frexp(finished.settings[f"box2d.unit_of_{name}"])[0] == 0.5  # a power of two: nothing is rounded
    assert finished.settings["box2d.velocity_threshold"] < 1e-5 * down
    assert finished.settings["box2d.touch"] < finished.settings["box2d.linear_slop"]


@needs_box2d
@pytest.mark.parametrize("degrees", [*range(0, 360, 30), 7.3, 111.1])
def test_a_touching_disk_is_in_contact_from_the_first_step(degrees):
    slope, mu = 0.5, 0.3
    history = run(on_plane(rigid(mu=mu), degrees=degrees, slope=slope)).history
    normal, down = 2.0 * G * math.cos(slope), G * (math.sin(slope) - mu * math.cos(slope))
    # On a tilted plane each of the hundred iterations rounds a velocity of the size of down; the impulse follows.
    rounding = 100 * EPS * 2.0 * down / 0.01
    np.testing.assert_allclose(history.fn[1:, 0], normal, atol=rounding)
    np.testing.assert_allclose(history.fs[1:, 0], -mu * normal, atol=rounding)
    np.testing.assert_allclose(history.gap[:, 0], 0.0, atol=2e-5)
    np.testing.assert_allclose(np.hypot(*history.v[-1, 0]), down, rtol=100 * EPS)


@needs_box2d
def test_forces_follow_the_scene_s_signs_and_are_step_means():
    history = run(on_plane(rigid(mu=0.4), v=(-1.0, 0.0)), 3).history
    assert history.force_meaning == "step-mean"
    assert np.isnan(history.fn[0, 0])
    assert history.fn[1, 0] == pytest.approx(20.0, rel=4 * EPS)
    assert history.fs[1, 0] == pytest.approx(8.0, rel=4 * EPS)
    np.testing.assert_allclose(history.wall_force[1, 0], [-8.0, -20.0], rtol=4 * EPS)
    np.testing.assert_allclose(history.v[1, 0], [-1.0 + 0.4 * G * 0.01, 0.0], atol=4 * EPS)


@needs_box2d
def test_each_pair_has_its_own_friction_and_restitution():
    # Box2D would take the geometric mean and the larger one: neither gives these three from coefficients of bodies.
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], v=[[4.0, 0.0], [0.0, 0.0]], radius=0.5, mass=[2.0, 3.0], rotating=False)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.25))
    back = Wall(name="back", point=(3.7, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=0.8))
    scene = Scene(disks=disks, disk_disk=rigid(restitution=0.3), walls=(floor, back), gravity=(0.0, -G))
    history = run(scene, 400, dt=0.0025, watch=((0, 1), (0, 2), (1, 2), (1, 3))).history
    speed, fall = history.v[:, :, 0], 0.25 * G * 0.0025
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    assert speed[0, 0] - speed[hit - 1, 0] == pytest.approx((hit - 1) * fall, rel=1e-4)
    before = speed[hit - 1]
    assert (speed[hit, 1] - speed[hit, 0]) / (before[0] - before[1]) == pytest.approx(0.3, abs=2 * fall)
    turned = int(np.flatnonzero(history.fn[:, 3] > 0)[0])
    assert -speed[turned, 1] / speed[turned - 1, 1] == pytest.approx(0.8, abs=2 * fall)


@needs_box2d
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_oblique_impact_of_two_disks(restitution):
    line = np.array([0.6, 0.8])
    disks = Disks(
        x=[[0.0, 0.0], 2.0 * line + 1e-3], v=[line + np.array([-0.8, 0.6]), [0.0, 0.0]], radius=1.0, mass=[1.0, 3.0]
    )
    history = run(Scene(disks=disks, disk_disk=rigid(restitution=restitution)), 3).history
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    apart = history.x[hit - 1, 1] - history.x[hit - 1, 0]
    normal = apart / np.hypot(*apart)
    approach = (disks.v[0] - disks.v[1]) @ normal
    assert (history.v[-1, 1] - history.v[-1, 0]) @ normal == pytest.approx(restitution * approach, abs=16 * EPS)
    np.testing.assert_allclose(history.v[-1, 0] + 3.0 * history.v[-1, 1], disks.v[0], atol=8 * EPS)


@needs_box2d
def test_a_stack_carries_its_weight():
    disks = Disks(x=[[0.0, 0.5], [0.0, 1.5], [0.0, 2.5]], radius=0.5, mass=[1.0, 2.0, 3.0])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.5), walls=(floor,), gravity=(0.0, -G))
    history = run(scene, 20, watch=((0, 3), (0, 1), (1, 2))).history
    np.testing.assert_allclose(history.fn[-1], [60.0, 50.0, 30.0], rtol=1e-4)
    few = run(scene, 1, watch=((0, 3), (0, 1), (1, 2)), velocity_iterations=2).history
    assert np.abs(few.fn[1] - [60.0, 50.0, 30.0]).max() > 1.0


@needs_box2d
def test_moving_walls_carry_a_disk():
    motion = (WallSegment(duration=0.25, velocity=(0.3, 0.2)), WallSegment(angular_velocity=0.2, pivot=(0.0, 0.0)))
    history = run(on_plane(rigid(mu=2.0), motion=motion), 60).history
    np.testing.assert_allclose(history.v[5:25, 0], [[0.3, 0.2]] * 20, atol=1e-5)
    # The slop, and the wall's way in the first step, which finds the disk at rest.
    assert np.abs(history.gap[:25, 0]).max() < 0.2 * 0.01 + 1e-3
    assert history.wall_angle[-1, 0] == pytest.approx(math.pi / 2 + 0.2 * 0.35, abs=1e-12)


@needs_box2d
def test_disks_that_cannot_turn_keep_their_spin():
    history = run(on_plane(rigid(mu=0.3), v=(1.0, 0.0), omega=0.75)).history
    np.testing.assert_array_equal(history.omega[:, 0], 0.75)
    assert history.angle[-1, 0] == pytest.approx(0.75, rel=1e-5)


@needs_box2d
def test_a_speed_that_box2d_would_cut_off_is_an_error():
    # A light disk between a heavy one and a wall: the impact throws it faster than anything was at the start.
    disks = Disks(x=[[0.0, 0.0], [0.6, 0.0]], v=[[10.0, 0.0], [0.0, 0.0]], radius=[0.3, 0.25], mass=[1e3, 1e-3])
    wall = Wall(name="wall", point=(1.5, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=1.0))
    scene = Scene(disks=disks, disk_disk=rigid(restitution=1.0), walls=(wall,))
    with pytest.raises(EngineError, match="cuts velocities off"):
        run(scene, 60, watch=())
    with pytest.raises(EngineError, match="cuts spins off"):
        run(on_plane(rigid(), rotating=True, omega=200.0), 1)


@needs_box2d
def test_settings_are_recorded_and_runs_repeat_to_the_bit_in_a_process_of_their_own():
    scene = on_plane(rigid(mu=0.3), slope=0.5, degrees=33.0)
    one, two = (ENGINE.run(scene, numerics(20, velocity_iterations=7), ((0, 1),)) for _ in range(2))
    assert one.settings["box2d.velocity_iterations"] == 7
    assert one.settings["box2d.allow_sleep"] is False
    assert one.settings["engine_version"] == ENGINE.info().version
    np.testing.assert_array_equal(one.history.x, two.history.x)
    np.testing.assert_array_equal(one.history.x, run(scene, 20, velocity_iterations=7).history.x)


@needs_box2d
def test_a_crash_is_an_error_and_not_the_end(monkeypatch, tmp_path):
    (tmp_path / "crashing.py").write_text("import os\ndef session(*_): os.abort()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(Box2DEngine, "session", "crashing:session")
    with pytest.raises(EngineError, match=r"SIGABRT|signal"):
        ENGINE.run(on_plane(rigid()), numerics(1), [])
