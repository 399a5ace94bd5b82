"""A scene in other units, along turned axes, in a moving frame; and its history brought back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.case import Setup


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Observer of a scene: ``x' = length (turn(angle) x + velocity t)``, ``t' = time t``, ``m' = mass m``.

    Parameters
    ----------
    length, mass, time : float
        Numbers in the observer's units per SI unit, > 0.
    angle : float
        Rotation of the scene [rad], counter-clockwise.
    velocity : (float, float)
        Velocity of the scene after the rotation [m/s].
    """

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0
    angle: float = 0.0
    velocity: tuple[float, float] = (0.0, 0.0)

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
        return replace(setup, scene=self._scene(setup.scene), numerics=self._numerics(setup.numerics, options))

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
            disk_disk=self._law(scene.disk_disk),
            walls=tuple(self._wall(wall) for wall in scene.walls),
            gravity=tuple((self.turn(scene.gravity) * (self.length / self.time**2)).tolist()),
            xi=scene.xi / self.time,
            initial_shear={pair: force * self.force for pair, force in scene.initial_shear.items()},
        )

    def _law(self, law: ContactLaw) -> ContactLaw:
        stiffness = self.mass / self.time**2
        return replace(law, kn=law.kn * stiffness, ks=law.ks * stiffness)

    def _wall(self, wall: Wall) -> Wall:
        motion = list(wall.motion)
        if any(self.velocity) and (not motion or math.isfinite(motion[-1].duration)):
            motion.append(WallSegment())  # the wall rests after its last segment, in its own frame
        return replace(
            wall,
            point=tuple((self.turn(wall.point) * self.length).tolist()),
            normal=tuple(self.turn(wall.normal).tolist()),
            law=self._law(wall.law),
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
