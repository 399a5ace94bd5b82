"""Geometry that adapters of rigid-body engines share: walls' poses, contact frames, lengths that walls must reach.

Symmetry of scenes: where a mirror image alone keeps every disk from turning. What space has of its own is in
`ninedisk.harness.engines.space`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from typing import Any

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene, Wall
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError

OF_SLIP = frozenset(
    {
        Capability.FRICTION,
        Capability.SHEAR_SPRING,
        Capability.LEVER_ARM_RADIUS,
        Capability.LEVER_ARM_OVERLAP,
        Capability.SLIP_MIDDLE,
        Capability.SLIP_END,
    }
)
"""What no engine needs where no contact can slip."""

TOUCH_ULPS = 16.0
"""A gap is a sum of a few coordinates of disks and walls, each rounded to half a unit in the last place."""


class WallPoses:
    """Surface point [m] and unit normal of each wall at a time [s], both of shape (m, 2); exact for any motion."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.moving = any(wall.motion for wall in scene.walls)

    def __call__(self, t: float) -> tuple[FloatArray, FloatArray]:
        """Points and normals at time ``t``; the first call compiles the walls' motion where there is any."""
        if not self.moving:
            walls = self.scene.walls
            point, normal = [wall.point for wall in walls], [wall.normal for wall in walls]
            return np.array(point).reshape(-1, 2), np.array(normal).reshape(-1, 2)
        from ninedisk.core.scene.motion import compile_motion, wall_poses

        if not hasattr(self, "table"):
            self.table = compile_motion(self.scene.walls)
        pose = wall_poses(self.table, t)
        return pose[:, 0:2].copy(), pose[:, 2:4].copy()


def contact_frame(
    scene: Scene, x: FloatArray, point: FloatArray, normal: FloatArray, i: int, j: int
) -> tuple[FloatArray, float]:
    """Unit normal from body ``i`` to body ``j``, and the gap [m].

    Parameters
    ----------
    scene : Scene
    x : array
        Centres of the disks [m], shape (n, 2).
    point, normal : array
        Walls' surface points [m] and normals at the same time, shape (m, 2).
    i, j : int
        A disk, and a later disk or a wall.
    """
    radius, wall = scene.disks.radius, j - len(scene.disks)
    if wall >= 0:
        return -normal[wall], float((x[i] - point[wall]) @ normal[wall] - radius[i])
    apart = x[j] - x[i]
    distance = float(np.hypot(apart[0], apart[1]))
    return apart / distance, distance - float(radius[i] + radius[j])


def write_contacts(
    scene: Scene,
    history: History,
    row: int,
    pose: tuple[FloatArray, FloatArray],
    impulses: Mapping[Pair, FloatArray] | None,
    dt: float,
) -> None:
    """Write walls' poses, gaps, contact forces and walls' resultants of a row whose positions are there already.

    Parameters
    ----------
    scene : Scene
    history : History
    row : int
    pose : (array, array)
        Points [m] and normals of the walls, as `WallPoses` gives them.
    impulses : mapping or None
        Impulse [N s] of the last step on the first body of each touching pair, shape (2,); None before the first step,
        whose forces stay NaN.
    dt : float
        Length of that step [s].
    """
    point, normal = pose
    history.wall_point[row] = point
    history.wall_angle[row] = np.arctan2(normal[:, 1], normal[:, 0])
    for c, (i, j) in enumerate(history.pairs):
        n, gap = contact_frame(scene, history.x[row], point, normal, i, j)
        history.gap[row, c] = gap
        if impulses is not None:
            force = impulses.get((i, j), np.zeros(2)) / dt
            history.fn[row, c] = -(force @ n)
            history.fs[row, c] = force @ np.array([-n[1], n[0]])
    if impulses is not None:
        history.wall_force[row] = 0.0
        for i, j in sorted(
            impulses
        ):  # engines list contacts by addresses: a sum in their order would differ from run to run
            if j >= len(scene.disks):
                history.wall_force[row, j - len(scene.disks)] -= impulses[i, j] / dt


class WorldSession(ABC):
    """`Session` of an engine that steps a world of rigid bodies, whose forces are the impulses of a step.

    A subclass builds the world and gives `engine` (its name in messages), `step`, `copy`, `impulses` and `drive`.
    """

    engine = ""

    poses: Any
    """What gives the walls' poses at a time."""

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        self.scene, self.dt, self.pairs, self.done = scene, numerics.dt, pairs, 0
        self.fixed = scene.bodies.fixed.tolist()
        self.begin()

    def begin(self) -> None:
        """Set ``poses``."""
        self.poses = WallPoses(self.scene)

    def warm_up(self) -> None:
        """Compile the walls' motion where there is any; the engine itself is native code."""
        self.poses(0.0)

    def advance(self, n_steps: int) -> None:
        """Step the world; before each step a moving wall gets its exact pose and the velocity that takes it to the next."""
        for remaining in range(n_steps, 0, -1):
            self.prescribe()
            self.step(last=remaining == 1)
            self.done += 1

    def prescribe(self) -> None:
        """Set what is prescribed in the coming step: walls' motion, forces."""
        if self.poses.moving:
            here, facing = self.poses(self.done * self.dt)
            there, to_face = self.poses((self.done + 1) * self.dt)
            for k in range(len(self.scene.walls)):
                self.drive(k, here[k], there[k], facing[k], turn(facing[k], to_face[k]) / self.dt)
        if self.scene.forces:
            for i, load in enumerate(mean_loads(self.scene, self.done * self.dt, (self.done + 1) * self.dt)):
                if not self.fixed[i]:
                    self.push(i, load)

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and the contact impulses of the last step as forces."""
        self.copy(history, row)
        finite_state(self.engine, self.done, history.x[row], history.v[row], history.omega[row])
        self.write(history, row, self.poses(self.done * self.dt), self.impulses() if self.done else None)

    def write(self, history: History, row: int, pose: Any, impulses: Mapping[Pair, FloatArray] | None) -> None:
        """Write what follows from positions, walls' poses and impulses."""
        write_contacts(self.scene, history, row, pose, impulses, self.dt)

    @abstractmethod
    def step(self, *, last: bool) -> None:
        """One step; ``last``: the next call is `observe`."""

    @abstractmethod
    def copy(self, history: History, row: int) -> None:
        """Write positions, velocities, angles and spins."""

    @abstractmethod
    def impulses(self) -> Mapping[Pair, FloatArray]:
        """Impulse [N s] of the last step on the first body of each touching pair, shape (2,), in space (3,)."""

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:  # noqa: ARG002
        """Put wall ``k`` at ``here`` [m] with the normal ``facing``, on its way to ``there`` in one step, turning at ``rate`` [rad/s]."""
        raise TypeError(f"{type(self).__name__} prescribes no motion: its capabilities must not say so")

    def push(self, i: int, load: FloatArray) -> None:
        """Let a force [N] and a torque [N m], shape (3,), act on a disk in the coming step; of engines with `Capability.BODY_FORCES`."""
        raise EngineError(f"{self.engine} has no forces on disks: {load!r} on disk {i}")


def mean_loads(scene: Scene, begin: float, end: float) -> FloatArray:
    """Mean of `Scene.forces` between two times [s]: force [N] and torque [N m] on each disk, shape (n, 3)."""
    mean = np.zeros((len(scene.disks), 3))
    for each in scene.forces:
        part = max(0.0, min(end, each.end) - max(begin, each.begin)) / (end - begin)
        mean[each.disk] += part * np.array([*each.force, each.torque])
    return mean


def three(values: Iterable[float] | float) -> list[float]:
    """A vector of the plane z = 0 or of space, or a spin about z, as three numbers."""
    if np.ndim(values) == 0:  # type: ignore[arg-type]
        return [0.0, 0.0, float(values)]  # type: ignore[arg-type]
    flat = [float(value) for value in values]  # type: ignore[union-attr]
    return [*flat, *[0.0] * (3 - len(flat))]


def turn(one: FloatArray | tuple[float, float], two: FloatArray) -> float:
    """Signed angle from one direction to another [rad], in (-pi, pi]."""
    return math.atan2(one[0] * two[1] - one[1] * two[0], one[0] * two[0] + one[1] * two[1])


def wall_reach(scene: Scene | SphereScene, numerics: Numerics, engine: str) -> float:
    """Half-length [m] of a wall that no disk can leave within the run: four times the scene's size and the way of its
    fastest body.

    Raises
    ------
    EngineError
        If that is no finite length; ``engine`` is the name in the message.
    """
    reach = 4.0 * (size(scene) + path(scene, numerics))
    if not math.isfinite(reach):
        raise EngineError(
            f"{engine}: the bodies' way over the run is no finite length; reduce velocities, dt or n_steps"
        )
    return reach


def touch_length(scene: Scene | SphereScene, numerics: Numerics, engine: str) -> float:
    """Length [m] of a few units of round-off of the scene's coordinates: bodies that are no further apart touch.

    Raises
    ------
    EngineError
        If the bodies' way over the run is no finite length.
    """
    return TOUCH_ULPS * float(np.spacing(wall_reach(scene, numerics, engine)))


def size(scene: Scene | SphereScene) -> float:
    """Largest distance from the origin that bodies and walls' points reach at time 0 [m]."""
    far = [float(np.abs(scene.bodies.x).max() + scene.bodies.radius.max())] if len(scene.bodies) else []
    return max([*far, *(max(map(abs, wall.point)) for wall in scene.walls)], default=1.0)


def path(scene: Scene | SphereScene, numerics: Numerics) -> float:
    """Path [m] of the fastest body over the run, were it free: walls must be longer than that."""
    t = numerics.dt * numerics.n_steps
    return top_speed(scene) * t + 0.5 * math.hypot(*scene.gravity) * t * t


def top_speed(scene: Scene | SphereScene) -> float:
    """Bound of the speeds [m/s] with which bodies' surfaces begin; what walls drive may be twice as fast as they."""
    bodies = scene.bodies
    speed = float(reduce(np.hypot, bodies.v.T).max(initial=0.0))
    spin = float(np.abs(bodies.omega.T * bodies.radius).max(initial=0.0))
    driven = max((abs(v) for wall in scene.walls for seg in wall.motion for v in seg.velocity), default=0.0)
    return speed + spin + 2.0 * driven


def finite_state(engine: str, step: int, *arrays: FloatArray) -> None:
    """Raise `EngineError`, naming engine and step, unless all numbers are finite."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise EngineError(f"{engine}: the state is no longer finite at step {step}; reduce dt")


TOLERANCE = 1e-12
"""Of the scene's size, or of a quantity's largest value: round-off of coordinates that were given as decimals."""


def no_disk_can_turn(scene: Scene) -> bool:
    """Whether every disk's centre lies on a line in which the whole scene is its own mirror image.

    A reflection turns spins round; a disk on the mirror therefore has a spin equal to its own opposite, zero, as long as the
    motion keeps the symmetry of its beginning and its loads. Neither inertia nor lever arms then matter.
    """
    if any(scene.initial_shear.values()):
        return False
    valid: list[tuple[FloatArray, FloatArray]] = []
    for centre in scene.disks.x:
        if any(_on_line(scene, centre, mirror) for mirror in valid):
            continue
        found = next((mirror for mirror in _candidates(scene, centre) if _is_mirror(scene, *mirror)), None)
        if found is None:
            return False
        valid.append(found)
    return True


def _size(scene: Scene) -> float:
    return float(np.abs(scene.disks.x).max() + scene.disks.radius.max())


def _on_line(scene: Scene, point: FloatArray, mirror: tuple[FloatArray, FloatArray]) -> bool:
    foot, normal = mirror
    return bool(abs((point - foot) @ normal) <= TOLERANCE * _size(scene))


def _candidates(scene: Scene, centre: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Lines (point, normal) through a disk's centre: a mirror passes through the centroid of the centres, too."""
    arm = scene.disks.x.mean(axis=0) - centre
    length = float(np.hypot(*arm))
    if length > TOLERANCE * _size(scene):
        yield centre, np.array([-arm[1], arm[0]]) / length
        return
    directions = [wall.normal for wall in scene.walls] + [scene.gravity, (1.0, 0.0), *map(tuple, scene.disks.v)]
    for dx, dy in directions:
        length = float(np.hypot(dx, dy))
        if length > 0.0:
            yield centre, np.array([dx, dy]) / length
            yield centre, np.array([-dy, dx]) / length


def _is_mirror(scene: Scene, foot: FloatArray, normal: FloatArray) -> bool:
    disks, size = scene.disks, _size(scene)

    def vector(values: object) -> FloatArray:
        array = np.asarray(values, dtype=float)
        return array - 2.0 * (array @ normal)[..., None] * normal

    image = foot + vector(disks.x - foot)
    far = np.hypot(*(image[:, None, :] - disks.x[None, :, :]).transpose(2, 0, 1))
    partner = far.argmin(axis=1)
    if (far[np.arange(len(partner)), partner] > TOLERANCE * size).any() or len(set(partner.tolist())) < len(partner):
        return False
    if any((values != values[partner]).any() for values in (disks.radius, disks.mass, disks.inertia, disks.rotating)):
        return False
    if not (_same(vector(disks.v), disks.v[partner]) and _same(-disks.omega, disks.omega[partner])):
        return False
    if not _same(vector(scene.gravity), np.asarray(scene.gravity)):
        return False
    return all(any(_images(wall, other, foot, normal, size) for other in scene.walls) for wall in scene.walls)


def _images(one: Wall, two: Wall, foot: FloatArray, normal: FloatArray, size: float) -> bool:
    """Whether the mirror takes one wall, its law and its motion to the other; walls that turn are none of its business."""

    def vector(values: tuple[float, float]) -> FloatArray:
        array = np.asarray(values)
        return np.asarray(array - 2.0 * (array @ normal) * normal)

    place = foot + vector((one.point[0] - foot[0], one.point[1] - foot[1]))
    facing = vector(one.normal)
    if not _same(facing, np.asarray(two.normal)) or one.law != two.law or len(one.motion) != len(two.motion):
        return False
    if abs((place - np.asarray(two.point)) @ facing) > TOLERANCE * size:
        return False
    for a, b in zip(one.motion, two.motion, strict=True):
        if a.angular_velocity or b.angular_velocity:
            return False
        if (a.duration, a.frequency, a.phase, a.tan_rate) != (b.duration, b.frequency, b.phase, b.tan_rate):
            return False
        ways = [(getattr(a, key), getattr(b, key)) for key in ("velocity", "amplitude", "tan_lever")]
        if not all(_same(vector(way), np.asarray(other)) for way, other in ways):
            return False
    return True


def _same(one: FloatArray, two: FloatArray) -> bool:
    return bool((np.abs(one - two) <= TOLERANCE * float(np.abs(two).max(initial=0.0))).all())


def no_contact_can_slip(scene: Scene) -> bool:
    """Whether symmetry alone keeps every contact from slipping, whatever the friction between disks.

    Equal disks at rest on a full rectangular lattice along x and y, smooth walls along x or y that move along their
    normals, no gravity: with x a function of the column and y one of the row, contacts lie in rows and columns and their
    forces depend on the column, or the row, alone. The motion therefore keeps that form, and no contact ever slips.
    """
    disks = scene.disks
    if len(disks) == 0 or any(scene.gravity) or np.any(disks.v) or np.any(disks.omega):
        return False
    if any(np.ptp(values) for values in (disks.radius, disks.mass)):
        return False
    columns, rows = np.unique(disks.x[:, 0]), np.unique(disks.x[:, 1])
    if len(columns) * len(rows) != len(disks) or len(np.unique(disks.x, axis=0)) != len(disks):
        return False
    for wall in scene.walls:
        if wall.law.mu > 0.0 or 0.0 not in wall.normal:
            return False
        along = 0 if wall.normal[0] == 0.0 else 1
        for segment in wall.motion:
            sideways = (segment.velocity[along], segment.amplitude[along], segment.tan_lever[along])
            if segment.angular_velocity or any(sideways):
                return False
    return True
