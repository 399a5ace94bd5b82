"""Rigid disks, and grains of other outlines: what these must fulfil, and their JSON form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, SMALLEST, finite, items_of, numbers, shown

if TYPE_CHECKING:
    from ninedisk.core.nurbs.curve import NurbsCurve

CENTRED = 1e-9
"""Distance of the centroid from the frame's origin, over the largest distance of the outline, that counts as rounding: moving a curve
leaves 1e-16 of the distance by which it was moved."""

ENCLOSED = 1e-12
"""What an outline may stick out of its enclosing circle, over the radius: rounding of the curve's points."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Disks:
    """Rigid disks and grains as a structure of arrays (copied and made read-only).

    Two are equal if all their numbers are; they cannot be keys of a dictionary.

    Parameters
    ----------
    x : array_like, shape (n, 2)
        Centres [m]; of a grain with an outline, its centroid.
    radius, mass : array_like, shape (n,) or scalar
        Radii [m] and masses [kg], > 0. The radius of a grain with an outline is that of a circle about its centroid that encloses it:
        the contact search uses it, contacts do not.
    inertia : array_like, shape (n,), scalar or None
        Moments of inertia [kg m^2], > 0; None means uniform disks, ``m R^2 / 2``, and is refused if a grain has an outline
        (`ninedisk.core.nurbs.mass.uniform_grain` gives the values of a uniform one).
    v : array_like, shape (n, 2), optional
        Velocities [m/s] at time 0.
    omega : array_like, shape (n,), optional
        Spins [rad/s] at time 0, counter-clockwise positive.
    rotating : array_like of bool, shape (n,) or scalar
        False: the disk keeps its spin whatever torque acts (a block in the shape of a disk).
    held : array_like of bool, shape (n, 2) or scalar
        True: the disk keeps this component of its velocity whatever force acts (a prescribed motion).
    outline : array_like of int, shape (n,) or scalar
        Which of `Scene.outlines` is the boundary of the grain; -1: it is a disk.
    material : sequence of n str, or str
        Names of what the bodies are made of, which `Scene.laws` refers to; "" where the scene names no materials.
    angle : array_like, shape (n,) or scalar
        Angles [rad] of the outlines at time 0, counter-clockwise positive: at 0 the body's frame has the scene's axes.

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
    outline: NDArray[np.int64] = -1  # type: ignore[assignment]
    angle: FloatArray = 0.0  # type: ignore[assignment]
    material: tuple[str, ...] = ""  # type: ignore[assignment]

    def __post_init__(self) -> None:
        x = rows_of("disks.x", self.x, 2)
        n = len(x)

        def column(name: str, value: ArrayLike | None, *, most: float = np.inf) -> FloatArray:
            array = numbers(f"disks.{name}", value)  # type: ignore[arg-type]
            return finite(f"disks.{name}", np.full(n, array) if array.ndim == 0 else array, (n,), most=most)

        outline = _outline_numbers(self.outline, n)
        if self.inertia is None and np.any(outline >= 0):
            raise InvalidSceneError(
                f"disks.inertia is missing and grain {int(np.argmax(outline >= 0))} has an outline: give the moments of inertia "
                "(ninedisk.core.nurbs.mass.uniform_grain gives that of a uniform grain)"
            )
        radius, mass = column("radius", self.radius), column("mass", self.mass)
        sizes_in_range("disks.radius", radius)
        sizes_in_range("disks.mass", mass)
        with np.errstate(over="ignore"):  # an infinite one is refused by name below
            uniform = 0.5 * mass * radius**2
        inertia = column("inertia", uniform if self.inertia is None else self.inertia)
        sizes_in_range("disks.inertia", inertia, SMALLEST**2, LARGEST**2)
        rotating = flags_of("disks.rotating", self.rotating, (n,), "one for each disk")
        held = flags_of("disks.held", self.held, (n, 2), "a pair (x, y) for each disk")
        object.__setattr__(self, "x", finite("disks.x", x, (n, 2), most=LARGEST))
        object.__setattr__(
            self, "v", finite("disks.v", np.zeros((n, 2)) if self.v is None else rows_of("disks.v", self.v, 2), (n, 2))
        )
        object.__setattr__(self, "omega", column("omega", 0.0 if self.omega is None else self.omega))
        object.__setattr__(self, "radius", radius)
        object.__setattr__(self, "mass", mass)
        object.__setattr__(self, "inertia", inertia)
        object.__setattr__(self, "rotating", rotating)
        object.__setattr__(self, "held", held)
        object.__setattr__(self, "outline", outline)
        object.__setattr__(self, "material", materials_of("disks.material", self.material, n))
        angle = column("angle", self.angle, most=LARGEST) + 0.0  # -0.0 becomes 0.0, which the JSON form leaves out
        angle.setflags(write=False)
        object.__setattr__(self, "angle", angle)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Disks):
            return NotImplemented
        if self.material != other.material:
            return False
        return all(
            np.array_equal(mine, getattr(other, name)) for name, mine in vars(self).items() if name != "material"
        )

    def __len__(self) -> int:
        return int(self.x.shape[0])

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Which disks stay where they are, shape (n,): held at rest in both directions, and not turning.

        They bear contacts as a part of the ground does. Among themselves and with walls they have none: nothing could answer its
        forces. They may therefore touch and overlap.
        """
        fixed: NDArray[np.bool_] = self.held.all(axis=1) & ~self.v.any(axis=1) & ~self.rotating & (self.omega == 0.0)
        return fixed


def sizes_in_range(name: str, values: FloatArray, low: float = SMALLEST, high: float = LARGEST) -> None:
    """Raise `InvalidSceneError` unless all sizes are > 0 and in the range in which they can be computed with."""
    for i in (int(np.argmin(values)), int(np.argmax(values))) if len(values) else ():
        if values[i] <= 0.0:
            raise InvalidSceneError(f"{name}[{i}] = {values[i]:g} is not allowed: it must be > 0")
        if not low <= values[i] <= high:
            raise InvalidSceneError(
                f"{name}[{i}] = {values[i]:g} is not allowed: it must lie between {low:g} and {high:g}; change units"
            )


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
            f"{name} = {shown(value)} is not allowed: it must be a name, or one for each of the {n} bodies"
        )
    return names


def rows_of(name: str, value: ArrayLike, width: int) -> FloatArray:
    """Numbers in rows of this width; an empty list, as JSON has it for no body at all, has lost its second dimension."""
    array = numbers(name, value)
    if array.shape == (0,):
        return array.reshape(0, width)
    if array.ndim != 2 or array.shape[1] != width:
        raise InvalidSceneError(f"{name} has shape {array.shape}; it must have shape (n, {width})")
    return array


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
            f"{name} must be true or false, one for all or {form} of the {shape[0]}, not {shown(value)}"
        )
    full = np.array(np.broadcast_to(flags, shape))
    full.setflags(write=False)
    return full


def check_outlines(outlines: Sequence[NurbsCurve], disks: Disks) -> tuple[NurbsCurve, ...]:
    """The outlines as a tuple, or `InvalidSceneError`: each centred, each inside the circles of the grains that have it."""
    given = items_of("outlines", outlines, "a sequence of NurbsCurve, () for none")
    most = int(disks.outline.max()) if len(disks) else -1
    if most >= len(given):
        i = int(np.argmax(disks.outline))
        known = f"outlines 0 .. {len(given) - 1}" if given else "no outlines"
        raise InvalidSceneError(
            f"disks.outline[{i}] = {most} is not allowed: the scene has {known}, and -1 stands for a disk"
        )
    if not given:
        return given
    # The curves' modules load Numba, which a scene of disks need not wait for.
    from ninedisk.core.nurbs.curve import NurbsCurve
    from ninedisk.core.nurbs.mass import area_moments, farthest

    for k, curve in enumerate(given):
        if not isinstance(curve, NurbsCurve):
            raise InvalidSceneError(f"outlines[{k}] is no NurbsCurve but {type(curve).__name__}")
        reach, centroid = farthest(curve), area_moments(curve).centroid
        if not float(np.hypot(*centroid)) <= CENTRED * reach:
            raise InvalidSceneError(
                f"outlines[{k}] has its centroid at ({centroid[0]:g}, {centroid[1]:g}) m; it must be the origin of the body's frame: "
                "shift it by ninedisk.core.nurbs.mass.centred"
            )
        mine = np.flatnonzero(disks.outline == k)
        small = mine[disks.radius[mine] < reach * (1.0 - ENCLOSED)]
        if len(small):
            i = int(small[0])
            raise InvalidSceneError(
                f"disks.radius[{i}] = {disks.radius[i]:.17g} is not allowed: outline {k} reaches {reach:.17g} m from its centroid, and the "
                "radius of a grain is that of a circle around it (ninedisk.core.nurbs.mass.uniform_grain gives the smallest)"
            )
    return given


def plain_outline(curve: NurbsCurve) -> dict[str, Any]:
    """An outline as JSON data."""
    return {
        "degree": curve.degree,
        "knots": curve.knots.tolist(),
        "points": curve.points.tolist(),
        "weights": curve.weights.tolist(),
    }


def outlines_from(data: Sequence[Mapping[str, Any]]) -> tuple[NurbsCurve, ...]:
    """Outlines from `plain_outline` data, the same to the last bit."""
    if not data:
        return ()
    from ninedisk.core.nurbs.curve import NurbsCurve

    return tuple(NurbsCurve(**curve) for curve in data)
