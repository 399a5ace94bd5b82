"""Kernels that measure one contact: its chord, its extent along the normal, and its area.

Near grazing an intersection is known along the tangent to round-off over the crossing angle only, and a normal from the
difference of two such points loses half of all digits. Two things prevent this. The chord is computed from the differences of points along
each curve, which keep relative precision: the first intersection is taken as it is, the residual there being a shift of one
curve by round-off, and the second one is corrected until both curves give the same chord. And the overlap is not taken
from the intersections at all: it is the difference of the extreme points' coordinates along the normal, which is stationary in
their places.

The boundary of a common area with more than two corners is several arcs of the first outline, each from where it enters the second one
to where it leaves, with arcs of the second one between them. Moving the first body by dx sweeps ``dx . (integral of the outward normal
along its arcs)``, which is the sum of its arcs' chords turned clockwise, and turning it sweeps the sum of ``-c . M``, c a chord as a vector
and M its middle (`ninedisk.core.law.ContactLaw`). The one chord in their place is therefore their sum C: the normal is at right angles to
it, and its middle is where ``C . M`` is the sum of the chords'; along the normal it is at the mean of the chords of both outlines, weighted
by their lengths. It changes continuously where two corners meet and vanish. Where chords cancel, as when a plate goes through a grain,
there is no such chord.

The area between an arc and its chord is the integral of ``(r x dr)/2`` along the arc (Green's theorem) with r measured from the chord's
end: the chord itself contributes nothing, and no area of the outline's own size is subtracted.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, step_along, tangent_at, walked
from ninedisk.core.nurbs.state import ContactRows

CANCEL = 0.5
"""Length of the sum of chords over the sum of their lengths, on the mean of both outlines, below which they cancel."""

NODES = (0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363)
"""Positive half of the 8 Gauss nodes on a piece, which turns by 0.6 rad at most: they leave round-off."""

GAUSS_WEIGHTS = (0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763)


@inline_kernel
def chord(
    table: ShapeTable, a: int, b: int, pose: Pose, root: FloatArray, k: int, m: int
) -> tuple[float, float, float, float]:
    """Chord from the intersection ``k``, where ``a`` enters, to ``m``, where it leaves, and its middle [m]: dx, dy, x, y."""
    i0, u0, j0, v0 = int(root[k, 0]), root[k, 1], int(root[k, 2]), root[k, 3]
    i1, u1, j1, v1 = int(root[m, 0]), root[m, 1], int(root[m, 2]), root[m, 3]
    still = Pose(1.0, 0.0, 0.0, 0.0)
    for _ in range(2):
        x, y = step_along(table, a, i0, u0, i1, u1, still)
        px, py = step_along(table, b, j0, v0, j1, v1, pose)
        _, _, dx, dy = tangent_at(table, a, i1, u1, still)
        _, _, ex, ey = tangent_at(table, b, j1, v1, pose)
        fx, fy = x - px, y - py
        det = dx * ey - dy * ex
        du = -(fx * ey - fy * ex) / det
        u1 += du
        v1 += (dx * fy - dy * fx) / det
        x, y = x + du * dx, y + du * dy
        if abs(du) < 1e-12:
            break
    ax, ay, _, _ = tangent_at(table, a, i0, u0, still)
    bx, by, _, _ = tangent_at(table, b, j0, v0, pose)
    return x, y, 0.5 * (ax + bx + x), 0.5 * (ay + by + y)


@inline_kernel
def extreme_near(
    table: ShapeTable, shape: int, pose: Pose, i: int, u: float, nx: float, ny: float
) -> tuple[float, float]:
    """Point of a convex outline that is extreme along (nx, ny) [m], by Newton from a place close to it."""
    n = table.first_span[shape + 1] - table.first_span[shape]
    x, y = 0.0, 0.0
    for _ in range(8):
        x, y, dx, dy, ex, ey = bend_at(table, shape, i, u, pose)
        du = -(nx * dx + ny * dy) / (nx * ex + ny * ey)
        if not abs(du) < 0.5:
            return x, y
        if abs(du) < 1e-8:  # what is left of the extent is the square of this
            return x + du * dx, y + du * dy
        i, u = walked(n, i, u + du)
    return x, y


@inline_kernel
def extent_on(
    table: ShapeTable, shape: int, pose: Pose, i: int, low: float, high: float, nx: float, ny: float
) -> float:
    """Largest coordinate along (nx, ny) [m] of the part ``low .. high`` of a piece."""
    x, y, dx, dy = tangent_at(table, shape, i, low, pose)
    px, py, ex, ey = tangent_at(table, shape, i, high, pose)
    best = max(nx * x + ny * y, nx * px + ny * py)
    if not (nx * dx + ny * dy > 0.0 > nx * ex + ny * ey):
        return best
    u = 0.5 * (low + high)
    for _ in range(60):
        x, y, dx, dy, ex, ey = bend_at(table, shape, i, u, pose)
        slope, bend = nx * dx + ny * dy, nx * ex + ny * ey
        if slope > 0.0:
            low = u
        else:
            high = u
        best = max(best, nx * x + ny * y)
        du = -slope / bend
        if abs(du) < 1e-9:
            break
        u = u + du if low < u + du < high else 0.5 * (low + high)
    return best


@inline_kernel
def piece_from(table: ShapeTable, shape: int, i: int, u: float) -> int:
    """The piece on which an outline goes on from (i, u)."""
    k, last = table.first_piece[shape], table.first_piece[shape + 1] - 1
    while k < last and (table.piece_span[k] < i or (table.piece_span[k] == i and table.piece_range[k, 1] <= u)):
        k += 1
    return int(k)


@inline_kernel
def extent_along(
    table: ShapeTable, shape: int, pose: Pose, i0: int, u0: float, i1: int, u1: float, nx: float, ny: float
) -> float:
    """Largest coordinate along (nx, ny) [m] of the arc that runs forward from (i0, u0) to (i1, u1), piece by piece."""
    first, last = table.first_piece[shape], table.first_piece[shape + 1] - 1
    k = piece_from(table, shape, i0, u0)
    best = -1e300
    low = u0
    whole_turn = i1 < i0 or (i1 == i0 and u1 < u0)
    for _ in range(last - first + 2):
        span, high = table.piece_span[k], table.piece_range[k, 1]
        ends_here = span == i1 and u1 <= high and not whole_turn
        best = max(best, extent_on(table, shape, pose, span, low, u1 if ends_here else high, nx, ny))
        if ends_here:
            break
        k += 1
        if k > last:
            k, whole_turn = first, False
        low = table.piece_range[k, 0]
    return best


@inline_kernel
def normal_of(dx: float, dy: float) -> tuple[float, float, float]:
    """Length of a chord [m] and the unit vector to its right, which is outward where the outline runs along the chord."""
    length = sqrt(dx * dx + dy * dy)
    return length, dy / length, -dx / length


@inline_kernel
def entry_after(n: int, m: int, ring: float, root: FloatArray) -> int:
    """The intersection of ``n`` at which the first outline enters that follows ``m`` along the second one, of ``ring`` spans."""
    start, best, least = root[m, 2] + root[m, 3], -1, 1e300
    for k in range(n):
        ahead = (root[k, 2] + root[k, 3] - start) % ring
        if root[k, 4] > 0.0 and ahead < least:
            best, least = k, ahead
    return best


@inline_kernel
def corners_from(n: int, k: int, ring: float, root: FloatArray) -> int:
    """Corners of the common area that the first outline enters at ``k``; 0 if an entry before k is one of them; -1 if it never closes."""
    i = k
    for turn in range(n):
        i = entry_after(n, i + 1 if i + 1 < n else 0, ring, root)
        if i == k:
            return 2 * turn + 2
        if i < k:
            return 0
    return -1


@inline_kernel
def between(x: float, y: float, px: float, py: float) -> tuple[float, float, float]:
    """Distance of two points [m] and their middle."""
    return sqrt((px - x) * (px - x) + (py - y) * (py - y)), 0.5 * (x + px), 0.5 * (y + py)


@inline_kernel
def note_places(out: ContactRows, row: int, root: FloatArray, k: int, m: int) -> None:
    """Write where the outlines intersect at ``k`` (entering) and ``m`` (leaving)."""
    out.place[row, 0], out.place[row, 1] = root[k, 0] + root[k, 1] + 0.5, root[k, 2] + root[k, 3] + 0.5
    out.place[row, 2], out.place[row, 3] = root[m, 0] + root[m, 1] + 0.5, root[m, 2] + root[m, 3] + 0.5


@inline_kernel
def measured_lens(
    table: ShapeTable,
    a: int,
    at: Pose,
    b: int,
    pose: Pose,
    root: FloatArray,
    n: int,
    k: int,
    out: ContactRows,
    row: int,
) -> bool:
    """Write the contact of the common area that the first outline enters at ``k``; False if its chords cancel."""
    still, ring = Pose(1.0, 0.0, 0.0, 0.0), float(table.first_span[b + 1] - table.first_span[b])
    cx, cy, along, across_x, across_y, total, longest = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0
    first_x, first_y, last_x, last_y = 0.0, 0.0, 0.0, 0.0
    i = k
    for turn in range(n):
        m = i + 1 if i + 1 < n else 0
        dx, dy, x, y = chord(table, a, b, pose, root, i, m)
        length = sqrt(dx * dx + dy * dy)
        cx, cy, along, total = cx + dx, cy + dy, along + dx * x + dy * y, total + length
        across_x, across_y = across_x + length * x, across_y + length * y
        if length > longest:
            longest = length
            note_places(out, row, root, i, m)
        # The second outline's chords, from where the first one left to where it enters, count alike: neither body comes first.
        if turn == 0:
            first_x, first_y = x - 0.5 * dx, y - 0.5 * dy
        else:
            length, px, py = between(last_x, last_y, x - 0.5 * dx, y - 0.5 * dy)
            total, across_x, across_y = total + length, across_x + length * px, across_y + length * py
        last_x, last_y = x + 0.5 * dx, y + 0.5 * dy
        i = entry_after(n, m, ring, root)
        if i == k:
            break
    length, px, py = between(last_x, last_y, first_x, first_y)
    total, across_x, across_y = total + length, across_x + length * px, across_y + length * py
    size, nx, ny = normal_of(cx, cy)
    if not size >= 0.5 * CANCEL * total:
        return False
    level, reach = (nx * across_x + ny * across_y) / total, along / size
    top, low = -1e300, -1e300
    i = k
    for _ in range(n):
        m = i + 1 if i + 1 < n else 0
        after = entry_after(n, m, ring, root)
        top = max(top, extent_along(table, a, still, int(root[i, 0]), root[i, 1], int(root[m, 0]), root[m, 1], nx, ny))
        j0, v0, j1, v1 = int(root[m, 2]), root[m, 3], int(root[after, 2]), root[after, 3]
        low = max(low, extent_along(table, b, pose, j0, v0, j1, v1, -nx, -ny))
        i = after
        if i == k:
            break
    # The tangent is the normal turned counter-clockwise: the chord's direction.
    x, y = level * nx - reach * ny, level * ny + reach * nx
    out.point[row, 0], out.point[row, 1] = at.c * x - at.s * y + at.x, at.s * x + at.c * y + at.y
    out.normal[row, 0], out.normal[row, 1] = at.c * nx - at.s * ny, at.s * nx + at.c * ny
    out.chord[row], out.overlap[row], out.beyond[row] = size, top + low, top - level
    return True


@inline_kernel
def segment_area(table: ShapeTable, shape: int, start: float, end: float) -> float:
    """Area [m^2] between the arc that runs forward between two places (span + u + 1/2) and its chord."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    ring = table.first_span[shape + 1] - table.first_span[shape]
    start, end = start if start < ring else start - ring, end if end < ring else end - ring
    i0, i1 = int(start), int(end)
    u0, u1 = start - i0 - 0.5, end - i1 - 0.5
    first, last = table.first_piece[shape], table.first_piece[shape + 1] - 1
    fx, fy, _, _ = tangent_at(table, shape, i0, u0, still)
    k, low, whole_turn, area = piece_from(table, shape, i0, u0), u0, end < start, 0.0
    for _ in range(last - first + 2):
        span, high = table.piece_span[k], table.piece_range[k, 1]
        ends_here = span == i1 and u1 <= high and not whole_turn
        if ends_here:
            high = u1
        half, middle = 0.5 * (high - low), 0.5 * (high + low)
        for m in range(8):
            node = NODES[m // 2] if m % 2 == 0 else -NODES[m // 2]
            x, y, dx, dy = tangent_at(table, shape, span, middle + half * node, still)
            area += 0.5 * half * GAUSS_WEIGHTS[m // 2] * ((x - fx) * dy - (y - fy) * dx)
        if ends_here:
            break
        k += 1
        if k > last:
            k, whole_turn = first, False
        low = table.piece_range[k, 0]
    return area
