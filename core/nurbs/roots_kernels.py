"""Kernels that find all intersections of two outlines: bounding volumes, subdivision, then Newton; a short way for convex ones.

On a box, a range of ``u`` on either curve, each curve is its tangent at the middle and a remainder of length
``bend (range)^2 / 8`` at most. If the tangents cannot meet within the remainders, the box holds no intersection; if the remainders are
so small beside the angle of the tangents that Newton's map contracts, it holds one at most, and Newton finds it or runs out
of the box; otherwise the longer range is halved. Curves that touch are halved down to `TOUCHING` of their size.

Strictly convex outlines that overlap little have two intersections, which need no search. Where the tangents are parallel and opposite
and the points lie on a common normal, each outline is on its own side of its tangent. If these tangents leave a gap, the shapes are apart.
If they overlap by d, all intersections lie in the strip of width d between them, on one cap of either outline; when d is below the
smallest radius of curvature, each cap is a graph over the tangent, one concave, one convex, so that there are two intersections, one on
either side. Where this does not apply, the search among all pieces decides.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, extreme_guess, tangent_at, walked
from ninedisk.core.nurbs.state import MOST_ROOTS, PARALLEL, STACK, UNDECIDED, Workspace

TOUCHING = 5e-10
"""Length of a box, over the smaller shape's radius R, below which the curves are taken to touch without crossing. An overlap of
1e-12 R from outside has a chord of 1e-6 R and boxes of 1e-7 R; one curve touching another from inside, of a curvature that differs by a
hundredth, has boxes of 1e-9 R."""

CONTRACTION = 0.25
"""Change of Newton's matrix over a box, relative to itself, up to which Newton is trusted."""

MOST_BOXES = 100_000
"""Boxes after which the boundaries are taken to coincide."""

ROUNDING = 2e-15
"""Rounding of a point's coordinates, over the size of both shapes."""

COINCIDE = 1000.0
"""Roundings by which straight lines must draw apart along their length for their intersection to be known, to a tenth of the length."""

SHIFT = 4000.0
"""Roundings by which a shape is shifted off another body with which it shares a line; more than `COINCIDE` at 0.3 rad to the line."""


APART, LENS, UNSURE = 0, 1, 2
"""What `convex_lens` finds: no contact, one with two intersections, or nothing that could be decided."""


@inline_kernel
def nearby(table: ShapeTable, a: int, b: int, pose: Pose, work: Workspace) -> tuple[int, int]:
    """Pieces of either shape that reach the other's bounding circle; fills ``near_a``, ``near_b``, ``centre``."""
    n_a, n_b = 0, 0
    for k in range(table.first_piece[a], table.first_piece[a + 1]):
        x, y = table.piece_circle[k, 0] - pose.x, table.piece_circle[k, 1] - pose.y
        reach = table.piece_circle[k, 2] + table.radius[b]
        if x * x + y * y <= reach * reach:
            work.near_a[n_a] = k
            n_a += 1
    if n_a == 0:
        return 0, 0
    for k in range(table.first_piece[b], table.first_piece[b + 1]):
        px, py = table.piece_circle[k, 0], table.piece_circle[k, 1]
        x, y = pose.c * px - pose.s * py + pose.x, pose.s * px + pose.c * py + pose.y
        reach = table.piece_circle[k, 2] + table.radius[a]
        if x * x + y * y <= reach * reach:
            work.near_b[n_b] = k
            work.centre[n_b, 0], work.centre[n_b, 1] = x, y
            n_b += 1
    return n_a, n_b


@inline_kernel
def solve_box(
    table: ShapeTable,
    a: int,
    i: int,
    u: float,
    b: int,
    j: int,
    v: float,
    pose: Pose,
    half_u: float,
    half_v: float,
    slack_u: float,
    slack_v: float,
) -> tuple[bool, float, float, float]:
    """Newton from the middle (u, v) of a box: whether it converged near the box, the intersection, and its direction.

    ``slack`` is what rounding makes of the places, and a part of the box: neither steps nor edges are judged by less.
    """
    still = Pose(1.0, 0.0, 0.0, 0.0)
    u0, v0, settled = u, v, False
    for _ in range(20):
        x, y, dx, dy = tangent_at(table, a, i, u, still)
        px, py, ex, ey = tangent_at(table, b, j, v, pose)
        x, y = x - px, y - py
        det = dx * ey - dy * ex
        du = -(x * ey - y * ex) / det
        dv = (dx * y - dy * x) / det
        u, v = u + du, v + dv
        if not (abs(u - u0) <= 2.0 * half_u + slack_u and abs(v - v0) <= 2.0 * half_v + slack_v):
            return False, u, v, 0.0
        # One more step once within rounding, for the residual to be what rounding leaves and no multiple of it.
        last, settled = settled, abs(du) <= 1e-2 * slack_u and abs(dv) <= 1e-2 * slack_v
        if last and settled:
            inside = abs(u - u0) <= half_u + slack_u and abs(v - v0) <= half_v + slack_v
            return inside, u, v, 1.0 if det < 0.0 else -1.0
    return False, u, v, 0.0


@inline_kernel
def is_known(root: FloatArray, first: int, n: int, u: float, crossing: float, margin: float) -> bool:
    """Whether an intersection is among ``first .. n-1`` of the same two pieces: where boxes are smaller than rounding makes the
    place, many find the same one."""
    for k in range(first, n):  # noqa: SIM110 - a generator expression would need memory
        if root[k, 4] == crossing and abs(root[k, 1] - u) <= margin:
            return True
    return False


@inline_kernel
def piece_crossings(
    table: ShapeTable, a: int, ka: int, b: int, kb: int, pose: Pose, work: Workspace, n: int, boxes: int
) -> tuple[int, int]:
    """Append the intersections of two pieces to ``work.root``; the new numbers of intersections and of boxes."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    i, j = table.piece_span[ka], table.piece_span[kb]
    bend_a, bend_b = table.piece_bend[ka], table.piece_bend[kb]
    noise = ROUNDING * (table.radius[a] + table.radius[b])
    smallest = TOUCHING * min(table.radius[a], table.radius[b])
    box = work.box
    box[0, 0], box[0, 1] = table.piece_range[ka, 0], table.piece_range[ka, 1]
    box[0, 2], box[0, 3] = table.piece_range[kb, 0], table.piece_range[kb, 1]
    waiting, before = 1, n
    while waiting > 0:
        waiting -= 1
        boxes += 1
        low_u, high_u, low_v, high_v = box[waiting, 0], box[waiting, 1], box[waiting, 2], box[waiting, 3]
        u, v, half_u, half_v = (
            0.5 * (low_u + high_u),
            0.5 * (low_v + high_v),
            0.5 * (high_u - low_u),
            0.5 * (high_v - low_v),
        )
        x, y, dx, dy = tangent_at(table, a, i, u, still)
        px, py, ex, ey = tangent_at(table, b, j, v, pose)
        x, y = x - px, y - py
        rest = 0.5 * (bend_a * half_u * half_u + bend_b * half_v * half_v)
        margin = rest + noise
        det = dx * ey - dy * ex
        speed_a, speed_b = sqrt(dx * dx + dy * dy), sqrt(ex * ex + ey * ey)
        if abs(dx * y - dy * x) > abs(det) * half_v + speed_a * margin:
            continue
        if abs(ex * y - ey * x) > abs(det) * half_u + speed_b * margin:
            continue
        if abs(dx * x + dy * y) > speed_a * (speed_a * half_u + margin) + abs(dx * ex + dy * ey) * half_v:
            continue
        long_a, long_b = 2.0 * speed_a * half_u, 2.0 * speed_b * half_v
        if rest == 0.0 and abs(det) * min(speed_a * half_u, speed_b * half_v) <= COINCIDE * noise * speed_a * speed_b:
            return PARALLEL, boxes
        if 4.0 * rest * max(long_a, long_b) <= CONTRACTION * abs(det) * 4.0 * half_u * half_v and det != 0.0:
            # An intersection on the edge of two boxes may be found in both, for none to be lost to rounding.
            slack_u = 1e-6 * half_u + 100.0 * noise * speed_b / abs(det)
            slack_v = 1e-6 * half_v + 100.0 * noise * speed_a / abs(det)
            found, u, v, crossing = solve_box(table, a, i, u, b, j, v, pose, half_u, half_v, slack_u, slack_v)
            if found and not is_known(work.root, before, n, u, crossing, 3.0 * slack_u):
                if n >= MOST_ROOTS:
                    return UNDECIDED, boxes
                root = work.root
                root[n, 0], root[n, 1], root[n, 2], root[n, 3], root[n, 4] = i, u, j, v, crossing
                n += 1
            continue
        if max(long_a, long_b) < smallest:
            continue
        if waiting + 2 > STACK or boxes > MOST_BOXES:
            return UNDECIDED, boxes
        for part in range(2):
            new = waiting + part
            box[new, 0], box[new, 1], box[new, 2], box[new, 3] = low_u, high_u, low_v, high_v
            if long_a >= long_b:
                box[new, part] = u
            else:
                box[new, 2 + part] = v
        waiting += 2
    return n, boxes


@inline_kernel
def sort_crossings(n: int, ring: int, root: FloatArray) -> int:
    """Sort ``n`` intersections along the first outline, of ``ring`` spans, and drop those found twice; their number.

    Along a closed curve entering and leaving alternate: neighbours of the same kind and at the same place are one.
    """
    for k in range(1, n):  # insertion sort: the list is short
        i, u, j, v, crossing = root[k, 0], root[k, 1], root[k, 2], root[k, 3], root[k, 4]
        m = k - 1
        while m >= 0 and root[m, 0] + root[m, 1] > i + u:
            for column in range(5):
                root[m + 1, column] = root[m, column]
            m -= 1
        root[m + 1, 0], root[m + 1, 1], root[m + 1, 2], root[m + 1, 3], root[m + 1, 4] = i, u, j, v, crossing
    kept = 0
    for k in range(n):
        if kept > 0 and root[kept - 1, 4] == root[k, 4]:
            if (root[k, 0] + root[k, 1]) - (root[kept - 1, 0] + root[kept - 1, 1]) > 1e-4:
                return UNDECIDED
            continue
        for column in range(5):
            root[kept, column] = root[k, column]
        kept += 1
    if kept > 1 and root[0, 4] == root[kept - 1, 4]:
        if (root[0, 0] + root[0, 1] + ring) - (root[kept - 1, 0] + root[kept - 1, 1]) > 1e-4:
            return UNDECIDED
        kept -= 1
    # A single crossing is one of a pair that rounding cannot distinguish: the curves touch.
    return 0 if kept == 1 else kept


@inline_kernel
def crossings(table: ShapeTable, a: int, b: int, pose: Pose, work: Workspace) -> int:
    """All intersections of the outlines of ``a`` (in its own frame) and ``b`` (placed by ``pose``), sorted along ``a``.

    Returns
    -------
    int
        Their number, an even one, or `UNDECIDED` or `PARALLEL`.
    """
    n_a, n_b = nearby(table, a, b, pose, work)
    n, boxes = 0, 0
    for k in range(n_a):
        ka = work.near_a[k]
        for m in range(n_b):
            kb = work.near_b[m]
            x, y = table.piece_circle[ka, 0] - work.centre[m, 0], table.piece_circle[ka, 1] - work.centre[m, 1]
            reach = table.piece_circle[ka, 2] + table.piece_circle[kb, 2]
            if x * x + y * y <= reach * reach:
                n, boxes = piece_crossings(table, a, ka, b, kb, pose, work, n, boxes)
                if n < 0:
                    return n
    n = sort_crossings(n, table.first_span[a + 1] - table.first_span[a], work.root)
    return PARALLEL if n == UNDECIDED else n


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
