"""Half-plane walls and their prescribed motion."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.validate import LARGEST, SMALLEST, all_of_kind, finite, kind_of, real, shown


@dataclass(frozen=True, kw_only=True)
class WallSegment:
    """One piece of a wall's prescribed motion, exact in time.

    With ``tau`` the time since the segment began, the wall's pivot is displaced by

    ``velocity tau + amplitude (sin(frequency tau + phase) - sin(phase)) + tan_lever tan(tan_rate tau)``

    and the wall turns about that pivot by ``angular_velocity tau``. The last term is the exact motion of
    a cap that follows a side wall rotating at a constant rate.

    Parameters
    ----------
    duration : float
        Length of the segment [s], > 0; ``inf`` is allowed for the last one.
    velocity : (float, float)
        Translation velocity [m/s].
    angular_velocity : float
        Rotation rate [rad/s], counter-clockwise positive.
    pivot : (float, float) or None
        Centre of rotation [m] at the segment's beginning; None: the wall's own reference point.
    amplitude : (float, float)
        Amplitude of a harmonic translation [m].
    frequency, phase : float
        Angular frequency [rad/s] and phase [rad] of the harmonic translation.
    tan_lever : (float, float)
        Coefficient of the tangent term [m].
    tan_rate : float
        Rate of the tangent term [rad/s].
    """

    duration: float = float("inf")
    velocity: tuple[float, float] = (0.0, 0.0)
    angular_velocity: float = 0.0
    pivot: tuple[float, float] | None = None
    amplitude: tuple[float, float] = (0.0, 0.0)
    frequency: float = 0.0
    phase: float = 0.0
    tan_lever: tuple[float, float] = (0.0, 0.0)
    tan_rate: float = 0.0

    def __post_init__(self) -> None:
        duration = real(self.duration)
        if not duration > 0.0:
            raise InvalidSceneError(
                f"segment duration = {shown(self.duration)} is not allowed: it must be a number > 0 (inf for the last segment)"
            )
        if not (SMALLEST <= duration <= LARGEST or duration == np.inf):
            raise InvalidSceneError(
                f"segment duration = {duration!r} is not allowed: it must lie between {SMALLEST:g} and {LARGEST:g} s, or be inf"
            )
        object.__setattr__(self, "duration", duration)
        for name in ("velocity", "amplitude", "tan_lever"):
            array = finite(f"segment {name}", getattr(self, name), (2,), most=LARGEST)
            object.__setattr__(self, name, (float(array[0]), float(array[1])))
        if self.pivot is not None:
            pivot = finite("segment pivot", self.pivot, (2,), most=LARGEST)
            object.__setattr__(self, "pivot", (float(pivot[0]), float(pivot[1])))
        for name in ("angular_velocity", "frequency", "phase", "tan_rate"):
            object.__setattr__(self, name, float(finite(f"segment {name}", getattr(self, name), (), most=LARGEST)))
        if self.tan_rate and not abs(self.tan_rate * self.duration) < np.pi / 2:
            raise InvalidSceneError(
                f"tan_rate * duration = {self.tan_rate * self.duration:g} is not allowed: it must stay below pi/2"
            )


@dataclass(frozen=True, kw_only=True)
class Wall:
    """A rigid half-plane with prescribed motion; disks live on the side its normal points to.

    Parameters
    ----------
    name : str
        Unique name, used in messages and figures.
    point : (float, float)
        A point of the surface [m] at time 0.
    normal : (float, float)
        Normal into the free side; normalised here.
    law : ContactLaw
        Contact of disks with this wall, where `Scene.laws` has none for their materials.
    material : str
        Name of what it is made of; "" where the scene names no materials.
    motion : sequence of WallSegment
        Segments one after the other from time 0; the wall rests after the last one.
    """

    name: str
    point: tuple[float, float]
    normal: tuple[float, float]
    law: ContactLaw
    material: str = ""
    motion: tuple[WallSegment, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InvalidSceneError(f"the name of a wall must be a string, not {shown(self.name)}")
        point = finite(f"wall {self.name!r} point", self.point, (2,), most=LARGEST)
        normal = finite(f"wall {self.name!r} normal", self.normal, (2,))
        largest = float(np.abs(normal).max())
        if largest == 0.0:
            raise InvalidSceneError(f"wall {self.name!r} has a zero normal: give it a direction")
        kind_of(f"wall {self.name!r} law", self.law, ContactLaw)
        kind_of(f"wall {self.name!r} material", self.material, str)
        motion = all_of_kind(f"wall {self.name!r} motion", self.motion, WallSegment)
        for segment in motion[:-1]:
            if not np.isfinite(segment.duration):
                raise InvalidSceneError(
                    f"wall {self.name!r}: only the last segment may be endless, the others need a finite duration"
                )
        object.__setattr__(self, "point", (float(point[0]), float(point[1])))
        # A unit normal stays as it is: dividing by a length one unit in the last place off 1 would move it at every copy.
        if abs(hypot(normal[0], normal[1]) - 1.0) > 4e-16:
            # A power of two first, which rounds nothing: the length of a tiny or huge normal would under- or overflow.
            scaled = np.ldexp(normal, -int(np.frexp(largest)[1]))
            normal = scaled / np.hypot(scaled[0], scaled[1])
        object.__setattr__(self, "normal", (float(normal[0]), float(normal[1])))
        object.__setattr__(self, "motion", motion)
