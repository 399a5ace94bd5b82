"""Kernels that find where two outlines are nearest to each other, whether they are apart, touch or overlap by little.

The intersection-based contact of `nurbs_kernels` needs an intersection. What a step has to keep from overlapping is known before: the
common normals of both outlines at which their distance is smallest among all places nearby, and each vertex (a corner, or an end of a
straight part) with its foot on the other outline. The gap along the normal passes through 0 smoothly, so that a contact
that just touches, opens or closes is found in the same way. Two straight parts have no single common normal; their vertices do.
"""

from __future__ import annotations

from math import asin, atan2, pi, sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, tangent_at, walked
from ninedisk.core.nurbs.nurbs_convex_kernels import deepest, normal_step
from ninedisk.core.nurbs.nurbs_feature_row_kernels import AT_END, CONVERGED, added
from ninedisk.core.nurbs.nurbs_vertex_kernels import vertices_on_pieces, vertices_on_vertices
from ninedisk.core.nurbs.nurbs_vertices import Vertices
from ninedisk.core.nurbs.state import FeatureRows


@inline_kernel
def normal_found(
    table: ShapeTable, a: int, i: int, u: float, b: int, j: int, v: float, pose: Pose, ring: bool
) -> tuple[bool, int, float, int, float]:
    """Newton for a common normal from (i, u) and (j, v).

    With ``ring`` it passes from span to span, otherwise it stays on the polynomials of the two given ones.
    """
    n_a = table.first_span[a + 1] - table.first_span[a]
    n_b = table.first_span[b + 1] - table.first_span[b]
    for _ in range(25):
        du, dv = normal_step(table, a, i, u, b, j, v, pose)
        if not (abs(du) < 1.0 and abs(dv) < 1.0):
            return False, i, u, j, v
        u, v = u + du, v + dv
        if ring:
            i, u = walked(n_a, i, u)
            j, v = walked(n_b, j, v)
        elif not (abs(u) < 1.0 and abs(v) < 1.0):
            return False, i, u, j, v
        if abs(du) < CONVERGED and abs(dv) < CONVERGED:
            return True, i, u, j, v
    return False, i, u, j, v


@inline_kernel
def normal_added(
    table: ShapeTable,
    a: int,
    i: int,
    u: float,
    b: int,
    j: int,
    v: float,
    pose: Pose,
    reach: float,
    out: FeatureRows,
    row: int,
    n: int,
) -> int:
    """Add the common normal at (i, u) and (j, v) if the distance is smallest there.

    Over tangential displacements s and t of the points, ``(gap + (ka s^2 + kb t^2)/2)^2 + (s - t)^2`` with the curvatures ka and kb is
    smallest at 0 if ``1 + gap ka``, ``1 + gap kb`` and ``ka + kb + gap ka kb`` are positive; the signed gap is where it is negative.
    """
    still = Pose(1.0, 0.0, 0.0, 0.0)
    x, y, dx, dy, hx, hy = bend_at(table, a, i, u, still)
    px, py, ex, ey, kx, ky = bend_at(table, b, j, v, pose)
    if dx * ex + dy * ey >= 0.0:
        return n
    speed_a, speed_b = sqrt(dx * dx + dy * dy), sqrt(ex * ex + ey * ey)
    nx, ny = dy / speed_a, -dx / speed_a
    gap = (px - x) * nx + (py - y) * ny
    ka = (dx * hy - dy * hx) / (speed_a * speed_a * speed_a)
    kb = (ex * ky - ey * kx) / (speed_b * speed_b * speed_b)
    if 1.0 + gap * ka <= 0.0 or 1.0 + gap * kb <= 0.0 or ka + kb + gap * ka * kb <= 0.0:
        return n
    size = min(table.radius[a], table.radius[b])
    return added(out, row, n, size, reach, x, y, px, py, nx, ny, gap, i + u + 0.5, j + v + 0.5)


@inline_kernel
def turn_bound(table: ShapeTable, k: int, speed: float) -> float:
    """Bound of the angle [rad] between the tangents of a piece and that in its middle, where the speed is ``speed`` [m]."""
    change = 0.5 * table.piece_bend[k] * (table.piece_range[k, 1] - table.piece_range[k, 0])
    return asin(change / speed) if change < speed else pi


@inline_kernel
def normals_of_pieces(
    table: ShapeTable, a: int, ka: int, b: int, kb: int, pose: Pose, reach: float, out: FeatureRows, row: int, n: int
) -> int:
    """Add the common normal of two pieces, of which one at least is curved, if they have one."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    i, low_a, high_a = int(table.piece_span[ka]), table.piece_range[ka, 0], table.piece_range[ka, 1]
    j, low_b, high_b = int(table.piece_span[kb]), table.piece_range[kb, 0], table.piece_range[kb, 1]
    mid_a, mid_b = 0.5 * (low_a + high_a), 0.5 * (low_b + high_b)
    _, _, dx, dy = tangent_at(table, a, i, mid_a, still)
    _, _, ex, ey = tangent_at(table, b, j, mid_b, pose)
    room = turn_bound(table, ka, sqrt(dx * dx + dy * dy)) + turn_bound(table, kb, sqrt(ex * ex + ey * ey)) + 1e-6
    if abs(atan2(dy * ex - dx * ey, -(dx * ex + dy * ey))) > room:
        return n
    quarter_a, quarter_b = 0.3 * (high_a - low_a), 0.3 * (high_b - low_b)
    for start in range(5):
        u = mid_a if start == 0 else (mid_a - quarter_a if start < 3 else mid_a + quarter_a)
        v = mid_b if start == 0 else (mid_b - quarter_b if start % 2 == 1 else mid_b + quarter_b)
        found, _, u, _, v = normal_found(table, a, i, u, b, j, v, pose, False)
        if found and low_a - AT_END <= u <= high_a + AT_END and low_b - AT_END <= v <= high_b + AT_END:
            return normal_added(table, a, i, u, b, j, v, pose, reach, out, row, n)
    return n


@inline_kernel
def features_in_frame(
    table: ShapeTable, vertices: Vertices, a: int, b: int, pose: Pose, reach: float, out: FeatureRows, row: int
) -> int:
    """Features of two shapes in the frame of the first, the second one placed by ``pose``: their number, or `FULL`."""
    n = 0
    if table.smallest_radius[a] > 0.0 and table.smallest_radius[b] > 0.0:
        found, i, u, j, v = deepest(table, a, b, pose)
        if found:
            found, i, u, j, v = normal_found(table, a, i, u, b, j, v, pose, True)
        if found:
            # Strictly convex shapes have one common normal with facing sides; where the shapes are deep in each other it may be another.
            n = normal_added(table, a, i, u, b, j, v, pose, 1e300, out, row, 0)
            if n != 0:
                return n if n < 0 or out.gap[row] < reach else 0
    for ka in range(table.first_piece[a], table.first_piece[a + 1]):
        for kb in range(table.first_piece[b], table.first_piece[b + 1]):
            px, py = table.piece_circle[kb, 0], table.piece_circle[kb, 1]
            x = pose.c * px - pose.s * py + pose.x - table.piece_circle[ka, 0]
            y = pose.s * px + pose.c * py + pose.y - table.piece_circle[ka, 1]
            far = table.piece_circle[ka, 2] + table.piece_circle[kb, 2] + reach
            if x * x + y * y > far * far or (vertices.straight[ka] and vertices.straight[kb]):
                continue
            n = normals_of_pieces(table, a, ka, b, kb, pose, reach, out, row, n)
            if n < 0:
                return n
    for turn in range(2):
        n = vertices_on_pieces(table, vertices, a, b, pose, turn == 1, reach, out, row, n)
        if n < 0:
            return n
    return vertices_on_vertices(table, vertices, a, b, pose, reach, out, row, n)
