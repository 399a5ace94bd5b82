"""Rigid bodies of a scene: disks and grains in 2D, spheres and boxes in 3D."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, SMALLEST, finite, items_of, numbers, rows_of, short_repr


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
    """Rigid bodies as a structure of arrays (copied and made read-only), d = 2 or 3 the dimension.

    Two are equal if all their numbers are; they cannot be keys of a dictionary.

    Parameters
    ----------
    x : array_like, shape (n, d)
        Centres [m]; of a grain with an outline, its centroid.
    radius, mass : array_like, shape (n,) or scalar
        Radii [m] and masses [kg], > 0. The radius of a grain with an outline is that of a circle about its centroid that encloses it:
        the contact search uses it, contacts do not.
    inertia : array_like, shape (n,), scalar or None
        Moments of inertia about the centre [kg m^2], > 0; None means uniform bodies, ``m R^2 / 2`` of disks and ``(2/5) m R^2`` of
        spheres.
    v : array_like, shape (n, d), optional
        Velocities [m/s] at time 0.
    omega : array_like, shape (n,) in 2D, (n, 3) in 3D, optional
        Spins [rad/s] at time 0, counter-clockwise positive in 2D.
    rotating : array_like of bool, shape (n,) or scalar
        False: the body keeps its spin whatever torque acts (a block in the shape of a disk).
    held : array_like of bool, shape (n, d) or scalar
        True: the body keeps this component of its velocity whatever force acts (a prescribed motion).
    material : sequence of n str, or str
        Names of what the bodies are made of, which the scene's ``laws`` refer to; "" where the scene names no materials.

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

    dimension: ClassVar[int]
    noun: ClassVar[str]
    """What a body is called in messages."""
    __hash__ = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        d, name = self.dimension, f"{self.noun}s"
        x = rows_of(f"{name}.x", self.x, d)
        n = len(x)
        radius, mass = self._column("radius", self.radius, n), self._column("mass", self.mass, n)
        sizes_in_range(f"{name}.radius", radius)
        sizes_in_range(f"{name}.mass", mass)
        inertia = self._checked_inertia(radius, mass)
        checked: dict[str, Any] = {
            "x": finite(f"{name}.x", x, (n, d), most=LARGEST),
            "v": self._vectors("v", self.v, n),
            "omega": self._column("omega", 0.0 if self.omega is None else self.omega, n)
            if d == 2
            else self._vectors("omega", self.omega, n),
            "radius": radius,
            "mass": mass,
            "inertia": inertia,
            "rotating": flags_of(f"{name}.rotating", self.rotating, (n,), f"one for each {self.noun}"),
            "held": flags_of(
                f"{name}.held",
                self.held,
                (n, d),
                f"{'a pair (x, y)' if d == 2 else 'three (x, y, z)'} for each {self.noun}",
            ),
            "material": materials_of(f"{name}.material", self.material, n),
        }
        for field, value in checked.items():
            object.__setattr__(self, field, value)

    def _checked_inertia(self, radius: FloatArray, mass: FloatArray) -> FloatArray:
        """Moments of inertia [kg m^2] as the class keeps them; those of uniform bodies where none are given."""
        with np.errstate(over="ignore"):  # an infinite one is refused by name below
            uniform = UNIFORM[self.dimension] * mass * radius**2
        inertia = self._column("inertia", uniform if self.inertia is None else self.inertia, len(mass))
        sizes_in_range(f"{self.noun}s.inertia", inertia, SMALLEST**2, LARGEST**2)
        return inertia

    def _column(self, field: str, value: ArrayLike, n: int, *, most: float = np.inf) -> FloatArray:
        array = numbers(f"{self.noun}s.{field}", value)
        return finite(f"{self.noun}s.{field}", np.full(n, array) if array.ndim == 0 else array, (n,), most=most)

    def _vectors(self, field: str, value: ArrayLike | None, n: int) -> FloatArray:
        name, shape = f"{self.noun}s.{field}", (n, self.dimension)
        return finite(name, np.zeros(shape) if value is None else rows_of(name, value, self.dimension), shape)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Bodies) or type(other) is not type(self):
            return NotImplemented
        return all(np.array_equal(mine, getattr(other, name)) for name, mine in vars(self).items())

    def __len__(self) -> int:
        return int(self.x.shape[0])

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Which bodies stay where they are, shape (n,): held at rest in all directions, and not turning.

        They bear contacts as a part of the ground does. Among themselves and with walls they have none: nothing could answer its
        forces. They may therefore touch and overlap.
        """
        still = ~self.v.any(axis=1) & (self.omega.reshape(len(self), -1) == 0.0).all(axis=1)
        fixed: NDArray[np.bool_] = self.held.all(axis=1) & still & ~self.rotating
        return fixed

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what most bodies lack is left out."""
        plain = {
            name: value.tolist() for name, value in vars(self).items() if name not in ("material", "outline", "angle")
        }
        if any(self.material):
            plain["material"] = list(self.material)
        return plain


@dataclass(frozen=True, kw_only=True, eq=False)
class Disks(Bodies):
    """Rigid disks and grains of other outlines in 2D.

    Parameters
    ----------
    x, radius, mass, inertia, v, omega, rotating, held, material
        As in `Bodies`, with d = 2. The moment of inertia of a grain with an outline must be given
        (`ninedisk.core.nurbs.mass.uniform_grain` gives the values of a uniform one).
    outline : array_like of int, shape (n,) or scalar
        Which of `Scene.outlines` is the boundary of the grain; -1: it is a disk.
    angle : array_like, shape (n,) or scalar
        Angles [rad] of the outlines at time 0, counter-clockwise positive: at 0 the body's frame has the scene's axes.

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.

    Examples
    --------
    >>> Disks(x=[[0.0, 1.0], [2.0, 1.0]], radius=[0.5, 1.0], mass=2.0).inertia
    array([0.25, 1.  ])
    """

    outline: NDArray[np.int64] = -1  # type: ignore[assignment]
    angle: FloatArray = 0.0  # type: ignore[assignment]

    dimension: ClassVar[int] = 2
    noun: ClassVar[str] = "disk"

    def __post_init__(self) -> None:
        n = len(rows_of("disks.x", self.x, 2))
        outline = _outline_numbers(self.outline, n)
        if self.inertia is None and np.any(outline >= 0):
            raise InvalidSceneError(
                f"disks.inertia is missing and grain {int(np.argmax(outline >= 0))} has an outline: give the moments of inertia "
                "(ninedisk.core.nurbs.mass.uniform_grain gives that of a uniform grain)"
            )
        super().__post_init__()
        object.__setattr__(self, "outline", outline)
        angle = (
            self._column("angle", self.angle, n, most=LARGEST) + 0.0
        )  # -0.0 becomes 0.0, which the JSON form leaves out
        angle.setflags(write=False)
        object.__setattr__(self, "angle", angle)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what most disks lack is left out."""
        plain = super().to_dict()
        if np.any(self.outline >= 0):
            plain["outline"] = self.outline.tolist()
        if np.any(self.angle):
            plain["angle"] = self.angle.tolist()
        return plain


@dataclass(frozen=True, kw_only=True, eq=False)
class Spheres(Bodies):
    """Rigid spheres and boxes in 3D.

    Parameters
    ----------
    x, mass, v, omega, rotating, held, material
        As in `Bodies`, with d = 3. ``omega`` of a box has the axes of the scene, like that of a sphere.
    radius : array_like, shape (n,) or scalar, optional
        Radii [m]. That of a box is the radius of a sphere about its centre that encloses it: the contact search uses it, contacts do
        not. It may be left out where all bodies are boxes.
    inertia : array_like, optional
        Moments of inertia about the centre [kg m^2], > 0: shape (n,) or scalar where all bodies are spheres; where some are boxes,
        shape (n, 3), about the axes of the body's frame. None means uniform bodies: ``(2/5) m R^2`` of spheres,
        ``m (b^2 + c^2)/3`` of boxes with the half edges b and c across the axis.
    half_sizes : array_like, shape (n, 3), optional
        Half the edges of boxes [m] along the axes of the body's frame, > 0; a row of zeros is a sphere. None: all are spheres.
    quaternion : array_like, shape (n, 4), optional
        Rotations from the bodies' frames to the scene's at time 0, as unit quaternions ``(w, x, y, z)``. None: the frames are parallel.

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.

    Examples
    --------
    A uniform sphere has the moment of inertia ``(2/5) m R^2``:

    >>> Spheres(x=[[0.0, 0.0, 1.0]], radius=0.5, mass=2.0).inertia
    array([0.2])

    A uniform box of 2 m x 4 m x 6 m:

    >>> box = Spheres(x=[[0.0, 0.0, 3.0]], mass=3.0, half_sizes=[[1.0, 2.0, 3.0]])
    >>> box.inertia, box.radius.round(9), box.boxes
    (array([[13., 10.,  5.]]), array([3.74165739]), array([ True]))
    """

    radius: FloatArray = None  # type: ignore[assignment]
    half_sizes: FloatArray = None  # type: ignore[assignment]
    quaternion: FloatArray = None  # type: ignore[assignment]

    dimension: ClassVar[int] = 3
    noun: ClassVar[str] = "sphere"

    def __post_init__(self) -> None:
        n = len(rows_of("spheres.x", self.x, 3))
        half = self._vectors("half_sizes", self.half_sizes, n)
        object.__setattr__(self, "half_sizes", half)
        boxes = self.boxes
        if np.any(half[boxes] <= 0.0):
            i = int(np.flatnonzero(boxes & (half <= 0.0).any(axis=1))[0])
            raise InvalidSceneError(
                f"spheres.half_sizes[{i}] = {half[i].tolist()} is not allowed: half the edges of a box must be > 0; a sphere has zeros"
            )
        turns = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (n, 4)) if self.quaternion is None else self.quaternion
        object.__setattr__(self, "quaternion", _unit_quaternions("spheres.quaternion", turns, n))
        diagonal = np.sqrt(np.sum(half**2, axis=1))
        if self.radius is None:
            if not boxes.all():
                raise InvalidSceneError(
                    f"spheres.radius is missing and body {int(np.argmin(boxes))} is a sphere: give the radii"
                )
            object.__setattr__(self, "radius", diagonal)
        super().__post_init__()
        open_ = np.flatnonzero(self.radius < diagonal * (1.0 - 1e-12))  # the round-off of a diagonal
        if len(open_):
            i = int(open_[0])
            raise InvalidSceneError(
                f"spheres.radius[{i}] = {self.radius[i]:g} is not allowed: the radius of a box encloses it, so it must be at least half "
                f"its diagonal, {diagonal[i]:g}; or leave it out where all bodies are boxes"
            )

    @property
    def boxes(self) -> NDArray[np.bool_]:
        """Which bodies are boxes, shape (n,)."""
        boxes: NDArray[np.bool_] = np.asarray(self.half_sizes.any(axis=1))
        return boxes

    def _checked_inertia(self, radius: FloatArray, mass: FloatArray) -> FloatArray:
        boxes = self.boxes
        if not boxes.any():
            return super()._checked_inertia(radius, mass)
        with np.errstate(over="ignore"):  # an infinite one is refused by name below
            square = self.half_sizes**2
            of_box = mass[:, None] * (square.sum(axis=1)[:, None] - square) / 3.0
            of_sphere = (UNIFORM[3] * mass * radius**2)[:, None]
            uniform = np.where(boxes[:, None], of_box, of_sphere)
        given = uniform if self.inertia is None else rows_of("spheres.inertia", self.inertia, 3)
        inertia = finite("spheres.inertia", given, (len(mass), 3))
        for k in range(3):
            sizes_in_range("spheres.inertia", inertia[:, k], SMALLEST**2, LARGEST**2)
        return inertia

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what scenes of spheres lack is left out."""
        plain = super().to_dict()
        if not self.boxes.any():
            del plain["half_sizes"]
        if not np.any(self.quaternion != [1.0, 0.0, 0.0, 0.0]):
            del plain["quaternion"]
        return plain


UNIT = 1e-9
"""How far the square of a quaternion's size may be from 1: what is farther is a mistake, not rounding."""
UNIFORM = {2: 0.5, 3: 0.4}
"""Moment of inertia of a uniform disk or sphere over ``m R^2``, by the dimension."""


def sizes_in_range(name: str, values: FloatArray, low: float = SMALLEST, high: float = LARGEST) -> None:
    """Raise `InvalidSceneError` unless all sizes are > 0 and in the range in which they can be computed with."""
    for i in (int(np.argmin(values)), int(np.argmax(values))) if len(values) else ():
        if values[i] <= 0.0:
            raise InvalidSceneError(f"{name}[{i}] = {values[i]:g} is not allowed: it must be > 0")
        if not low <= values[i] <= high:
            raise InvalidSceneError(
                f"{name}[{i}] = {values[i]:g} is not allowed: it must lie between {low:g} and {high:g}; change units"
            )


def _unit_quaternions(name: str, value: ArrayLike, n: int) -> FloatArray:
    """Read-only unit quaternions of ``n`` bodies, or `InvalidSceneError`."""
    turns = finite(name, rows_of(name, value, 4), (n, 4))
    off = np.flatnonzero(np.abs(np.sum(turns**2, axis=1) - 1.0) > UNIT)
    if len(off):
        i = int(off[0])
        raise InvalidSceneError(
            f"{name}[{i}] = {turns[i].tolist()} is not allowed: its size must be 1, here it is {np.linalg.norm(turns[i]):g}"
        )
    return turns


def _outline_numbers(value: object, n: int) -> NDArray[np.int64]:
    """Read-only outline numbers of ``n`` grains, -1 for a disk, from as many or from one for all; or `InvalidSceneError`."""
    array = numbers("disks.outline", value)  # type: ignore[arg-type]
    full: FloatArray = np.full(n, array) if array.ndim == 0 else array
    if full.shape != (n,):
        raise InvalidSceneError(f"disks.outline has shape {full.shape}; it must have shape {(n,)}")
    bad = np.flatnonzero(~((full >= -1.0) & (full == np.floor(full)) & (full < 2**31)))
    if len(bad):
        i = int(bad[0])
        raise InvalidSceneError(
            f"disks.outline[{i}] = {full[i]:g} is not allowed: it must be the number of an outline, or -1 for a disk"
        )
    whole = full.astype(np.int64)
    whole.setflags(write=False)
    return whole


def materials_of(name: str, value: object, n: int) -> tuple[str, ...]:
    """Names of the materials of ``n`` bodies, from as many or from one for all; or `InvalidSceneError`."""
    if isinstance(value, str):
        return (value,) * n
    names = items_of(name, value, "a name, or one for each body")
    if len(names) != n or not all(isinstance(each, str) for each in names):
        raise InvalidSceneError(
            f"{name} = {short_repr(value)} is not allowed: it must be a name, or one for each of the {n} bodies"
        )
    return names


def flags_of(name: str, value: ArrayLike, shape: tuple[int, ...], form: str) -> NDArray[np.bool_]:
    """Read-only truth values of the given shape, from as many or from one for all."""
    try:
        flags = np.empty(()) if np.ma.is_masked(value) else np.asarray(value)
    except Exception:  # rows of unequal length, or whatever an object does that is asked to be an array
        flags = np.empty(())
    if flags.size == 0 == shape[0]:  # an empty list has lost its shape and type
        flags = np.empty(shape, dtype=bool)
    if flags.dtype != np.bool_ or flags.shape not in ((), shape):
        raise InvalidSceneError(
            f"{name} must be true or false, one for all or {form} of the {shape[0]}, not {short_repr(value)}"
        )
    full = np.array(np.broadcast_to(flags, shape))
    full.setflags(write=False)
    return full
