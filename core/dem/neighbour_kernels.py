"""Kernels of the contact search: cell list, half neighbour list with a skin, lists of disks near walls.

The neighbour list is stored by rows: the neighbours ``j > i`` of disk ``i`` are ``other[start[i]:start[i+1]]``, beside
each the shear force of that contact. Lists are built in the order of the disks, so the same input gives the same bits.
"""

from __future__ import annotations

from math import floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import kernel

OK, PAIRS_FULL, WALL_PAIRS_FULL, NOT_FINITE = 0, 1, 2, 3


class NeighbourList(NamedTuple):
    """Pairs closer than the skin, by rows.

    Attributes
    ----------
    start : ndarray of int32, shape (rows + 1,)
        Row pointers; a row is a disk (disk-disk list) or a wall (wall list).
    other : ndarray of uint32, shape (capacity,)
        The other disk of each pair.
    shear : ndarray, shape (capacity,)
        Shear force ``fs`` [N] on the row's body (disk-disk list) or on the disk (wall list).
    """

    start: NDArray[np.int32]
    other: NDArray[np.uint32]
    shear: NDArray[np.float64]


class Cells(NamedTuple):
    """Work arrays of the cell list.

    Attributes
    ----------
    start : ndarray of int32, shape (cells + 1,)
    order : ndarray of uint32, shape (n,)
        Disks sorted by cell, row by row. Rows lie along the shorter side of the box around the centres: the next row is then not far
        away in memory.
    cell : ndarray of int32, shape (n,)
        Cell of each disk.
    grid : ndarray, shape (5,)
        Lower corner [m] along and across the rows, width of a cell [m], cells of a row, rows.
    """

    start: NDArray[np.int32]
    order: NDArray[np.uint32]
    cell: NDArray[np.int32]
    grid: NDArray[np.float64]


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
    nx, count = int(columns), int(columns * rows)
    for c in range(count + 1):
        cells.start[c] = 0
    for i in range(n):
        c = int((x[i, across] - low_b) / width) * nx + int((x[i, along] - low_a) / width)
        cells.cell[i] = c
        cells.start[c + 1] += 1
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
    return True


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
    """Half neighbour list of all pairs with a gap below ``skin``; shear forces of the old list are carried over.

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
        Row that each disk had in ``old``. A shear force is the same number seen from either disk.
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
                    new.other[k] = j
                    new.shear[k] = 0.0
                    a, b = min(listed[i], listed[j]), max(listed[i], listed[j])
                    for o in range(old.start[a], old.start[a + 1]):
                        if old.other[o] == b:
                            new.shear[k] = old.shear[o]
                            break
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
    """Lists of the disks with a gap below ``skin`` to each wall; shear forces of the old lists are carried over.

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
    new.start[0] = 0
    for w in range(wall.shape[0]):
        for o in range(old.start[w], old.start[w + 1]):
            scratch[old.other[o]] = old.shear[o]
        px, py, nx, ny = wall[w, 0], wall[w, 1], wall[w, 2], wall[w, 3]
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
        for o in range(old.start[w], old.start[w + 1]):
            scratch[old.other[o]] = 0.0
    return OK
