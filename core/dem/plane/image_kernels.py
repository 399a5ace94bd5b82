"""Kernels of a periodic cell: images of disks, their contacts, the stress, the work of the deforming cell.

The edges are the columns of ``h(t) = (I + t rate) diag(size)``, upper triangular as ``rate`` is. Positions ``x`` are those of one and the
same image throughout. A listed pair carries whole numbers ``s``: its contact is that of disk ``i`` and of the image of disk ``j`` that lies
``h s`` away from ``x_j`` and moves faster by ``h' s``. So ``d = x_j - x_i + h s`` and ``d' = v_j - v_i + h' s`` (Lees & Edwards,
J. Phys. C 5 (1972) 1921), nothing else differs from disks without images, and no velocity ever jumps. As ``h`` is linear in time,
``h' s`` is its change at every time of a step. ``s`` stays the same while disks wander off through whatever edges.

Stress, compression positive: ``A sigma = -sum g (x) d`` over the contacts, with the force ``g`` on ``i``, and ``sum m v' (x) v'`` over the
disks, with ``v' = v - L x`` beside the affine flow ``L = h' h^-1``, the same for each image, less its mean by mass.
Work: images feed ``g.(h' s)``.
"""

from __future__ import annotations

from math import ceil, floor, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_inline_kernel, fused_kernel, inline_kernel, kernel
from ninedisk.core.dem.plane.force_kernels import (
    CHUNK,
    DASHPOT_X,
    DASHPOT_Y,
    DX,
    DY,
    GX,
    GY,
    SCRATCH,
    VX,
    VY,
    Index,
    gather,
    gather_dashpots,
    normal_force,
    pair_forces_extrapolated,
    pair_forces_lagged,
    scatter,
)
from ninedisk.core.dem.plane.kick_kernels import farther
from ninedisk.core.dem.plane.sample_kernels import synchronised_part
from ninedisk.core.dem.state import (
    BETA,
    KN,
    KS,
    OK,
    PAIRS_FULL,
    Cells,
    DiskArrays,
    Images,
    NeighbourList,
    Samples,
    System,
    Team,
    Views,
)

XX, XY, YY, RATE_XX, RATE_XY, RATE_YY = range(6)
"""Entries of `Images.now`: ``h`` at ``t_n`` [m] and ``h'`` [m/s]."""

POWER = 4
"""Entry of a share that is the power of the images [W], after ``sum g (x) d`` row by row [N m]."""

BRANCH_X, BRANCH_Y, MOVE_X, MOVE_Y = (np.uint64(SCRATCH + c * CHUNK) for c in range(4))
"""Where the scratch holds, for each pair, ``d`` and ``h' s``."""

CELL_SCRATCH = SCRATCH + 4 * CHUNK

ROUND_OFF = 8.881784197001252e-16
"""Of a coordinate, eight roundings: four in ``x - F x_b``, and those of ``F`` and of half a pair's distance."""


@inline_kernel
def edges_at(images: Images, t: float) -> tuple[float, float, float]:
    """The entries xx, xy, yy of ``h`` [m] at time ``t`` [s]."""
    size, now = images.size, images.now
    return size[0] + t * now[RATE_XX], t * now[RATE_XY], size[1] + t * now[RATE_YY]


@inline_kernel
def flow_at(images: Images, t: float) -> tuple[float, float, float]:
    """The entries xx, xy, yy of ``L = h' h^-1`` [1/s] at time ``t`` [s]."""
    now = images.now
    xx, xy, yy = edges_at(images, t)
    along = now[RATE_XX] / xx
    return along, (now[RATE_XY] - along * xy) / yy, now[RATE_YY] / yy


@kernel
def place_cell(images: Images, t: float) -> None:
    """Edges at time ``t`` [s]."""
    images.now[XX], images.now[XY], images.now[YY] = edges_at(images, t)


@inline_kernel
def displacement_limit(images: Images, skin: float, widest: float) -> float:
    """Bound on a disk's displacement from the flow since the last rebuild, up to which the lists are complete [m]; <= 0: none.

    With ``F = h h_b^-1`` and ``u = x - F x_b`` a pair is ``d = F d_b + u_j - u_i`` apart, whichever image. A pair that is not listed was
    at least ``2 R + skin`` away, so it cannot touch while ``2 u <= (1 - f)(2 R + skin) - 2 R`` with ``f = |F - I|``.
    """
    now, built = images.now, images.built
    xx, yy = now[XX] / built[XX], now[YY] / built[YY]
    xy = (now[XY] - xx * built[XY]) / built[YY]
    f = sqrt((xx - 1.0) * (xx - 1.0) + xy * xy + (yy - 1.0) * (yy - 1.0))
    return 0.5 * ((1.0 - f) * skin - f * 2.0 * widest)


@inline_kernel
def beside_flow(views: Views, images: Images, t: float, begin: int, end: int) -> float:
    """Largest square of ``u = x - F x_b`` (`displacement_limit`) of the disks ``begin .. end-1`` at time ``t`` [m^2]; NaN if any is NaN.

    Rounding of u, and of the distances that contacts have across images, is added to it. The edges are not taken from ``images.now``: one
    thread may still be here while another one places the cell of the next step.
    """
    x, built = views.x, views.built
    xx, xy, yy = edges_at(images, t)
    xx, yy = xx / images.built[XX], yy / images.built[YY]
    xy = (xy - xx * images.built[XY]) / images.built[YY]
    far, one = 0.0, np.uint64(1)
    for i in range(np.uint64(begin), np.uint64(end)):
        ix, iy = i + i, i + i + one
        mx, my = x[ix] - (xx * built[ix] + xy * built[iy]), x[iy] - yy * built[iy]
        u = sqrt(mx * mx + my * my) + ROUND_OFF * (abs(x[ix]) + abs(x[iy]))
        far = farther(far, u * u)
    return far


@kernel
def sort_into_images(x: NDArray[np.float64], width: float, images: Images, cells: Cells) -> bool:
    """Counting sort of the disks, each put back into the cell, into a grid along the cell's edges.

    The second edge is that of the lattice of images with the least tilt: ``e_2 - tilt e_1``.

    Parameters
    ----------
    x : ndarray, shape (n, 2)
        Centres [m].
    width : float
        Smallest height of a grid cell [m]; where the periodic cell is lower, as many as are in reach are stored in the grid.
    images : Images
        ``now`` is read; ``home`` is written: whole edges by which each disk is out of the cell, of the lattice of least tilt.
    cells : Cells
        Out; ``grid`` holds the tilt, the grid cells in reach along and across, and those along and across.

    Returns
    -------
    bool
        False if a coordinate is not finite.
    """
    a, b = images.now[XX], images.now[YY]
    tilt = floor(images.now[XY] / a + 0.5)
    lean = images.now[XY] - tilt * a
    height = a * b / sqrt(b * b + lean * lean)
    room, wanted = cells.start.shape[0] - 1, width
    columns, rows = max(floor(height / wanted), 1.0), max(floor(b / wanted), 1.0)
    while columns * rows > room:
        wanted *= 1.5
        columns, rows = max(floor(height / wanted), 1.0), max(floor(b / wanted), 1.0)
    grid = cells.grid
    grid[0], grid[1], grid[2] = tilt, ceil(width * columns / height), ceil(width * rows / b)
    grid[3], grid[4] = columns, rows
    nx, ny = int(columns), int(rows)
    for c in range(nx * ny + 1):
        cells.start[c] = 0
    for i in range(x.shape[0]):
        up = x[i, 1] / b
        along = (x[i, 0] - lean * up) / a
        if not (np.isfinite(up) and np.isfinite(along)):
            return False
        images.home[i, 0], images.home[i, 1] = floor(along), floor(up)
        column = min(int((along - images.home[i, 0]) * columns), nx - 1)
        row = min(int((up - images.home[i, 1]) * rows), ny - 1)
        cells.cell[i] = row * nx + column
        cells.start[row * nx + column + 1] += 1
    for c in range(nx * ny):
        cells.start[c + 1] += cells.start[c]
    # The pointers serve as cursors while filling and are shifted back afterwards.
    for i in range(x.shape[0]):
        c = cells.cell[i]
        cells.order[cells.start[c]] = i
        cells.start[c] += 1
    for c in range(nx * ny, 0, -1):
        cells.start[c] = cells.start[c - 1]
    cells.start[0] = 0
    return True


@inline_kernel
def shear_of(
    pairs: NeighbourList, shift: NDArray[np.float64], a: int, b: int, along: float, across: float
) -> tuple[bool, float]:
    """Whether the contact of row ``a`` and the image of ``b`` is listed in that row, and its shear force [N]."""
    for k in range(pairs.start[a], pairs.start[a + 1]):
        if pairs.other[k] == b and shift[2 * k] == along and shift[2 * k + 1] == across:
            return True, float(pairs.shear[k])
    return False, 0.0


@inline_kernel
def carried(pairs: NeighbourList, shift: NDArray[np.float64], a: int, b: int, along: float, across: float) -> float:
    """Shear force [N] of a contact, from whichever of its two disks is the row; 0 if it is not listed."""
    listed, shear = shear_of(pairs, shift, a, b, along, across)
    if not listed:
        listed, shear = shear_of(pairs, shift, b, a, -along, -across)
    return shear


@kernel
def build_image_pairs(
    x: NDArray[np.float64],
    radius: NDArray[np.float64],
    skin: float,
    images: Images,
    cells: Cells,
    in_order: bool,
    listed: NDArray[np.uint32],
    old: NeighbourList,
    new: NeighbourList,
) -> int:
    """Half neighbour list of all pairs of a disk and an image with a gap below ``skin``; shear forces of the old list are carried over.

    Any number of images of one disk may be in reach, also of the disk itself. A pair is listed by its disk with the smaller number;
    where disks are in order, and the pair lies across the cell's upper edge, by the disk below the edge: then it is one of the last row
    of the grid and one of the first, and stripes of rows form a ring.

    Parameters and result are those of `neighbour_kernels.build_pairs`; ``images.spare`` is written beside ``new``.
    """
    now, home = images.now, images.home
    tilt, wide, high = cells.grid[0], int(cells.grid[1]), int(cells.grid[2])
    nx, ny = int(cells.grid[3]), int(cells.grid[4])
    capacity, k = new.other.shape[0], 0
    new.start[0] = 0
    for i in range(x.shape[0]):
        row, column = cells.cell[i] // nx, cells.cell[i] % nx
        for r in range(row if in_order else row - high, row + high + 1):
            up = r // ny
            for c in range(column - wide, column + wide + 1):
                aside = c // nx
                at = (r - up * ny) * nx + c - aside * nx
                for m in range(cells.start[at], cells.start[at + 1]):
                    j = int(cells.order[m])
                    across = up + home[i, 1] - home[j, 1]
                    along = aside + home[i, 0] - home[j, 0] - tilt * across
                    later = j > i or (j == i and (across > 0.0 or (across == 0.0 and along > 0.0)))
                    if in_order and up > 0:
                        later = True
                    if not later:
                        continue
                    dx = x[j, 0] - x[i, 0] + (now[XX] * along + now[XY] * across)
                    dy = x[j, 1] - x[i, 1] + now[YY] * across
                    limit = radius[i] + radius[j] + skin
                    if dx * dx + dy * dy < limit * limit:
                        if k == capacity:
                            return PAIRS_FULL
                        new.other[k] = j
                        images.spare[2 * k], images.spare[2 * k + 1] = along, across
                        new.shear[k] = carried(old, images.shift, int(listed[i]), int(listed[j]), along, across)
                        k += 1
        new.start[i + 1] = k
    return OK


@inline_kernel
def close_ring(disks: DiskArrays, cells: Cells, team: Team, mixed: bool) -> None:
    """Make the stripes a ring, each of which touches no further than the next: an even number of them, or one, as for ``mixed`` sizes.

    The first row of the grid is then the border of the first stripe, too; a single stripe is all border.
    """
    stripe, border = team.stripe, team.border
    n, used = disks.x.shape[0], 0
    while used < stripe.shape[0] - 1 and stripe[used + 1] > stripe[used]:
        used += 1
    if used < 2 or mixed or cells.grid[2] > 1.0:
        used = 1
    elif used % 2 == 1:
        used -= 1
    for s in range(used, stripe.shape[0]):
        stripe[s] = n
        if s < stripe.shape[0] - 1:
            border[s] = n
    border[0] = n if used == 1 else cells.start[int(cells.grid[3])]


@fused_inline_kernel
def gather_images(images: Images, begin: Index, end: Index, scratch: NDArray[np.float64]) -> None:
    """Put the images of the pairs ``begin .. end-1`` into their differences in the scratch; ``d`` and ``h' s`` beside them."""
    shift, now = images.shift, images.now
    xx, xy, yy = now[XX], now[XY], now[YY]
    rate_xx, rate_xy, rate_yy = now[RATE_XX], now[RATE_XY], now[RATE_YY]
    one = np.uint64(1)
    for k in range(begin, end):
        q, along, across = k - begin, shift[k + k], shift[k + k + one]
        bx = scratch[DX + q] + (xx * along + xy * across)
        by = scratch[DY + q] + yy * across
        mx, my = rate_xx * along + rate_xy * across, rate_yy * across
        scratch[DX + q], scratch[DY + q], scratch[BRANCH_X + q], scratch[BRANCH_Y + q] = bx, by, bx, by
        scratch[VX + q] -= mx
        scratch[VY + q] -= my
        scratch[MOVE_X + q], scratch[MOVE_Y + q] = mx, my


@fused_inline_kernel
def gather_image_dashpots(begin: Index, end: Index, scratch: NDArray[np.float64]) -> None:
    """Put the motion of the images into the velocities that dashpots see."""
    for q in range(end - begin):
        scratch[DASHPOT_X + q] -= scratch[MOVE_X + q]
        scratch[DASHPOT_Y + q] -= scratch[MOVE_Y + q]


@fused_inline_kernel
def add_shares(share: NDArray[np.float64], begin: Index, end: Index, scratch: NDArray[np.float64]) -> None:
    """Add what the pairs ``begin .. end-1`` contribute to ``sum g (x) d`` and to the images' power."""
    xx, xy, yx, yy, power = 0.0, 0.0, 0.0, 0.0, 0.0
    for q in range(end - begin):
        gx, gy, bx, by = scratch[GX + q], scratch[GY + q], scratch[BRANCH_X + q], scratch[BRANCH_Y + q]
        xx += gx * bx
        xy += gx * by
        yx += gy * bx
        yy += gy * by
        power += gx * scratch[MOVE_X + q] + gy * scratch[MOVE_Y + q]
    share[0] += xx
    share[1] += xy
    share[2] += yx
    share[3] += yy
    share[POWER] += power


@fused_kernel
def image_forces(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    images: Images,
    law: NDArray[np.float64],
    slip_dt: float,
    begin: int,
    end: int,
    scratch: NDArray[np.float64],
    stripe: int,
) -> None:
    """Add the forces of the contacts of disks and images in some rows; update shear forces, add to this stripe's share of the stress.

    Parameters are those of `force_kernels.disk_disk_forces`, ``scratch`` of shape (CELL_SCRATCH,).
    """
    chunk = np.uint64(CHUNK)
    extrapolated = disks.v_now.shape[0] > 0
    last = np.uint64(pairs.start[end])
    for low in range(np.uint64(pairs.start[begin]), last, chunk):
        high = min(low + chunk, last)
        gather(disks, views, pairs, None, low, high, scratch)
        gather_images(images, low, high, scratch)
        if extrapolated:
            gather_dashpots(disks, views, pairs, None, low, high, scratch)
            gather_image_dashpots(low, high, scratch)
            pair_forces_extrapolated(pairs, views.damping, law, None, None, slip_dt, 0.0, low, high, scratch)
        else:
            pair_forces_lagged(pairs, views.damping, law, None, None, slip_dt, 0.0, low, high, scratch)
        add_shares(images.share[stripe], low, high, scratch)
        scatter(disks, views, pairs, None, None, stripe, low, high, scratch)


@inline_kernel
def clear_image_share(images: Images, stripe: int) -> None:
    """Begin a new sum of the stripe's share."""
    for c in range(POWER + 1):
        images.share[stripe, c] = 0.0


@inline_kernel
def gather_shares(images: Images, dt: float) -> None:
    """Sum the shares in the order of the stripes; add the work of the images in the last step, by the trapezoidal rule."""
    before = images.load[POWER]
    for c in range(POWER + 1):
        total = 0.0
        for s in range(images.share.shape[0]):
            total += images.share[s, c]
        images.load[c] = total
    images.work[0] += 0.5 * dt * (images.load[POWER] + before)


@inline_kernel
def nearest_image(
    disks: DiskArrays, now: NDArray[np.float64], i: int, j: int
) -> tuple[float, float, float, float, float]:
    """Squared distance [m^2] from the disk in row i to the nearest image of the one in row j, ``d``, and ``s``.

    In the lattice of least tilt the nearest image is beside the one that rounding finds, or is that one.
    """
    a, b = now[XX], now[YY]
    tilt = floor(now[XY] / a + 0.5)
    lean = now[XY] - tilt * a
    x, y = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
    q0 = -floor(y / b + 0.5)
    p0 = -floor((x - lean * (y / b)) / a + 0.5)
    best, best_x, best_y, best_along, best_across = np.inf, 0.0, 0.0, 0.0, 0.0
    for dq in range(-1, 2):
        for dp in range(-1, 2):
            across = q0 + dq
            along = p0 + dp - tilt * across
            dx, dy = x + (a * along + now[XY] * across), y + b * across
            if dx * dx + dy * dy < best:
                best, best_x, best_y, best_along, best_across = dx * dx + dy * dy, dx, dy, along, across
    return best, best_x, best_y, best_along, best_across


@fused_kernel
def image_contacts(disks: DiskArrays, pairs: NeighbourList, images: Images) -> tuple[int, float, float]:
    """Contacts, and the sums of the squares of their overlaps [m^2] and shear forces [N^2]."""
    now = images.now
    count, squares, shears = 0, 0.0, 0.0
    for i in range(disks.x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j, along, across = pairs.other[k], images.shift[2 * k], images.shift[2 * k + 1]
            dx = disks.x[j, 0] - disks.x[i, 0] + (now[XX] * along + now[XY] * across)
            dy = disks.x[j, 1] - disks.x[i, 1] + now[YY] * across
            overlap = disks.radius[i] + disks.radius[j] - sqrt(dx * dx + dy * dy)
            if overlap > 0.0:
                count += 1
                squares += overlap * overlap
            shears += pairs.shear[k] * pairs.shear[k]
    return count, squares, shears


@kernel
def record_images(system: System, images: Images, samples: Samples, row: int, n: int) -> None:
    """Write stress, work, elastic energies and watched pairs at step ``n`` to a row, in the place of those without images.

    The image of a watched pair is the nearest one.
    """
    disks, pairs, law, step, now = system.disks, system.lists.pairs, system.law, system.step, images.now
    area, t, start = now[XX] * now[YY], n * step.kick.dt, n == 0
    xx, xy, yy = flow_at(images, t)
    mass, px, py, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for turn in range(2):
        for i in range(disks.x.shape[0]):
            if disks.inv_mass[i] == 0.0:
                continue
            ax = disks.force[i, 0] * disks.inv_mass[i] + step.kick.gravity_x
            ay = disks.force[i, 1] * disks.inv_mass[i] + step.kick.gravity_y
            vx = synchronised_part(disks, i, 0, ax, step, start) - (xx * disks.x[i, 0] + xy * disks.x[i, 1])
            vy = synchronised_part(disks, i, 1, ay, step, start) - yy * disks.x[i, 1]
            m = 1.0 / disks.inv_mass[i]
            if turn == 0:
                mass, px, py = mass + m, px + m * vx, py + m * vy
            else:
                vx, vy = vx - px / mass, vy - py / mass
                sxx += m * vx * vx
                sxy += m * vx * vy
                syy += m * vy * vy
    samples.stress[row, 1, 0, 0], samples.stress[row, 1, 1, 1] = sxx / area, syy / area
    samples.stress[row, 1, 0, 1], samples.stress[row, 1, 1, 0] = sxy / area, sxy / area
    for c in range(4):
        samples.stress[row, 0, c // 2, c % 2] = -images.load[c] / area
    samples.cell_work[row] = images.work[0]
    _, squares, shears = image_contacts(disks, pairs, images)
    samples.energy[row, 2] = 0.5 * law[KN] * squares
    samples.energy[row, 3] = 0.5 * shears / law[KS] if law[KS] > 0.0 else 0.0
    dashpot_v = disks.v_now if disks.v_now.shape[0] > 0 else disks.v
    for c in range(samples.pairs.shape[0]):
        i, j = int(disks.place[samples.pairs[c, 0]]), int(disks.place[samples.pairs[c, 1]])
        d2, dx, dy, along, across = nearest_image(disks, now, i, j)
        d = sqrt(d2)
        gap, fn, fs = d - (disks.radius[i] + disks.radius[j]), 0.0, 0.0
        if gap < 0.0:
            vx = dashpot_v[i, 0] - dashpot_v[j, 0] - (now[RATE_XX] * along + now[RATE_XY] * across)
            vy = dashpot_v[i, 1] - dashpot_v[j, 1] - now[RATE_YY] * across
            rate = (vx * dx + vy * dy) / d
            fn = normal_force(-gap, rate, law[KN], law[BETA], disks.inv_mass[i] + disks.inv_mass[j], 0.0)
            fs = carried(pairs, images.shift, i, j, along, across)
        samples.gap[row, c], samples.fn[row, c], samples.fs[row, c] = gap, fn, fs
