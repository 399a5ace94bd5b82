"""Chord and overlap of two ellipses, from one's implicit equation along the other's trigonometric parametrisation.

It shares nothing with curves in rational form: intersections are zeros of an implicit equation, and the extent of the common area
along the chord's normal comes from the support function ``sqrt(a^2 nx^2 + b^2 ny^2)``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import finite, pair, positive

FloatArray = NDArray[np.float64]

SAMPLES = 2048
"""Points of the one ellipse among which the deepest inside the other is sought: next to the lowest there is one valley."""

HALVINGS = 80
"""Of an interval: to the last bit of an angle, from either side."""

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class Ellipse:
    """Half-axes ``a``, ``b`` [m] > 0, centre [m], and angle [rad] of the axis a."""

    a: float
    b: float
    centre: tuple[float, float]
    angle: float

    def __post_init__(self) -> None:
        positive(a=self.a, b=self.b)
        finite(angle=self.angle)
        pair("centre", self.centre)

    def at(self, parameter: ArrayLike) -> FloatArray:
        """Points ``centre + rotation (a cos p, b sin p)`` [m], shape (..., 2)."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        p, q = self.a * np.cos(parameter), self.b * np.sin(parameter)
        return np.stack([c * p - s * q + self.centre[0], s * p + c * q + self.centre[1]], axis=-1)

    def level(self, point: FloatArray) -> FloatArray:
        """Implicit equation, negative inside: ``(x/a)^2 + (y/b)^2 - 1`` along the axes, as a product that keeps small values."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        d = point - np.array(self.centre)
        x, y = (c * d[..., 0] + s * d[..., 1]) / self.a, (c * d[..., 1] - s * d[..., 0]) / self.b
        return np.asarray((x - 1.0) * (x + 1.0) + y * y, dtype=np.float64)

    def support(self, normal: FloatArray) -> float:
        """Largest distance of the outline from the centre along a unit normal [m]."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return math.hypot(self.a * (c * normal[0] + s * normal[1]), self.b * (c * normal[1] - s * normal[0]))


def ellipse_overlap(one: Ellipse, two: Ellipse) -> float:
    """Overlap [m] of two ellipses that intersect twice: the common area's extent at right angles to the chord of intersection.

    Raises
    ------
    ValueError
        If they do not intersect in two points.
    """
    grid = np.linspace(0.0, 2.0 * math.pi, SAMPLES, endpoint=False)
    values = two.level(one.at(grid))
    inside = _lowest(lambda p: float(two.level(one.at(p))), float(grid[np.argmin(values)]), 2.0 * math.pi / SAMPLES)
    beyond = grid[values > 0.0]
    crossings = int(np.count_nonzero((values > 0.0) != (np.roll(values, 1) > 0.0)))
    if not float(two.level(one.at(inside))) < 0.0 or not len(beyond) or crossings not in (0, 2):
        raise ValueError(f"the ellipses do not intersect in two points: {one} and {two}")
    after = inside + float(np.mod(beyond - inside, 2.0 * math.pi).min())
    before = inside - float(np.mod(inside - beyond, 2.0 * math.pi).min())
    ends = [one.at(_zero(lambda p: float(two.level(one.at(p))), inside, far)) for far in (before, after)]
    chord = ends[1] - ends[0]
    normal = np.array([chord[1], -chord[0]]) / math.hypot(*chord)
    between = np.array(two.centre) - np.array(one.centre)
    return one.support(normal) + two.support(normal) - float(between @ normal)


def ellipse_separation(one: Ellipse, two: Ellipse) -> float:
    """Largest distance [m] between two parallel lines that part the ellipses; below 0 where they overlap, by what none can part.

    Of two convex bodies this is their distance if they are apart (separating axis theorem).

    Examples
    --------
    >>> small, large = Ellipse(1.0, 1.0, (0.0, 0.0), 0.0), Ellipse(2.0, 2.0, (3.0, 4.0), 0.3)
    >>> round(ellipse_separation(small, large), 12)
    2.0
    """
    between = np.array(two.centre) - np.array(one.centre)

    def overlap(angle: float) -> float:
        normal = np.array([math.cos(angle), math.sin(angle)])
        return one.support(normal) + two.support(normal) - float(between @ normal)

    grid = np.linspace(0.0, 2.0 * math.pi, SAMPLES, endpoint=False)
    nearest = float(grid[np.argmin([overlap(float(angle)) for angle in grid])])
    return -overlap(_lowest(overlap, nearest, 2.0 * math.pi / SAMPLES))


def _lowest(level: Callable[[float], float], middle: float, width: float) -> float:
    """Place of the smallest value within ``width`` of ``middle``, by golden sections."""
    low, high = middle - width, middle + width
    for _ in range(HALVINGS):
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        if level(left) < level(right):
            high = right
        else:
            low = left
    return 0.5 * (low + high)


def _zero(level: Callable[[float], float], inside: float, outside: float) -> float:
    """Zero between a place with a negative level and one with a positive level, by bisection."""
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        if level(middle) < 0.0:
            inside = middle
        else:
            outside = middle
    return 0.5 * (inside + outside)
