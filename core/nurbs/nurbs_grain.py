"""A grain from an outline: its frame, its enclosing circle, the mass and inertia of a uniform body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import area_moments, centred
from ninedisk.core.nurbs.table import outline_points
from ninedisk.core.validate import at_least, finite, kind_of

SAMPLES = 17
"""Points of a piece among which the farthest one is sought: a piece turns by 0.6 rad at most."""


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
    table, best = kind_of("curve", curve, NurbsCurve).table, 0.0
    for k in range(len(table.piece_span)):
        low, high = table.piece_range[k]
        coef = table.coef[table.piece_span[k] : table.piece_span[k] + 1]
        at = np.linspace(low, high, SAMPLES)
        u = float(at[np.argmax(np.hypot(*outline_points(coef, at)[0][0].T))])
        for _ in range(6):
            (point,), (slope,), (bend,) = (rows[0] for rows in outline_points(coef, np.array([u])))
            best = max(best, float(np.hypot(*point)))
            # Half the slope and the curvature of the squared distance; a maximum has a negative one.
            rise, fall = float(point @ slope), float(slope @ slope + point @ bend)
            if fall >= 0.0:
                break
            u = float(np.clip(u - rise / fall, low, high))
    return best


def extent(curve: NurbsCurve, direction: ArrayLike) -> float:
    """Largest coordinate of the outline along a unit vector of its frame [m], to round-off."""
    table, best = kind_of("curve", curve, NurbsCurve).table, -np.inf
    n = finite("direction", direction, (2,))
    if abs(np.hypot(n[0], n[1]) - 1.0) > 1e-12:
        raise InvalidSceneError(f"direction = ({n[0]:g}, {n[1]:g}) is not allowed: it must be a unit vector")
    for k in range(len(table.piece_span)):
        low, high = table.piece_range[k]
        coef = table.coef[table.piece_span[k] : table.piece_span[k] + 1]
        at = np.linspace(low, high, SAMPLES)
        u = float(at[np.argmax(outline_points(coef, at)[0][0] @ n)])
        for _ in range(6):
            (point,), (slope,), (bend,) = (rows[0] for rows in outline_points(coef, np.array([u])))
            best = max(best, float(point @ n))
            if bend @ n >= 0.0:
                break
            u = float(np.clip(u - (slope @ n) / (bend @ n), low, high))
    return best
