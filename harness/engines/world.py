"""What adapters of rigid-body engines share: walls' poses, contact frames, rotations, sessions that step a world of bodies."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, Scene, SphereScene
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.engines.boxes import box_frame


class WallPoses:
    """Surface point [m] and unit normal of each wall of 2D at a time [s], both of shape (m, 2); exact for any motion."""

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


class Pose(NamedTuple):
    """Of all walls of 3D at a time: surface points [m] and normals, shape (m, 3), and rotations since time 0, shape (m, 3, 3)."""

    point: FloatArray
    normal: FloatArray
    rotation: FloatArray


class PlanePoses:
    """`Pose` of the walls of 3D at a time [s]; exact for any motion."""

    def __init__(self, scene: SphereScene) -> None:
        self.scene = scene
        self.moving = any(wall.motion for wall in scene.walls)

    def __call__(self, t: float) -> Pose:
        """Poses at time ``t``."""
        found = [_pose(np.array(wall.point), wall.motion, t) for wall in self.scene.walls]
        rotation = np.array([turned for _, turned in found]).reshape(-1, 3, 3)
        normal = np.array([wall.normal for wall in self.scene.walls]).reshape(-1, 3)
        point = np.array([place for place, _ in found]).reshape(-1, 3)
        return Pose(point, np.einsum("kab,kb->ka", rotation, normal), rotation)


def _pose(point: FloatArray, motion: tuple[PlaneSegment, ...], t: float) -> tuple[FloatArray, FloatArray]:
    rotation, begin = np.eye(3), 0.0
    for segment in motion:
        tau = min(t - begin, segment.duration)
        if tau <= 0.0:
            break
        wave = math.sin(segment.frequency * tau + segment.phase) - math.sin(segment.phase)
        away = tau * np.array(segment.velocity) + wave * np.array(segment.amplitude)
        turned = rotation_of(tau * np.array(segment.angular_velocity))
        pivot = point if segment.pivot is None else np.array(segment.pivot)
        point = pivot + away + turned @ (point - pivot)
        rotation, begin = turned @ rotation, begin + segment.duration
    return point, rotation


def rotation_of(vector: FloatArray) -> FloatArray:
    """Matrix of the rotation about a vector by its length [rad]: Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: FloatArray = np.eye(3) + math.sin(angle) * across + 2.0 * math.sin(0.5 * angle) ** 2 * across @ across
    return turned


def vector_of(rotation: FloatArray) -> FloatArray:
    """Inverse of `rotation_of`, the shortest of its values."""
    w, *axial = quaternion_of(rotation)
    vector = math.copysign(1.0, w) * np.array(axial)
    sine = float(np.linalg.norm(vector))
    return vector * (2.0 * math.atan2(sine, abs(w)) / sine) if sine > 0.0 else np.zeros(3)


def twists(here: Pose, there: Pose, dt: float) -> tuple[FloatArray, FloatArray]:
    """Velocity [m/s] of each wall's point and its spin [rad/s], shape (m, 3), of the screw motion from one pose to the next.

    That of a wall that turns about a fixed axis is exact at any point of it; the mean velocity of a point off the axis is not, and moves
    the axis.
    """
    spin = (
        np.array([vector_of(b @ a.T) for a, b in zip(here.rotation, there.rotation, strict=True)]).reshape(-1, 3) / dt
    )
    velocity = (there.point - here.point) / dt
    for k, turned in enumerate(dt * spin):
        half = 0.5 * float(np.linalg.norm(turned))
        if half > 0.0:
            across = np.cross(turned, velocity[k])
            part = (1.0 - half / math.tan(half)) / (4.0 * half**2)
            velocity[k] += -0.5 * across + part * np.cross(turned, across)
    return velocity, spin


def quaternion_of(rotation: FloatArray) -> list[float]:
    """Unit quaternion (w, x, y, z) of a rotation: of the four columns of 4 q q^T the longest, which no angle makes small."""
    m, trace = rotation, float(np.trace(rotation))
    outer = np.empty((4, 4))
    outer[0, 0] = 1.0 + trace
    outer[0, 1:] = outer[1:, 0] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    outer[1:, 1:] = m + m.T + (1.0 - trace) * np.eye(3)
    longest = outer[np.argmax(np.diag(outer))]
    return [float(each) for each in longest / np.linalg.norm(longest)]


def from_z(normal: FloatArray) -> list[float]:
    """Unit quaternion (w, x, y, z) of the shortest rotation that takes z to ``normal``."""
    x, y, z = normal
    if z < -1.0 + 1e-12:
        return [0.0, 1.0, 0.0, 0.0]
    quaternion = np.array([1.0 + z, -y, x, 0.0])
    return [float(each) for each in quaternion / np.linalg.norm(quaternion)]


def poses_of(scene: Scene | SphereScene) -> WallPoses | PlanePoses:
    """What gives the walls' poses at a time."""
    return PlanePoses(scene) if isinstance(scene, SphereScene) else WallPoses(scene)


def contact_frame(
    scene: Scene | SphereScene, x: FloatArray, point: FloatArray, normal: FloatArray, i: int, j: int
) -> tuple[FloatArray, float]:
    """Unit normal from body ``i`` to body ``j``, and the gap [m].

    Parameters
    ----------
    scene : Scene or SphereScene
    x : array
        Centres of the bodies [m], shape (n, dimension).
    point, normal : array
        Walls' surface points [m] and normals at the same time, shape (m, dimension).
    i, j : int
        A disk or sphere, and a later one or a wall; boxes: `ninedisk.harness.engines.boxes.box_frame`.
    """
    radius, wall = scene.bodies.radius, j - len(scene.bodies)
    if wall >= 0:
        return -normal[wall], float((x[i] - point[wall]) @ normal[wall] - radius[i])
    apart = x[j] - x[i]
    distance = float(np.hypot(apart[0], apart[1]) if scene.dimension == 2 else np.linalg.norm(apart))
    return apart / distance, distance - float(radius[i] + radius[j])


def write_contacts(
    scene: Scene | SphereScene,
    history: History,
    row: int,
    pose: Any,
    impulses: Mapping[Pair, FloatArray] | None,
    dt: float,
    moments: Mapping[Pair, FloatArray] | None = None,
) -> None:
    """Write walls' poses, gaps, contact forces and walls' resultants of a row whose positions, and of boxes orientations, are there.

    Parameters
    ----------
    scene : Scene or SphereScene
    history : History
    row : int
    pose : tuple of arrays
        Points [m] and normals of the walls first, as `WallPoses` and `PlanePoses` give them.
    impulses : mapping or None
        Impulse [N s] of the last step on the first body of each touching pair, shape (dimension,); None before the first step,
        whose forces stay NaN.
    dt : float
        Length of that step [s].
    moments : mapping or None
        Of scenes with boxes: moment of these impulses [N m s] about the centre of the first body of each touching pair, shape (3,).
    """
    size, (point, normal, *_) = scene.dimension, pose
    boxes = scene.bodies.boxes if isinstance(scene, SphereScene) and has_boxes(scene) else ()
    history.wall_point[row] = point
    history.wall_angle[row] = normal if size == 3 else np.arctan2(normal[:, 1], normal[:, 0])
    for c, (i, j) in enumerate(history.pairs):
        if any(boxes[k] for k in (i, j) if k < len(boxes)):
            n, gap = box_frame(scene, history.x[row], history.quaternion[row], point, normal, i, j)  # type: ignore[arg-type, index]
        else:
            n, gap = contact_frame(scene, history.x[row], point, normal, i, j)
        history.gap[row, c] = gap
        if impulses is not None:
            force = impulses.get((i, j), np.zeros(size)) / dt
            history.fn[row, c] = -(force @ n)
            history.fs[row, c] = force - (force @ n) * n if size == 3 else force @ np.array([-n[1], n[0]])
            if moments is not None and history.moment is not None:
                history.moment[row, c] = moments.get((i, j), np.zeros(3)) / dt
    if impulses is not None:
        history.wall_force[row] = 0.0
        for i, j in sorted(
            impulses
        ):  # engines list contacts by addresses: a sum in their order would differ from run to run
            if j >= len(scene.bodies):
                history.wall_force[row, j - len(scene.bodies)] -= impulses[i, j] / dt


def driven_spheres(scene: SphereScene) -> list[int]:
    """Spheres that move in a prescribed way: held in all three components and keeping their spin, but not at rest."""
    spheres = scene.spheres
    return np.flatnonzero(spheres.held.all(axis=1) & ~spheres.rotating & ~spheres.fixed).tolist()


def write_driven(scene: SphereScene, history: History, row: int, t: float) -> None:
    """Write the state of the spheres whose motion is prescribed."""
    spheres, driven = scene.spheres, driven_spheres(scene)
    history.x[row, driven] = spheres.x[driven] + t * spheres.v[driven]
    history.v[row, driven], history.omega[row, driven] = spheres.v[driven], spheres.omega[driven]
    history.angle[row, driven] = t * spheres.omega[driven]


def partly_held(scene: SphereScene, engine: str) -> list[str]:
    """Reasons against spheres that keep some components of their motion and not others."""
    whole = {*driven_spheres(scene), *np.flatnonzero(scene.spheres.fixed)}
    return [
        f"sphere {i} is held in part: {engine} has bodies that are free, and such whose whole motion is prescribed"
        for i in np.flatnonzero(scene.spheres.held.any(axis=1))
        if i not in whole
    ]


class WorldSession(ABC):
    """`Session` of an engine that steps a world of rigid bodies, whose forces are the impulses of a step.

    A subclass builds the world and gives `engine` (its name in messages), `step`, `copy`, `impulses`, and what it has of `drive`,
    `drive_3d`, `drive_sphere` and `push`.

    Attributes
    ----------
    driven : list of int
        Spheres whose whole motion is prescribed.
    angle : array
        Angles of disks; of spheres the integrals of their spins, which are summed with those that the engine's steps move bodies by, as
        engines know orientations.
    """

    engine = ""

    poses: Any
    """What gives the walls' poses at a time."""
    moments: Mapping[Pair, FloatArray] | None = None
    """Of scenes with boxes: moments of what `impulses` returned last [N m s], about the centre of the first body of each pair."""

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        self.scene, self.dt, self.pairs, self.done = scene, numerics.dt, pairs, 0
        self.fixed = scene.bodies.fixed.tolist()
        self.initialise()

    def initialise(self) -> None:
        """Set ``poses``, what is prescribed of spheres, and the angles to 0."""
        self.poses = poses_of(self.scene)
        self.driven = driven_spheres(self.scene) if self.scene.dimension == 3 else []
        self.angle = np.zeros_like(self.scene.bodies.omega)

    def warm_up(self) -> None:
        """Compile the walls' motion where there is any; the engine itself is native code."""
        self.poses(0.0)

    def advance(self, n_steps: int) -> None:
        """Step the world; before each step a moving wall gets its exact pose and the velocity that takes it to the next."""
        for remaining in range(n_steps, 0, -1):
            if self.scene.dimension == 2:
                self.prescribe()
            else:
                self.prescribe_3d()
            self.step(last=remaining == 1)
            self.done += 1

    def prescribe(self) -> None:
        """Set what is prescribed in the coming step of disks: walls' motion, forces."""
        if self.poses.moving:
            here, facing = self.poses(self.done * self.dt)
            there, to_face = self.poses((self.done + 1) * self.dt)
            for k in range(len(self.scene.walls)):
                self.drive(k, here[k], there[k], facing[k], signed_angle(facing[k], to_face[k]) / self.dt)
        self._push_all()

    def _push_all(self) -> None:
        """Let the mean forces of the coming step act."""
        if self.scene.forces:
            for i, load in enumerate(mean_loads(self.scene, self.done * self.dt, (self.done + 1) * self.dt)):
                if not self.fixed[i]:
                    self.push(i, load)

    def prescribe_3d(self) -> None:
        """Put moving walls and spheres where they are at the begin of the coming step, with its velocities; let forces act."""
        t = self.done * self.dt
        if self.poses.moving:
            here = self.poses(t)
            velocity, rate = twists(here, self.poses(t + self.dt), self.dt)
            for k in range(len(self.scene.walls)):
                self.drive_3d(k, here.point[k], here.rotation[k], velocity[k], rate[k])
        for i in self.driven:
            self.drive_sphere(i, self.scene.spheres.x[i] + t * self.scene.spheres.v[i])
        self._push_all()

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and the contact impulses of the last step as forces."""
        self.copy(history, row)
        finite_state(self.engine, self.done, history.x[row], history.v[row], history.omega[row])
        if self.driven:
            write_driven(self.scene, history, row, self.done * self.dt)
        pose, impulses = self.poses(self.done * self.dt), self.impulses() if self.done else None
        write_contacts(self.scene, history, row, pose, impulses, self.dt, self.moments)

    @abstractmethod
    def step(self, *, last: bool) -> None:
        """One step; ``last``: the next call is `observe`."""

    @abstractmethod
    def copy(self, history: History, row: int) -> None:
        """Write positions, velocities, angles and spins."""

    @abstractmethod
    def impulses(self) -> Mapping[Pair, FloatArray]:
        """Impulse [N s] of the last step on the first body of each touching pair, shape (dimension,)."""

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:  # noqa: ARG002
        """Put wall ``k`` at ``here`` [m] with the normal ``facing``, moving to ``there`` in one step, turning at ``rate`` [rad/s]."""
        raise self._prescribes_nothing()

    def drive_3d(
        self,
        k: int,  # noqa: ARG002
        point: FloatArray,  # noqa: ARG002
        rotation: FloatArray,  # noqa: ARG002
        velocity: FloatArray,  # noqa: ARG002
        rate: FloatArray,  # noqa: ARG002
    ) -> None:
        """Put wall ``k`` at ``point`` [m], turned by ``rotation`` since time 0, with a velocity [m/s] and a spin [rad/s]."""
        raise self._prescribes_nothing()

    def drive_sphere(self, i: int, place: FloatArray) -> None:  # noqa: ARG002
        """Put sphere ``i`` at ``place`` [m] with its velocity and spin of time 0."""
        raise self._prescribes_nothing()

    def _prescribes_nothing(self) -> TypeError:
        return TypeError(f"{type(self).__name__} prescribes no motion: its capabilities must not say so")

    def push(self, i: int, load: FloatArray) -> None:
        """Let a force [N] and a torque [N m], shape (6,), act on a body in the coming step; of engines with `Capability.BODY_FORCES`."""
        raise EngineError(f"{self.engine} has no forces on bodies: {load!r} on body {i}")


def mean_loads(scene: Scene | SphereScene, begin: float, end: float) -> FloatArray:
    """Mean of the scene's forces between two times [s]: force [N] and torque [N m] on each body, in 2D of the plane z = 0, shape (n, 6)."""
    mean = np.zeros((len(scene.bodies), 6))
    for each in scene.forces:
        part = max(0.0, min(end, each.end) - max(begin, each.begin)) / (end - begin)
        mean[each.disk] += part * np.array([*three_components(each.force), *three_components(each.torque)])
    return mean


def three_components(values: Iterable[float] | float) -> list[float]:
    """A vector of 2D, at z = 0, or of 3D, or a spin about z, as three numbers."""
    if np.ndim(values) == 0:  # type: ignore[arg-type]
        return [0.0, 0.0, float(values)]  # type: ignore[arg-type]
    flat = [float(value) for value in values]  # type: ignore[union-attr]
    return [*flat, *[0.0] * (3 - len(flat))]


def signed_angle(one: FloatArray | tuple[float, float], two: FloatArray) -> float:
    """Signed angle from one direction to another [rad], in (-pi, pi]."""
    return math.atan2(one[0] * two[1] - one[1] * two[0], one[0] * two[0] + one[1] * two[1])


def finite_state(engine: str, step: int, *arrays: FloatArray) -> None:
    """Raise `EngineError`, naming engine and step, unless all numbers are finite."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise EngineError(f"{engine}: the state is no longer finite at step {step}; reduce dt")
