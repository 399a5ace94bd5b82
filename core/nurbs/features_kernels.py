"""Kernels that find where two outlines, or an outline and a wall, are nearest: features within reach, and gaps of what is apart.

The intersection-based contact of `intersect_kernels` needs an intersection. What a step has to keep from overlapping is known before: the
common normals of both outlines at which their distance is smallest among all places nearby, and each vertex (a corner, or an end of a
straight part) with its foot on the other outline, and corners that face each other. The gap along the normal passes through 0 smoothly, so
that a contact that just touches, opens or closes is found in the same way. Two straight parts have no single common normal; their vertices
do.

The gap of outlines that do not touch is their smallest distance. Strictly convex ones have one common normal between them, which Newton's
method finds. Otherwise all pairs of pieces that their bounding circles do not exclude are searched: along a piece of the one outline the
distance to the nearest point of a piece of the other has the slope ``(p - q).C'/|p - q|``, whose zero is bisected. A piece turns by 0.6 rad
at most, so that this has one valley; corners are ends of pieces.
"""

from __future__ import annotations

from math import asin, atan2, pi, sqrt
from typing import NamedTuple

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, tangent_at, walked
from ninedisk.core.nurbs.lens_kernels import extent_on
from ninedisk.core.nurbs.roots_kernels import deepest, normal_step
from ninedisk.core.nurbs.state import FULL, TOO_DEEP, FeatureRows, Vertices
from ninedisk.core.pose import NORMAL_X, NORMAL_Y, POINT_X, POINT_Y

DEEPEST = 0.05
"""Overlap over the smaller radius up to which a contact is followed; it leaves the far sides of both bodies alone."""

SAME = 1e-6
"""Distance over the smaller radius up to which two features are one; the gaps of such neighbours differ by the square of it."""

CONVERGED = 1e-9
"""Step of Newton's method in ``u`` after which the next one is below rounding."""

AT_END = 1e-9
"""Range of ``u`` beyond a piece that still counts as the piece: rounding must not lose what lies on the border of two."""

BISECTIONS = 40
"""Halvings of a piece: its 1e-12th part, in whose square the distance errs."""

TOUCHING = 1e-14
"""Of the coordinates of two points that touch: rounding of their difference, some operations each."""

PARTS = 4
"""Parts of a piece between whose ends its height over a wall can have a valley: more than the inflections of a piece."""


class Pair(NamedTuple):
    """Two shapes of a table whose features are sought, in the frame of the first, and where these go.

    Attributes
    ----------
    table : ShapeTable
    vertices : Vertices
        Of the same shapes.
    a, b : int
        The two shapes.
    pose : Pose
        Places the second one.
    out : FeatureRows
        Out, the pair's features from ``row`` on.
    row : int
    """

    table: ShapeTable
    vertices: Vertices
    a: int
    b: int
    pose: Pose
    out: FeatureRows
    row: int


class Line(NamedTuple):
    """A wall in the frame of a shape: the points q with ``n . q = height`` [m], n into the free side."""

    nx: float
    ny: float
    height: float


class Feature(NamedTuple):
    """A row of `FeatureRows`: points of the first and the second body, normal, gap [m], places on both outlines."""

    ax: float
    ay: float
    bx: float
    by: float
    nx: float
    ny: float
    gap: float
    place_a: float
    place_b: float


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
def normal_added(pair: Pair, reach: float, n: int, i: int, u: float, j: int, v: float) -> int:
    """Add the common normal at (i, u) and (j, v) if the distance is smallest there; the number of features then.

    Over tangential displacements s and t of the points, ``(gap + (ka s^2 + kb t^2)/2)^2 + (s - t)^2`` with the curvatures ka and kb is
    smallest at 0 if ``1 + gap ka``, ``1 + gap kb`` and ``ka + kb + gap ka kb`` are positive; the signed gap is where it is negative.
    """
    table, a, b = pair.table, pair.a, pair.b
    still = Pose(1.0, 0.0, 0.0, 0.0)
    x, y, dx, dy, hx, hy = bend_at(table, a, i, u, still)
    px, py, ex, ey, kx, ky = bend_at(table, b, j, v, pair.pose)
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
    return added(pair.out, pair.row, n, size, reach, Feature(x, y, px, py, nx, ny, gap, i + u + 0.5, j + v + 0.5))


@inline_kernel
def turn_bound(table: ShapeTable, k: int, speed: float) -> float:
    """Bound of the angle [rad] between the tangents of a piece and that in its middle, where the speed is ``speed`` [m]."""
    change = 0.5 * table.piece_bend[k] * (table.piece_range[k, 1] - table.piece_range[k, 0])
    return asin(change / speed) if change < speed else pi


@inline_kernel
def normals_of_pieces(pair: Pair, reach: float, n: int, ka: int, kb: int) -> int:
    """Add the common normal of two pieces, of which one at least is curved, if they have one."""
    table, a, b, pose = pair.table, pair.a, pair.b, pair.pose
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
            return normal_added(pair, reach, n, i, u, j, v)
    return n


@inline_kernel
def features_in_frame(pair: Pair, reach: float) -> int:
    """Features of two shapes: their number, or `FULL`."""
    table, vertices, a, b, pose = pair.table, pair.vertices, pair.a, pair.b, pair.pose
    n = 0
    if table.smallest_radius[a] > 0.0 and table.smallest_radius[b] > 0.0:
        found, i, u, j, v = deepest(table, a, b, pose)
        if found:
            found, i, u, j, v = normal_found(table, a, i, u, b, j, v, pose, True)
        if found:
            # Strictly convex shapes have one common normal with facing sides; where the shapes are deep in each other it may be another.
            n = normal_added(pair, 1e300, 0, i, u, j, v)
            if n != 0:
                return n if n < 0 or pair.out.gap[pair.row] < reach else 0
    for ka in range(table.first_piece[a], table.first_piece[a + 1]):
        for kb in range(table.first_piece[b], table.first_piece[b + 1]):
            px, py = table.piece_circle[kb, 0], table.piece_circle[kb, 1]
            x = pose.c * px - pose.s * py + pose.x - table.piece_circle[ka, 0]
            y = pose.s * px + pose.c * py + pose.y - table.piece_circle[ka, 1]
            far = table.piece_circle[ka, 2] + table.piece_circle[kb, 2] + reach
            if x * x + y * y > far * far or (vertices.straight[ka] and vertices.straight[kb]):
                continue
            n = normals_of_pieces(pair, reach, n, ka, kb)
            if n < 0:
                return n
    for turn in range(2):
        n = vertices_on_pieces(pair, reach, n, turn == 1)
        if n < 0:
            return n
    return vertices_on_vertices(pair, reach, n)


@inline_kernel
def added(out: FeatureRows, row: int, n: int, size: float, reach: float, new: Feature) -> int:
    """Number of features of a pair after one more, unless it is out of range or known; those of the pair begin at ``row``.

    Points are in the frame in which the pair is computed. `FULL` where there is no room.
    """
    if not -DEEPEST * size < new.gap < reach:
        return n
    same = SAME * size
    k = row + n
    for other in range(row, row + n):
        if (
            abs(out.first[other, 0] - new.ax) + abs(out.first[other, 1] - new.ay) <= same
            and abs(out.second[other, 0] - new.bx) + abs(out.second[other, 1] - new.by) <= same
        ):
            if new.gap >= out.gap[other]:
                return n
            k, n = other, n - 1
            break
    if k >= out.gap.shape[0]:
        return FULL
    out.first[k, 0], out.first[k, 1], out.second[k, 0], out.second[k, 1] = new.ax, new.ay, new.bx, new.by
    out.normal[k, 0], out.normal[k, 1], out.gap[k] = new.nx, new.ny, new.gap
    out.place[k, 0], out.place[k, 1] = new.place_a, new.place_b
    return n + 1


@inline_kernel
def foot_on(table: ShapeTable, shape: int, k: int, pose: Pose, x: float, y: float) -> tuple[bool, float, float, float]:
    """Where a piece is nearest to (x, y) [m], by Newton's method kept inside by bisection.

    Returns
    -------
    tuple
        Whether that is inside the piece or, but for rounding, at its end; ``u``; the point [m].
    """
    span, low, high = table.piece_span[k], table.piece_range[k, 0], table.piece_range[k, 1]
    lx, ly, dx, dy = tangent_at(table, shape, span, low, pose)
    at_low = ((lx - x) * dx + (ly - y) * dy) / (dx * dx + dy * dy)
    qx, qy, dx, dy = tangent_at(table, shape, span, high, pose)
    at_high = ((qx - x) * dx + (qy - y) * dy) / (dx * dx + dy * dy)
    near = at_low <= AT_END and at_high >= -AT_END
    if at_low >= 0.0:
        return near, low, lx, ly
    if at_high <= 0.0:
        return near, high, qx, qy
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
            return True, u + step, qx + step * dx, qy + step * dy
        u = u + step if low < u + step < high else 0.5 * (low + high)
    return True, u, qx, qy


@inline_kernel
def vertices_on_pieces(pair: Pair, reach: float, n: int, swapped: bool) -> int:
    """Add the vertices of one outline with their feet on the other: of the first one's, or of the second one's if ``swapped``.

    A vertex is inside the other body if the nearest of its feet says so, and leaves through that one: close to a corner it has a foot on
    either face, and may be beyond the one face's line without being inside.
    """
    table, vertices, still = pair.table, pair.vertices, Pose(1.0, 0.0, 0.0, 0.0)
    owner, other, at, of = (pair.b, pair.a, pair.pose, still) if swapped else (pair.a, pair.b, still, pair.pose)
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
            found, u, _, _ = foot_on(table, other, k, of, x, y)
            if not found:
                continue
            qx, qy, dx, dy = tangent_at(table, other, int(table.piece_span[k]), u, of)
            gap = ((x - qx) * dy - (y - qy) * dx) / sqrt(dx * dx + dy * dy)
            if abs(gap) < least:
                least, inner_k, inner_u = abs(gap), k if gap < 0.0 else -1, u
            if gap < 0.0:
                continue
            n = foot_added(pair, reach, n, swapped, m, x, y, k, u)
            if n < 0:
                return n
        if inner_k >= 0:
            n = foot_added(pair, reach, n, swapped, m, x, y, inner_k, inner_u)
            if n < 0:
                return n
    return n


@inline_kernel
def foot_added(pair: Pair, reach: float, n: int, swapped: bool, m: int, x: float, y: float, k: int, u: float) -> int:
    """Add vertex ``m``, at (x, y), of the first outline, or of the second if ``swapped``, with its foot at ``u`` of piece ``k``."""
    table, still = pair.table, Pose(1.0, 0.0, 0.0, 0.0)
    other, of = (pair.a, still) if swapped else (pair.b, pair.pose)
    size = min(table.radius[pair.a], table.radius[pair.b])
    span = int(table.piece_span[k])
    qx, qy, dx, dy = tangent_at(table, other, span, u, of)
    speed = sqrt(dx * dx + dy * dy)
    nx, ny = dy / speed, -dx / speed
    gap = (x - qx) * nx + (y - qy) * ny
    foot, corner = span + u + 0.5, pair.vertices.place[m]
    if swapped:
        return added(pair.out, pair.row, n, size, reach, Feature(qx, qy, x, y, nx, ny, gap, foot, corner))
    return added(pair.out, pair.row, n, size, reach, Feature(x, y, qx, qy, -nx, -ny, gap, corner, foot))


@inline_kernel
def in_cone(vertices: Vertices, m: int, dx: float, dy: float) -> bool:
    """Whether a direction, in the frame of the shape, lies between the normals of a vertex."""
    cone = vertices.cone
    return bool(cone[m, 0] * dy - cone[m, 1] * dx >= 0.0 and dx * cone[m, 3] - dy * cone[m, 2] >= 0.0)


@inline_kernel
def vertices_on_vertices(pair: Pair, reach: float, n: int) -> int:
    """Add pairs of corners that are apart and face each other."""
    vertices, a, b, pose = pair.vertices, pair.a, pair.b, pair.pose
    size = min(pair.table.radius[a], pair.table.radius[b])
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
                facing = Feature(x, y, px, py, nx, ny, gap, vertices.place[m], vertices.place[k])
                n = added(pair.out, pair.row, n, size, reach, facing)
                if n < 0:
                    return n
    return n


@inline_kernel
def distance_of_pieces(table: ShapeTable, a: int, ka: int, b: int, kb: int, pose: Pose) -> float:
    """Smallest distance [m] of two pieces, the second shape being placed by ``pose``."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    span, low, high = table.piece_span[ka], table.piece_range[ka, 0], table.piece_range[ka, 1]
    best = 1e300
    for k in range(BISECTIONS + 2):
        u = low if k == 0 else (high if k == 1 else 0.5 * (low + high))
        x, y, dx, dy = tangent_at(table, a, span, u, still)
        _, _, qx, qy = foot_on(table, b, kb, pose, x, y)
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
        c, s, p, q = turn[i, 0], turn[i, 1], turn[j, 0], turn[j, 1]
        dx, dy = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
        pose = Pose(c * p + s * q, c * q - s * p, c * dx + s * dy, c * dy - s * dx)
        found = features_in_frame(Pair(table, vertices, shape[i], shape[j], pose, out, row), reach)
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
    table: ShapeTable, vertices: Vertices, shape: int, line: Line, reach: float, out: FeatureRows, row: int
) -> int:
    """Lowest places and vertices of a shape over a wall, in the shape's frame: their number, `FULL` or `TOO_DEEP`."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    nx, ny, height = line
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
            n = wall_feature(out, row, n, size, reach, line, px, py, span + u + 0.5)
            if n < 0:
                return n
    for m in range(vertices.first[shape], vertices.first[shape + 1]):
        n = wall_feature(out, row, n, size, reach, line, vertices.point[m, 0], vertices.point[m, 1], vertices.place[m])
        if n < 0:
            return n
    return n


@inline_kernel
def wall_feature(
    out: FeatureRows, row: int, n: int, size: float, reach: float, line: Line, px: float, py: float, place: float
) -> int:
    """`added` for the point (px, py) over a wall; `TOO_DEEP` beyond `DEEPEST`."""
    nx, ny = line.nx, line.ny
    gap = nx * px + ny * py - line.height
    if gap <= -DEEPEST * size:
        return TOO_DEEP
    return added(out, row, n, size, reach, Feature(px, py, px - gap * nx, py - gap * ny, -nx, -ny, gap, place, 0.0))


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
        nx, ny, c, s = wall[w, NORMAL_X], wall[w, NORMAL_Y], turn[i, 0], turn[i, 1]
        height = nx * (wall[w, POINT_X] - x[i, 0]) + ny * (wall[w, POINT_Y] - x[i, 1])
        line = Line(c * nx + s * ny, c * ny - s * nx, height)
        found = features_at_wall(table, vertices, shape[i], line, reach, out, row)
        count[k] = found
        for m in range(row, row + max(found, 0)):
            for rows in (out.first, out.second):
                px, py = rows[m, 0], rows[m, 1]
                rows[m, 0], rows[m, 1] = c * px - s * py, s * px + c * py
            out.normal[m, 0], out.normal[m, 1] = -nx, -ny
        row += max(found, 0)
    return row
