"""Boxes in engines with rigid contacts: closed forms, one body of scenes for all engines."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.boxes import rotation_matrix
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import BUILTIN_ENGINES, get_engine
from ninedisk.harness.api.support import support_of, without_spring_preload
from ninedisk.harness.engines.boxes import box_frame
from ninedisk.harness.engines.package import PackageEngine

G, DT = 9.81, 0.005
HALF = np.array([0.4, 0.25, 0.3])
UP = np.array([2.0, -1.0, 2.0]) / 3.0
"""Normal of the floor: no two components of one size and sign."""

SOFT = {
    "bullet": 1e-9,
    "dart": 2e-4,
    "mujoco": 1e-3,
    "drake-sap": 5e-3,
    "drake-lagged": 1e-3,
    "jolt": 0.0,
    "sapien": 1e-5,
}
"""Relative errors of forces at rest: the solver's, or the engine's softness; Jolt reports none, SAPIEN no friction."""

SINGLE = {"jolt": 2e-5, "sapien": 2e-5}
"""Errors [m, m/s, -] of motion in single precision: some hundred units of round-off of coordinates up to 10."""

each_engine = pytest.mark.parametrize("engine", SOFT)
OF_SEVERAL = ("bullet", "dart", "mujoco", "jolt", "sapien")
WITH_FORCES = ("bullet", "dart", "mujoco", "jolt")
"""Engines of several boxes, and of those with forces on bodies in space."""


def law(mu: float = 0.3) -> SphereLaw:
    return SphereLaw(kn=1e7, ks=1e7, mu=mu, restitution=0.0, regularised=True)


def floor(contact: SphereLaw, normal: Any = (0.0, 0.0, 1.0)) -> PlaneWall:
    x, y, z = normal
    return PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(x, y, z), law=contact)


def turn(angle: float) -> list[float]:
    return [math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)]


def to_up() -> np.ndarray[Any, Any]:
    """The shortest rotation from z to UP."""
    return np.array([1.0 + UP[2], -UP[1], UP[0], 0.0]) / math.sqrt(2.0 + 2.0 * UP[2])


def run(engine: str, scene: SphereScene, n_steps: int, watch: Any = ()) -> History:
    if not get_engine(engine).info().installed:
        pytest.skip("not installed")
    numerics = Numerics(dt=DT, n_steps=n_steps, sample_every=max(1, n_steps // 2))
    assert support_of(get_engine(engine), scene, numerics).level is not SupportLevel.NO
    return get_engine(engine).run(scene, numerics, watch).history


def test_these_are_all_engines_with_boxes() -> None:
    able = {name for name in BUILTIN_ENGINES if Capability.BOXES in get_engine(name).info().capabilities}
    assert able - {"cd", "dem"} == set(SOFT)
    pushed = {name for name in SOFT if Capability.BODY_FORCES_3D in get_engine(name).info().capabilities}
    assert pushed == set(WITH_FORCES)


def sees_forces(engine: str, history: History) -> bool:
    """Whether the engine reports contact forces; if it does not, they have no numbers."""
    reported = get_engine(engine).info().contact_forces
    if reported == "all":
        return True
    assert np.isnan(history.fn).all() == (reported == "none")
    assert np.isnan(history.fs).all()
    assert history.moment is None or np.isnan(history.moment).all()
    return False


@each_engine
def test_a_box_rests_on_an_oblique_floor(engine: str) -> None:
    """Its weight is tilted by 0.2: friction holds it, the plane presses where no moment is left."""
    contact, mass = law(0.5), 3.0
    side = np.cross(UP, [0.0, 0.0, 1.0])
    along = side / np.linalg.norm(side)
    box = Spheres(x=[HALF[2] * UP], mass=mass, half_sizes=[HALF], quaternion=[to_up()])
    gravity = -G * math.cos(0.2) * UP + G * math.sin(0.2) * along
    x, y, z = gravity.tolist()
    scene = SphereScene(spheres=box, sphere_sphere=contact, walls=(floor(contact, UP),), gravity=(x, y, z))
    history = run(engine, scene, 40, [(0, 1)])
    weight, error = mass * G, SOFT[engine]
    assert history.quaternion is not None
    if sees_forces(engine, history):
        assert history.moment is not None
        np.testing.assert_allclose(history.fn[-1, 0], weight * math.cos(0.2), rtol=2 * error)
        np.testing.assert_allclose(history.fs[-1, 0], -weight * math.sin(0.2) * along, atol=2 * error * weight)
        np.testing.assert_allclose(history.moment[-1, 0], 0.0, atol=error * weight)
    np.testing.assert_allclose(history.gap[-1, 0], 0.0, atol=2e-5)
    np.testing.assert_allclose(rotation_matrix(history.quaternion[-1, 0]), rotation_matrix(to_up()), atol=1e-3)
    np.testing.assert_allclose(history.x[-1, 0], HALF[2] * UP, atol=1e-3)
    np.testing.assert_allclose(history.v[-1, 0], 0.0, atol=5e-3)


@each_engine
def test_a_box_in_flight_keeps_its_momentum_and_its_orientation_follows_its_spin(engine: str) -> None:
    start = np.array([0.5, 0.1, -0.7, 0.5])
    spin = np.array([1.0, 4.0, -2.0])
    box = Spheres(
        x=[[0.0, 0.0, 9.0]], mass=3.0, half_sizes=[HALF], quaternion=[start], v=[[1.0, 2.0, 3.0]], omega=[spin]
    )
    scene = SphereScene(spheres=box, sphere_sphere=law(), walls=(floor(law()),))
    history = run(engine, scene, 40, [(0, 1)])
    single = SINGLE.get(engine, 0.0)
    assert history.quaternion is not None
    first, last = (rotation_matrix(history.quaternion[k, 0]) for k in (0, -1))
    np.testing.assert_allclose(first, rotation_matrix(start), atol=1e-12 + single)
    np.testing.assert_allclose(history.omega[0, 0], spin, atol=1e-12 + single)
    inertia = np.array(box.inertia[0])
    momentum = [
        turned @ (inertia * (turned.T @ omega)) for turned, omega in ((first, spin), (last, history.omega[-1, 0]))
    ]
    # Euler's explicit rule is off by half a step of I w x w.
    np.testing.assert_allclose(momentum[1], momentum[0], atol=4e-3)
    assert abs(history.omega[-1, 0] - spin).max() > 0.1, "the spin moves"
    reach = np.abs(last.T @ [0.0, 0.0, 1.0]) @ HALF
    np.testing.assert_allclose(history.gap[-1, 0], history.x[-1, 0, 2] - reach, atol=1e-12 + single)
    np.testing.assert_allclose(history.x[-1, 0], [0.2, 0.4, 9.6], atol=1e-10 + single)


@each_engine
def test_a_box_that_cannot_turn_slides_without_turning(engine: str) -> None:
    box = Spheres(
        x=[[0.0, 0.0, HALF[2]]],
        mass=4.0,
        half_sizes=[HALF],
        quaternion=[turn(0.4)],
        rotating=[False],
        v=[[1.0, 0.5, 0.0]],
    )
    scene = SphereScene(spheres=box, sphere_sphere=law(), walls=(floor(law()),), gravity=(0.0, 0.0, -G))
    history = run(engine, scene, 20, [(0, 1)])
    assert history.quaternion is not None
    np.testing.assert_allclose(
        rotation_matrix(history.quaternion[-1, 0]),
        rotation_matrix(np.array(turn(0.4))),
        atol=1e-12 + SINGLE.get(engine, 0.0),
    )
    assert not history.omega[-1].any()
    lost = 0.3 * G * 20 * DT / math.hypot(1.0, 0.5)
    # The convex model lifts, and lagged friction has none in the first step.
    off = {"drake-sap": 0.05, "drake-lagged": 0.02}.get(engine, 1e-4)
    np.testing.assert_allclose(history.v[-1, 0, :2], [1.0 - lost, 0.5 * (1.0 - lost)], atol=off)


@pytest.mark.parametrize("engine", OF_SEVERAL)
def test_a_stack_of_boxes_and_a_ball_bears_what_statics_says(engine: str) -> None:
    """Unequal, off the axis of the lowest: the moment of the load on it is balanced by the floor."""
    boxes = Spheres(
        x=[[0.0, 0.0, 0.3], [0.1, 0.05, 0.8], [0.1, 0.05, 1.25]],
        radius=[0.7, 0.6, 0.25],
        mass=[3.0, 2.0, 1.0],
        half_sizes=[[0.5, 0.35, 0.3], [0.3, 0.2, 0.2], [0.0, 0.0, 0.0]],
        quaternion=[turn(0.4), turn(1.0), turn(0.0)],
    )
    scene = SphereScene(spheres=boxes, sphere_sphere=law(), walls=(floor(law()),), gravity=(0.0, 0.0, -G))
    history = run(engine, scene, 20, [(0, 1), (1, 2), (0, 3)])
    error = 10 * SOFT[engine]
    if sees_forces(engine, history):
        np.testing.assert_allclose(history.fn[-1], [3.0 * G, G, 6.0 * G], rtol=error)
        assert history.moment is not None
        load = np.cross([0.1, 0.05, 0.3], [0.0, 0.0, -3.0 * G])
        np.testing.assert_allclose(history.moment[-1, 0], load, atol=error * 6.0 * G)
        np.testing.assert_allclose(history.moment[-1, 2], -load, atol=error * 6.0 * G)
    np.testing.assert_allclose(history.gap[-1], 0.0, atol=2e-5)
    np.testing.assert_allclose(history.v[-1], 0.0, atol=5e-3)


@pytest.mark.parametrize("engine", WITH_FORCES)
def test_a_force_and_a_torque_act_along_the_axes_of_the_scene(engine: str) -> None:
    """On a turned cube, whose moment of inertia has no direction, from inside one step to inside another."""
    side, mass = 0.3, 3.0
    box = Spheres(x=[[0.0, 0.0, 5.0]], mass=mass, half_sizes=[[side] * 3], quaternion=[[0.5, 0.1, -0.7, 0.5]])
    force, torque = np.array([3.0, -1.0, 2.0]), np.array([0.2, -0.3, 0.1])
    load = BodyForce(disk=0, force=tuple(force), torque=tuple(torque), begin=0.0032, end=0.0573)
    scene = SphereScene(spheres=box, sphere_sphere=law(), walls=(floor(law()),), forces=(load,))
    history = run(engine, scene, 20)
    lasts, error = load.end - load.begin, 1e-9 + SINGLE.get(engine, 0.0)
    np.testing.assert_allclose(history.v[-1, 0], force * lasts / mass, atol=error)
    np.testing.assert_allclose(history.omega[-1, 0], torque * lasts / (mass * 2.0 * side**2 / 3.0), atol=error)


@pytest.mark.parametrize("engine", ["drake-sap", "drake-lagged"])
def test_drake_says_that_its_boxes_are_alone(engine: str) -> None:
    two = Spheres(x=[[0.0, 0.0, 0.3], [3.0, 0.0, 0.3]], mass=[1.0, 2.0], half_sizes=[HALF, HALF])
    answer = support_of(get_engine(engine), SphereScene(spheres=two, sphere_sphere=law()), Numerics(dt=DT, n_steps=1))
    assert answer.level is SupportLevel.NO
    assert "alone" in answer.notes[0]


@pytest.mark.parametrize("engine", ["lammps", "liggghts", "yade", "esys-particle", "siconos", "dem", "kratos"])
def test_engines_of_spheres_refuse_several_boxes(engine: str) -> None:
    two = Spheres(x=[[0.0, 0.0, 0.3], [3.0, 0.0, 0.3]], mass=[1.0, 2.0], half_sizes=[HALF, HALF])
    answer = support_of(get_engine(engine), SphereScene(spheres=two, sphere_sphere=law()), Numerics(dt=DT, n_steps=1))
    assert answer.level is SupportLevel.NO
    assert Capability.BOXES in answer.missing


def test_mujoco_refuses_a_restitution_of_boxes() -> None:
    bouncing = SphereLaw(kn=1e7, restitution=0.5, regularised=True)
    box = Spheres(x=[[0.0, 0.0, 1.0]], mass=1.0, half_sizes=[HALF])
    scene = SphereScene(spheres=box, sphere_sphere=bouncing, walls=(floor(bouncing),))
    assert support_of(get_engine("mujoco"), scene, Numerics(dt=DT, n_steps=1)).level is SupportLevel.NO


def test_a_box_that_touches_a_wall_is_not_moved_off_it() -> None:
    """The sphere that encloses it would overlap."""
    box = Spheres(
        x=[[0.0, 0.0, 0.3], [5.0, 0.0, 0.29]], mass=[1.0, 2.0], half_sizes=[HALF, HALF], quaternion=[turn(0.4)] * 2
    )
    scene = SphereScene(spheres=box, sphere_sphere=law(), walls=(floor(law()),))
    np.testing.assert_allclose(without_spring_preload(scene).spheres.x, [[0.0, 0.0, 0.3], [5.0, 0.0, 0.3]], atol=1e-15)


def test_the_process_of_an_engine_keeps_the_kernels_of_the_core(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its home is the run's own: without their folder it would compile the contacts of boxes in every run."""
    engine = get_engine("bullet")
    assert isinstance(engine, PackageEngine)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert engine.environment(tmp_path)["XDG_CACHE_HOME"] == str(Path.home() / ".cache")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert engine.environment(tmp_path)["XDG_CACHE_HOME"] == "/somewhere"


def frame(
    x: Any, half: Any, quaternion: Any, radius: Any = None, i: int = 0, j: int = 1
) -> tuple[np.ndarray[Any, Any], float]:
    bodies = Spheres(x=x, mass=[1.0] * len(x), half_sizes=half, quaternion=quaternion, radius=radius)
    scene = SphereScene(spheres=bodies, sphere_sphere=law(), walls=(floor(law()),))
    point, normal = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    return box_frame(scene, np.array(bodies.x), np.array(bodies.quaternion), point, normal, i, j)


def test_gaps_of_boxes_are_geometry() -> None:
    none, one = [0.0, 0.0, 0.0], [1.0, 2.0, 3.0]
    eighth = turn(0.25 * math.pi)
    normal, gap = frame([[0.0, 0.0, 3.5]], [one], [eighth])
    assert gap == pytest.approx(0.5)
    np.testing.assert_allclose(normal, [0.0, 0.0, -1.0])
    # A ball beyond an edge, to either side of the pair; one whose centre is in the box.
    for k, sign in ((0, 1.0), (1, -1.0)):
        order = [[0.0, 0.0, 5.0], [4.0, 6.0, 5.0]][:: 1 if k == 0 else -1]
        normal, gap = frame(order, [one, none][:: 1 if k == 0 else -1], None, [9.0, 0.5][:: 1 if k == 0 else -1])
        assert gap == pytest.approx(4.5)
        np.testing.assert_allclose(normal, [sign * 0.6, sign * 0.8, 0.0])
    normal, gap = frame([[0.0, 0.0, 5.0], [0.9, 0.0, 5.0]], [one, none], None, [9.0, 0.5])
    assert gap == pytest.approx(-0.6)
    np.testing.assert_allclose(normal, [1.0, 0.0, 0.0])
    # An edge of a box that is turned by 45 degrees before a face.
    normal, gap = frame(
        [[0.0, 0.0, 5.0], [1.0 + math.sqrt(2.0) + 0.25, 0.0, 5.0]], [one, [1.0, 1.0, 1.0]], [turn(0.0), eighth]
    )
    assert gap == pytest.approx(0.25)
    np.testing.assert_allclose(normal, [1.0, 0.0, 0.0], atol=1e-12)
