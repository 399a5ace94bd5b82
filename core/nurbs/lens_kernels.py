"""Kernels that measure one contact: its chord and its extent along the normal.

Near grazing an intersection is known along the tangent to round-off over the crossing angle only, and a normal from the
difference of two such points loses half of all digits. Two things prevent this. The chord is computed from the differences of points along
each curve, which keep relative precision: the first intersection is taken as it is, the residual there being a shift of one
curve by round-off, and the second one is corrected until both curves give the same chord. And the overlap is not taken
from the intersections at all: it is the difference of the extreme points' coordinates along the normal, which is stationary in
their places.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, bend_at, step_along, tangent_at, walked


@inline_kernel
def chord(
    table: ShapeTable,
    a: int,
    b: int,
    pose: Pose,
    i0: int,
    u0: float,
    j0: int,
    v0: float,
    i1: int,
    u1: float,
    j1: int,
    v1: float,
) -> tuple[float, float, float, float]:
    """Chord from the entering to the leaving intersection of ``a``, and its middle [m]: dx, dy, x, y."""
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
