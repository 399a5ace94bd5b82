"""Kernels of the short way to the two intersections of strictly convex outlines that overlap little.

Where the tangents are parallel and opposite and the points lie on a common normal, each convex outline is on its own side of
its tangent. If these tangents leave a gap, the shapes are apart. If they overlap by d, all intersections lie in the strip of
width d between them, on one cap of either outline; when d is below the smallest radius of curvature, each cap is a graph
over the tangent, one concave, one convex, so that there are two intersections, one on either side. Where this does not apply,
the search among all pieces decides.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, extreme_guess, tangent_at, walked
from ninedisk.core.nurbs.roots_kernels import ROUNDING
from ninedisk.core.nurbs.state import FloatArray, Workspace

APART, LENS, UNSURE = 0, 1, 2


@inline_kernel
def normal_step(
    table: ShapeTable, a: int, i: int, u: float, b: int, j: int, v: float, pose: Pose
) -> tuple[float, float]:
    """Newton's step for points with a common normal: parallel tangents, and the points one above the other."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    x, y, dx, dy, hx, hy = bend_at(table, a, i, u, still)
    px, py, ex, ey, kx, ky = bend_at(table, b, j, v, pose)
    x, y = x - px, y - py
    f, g = dx * ey - dy * ex, x * dx + y * dy
    fu, fv = hx * ey - hy * ex, dx * ky - dy * kx
    gu, gv = dx * dx + dy * dy + x * hx + y * hy, -(ex * dx + ey * dy)
    det = fu * gv - fv * gu
    return -(f * gv - fv * g) / det, -(fu * g - f * gu) / det


@inline_kernel
def deepest(table: ShapeTable, a: int, b: int, pose: Pose) -> tuple[bool, int, float, int, float]:
    """Points with a common normal, by Newton from the directions of the line of centres; whether it converged."""
    n_a = table.first_span[a + 1] - table.first_span[a]
    n_b = table.first_span[b + 1] - table.first_span[b]
    i, u = extreme_guess(table, a, pose.x, pose.y)
    j, v = extreme_guess(table, b, -(pose.c * pose.x + pose.s * pose.y), pose.s * pose.x - pose.c * pose.y)
    for _ in range(12):
        du, dv = normal_step(table, a, i, u, b, j, v, pose)
        if not (abs(du) < 0.75 and abs(dv) < 0.75):
            return False, i, u, j, v
        i, u = walked(n_a, i, u + du)
        j, v = walked(n_b, j, v + dv)
        if abs(du) < 1e-5 and abs(dv) < 1e-5:
            return True, i, u, j, v
    return False, i, u, j, v


@inline_kernel
def crossing_near(
    table: ShapeTable, a: int, b: int, pose: Pose, i: int, u: float, j: int, v: float, row: FloatArray, k: int
) -> bool:
    """Newton for an intersection from a guess, written to row ``k`` of ``row``; whether it converged."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    n_a = table.first_span[a + 1] - table.first_span[a]
    n_b = table.first_span[b + 1] - table.first_span[b]
    i, u = walked(n_a, i, u)
    j, v = walked(n_b, j, v)
    for _ in range(12):
        x, y, dx, dy = tangent_at(table, a, i, u, still)
        px, py, ex, ey = tangent_at(table, b, j, v, pose)
        x, y = x - px, y - py
        det = dx * ey - dy * ex
        du = -(x * ey - y * ex) / det
        dv = (dx * y - dy * x) / det
        if not (abs(du) < 0.5 and abs(dv) < 0.5):
            return False
        i, u = walked(n_a, i, u + du)
        j, v = walked(n_b, j, v + dv)
        if abs(du) < 1e-8 and abs(dv) < 1e-8:
            row[k, 0], row[k, 1], row[k, 2], row[k, 3] = i, u, j, v
            row[k, 4] = 1.0 if det < 0.0 else -1.0
            return True
    return False


@inline_kernel
def convex_lens(table: ShapeTable, a: int, b: int, pose: Pose, work: Workspace) -> tuple[int, int, float, int, float]:
    """`APART`, `LENS` or `UNSURE`, and the deepest points; a lens' intersections, entering and leaving, are in ``work.root``."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    found, i, u, j, v = deepest(table, a, b, pose)
    if not found:
        return UNSURE, i, u, j, v
    x, y, dx, dy, hx, hy = bend_at(table, a, i, u, still)
    px, py, ex, ey, kx, ky = bend_at(table, b, j, v, pose)
    aa, bb = dx * dx + dy * dy, ex * ex + ey * ey
    speed_a, speed_b = sqrt(aa), sqrt(bb)
    depth = ((x - px) * dy - (y - py) * dx) / speed_a
    if dx * ex + dy * ey >= 0.0 or depth > min(table.smallest_radius[a], table.smallest_radius[b]):
        return UNSURE, i, u, j, v
    if depth <= ROUNDING * (table.radius[a] + table.radius[b]):
        return APART, i, u, j, v
    curvature = (dx * hy - dy * hx) / (aa * speed_a) + (ex * ky - ey * kx) / (bb * speed_b)
    half = sqrt(2.0 * depth / curvature)
    # Second order in the distance along the tangent: the speed changes with u.
    bent_a = -0.5 * (dx * hx + dy * hy) * half * half / (aa * aa)
    bent_b = -0.5 * (ex * kx + ey * ky) * half * half / (bb * bb)
    step_a, step_b = -half / speed_a, half / speed_b
    for k in range(2):
        if not crossing_near(table, a, b, pose, i, u + step_a + bent_a, j, v + step_b + bent_b, work.root, k):
            return UNSURE, i, u, j, v
        step_a, step_b = -step_a, -step_b
    kind = LENS if work.root[0, 4] > 0.0 > work.root[1, 4] else UNSURE
    return kind, i, u, j, v
