"""Kernels of the contact search: cell list, half neighbour list with a skin, disks near walls, order of the disks, stripes.

The neighbour list is stored by rows: the neighbours ``j > i`` of disk ``i`` are ``other[start[i]:start[i+1]]``, beside
each the shear force of that contact. Lists are built in the order of the disks, so the same input gives the same bits.
"""

from __future__ import annotations

from math import floor, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.state import (
    OK,
    PAIRS_FULL,
    WALL_PAIRS_FULL,
    Cells,
    DiskArrays,
    Levels,
    NeighbourList,
    Team,
    WallArrays,
)
from ninedisk.core.pose import NORMAL_X, NORMAL_Y, POINT_X, POINT_Y

ROWS = 4
"""Rows of cells of a stripe: the fewer they are, the more disks lie on borders and move in their own pass. A stripe of a crowded
place may have half as many."""

REBUILD_COST = 5.0
"""Cost of a rebuild over that of the pairs out of contact in a step, per disk, with a skin of a mean radius (measured: 70 ns over
2.8 pairs of 5.4 ns)."""


@inline_kernel
def order_by_cell(cells: Cells | Levels, n: int, count: int) -> None:
    """Counting sort of ``n`` bodies by ``cells.cell``, the numbers of their cells, of which there are ``count``."""
    for c in range(count + 1):
        cells.start[c] = 0
    for i in range(n):
        cells.start[cells.cell[i] + 1] += 1
    for c in range(count):
        cells.start[c + 1] += cells.start[c]
    # The pointers serve as cursors while filling and are shifted back afterwards.
    for i in range(n):
        c = cells.cell[i]
        cells.order[cells.start[c]] = i
        cells.start[c] += 1
    for c in range(count, 0, -1):
        cells.start[c] = cells.start[c - 1]
    cells.start[0] = 0


@kernel
def sort_into_cells(x: NDArray[np.float64], width: float, cells: Cells) -> bool:
    """Counting sort of the centres into square cells, in rows along the shorter side of the box around them.

    Parameters
    ----------
    x : ndarray, shape (n, 2)
        Centres [m].
    width : float
        Smallest width of a cell [m]; it grows until the cells fit into ``cells.start``.
    cells : Cells
        Out.

    Returns
    -------
    bool
        False if a coordinate, or the extent of all, is not finite.
    """
    n = x.shape[0]
    low_x, low_y, high_x, high_y = x[0, 0], x[0, 1], x[0, 0], x[0, 1]
    for i in range(n):
        if not (np.isfinite(x[i, 0]) and np.isfinite(x[i, 1])):
            return False
        low_x, high_x = min(low_x, x[i, 0]), max(high_x, x[i, 0])
        low_y, high_y = min(low_y, x[i, 1]), max(high_y, x[i, 1])
    # Finite coordinates can still be too far apart for a finite difference.
    if not (np.isfinite(high_x - low_x) and np.isfinite(high_y - low_y)):
        return False
    along, across = (0, 1) if high_x - low_x <= high_y - low_y else (1, 0)
    low_a, long_a = (low_x, high_x - low_x) if along == 0 else (low_y, high_y - low_y)
    low_b, long_b = (low_y, high_y - low_y) if along == 0 else (low_x, high_x - low_x)
    room = cells.start.shape[0] - 1
    columns, rows = floor(long_a / width) + 1.0, floor(long_b / width) + 1.0
    while columns * rows > room:
        width *= 1.5
        columns, rows = floor(long_a / width) + 1.0, floor(long_b / width) + 1.0
    grid = cells.grid
    grid[0], grid[1], grid[2], grid[3], grid[4] = low_a, low_b, width, columns, rows
    nx = int(columns)
    for i in range(n):
        cells.cell[i] = int((x[i, across] - low_b) / width) * nx + int((x[i, along] - low_a) / width)
    order_by_cell(cells, n, int(columns * rows))
    return True


@inline_kernel
def enter_pair(i: int, j: int, listed: NDArray[np.uint32], old: NeighbourList, new: NeighbourList, k: int) -> None:
    """Make the disks i and j the listed pair k, with the history that it has in the old list."""
    bends = new.bending.shape[0] > 0
    new.other[k] = j
    new.shear[k] = 0.0
    if bends:
        new.bending[k] = 0.0
    a, b = min(listed[i], listed[j]), max(listed[i], listed[j])
    for o in range(old.start[a], old.start[a + 1]):
        if old.other[o] == b:
            new.shear[k] = old.shear[o]
            if bends:
                new.bending[k] = old.bending[o] if a == listed[i] else -old.bending[o]
            break


@kernel
def build_pairs(
    x: NDArray[np.float64],
    radius: NDArray[np.float64],
    skin: float,
    cells: Cells,
    in_order: bool,
    listed: NDArray[np.uint32],
    old: NeighbourList,
    new: NeighbourList,
) -> int:
    """Half neighbour list of all pairs with a gap below ``skin``; the history of the old list is carried over.

    Parameters
    ----------
    x : ndarray, shape (n, 2)
        Centres [m].
    radius : ndarray, shape (n,)
        Radii [m].
    skin : float
        Largest gap [m] of a listed pair.
    cells : Cells
        Filled by `sort_into_cells` with a width of at least twice the largest radius plus the skin.
    in_order : bool
        Whether the disks already lie in the order of the cells; partners then come from the rest of their row and the next.
    listed : ndarray of uint32, shape (n,)
        Row that each disk had in ``old``. A shear force is the same number from either disk, a torque its opposite.
    old, new : NeighbourList
        ``old`` is read, ``new`` written.

    Returns
    -------
    int
        OK, or PAIRS_FULL if the capacity of ``new`` is too small.
    """
    n = x.shape[0]
    nx, ny = int(cells.grid[3]), int(cells.grid[4])
    capacity, k = new.other.shape[0], 0
    new.start[0] = 0
    for i in range(n):
        c = cells.cell[i]
        row, column = c // nx, c % nx
        xi, yi, reach = x[i, 0], x[i, 1], radius[i] + skin
        first, last = max(column - 1, 0), min(column + 1, nx - 1)
        for r in range(row if in_order else max(row - 1, 0), min(row + 2, ny)):
            begin = cells.start[r * nx + first]
            for m in range(max(begin, i + 1) if in_order else begin, cells.start[r * nx + last + 1]):
                j = m if in_order else int(cells.order[m])
                if j <= i:
                    continue
                dx, dy, limit = x[j, 0] - xi, x[j, 1] - yi, reach + radius[j]
                if dx * dx + dy * dy < limit * limit:
                    if k == capacity:
                        return PAIRS_FULL
                    enter_pair(i, j, listed, old, new, k)
                    k += 1
        new.start[i + 1] = k
    return OK


@kernel
def build_wall_pairs(
    x: NDArray[np.float64],
    radius: NDArray[np.float64],
    skin: float,
    wall: NDArray[np.float64],
    listed: NDArray[np.uint32],
    scratch: NDArray[np.float64],
    old: NeighbourList,
    new: NeighbourList,
) -> int:
    """Lists of the disks with a gap below ``skin`` to each wall; the history of the old lists is carried over.

    Parameters
    ----------
    x, radius, skin, listed
        As in `build_pairs`.
    wall : ndarray, shape (m, 11)
        Walls as `place_walls` fills them.
    scratch : ndarray, shape (n,)
        Zero before and after.
    old, new : NeighbourList
        Rows are walls; disks ascend within a row.

    Returns
    -------
    int
        OK, or WALL_PAIRS_FULL if the capacity of ``new`` is too small.
    """
    capacity, k = new.other.shape[0], 0
    bends = new.bending.shape[0] > 0
    new.start[0] = 0
    for w in range(wall.shape[0]):
        begun = k
        for o in range(old.start[w], old.start[w + 1]):
            scratch[old.other[o]] = old.shear[o]
        px, py, nx, ny = wall[w, POINT_X], wall[w, POINT_Y], wall[w, NORMAL_X], wall[w, NORMAL_Y]
        for i in range(x.shape[0]):
            if (x[i, 0] - px) * nx + (x[i, 1] - py) * ny - radius[i] < skin:
                if k == capacity:
                    for o in range(old.start[w], old.start[w + 1]):
                        scratch[old.other[o]] = 0.0
                    return WALL_PAIRS_FULL
                new.other[k] = i
                new.shear[k] = scratch[listed[i]]
                k += 1
        new.start[w + 1] = k
        if bends:
            for o in range(old.start[w], old.start[w + 1]):
                scratch[old.other[o]] = old.bending[o]
            for m in range(begun, k):
                new.bending[m] = scratch[listed[new.other[m]]]
        for o in range(old.start[w], old.start[w + 1]):
            scratch[old.other[o]] = 0.0
    return OK


@inline_kernel
def permute(values: NDArray[np.float64], order: NDArray[np.uint32], scratch: NDArray[np.float64]) -> None:
    """``values[k] = values[order[k]]`` for an array of shape (n,)."""
    for k in range(values.shape[0]):
        scratch[k] = values[order[k]]
    for k in range(values.shape[0]):
        values[k] = scratch[k]


@inline_kernel
def permute_pairs(values: NDArray[np.float64], order: NDArray[np.uint32], scratch: NDArray[np.float64]) -> None:
    """``values[k] = values[order[k]]`` for an array of shape (n, 2), or (0, 2)."""
    for k in range(values.shape[0]):
        scratch[k, 0], scratch[k, 1] = values[order[k], 0], values[order[k], 1]
    for k in range(values.shape[0]):
        values[k, 0], values[k, 1] = scratch[k, 0], scratch[k, 1]


@inline_kernel
def permute_numbers(values: NDArray[np.uint32], order: NDArray[np.uint32], scratch: NDArray[np.float64]) -> None:
    """``values[k] = values[order[k]]`` for whole numbers, which a double holds exactly."""
    for k in range(values.shape[0]):
        scratch[k] = values[order[k]]
    for k in range(values.shape[0]):
        values[k] = np.uint32(scratch[k])


@kernel
def put_in_order(disks: DiskArrays, cells: Cells) -> None:
    """Bring the disks into the order of the cells, so that neighbours in space are neighbours in memory.

    ``disks.listed`` keeps saying which row a disk has in the lists in use, also if a rebuild is begun more than once. Forces and
    torques serve as scratch.
    """
    order, one, two = cells.order, disks.torque, disks.force
    permute_pairs(disks.x, order, two)
    permute_pairs(disks.v, order, two)
    permute_pairs(disks.v_now, order, two)
    permute(disks.angle, order, one)
    permute(disks.omega, order, one)
    permute(disks.radius, order, one)
    permute(disks.omega_now, order, one)
    permute(disks.braked, order, one)
    permute(disks.inv_mass, order, one)
    permute(disks.inv_inertia, order, one)
    permute_numbers(disks.name, order, one)
    permute_numbers(disks.listed, order, one)
    for k in range(order.shape[0]):
        disks.place[disks.name[k]] = k
    # A counting sort is stable: sorted once more, the disks stay where they are.
    nx = int(cells.grid[3])
    for c in range(nx * int(cells.grid[4])):
        for k in range(cells.start[c], cells.start[c + 1]):
            order[k], cells.cell[k] = k, c


@inline_kernel
def stripes_of(rows: int, most: int) -> int:
    """Number of stripes of ``rows`` rows of cells: even and odd ones each share out evenly among 2 threads, many among 3 and 4."""
    count = min((rows + ROWS - 1) // ROWS, most)
    for parts in (24, 8, 4):
        if count >= parts:
            return count - count % parts
    return count


@kernel
def divide(n: int, cells: Cells, team: Team) -> None:
    """Stripes of whole rows of cells with about equally many of the ``n`` disks; one stripe of all where disks are not in order.

    The division depends on the positions alone, never on the number of threads. Only the first row of cells of a stripe has
    partners in the stripe before.
    """
    stripe, border = team.stripe, team.border
    room = stripe.shape[0] - 1
    nx, ny = int(cells.grid[3]), int(cells.grid[4])
    count = stripes_of(ny, room)
    stripe[0], border[0] = 0, 0
    used, begun = 0, 0
    for row in range(1, ny if count > 1 else 0):
        first = cells.start[row * nx]
        enough = row - begun >= ROWS // 2 and first > stripe[used]
        if used < count - 1 and enough and first * count >= (used + 1) * n:
            used, begun = used + 1, row
            stripe[used], border[used] = first, cells.start[(row + 1) * nx]
    for s in range(used + 1, room + 1):
        stripe[s] = n
        if s < room:
            border[s] = n


@inline_kernel
def next_skin(skin: float, steps: int, cost: float, radius: float, least: float, most: float) -> float:
    """Skin for the next lists [m], from how many steps the last ones served.

    A skin ``h`` costs ``b h/R`` a step and disk for the pairs that do not touch, and a rebuild ``c`` every ``h/(2 u)`` steps, with ``u``
    the displacement a step. The sum is least for ``h^2 = 2 u c R/b``, with ``u = h_last/(2 steps)`` and ``cost`` for ``c/b``.

    Parameters
    ----------
    skin : float
        Last skin [m].
    steps : int
        Steps since the last rebuild; 0: keep the skin.
    cost : float
        `REBUILD_COST`, ``c/b``.
    radius, least, most : float
        Mean radius and limits of the skin [m].
    """
    if steps == 0:
        return skin
    best = sqrt(cost * radius * skin / steps)
    return min(max(best, least), most)


@inline_kernel
def mark_built(disks: DiskArrays, walls: WallArrays) -> None:
    """Remember where disks and walls are at the rebuild that just happened; forget forces and torques."""
    for i in range(disks.x.shape[0]):
        disks.built[i, 0], disks.built[i, 1], disks.listed[i] = disks.x[i, 0], disks.x[i, 1], i
        disks.force[i, 0], disks.force[i, 1], disks.torque[i] = 0.0, 0.0, 0.0
    for w in range(walls.now.shape[0]):
        extent = 0.0
        for c in range(9):
            walls.built[w, c] = walls.now[w, c]
        for i in range(disks.x.shape[0]):
            dx, dy = disks.x[i, 0] - walls.now[w, POINT_X], disks.x[i, 1] - walls.now[w, POINT_Y]
            extent = max(extent, dx * dx + dy * dy)
        walls.extent[w] = sqrt(extent)


@inline_kernel
def copy_list(source: NeighbourList, target: NeighbourList) -> None:
    """Copy a freshly built list over the one in use."""
    rows = source.start.shape[0]
    for k in range(rows):
        target.start[k] = source.start[k]
    for k in range(source.start[rows - 1]):
        target.other[k] = source.other[k]
        target.shear[k] = source.shear[k]
    if source.bending.shape[0] > 0:
        for k in range(source.start[rows - 1]):
            target.bending[k] = source.bending[k]
