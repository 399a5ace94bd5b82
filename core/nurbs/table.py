"""From the polynomials of an outline to what the kernels read: pieces and their bounds, extreme points, vertices."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, pi
from typing import NamedTuple

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve_kernels import BINS, ShapeTable, diamond_angle, sample
from ninedisk.core.nurbs.state import Vertices

TURN = 0.6
"""Largest turning of the tangent over a piece [rad], by its bound: then its circle fits and the piece is a graph over its chord."""

MOST_PIECES = 1_000
"""Of an outline: crossings are sought among all pairs of their segments."""

SPLITS = 12
"""Halvings of a span after which a piece is taken as it is: where the curve nearly stands still, the bound may never be met."""

STRAIGHT = 1e-9
"""Turning of the tangent [rad] up to which a piece counts as straight: rounding of its control points."""

CORNER = 1e-6
"""Turning between two pieces [rad] from which there is a corner: a fitted outline with continuous tangents stays far below."""

PLACES = 5
"""Points of a piece at which its curvature is looked at."""

DIRECTIONS = 65
"""Points of a span at which the normal's direction is tabulated, to begin the search for an extreme point near it."""

RADII = 9
"""Points of a piece at which the radius of curvature is taken; what it does between them is bounded by their spread."""

KINK = 1e-9
"""Sine of the turning between two spans from which an outline is not smooth: rounding of its control points."""

DIAMOND_TURN = 4.0
"""A full turn, as `diamond_angle` counts."""


class Pieces(NamedTuple):
    """Parts of spans and what bounds them, m in a row.

    Attributes
    ----------
    span : ndarray of int64, shape (m,)
    low, high : ndarray, shape (m,)
        Range of ``u``.
    middle : ndarray, shape (m, 4)
        x, y, x', y' in the middle, derivatives by ``u`` [m].
    bend : ndarray, shape (m,)
        Bound of the length of the second derivative by ``u`` [m], see `_bend`.
    """

    span: IntArray
    low: FloatArray
    high: FloatArray
    middle: FloatArray
    bend: FloatArray

    @property
    def turn(self) -> FloatArray:
        """Bound of the tangent's turning over each piece [rad]; pi if the curve may stand still."""
        speed, change = np.hypot(*self.middle.T[2:]), 0.5 * self.bend * (self.high - self.low)
        turns = change < speed
        return np.where(turns, 2.0 * np.arcsin(np.where(turns, change, 0.0) / np.where(turns, speed, 1.0)), pi)

    @property
    def circle(self) -> FloatArray:
        """Circle that contains each piece, shape (m, 3): centre and radius [m], with room for rounding."""
        half = 0.5 * (self.high - self.low)
        radius = np.hypot(*self.middle.T[2:]) * half + 0.5 * self.bend * half**2
        return np.column_stack([self.middle[:, :2], radius * (1.0 + 1e-12)])


def pieces_of(polys: FloatArray) -> Pieces:
    """Pieces of all spans in order, each of which turns by `TURN` at most.

    Parameters
    ----------
    polys : ndarray, shape (spans, degree + 1, 3)

    Raises
    ------
    InvalidSceneError
        If they are too many.
    """
    span, low = np.arange(len(polys)), np.full(len(polys), -0.5)
    high, done, count = -low, [], 0
    while len(span):
        found = _bounded(polys, span, low, high)
        fine = (found.turn <= TURN) | (high - low <= 0.5**SPLITS)
        done.append(Pieces(*(each[fine] for each in found)))
        count += int(np.count_nonzero(fine))
        if count + np.count_nonzero(~fine) > MOST_PIECES:
            raise InvalidSceneError(
                f"the outline turns so sharply that it has more than {MOST_PIECES} pieces: points or weights differ too much; make "
                "corners by knots repeated degree times, and fit it with fewer points"
            )
        span, left, right = np.repeat(span[~fine], 2), low[~fine], high[~fine]
        middle = 0.5 * (left + right)
        low, high = np.column_stack([left, middle]).ravel(), np.column_stack([middle, right]).ravel()
    every = [np.concatenate(columns) for columns in zip(*done, strict=True)]
    order = np.lexsort((every[1], every[0]))
    return Pieces(*(column[order] for column in every))


def _bounded(polys: FloatArray, span: IntArray, low: FloatArray, high: FloatArray) -> Pieces:
    x = polys[span]
    at = (0.5 * (low + high))[:, None]
    value, slope = _many(x, at)[:, 0], _many(_derivative(x), at)[:, 0]
    point = value[:, :2] / value[:, 2:]
    middle = np.concatenate([point, (slope[:, :2] - point * slope[:, 2:]) / value[:, 2:]], axis=1)
    return Pieces(span, low, high, middle, _bend(x, point, low, high))


def _bend(polys: FloatArray, middle: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Bounds of the second derivatives by ``u`` [m], from the hulls of numerator and denominator; inf where a weight may be 0.

    With ``X = w (C - m)`` about the middle point m: ``C' = (X' - (C - m) w')/w`` and ``C'' = (X'' - 2 C' w' - (C - m) w'')/w``.
    """
    x = polys.copy()
    x[..., :2] -= x[..., 2:] * middle[:, None]
    first = _derivative(x)
    hull = [_hulls(c, low, high) for c in (x, first, _derivative(first))]
    least = hull[0][..., 2].min(axis=1)
    bounded = least > 0.0
    least = np.where(bounded, least, 1.0)
    weights = np.where(bounded[:, None], hull[0][..., 2], 1.0)
    reach = np.hypot(hull[0][..., 0] / weights, hull[0][..., 1] / weights).max(axis=1)
    numerator = [np.hypot(h[..., 0], h[..., 1]).max(axis=1) for h in hull]
    weight = [np.abs(h[..., 2]).max(axis=1) for h in hull]
    speed = (numerator[1] + reach * weight[1]) / least
    return np.where(bounded, (numerator[2] + 2.0 * speed * weight[1] + reach * weight[2]) / least, np.inf)


def outline_table(polys: FloatArray) -> ShapeTable:
    """Table of one outline.

    Parameters
    ----------
    polys : ndarray, shape (spans, degree + 1, 3)
        Coefficients of the powers of ``u`` of each span.

    Returns
    -------
    ShapeTable
    """
    pieces = pieces_of(polys)
    circle = pieces.circle
    places, least = _extremes(polys, pieces)
    return ShapeTable(
        degree=np.array([polys.shape[1] - 1], dtype=np.int64),
        first_span=np.array([0, len(polys)], dtype=np.int64),
        first_piece=np.array([0, len(pieces.span)], dtype=np.int64),
        coef=polys,
        piece_span=pieces.span,
        piece_range=np.column_stack([pieces.low, pieces.high]),
        piece_circle=circle,
        piece_bend=pieces.bend,
        radius=np.array([np.max(np.hypot(circle[:, 0], circle[:, 1]) + circle[:, 2])]),
        smallest_radius=np.array([least]),
        extreme=places[None],
    )


def table_of_circles(unit: ShapeTable, radii: FloatArray) -> ShapeTable:
    """Circles of several radii [m] from the table of the circle of radius 1."""
    m, spans, pieces = len(radii), len(unit.coef), len(unit.piece_span)
    coef = np.tile(unit.coef, (m, 1, 1))
    coef[:, :, :2] *= np.repeat(radii, spans)[:, None, None]
    each = np.repeat(radii, pieces)
    return ShapeTable(
        degree=np.tile(unit.degree, m),
        first_span=spans * np.arange(m + 1, dtype=np.int64),
        first_piece=pieces * np.arange(m + 1, dtype=np.int64),
        coef=coef,
        piece_span=np.tile(unit.piece_span, m),
        piece_range=np.tile(unit.piece_range, (m, 1)),
        piece_circle=np.tile(unit.piece_circle, (m, 1)) * each[:, None],
        piece_bend=np.tile(unit.piece_bend, m) * each,
        radius=unit.radius * radii,
        smallest_radius=unit.smallest_radius * radii,
        extreme=np.tile(unit.extreme, (m, 1)),
    )


def joined_tables(tables: Sequence[ShapeTable]) -> ShapeTable:
    """One table of the shapes of several, in their order."""
    most = max(table.coef.shape[1] for table in tables)
    joined = {name: np.concatenate([getattr(table, name) for table in tables]) for name in ShapeTable._fields[4:]}
    counts = {
        name: np.concatenate([np.diff(getattr(table, name)) for table in tables])
        for name in ("first_span", "first_piece")
    }
    return ShapeTable(
        degree=np.concatenate([table.degree for table in tables]),
        **{name: np.concatenate([[0], np.cumsum(count)]) for name, count in counts.items()},
        coef=np.concatenate([np.pad(t.coef, ((0, 0), (0, most - t.coef.shape[1]), (0, 0))) for t in tables]),
        **joined,
    )


def outline_points(polys: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points, first and second derivatives by ``u`` [m] at ``u``, as `_many` takes it, each of shape (spans, k, 2)."""
    value, slope, twice = (_many(c, u) for c in (polys, _derivative(polys), _derivative(_derivative(polys))))
    w, w1, w2 = value[..., 2:], slope[..., 2:], twice[..., 2:]
    point = value[..., :2] / w
    first = (slope[..., :2] - point * w1) / w
    return point, first, (twice[..., :2] - 2.0 * first * w1 - point * w2) / w


def _extremes(polys: FloatArray, pieces: Pieces) -> tuple[FloatArray, float]:
    """Places of the extreme points, shape (BINS + 1,), and the smallest radius of curvature; zeros unless strictly convex."""
    least = _smallest_radius(polys, pieces)
    if least == 0.0:
        return np.zeros(BINS + 1), 0.0
    u = np.linspace(-0.5, 0.5, DIRECTIONS)
    _, first, _ = outline_points(polys, u)
    # The outward normal is the tangent turned clockwise; over the whole curve it turns once.
    angle = np.array([diamond_angle(y, -x) for x, y in first.reshape(-1, 2)])
    place = (np.arange(len(polys))[:, None] + u + 0.5).ravel()
    start = int(np.argmin(angle))
    place = np.concatenate([place[start:], place[:start] + len(polys)])
    angle = np.maximum.accumulate(np.concatenate([angle[start:], angle[:start]]))
    turned = np.concatenate([angle[-1:] - DIAMOND_TURN, angle, angle[:1] + DIAMOND_TURN])
    places = np.concatenate([place[-1:] - len(polys), place, place[:1] + len(polys)])
    return np.interp(DIAMOND_TURN * np.arange(BINS + 1) / BINS, turned, places) + len(polys), least


def _smallest_radius(polys: FloatArray, pieces: Pieces) -> float:
    """Lower bound of the radius of curvature [m]; 0 if it is not positive throughout or the outline has a corner."""
    _, slopes, _ = outline_points(polys, np.array([-0.5, 0.5]))
    speed = np.linalg.norm(slopes, axis=-1, keepdims=True)
    if speed.min() == 0.0:
        return 0.0
    unit = slopes / speed
    following = np.roll(unit[:, 0], -1, axis=0)
    kink = unit[:, 1, 0] * following[:, 1] - unit[:, 1, 1] * following[:, 0]
    if np.abs(kink).max() > KINK or np.sum(unit[:, 1] * following, axis=1).min() < 0.0:
        return 0.0
    u = np.linspace(pieces.low, pieces.high, RADII, axis=1)
    _, first, second = outline_points(polys[pieces.span], u)
    pace = np.linalg.norm(first, axis=-1)
    if pace.min() == 0.0:
        return 0.0
    curvature = (first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / pace**3
    # Between samples the curvature may leave their range: room of their own spread.
    spread = np.ptp(curvature, axis=1)
    if np.min(curvature.min(axis=1) - spread) <= 0.0:
        return 0.0
    return float(1.0 / np.max(curvature.max(axis=1) + spread))


def _derivative(poly: FloatArray) -> FloatArray:
    """Coefficients of the derivative by ``u``; powers run along the last axis but one."""
    k = np.arange(1, poly.shape[-2])
    slope = poly[..., 1:, :] * k[:, None]
    return slope if len(k) else np.zeros_like(poly)


def _many(polys: FloatArray, u: FloatArray) -> FloatArray:
    """Values of polynomials, shape (spans, k, 3), at the same ``u``, shape (k,), of all of them, or each at its own, (spans, k)."""
    value: FloatArray = np.einsum(
        "skc,uk->suc" if u.ndim == 1 else "skc,suk->suc", polys, u[..., None] ** np.arange(polys.shape[1])
    )
    return value


def _hulls(polys: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Bezier control points of m polynomials, each on its ``low .. high``: their values lie in the hulls of these. Shape as ``polys``."""
    p = polys.shape[1] - 1
    k = np.arange(p + 1)
    chosen = np.array([[float(comb(j, i)) for j in k] for i in k])
    # In powers of u - middle, then of t = (u - low)/(high - low), where u - middle = half (t - 1/2); then of Bernstein's polynomials.
    power = np.maximum(k - k[:, None], 0)
    about = chosen * (0.5 * (low + high))[:, None, None] ** power
    in_t = chosen * (-0.5) ** power * (high - low)[:, None, None] ** k
    control = chosen.T / chosen[:, p]
    hulls: FloatArray = np.einsum("ik,mkj,mjl,mlc->mic", control, in_t, about, polys, optimize=True)
    return hulls


def vertices_of(table: ShapeTable) -> Vertices:
    """Vertices of all shapes; corners that point inwards touch nothing before their neighbours do and are none."""
    straight = np.zeros(len(table.piece_span), dtype=np.bool_)
    counts: list[int] = []
    rows: list[list[float]] = []
    for shape in range(len(table.degree)):
        pieces = range(int(table.first_piece[shape]), int(table.first_piece[shape + 1]))
        ends = {k: _ends(table, shape, k) for k in pieces}
        for k in pieces:
            straight[k] = ends[k][2]
        before = len(rows)
        for k, last in zip(pieces, [pieces[-1], *pieces[:-1]], strict=True):
            (_, normal, _), here = ends[last], ends[k]
            turn = np.arctan2(normal[0] * here[0][5] - normal[1] * here[0][4], normal @ here[0][4:6])
            if turn > CORNER or (abs(turn) <= CORNER and straight[k] != straight[last]):
                rows.append([here[0][0], *here[0][1:3], *normal, *here[0][4:6]])
        counts.append(len(rows) - before)
    found = np.array(rows, dtype=np.float64).reshape(len(rows), 7)
    return Vertices(
        first=np.cumsum([0, *counts]).astype(np.int64),
        place=found[:, 0].copy(),
        point=found[:, 1:3].copy(),
        cone=found[:, 3:7].copy(),
        straight=straight,
    )


def _ends(table: ShapeTable, shape: int, k: int) -> tuple[FloatArray, FloatArray, bool]:
    """Place, point, 0 and normal at the start of a piece; the normal at its end; whether it is straight."""
    u = np.linspace(table.piece_range[k, 0], table.piece_range[k, 1], PLACES)
    out = np.empty((PLACES, 6))
    sample(table, shape, np.full(PLACES, table.piece_span[k]), u, out)
    speed = np.hypot(out[:, 2], out[:, 3])
    turning = np.abs(out[:, 2] * out[:, 5] - out[:, 3] * out[:, 4]) / speed**2 * (u[-1] - u[0])
    normal = np.column_stack([out[:, 3], -out[:, 2]]) / speed[:, None]
    start = np.array([table.piece_span[k] + u[0] + 0.5, out[0, 0], out[0, 1], 0.0, *normal[0]])
    return start, normal[-1], bool(turning.max() <= STRAIGHT)
