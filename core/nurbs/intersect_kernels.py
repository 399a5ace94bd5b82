"""Kernels of the intersection-based contact of two NURBS outlines.

Two outlines that intersect in two points have a contact: its point is the middle of the chord between them, its normal is at
right angles to the chord, from the first body to the second, and its overlap is the extent of the common area along the
normal, from the extreme point of the second outline to that of the first. On disks this is ``R1 + R2 - d``. Outlines that
are not convex can have several. Where both outlines cut corners off each other, a common area has more than two corners
(`lens_kernels`).
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, point_at
from ninedisk.core.nurbs.lens_kernels import (
    chord,
    corners_from,
    extent_along,
    extreme_near,
    measured_lens,
    normal_of,
    note_places,
)
from ninedisk.core.nurbs.roots_kernels import APART, LENS, ROUNDING, SHIFT, UNSURE, convex_lens, crossings
from ninedisk.core.nurbs.state import CROSSED, ENCLOSED, FULL, PARALLEL, UNDECIDED, ContactRows, Workspace
from ninedisk.core.nurbs.wall_kernels import line_crossings

POINT = 8.0
"""Roundings below which a chord is a point: the outlines touch at a corner."""


@inline_kernel
def contains_point(table: ShapeTable, shape: int, x: float, y: float, work: Workspace) -> bool:
    """Whether a point, in the shape's frame and not on its outline, lies inside: crossings of the ray along +x are odd."""
    n = line_crossings(table, shape, 0.0, 1.0, y, work)
    still = Pose(1.0, 0.0, 0.0, 0.0)
    odd = False
    for k in range(max(n, 0)):
        px, _ = point_at(table, shape, int(work.root[k, 0]), work.root[k, 1], still)
        if px > x:
            odd = not odd
    return odd


@inline_kernel
def one_contains_other(table: ShapeTable, a: int, b: int, pose: Pose, work: Workspace) -> bool:
    """Whether one of two outlines that do not intersect lies inside the other."""
    inner, outer, c, s, x, y = b, a, pose.c, pose.s, pose.x, pose.y
    for _ in range(2):
        px, py = point_at(table, inner, 0, 0.0, Pose(c, s, x, y))
        if px * px + py * py <= table.radius[outer] * table.radius[outer] and contains_point(
            table, outer, px, py, work
        ):
            return True
        inner, outer, s = a, b, -s
        x, y = -(c * pose.x - s * pose.y), -(s * pose.x + c * pose.y)
    return False


@inline_kernel
def measured(
    table: ShapeTable,
    a: int,
    at: Pose,
    b: int,
    pose: Pose,
    root: FloatArray,
    k: int,
    m: int,
    out: ContactRows,
    row: int,
) -> tuple[float, float, float]:
    """Write all except the extents of the contact between intersections ``k`` (entering) and ``m``.

    Returns
    -------
    tuple of float
        In the frame of ``a``: its normal, and the chord's coordinate along the normal [m].
    """
    dx, dy, x, y = chord(table, a, b, pose, root, k, m)
    length, nx, ny = normal_of(dx, dy)
    out.point[row, 0], out.point[row, 1] = at.c * x - at.s * y + at.x, at.s * x + at.c * y + at.y
    out.normal[row, 0], out.normal[row, 1] = at.c * nx - at.s * ny, at.s * nx + at.c * ny
    out.chord[row] = length
    note_places(out, row, root, k, m)
    return nx, ny, nx * x + ny * y


@inline_kernel
def lens_extent(
    table: ShapeTable, a: int, b: int, pose: Pose, root: FloatArray, k: int, m: int, nx: float, ny: float
) -> tuple[float, float]:
    """Upper end of the common area between intersections ``k`` and ``m`` along the normal, and its extent, from both its arcs [m]."""
    shape, first, last, column, sign = a, k, m, 0, 1.0
    side = Pose(1.0, 0.0, 0.0, 0.0)
    top, extent = 0.0, 0.0
    for _ in range(2):
        top = extent
        i0, u0 = int(root[first, column]), root[first, column + 1]
        i1, u1 = int(root[last, column]), root[last, column + 1]
        extent += extent_along(table, shape, side, i0, u0, i1, u1, sign * nx, sign * ny)
        shape, first, last, column, sign, side = b, m, k, 2, -1.0, pose
    return top, extent


@inline_kernel
def convex_extent(
    table: ShapeTable, a: int, b: int, pose: Pose, i: int, u: float, j: int, v: float, nx: float, ny: float
) -> tuple[float, float]:
    """`lens_extent` of strictly convex outlines whose extreme points are near (i, u) and (j, v)."""
    top_x, top_y = extreme_near(table, a, Pose(1.0, 0.0, 0.0, 0.0), i, u, nx, ny)
    low_x, low_y = extreme_near(table, b, pose, j, v, nx, ny)
    return nx * top_x + ny * top_y, nx * (top_x - low_x) + ny * (top_y - low_y)


@inline_kernel
def contacts_at(
    table: ShapeTable, a: int, at: Pose, b: int, pose: Pose, work: Workspace, out: ContactRows, row: int
) -> int:
    """`placed_contacts`, or `PARALLEL` where boundaries coincide too closely for it."""
    n, kind, i, u, j, v = 0, UNSURE, 0, 0.0, 0, 0.0
    one_centre = pose.x == 0.0 and pose.y == 0.0  # there is no line of centres to start from
    if table.smallest_radius[a] > 0.0 and table.smallest_radius[b] > 0.0 and not one_centre:
        kind, i, u, j, v = convex_lens(table, a, b, pose, work)
        if kind == APART:
            return 0
        n = 2
    if kind == UNSURE:
        n = crossings(table, a, b, pose, work)
        if n < 0:
            return n
        if n == 0:
            return ENCLOSED if one_contains_other(table, a, b, pose, work) else 0
    if row + n // 2 > out.overlap.shape[0]:
        return FULL
    ring = float(table.first_span[b + 1] - table.first_span[b])
    smallest = POINT * ROUNDING * (table.radius[a] + table.radius[b])
    done = 0
    for k in range(n):
        if work.root[k, 4] < 0.0:
            continue
        corners = 2 if n == 2 else corners_from(n, k, ring, work.root)
        if corners < 0:
            return PARALLEL
        if corners == 0:
            continue
        m = k + 1 if k + 1 < n else 0
        if corners > 2:
            if not measured_lens(table, a, at, b, pose, work.root, n, k, out, row + done):
                return CROSSED
        else:
            nx, ny, level = measured(table, a, at, b, pose, work.root, k, m, out, row + done)
            if kind == LENS:
                top, extent = convex_extent(table, a, b, pose, i, u, j, v, nx, ny)
            else:
                top, extent = lens_extent(table, a, b, pose, work.root, k, m, nx, ny)
            out.overlap[row + done], out.beyond[row + done] = extent, top - level
        out.corners[row + done] = corners
        if out.chord[row + done] > smallest:
            done += 1
    return done


@inline_kernel
def placed_contacts(
    table: ShapeTable, a: int, at: Pose, b: int, pose: Pose, work: Workspace, out: ContactRows, row: int
) -> int:
    """`pair_contacts` with the second shape's pose relative to the first's, wherever the bounding circles overlap.

    Faces that coincide to rounding have no intersections that can be distinguished. The second shape is then shifted by `SHIFT` roundings,
    apart and aside: faces that only touch leave each other, and of sides that lie on one line one comes to be the inner one. Should a
    line lie along the shift, another direction is tried.
    """
    size = SHIFT * ROUNDING * (table.radius[a] + table.radius[b])
    distance = sqrt(pose.x * pose.x + pose.y * pose.y)
    ux, uy = (pose.x / distance, pose.y / distance) if distance > 0.0 else (1.0, 0.0)
    found, dx, dy = PARALLEL, 0.0, 0.0
    for attempt in range(4):
        found = contacts_at(table, a, at, b, Pose(pose.c, pose.s, pose.x + dx, pose.y + dy), work, out, row)
        if found != PARALLEL:
            return found
        # 0.5, -0.35 and 1.2 rad from the line of centres: half a radian and more from each other.
        c, s = (0.878, 0.479) if attempt == 0 else ((0.939, -0.343) if attempt == 1 else (0.362, 0.932))
        dx, dy = size * (c * ux - s * uy), size * (s * ux + c * uy)
    return UNDECIDED


@inline_kernel
def pair_contacts(
    table: ShapeTable, a: int, at: Pose, b: int, other: Pose, work: Workspace, out: ContactRows, row: int
) -> int:
    """Contacts of shape ``a`` placed by ``at`` with shape ``b`` placed by ``other``, written to ``out`` from ``row`` on.

    Computed in the frame of ``a``, into which the difference of the two positions is turned: far from the scene's origin
    nothing is lost.

    Returns
    -------
    int
        Number of contacts, or `ENCLOSED`, `CROSSED`, `UNDECIDED` or `FULL`.
    """
    x, y = other.x - at.x, other.y - at.y
    reach = table.radius[a] + table.radius[b]
    if not x * x + y * y < reach * reach:  # positions that are no numbers are nobody's contact
        return 0
    pose = Pose(
        at.c * other.c + at.s * other.s, at.c * other.s - at.s * other.c, at.c * x + at.s * y, at.c * y - at.s * x
    )
    return placed_contacts(table, a, at, b, pose, work, out, row)


@kernel
def contacts_of_pairs(
    table: ShapeTable,
    shape: IntArray,
    x: FloatArray,
    turn: FloatArray,
    pairs: IntArray,
    work: Workspace,
    count: IntArray,
    out: ContactRows,
) -> int:
    """Contacts of many pairs, one after the other in ``out``.

    Parameters
    ----------
    table : ShapeTable
    shape : ndarray of int64, shape (n,)
        Shape of each grain.
    x : ndarray, shape (n, 2)
        Positions of the frames' origins [m].
    turn : ndarray, shape (n, 2)
        Cosine and sine of the rotations.
    pairs : ndarray of int64, shape (k, 2)
    work : Workspace
    count : ndarray of int64, shape (k,)
        Out: what `pair_contacts` returns for each pair.
    out : ContactRows
        Out: the contacts, in the order of the pairs.

    Returns
    -------
    int
        Number of contacts.
    """
    row = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        at = Pose(turn[i, 0], turn[i, 1], x[i, 0], x[i, 1])
        other = Pose(turn[j, 0], turn[j, 1], x[j, 0], x[j, 1])
        found = pair_contacts(table, shape[i], at, shape[j], other, work, out, row)
        count[k] = found
        if found > 0:
            row += found
    return row
