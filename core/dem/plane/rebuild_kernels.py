"""Kernels of a rebuild of the lists of disks, with and without images, with one grid or one for each level of sizes."""

from __future__ import annotations

from ninedisk.core.compile import kernel
from ninedisk.core.dem.plane.image_kernels import build_image_pairs, close_ring, sort_into_images
from ninedisk.core.dem.plane.level_kernels import (
    build_image_level_pairs,
    build_level_pairs,
    fit_stripes,
    sort_for_memory,
    sort_into_image_levels,
    sort_into_levels,
)
from ninedisk.core.dem.plane.neighbour_kernels import (
    build_pairs,
    build_wall_pairs,
    copy_list,
    divide,
    mark_built,
    put_in_order,
    sort_into_cells,
)
from ninedisk.core.dem.state import (
    NOT_FINITE,
    OK,
    DiskArrays,
    Images,
    Lists,
    StepConstants,
    Team,
    WallArrays,
)


@kernel
def rebuild(disks: DiskArrays, walls: WallArrays, lists: Lists, team: Team, step: StepConstants, skin: float) -> int:
    """Rebuild both lists with this skin [m], their history carried over; forces and torques are zero afterwards.

    Returns
    -------
    int
        OK, PAIRS_FULL, WALL_PAIRS_FULL or NOT_FINITE; on any but OK the lists in use are untouched.
    """
    pairs, wall_pairs, spare, wall_spare, cells, levels = lists
    mixed = levels.widest.shape[0] > 0
    if not (
        sort_for_memory(disks.x, disks.radius, skin, cells, levels)
        if mixed
        else sort_into_cells(disks.x, 2.0 * step.widest + skin, cells)
    ):
        return NOT_FINITE
    if step.sorted:
        put_in_order(disks, cells)
    for i in range(disks.torque.shape[0]):
        disks.torque[i] = 0.0
    if mixed:
        sort_into_levels(disks.x, disks.radius, levels)
        code = build_level_pairs(disks.x, disks.radius, skin, levels, disks.listed, pairs, spare)
    else:
        code = build_pairs(disks.x, disks.radius, skin, cells, step.sorted, disks.listed, pairs, spare)
    if code != OK:
        return code
    code = build_wall_pairs(disks.x, disks.radius, skin, walls.now, disks.listed, disks.torque, wall_pairs, wall_spare)
    if code != OK:
        return code
    copy_list(spare, pairs)
    copy_list(wall_spare, wall_pairs)
    divide(disks.x.shape[0], cells, team)
    if mixed:
        fit_stripes(pairs, team)
    mark_built(disks, walls)
    return OK


@kernel
def rebuild_images(
    disks: DiskArrays,
    walls: WallArrays,
    lists: Lists,
    images: Images,
    team: Team,
    step: StepConstants,
    skin: float,
) -> int:
    """Rebuild the list of pairs with this skin [m] as `rebuild` does, with images; there are no walls."""
    pairs, spare, cells, levels = lists.pairs, lists.spare, lists.cells, lists.levels
    mixed = levels.widest.shape[0] > 0
    # With levels these cells are those of the order in memory only.
    if not sort_into_images(disks.x, 2.0 * (levels.widest[0] if mixed else step.widest) + skin, images, cells):
        return NOT_FINITE
    if step.sorted:
        for k in range(disks.x.shape[0]):
            disks.force[k, 0], disks.force[k, 1] = images.home[cells.order[k], 0], images.home[cells.order[k], 1]
        for k in range(disks.x.shape[0]):
            images.home[k, 0], images.home[k, 1] = disks.force[k, 0], disks.force[k, 1]
        put_in_order(disks, cells)
    if mixed:
        sort_into_image_levels(disks.x, disks.radius, skin, images, cells.grid[0], levels)
        code = build_image_level_pairs(
            disks.x, disks.radius, skin, images, cells.grid[0], levels, disks.listed, pairs, spare
        )
    else:
        code = build_image_pairs(disks.x, disks.radius, skin, images, cells, step.sorted, disks.listed, pairs, spare)
    if code != OK:
        return code
    copy_list(spare, pairs)
    for k in range(2 * spare.start[disks.x.shape[0]]):
        images.shift[k] = images.spare[k]
    for c in range(3):
        images.built[c] = images.now[c]
    divide(disks.x.shape[0], cells, team)
    close_ring(disks, cells, team, mixed)
    mark_built(disks, walls)
    return OK
