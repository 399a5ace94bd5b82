"""Kernels of the rebuild: disks into the order of the cells, lists with their shear forces, stripes of the threads."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.neighbour_kernels import (
    NOT_FINITE,
    OK,
    Cells,
    NeighbourList,
    build_pairs,
    build_wall_pairs,
    sort_into_cells,
)
from ninedisk.core.dem.state import DiskArrays, StepConstants, Team, WallArrays


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


ROWS = 4
"""Rows of cells of a stripe: the fewer they are, the more disks lie on borders and move in a pass of their own. A stripe of a crowded
place may have half as many."""


REBUILD_COST = 5.0
"""Cost of a rebuild over that of the pairs out of contact in a step, per disk, with a skin of a mean radius (measured: 70 ns over
2.8 pairs of 5.4 ns)."""


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
def divide(disks: DiskArrays, cells: Cells, team: Team) -> None:
    """Stripes of whole rows of cells with about equally many disks; one stripe of all where disks are not in order.

    The division depends on the positions alone, never on the number of threads. Only the first row of cells of a stripe has
    partners in the stripe before.
    """
    stripe, border = team.stripe, team.border
    n, room = disks.x.shape[0], stripe.shape[0] - 1
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
def next_skin(skin: float, steps: int, step: StepConstants) -> float:
    """Skin for the next lists [m], from how many steps the last ones served.

    A skin ``h`` costs ``b h/R`` a step and disk for the pairs that do not touch, and a rebuild ``c`` every ``h/(2 u)`` steps, with ``u``
    the displacement a step. The sum is least for ``h^2 = 2 u c R/b``, with ``u = h_last/(2 steps)`` and `REBUILD_COST` for ``c/b``.

    Parameters
    ----------
    skin : float
        Last skin [m].
    steps : int
        Steps since the last rebuild; 0: keep the skin.
    step : StepConstants
    """
    if steps == 0:
        return skin
    best = sqrt(REBUILD_COST * step.radius * skin / steps)
    return min(max(best, step.least_skin), step.most_skin)


@inline_kernel
def mark_built(disks: DiskArrays, walls: WallArrays) -> None:
    """Forget displacements, forces and torques; remember the walls of the rebuild that just happened."""
    for i in range(disks.x.shape[0]):
        disks.moved[i, 0], disks.moved[i, 1], disks.listed[i] = 0.0, 0.0, i
        disks.force[i, 0], disks.force[i, 1], disks.torque[i] = 0.0, 0.0, 0.0
    for w in range(walls.now.shape[0]):
        extent = 0.0
        for c in range(9):
            walls.built[w, c] = walls.now[w, c]
        for i in range(disks.x.shape[0]):
            dx, dy = disks.x[i, 0] - walls.now[w, 0], disks.x[i, 1] - walls.now[w, 1]
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


@kernel
def rebuild(
    disks: DiskArrays,
    walls: WallArrays,
    pairs: NeighbourList,
    wall_pairs: NeighbourList,
    spare: NeighbourList,
    wall_spare: NeighbourList,
    cells: Cells,
    team: Team,
    skin: float,
    widest: float,
    in_order: bool,
) -> int:
    """Rebuild both lists, shear forces carried over; on any code but OK the lists in use are untouched.

    Parameters
    ----------
    disks, walls, pairs, wall_pairs, team
        See their classes; forces and torques are zero afterwards.
    spare, wall_spare, cells
        Work arrays.
    skin, widest : float
        Skin of the lists and largest radius [m].
    in_order : bool
        Whether disks are brought into the order of the cells.

    Returns
    -------
    int
        A code of `search_kernels`.
    """
    if not sort_into_cells(disks.x, 2.0 * widest + skin, cells):
        return NOT_FINITE
    if in_order:
        put_in_order(disks, cells)
    for i in range(disks.torque.shape[0]):
        disks.torque[i] = 0.0
    code = build_pairs(disks.x, disks.radius, skin, cells, in_order, disks.listed, pairs, spare)
    if code != OK:
        return code
    code = build_wall_pairs(disks.x, disks.radius, skin, walls.now, disks.listed, disks.torque, wall_pairs, wall_spare)
    if code != OK:
        return code
    copy_list(spare, pairs)
    copy_list(wall_spare, wall_pairs)
    divide(disks, cells, team)
    mark_built(disks, walls)
    return OK
