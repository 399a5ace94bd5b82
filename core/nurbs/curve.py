"""Closed rational B-spline curves in the plane, and what such a curve must fulfil to be the outline of a grain."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve_kernels import ShapeTable, sample
from ninedisk.core.nurbs.table import outline_points, outline_table
from ninedisk.core.validate import LARGEST, SMALLEST, finite, numbers, real, short_repr

MOST_DEGREE, MOST_POINTS = 12, 1_000
"""Of an outline. Bernstein coefficients of higher degrees lose digits; crossings are sought among all pairs of an outline's segments."""

CLOSED_TO = 1e-12
"""Largest distance of first and last point, relative to the control polygon's size, that counts as rounding."""

SEGMENTS = 12
"""Straight segments into which a piece, turning by 0.6 rad at most, is divided to look for crossings."""

FLAT = 1e-9
"""Enclosed area over squared perimeter below which an outline is taken as having no area; a disk has 1/(4 pi)."""


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
                f"degree = {short_repr(degree)} is not allowed: it must be an integer in 1 .. {n - 1}, for {n} points"
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
        return outline_table(powers(self.spans))

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
            raise InvalidSceneError(f"order = {short_repr(order)} is not allowed: it must be 0, 1 or 2")
        order = int(order)
        span = np.clip(np.searchsorted(self.breaks, at, side="right") - 1, 0, len(self.breaks) - 2).astype(np.int64)
        width = self.breaks[span + 1] - self.breaks[span]
        out = np.empty((len(at), 6))
        sample(self.table, 0, span, (at - self.breaks[span]) / width - 0.5, out)
        return out[:, 2 * order : 2 * order + 2] / width[:, None] ** order

    def moved(self, *, shift: ArrayLike = (0.0, 0.0), angle: float = 0.0) -> NurbsCurve:
        """The outline turned about the origin by ``angle`` [rad], then shifted [m]."""
        turn, displacement = finite("angle", angle, (), most=LARGEST), finite("shift", shift, (2,), most=LARGEST)
        c, s = np.cos(turn), np.sin(turn)
        turned = self.points @ np.array([[c, s], [-s, c]])
        return NurbsCurve(degree=self.degree, knots=self.knots, points=turned + displacement, weights=self.weights)


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


def check_weights(weights: ArrayLike, n: int) -> FloatArray:
    """Read-only weights, one for each of the ``n`` control points and all > 0, or `InvalidSceneError`."""
    checked = finite("weights", numbers("weights", weights), (n,))
    if checked.min() <= 0.0:
        k = int(np.argmin(checked))
        raise InvalidSceneError(f"weights[{k}] = {checked[k]:g} is not allowed: it must be > 0")
    return checked


def check_knots(knots: ArrayLike, n: int, degree: int) -> FloatArray:
    """Read-only knots of ``n`` control points, or `InvalidSceneError`."""
    given = numbers("knots", knots)
    if given.shape != (n + degree + 1,):
        raise InvalidSceneError(
            f"there are {given.size} knots; {n} control points of degree {degree} need {n + degree + 1} (points + degree + 1)"
        )
    checked = finite("knots", given, (n + degree + 1,))
    falling = np.flatnonzero(np.diff(checked) < 0.0)
    if len(falling):
        k = int(falling[0])
        raise InvalidSceneError(f"knots must not decrease: knots[{k + 1}] = {checked[k + 1]:g} follows {checked[k]:g}")
    low, high = checked[degree], checked[n]
    if not low < high:
        raise InvalidSceneError(f"knots[{degree}] .. knots[{n}], the curve's range, is empty: both are {low:g}")
    inner, times = np.unique(checked[(checked > low) & (checked < high)], return_counts=True)
    if len(inner) and times.max() > degree:
        k = int(np.argmax(times))
        raise InvalidSceneError(
            f"knot {inner[k]:g} occurs {times[k]} times; more than degree = {degree} would tear the curve"
        )
    return checked


def check_outline(table: ShapeTable) -> None:
    """Raise `InvalidSceneError` unless the one shape of ``table`` moves on everywhere, runs counter-clockwise and is simple.

    Crossings are sought on the polygon of `SEGMENTS` points a piece: passages narrower than its distance from the curve, about
    1e-3 of a piece's length, cannot be distinguished from crossings.
    """
    points = []
    for k in range(len(table.piece_span)):
        low, high = table.piece_range[k]
        u = np.linspace(low, high, SEGMENTS + 1)
        span = int(table.piece_span[k])
        place, slope, _ = outline_points(table.coef[span : span + 1], u)
        if np.linalg.norm(slope[0], axis=1).min() <= 1e-9 * table.radius[0]:
            raise InvalidSceneError(
                f"the curve stands still near ({place[0, 0, 0]:g}, {place[0, 0, 1]:g}): "
                "make a corner by a knot repeated degree times, not by repeated control points"
            )
        points.append(place[0, :-1])
    polygon = np.concatenate(points)
    following = np.roll(polygon, -1, axis=0)
    area = 0.5 * float(np.sum(polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]))
    perimeter = float(np.linalg.norm(following - polygon, axis=1).sum())
    crossing = first_crossing(polygon)
    if abs(area) <= FLAT * perimeter**2:
        raise InvalidSceneError(f"the outline has zero area ({area:g} m^2 at a perimeter of {perimeter:g} m)")
    if crossing is not None:
        raise InvalidSceneError(
            f"the outline crosses itself near ({crossing[0]:g}, {crossing[1]:g}): a grain's boundary is simple"
        )
    if area < 0.0:
        raise InvalidSceneError(
            f"the outline runs clockwise (area {area:g} m^2): reverse its control points, weights and knots"
        )


def first_crossing(polygon: FloatArray) -> FloatArray | None:
    """A point where two segments of a closed polygon, not neighbours, meet; None if there is none."""
    n = len(polygon)
    along = np.roll(polygon, -1, axis=0) - polygon
    low, high = np.minimum(polygon, polygon + along), np.maximum(polygon, polygon + along)
    x, y = ((low[:, None, k] <= high[None, :, k]) & (low[None, :, k] <= high[:, None, k]) for k in (0, 1))
    i, j = np.nonzero(np.triu(x & y, 2))
    apart = (i > 0) | (j < n - 1)
    i, j = i[apart], j[apart]
    start = polygon[j] - polygon[i]
    cross = along[i, 0] * along[j, 1] - along[i, 1] * along[j, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        mine = (start[:, 0] * along[j, 1] - start[:, 1] * along[j, 0]) / cross
        its = (start[:, 0] * along[i, 1] - start[:, 1] * along[i, 0]) / cross
    met = np.flatnonzero((cross != 0.0) & (mine >= 0.0) & (mine <= 1.0) & (its >= 0.0) & (its <= 1.0))
    if not len(met):
        return None
    meeting: FloatArray = polygon[i[met[0]]] + mine[met[0]] * along[i[met[0]]]
    return meeting
