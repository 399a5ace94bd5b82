"""Scenes in space: spheres, planes and their motion.

Bodies are numbered: spheres ``0 .. n-1``, walls ``n .. n+m-1``. ``n`` is the unit normal from body i to body j; the force of a contact on
body i is ``-fn n + fs``, with ``fn >= 0`` in compression and the vector ``fs`` at right angles to n.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.scene.bodies import BodiesAndWalls, walls_of
from ninedisk.core.scene.disks import flags_of, materials_of, rows_of, sizes_in_range
from ninedisk.core.spheres.law import SphereLaw
from ninedisk.core.validate import LARGEST, SMALLEST, all_of_kind, finite, kind_of, numbers, real, shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Spheres:
    """Rigid spheres as a structure of arrays (copied and made read-only); equal if all their numbers are.

    Parameters
    ----------
    x : array_like, shape (n, 3)
        Centres [m].
    radius, mass : array_like, shape (n,) or scalar
        Radii [m] and masses [kg], > 0.
    inertia : array_like, shape (n,), scalar or None
        Moments of inertia about any axis through the centre [kg m^2], > 0; None: uniform spheres, ``(2/5) m R^2``.
    v, omega : array_like, shape (n, 3), optional
        Velocities [m/s] and spins [rad/s] at time 0.
    rotating : array_like of bool, shape (n,) or scalar
        False: the sphere keeps its spin whatever torque acts.
    held : array_like of bool, shape (n, 3) or scalar
        True: the sphere keeps this component of its velocity whatever force acts.
    material : sequence of n str, or str
        Names of what the spheres are made of, which `SphereScene.laws` refers to.

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.
    """

    x: FloatArray
    radius: FloatArray
    mass: FloatArray
    inertia: FloatArray = None  # type: ignore[assignment]
    v: FloatArray = None  # type: ignore[assignment]
    omega: FloatArray = None  # type: ignore[assignment]
    rotating: NDArray[np.bool_] = True  # type: ignore[assignment]
    held: NDArray[np.bool_] = False  # type: ignore[assignment]
    material: tuple[str, ...] = ""  # type: ignore[assignment]

    def __post_init__(self) -> None:
        x = rows_of("spheres.x", self.x, 3)
        n = len(x)

        def column(name: str, value: Any) -> FloatArray:
            array = numbers(f"spheres.{name}", value)
            return finite(f"spheres.{name}", np.full(n, array) if array.ndim == 0 else array, (n,))

        radius, mass = column("radius", self.radius), column("mass", self.mass)
        sizes_in_range("spheres.radius", radius)
        sizes_in_range("spheres.mass", mass)
        with np.errstate(over="ignore"):  # an infinite one is refused by name below
            uniform = 0.4 * mass * radius**2
        inertia = column("inertia", uniform if self.inertia is None else self.inertia)
        sizes_in_range("spheres.inertia", inertia, SMALLEST**2, LARGEST**2)
        object.__setattr__(self, "x", finite("spheres.x", x, (n, 3), most=LARGEST))
        for name in ("v", "omega"):
            given = getattr(self, name)
            rows = np.zeros((n, 3)) if given is None else rows_of(f"spheres.{name}", given, 3)
            object.__setattr__(self, name, finite(f"spheres.{name}", rows, (n, 3)))
        object.__setattr__(self, "radius", radius)
        object.__setattr__(self, "mass", mass)
        object.__setattr__(self, "inertia", inertia)
        object.__setattr__(self, "rotating", flags_of("spheres.rotating", self.rotating, (n,), "one for each sphere"))
        object.__setattr__(self, "held", flags_of("spheres.held", self.held, (n, 3), "three (x, y, z) for each sphere"))
        object.__setattr__(self, "material", materials_of("spheres.material", self.material, n))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Spheres):
            return NotImplemented
        return all(np.array_equal(mine, getattr(other, name)) for name, mine in vars(self).items())

    __hash__ = None  # type: ignore[assignment]

    def __len__(self) -> int:
        return int(self.x.shape[0])

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Which spheres stay where they are, shape (n,): held at rest, and not turning. They have no contact with walls and each other."""
        still = ~self.v.any(axis=1) & ~self.omega.any(axis=1)
        fixed: NDArray[np.bool_] = self.held.all(axis=1) & still & ~self.rotating
        return fixed


@dataclass(frozen=True, kw_only=True)
class PlaneSegment:
    """One piece of a plane's prescribed motion, exact in time.

    With ``tau`` the time since the segment began, the plane's pivot is displaced by ``velocity tau + amplitude (sin(frequency tau + phase)
    - sin(phase))``, and the plane turns about an axis through it by ``angular_velocity tau``.

    Parameters
    ----------
    duration : float
        Length of the segment [s], > 0; ``inf`` is allowed for the last one.
    velocity, angular_velocity, amplitude : (float, float, float)
        [m/s], [rad/s], [m].
    pivot : (float, float, float) or None
        A point of the axis [m] at the segment's beginning; None: the plane's own reference point.
    frequency, phase : float
        Angular frequency [rad/s] and phase [rad] of the harmonic translation.
    """

    duration: float = float("inf")
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pivot: tuple[float, float, float] | None = None
    amplitude: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frequency: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        duration = real(self.duration)
        if not (SMALLEST <= duration <= LARGEST or duration == np.inf):
            raise InvalidSceneError(
                f"segment duration = {shown(self.duration)} is not allowed: it must lie between {SMALLEST:g} and {LARGEST:g} s, or be inf "
                "for the last segment"
            )
        object.__setattr__(self, "duration", duration)
        for name in ("velocity", "angular_velocity", "amplitude", "pivot"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, _three(f"segment {name}", given))
        for name in ("frequency", "phase"):
            object.__setattr__(self, name, float(finite(f"segment {name}", getattr(self, name), (), most=LARGEST)))


@dataclass(frozen=True, kw_only=True)
class PlaneWall:
    """A rigid half-space with prescribed motion; spheres live on the side its normal points to.

    Parameters
    ----------
    name : str
        Unique name, used in messages and figures.
    point, normal : (float, float, float)
        A point of the surface [m] at time 0, and the normal into the free side; normalised here.
    law : SphereLaw
        Contact of spheres with this wall, where `SphereScene.laws` has none for their materials.
    material : str
        Name of what it is made of; "" where the scene names no materials.
    motion : sequence of PlaneSegment
        Segments one after the other from time 0; the wall rests after the last one.
    """

    name: str
    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    law: SphereLaw
    material: str = ""
    motion: tuple[PlaneSegment, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InvalidSceneError(f"the name of a wall must be a string, not {shown(self.name)}")
        object.__setattr__(self, "point", _three(f"wall {self.name!r} point", self.point))
        normal = finite(f"wall {self.name!r} normal", self.normal, (3,))
        largest = float(np.abs(normal).max())
        if largest == 0.0:
            raise InvalidSceneError(f"wall {self.name!r} has a zero normal: give it a direction")
        if abs(float(np.linalg.norm(normal)) - 1.0) > 4e-16:  # a unit normal stays as it is at every copy
            scaled = np.ldexp(normal, -int(np.frexp(largest)[1]))
            normal = scaled / np.linalg.norm(scaled)
        object.__setattr__(self, "normal", tuple(float(each) for each in normal))
        kind_of(f"wall {self.name!r} law", self.law, SphereLaw)
        kind_of(f"wall {self.name!r} material", self.material, str)
        motion = all_of_kind(f"wall {self.name!r} motion", self.motion, PlaneSegment)
        if not all(np.isfinite(segment.duration) for segment in motion[:-1]):
            raise InvalidSceneError(
                f"wall {self.name!r}: only the last segment may be endless, the others need a finite duration"
            )
        object.__setattr__(self, "motion", motion)


@dataclass(frozen=True, kw_only=True)
class SphereScene(BodiesAndWalls[SphereLaw]):
    """Everything that physics in space needs to know; equal if all values are.

    Parameters
    ----------
    spheres : Spheres
    walls : sequence of PlaneWall
    sphere_sphere : SphereLaw
        Law of every contact between two spheres, where ``laws`` has none for their materials.
    gravity : (float, float, float)
        Acceleration [m/s^2].
    laws : mapping from pair of names to SphereLaw
        Laws of contacts between two materials, in either order.

    Raises
    ------
    InvalidSceneError
        Naming the offending body, its value and the allowed range.
    """

    spheres: Spheres
    sphere_sphere: SphereLaw
    walls: tuple[PlaneWall, ...] = ()
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    laws: Mapping[tuple[str, str], SphereLaw] = field(default_factory=dict)

    dimension: ClassVar[int] = 3
    noun: ClassVar[str] = "sphere"
    __hash__ = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        kind_of("spheres", self.spheres, Spheres)
        kind_of("sphere_sphere", self.sphere_sphere, SphereLaw)
        object.__setattr__(self, "walls", all_of_kind("walls", self.walls, PlaneWall))
        object.__setattr__(self, "gravity", _three("gravity", self.gravity))
        self._check_names()
        self._check_centres()
        object.__setattr__(self, "laws", self._checked_laws(SphereLaw))

    @property
    def bodies(self) -> Spheres:
        """The spheres."""
        return self.spheres

    @property
    def law_of_bodies(self) -> SphereLaw:
        """Law between spheres that no materials decide."""
        return self.sphere_sphere

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; `from_dict` is its inverse, to the last bit."""
        spheres: dict[str, Any] = {
            name: value.tolist() for name, value in vars(self.spheres).items() if name != "material"
        }
        if any(self.spheres.material):
            spheres["material"] = list(self.spheres.material)
        data: dict[str, Any] = {
            "dimension": 3,
            "spheres": spheres,
            "sphere_sphere": self.sphere_sphere.to_dict(),
            "walls": self._plain_walls(),
            "gravity": list(self.gravity),
        }
        if self.laws:
            data["laws"] = self._plain_laws()
        return data

    @classmethod
    def _fields_of(cls, data: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "walls": walls_of(data["walls"], PlaneWall, PlaneSegment, SphereLaw),
            "spheres": Spheres(**data["spheres"]),
            "sphere_sphere": SphereLaw.from_dict(data["sphere_sphere"]),
            "gravity": data["gravity"],
            "laws": {(one, two): SphereLaw.from_dict(law) for one, two, law in data.get("laws", ())},
        }


def _three(name: str, value: Any) -> tuple[float, float, float]:
    x, y, z = finite(name, value, (3,), most=LARGEST)
    return float(x), float(y), float(z)
