"""From the polynomials of an outline to what the kernels read: pieces and their bounds, extreme points, vertices."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import comb, pi

import numpy as np

from ninedisk.core.array_types import FloatArray
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


class Piece:
    """Part of a span and what bounds it.

    Parameters
    ----------
    span : int
    poly : ndarray, shape (degree + 1, 3)
        Coefficients of the span.
    low, high : float
        Range of ``u``.
    """

    def __init__(self, span: int, poly: FloatArray, low: float, high: float) -> None:
        self.span, self.poly, self.low, self.high = span, poly, low, high

    @cached_property
    def middle(self) -> FloatArray:
        """x, y, x', y' in the middle, derivatives by ``u`` [m]."""
        u = 0.5 * (self.low + self.high)
        value, slope = _at(self.poly, u), _at(_derivative(self.poly), u)
        point = value[:2] / value[2]
        return np.concatenate([point, (slope[:2] - point * slope[2]) / value[2]])

    @cached_property
    def bend(self) -> float:
        """Bound of the length of the second derivative by ``u`` [m], from the hulls of numerator and denominator.

        With ``X = w (C - m)`` about the middle point m: ``C' = (X' - (C - m) w')/w`` and
        ``C'' = (X'' - 2 C' w' - (C - m) w'')/w``.
        """
        x = self.poly.copy()
        x[:, :2] -= np.outer(x[:, 2], self.middle[:2])
        first, second = _derivative(x), _derivative(_derivative(x))
        hull = [_hull(c, self.low, self.high) for c in (x, first, second)]
        least = float(hull[0][:, 2].min())
        if least <= 0.0:
            return np.inf
        reach = float(np.hypot(*(hull[0][:, :2] / hull[0][:, 2:]).T).max())
        numerator = [float(np.hypot(h[:, 0], h[:, 1]).max()) for h in hull]
        weight = [float(np.abs(h[:, 2]).max()) for h in hull]
        speed = (numerator[1] + reach * weight[1]) / least
        return (numerator[2] + 2.0 * speed * weight[1] + reach * weight[2]) / least

    @cached_property
    def turn(self) -> float:
        """Bound of the tangent's turning over the piece [rad]; pi if the curve may stand still."""
        speed, change = float(np.hypot(*self.middle[2:])), 0.5 * self.bend * (self.high - self.low)
        return 2.0 * float(np.arcsin(change / speed)) if change < speed else pi

    @property
    def circle(self) -> tuple[float, float, float]:
        """Circle that contains the piece: centre and radius [m], with room for rounding."""
        half = 0.5 * (self.high - self.low)
        radius = float(np.hypot(*self.middle[2:])) * half + 0.5 * self.bend * half**2
        return float(self.middle[0]), float(self.middle[1]), radius * (1.0 + 1e-12)

    def halves(self) -> tuple[Piece, Piece]:
        """Its two halves."""
        u = 0.5 * (self.low + self.high)
        return Piece(self.span, self.poly, self.low, u), Piece(self.span, self.poly, u, self.high)


def pieces_of(polys: FloatArray) -> list[Piece]:
    """Pieces of all spans in order, each of which turns by `TURN` at most."""
    done: list[Piece] = []
    for span, poly in enumerate(polys):
        waiting = [Piece(span, poly, -0.5, 0.5)]
        while waiting:
            piece = waiting.pop()
            if len(done) > MOST_PIECES:
                raise InvalidSceneError(
                    f"the outline turns so sharply that it has more than {MOST_PIECES} pieces: points or weights differ too much; make "
                    "corners by knots repeated degree times, and fit it with fewer points"
                )
            if piece.turn <= TURN or piece.high - piece.low <= 0.5**SPLITS:
                done.append(piece)
            else:
                first, second = piece.halves()
                waiting += [second, first]
    return done


def shape_table(shapes: Sequence[FloatArray]) -> ShapeTable:
    """Table of shapes.

    Parameters
    ----------
    shapes : sequence of ndarray, each of shape (spans, degree + 1, 3)
        Coefficients of the powers of ``u`` of each span.

    Returns
    -------
    ShapeTable
    """
    most = max(polys.shape[1] for polys in shapes)
    pieces = [pieces_of(polys) for polys in shapes]
    every = [piece for own in pieces for piece in own]
    directions = [_extremes(polys, own) for polys, own in zip(shapes, pieces, strict=True)]
    return ShapeTable(
        degree=np.array([polys.shape[1] - 1 for polys in shapes], dtype=np.int64),
        first_span=np.cumsum([0, *(len(polys) for polys in shapes)]).astype(np.int64),
        first_piece=np.cumsum([0, *(len(own) for own in pieces)]).astype(np.int64),
        coef=np.concatenate([np.pad(polys, ((0, 0), (0, most - polys.shape[1]), (0, 0))) for polys in shapes]),
        piece_span=np.array([piece.span for piece in every], dtype=np.int64),
        piece_range=np.array([(piece.low, piece.high) for piece in every]),
        piece_circle=np.array([piece.circle for piece in every]),
        piece_bend=np.array([piece.bend for piece in every]),
        radius=np.array([max(np.hypot(x, y) + r for x, y, r in (piece.circle for piece in own)) for own in pieces]),
        smallest_radius=np.array([least for _, least in directions]),
        extreme=np.array([places for places, _ in directions]),
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


def tables_together(tables: Sequence[ShapeTable]) -> ShapeTable:
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
    """Points, first and second derivatives by ``u`` [m] at the same ``u`` of every span, each of shape (spans, len(u), 2)."""
    value, slope, twice = (_many(c, u) for c in (polys, _derivative(polys), _derivative(_derivative(polys))))
    w, w1, w2 = value[..., 2:], slope[..., 2:], twice[..., 2:]
    point = value[..., :2] / w
    first = (slope[..., :2] - point * w1) / w
    return point, first, (twice[..., :2] - 2.0 * first * w1 - point * w2) / w


def _extremes(polys: FloatArray, pieces: list[Piece]) -> tuple[FloatArray, float]:
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


def _smallest_radius(polys: FloatArray, pieces: list[Piece]) -> float:
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
    least = np.inf
    for piece in pieces:
        u = np.linspace(piece.low, piece.high, RADII)
        _, first, second = outline_points(polys[piece.span : piece.span + 1], u)
        pace = np.linalg.norm(first[0], axis=1)
        if pace.min() == 0.0:
            return 0.0
        curvature = (first[0, :, 0] * second[0, :, 1] - first[0, :, 1] * second[0, :, 0]) / pace**3
        # Between samples the curvature may leave their range: room of their own spread.
        spread = np.ptp(curvature)
        if curvature.min() - spread <= 0.0:
            return 0.0
        least = min(least, 1.0 / (curvature.max() + spread))
    return float(least)


def _derivative(poly: FloatArray) -> FloatArray:
    """Coefficients of the derivative by ``u``; powers run along the last axis but one."""
    k = np.arange(1, poly.shape[-2])
    slope = poly[..., 1:, :] * k[:, None]
    return slope if len(k) else np.zeros_like(poly)


def _at(poly: FloatArray, u: float) -> FloatArray:
    return np.asarray(np.polynomial.polynomial.polyval(u, poly), dtype=np.float64)


def _many(polys: FloatArray, u: FloatArray) -> FloatArray:
    """Values of polynomials, shape (spans, len(u), 3)."""
    value: FloatArray = np.einsum("skc,uk->suc", polys, u[:, None] ** np.arange(polys.shape[1]))
    return value


def _hull(poly: FloatArray, low: float, high: float) -> FloatArray:
    """Bezier control points of a polynomial on ``low .. high``: its values lie in their hull."""
    p = len(poly) - 1
    middle, half = 0.5 * (low + high), high - low
    shifted = np.array([sum(comb(j, k) * middle ** (j - k) * poly[j] for j in range(k, p + 1)) for k in range(p + 1)])
    # In t = (u - low)/(high - low), u - middle = half (t - 1/2).
    in_t = np.array(
        [sum(comb(j, k) * (-0.5) ** (j - k) * half**j * shifted[j] for j in range(k, p + 1)) for k in range(p + 1)]
    )
    return np.array([sum(comb(i, k) / comb(p, k) * in_t[k] for k in range(i + 1)) for i in range(p + 1)])


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
