"""Kernels of the vertices of outlines: their feet on the other outline, and pairs of corners that face each other."""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, tangent_at
from ninedisk.core.nurbs.nurbs_feature_row_kernels import AT_END, CONVERGED, SAME, added
from ninedisk.core.nurbs.nurbs_vertices import Vertices
from ninedisk.core.nurbs.state import FeatureRows


@inline_kernel
def foot_on(table: ShapeTable, shape: int, k: int, pose: Pose, x: float, y: float) -> tuple[bool, float]:
    """Where a piece is nearest to (x, y) [m], and whether that is inside the piece or, but for rounding, at its end."""
    span, low, high = table.piece_span[k], table.piece_range[k, 0], table.piece_range[k, 1]
    qx, qy, dx, dy = tangent_at(table, shape, span, low, pose)
    at_low = ((qx - x) * dx + (qy - y) * dy) / (dx * dx + dy * dy)
    qx, qy, dx, dy = tangent_at(table, shape, span, high, pose)
    at_high = ((qx - x) * dx + (qy - y) * dy) / (dx * dx + dy * dy)
    if at_low > AT_END or at_high < -AT_END:
        return False, low
    if at_low >= 0.0 or at_high <= 0.0:
        return True, low if at_low >= 0.0 else high
    u = 0.5 * (low + high)
    for _ in range(60):
        qx, qy, dx, dy, ex, ey = bend_at(table, shape, span, u, pose)
        slope = (qx - x) * dx + (qy - y) * dy
        if slope < 0.0:
            low = u
        else:
            high = u
        step = -slope / (dx * dx + dy * dy + (qx - x) * ex + (qy - y) * ey)
        if abs(step) < CONVERGED:
            return True, u + step
        u = u + step if low < u + step < high else 0.5 * (low + high)
    return True, u


@inline_kernel
def vertices_on_pieces(
    table: ShapeTable,
    vertices: Vertices,
    a: int,
    b: int,
    pose: Pose,
    swapped: bool,
    reach: float,
    out: FeatureRows,
    row: int,
    n: int,
) -> int:
    """Add the vertices of one outline with their feet on the other: of the first one's, or of the second one's if ``swapped``.

    A vertex is inside the other body if the nearest of its feet says so, and leaves through that one: close to a corner it has a foot on
    either face, and may be beyond the one face's line without being inside.
    """
    still = Pose(1.0, 0.0, 0.0, 0.0)
    owner, other, at, of = (b, a, pose, still) if swapped else (a, b, still, pose)
    for m in range(vertices.first[owner], vertices.first[owner + 1]):
        x = at.c * vertices.point[m, 0] - at.s * vertices.point[m, 1] + at.x
        y = at.s * vertices.point[m, 0] + at.c * vertices.point[m, 1] + at.y
        least, inner_k, inner_u = 1e300, -1, 0.0
        for k in range(table.first_piece[other], table.first_piece[other + 1]):
            px, py = table.piece_circle[k, 0], table.piece_circle[k, 1]
            dx, dy = of.c * px - of.s * py + of.x - x, of.s * px + of.c * py + of.y - y
            far = table.piece_circle[k, 2] + reach
            if dx * dx + dy * dy > far * far:
                continue
            found, u = foot_on(table, other, k, of, x, y)
            if not found:
                continue
            qx, qy, dx, dy = tangent_at(table, other, int(table.piece_span[k]), u, of)
            gap = ((x - qx) * dy - (y - qy) * dx) / sqrt(dx * dx + dy * dy)
            if abs(gap) < least:
                least, inner_k, inner_u = abs(gap), k if gap < 0.0 else -1, u
            if gap < 0.0:
                continue
            n = foot_added(table, vertices, a, b, m, other, k, u, of, x, y, swapped, reach, out, row, n)
            if n < 0:
                return n
        if inner_k >= 0:
            n = foot_added(table, vertices, a, b, m, other, inner_k, inner_u, of, x, y, swapped, reach, out, row, n)
            if n < 0:
                return n
    return n


@inline_kernel
def foot_added(
    table: ShapeTable,
    vertices: Vertices,
    a: int,
    b: int,
    m: int,
    other: int,
    k: int,
    u: float,
    of: Pose,
    x: float,
    y: float,
    swapped: bool,
    reach: float,
    out: FeatureRows,
    row: int,
    n: int,
) -> int:
    """Add vertex ``m``, at (x, y), with its foot at ``u`` of piece ``k``."""
    size = min(table.radius[a], table.radius[b])
    span = int(table.piece_span[k])
    qx, qy, dx, dy = tangent_at(table, other, span, u, of)
    speed = sqrt(dx * dx + dy * dy)
    nx, ny = dy / speed, -dx / speed
    gap = (x - qx) * nx + (y - qy) * ny
    place = span + u + 0.5
    if swapped:
        return added(out, row, n, size, reach, qx, qy, x, y, nx, ny, gap, place, vertices.place[m])
    return added(out, row, n, size, reach, x, y, qx, qy, -nx, -ny, gap, vertices.place[m], place)


@inline_kernel
def in_cone(vertices: Vertices, m: int, dx: float, dy: float) -> bool:
    """Whether a direction, in the frame of the shape, lies between the normals of a vertex."""
    cone = vertices.cone
    return bool(cone[m, 0] * dy - cone[m, 1] * dx >= 0.0 and dx * cone[m, 3] - dy * cone[m, 2] >= 0.0)


@inline_kernel
def vertices_on_vertices(
    table: ShapeTable,
    vertices: Vertices,
    a: int,
    b: int,
    pose: Pose,
    reach: float,
    out: FeatureRows,
    row: int,
    n: int,
) -> int:
    """Add pairs of corners that are apart and face each other."""
    size = min(table.radius[a], table.radius[b])
    for m in range(vertices.first[a], vertices.first[a + 1]):
        x, y = vertices.point[m, 0], vertices.point[m, 1]
        for k in range(vertices.first[b], vertices.first[b + 1]):
            px = pose.c * vertices.point[k, 0] - pose.s * vertices.point[k, 1] + pose.x
            py = pose.s * vertices.point[k, 0] + pose.c * vertices.point[k, 1] + pose.y
            dx, dy = px - x, py - y
            gap = sqrt(dx * dx + dy * dy)
            if gap >= reach or gap <= SAME * size or not in_cone(vertices, m, dx, dy):
                continue
            if in_cone(vertices, k, -(pose.c * dx + pose.s * dy), pose.s * dx - pose.c * dy):
                nx, ny = dx / gap, dy / gap
                n = added(out, row, n, size, reach, x, y, px, py, nx, ny, gap, vertices.place[m], vertices.place[k])
                if n < 0:
                    return n
    return n
