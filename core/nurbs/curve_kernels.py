"""Kernels of NURBS outlines: points, derivatives and differences of points that lose no digits.

A curve is a ring of spans. On each span the homogeneous coordinates ``(w x, w y, w)`` are polynomials in ``u``, in powers about
the span's middle: ``u`` runs from -1/2 to 1/2. A place on the curve is the pair (span, u); spans count from 0 in each shape.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

BINS = 32
"""Number of directions for which a convex outline keeps the place of its extreme point."""


class ShapeTable(NamedTuple):
    """Outlines of s shapes in their own frames, in n spans and m pieces.

    Attributes
    ----------
    degree : ndarray of int64, shape (s,)
    first_span, first_piece : ndarray of int64, shape (s + 1,)
        Spans ``first_span[k] .. first_span[k+1]-1`` belong to shape ``k``; the same for pieces.
    coef : ndarray, shape (n, largest degree + 1, 3)
        Coefficients of the powers of ``u``: w x [m], w y [m], w [-].
    piece_span : ndarray of int64, shape (m,)
        Span of a piece, counted within its shape.
    piece_range : ndarray, shape (m, 2)
        Range of ``u`` of a piece, inside -1/2 .. 1/2.
    piece_circle : ndarray, shape (m, 3)
        Circle that contains the piece: centre and radius [m].
    piece_bend : ndarray, shape (m,)
        Bound of the second derivative's length over the piece [m].
    radius : ndarray, shape (s,)
        Radius about the frame's origin of a circle that contains the shape [m].
    smallest_radius : ndarray, shape (s,)
        Lower bound of the radius of curvature [m] if the outline is strictly convex and smooth, otherwise 0.
    extreme : ndarray, shape (s, BINS + 1)
        Places span + u + 1/2 of the extreme points in directions of equal steps in `diamond_angle`, ascending over one turn;
        convex outlines only.
    """

    degree: NDArray[np.int64]
    first_span: NDArray[np.int64]
    first_piece: NDArray[np.int64]
    coef: NDArray[np.float64]
    piece_span: NDArray[np.int64]
    piece_range: NDArray[np.float64]
    piece_circle: NDArray[np.float64]
    piece_bend: NDArray[np.float64]
    radius: NDArray[np.float64]
    smallest_radius: NDArray[np.float64]
    extreme: NDArray[np.float64]


class Pose(NamedTuple):
    """Placement of a shape in the frame in which a contact is computed: ``q = rotation p + offset``.

    Attributes
    ----------
    c, s : float
        Cosine and sine of the rotation.
    x, y : float
        Offset [m].
    """

    c: float
    s: float
    x: float
    y: float


@kernel
def diamond_angle(x: float, y: float) -> float:
    """Monotone stand-in of the direction's angle, in [0, 4): exact multiples of 1 on the axes, no trigonometry."""
    total = abs(x) + abs(y)
    part = y / total
    if x < 0.0:
        return 2.0 - part
    return part if y >= 0.0 else 4.0 + part


@inline_kernel
def point_at(table: ShapeTable, shape: int, span: int, u: float, pose: Pose) -> tuple[float, float]:
    """Point of the placed outline [m]."""
    row = table.first_span[shape] + span
    k = table.degree[shape]
    x, y, w = table.coef[row, k, 0], table.coef[row, k, 1], table.coef[row, k, 2]
    while k > 0:
        k -= 1
        x = x * u + table.coef[row, k, 0]
        y = y * u + table.coef[row, k, 1]
        w = w * u + table.coef[row, k, 2]
    x, y = x / w, y / w
    return pose.c * x - pose.s * y + pose.x, pose.s * x + pose.c * y + pose.y


@inline_kernel
def tangent_at(table: ShapeTable, shape: int, span: int, u: float, pose: Pose) -> tuple[float, float, float, float]:
    """Point and first derivative by ``u`` of the placed outline [m]: x, y, x', y'."""
    row = table.first_span[shape] + span
    k = table.degree[shape]
    x, y, w = table.coef[row, k, 0], table.coef[row, k, 1], table.coef[row, k, 2]
    dx, dy, dw = 0.0, 0.0, 0.0
    while k > 0:
        k -= 1
        dx, dy, dw = dx * u + x, dy * u + y, dw * u + w
        x = x * u + table.coef[row, k, 0]
        y = y * u + table.coef[row, k, 1]
        w = w * u + table.coef[row, k, 2]
    inverse = 1.0 / w
    x, y = x * inverse, y * inverse
    dx, dy = (dx - x * dw) * inverse, (dy - y * dw) * inverse
    return (
        pose.c * x - pose.s * y + pose.x,
        pose.s * x + pose.c * y + pose.y,
        pose.c * dx - pose.s * dy,
        pose.s * dx + pose.c * dy,
    )


@inline_kernel
def bend_at(
    table: ShapeTable, shape: int, span: int, u: float, pose: Pose
) -> tuple[float, float, float, float, float, float]:
    """Point, first and second derivative by ``u`` of the placed outline [m]: x, y, x', y', x'', y''."""
    row = table.first_span[shape] + span
    k = table.degree[shape]
    x, y, w = table.coef[row, k, 0], table.coef[row, k, 1], table.coef[row, k, 2]
    dx, dy, dw = 0.0, 0.0, 0.0
    hx, hy, hw = 0.0, 0.0, 0.0  # half the second derivatives
    while k > 0:
        k -= 1
        hx, hy, hw = hx * u + dx, hy * u + dy, hw * u + dw
        dx, dy, dw = dx * u + x, dy * u + y, dw * u + w
        x = x * u + table.coef[row, k, 0]
        y = y * u + table.coef[row, k, 1]
        w = w * u + table.coef[row, k, 2]
    inverse = 1.0 / w
    x, y = x * inverse, y * inverse
    dx, dy = (dx - x * dw) * inverse, (dy - y * dw) * inverse
    ex = 2.0 * (hx - dx * dw - x * hw) * inverse
    ey = 2.0 * (hy - dy * dw - y * hw) * inverse
    return (
        pose.c * x - pose.s * y + pose.x,
        pose.s * x + pose.c * y + pose.y,
        pose.c * dx - pose.s * dy,
        pose.s * dx + pose.c * dy,
        pose.c * ex - pose.s * ey,
        pose.s * ex + pose.c * ey,
    )


@inline_kernel
def step_within(table: ShapeTable, shape: int, span: int, u0: float, u1: float) -> tuple[float, float]:
    """``C(u1) - C(u0)`` on one span in the shape's frame [m], to relative precision however close the two are.

    With the divided differences X, W of the homogeneous coordinates, ``C(u1) - C(u0) = (u1 - u0) (X - C(u0) W) / w(u1)``: nothing
    of the curve's own size is subtracted.
    """
    row = table.first_span[shape] + span
    k = table.degree[shape]
    x, y, w = table.coef[row, k, 0], table.coef[row, k, 1], table.coef[row, k, 2]
    qx, qy, qw = 0.0, 0.0, 0.0
    while k > 0:
        k -= 1
        qx, qy, qw = qx * u1 + x, qy * u1 + y, qw * u1 + w
        x = x * u0 + table.coef[row, k, 0]
        y = y * u0 + table.coef[row, k, 1]
        w = w * u0 + table.coef[row, k, 2]
    length = u1 - u0
    factor = length / (w + length * qw)
    return factor * (qx - x / w * qw), factor * (qy - y / w * qw)


@inline_kernel
def step_along(
    table: ShapeTable, shape: int, span0: int, u0: float, span1: int, u1: float, pose: Pose
) -> tuple[float, float]:
    """``C(span1, u1) - C(span0, u0)`` of the placed outline [m], summed span by span over the shorter way round.

    Close places on either side of a knot keep their relative precision too.
    """
    n = table.first_span[shape + 1] - table.first_span[shape]
    ahead = (span1 - span0) + (u1 - u0)
    if ahead < -0.5 * n:
        ahead += n
    elif ahead > 0.5 * n:
        ahead -= n
    span, end = (span0, span1) if ahead >= 0.0 else (span1, span0)
    low, high = (u0, u1) if ahead >= 0.0 else (u1, u0)
    x, y = 0.0, 0.0
    if span != end:
        x, y = step_within(table, shape, span, low, 0.5)
        span = span + 1 if span + 1 < n else 0
        while span != end:
            dx, dy = step_within(table, shape, span, -0.5, 0.5)
            x, y = x + dx, y + dy
            span = span + 1 if span + 1 < n else 0
        low = -0.5
    dx, dy = step_within(table, shape, span, low, high)
    x, y = x + dx, y + dy
    if ahead < 0.0:
        x, y = -x, -y
    return pose.c * x - pose.s * y, pose.s * x + pose.c * y


@inline_kernel
def walked(n: int, span: int, u: float) -> tuple[int, float]:
    """The place (span, u) with ``u`` brought into -1/2 .. 1/2 by passing to neighbouring spans of a ring of ``n``."""
    while u > 0.5:
        u -= 1.0
        span = span + 1 if span + 1 < n else 0
    while u < -0.5:
        u += 1.0
        span = span - 1 if span > 0 else n - 1
    return span, u


@inline_kernel
def extreme_guess(table: ShapeTable, shape: int, x: float, y: float) -> tuple[int, float]:
    """Place near the extreme point of a convex shape in the direction (x, y) of its own frame."""
    turn = diamond_angle(x, y) * (0.25 * BINS)
    k = min(int(turn), BINS - 1)
    part = turn - k
    place = (1.0 - part) * table.extreme[shape, k] + part * table.extreme[shape, k + 1]
    n = table.first_span[shape + 1] - table.first_span[shape]
    span = int(place)
    return span % n, place - span - 0.5


@kernel
def sample(
    table: ShapeTable, shape: int, span: NDArray[np.int64], u: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Points and derivatives at many places of one shape, in its own frame.

    Parameters
    ----------
    table : ShapeTable
    shape : int
    span : ndarray of int64, shape (k,)
    u : ndarray, shape (k,)
    out : ndarray, shape (k, 6)
        Out: x, y, x', y', x'', y'' [m], derivatives by ``u``.
    """
    still = Pose(1.0, 0.0, 0.0, 0.0)
    for k in range(u.shape[0]):
        x, y, dx, dy, ex, ey = bend_at(table, shape, span[k], u[k], still)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4], out[k, 5] = x, y, dx, dy, ex, ey
