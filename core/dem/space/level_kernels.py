"""Kernels of the lists of neighbours of spheres of many sizes, with a grid for each level of sizes (`ninedisk.core.dem.levels`)."""

from __future__ import annotations

from math import floor

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
from ninedisk.core.dem.plane.neighbour_kernels import next_skin, order_by_cell
from ninedisk.core.dem.space.image_kernels import (
    beyond_skin,
    enter_image,
    face_distances,
    is_listed_image,
    solved,
)
from ninedisk.core.dem.space.neighbour_kernels import (
    IN_LAYER,
    IN_ROW,
    LAYERS,
    REBUILD_COST,
    Materials,
    axes_of,
    box_around,
    divide,
    enter_pair,
    put_in_order,
)
from ninedisk.core.dem.space.registers import WIDE
from ninedisk.core.dem.space.state import Contacts, Floats, Images, Integers, State
from ninedisk.core.dem.state import Cells, Levels


@inline_kernel
def cells_along(length: float, width: float) -> float:
    """Cells of this width along a side [m]."""
    return floor(length / width) + 1.0


@kernel
def sort_for_memory(x: Floats, radius: Floats, skin: float, cells: Cells, levels: Levels) -> bool:
    """Order of the spheres in memory: by finest cells as with one level, larger ones shifted behind all that they can touch.

    The grids of all levels get their extents; ``cells.grid`` those of the finest one, with the layers that shifts add.

    Returns
    -------
    bool
        False if a coordinate, or the extent of all, is not finite.
    """
    n = cells.cell.shape[0]
    finite, low, long = box_around(x, n)
    if not finite:
        return False
    wide, deep, high = axes_of(long)
    levels.axes[0], levels.axes[1], levels.axes[2] = wide, deep, high
    for c in range(3):
        levels.low[c] = low[levels.axes[c]]
    for k in range(levels.widest.shape[0]):
        width, room = 2.0 * levels.widest[k] + skin, levels.room[k]
        while True:
            nx, ny, nz = cells_along(long[wide], width), cells_along(long[deep], width), cells_along(long[high], width)
            # The finest cells are those of the order in memory, too.
            behind = set_shifts(levels, width, skin) if k == 0 else 0
            if nx * ny * nz <= room and nx * ny * (nz + behind) <= cells.start.shape[0] - 1:
                break
            width *= 1.25
        levels.width[k] = width
        levels.counts[k, 0], levels.counts[k, 1], levels.counts[k, 2] = int(nx), int(ny), int(nz)
        if k == 0:
            cells.grid[IN_LAYER], cells.grid[LAYERS], cells.grid[IN_ROW] = nx * ny, nz + behind, nx
    width, nx, ny = levels.width[0], levels.counts[0, 0], levels.counts[0, 1]
    for i in range(n):
        layer = int((x[WIDE * i + high] - low[high]) / width) + levels.shift[level_of(levels, radius[i])]
        line = int((x[WIDE * i + deep] - low[deep]) / width)
        cells.cell[i] = (layer * ny + line) * nx + int((x[WIDE * i + wide] - low[wide]) / width)
    order_by_cell(cells, n, int(cells.grid[IN_LAYER] * cells.grid[LAYERS]))
    return True


@kernel
def sort_into_levels(x: Floats, radius: Floats, levels: Levels) -> None:
    """Counting sort of the spheres, each into the grid of its level (`sort_for_memory` has set the grids)."""
    total = set_bases(levels)
    axes, low = levels.axes, levels.low
    for i in range(radius.shape[0]):
        k = level_of(levels, radius[i])
        width, q = levels.width[k], WIDE * i
        a = int((x[q + axes[0]] - low[0]) / width)
        b, c = int((x[q + axes[1]] - low[1]) / width), int((x[q + axes[2]] - low[2]) / width)
        levels.cell[i] = box_number(levels, k, a, b, c)
    order_by_cell(levels, radius.shape[0], total)


@kernel
def begin_level_lists(
    state: State,
    listed: Integers,
    cells: Cells,
    levels: Levels,
    stripe: Integers,
    skin: float,
    steps: int,
    sizes: tuple[float, float, float, float],
) -> float:
    """`ninedisk.core.dem.space.neighbour_kernels.begin_lists` for spheres of many sizes, which are always kept in order.

    Stripes are those of layers; pairs may jump them until `merge_stripes`.
    """
    mean, _, least, most = sizes
    skin = next_skin(skin, steps, REBUILD_COST, mean, least, most)
    if not sort_for_memory(state.x, state.radius, skin, cells, levels):
        return -1.0
    put_in_order(state, listed, cells)
    for q in range(state.built.shape[0]):
        state.built[q] = state.x[q]
    divide(state.radius.shape[0], cells, stripe)
    sort_into_levels(state.x, state.radius, levels)
    return skin


@kernel
def list_level_pairs(
    state: State,
    listed: Integers,
    levels: Levels,
    materials: Materials,
    laws: Floats,
    skin: float,
    stripe: Integers,
    old: Contacts,
    new: Contacts,
) -> bool:
    """List all pairs of spheres with a gap below ``skin`` [m], with the memory of the old list; False if ``new`` is too small.

    A sphere's partners are those behind it in memory: of its own level, and all of larger ones.
    """
    x, radius, name = state.x, state.radius, state.name
    ax, ay, az = levels.axes[0], levels.axes[1], levels.axes[2]
    room, k = new.other.shape[0], 0
    new.start[0] = 0
    for i in range(radius.shape[0]):
        q = WIDE * i
        px, py, pz = x[q + ax] - levels.low[0], x[q + ay] - levels.low[1], x[q + az] - levels.low[2]
        own = level_of(levels, radius[i])
        for level in range(own, levels.widest.shape[0]):
            width, count = levels.width[level], levels.counts[level]
            reach = radius[i] + levels.widest[level] + skin
            first, last = first_cell(px, reach, width), last_cell(px, reach, width, count[0])
            # The finest cells follow each other as spheres do in memory.
            forward = level == 0
            layer, line = int(pz / width), int(py / width)
            for c in range(
                layer if forward else first_cell(pz, reach, width), last_cell(pz, reach, width, count[2]) + 1
            ):
                lowest = line if forward and c == layer else first_cell(py, reach, width)
                for b in range(lowest, last_cell(py, reach, width, count[1]) + 1):
                    at = box_number(levels, level, 0, b, c)
                    for m in range(levels.start[at + first], levels.start[at + last + 1]):
                        j = int(levels.order[m])
                        if level == own and j <= i:
                            continue
                        dx, dy, dz = (
                            x[WIDE * j] - x[q],
                            x[WIDE * j + 1] - x[q + 1],
                            x[WIDE * j + 2] - x[q + 2],
                        )
                        limit = radius[i] + radius[j] + skin
                        if dx * dx + dy * dy + dz * dz >= limit * limit:
                            continue
                        if materials.fixed[name[i]] and materials.fixed[name[j]]:
                            continue
                        if k == room:
                            return False
                        enter_pair(state, listed, materials, laws, i, j, old, new, k)
                        k += 1
        new.start[i + 1] = k
    merge_stripes(new.start, new.other, stripe)
    return True


@kernel
def sort_into_image_levels(state: State, images: Images, skin: float, levels: Levels) -> bool:
    """Put the spheres of a periodic cell into boxes along its edges, each into those of its level; False if a position is not finite."""
    h, apart = images.now, images.scratch
    face_distances(h, apart)
    for k in range(levels.widest.shape[0]):
        levels.width[k] = 2.0 * levels.widest[k] + skin
        for c in range(3):
            levels.counts[k, c] = max(1, int(min(apart[c] / levels.width[k], 1e6)))
        halve_to_fit(levels, k)
    total = set_bases(levels)
    for i in range(state.radius.shape[0]):
        k = level_of(levels, state.radius[i])
        f = solved(h, state.x[WIDE * i], state.x[WIDE * i + 1], state.x[WIDE * i + 2])
        box = 0
        for c in range(3):
            if not abs(f[2 - c]) < 1e15:
                return False
            home, count = floor(f[2 - c]), levels.counts[k, 2 - c]
            images.home[i, 2 - c] = home
            box = box * count + min(int((f[2 - c] - home) * count), count - 1)
        levels.cell[i] = levels.base[k] + box
    order_by_cell(levels, state.radius.shape[0], total)
    return True


@kernel
def list_image_levels(
    state: State,
    images: Images,
    levels: Levels,
    materials: Materials,
    laws: Floats,
    skin: float,
    old: Contacts,
    new: Contacts,
) -> bool:
    """`ninedisk.core.dem.space.image_kernels.list_images` for spheres of many sizes.

    The row of a pair of two levels is its smaller sphere.
    """
    radius, h, home, shift = state.radius, images.now, images.home, images.scratch
    face_distances(h, shift)
    apart_x, apart_y, apart_z = shift[0], shift[1], shift[2]
    room, k = new.other.shape[0], 0
    new.start[0] = 0
    for i in range(radius.shape[0]):
        f = solved(h, state.x[WIDE * i], state.x[WIDE * i + 1], state.x[WIDE * i + 2])
        fx, fy, fz = f[0] - home[i, 0], f[1] - home[i, 1], f[2] - home[i, 2]
        own = level_of(levels, radius[i])
        for level in range(own, levels.widest.shape[0]):
            reach, count = radius[i] + levels.widest[level] + skin, levels.counts[level]
            nx, ny, nz = count[0], count[1], count[2]
            # Places in boxes along the edges, and how many boxes are within reach.
            px, py, pz = fx * nx, fy * ny, fz * nz
            mx, my, mz = (
                reach / apart_x * nx + MARGIN,
                reach / apart_y * ny + MARGIN,
                reach / apart_z * nz + MARGIN,
            )
            for bz in range(floor(pz - mz), floor(pz + mz) + 1):
                for by in range(floor(py - my), floor(py + my) + 1):
                    for bx in range(floor(px - mx), floor(px + mx) + 1):
                        az, ay, ax = bz // nz, by // ny, bx // nx
                        at = box_number(levels, level, bx - ax * nx, by - ay * ny, bz - az * nz)
                        for m in range(levels.start[at], levels.start[at + 1]):
                            j = int(levels.order[m])
                            if level == own and j < i:
                                continue
                            shift[0] = ax - home[j, 0] + home[i, 0]
                            shift[1] = ay - home[j, 1] + home[i, 1]
                            shift[2] = az - home[j, 2] + home[i, 2]
                            if i == j and not is_listed_image(shift):
                                continue
                            if beyond_skin(state, h, shift, i, j, skin) or (materials.fixed[i] and materials.fixed[j]):
                                continue
                            if k == room:
                                return False
                            enter_image(state, materials, laws, shift, i, j, old, new, k)
                            k += 1
        new.start[i + 1] = k
    return True
