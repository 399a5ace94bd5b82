"""Kernels of contacts whose common area has more than two corners.

Its boundary is several arcs of the first outline, each from where it enters the second one to where it leaves, with arcs of the second
one between them. Moving the first body by dx sweeps ``dx . (integral of the outward normal along its arcs)``, which is the sum of
its arcs' chords turned clockwise, and turning it sweeps the sum of ``-c . M``, c a chord as a vector and M its middle
(`ninedisk.core.law.ContactLaw`). The one chord in their place is therefore their sum C: the normal is at right angles to it, and its
middle is where ``C . M`` is the sum of the chords'; along the normal it is at the mean of the chords of both outlines, weighted by
their lengths. It changes continuously where two corners meet and vanish. Where chords cancel, as when a plate goes through a grain,
there is no such chord.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable
from ninedisk.core.nurbs.lens_kernels import chord, extent_along, normal_of
from ninedisk.core.nurbs.state import ContactRows, FloatArray

CANCEL = 0.5
"""Length of the sum of chords over the sum of their lengths, on the mean of both outlines, below which they cancel."""


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
def measured_together(
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
        i0, u0, j0, v0 = int(root[i, 0]), root[i, 1], int(root[i, 2]), root[i, 3]
        i1, u1, j1, v1 = int(root[m, 0]), root[m, 1], int(root[m, 2]), root[m, 3]
        dx, dy, x, y = chord(table, a, b, pose, i0, u0, j0, v0, i1, u1, j1, v1)
        length = sqrt(dx * dx + dy * dy)
        cx, cy, along, total = cx + dx, cy + dy, along + dx * x + dy * y, total + length
        across_x, across_y = across_x + length * x, across_y + length * y
        if length > longest:
            longest = length
            out.place[row, 0], out.place[row, 1] = i0 + u0 + 0.5, j0 + v0 + 0.5
            out.place[row, 2], out.place[row, 3] = i1 + u1 + 0.5, j1 + v1 + 0.5
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
