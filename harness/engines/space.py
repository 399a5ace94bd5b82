"""What adapters of rigid-body engines share in space: planes' poses, contact frames, sessions of a world of spheres."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.scene import PlaneSegment, SphereScene
from ninedisk.core.validate import FloatArray
from ninedisk.harness.engines.plane import WorldSession


class Pose(NamedTuple):
    """Of all planes at a time: surface points [m] and normals, shape (m, 3), and rotations since time 0, shape (m, 3, 3)."""

    point: FloatArray
    normal: FloatArray
    rotation: FloatArray


class PlanePoses:
    """`Pose` of the planes at a time [s]; exact for any motion."""

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
    """Velocity [m/s] of each plane's point and its spin [rad/s], shape (m, 3), of the screw motion from one pose to the next.

    That of a plane that turns about a fixed axis is exact at any point of it; the mean velocity of a point off the axis is not, and moves
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


def write_contacts(
    scene: SphereScene, history: History, row: int, pose: Pose, impulses: Mapping[Pair, FloatArray] | None, dt: float
) -> None:
    """As `ninedisk.harness.engines.plane.write_contacts`, of a scene in space."""
    n, x = len(scene.spheres), history.x[row]
    history.wall_point[row], history.wall_angle[row] = pose.point, pose.normal
    for c, (i, j) in enumerate(history.pairs):
        if j < n:
            apart = x[j] - x[i]
            distance = float(np.linalg.norm(apart))
            normal, gap = apart / distance, distance - float(scene.spheres.radius[i] + scene.spheres.radius[j])
        else:
            normal = -pose.normal[j - n]
            gap = float((pose.point[j - n] - x[i]) @ normal - scene.spheres.radius[i])
        history.gap[row, c] = gap
        if impulses is not None:
            force = impulses.get((i, j), np.zeros(3)) / dt
            history.fn[row, c] = -(force @ normal)
            history.fs[row, c] = force - (force @ normal) * normal
    if impulses is not None:
        history.wall_force[row] = 0.0
        for i, j in sorted(impulses):  # a sum in the engine's order would differ from run to run
            if j >= n:
                history.wall_force[row, j - n] -= impulses[i, j] / dt


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


class SpaceSession(WorldSession):
    """A `WorldSession` of a scene in space; a subclass gives `drive_wall`, and `drive_sphere` where it has `Capability.HELD_MOTION`.

    Engines know orientations; ``angle``, the integral of the spin, is summed with the spins that their steps move bodies by.
    """

    def begin(self) -> None:
        """Set ``poses``, and what is prescribed of spheres."""
        self.poses = PlanePoses(self.scene)
        self.driven = driven_spheres(self.scene)
        self.angle = np.zeros_like(self.scene.spheres.omega)

    def prescribe(self) -> None:
        """Put moving planes and spheres where they are at the begin of the coming step, with its velocities."""
        t = self.done * self.dt
        if self.poses.moving:
            here = self.poses(t)
            velocity, rate = twists(here, self.poses(t + self.dt), self.dt)
            for k in range(len(self.scene.walls)):
                self.drive_wall(k, here.point[k], here.rotation[k], velocity[k], rate[k])
        for i in self.driven:
            self.drive_sphere(i, self.scene.spheres.x[i] + t * self.scene.spheres.v[i])

    def write(self, history: History, row: int, pose: Any, impulses: Mapping[Pair, FloatArray] | None) -> None:
        """Write what is prescribed, and what follows from positions, planes' poses and impulses."""
        write_driven(self.scene, history, row, self.done * self.dt)
        write_contacts(self.scene, history, row, pose, impulses, self.dt)

    def drive_wall(
        self,
        k: int,  # noqa: ARG002
        point: FloatArray,  # noqa: ARG002
        rotation: FloatArray,  # noqa: ARG002
        velocity: FloatArray,  # noqa: ARG002
        rate: FloatArray,  # noqa: ARG002
    ) -> None:
        """Put plane ``k`` at ``point`` [m], turned by ``rotation`` since time 0, with a velocity [m/s] and a spin [rad/s]."""
        raise TypeError(f"{type(self).__name__} prescribes no motion: its capabilities must not say so")

    def drive_sphere(self, i: int, place: FloatArray) -> None:  # noqa: ARG002
        """Put sphere ``i`` at ``place`` [m] with its velocity and spin of time 0."""
        raise TypeError(f"{type(self).__name__} prescribes no motion: its capabilities must not say so")
