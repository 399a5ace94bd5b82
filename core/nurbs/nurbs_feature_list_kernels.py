"""Kernels that list the features of many pairs of outlines, and of outlines and walls."""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, tangent_at
from ninedisk.core.nurbs.features_kernels import features_in_frame
from ninedisk.core.nurbs.nurbs_feature_row_kernels import AT_END, CONVERGED, DEEPEST, added
from ninedisk.core.nurbs.nurbs_vertices import Vertices
from ninedisk.core.nurbs.state import TOO_DEEP, FeatureRows, FloatArray, IntArray

PARTS = 4
"""Parts of a piece between whose ends its height over a wall can have a valley: more than the inflections of a piece."""


@kernel
def features_of_pairs(
    table: ShapeTable,
    vertices: Vertices,
    shape: IntArray,
    x: FloatArray,
    turn: FloatArray,
    pairs: IntArray,
    reach: float,
    count: IntArray,
    out: FeatureRows,
) -> int:
    """Features of many pairs with a gap below ``reach`` [m], one pair after the other in ``out``; their number.

    Parameters
    ----------
    table : ShapeTable
    vertices : Vertices
        Of the same shapes.
    shape : ndarray of int64, shape (n,)
        Shape of each grain.
    x : ndarray, shape (n, 2)
        Positions [m].
    turn : ndarray, shape (n, 2)
        Cosine and sine of the rotations.
    pairs : ndarray of int64, shape (k, 2)
    reach : float
    count : ndarray of int64, shape (k,)
        Out: number of features of each pair, `FULL` where there was no room.
    out : FeatureRows
        Out.
    """
    row = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        a, b = shape[i], shape[j]
        c, s, p, q = turn[i, 0], turn[i, 1], turn[j, 0], turn[j, 1]
        dx, dy = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
        pose = Pose(c * p + s * q, c * q - s * p, c * dx + s * dy, c * dy - s * dx)
        found = features_in_frame(table, vertices, a, b, pose, reach, out, row)
        count[k] = found
        for m in range(row, row + max(found, 0)):
            ax, ay, bx, by = out.first[m, 0], out.first[m, 1], out.second[m, 0] - pose.x, out.second[m, 1] - pose.y
            nx, ny = out.normal[m, 0], out.normal[m, 1]
            out.first[m, 0], out.first[m, 1] = c * ax - s * ay, s * ax + c * ay
            out.second[m, 0], out.second[m, 1] = c * bx - s * by, s * bx + c * by
            out.normal[m, 0], out.normal[m, 1] = c * nx - s * ny, s * nx + c * ny
        row += max(found, 0)
    return row


@inline_kernel
def lowest_between(table: ShapeTable, shape: int, span: int, low: float, high: float, nx: float, ny: float) -> float:
    """Where, between ``low`` and ``high``, the slope of the height along (nx, ny) passes from negative to positive."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    u = 0.5 * (low + high)
    for _ in range(60):
        _, _, dx, dy, ex, ey = bend_at(table, shape, span, u, still)
        slope, bend = nx * dx + ny * dy, nx * ex + ny * ey
        if slope < 0.0:
            low = u
        else:
            high = u
        step = -slope / bend if bend > 0.0 else high - low
        if abs(step) < CONVERGED:
            return u + step
        u = u + step if low < u + step < high else 0.5 * (low + high)
    return u


@inline_kernel
def features_at_wall(
    table: ShapeTable,
    vertices: Vertices,
    shape: int,
    height: float,
    nx: float,
    ny: float,
    reach: float,
    out: FeatureRows,
    row: int,
) -> int:
    """Lowest places and vertices of a shape over the wall ``n . q = height``, in the shape's frame: their number, `FULL` or `TOO_DEEP`."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    n, size = 0, table.radius[shape]
    for k in range(table.first_piece[shape], table.first_piece[shape + 1]):
        circle = table.piece_circle
        if nx * circle[k, 0] + ny * circle[k, 1] - circle[k, 2] - height > reach or vertices.straight[k]:
            continue
        span, low, high = int(table.piece_span[k]), table.piece_range[k, 0], table.piece_range[k, 1]
        _, _, dx, dy = tangent_at(table, shape, span, low, still)
        slope = (nx * dx + ny * dy) / sqrt(dx * dx + dy * dy)
        for part in range(PARTS):
            begin = low + part * (high - low) / PARTS
            end = high if part == PARTS - 1 else low + (part + 1) * (high - low) / PARTS
            before = slope
            _, _, dx, dy = tangent_at(table, shape, span, end, still)
            slope = (nx * dx + ny * dy) / sqrt(dx * dx + dy * dy)
            if before > AT_END or slope < -AT_END or slope <= before:
                continue
            u = (
                begin
                if before >= 0.0
                else (end if slope <= 0.0 else lowest_between(table, shape, span, begin, end, nx, ny))
            )
            px, py, _, _ = tangent_at(table, shape, span, u, still)
            n = wall_feature(out, row, n, size, reach, px, py, height, nx, ny, span + u + 0.5)
            if n < 0:
                return n
    for m in range(vertices.first[shape], vertices.first[shape + 1]):
        px, py = vertices.point[m, 0], vertices.point[m, 1]
        n = wall_feature(out, row, n, size, reach, px, py, height, nx, ny, vertices.place[m])
        if n < 0:
            return n
    return n


@inline_kernel
def wall_feature(
    out: FeatureRows,
    row: int,
    n: int,
    size: float,
    reach: float,
    px: float,
    py: float,
    height: float,
    nx: float,
    ny: float,
    place: float,
) -> int:
    """`added` for the point (px, py) over a wall; `TOO_DEEP` beyond `DEEPEST`."""
    gap = nx * px + ny * py - height
    if gap <= -DEEPEST * size:
        return TOO_DEEP
    return added(out, row, n, size, reach, px, py, px - gap * nx, py - gap * ny, -nx, -ny, gap, place, 0.0)


@kernel
def features_with_walls(
    table: ShapeTable,
    vertices: Vertices,
    shape: IntArray,
    x: FloatArray,
    turn: FloatArray,
    pairs: IntArray,
    wall: FloatArray,
    reach: float,
    count: IntArray,
    out: FeatureRows,
) -> int:
    """Features of grains and walls with a gap below ``reach`` [m], one pair after the other in ``out``; their number.

    Parameters
    ----------
    table, vertices, shape, x, turn, reach, out
        As for `features_of_pairs`.
    pairs : ndarray of int64, shape (k, 2)
        Grain and body number n + w of a wall.
    wall : ndarray, shape (m, 11)
        Walls as `place_walls` fills them.
    count : ndarray of int64, shape (k,)
        Out: number of features of each pair, `FULL`, or `TOO_DEEP` where a lowest place is deeper than `DEEPEST`.
    """
    row = 0
    for k in range(pairs.shape[0]):
        i, w = pairs[k, 0], pairs[k, 1] - x.shape[0]
        nx, ny, c, s = wall[w, 2], wall[w, 3], turn[i, 0], turn[i, 1]
        height = nx * (wall[w, 0] - x[i, 0]) + ny * (wall[w, 1] - x[i, 1])
        mx, my = c * nx + s * ny, c * ny - s * nx
        found = features_at_wall(table, vertices, shape[i], height, mx, my, reach, out, row)
        count[k] = found
        for m in range(row, row + max(found, 0)):
            for rows in (out.first, out.second):
                px, py = rows[m, 0], rows[m, 1]
                rows[m, 0], rows[m, 1] = c * px - s * py, s * px + c * py
            out.normal[m, 0], out.normal[m, 1] = -nx, -ny
        row += max(found, 0)
    return row
