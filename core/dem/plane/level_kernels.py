"""Kernels of the lists of neighbours of disks of many sizes, with a grid for each level of sizes (`ninedisk.core.dem.levels`)."""

from __future__ import annotations

from math import floor, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.level_kernels import (
    MARGIN,
    box_number,
    first_cell,
    halve_to_fit,
    last_cell,
    level_of,
    merge_stripes,
    set_bases,
    set_shifts,
)
from ninedisk.core.dem.plane.image_kernels import XX, XY, YY, carried
from ninedisk.core.dem.plane.neighbour_kernels import enter_pair, order_by_cell
from ninedisk.core.dem.state import OK, PAIRS_FULL, Cells, Images, Levels, NeighbourList, Team


@kernel
def set_grids(x: NDArray[np.float64], skin: float, cells: Cells, levels: Levels) -> bool:
    """Extents of the grids of all levels, rows along the shorter side; ``cells.grid`` gets those of the finest one, with the rows that
    shifts add. False if a coordinate, or the extent of all, is not finite."""
    low_x, low_y, high_x, high_y = x[0, 0], x[0, 1], x[0, 0], x[0, 1]
    for i in range(x.shape[0]):
        if not (np.isfinite(x[i, 0]) and np.isfinite(x[i, 1])):
            return False
        low_x, high_x = min(low_x, x[i, 0]), max(high_x, x[i, 0])
        low_y, high_y = min(low_y, x[i, 1]), max(high_y, x[i, 1])
    long_x, long_y = high_x - low_x, high_y - low_y
    if not (np.isfinite(long_x) and np.isfinite(long_y)):
        return False
    along = 0 if long_x <= long_y else 1
    low, low_across = (low_x, low_y) if along == 0 else (low_y, low_x)
    long, long_across = (long_x, long_y) if along == 0 else (long_y, long_x)
    levels.axes[0], levels.axes[1] = along, 1 - along
    levels.low[0], levels.low[1] = low, low_across
    for k in range(levels.widest.shape[0]):
        width = 2.0 * levels.widest[k] + skin
        while True:
            columns, rows = floor(long / width) + 1.0, floor(long_across / width) + 1.0
            # The finest cells are those of the order in memory, too.
            behind = set_shifts(levels, width, skin) if k == 0 else 0
            if columns * rows <= levels.room[k] and columns * (rows + behind) <= cells.start.shape[0] - 1:
                break
            width *= 1.25
        levels.width[k], levels.counts[k, 0], levels.counts[k, 1] = width, int(columns), int(rows)
        if k == 0:
            grid = cells.grid
            grid[0], grid[1], grid[2], grid[3], grid[4] = low, low_across, width, columns, rows + behind
    return True


@inline_kernel
def column_of(x: NDArray[np.float64], i: int, levels: Levels, k: int) -> int:
    """Column of a disk in level k."""
    return int((x[i, levels.axes[0]] - levels.low[0]) / levels.width[k])


@inline_kernel
def row_of(x: NDArray[np.float64], i: int, levels: Levels, k: int) -> int:
    """Row of a disk in level k."""
    return int((x[i, levels.axes[1]] - levels.low[1]) / levels.width[k])


@kernel
def sort_for_memory(
    x: NDArray[np.float64], radius: NDArray[np.float64], skin: float, cells: Cells, levels: Levels
) -> bool:
    """Order of the disks in memory: by finest cells as with one level, larger ones shifted behind all that they can touch.

    Returns
    -------
    bool
        False if a coordinate, or the extent of all, is not finite.
    """
    if not set_grids(x, skin, cells, levels):
        return False
    nx = int(cells.grid[3])
    for i in range(x.shape[0]):
        row = row_of(x, i, levels, 0) + levels.shift[level_of(levels, radius[i])]
        cells.cell[i] = row * nx + column_of(x, i, levels, 0)
    order_by_cell(cells, x.shape[0], nx * int(cells.grid[4]))
    return True


@kernel
def sort_into_levels(x: NDArray[np.float64], radius: NDArray[np.float64], levels: Levels) -> None:
    """Counting sort of the disks, each into the grid of its level (`set_grids`)."""
    total = set_bases(levels)
    for i in range(x.shape[0]):
        k = level_of(levels, radius[i])
        levels.cell[i] = box_number(levels, k, column_of(x, i, levels, k), row_of(x, i, levels, k), 0)
    order_by_cell(levels, x.shape[0], total)


@kernel
def build_level_pairs(
    x: NDArray[np.float64],
    radius: NDArray[np.float64],
    skin: float,
    levels: Levels,
    listed: NDArray[np.uint32],
    old: NeighbourList,
    new: NeighbourList,
) -> int:
    """`ninedisk.core.dem.plane.neighbour_kernels.build_pairs` for disks of many sizes.

    Disks are in order (`sort_for_memory`): the larger one of a pair of two levels is behind the smaller.
    """
    k = 0
    new.start[0] = 0
    for i in range(x.shape[0]):
        px, py = x[i, levels.axes[0]] - levels.low[0], x[i, levels.axes[1]] - levels.low[1]
        own = level_of(levels, radius[i])
        for level in range(own, levels.widest.shape[0]):
            width, count = levels.width[level], levels.counts[level]
            reach = radius[i] + levels.widest[level] + skin
            first, last = first_cell(px, reach, width), last_cell(px, reach, width, count[0])
            # The finest rows follow each other as disks do.
            lowest = row_of(x, i, levels, 0) if level == 0 else first_cell(py, reach, width)
            for row in range(lowest, last_cell(py, reach, width, count[1]) + 1):
                at = box_number(levels, level, 0, row, 0)
                for m in range(levels.start[at + first], levels.start[at + last + 1]):
                    j = int(levels.order[m])
                    if level == own and j <= i:
                        continue
                    dx, dy, limit = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], radius[i] + radius[j] + skin
                    if dx * dx + dy * dy < limit * limit:
                        if k == new.other.shape[0]:
                            return PAIRS_FULL
                        enter_pair(i, j, listed, old, new, k)
                        k += 1
        new.start[i + 1] = k
    return OK


@kernel
def fit_stripes(pairs: NeighbourList, team: Team) -> None:
    """Stripes that no pair jumps, of those that rows of cells make, and their borders: what the stripe before touches."""
    merge_stripes(pairs.start, pairs.other, team.stripe)
    stripe, border, far = team.stripe, team.border, -1
    for s in range(border.shape[0]):
        border[s] = min(max(stripe[s], far + 1), stripe[s + 1])
        for k in range(pairs.start[stripe[s]], pairs.start[stripe[s + 1]]):
            far = max(far, int(pairs.other[k]))


@inline_kernel
def place_in_cell(x: NDArray[np.float64], i: int, images: Images, lean: float) -> tuple[float, float]:
    """Shares of the edges along and across by which a disk, put back into a periodic cell, is in it."""
    up = x[i, 1] / images.now[YY]
    return (x[i, 0] - lean * up) / images.now[XX] - images.home[i, 0], up - images.home[i, 1]


@inline_kernel
def column_height(images: Images, lean: float) -> float:
    """Height of a periodic cell over its second edge, which leans by so much [m]."""
    a, b = images.now[XX], images.now[YY]
    return float(a * b / sqrt(b * b + lean * lean))


@kernel
def sort_into_image_levels(
    x: NDArray[np.float64], radius: NDArray[np.float64], skin: float, images: Images, tilt: float, levels: Levels
) -> None:
    """Counting sort of the disks of a periodic cell, each into the grid of its level along the cell's edges.

    `ninedisk.core.dem.plane.image_kernels.sort_into_images` has put them back into the cell and found the tilt.
    """
    lean = images.now[XY] - tilt * images.now[XX]
    height = column_height(images, lean)
    for k in range(levels.widest.shape[0]):
        levels.width[k] = 2.0 * levels.widest[k] + skin
        levels.counts[k, 0] = max(1, int(min(height / levels.width[k], 1e6)))
        levels.counts[k, 1] = max(1, int(min(images.now[YY] / levels.width[k], 1e6)))
        halve_to_fit(levels, k)
    total = set_bases(levels)
    for i in range(x.shape[0]):
        k = level_of(levels, radius[i])
        along, up = place_in_cell(x, i, images, lean)
        columns, rows = levels.counts[k, 0], levels.counts[k, 1]
        column, row = min(int(along * columns), columns - 1), min(int(up * rows), rows - 1)
        levels.cell[i] = box_number(levels, k, column, row, 0)
    order_by_cell(levels, x.shape[0], total)


@kernel
def build_image_level_pairs(
    x: NDArray[np.float64],
    radius: NDArray[np.float64],
    skin: float,
    images: Images,
    tilt: float,
    levels: Levels,
    listed: NDArray[np.uint32],
    old: NeighbourList,
    new: NeighbourList,
) -> int:
    """`ninedisk.core.dem.plane.image_kernels.build_image_pairs` for disks of many sizes.

    The row of a pair of two levels is its smaller disk, whatever their order: all disks are one stripe, which is kicked at the end.
    """
    now, home = images.now, images.home
    lean = now[XY] - tilt * now[XX]
    height, k = column_height(images, lean), 0
    new.start[0] = 0
    for i in range(x.shape[0]):
        own = level_of(levels, radius[i])
        share_along, share_up = place_in_cell(x, i, images, lean)
        for level in range(own, levels.widest.shape[0]):
            nx, ny = levels.counts[level, 0], levels.counts[level, 1]
            reach = radius[i] + levels.widest[level] + skin
            # Places in cells along the edges, and how many cells are within reach.
            px, mx = share_along * nx, reach / height * nx + MARGIN
            py, my = share_up * ny, reach / now[YY] * ny + MARGIN
            for r in range(floor(py - my), floor(py + my) + 1):
                up = r // ny
                for c in range(floor(px - mx), floor(px + mx) + 1):
                    aside = c // nx
                    at = box_number(levels, level, c - aside * nx, r - up * ny, 0)
                    for m in range(levels.start[at], levels.start[at + 1]):
                        j = int(levels.order[m])
                        across = up + home[i, 1] - home[j, 1]
                        along = aside + home[i, 0] - home[j, 0] - tilt * across
                        beyond = across > 0.0 or (across == 0.0 and along > 0.0)
                        if level == own and (j < i or (j == i and not beyond)):
                            continue
                        dx = x[j, 0] - x[i, 0] + (now[XX] * along + now[XY] * across)
                        dy = x[j, 1] - x[i, 1] + now[YY] * across
                        limit = radius[i] + radius[j] + skin
                        if dx * dx + dy * dy < limit * limit:
                            if k == new.other.shape[0]:
                                return PAIRS_FULL
                            new.other[k] = j
                            images.spare[2 * k], images.spare[2 * k + 1] = along, across
                            new.shear[k] = carried(old, images.shift, int(listed[i]), int(listed[j]), along, across)
                            k += 1
        new.start[i + 1] = k
    return OK
