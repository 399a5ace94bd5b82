"""Outlines with corners: polygons, and regular polygons whose corners are rounded by circular arcs."""

from __future__ import annotations

from math import cos, pi, sin, tan

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve import MOST_POINTS, NurbsCurve
from ninedisk.core.validate import FloatArray, at_least, numbers, real, shown, whole

MOST_FACES = MOST_POINTS // 4 - 1
"""A rounded polygon has four control points a face."""


def polygon(vertices: ArrayLike) -> NurbsCurve:
    """The polygon with these corners [m], counter-clockwise, each once, shape (k, 2), k >= 3: a curve of degree 1.

    Raises
    ------
    InvalidSceneError
        If they are no such points, or the polygon is no outline (see `NurbsCurve`).
    """
    corners = numbers("vertices", vertices)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise InvalidSceneError(f"vertices have shape {corners.shape}; they must have shape (k, 2), k >= 3")
    knots = np.concatenate([[0.0], np.arange(len(corners) + 1.0), [len(corners)]])
    return NurbsCurve(degree=1, knots=knots, points=np.concatenate([corners, corners[:1]]))


def regular_polygon(faces: int, apothem: float, *, roundness: float = 0.0) -> NurbsCurve:
    """Regular polygon about the origin that stands on a face: at its angle 0 one outward normal is (0, -1).

    Parameters
    ----------
    faces : int
        3 .. `MOST_FACES`.
    apothem : float
        Distance of the faces from the centre [m], > 0.
    roundness : float
        Radius of the arcs that round the corners, over the apothem, in [0, 1): 0 is sharp, 1 would be the inscribed circle. The
        arcs are exact, and the faces' lines are those of the sharp polygon.

    Raises
    ------
    InvalidSceneError
        If a value is out of its range.
    """
    m = whole("faces", faces, 3, MOST_FACES, error=InvalidSceneError)
    height, part = at_least("apothem", apothem, 0.0, strict=True), real(roundness)
    if not 0.0 <= part < 1.0:
        raise InvalidSceneError(f"roundness = {shown(roundness)} is not allowed: it must be in [0, 1); 1 is a disk")
    half = pi / m
    ways = -0.5 * pi + 2.0 * half * np.arange(m, dtype=np.float64)  # of the faces' outward normals
    normal, along = _directions(ways), _directions(ways + 0.5 * pi)
    reach = height * (1.0 - part) * tan(half)
    end = height * normal + reach * along
    if part == 0.0:
        return polygon(end)
    # Each face and the arc behind it, in quadratic arcs: the face's start, its middle, its end, where its line meets the next one's.
    start = height * normal - reach * along
    crossing = height / cos(half) * _directions(ways + half)
    points = np.stack([start, height * normal, end, crossing], axis=1).reshape(-1, 2)
    weights = np.tile([1.0, 1.0, 1.0, sin(0.5 * pi - half)], m)
    knots = np.concatenate([[0.0], np.repeat(np.arange(2.0 * m + 1.0), 2), [2.0 * m]])
    return NurbsCurve(
        degree=2, knots=knots, points=np.concatenate([points, points[:1]]), weights=np.concatenate([weights, [1.0]])
    )


def _directions(angle: FloatArray) -> FloatArray:
    return np.column_stack([np.cos(angle), np.sin(angle)])
