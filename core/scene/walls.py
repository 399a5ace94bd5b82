"""Rigid walls, half-planes in 2D and half-spaces in 3D, and their prescribed motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from typing import Any, ClassVar, Self

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.validate import LARGEST, SMALLEST, all_of_kind, finite, kind_of, real, short_repr


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One piece of a wall's prescribed motion, exact in time; vectors have d = 2 or 3 numbers, d the dimension.

    With ``tau`` the time since the segment began, the wall's pivot is displaced by
    ``velocity tau + amplitude (sin(frequency tau + phase) - sin(phase))``, and the wall turns about that pivot, in 3D about an axis
    through it, by ``angular_velocity tau``.

    Parameters
    ----------
    duration : float
        Length of the segment [s], > 0; ``inf`` is allowed for the last one.
    velocity : d floats, optional
        Translation velocity [m/s].
    angular_velocity : float in 2D, 3 floats in 3D, optional
        Rotation rate [rad/s], counter-clockwise positive in 2D.
    pivot : d floats or None
        Centre of rotation, or a point of its axis [m], at the segment's beginning; None: the wall's own reference point.
    amplitude : d floats, optional
        Amplitude of a harmonic translation [m].
    frequency, phase : float
        Angular frequency [rad/s] and phase [rad] of the harmonic translation.
    """

    duration: float = float("inf")
    velocity: Any
    angular_velocity: Any
    pivot: Any = None
    amplitude: Any
    frequency: float = 0.0
    phase: float = 0.0

    dimension: ClassVar[int]

    def __post_init__(self) -> None:
        duration = real(self.duration)
        if not duration > 0.0:
            raise InvalidSceneError(
                f"segment duration = {short_repr(self.duration)} is not allowed: it must be a number > 0 (inf for the last segment)"
            )
        if not (SMALLEST <= duration <= LARGEST or duration == np.inf):
            raise InvalidSceneError(
                f"segment duration = {duration!r} is not allowed: it must lie between {SMALLEST:g} and {LARGEST:g} s, or be inf"
            )
        object.__setattr__(self, "duration", duration)
        for name in ("velocity", "amplitude"):
            object.__setattr__(self, name, vector(f"segment {name}", getattr(self, name), self.dimension))
        if self.pivot is not None:
            object.__setattr__(self, "pivot", vector("segment pivot", self.pivot, self.dimension))
        for name in ("frequency", "phase"):
            object.__setattr__(self, name, _number(f"segment {name}", getattr(self, name)))
        spin = self.angular_velocity
        turns = (
            _number("segment angular_velocity", spin)
            if self.dimension == 2
            else vector("segment angular_velocity", spin, 3)
        )
        object.__setattr__(self, "angular_velocity", turns)


@dataclass(frozen=True, kw_only=True)
class WallSegment(Segment):
    """One piece of a wall's prescribed motion in 2D, exact in time.

    With ``tau`` the time since the segment began, the wall's pivot is displaced by
    ``velocity tau + amplitude (sin(frequency tau + phase) - sin(phase)) + tan_lever tan(tan_rate tau)``, and the wall turns about that
    pivot by ``angular_velocity tau``. The tangent is the exact motion of a cap that follows a side wall rotating at a constant rate.

    Parameters
    ----------
    duration, velocity, angular_velocity, pivot, amplitude, frequency, phase
        As in `Segment`, with d = 2.
    tan_lever : (float, float)
        Coefficient of the tangent term [m].
    tan_rate : float
        Rate of the tangent term [rad/s].

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.

    Examples
    --------
    A wall that shakes by 1 cm at 100 rad/s moves at 1 m/s at most:

    >>> shaking = WallSegment(amplitude=(0.01, 0.0), frequency=100.0)
    >>> shaking.amplitude[0] * shaking.frequency
    1.0
    """

    velocity: tuple[float, float] = (0.0, 0.0)
    angular_velocity: float = 0.0
    pivot: tuple[float, float] | None = None
    amplitude: tuple[float, float] = (0.0, 0.0)
    tan_lever: tuple[float, float] = (0.0, 0.0)
    tan_rate: float = 0.0

    dimension: ClassVar[int] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "tan_lever", vector("segment tan_lever", self.tan_lever, 2))
        object.__setattr__(self, "tan_rate", _number("segment tan_rate", self.tan_rate))
        if self.tan_rate and not abs(self.tan_rate * self.duration) < np.pi / 2:
            raise InvalidSceneError(
                f"tan_rate * duration = {self.tan_rate * self.duration:g} is not allowed: it must stay below pi/2"
            )


@dataclass(frozen=True, kw_only=True)
class PlaneSegment(Segment):
    """One piece of a wall's prescribed motion in 3D, exact in time.

    With ``tau`` the time since the segment began, the wall's pivot is displaced by
    ``velocity tau + amplitude (sin(frequency tau + phase) - sin(phase))``, and the wall turns about an axis through that pivot by
    ``angular_velocity tau``.

    Parameters
    ----------
    duration, velocity, angular_velocity, pivot, amplitude, frequency, phase
        As in `Segment`, with d = 3.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.

    Examples
    --------
    A plane that sinks at 0.5 m/s for 4 s moves by 2 m:

    >>> sinking = PlaneSegment(duration=4.0, velocity=(0.0, 0.0, -0.5))
    >>> sinking.duration * sinking.velocity[2]
    -2.0
    """

    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pivot: tuple[float, float, float] | None = None
    amplitude: tuple[float, float, float] = (0.0, 0.0, 0.0)

    dimension: ClassVar[int] = 3


@dataclass(frozen=True, kw_only=True)
class AnyWall:
    """A rigid half-plane (2D) or half-space (3D) with prescribed motion; bodies live on the side its normal points to.

    Parameters
    ----------
    name : str
        Unique name, used in messages and figures.
    point, normal : d floats
        A point of the surface [m] at time 0, and the normal into the free side; normalised here.
    law : ContactLaw
        Contact of bodies with this wall, where the scene's ``laws`` have none for their materials.
    material : str
        Name of what it is made of; "" where the scene names no materials.
    motion : sequence of Segment
        Segments one after the other from time 0; the wall rests after the last one.
    """

    name: str
    point: Any
    normal: Any
    law: ContactLaw
    material: str = ""
    motion: tuple[Any, ...] = ()

    dimension: ClassVar[int]
    segment: ClassVar[type[Segment]]

    def __post_init__(self) -> None:
        d = self.dimension
        if not isinstance(self.name, str):
            raise InvalidSceneError(f"the name of a wall must be a string, not {short_repr(self.name)}")
        object.__setattr__(self, "point", vector(f"wall {self.name!r} point", self.point, d))
        normal = finite(f"wall {self.name!r} normal", self.normal, (d,))
        largest = float(np.abs(normal).max())
        if largest == 0.0:
            raise InvalidSceneError(f"wall {self.name!r} has a zero normal: give it a direction")
        kind_of(f"wall {self.name!r} law", self.law, ContactLaw).check_dimension(f"law of wall {self.name!r}", d)
        kind_of(f"wall {self.name!r} material", self.material, str)
        motion = all_of_kind(f"wall {self.name!r} motion", self.motion, self.segment)
        for part in motion[:-1]:
            if not np.isfinite(part.duration):
                raise InvalidSceneError(
                    f"wall {self.name!r}: only the last segment may be endless, the others need a finite duration"
                )
        # A unit normal stays as it is: dividing by a length one unit in the last place off 1 would move it at every copy.
        if abs(hypot(*normal) - 1.0) > 4e-16:
            # A power of two first, which rounds nothing: the length of a tiny or huge normal would under- or overflow.
            scaled = np.ldexp(normal, -int(np.frexp(largest)[1]))
            normal = scaled / (np.hypot(*scaled) if d == 2 else np.linalg.norm(scaled))
        object.__setattr__(self, "normal", tuple(float(each) for each in normal))
        object.__setattr__(self, "motion", motion)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "name": self.name,
            "point": list(self.point),
            "normal": list(self.normal),
            "law": self.law.to_dict(self.dimension),
            "motion": [plain(part) for part in self.motion],
            **({"material": self.material} if self.material else {}),
        }

    @classmethod
    def from_dict(cls, data: Any) -> Self:
        """Build a wall from `to_dict` data."""
        motion = tuple(cls.segment(**endless(part, "duration")) for part in data["motion"])
        return cls(**{**data, "law": ContactLaw.from_dict(data["law"]), "motion": motion})


@dataclass(frozen=True, kw_only=True)
class Wall(AnyWall):
    """A rigid half-plane in 2D with prescribed motion; bodies live on the side its normal points to.

    Parameters
    ----------
    name, point, normal, law, material, motion
        As in `AnyWall`, with d = 2.

    Raises
    ------
    InvalidSceneError
        If a value is not allowed.

    Examples
    --------
    A slope of 3 in 4; the normal into the free side gets the length 1:

    >>> Wall(name="slope", point=(0.0, 0.0), normal=(-3.0, 4.0), law=ContactLaw(kn=1e6)).normal
    (-0.6, 0.8)
    """

    point: tuple[float, float]
    normal: tuple[float, float]
    motion: tuple[WallSegment, ...] = ()

    dimension: ClassVar[int] = 2
    segment: ClassVar[type[Segment]] = WallSegment


@dataclass(frozen=True, kw_only=True)
class PlaneWall(AnyWall):
    """A rigid half-space in 3D with prescribed motion; bodies live on the side its normal points to.

    Parameters
    ----------
    name, point, normal, law, material, motion
        As in `AnyWall`, with d = 3.

    Raises
    ------
    InvalidSceneError
        If a value is not allowed.

    Examples
    --------
    A slope of 3 in 4; the normal into the free side gets the length 1:

    >>> PlaneWall(name="slope", point=(0.0, 0.0, 0.0), normal=(3.0, 0.0, 4.0), law=ContactLaw(kn=1e6)).normal
    (0.6, 0.0, 0.8)
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    motion: tuple[PlaneSegment, ...] = ()

    dimension: ClassVar[int] = 3
    segment: ClassVar[type[Segment]] = PlaneSegment


def vector(name: str, value: Any, dimension: int) -> tuple[Any, ...]:
    """``value`` as so many floats, or `InvalidSceneError`."""
    return tuple(float(each) for each in finite(name, value, (dimension,), most=LARGEST))


def _number(name: str, value: Any) -> float:
    return float(finite(name, value, (), most=LARGEST))


def plain(record: Any) -> dict[str, Any]:
    """Fields of a flat record as JSON data; an infinite time becomes the string ``"inf"``."""

    def written(value: Any) -> Any:
        if isinstance(value, tuple):
            return list(value)
        return "inf" if isinstance(value, float) and np.isinf(value) else value

    return {name: written(value) for name, value in vars(record).items()}


def endless(record: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the same fields, with the time ``name`` infinite where it is the string ``"inf"``."""
    return {**record, name: np.inf} if record.get(name) == "inf" else dict(record)
