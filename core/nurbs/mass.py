"""Area, centroid and moment of inertia of what an outline encloses, and the uniform grain that is made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.table import outline_points
from ninedisk.core.validate import at_least, finite, kind_of, whole

NODES = 16
"""Gauss nodes a piece: exact for polynomial curves of degree 8 and less; on rational pieces, which turn by 0.6 rad at most, the
integrands are analytic well around the piece and 16 nodes leave round-off."""

MOST_NODES = 100
"""Gauss nodes a piece: their weights are found by eigenvalues, in a time that grows with the third power."""

SAMPLES = 17
"""Points of a piece among which the farthest one is sought: a piece turns by 0.6 rad at most."""


@dataclass(frozen=True, kw_only=True)
class AreaMoments:
    """Moments of an enclosed area.

    Parameters
    ----------
    area : float
        [m^2].
    centroid : ndarray, shape (2,)
        [m].
    second_moment : float
        Polar second moment of area about the centroid [m^4]; times the mass per area, the moment of inertia.
    """

    area: float
    centroid: FloatArray
    second_moment: float


def area_moments(curve: NurbsCurve, nodes: int = NODES) -> AreaMoments:
    """Moments of the area that ``curve`` encloses, with ``nodes`` Gauss nodes a piece.

    Integrals over the area become integrals round the outline: A = 1/2 of (x dy - y dx), first moments 1/2 of x^2 dy and -1/2 of
    y^2 dx, polar moment 1/3 of (x^3 dy - y^3 dx); about a point inside, so that an outline far away loses no digits.
    """
    table = kind_of("curve", curve, NurbsCurve).table
    nodes = whole("nodes", nodes, 1, MOST_NODES, error=InvalidSceneError)
    at, weight = np.polynomial.legendre.leggauss(nodes)
    about = np.mean(table.piece_circle[:, :2], axis=0)
    low, high = table.piece_range.T[:, :, None]
    place, slope, _ = outline_points(table.coef[table.piece_span], 0.5 * (low + high) + 0.5 * (high - low) * at)
    px, py = np.moveaxis(place - about, -1, 0)
    qx, qy = np.moveaxis(slope, -1, 0) * (0.5 * (high - low) * weight)
    area = 0.5 * float(np.sum(px * qy - py * qx))
    first = 0.5 * np.array([np.sum(px**2 * qy), -np.sum(py**2 * qx)])
    polar = float(np.sum(px**3 * qy - py**3 * qx)) / 3.0
    arm = first / area
    return AreaMoments(area=area, centroid=about + arm, second_moment=polar - area * float(arm @ arm))


def centred(curve: NurbsCurve) -> NurbsCurve:
    """The outline shifted so that its centroid is the origin: the frame in which a grain is described."""
    return kind_of("curve", curve, NurbsCurve).moved(shift=-area_moments(curve).centroid)


@dataclass(frozen=True, kw_only=True)
class UniformGrain:
    """What `Disks` needs to know of a grain of uniform density.

    Parameters
    ----------
    outline : NurbsCurve
        In the body's frame: the centroid is the origin.
    radius : float
        Radius about the centroid of the smallest enclosing circle [m].
    mass : float
        [kg], per unit thickness.
    inertia : float
        About the centroid [kg m^2].
    """

    outline: NurbsCurve
    radius: float
    mass: float
    inertia: float


def uniform_grain(curve: NurbsCurve, density: float) -> UniformGrain:
    """The grain of ``density`` [kg/m^2] that fills an outline given in any frame.

    Raises
    ------
    InvalidSceneError
        If the density is not > 0.
    """
    rho = at_least("density", density, 0.0, strict=True)
    outline = centred(kind_of("curve", curve, NurbsCurve))
    moments = area_moments(outline)
    return UniformGrain(
        outline=outline,
        radius=farthest(outline),
        mass=rho * moments.area,
        inertia=rho * moments.second_moment,
    )


def farthest(curve: NurbsCurve) -> float:
    """Largest distance of the outline from the origin of its frame [m], to round-off."""

    # Half the slope and the curvature of the squared distance.
    def rates(x: FloatArray, dx: FloatArray, ddx: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.sum(x * dx, axis=-1), np.sum(dx * dx + x * ddx, axis=-1)

    return max(0.0, _largest(curve, lambda x: np.hypot(x[..., 0], x[..., 1]), rates))


def nearest(curve: NurbsCurve) -> float:
    """Smallest distance of the outline from the origin of its frame [m], to round-off."""

    def rates(x: FloatArray, dx: FloatArray, ddx: FloatArray) -> tuple[FloatArray, FloatArray]:
        return -np.sum(x * dx, axis=-1), -np.sum(dx * dx + x * ddx, axis=-1)

    return -_largest(curve, lambda x: -np.hypot(x[..., 0], x[..., 1]), rates)


def extent(curve: NurbsCurve, direction: ArrayLike) -> float:
    """Largest coordinate of the outline along a unit vector of its frame [m], to round-off."""
    n = finite("direction", direction, (2,))
    if abs(np.hypot(n[0], n[1]) - 1.0) > 1e-12:
        raise InvalidSceneError(f"direction = ({n[0]:g}, {n[1]:g}) is not allowed: it must be a unit vector")
    return _largest(curve, lambda x: x @ n, lambda _, dx, ddx: (dx @ n, ddx @ n))


def _largest(
    curve: NurbsCurve,
    measure: Callable[[FloatArray], FloatArray],
    rates: Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]],
) -> float:
    """Largest measure of an outline's points, shape (..., 2), by Newton's method on all pieces at once.

    ``rates`` gives the slope and the curvature of the measure, or of an increasing function of it, from points and their derivatives.
    """
    table, best = kind_of("curve", curve, NurbsCurve).table, -np.inf
    low, high = table.piece_range.T
    coef = table.coef[table.piece_span]
    at = np.linspace(low, high, SAMPLES, axis=1)
    u = at[np.arange(len(at)), np.argmax(measure(outline_points(coef, at)[0]), axis=1)]
    for _ in range(6):
        point, slope, bend = (rows[:, 0] for rows in outline_points(coef, u[:, None]))
        best = max(best, float(np.max(measure(point))))
        rise, fall = rates(point, slope, bend)
        rises = fall < 0.0  # elsewhere is no maximum
        u = np.where(rises, np.clip(u - rise / np.where(rises, fall, 1.0), low, high), u)
    return best
