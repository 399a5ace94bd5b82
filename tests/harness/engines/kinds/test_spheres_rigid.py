"""Spheres in space in engines with rigid contacts: closed forms, one body of scenes for all engines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.core.law import Rolling, SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.api.support import support_of
from ninedisk.harness.engines.dart.adapter import FORCE_MIXING
from ninedisk.harness.engines.world import from_z, quaternion_of, rotation_of, vector_of

G, MU, DT = 9.81, 0.3, 0.005


@dataclass(frozen=True)
class Expected:
    """What one engine is expected to give.

    Attributes
    ----------
    velocity : float
        Relative error of velocities and forces: round-off, or the engine's regularisation.
    sliding : float
        Error of the momentum that sliding friction takes, relative.
    steps : (float, float)
        ``x = v t + a t (t + p dt)/2``: p of the scheme and its own error.
    restitution : float or None
        Error of a rebound [m/s] at 1 m/s; None: it has no impact law.
    """

    velocity: float = 1e-11
    sliding: float = 1e-11
    euler: float = 1.0
    restitution: float | None = 1e-12
    options: Mapping[str, Any] = field(default_factory=dict)


SAP_LIFTS = MU * 3.0 / (G * 60 * DT)
"""A convex contact opens by mu times the slip at most, 3 m/s here; friction acts on what lifts it, as on the weight."""

EXPECTED = {
    "bullet": Expected(),
    # A contact gives way by the mixing of what it withstands; the second of an elastic pair once more.
    "dart": Expected(velocity=FORCE_MIXING, sliding=FORCE_MIXING, restitution=3 * FORCE_MIXING),
    # Slip is slip_compliance h/slip_damping of the friction; an impact is a spring's motion, whose e is off by half a per cent.
    "mujoco": Expected(velocity=2e-5, sliding=2e-5, euler=1.0 / 200, restitution=7.5e-3),
    "siconos": Expected(euler=0.0),
    "drake-sap": Expected(velocity=2e-3, sliding=SAP_LIFTS, restitution=None),
    # Friction lags a step behind the normal force: of 60 steps the first has none.
    "drake-lagged": Expected(velocity=2e-4, sliding=1.001 / 60, restitution=None),
}

each_engine = pytest.mark.parametrize("engine", EXPECTED)


def law(mu: float = 0.0, restitution: float | None = None, **given: Any) -> SphereLaw:
    return SphereLaw(kn=1e7, ks=1e7, mu=mu, restitution=restitution, regularised=True, **given)


def run(engine: str, scene: SphereScene, n_steps: int, watch: Any = (), **options: Any) -> History:
    if not get_engine(engine).info().installed:
        pytest.skip("not installed")
    numerics = Numerics(dt=DT, n_steps=n_steps, sample_every=n_steps // 2, options=options)
    assert support_of(get_engine(engine), scene, numerics).level is not SupportLevel.NO
    return get_engine(engine).run(scene, numerics, watch).history


def crowd() -> tuple[SphereScene, np.ndarray]:
    """Eight spheres without rotation sliding in eight directions, one that comes to roll, and one in flight; all far apart."""
    turns = math.radians(10.0) + math.pi / 4.0 * np.arange(8)
    ways = np.stack([np.cos(turns), np.sin(turns), np.zeros(8)], axis=1)
    spheres = Spheres(
        x=[*([20.0 * k, 0.0, 1.0] for k in range(9)), [200.0, 0.0, 9.0]],
        v=[*(3.0 * ways), [0.6, 0.8, 0.0], [1.0, 2.0, 3.0]],
        omega=[*np.zeros((8, 3)), [0.0, 0.0, 0.0], [1.0, -2.0, 0.5]],
        radius=1.0,
        mass=[*np.full(8, 2.0), 1.0, 3.0],
        rotating=[*[False] * 8, True, True],
    )
    floor = PlaneWall(name="floor", point=(5.0, 3.0, 0.0), normal=(0.0, 0.0, 1.0), law=law(MU))
    return SphereScene(spheres=spheres, sphere_sphere=law(MU), walls=(floor,), gravity=(0.0, 0.0, -G)), ways


@each_engine
def test_sliding_is_the_same_in_all_directions_and_ends_in_rolling(engine: str) -> None:
    scene, ways = crowd()
    expected, n = EXPECTED[engine], 60
    history = run(engine, scene, n, [(0, 10), (8, 10), (9, 10)])
    t, lost = n * DT, 3.0 * ways - history.v[-1, :8]
    along = (lost * ways).sum(axis=1)
    np.testing.assert_allclose(along, MU * G * t, rtol=expected.sliding)
    # Of an isotropic law nothing depends on the direction.
    np.testing.assert_allclose(along, along[0], rtol=1e-6)
    np.testing.assert_allclose(lost[:, :2], along[:, None] * ways[:, :2], atol=1e-6)
    # Slip ends after 2 v0/(7 mu g) = 0.10 s at 5/7 of the speed.
    np.testing.assert_allclose(history.v[-1, 8], [3 / 7, 4 / 7, 0.0], atol=expected.velocity)
    np.testing.assert_allclose(history.omega[-1, 8], [-4 / 7, 3 / 7, 0.0], atol=expected.velocity)
    # Nothing touches the last one.
    spin, begin = scene.spheres.omega[9], scene.spheres.x[9]
    fall = 0.5 * G * t * (t + expected.euler * DT)
    np.testing.assert_allclose(history.x[-1, 9], begin + t * scene.spheres.v[9] - [0.0, 0.0, fall], atol=1e-10)
    np.testing.assert_allclose(history.v[-1, 9], scene.spheres.v[9] - [0.0, 0.0, G * t], atol=1e-11)
    np.testing.assert_allclose(history.omega[-1, 9], spin, atol=1e-14)
    np.testing.assert_allclose(history.angle[-1, 9], t * spin, atol=1e-11)
    assert history.fn[-1, 2] == 0.0
    assert history.angle[-1, 8, 1] > 0.0
    if engine == "drake-sap":  # the sliding ones fly
        return
    np.testing.assert_allclose(history.fn[-1, :2], [2.0 * G, G], rtol=expected.velocity)
    # The force on the first body is against its path; the wall gets the opposite of all.
    np.testing.assert_allclose(history.fs[-1, 0], -MU * 2.0 * G * ways[0], atol=1e-3)
    np.testing.assert_allclose(history.fs[-1, 1], 0.0, atol=1e-3)
    np.testing.assert_allclose(history.wall_force[-1, 0], [0.0, 0.0, -17.0 * G], rtol=1e-3, atol=1e-3)
    np.testing.assert_array_equal(history.wall_angle[-1, 0], [0.0, 0.0, 1.0])


@each_engine
def test_a_ball_rolls_down_a_tilted_plane_at_five_sevenths(engine: str) -> None:
    """The plane has no axis of space in it; its load at rest is part of the scene where the contacts are springs."""
    normal = np.array([1.0, 2.0, 6.0]) / math.sqrt(41.0)
    plane = PlaneWall(name="plane", point=(1.0, 1.0, 1.0), normal=tuple(normal), law=law(0.5))
    place = np.array([1.0, 1.0, 1.0]) + (0.5 - 0.3 * G * normal[2] / 1e7) * normal
    ball = Spheres(x=[place], radius=0.5, mass=0.3)
    scene = SphereScene(spheres=ball, sphere_sphere=law(0.5), walls=(plane,), gravity=(0.0, 0.0, -G))
    history = run(engine, scene, 100, [(0, 1)])
    expected, weight = EXPECTED[engine], np.array([0.0, 0.0, -G])
    down = weight - (weight @ normal) * normal
    np.testing.assert_allclose(history.v[-1, 0], 5 / 7 * 100 * DT * down, atol=expected.velocity)
    np.testing.assert_allclose(history.omega[-1, 0], np.cross(normal, history.v[-1, 0]) / 0.5, atol=expected.velocity)
    np.testing.assert_allclose(history.fn[-1, 0], 0.3 * G * normal[2], rtol=expected.velocity)
    np.testing.assert_allclose(history.fs[-1, 0], -2 / 7 * 0.3 * down, atol=max(expected.velocity, 1e-4))
    np.testing.assert_allclose(history.gap[-1, 0], 0.0, atol=2e-5)


@each_engine
def test_a_ball_on_a_turntable_circles_at_two_sevenths(engine: str) -> None:
    """The table's own point moves on a circle, too: it is not on the axis."""
    turn, radius, speed = 2.0, 0.5, 0.7
    motion = (PlaneSegment(angular_velocity=(0.0, 0.0, turn), pivot=(0.0, 0.0, 0.0)),)
    table = PlaneWall(name="table", point=(2.0, 1.0, 0.0), normal=(0.0, 0.0, 1.0), law=law(1.0), motion=motion)
    x, v = np.array([1.0, 2.0, radius]), np.array([speed, 0.0, 0.0])

    def rolling(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.cross(np.cross([0.0, 0.0, turn], x) - v, [0.0, 0.0, 1.0]) / radius

    ball = Spheres(x=[x], v=[v], omega=[rolling(x, v)], radius=radius, mass=0.3)
    scene = SphereScene(spheres=ball, sphere_sphere=law(1.0), walls=(table,), gravity=(0.0, 0.0, -G))
    needed = {Capability.ROTATING_WALLS}
    if engine.startswith("drake"):
        assert set(support_of(get_engine(engine), scene, Numerics(dt=DT, n_steps=1)).missing) == needed
        return
    n = 200
    history = run(engine, scene, n, [(0, 1)])
    rate, t = 2 / 7 * turn, n * DT
    expected = speed * np.array([math.cos(rate * t), math.sin(rate * t), 0.0])
    # Euler's steps turn the velocity by what the ball moved in the step before: one step late, growing by (rate dt)^2/2 each.
    np.testing.assert_allclose(history.v[-1, 0], expected, atol=speed * (rate * DT + n * (rate * DT) ** 2))
    # The table's speed under the ball is that of the step's beginning.
    spin = rolling(history.x[-1, 0], history.v[-1, 0])
    np.testing.assert_allclose(history.omega[-1, 0], spin, atol=1.01 * turn * speed * DT / radius)
    np.testing.assert_allclose(history.wall_point[-1, 0], rotation_of(np.array([0.0, 0.0, turn * t])) @ table.point)
    np.testing.assert_allclose(history.fn[-1, 0], 0.3 * G, rtol=max(1e-6, EXPECTED[engine].velocity))


@each_engine
def test_spheres_rebound_from_a_wall_and_from_each_other(engine: str) -> None:
    """At a wall with e = 0.5, with e = 0.8 along a line of space, and touching, off the line, with friction: impulses by hand."""
    error = EXPECTED[engine].restitution
    e_wall, e, mu = (0.0, 0.0, 0.1) if error is None else (0.5, 0.8, 0.1)
    line = np.array([1.0, 2.0, 2.0]) / 3.0
    x = [[0.0, 0.0, 1.013], [20.0, 0.0, 20.0], 2.013 * line + [20.0, 0.0, 20.0], [40.0, 0.0, 20.0], [42.0, 0.0, 20.0]]
    v = [[0.0, 0.0, -1.0], line, np.zeros(3), [1.0, 0.0, 0.4], np.zeros(3)]
    omega = np.zeros((5, 3))
    omega[3, 1] = 2.0
    spheres = Spheres(x=x, v=v, omega=omega, radius=1.0, mass=[1.0, 1.0, 3.0, 1.0, 1.0])
    given = (e_wall, e) if error is not None else (None, None)
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law(mu, given[0]))
    history = run(engine, SphereScene(spheres=spheres, sphere_sphere=law(mu, given[1]), walls=(floor,)), 12)
    after, tolerance = history.v[-1], 0.012 if error is None else error
    np.testing.assert_allclose(after[0], [0.0, 0.0, e_wall], atol=tolerance)
    np.testing.assert_allclose(after[1], (1.0 - 0.75 * (1.0 + e)) * line, atol=tolerance)
    np.testing.assert_allclose(after[2], 0.25 * (1.0 + e) * line, atol=tolerance)
    if error is None:  # whose last pair stays together, and slips on
        return
    # Slip -1.6 m/s along z of the first against the second: 0.4 - 2 of its spin; it slides through the impact.
    push = 0.5 * (1.0 + e)
    np.testing.assert_allclose(after[3], [1.0 - push, 0.0, 0.4 + mu * push], atol=tolerance)
    np.testing.assert_allclose(after[4], [push, 0.0, -mu * push], atol=tolerance)
    np.testing.assert_allclose(history.omega[-1, 3:, 1], [2.0 - 2.5 * mu * push, -2.5 * mu * push], atol=3 * tolerance)


@pytest.mark.parametrize(("engine", "option"), [("bullet", ("friction", "pyramid")), ("dart", ("solver", "dantzig"))])
def test_a_pyramid_is_root_two_times_as_strong_across_its_edges(engine: str, option: tuple[str, str]) -> None:
    """Both components are mu fn, whatever the direction: friction acts 45 degrees off the axes and is no longer against the slip."""
    scene, ways = crowd()
    history = run(engine, scene, 20, **{f"{engine}.{option[0]}": option[1]})
    lost = 3.0 * ways - history.v[-1, :8]
    np.testing.assert_allclose(lost[:, :2], MU * G * 20 * DT * np.sign(ways[:, :2]), rtol=2 * FORCE_MIXING)


@pytest.mark.parametrize("engine", ["bullet", "dart", "mujoco", "siconos"])
def test_a_driven_sphere_carries_another_and_a_fixed_one_stops_it(engine: str) -> None:
    """Two rest on what moves sideways, one on what turns under it about the vertical through both; one falls on what is fixed."""
    x = [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [20.0, 0.0, 0.0], [20.0, 0.0, 2.0]]
    v = [[0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    held, turn = [True, False, True, False], np.array([[0.0, 0.0, 1.0], *np.zeros((3, 3))])
    spheres = Spheres(
        x=x, v=v, omega=turn, radius=1.0, mass=1.0, held=[[each] * 3 for each in held], rotating=np.logical_not(held)
    )
    scene = SphereScene(spheres=spheres, sphere_sphere=law(MU), gravity=(0.0, 0.0, -G))
    history = run(engine, scene, 20, [(0, 1), (2, 3)])
    t = 20 * DT
    np.testing.assert_array_equal(history.v[-1, [0, 2]], [v[0], v[2]])
    np.testing.assert_allclose(history.x[-1], np.array(x) + t * np.array(v), atol=1e-5)
    np.testing.assert_allclose(history.angle[-1, 0], [0.0, 0.0, t], atol=1e-12)
    np.testing.assert_allclose(history.fn[-1], G, rtol=1e-4)  # a soft contact's swings have not died away
    part = spheres.held.copy()
    part[1, 2] = True
    partly = scene.replace(spheres=Spheres(x=x, radius=1.0, mass=1.0, held=part))
    support = support_of(get_engine(engine), partly, Numerics(dt=DT, n_steps=1))
    assert (support.level is SupportLevel.NO) == (engine != "siconos")
    assert engine == "siconos" or "sphere 1 is held in part" in " ".join(support.notes)


@each_engine
def test_what_springs_and_resistances_ask_is_missing_by_name(engine: str) -> None:
    scene, _ = crowd()
    sprung = SphereLaw(e_star=1e9, g_star=1e9, mu=MU, beta=0.1, rolling=Rolling(model="constant", mu=0.1))
    missing = support_of(get_engine(engine), scene.replace(sphere_sphere=sprung), Numerics(dt=DT, n_steps=1)).missing
    assert {Capability.HERTZ_MINDLIN, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(missing)
    assert (Capability.ROLLING_CONSTANT in missing) == (engine not in {"bullet", "mujoco"})


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_resistances_to_rolling_and_twisting_are_torques_in_proportion_to_the_normal_force(engine: str) -> None:
    """A ball that spins about the vertical loses ``mu R fn t/I``, one that rolls 5/7 of mu g t; MuJoCo has one cone for all."""
    mu_twist, mu_roll = 0.02, 0.05
    resistances = {"twisting": Rolling(model="constant", mu=mu_twist), "rolling": Rolling(model="constant", mu=mu_roll)}
    floor = PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=law(MU, **resistances))
    balls = Spheres(
        x=[[0, 0, 0.5], [9, 0, 0.5]],
        v=[[0, 0, 0], [1.2, 1.6, 0]],
        omega=[[0, 0, 5], [-3.2, 2.4, 0]],
        radius=0.5,
        mass=0.3,
    )
    scene = SphereScene(spheres=balls, sphere_sphere=law(0.2), walls=(floor,), gravity=(0, 0, -G))
    history = run(engine, scene, 40, [(1, 2)])
    t, way = 40 * DT, np.array([0.6, 0.8, 0.0])
    assert history.omega[-1, 0, 2] == pytest.approx(5.0 - 2.5 * mu_twist * G * t / 0.5, rel=2e-5)
    rim = 0.5 * np.linalg.norm(history.omega[-1, 1])
    np.testing.assert_allclose(np.cross(history.v[-1, 1], way), 0.0, atol=1e-6)
    force, slip = -history.fs[-1, 0] @ way / history.fn[-1, 0], history.v[-1, 1] @ way / rim - 1.0
    # m a = -F and I a/R = F R - M: F = 5 M/(7 R).
    if engine == "bullet":
        assert force == pytest.approx(5 / 7 * mu_roll, rel=1e-9)
        assert slip == pytest.approx(0.0, abs=1e-9)
        return
    # One cone: (F/mu)^2 + (M/(mu_roll R))^2 = fn^2, with forces as mu^2 slip to mu_roll^2 R^2 omega: the ball slips.
    assert force == pytest.approx(1.0 / math.hypot(1.0 / MU, 1.4 / mu_roll), rel=0.01)
    assert slip == pytest.approx(5 / 7 * (mu_roll / MU) ** 2, rel=0.02)


def test_rotations_and_their_vectors_and_quaternions_agree_at_any_angle() -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    for angle in (0.0, 1e-9, 1.0, math.pi, 4.0, 6.0):
        turned = rotation_of(angle * axis)
        w, x, y, z = quaternion_of(turned)
        assert math.hypot(w, x, y, z) == pytest.approx(1.0, abs=1e-15)
        np.testing.assert_allclose(rotation_of(vector_of(turned)), turned, atol=1e-15)
        assert abs(w) == pytest.approx(abs(math.cos(0.5 * angle)), abs=1e-9)
    for normal in (axis, -axis, np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])):
        w, x, y, z = from_z(normal)
        np.testing.assert_allclose(
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], normal, atol=1e-15
        )
