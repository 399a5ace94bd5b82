"""Kernels of the gap between outlines that do not touch: their smallest distance.

Strictly convex outlines have one common normal between them, which Newton's method finds. Otherwise all pairs of pieces that their
bounding circles do not exclude are searched: along a piece of the one outline the distance to the nearest point of a piece of the other
has the slope ``(p - q).C'/|p - q|``, whose zero is bisected. A piece turns by 0.6 rad at most, so that this has one valley; corners
are ends of pieces.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, tangent_at
from ninedisk.core.nurbs.lens_kernels import extent_on
from ninedisk.core.nurbs.nurbs_convex_kernels import deepest

BISECTIONS = 40
"""Halvings of a piece: its 1e-12th part, in whose square the distance errs."""

TOUCHING = 1e-14
"""Of the coordinates of two points that touch: rounding of their difference, some operations each."""


@inline_kernel
def foot(table: ShapeTable, shape: int, k: int, pose: Pose, x: float, y: float) -> tuple[float, float]:
    """The point of a piece of a placed shape that is nearest to (x, y) [m], by Newton's method kept inside by bisection."""
    span, low, high = table.piece_span[k], table.piece_range[k, 0], table.piece_range[k, 1]
    qx, qy, dx, dy = tangent_at(table, shape, span, low, pose)
    if (qx - x) * dx + (qy - y) * dy >= 0.0:
        return qx, qy
    qx, qy, dx, dy = tangent_at(table, shape, span, high, pose)
    if (qx - x) * dx + (qy - y) * dy <= 0.0:
        return qx, qy
    u = 0.5 * (low + high)
    for _ in range(60):
        qx, qy, dx, dy, ex, ey = bend_at(table, shape, span, u, pose)
        slope = (qx - x) * dx + (qy - y) * dy
        if slope < 0.0:
            low = u
        else:
            high = u
        step = -slope / (dx * dx + dy * dy + (qx - x) * ex + (qy - y) * ey)
        if abs(step) < 1e-10:
            return qx + step * dx, qy + step * dy
        u = u + step if low < u + step < high else 0.5 * (low + high)
    return qx, qy


@inline_kernel
def distance_of_pieces(table: ShapeTable, a: int, ka: int, b: int, kb: int, pose: Pose) -> float:
    """Smallest distance [m] of two pieces, the second shape being placed by ``pose``."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    span, low, high = table.piece_span[ka], table.piece_range[ka, 0], table.piece_range[ka, 1]
    best = 1e300
    for k in range(BISECTIONS + 2):
        u = low if k == 0 else (high if k == 1 else 0.5 * (low + high))
        x, y, dx, dy = tangent_at(table, a, span, u, still)
        qx, qy = foot(table, b, kb, pose, x, y)
        best = min(best, sqrt((x - qx) * (x - qx) + (y - qy) * (y - qy)))
        if k >= 2:
            if (x - qx) * dx + (y - qy) * dy < 0.0:
                low = u
            else:
                high = u
    return best


@inline_kernel
def convex_gap(table: ShapeTable, a: int, b: int, pose: Pose) -> float:
    """Gap [m] of strictly convex outlines along their common normal; NaN if Newton's method did not find one with a gap.

    Outlines that do not touch have no negative gap but by rounding: those that graze have 0. The other common normal, through both far
    sides, has the widths of both outlines for a negative gap.
    """
    still = Pose(1.0, 0.0, 0.0, 0.0)
    found, i, u, j, v = deepest(table, a, b, pose)
    x, y, dx, dy = tangent_at(table, a, i, u, still)
    px, py, ex, ey = tangent_at(table, b, j, v, pose)
    gap = ((px - x) * dy - (py - y) * dx) / sqrt(dx * dx + dy * dy)
    rounding = TOUCHING * (abs(x) + abs(y) + abs(px) + abs(py))
    return max(gap, 0.0) if found and gap >= -rounding and dx * ex + dy * ey < 0.0 else float("nan")


@inline_kernel
def gap_of_shapes(table: ShapeTable, a: int, b: int, pose: Pose) -> float:
    """Smallest distance [m] of two outlines that do not touch, the second one being placed by ``pose`` in the first one's frame."""
    if table.smallest_radius[a] > 0.0 and table.smallest_radius[b] > 0.0:
        gap = convex_gap(table, a, b, pose)
        if gap >= 0.0:
            return gap
    best = 1e300
    for ka in range(table.first_piece[a], table.first_piece[a + 1]):
        for kb in range(table.first_piece[b], table.first_piece[b + 1]):
            px, py = table.piece_circle[kb, 0], table.piece_circle[kb, 1]
            x = pose.c * px - pose.s * py + pose.x - table.piece_circle[ka, 0]
            y = pose.s * px + pose.c * py + pose.y - table.piece_circle[ka, 1]
            if sqrt(x * x + y * y) - table.piece_circle[ka, 2] - table.piece_circle[kb, 2] < best:
                best = min(best, distance_of_pieces(table, a, ka, b, kb, pose))
    return best


@inline_kernel
def reach_of_shape(table: ShapeTable, shape: int, nx: float, ny: float) -> float:
    """Largest coordinate of an outline along (nx, ny), in its own frame [m]."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    best = -1e300
    for k in range(table.first_piece[shape], table.first_piece[shape + 1]):
        low, high = table.piece_range[k, 0], table.piece_range[k, 1]
        best = max(best, extent_on(table, shape, still, table.piece_span[k], low, high, nx, ny))
    return best
