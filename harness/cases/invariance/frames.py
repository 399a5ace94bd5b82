"""A scene in other units, along turned axes, in a moving frame; and its history brought back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import (
    ContactLaw,
    Disks,
    PlaneSegment,
    PlaneWall,
    Scene,
    Spheres,
    SphereScene,
    Wall,
    WallSegment,
)
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.case import Setup

AnyLaw = TypeVar("AnyLaw", ContactLaw, SphereLaw)


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Observer of a scene: ``x' = length (turn(angle) x + velocity t)``, ``t' = time t``, ``m' = mass m``.

    Parameters
    ----------
    length, mass, time : float
        Numbers in the observer's units per SI unit, > 0.
    angle : float
        Rotation of the scene [rad], counter-clockwise.
    velocity : tuple of float
        Velocity of the scene after the rotation [m/s].
    """

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0
    angle: float = 0.0
    velocity: tuple[float, ...] = (0.0, 0.0)

    @property
    def force(self) -> float:
        """Number of a force of 1 N."""
        return self.mass * self.length / self.time**2

    def turn(self, vectors: object, *, back: bool = False) -> FloatArray:
        """Vectors, shape (..., 2), turned by the angle; left alone to the last bit where it is 0."""
        array = np.asarray(vectors, dtype=np.float64)
        if self.angle == 0.0:
            return array
        c, s = math.cos(self.angle), math.sin(-self.angle if back else self.angle)
        return np.stack([c * array[..., 0] - s * array[..., 1], s * array[..., 0] + c * array[..., 1]], axis=-1)

    def setup(self, setup: Setup, settings: Mapping[str, tuple[float, int, int]] = MappingProxyType({})) -> Setup:
        """The same problem as this observer sees it.

        Parameters
        ----------
        setup : Setup
            The original problem in SI units.
        settings : mapping
            Settings of engines that have a dimension: SI value and the powers of length and time in it. They become options.
        """
        options = {
            name: value * self.length**of_length * self.time**of_time
            for name, (value, of_length, of_time) in settings.items()
            if (self.length, self.time) != (1.0, 1.0)
        }
        return replace(setup, scene=self.scene(setup.scene), numerics=self._numerics(setup.numerics, options))

    def history(self, history: History) -> History:
        """The observer's history in the terms of the original scene; energies are left out, a moving observer has others."""
        length, time = self.length, self.time
        offset = np.outer(history.t / time, self.velocity)[:, None, :]
        return replace(
            history,
            t=history.t / time,
            x=self.turn(history.x / length - offset, back=True),
            v=self.turn(history.v * (time / length) - np.asarray(self.velocity), back=True),
            omega=history.omega * time,
            gap=history.gap / length,
            fn=history.fn / self.force,
            fs=history.fs / self.force,
            wall_point=self.turn(history.wall_point / length - offset, back=True),
            wall_angle=history.wall_angle - self.angle,
            wall_force=self.turn(history.wall_force / self.force, back=True),
            energy={},
        )

    def law(self, law: AnyLaw) -> AnyLaw:
        """A contact law in the observer's units."""
        powers = {"kn": 0, "ks": 0, "e_star": -1, "g_star": -1, "surface_energy": 0}
        stiffness = self.mass / self.time**2
        scaled = {
            name: getattr(law, name) * stiffness * self.length**n for name, n in powers.items() if hasattr(law, name)
        }
        resisted = {name: each for name in ("rolling", "twisting") if (each := getattr(law, name, None)) is not None}
        moment = self.force * self.length
        turning = {name: replace(each, kr=each.kr * moment) for name, each in resisted.items()}
        return replace(law, **scaled, **turning)

    def _speed(self, vectors: object) -> FloatArray:
        moving: FloatArray = self.turn(vectors) + np.asarray(self.velocity)
        return moving * (self.length / self.time)

    def _numerics(self, numerics: Numerics, options: Mapping[str, float]) -> Numerics:
        contact_dt = numerics.contact_dt
        return numerics.replace(
            dt=numerics.dt * self.time,
            contact_dt=None if contact_dt is None else contact_dt * self.time,
            options={**numerics.options, **options},
        )

    def scene(self, scene: Any) -> Any:
        """The scene as this observer sees it."""
        return self._scene(scene)

    def _scene(self, scene: Scene) -> Scene:
        disks = scene.disks
        return scene.replace(
            disks=Disks(
                x=self.turn(disks.x) * self.length,
                v=self._speed(disks.v),
                omega=disks.omega / self.time,
                radius=disks.radius * self.length,
                mass=disks.mass * self.mass,
                inertia=disks.inertia * (self.mass * self.length**2),
                rotating=disks.rotating,
                held=disks.held,
            ),
            disk_disk=self.law(scene.disk_disk),
            walls=tuple(self._wall(wall) for wall in scene.walls),
            gravity=tuple((self.turn(scene.gravity) * (self.length / self.time**2)).tolist()),
            xi=scene.xi / self.time,
            initial_shear={pair: force * self.force for pair, force in scene.initial_shear.items()},
        )

    def _wall(self, wall: Wall) -> Wall:
        motion = list(wall.motion)
        if any(self.velocity) and (not motion or math.isfinite(motion[-1].duration)):
            motion.append(WallSegment())  # the wall rests after its last segment, in its own frame
        return replace(
            wall,
            point=tuple((self.turn(wall.point) * self.length).tolist()),
            normal=tuple(self.turn(wall.normal).tolist()),
            law=self.law(wall.law),
            motion=tuple(self._segment(segment) for segment in motion),
        )

    def _segment(self, segment: WallSegment) -> WallSegment:
        """Of a translation along straight lines, which is all that the cases seen by an observer have.

        Raises
        ------
        ValueError
            If the wall turns or swings.
        """
        if segment.angular_velocity or any(segment.amplitude) or any(segment.tan_lever):
            raise ValueError(f"walls that turn or swing cannot be seen from another frame: {segment}")
        return WallSegment(
            duration=segment.duration * self.time, velocity=tuple(self._speed(segment.velocity).tolist())
        )


MIRROR = np.array([2.0, -1.0, 2.0]) / 3.0
"""Normal of the plane that scenes in space are mirrored at, through the origin."""


@dataclass(frozen=True, kw_only=True)
class SpaceFrame(Frame):
    """Observer of a scene in space: turned by ``angle`` about ``axis`` (a unit vector), then mirrored at a plane if ``mirror``.

    Spins are axial vectors: a mirror turns them the other way round.
    """

    velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    mirror: bool = False

    @property
    def matrix(self) -> FloatArray:
        """Orthogonal matrix, shape (3, 3)."""
        u = np.array(self.axis)
        across = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
        turned = np.eye(3) + math.sin(self.angle) * across + (1.0 - math.cos(self.angle)) * across @ across
        seen: FloatArray = (np.eye(3) - 2.0 * np.outer(MIRROR, MIRROR)) @ turned if self.mirror else turned
        return seen

    def turn(self, vectors: object, *, back: bool = False) -> FloatArray:
        """Vectors, shape (..., 3)."""
        array = np.asarray(vectors, dtype=np.float64)
        if self.angle == 0.0 and not self.mirror:
            return array
        turned: FloatArray = array @ (self.matrix if back else self.matrix.T)
        return turned

    def axial(self, vectors: object, *, back: bool = False) -> FloatArray:
        """Spins and moments, shape (..., 3)."""
        return self.turn(vectors, back=back) * (-1.0 if self.mirror else 1.0)

    def history(self, history: History) -> History:
        """As of the plane; shear forces and normals of planes are vectors here."""
        plain = super().history(history)
        return replace(
            plain,
            omega=self.axial(plain.omega, back=True),
            angle=self.axial(history.angle, back=True),
            fs=self.turn(plain.fs, back=True),
            wall_angle=self.turn(history.wall_angle, back=True),
        )

    def scene(self, scene: Any) -> Any:
        """The scene as this observer sees it.

        Raises
        ------
        ValueError
            If a sphere is held, along axes that are not the observer's.
        """
        spheres: Spheres = scene.spheres
        if spheres.held.any():
            raise ValueError("spheres that are held cannot be seen from another frame: they are held along axes")
        seen: SphereScene = scene.replace(
            spheres=replace(
                spheres,
                x=self.turn(spheres.x) * self.length,
                v=self._speed(spheres.v),
                omega=self.axial(spheres.omega) / self.time,
                radius=spheres.radius * self.length,
                mass=spheres.mass * self.mass,
                inertia=spheres.inertia * (self.mass * self.length**2),
            ),
            sphere_sphere=self.law(scene.sphere_sphere),
            walls=tuple(self._plane(wall) for wall in scene.walls),
            gravity=tuple((self.turn(scene.gravity) * (self.length / self.time**2)).tolist()),
        )
        return seen

    def _plane(self, wall: PlaneWall) -> PlaneWall:
        motion, begin, segments = list(wall.motion), 0.0, []
        if any(self.velocity) and (not motion or math.isfinite(motion[-1].duration)):
            motion.append(PlaneSegment())  # the plane rests after its last segment, in its own frame
        for segment in motion:
            segments.append(self._moved(segment, begin))
            begin += segment.duration
        return replace(
            wall,
            point=tuple((self.turn(wall.point) * self.length).tolist()),
            normal=tuple(self.turn(wall.normal).tolist()),
            law=self.law(wall.law),
            motion=tuple(segments),
        )

    def _moved(self, segment: PlaneSegment, begin: float) -> PlaneSegment:
        """A segment that begins at ``begin`` [s], whose pivot has moved with the scene until then."""
        pivot = segment.pivot
        if pivot is not None:
            there = (self.turn(pivot) + np.asarray(self.velocity) * begin) * self.length
            pivot = (float(there[0]), float(there[1]), float(there[2]))
        return replace(
            segment,
            duration=segment.duration * self.time,
            velocity=tuple(self._speed(segment.velocity).tolist()),
            angular_velocity=tuple((self.axial(segment.angular_velocity) / self.time).tolist()),
            pivot=pivot,
            amplitude=tuple((self.turn(segment.amplitude) * self.length).tolist()),
            frequency=segment.frequency / self.time,
        )
