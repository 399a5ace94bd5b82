"""Closed rational B-spline curves in the plane: outlines of grains.

Source: Piegl & Tiller, The NURBS Book, 2nd ed., Springer 1997 (chapters 3 to 5).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve_kernels import ShapeTable, sample
from ninedisk.core.nurbs.nurbs_checks import check_knots, check_outline, check_weights
from ninedisk.core.nurbs.table import shape_table
from ninedisk.core.validate import LARGEST, SMALLEST, FloatArray, finite, numbers, real, shown

MOST_DEGREE, MOST_POINTS = 12, 1_000
"""Of an outline. Bernstein coefficients of higher degrees lose digits; crossings are sought among all pairs of an outline's segments."""

CLOSED_TO = 1e-12
"""Largest distance of first and last point, relative to the control polygon's size, that counts as rounding."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NurbsCurve:
    """A closed outline: a rational B-spline curve, counter-clockwise, that does not cross itself.

    Parameters
    ----------
    degree : int
        >= 1.
    knots : array_like, shape (n + degree + 1,)
        Not decreasing. The curve is defined on ``knots[degree] .. knots[n]``, so clamped and periodic knots serve alike.
    points : array_like, shape (n, 2)
        Control points [m].
    weights : array_like, shape (n,), optional
        > 0; all 1 if left out.

    Raises
    ------
    InvalidSceneError
        If the knots are wrong, a weight is not positive, or the outline is open, crosses itself, runs clockwise, stands still
        or encloses no area.
    """

    degree: int
    knots: FloatArray
    points: FloatArray
    weights: FloatArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        points = numbers("points", self.points)
        if points.ndim != 2 or points.shape[1] != 2:
            raise InvalidSceneError(f"points has shape {points.shape}; it must have shape (n, 2)")
        n = len(points)
        degree = self.degree
        if isinstance(degree, bool) or not isinstance(degree, int | np.integer) or not 1 <= degree < n:
            raise InvalidSceneError(
                f"degree = {shown(degree)} is not allowed: it must be an integer in 1 .. {n - 1}, for {n} points"
            )
        if degree > MOST_DEGREE or n > MOST_POINTS:
            raise InvalidSceneError(
                f"degree = {degree} with {n} points is not allowed: an outline has at most degree {MOST_DEGREE} and {MOST_POINTS} points; "
                "fit it with fewer (ninedisk.core.nurbs.shapes.fitted)"
            )
        object.__setattr__(self, "degree", int(degree))
        object.__setattr__(self, "points", finite("points", points, (n, 2), most=LARGEST))
        size = float(np.ptp(self.points, axis=0).max())
        if 0.0 < size < SMALLEST:
            raise InvalidSceneError(
                f"points span {size:g} m, which is not allowed: it must be {SMALLEST:g} m at least; change units"
            )
        object.__setattr__(self, "weights", check_weights(np.ones(n) if self.weights is None else self.weights, n))
        object.__setattr__(self, "knots", check_knots(self.knots, n, int(degree)))
        self._check_closed()
        check_outline(self.table)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, NurbsCurve):
            return NotImplemented
        return self.degree == other.degree and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in ("knots", "points", "weights")
        )

    def _check_closed(self) -> None:
        spans, size = self.spans, float(np.ptp(self.points, axis=0).max())
        if size == 0.0:
            raise InvalidSceneError("the outline has zero area: all its control points coincide")
        first, last = spans[0, 0], spans[-1, -1]
        opening = float(np.hypot(*(first[:2] / first[2] - last[:2] / last[2])))
        if opening > CLOSED_TO * size:
            raise InvalidSceneError(
                f"the curve is open: its ends are {opening:g} m apart, and at most {CLOSED_TO * size:.1g} is allowed; "
                "repeat the first control point at the end, or repeat the first ones of a periodic curve"
            )

    @cached_property
    def breaks(self) -> FloatArray:
        """Distinct knots of the curve's range, in ascending order."""
        return np.unique(self.knots[self.degree : len(self.points) + 1])

    @cached_property
    def spans(self) -> FloatArray:
        """Bezier control points of all spans in homogeneous coordinates, shape (spans, degree + 1, 3): w x, w y [m], w."""
        knots, points = self.knots, homogeneous(self.points, self.weights)
        p = self.degree
        for value in self.breaks:
            missing = p - int(np.count_nonzero(knots == value))
            for _ in range(missing):
                knots, points = inserted(knots, points, p, float(value))
        starts = [int(np.searchsorted(knots, value, side="right")) - 1 - p for value in self.breaks[:-1]]
        return np.array([points[k : k + p + 1] for k in starts])

    @cached_property
    def table(self) -> ShapeTable:
        """The outline as the kernels read it."""
        return shape_table([powers(self.spans)])

    def evaluate(self, parameter: ArrayLike, order: int = 0) -> FloatArray:
        """Points or derivatives.

        Parameters
        ----------
        parameter : array_like, shape (k,)
            In ``breaks[0] .. breaks[-1]``; at an inner break the span that begins there counts.
        order : int
            0, 1 or 2: which derivative by the parameter.

        Returns
        -------
        ndarray, shape (k, 2)
            [m], or [m] per unit of the parameter to the power ``order``.

        Raises
        ------
        InvalidSceneError
            If a parameter is out of range, or the order.
        """
        at = np.atleast_1d(numbers("parameter", parameter))
        if at.ndim != 1:
            raise InvalidSceneError(f"parameter has shape {at.shape}; it must have shape (k,)")
        low, high = self.breaks[0], self.breaks[-1]
        if not np.all((at >= low) & (at <= high)):
            raise InvalidSceneError(f"parameter is out of range: the curve is defined on {low:g} .. {high:g}")
        if real(order) not in (0.0, 1.0, 2.0):
            raise InvalidSceneError(f"order = {shown(order)} is not allowed: it must be 0, 1 or 2")
        order = int(order)
        span = np.clip(np.searchsorted(self.breaks, at, side="right") - 1, 0, len(self.breaks) - 2).astype(np.int64)
        width = self.breaks[span + 1] - self.breaks[span]
        out = np.empty((len(at), 6))
        sample(self.table, 0, span, (at - self.breaks[span]) / width - 0.5, out)
        return out[:, 2 * order : 2 * order + 2] / width[:, None] ** order

    def with_knot(self, value: float) -> NurbsCurve:
        """The same curve with one more knot, strictly inside its range and there at most ``degree`` times (Boehm's algorithm)."""
        value = real(given := value)
        if not self.breaks[0] < value < self.breaks[-1] or np.count_nonzero(self.knots == value) >= self.degree:
            raise InvalidSceneError(
                f"knot value = {shown(given)} cannot be inserted: it must lie inside {self.breaks[0]:g} .. {self.breaks[-1]:g} "
                f"and be there fewer than {self.degree} times"
            )
        knots, points = inserted(self.knots, homogeneous(self.points, self.weights), self.degree, value)
        return NurbsCurve(degree=self.degree, knots=knots, points=points[:, :2] / points[:, 2:], weights=points[:, 2])

    def moved(self, *, shift: ArrayLike = (0.0, 0.0), angle: float = 0.0) -> NurbsCurve:
        """The outline turned about the origin by ``angle`` [rad], then shifted [m]."""
        turn, way = finite("angle", angle, (), most=LARGEST), finite("shift", shift, (2,), most=LARGEST)
        c, s = np.cos(turn), np.sin(turn)
        turned = self.points @ np.array([[c, s], [-s, c]])
        return NurbsCurve(degree=self.degree, knots=self.knots, points=turned + way, weights=self.weights)


def homogeneous(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Control points as rows w x, w y [m], w."""
    return np.column_stack([points * weights[:, None], weights])


def inserted(knots: FloatArray, points: FloatArray, degree: int, value: float) -> tuple[FloatArray, FloatArray]:
    """Knots and homogeneous control points after one insertion of ``value`` (Boehm, CAD 12 (1980) 199-201)."""
    k = int(np.searchsorted(knots, value, side="right")) - 1
    fresh = np.empty((len(points) + 1, 3))
    for i in range(len(fresh)):
        if i <= k - degree:
            fresh[i] = points[i]
        elif i > k or i >= len(points):
            fresh[i] = points[i - 1]
        else:
            a = (value - knots[i]) / (knots[i + degree] - knots[i])
            fresh[i] = a * points[i] + (1.0 - a) * points[i - 1]
    return np.insert(knots, k + 1, value), fresh


def powers(spans: FloatArray) -> FloatArray:
    """Coefficients of the powers of ``u`` in -1/2 .. 1/2, from Bezier control points on the same range; same shape."""
    p = spans.shape[1] - 1
    forward = np.array([[comb(p, i) * comb(i, j) * (-1.0) ** (i - j) for j in range(p + 1)] for i in range(p + 1)])
    about_middle = np.array(
        [[comb(i, k) * 0.5 ** (i - k) if i >= k else 0.0 for i in range(p + 1)] for k in range(p + 1)]
    )
    coefficients: FloatArray = np.einsum("ki,ij,sjc->skc", about_middle, forward, spans)
    return coefficients
