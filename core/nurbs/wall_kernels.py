"""Kernels of the contact of a NURBS outline with a half-plane wall, in the same way as between two outlines."""

from __future__ import annotations

from math import sqrt

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.nurbs.curve_kernels import Pose, ShapeTable, step_along, tangent_at
from ninedisk.core.nurbs.lens_kernels import extent_along, extent_on
from ninedisk.core.nurbs.roots_kernels import (
    COINCIDE,
    CONTRACTION,
    MOST_BOXES,
    ROUNDING,
    SHIFT,
    TOUCHING,
    is_known,
    sort_crossings,
)
from ninedisk.core.nurbs.state import ENCLOSED, FULL, MOST_ROOTS, PARALLEL, STACK, UNDECIDED, ContactRows, Workspace


@inline_kernel
def solve_range(
    table: ShapeTable, shape: int, i: int, u: float, nx: float, ny: float, height: float, half: float, slack: float
) -> tuple[bool, float, float]:
    """Newton from the middle of a range for ``n . C = height``: whether it converged in the range, the place, the slope."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    u0 = u
    for _ in range(20):
        x, y, dx, dy = tangent_at(table, shape, i, u, still)
        slope = nx * dx + ny * dy
        du = -(nx * x + ny * y - height) / slope
        u += du
        if not abs(u - u0) <= 2.0 * half + slack:
            return False, u, slope
        if abs(du) <= 1e-2 * slack:
            return abs(u - u0) <= half + slack, u, slope
    return False, u, 0.0


@inline_kernel
def line_crossings(table: ShapeTable, shape: int, nx: float, ny: float, height: float, work: Workspace) -> int:
    """Intersections of an outline, in its own frame, with the line ``n . q = height``, sorted along the outline.

    Returns
    -------
    int
        Their number in ``work.root``, +1 where ``n . q`` falls below ``height``; or `UNDECIDED` or `PARALLEL`.
    """
    still = Pose(1.0, 0.0, 0.0, 0.0)
    noise, smallest = ROUNDING * (table.radius[shape] + abs(height)), TOUCHING * table.radius[shape]
    n, boxes, box = 0, 0, work.box
    for k in range(table.first_piece[shape], table.first_piece[shape + 1]):
        mid = nx * table.piece_circle[k, 0] + ny * table.piece_circle[k, 1] - height
        if abs(mid) > table.piece_circle[k, 2]:
            continue
        i, bend = table.piece_span[k], table.piece_bend[k]
        box[0, 0], box[0, 1] = table.piece_range[k, 0], table.piece_range[k, 1]
        waiting, before = 1, n
        while waiting > 0:
            waiting -= 1
            boxes += 1
            low, high = box[waiting, 0], box[waiting, 1]
            u, half = 0.5 * (low + high), 0.5 * (high - low)
            x, y, dx, dy = tangent_at(table, shape, i, u, still)
            off, slope, rest = nx * x + ny * y - height, nx * dx + ny * dy, 0.5 * bend * half * half
            if abs(off) > abs(slope) * half + rest + noise:
                continue
            if rest == 0.0 and abs(slope) * half <= COINCIDE * noise:
                return PARALLEL
            if 4.0 * rest <= CONTRACTION * abs(slope) * 2.0 * half and slope != 0.0:
                slack = 1e-6 * half + 100.0 * noise / abs(slope)
                found, u, slope = solve_range(table, shape, i, u, nx, ny, height, half, slack)
                crossing = 1.0 if slope < 0.0 else -1.0
                # Where the outline is parallel to the wall, rounding lets many boxes find the same intersection.
                if found and not is_known(work.root, before, n, u, crossing, 3.0 * slack):
                    if n >= MOST_ROOTS:
                        return UNDECIDED
                    root = work.root
                    root[n, 0], root[n, 1], root[n, 2], root[n, 3] = i, u, 0.0, 0.0
                    root[n, 4] = crossing
                    n += 1
                continue
            if 2.0 * half * sqrt(dx * dx + dy * dy) < smallest:
                continue
            if waiting + 2 > STACK or boxes > MOST_BOXES:
                return UNDECIDED
            box[waiting, 0], box[waiting, 1], box[waiting + 1, 0], box[waiting + 1, 1] = low, u, u, high
            waiting += 2
    n = sort_crossings(n, table.first_span[shape + 1] - table.first_span[shape], work.root)
    return PARALLEL if n == UNDECIDED else n


@inline_kernel
def deepest_below(table: ShapeTable, shape: int, nx: float, ny: float, height: float) -> float:
    """How far an outline, in its own frame, reaches beyond the line ``n . q = height`` [m]; -1 if its pieces' circles do not."""
    still = Pose(1.0, 0.0, 0.0, 0.0)
    best = -1.0
    for k in range(table.first_piece[shape], table.first_piece[shape + 1]):
        off = nx * table.piece_circle[k, 0] + ny * table.piece_circle[k, 1] - height
        if off < table.piece_circle[k, 2] and table.piece_circle[k, 2] - off > best:
            low, high = table.piece_range[k, 0], table.piece_range[k, 1]
            best = max(best, extent_on(table, shape, still, table.piece_span[k], low, high, -nx, -ny) + height)
    return best


@inline_kernel
def wall_contacts(
    table: ShapeTable,
    shape: int,
    at: Pose,
    px: float,
    py: float,
    nx: float,
    ny: float,
    work: Workspace,
    out: ContactRows,
    row: int,
) -> int:
    """Contacts of a placed shape with the wall through (px, py) whose free side is that of (nx, ny).

    The chord lies on the wall, the contact's normal is the wall's reversed, and the overlap is the depth of the arc that is
    beyond the wall. A face that coincides with the wall to rounding touches: it is judged as if the wall were back by `SHIFT` roundings.

    Returns
    -------
    int
        Number of contacts, or `ENCLOSED` (the whole grain is beyond the wall), `UNDECIDED` or `FULL`.
    """
    height = nx * (px - at.x) + ny * (py - at.y)
    if not height > -table.radius[shape]:
        return 0
    mx, my = at.c * nx + at.s * ny, at.c * ny - at.s * nx
    if deepest_below(table, shape, mx, my, height) <= 2.0 * ROUNDING * (table.radius[shape] + abs(height)):
        return 0  # it touches, if anything
    n = line_crossings(table, shape, mx, my, height, work)
    if n == PARALLEL:
        height -= SHIFT * ROUNDING * (table.radius[shape] + abs(height))
        n = line_crossings(table, shape, mx, my, height, work)
    if n < 0:
        return UNDECIDED
    root = work.root
    still = Pose(1.0, 0.0, 0.0, 0.0)
    if n == 0:
        x, y, _, _ = tangent_at(table, shape, 0, 0.0, still)
        # A grain that is no deeper than rounding touches; one on the free side is free.
        return ENCLOSED if mx * x + my * y < height else 0
    if row + n // 2 > out.overlap.shape[0]:
        return FULL
    done = 0
    for k in range(n):
        if root[k, 4] < 0.0:
            continue
        m = k + 1 if k + 1 < n else 0
        i0, u0, i1, u1 = int(root[k, 0]), root[k, 1], int(root[m, 0]), root[m, 1]
        # As in `lens_kernels.chord`: the second intersection at the very height of the first one, by differences along the curve.
        along = 0.0
        for _ in range(2):
            x, y = step_along(table, shape, i0, u0, i1, u1, still)
            _, _, dx, dy = tangent_at(table, shape, i1, u1, still)
            du = -(mx * x + my * y) / (mx * dx + my * dy)
            along = -my * (x + du * dx) + mx * (y + du * dy)
            u1 += du
        x, y, _, _ = tangent_at(table, shape, i0, u0, still)
        off = mx * x + my * y - height
        x, y = x - off * mx - 0.5 * along * my, y - off * my + 0.5 * along * mx
        r = row + done
        depth = extent_along(table, shape, still, i0, u0, i1, u1, -mx, -my) + height
        out.point[r, 0], out.point[r, 1] = at.c * x - at.s * y + at.x, at.s * x + at.c * y + at.y
        out.normal[r, 0], out.normal[r, 1] = -nx, -ny
        out.overlap[r], out.beyond[r], out.chord[r], out.corners[r] = depth, depth, abs(along), 2
        out.place[r, 0], out.place[r, 1] = i0 + u0 + 0.5, float("nan")
        out.place[r, 2], out.place[r, 3] = i1 + u1 + 0.5, float("nan")
        done += 1
    return done


@kernel
def contacts_with_wall(
    table: ShapeTable,
    shape: IntArray,
    x: FloatArray,
    turn: FloatArray,
    wall: FloatArray,
    work: Workspace,
    count: IntArray,
    out: ContactRows,
) -> int:
    """Contacts of many grains with one wall, one after the other in ``out``; their number.

    Parameters
    ----------
    table, shape, x, turn, work, out
        As for `contacts_of_pairs`.
    wall : ndarray, shape (4,)
        A point of the surface [m] and the unit normal into the free side.
    count : ndarray of int64, shape (n,)
        Out: what `wall_contacts` returns for each grain.
    """
    row = 0
    for k in range(x.shape[0]):
        at = Pose(turn[k, 0], turn[k, 1], x[k, 0], x[k, 1])
        found = wall_contacts(table, shape[k], at, wall[0], wall[1], wall[2], wall[3], work, out, row)
        count[k] = found
        if found > 0:
            row += found
    return row
