"""Common areas of convex polygons in rational numbers: exact for the polygons whose corners are the given floating-point numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Point = tuple[Fraction, Fraction]
Polygon = list[Point]
STEP = Fraction(1, 10**12)
"""Shift [m] of the differences of areas: areas are quadratic in a shift, so that central ones are exact unless corners change within."""


class Common(NamedTuple):
    """Area, its gradient by the second polygon's place [m], the number of boundary crossings, and the extent along the gradient [m]."""

    area: float
    gradient: NDArray[np.float64]
    crossings: int
    extent: float


def exact(points: NDArray[np.float64]) -> Polygon:
    """The polygon with exactly these corners, counter-clockwise."""
    return [(Fraction(float(x)), Fraction(float(y))) for x, y in points]


def shifted(polygon: Polygon, dx: Fraction, dy: Fraction) -> Polygon:
    return [(x + dx, y + dy) for x, y in polygon]


def beyond(a: Point, b: Point, p: Point) -> Fraction:
    """Twice the area of the triangle a, b, p: > 0 where p is to the left of the line from a to b."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def clipped(one: Polygon, other: Polygon) -> Polygon:
    """The common polygon (Sutherland & Hodgman, CACM 17 (1974) 32-42)."""
    found = one
    for a, b in zip(other, other[1:] + other[:1], strict=True):
        inside = [beyond(a, b, p) for p in found]
        cut: Polygon = []
        for k, p in enumerate(found):
            before, off, off_before = found[k - 1], inside[k], inside[k - 1]
            if off * off_before < 0:
                part = off_before / (off_before - off)
                cut.append((before[0] + part * (p[0] - before[0]), before[1] + part * (p[1] - before[1])))
            if off >= 0:
                cut.append(p)
        found = cut
    return found


def area(polygon: Polygon) -> Fraction:
    """Area [m^2]."""
    return (
        sum((p[0] * q[1] - q[0] * p[1] for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True)), Fraction())
        / 2
    )


def crossings(one: Polygon, other: Polygon) -> int:
    """Number of pairs of sides that cross properly."""
    found = 0
    for a, b in zip(one, one[1:] + one[:1], strict=True):
        for p, q in zip(other, other[1:] + other[:1], strict=True):
            if beyond(a, b, p) * beyond(a, b, q) < 0 and beyond(p, q, a) * beyond(p, q, b) < 0:
                found += 1
    return found


def common(one: Polygon, other: Polygon) -> Common:
    """What two polygons have in common."""
    gradient = []
    for way in ((STEP, Fraction()), (Fraction(), STEP)):
        ends = [area(clipped(one, shifted(other, sign * way[0], sign * way[1]))) for sign in (1, -1)]
        gradient.append((ends[0] - ends[1]) / (2 * STEP))
    shape = clipped(one, other)
    along = [gradient[0] * x + gradient[1] * y for x, y in shape]
    size = float(gradient[0] ** 2 + gradient[1] ** 2) ** 0.5
    extent = float(max(along) - min(along)) / size if size > 0.0 else 0.0
    return Common(float(area(shape)), np.array(gradient, dtype=float), crossings(one, other), extent)
