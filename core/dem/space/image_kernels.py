"""Kernels of a periodic cell in 3D: images of spheres, the pairs that they make, the stress, the work of the deforming cell.

As in 2D (`ninedisk.core.dem.plane.image_kernels`) positions are those of one and the same image throughout, and a listed pair carries whole
numbers ``s``: its contact is that of sphere i and of the image of sphere j that lies ``h s`` away and moves faster by ``h' s``. The edges
are the columns of ``h(t) = (I + t rate) diag(size)``, upper triangular.

Stress, compression positive: ``V sigma = -sum g (x) d`` over the contacts, with the force ``g`` on i. Images feed ``g.(h' s)``.
"""

from __future__ import annotations

from math import ceil, floor, sqrt

import numpy as np

from ninedisk.core.compile import fused_inline_kernel, inline_kernel, kernel
from ninedisk.core.dem.plane.kick_kernels import farther
from ninedisk.core.dem.space.neighbour_kernels import Materials, about_contact, inherit, record_pair
from ninedisk.core.dem.space.registers import WIDE
from ninedisk.core.dem.space.scratch_kernels import DASHPOT_ROWS, DV_ROWS, FOUR, PUSH, D, vector
from ninedisk.core.dem.space.state import IMAGE, Contacts, Floats, Images, Index, State, Vector
from ninedisk.core.dem.state import Cells

POWER = 9
"""Entry of `Images.share` that is the power of the images [W], after ``sum g (x) d`` row by row [N m]."""

ROUND_OFF = 8.881784197001252e-16
"""Of a coordinate, eight roundings, as in 2D."""


@kernel
def place_cell(images: Images, t: float) -> None:
    """Edges at time ``t`` [s]."""
    for a in range(3):
        for b in range(3):
            images.now[a, b] = edge_at(images, a, b, t)


@inline_kernel
def edge_at(images: Images, a: int, b: int, t: float) -> float:
    """Entry of ``h`` [m] at time ``t`` [s]."""
    return float((images.size[a] if a == b else 0.0) + t * images.rate[a, b])


@inline_kernel
def solved(h: Floats, x: float, y: float, z: float) -> Vector:
    """``h^-1 x`` of an upper triangular ``h``."""
    c = z / h[2, 2]
    b = (y - h[1, 2] * c) / h[1, 1]
    return (x - h[0, 1] * b - h[0, 2] * c) / h[0, 0], b, c


@inline_kernel
def displacement_limit(images: Images, skin: float) -> float:
    """Bound on a sphere's displacement from the flow since the last rebuild, up to which the lists are complete [m]; 0: none.

    With ``F = h h_b^-1`` and ``u = x - F x_b`` a pair is ``d = F d_b + u_j - u_i`` apart, whichever image. A pair that is not listed was
    at least ``2 R + skin`` away, so it cannot touch while ``2 u <= (1 - f)(2 R + skin) - 2 R`` with ``f = |F - I|``.
    """
    f2 = 0.0
    for a in range(3):
        # Row a of F solves F h_b = h.
        x = images.now[a, 0] / images.built[0, 0]
        y = (images.now[a, 1] - x * images.built[0, 1]) / images.built[1, 1]
        z = (images.now[a, 2] - x * images.built[0, 2] - y * images.built[1, 2]) / images.built[2, 2]
        x, y, z = x - (1.0 if a == 0 else 0.0), y - (1.0 if a == 1 else 0.0), z - (1.0 if a == 2 else 0.0)
        f2 += x * x + y * y + z * z
    f = sqrt(f2)
    return float(max(0.5 * ((1.0 - f) * skin - f * 2.0 * images.widest[0]), 0.0))


@kernel
def beside_flow(state: State, images: Images, t: float, begin: int, end: int) -> float:
    """Largest square of ``u = x - F x_b`` (`displacement_limit`) of the spheres ``begin .. end-1`` at time ``t`` [m^2]; NaN if any is NaN.

    Rounding of u, and of the distances that contacts have across images, is added to it.
    """
    x, built, far = state.x, state.built, 0.0
    for i in range(np.uint64(begin), np.uint64(end)):
        k = FOUR * i
        px, py, pz = solved(images.built, built[k], built[k + np.uint64(1)], built[k + np.uint64(2)])
        square, largest = 0.0, 0.0
        for a in range(3):
            at = x[k + np.uint64(a)]
            moved = edge_at(images, a, 0, t) * px + edge_at(images, a, 1, t) * py + edge_at(images, a, 2, t) * pz
            square += (at - moved) * (at - moved)
            largest = max(largest, abs(at))
        u = sqrt(square) + ROUND_OFF * largest
        far = farther(far, u * u)
    return far


@inline_kernel
def face_distances(h: Floats, apart: Floats) -> None:
    """Distances of the faces of a cell with these edges [m]: 1 over the rows of h^-1."""
    for c in range(3):
        total = 0.0
        for b in range(3):
            e = solved(h, 1.0 if b == 0 else 0.0, 1.0 if b == 1 else 0.0, 1.0 if b == 2 else 0.0)
            total += e[c] * e[c]
        apart[c] = 1.0 / sqrt(total)


@kernel
def sort_into_images(state: State, images: Images, width: float, cells: Cells) -> bool:
    """Put the spheres into boxes of the cell at least ``width`` [m] wide, as far as it has room; False if a position is not finite.

    ``cells.grid`` gets the boxes along the edges, and how many boxes to either side are within reach.
    """
    h, n = images.now, state.radius.shape[0]
    count, apart, most = images.boxes, images.scratch, int(cells.start.shape[0]) - 1
    face_distances(h, apart)
    for c in range(3):
        count[c] = max(1, int(min(apart[c] / width, 1e6)))
    while count[0] * count[1] * count[2] > most:
        largest = int(np.argmax(count))
        count[largest] = max(1, count[largest] // 2)
    for c in range(3):
        cells.grid[c] = count[c]
        cells.grid[3 + c] = ceil(width / (apart[c] / count[c]))
    cells.start[:] = 0
    for i in range(n):
        f = solved(h, state.x[WIDE * i], state.x[WIDE * i + 1], state.x[WIDE * i + 2])
        box = 0
        for c in range(3):
            if not abs(f[2 - c]) < 1e15:
                return False
            home = floor(f[2 - c])
            images.home[i, 2 - c] = home
            box = box * count[2 - c] + min(int((f[2 - c] - home) * count[2 - c]), count[2 - c] - 1)
        cells.cell[i] = box
        cells.start[box + 1] += 1
    for box in range(count[0] * count[1] * count[2]):
        cells.start[box + 1] += cells.start[box]
    for i in range(n - 1, -1, -1):
        # From the end of each box backwards, so that spheres ascend; `start` is mended below.
        box = cells.cell[i]
        cells.start[box + 1] -= 1
        cells.order[cells.start[box + 1]] = i
    for box in range(count[0] * count[1] * count[2]):
        cells.start[box] = cells.start[box + 1]
    cells.start[count[0] * count[1] * count[2]] = n
    return True


@inline_kernel
def image_of(old: Contacts, i: int, j: int, along: Floats) -> int:
    """Entry of the old list with this pair and image; -1 if there is none."""
    for o in range(old.start[i], old.start[i + 1]):
        if old.other[o] == j:
            same = True
            for c in range(3):
                same = same and old.notes[o, IMAGE + c] == along[c]
            if same:
                return o
    return -1


@inline_kernel
def is_listed_image(shift: Floats) -> bool:
    """Whether a sphere and its own image so many edges away are listed: of ``s`` and ``-s`` one is."""
    return bool(shift[0] > 0.0 or (shift[0] == 0.0 and (shift[1] > 0.0 or (shift[1] == 0.0 and shift[2] > 0.0))))


@inline_kernel
def beyond_skin(state: State, h: Floats, shift: Floats, i: int, j: int, skin: float) -> bool:
    """Whether the gap of a sphere and an image is at least ``skin`` [m]."""
    x, d2 = state.x, 0.0
    for a in range(3):
        d = x[WIDE * j + a] - x[WIDE * i + a]
        for b in range(3):
            d += h[a, b] * shift[b]
        d2 += d * d
    reach = state.radius[i] + state.radius[j]
    return bool(d2 >= (reach + skin) * (reach + skin))


@inline_kernel
def enter_image(
    state: State, materials: Materials, laws: Floats, shift: Floats, i: int, j: int, old: Contacts, new: Contacts, k: int
) -> None:  # fmt: skip
    """Make sphere i and this image of sphere j the listed pair k, with the memory that it has in the old list."""
    radius, inv_mass, inv_inertia = state.radius, state.inv_mass, state.inv_inertia
    number = materials.pair[materials.of[i], materials.of[j]]
    about = about_contact(state, i) + about_contact(state, j)
    masses, inertias = inv_mass[i] + inv_mass[j], inv_inertia[i] + inv_inertia[j]
    record_pair(new, k, laws, number, radius[i] * radius[j] / (radius[i] + radius[j]), masses, about, inertias)
    new.row[k], new.other[k] = i, j
    for c in range(3):
        new.notes[k, IMAGE + c] = shift[c]
    o = image_of(old, i, j, shift)
    if o >= 0:
        inherit(old, o, new, k, False)


@kernel
def list_images(
    state: State,
    images: Images,
    cells: Cells,
    materials: Materials,
    laws: Floats,
    skin: float,
    old: Contacts,
    new: Contacts,
) -> bool:
    """List all pairs of a sphere and an image with a gap below ``skin`` [m], each once, with the memory of the old list; False if ``new``
    is too small.

    A sphere and its own image are a pair, too: of ``s`` and ``-s`` the one is listed whose first number that is not 0 is positive.
    """
    radius, h = state.radius, images.now
    nx, ny, nz = int(cells.grid[0]), int(cells.grid[1]), int(cells.grid[2])
    mx, my, mz = int(cells.grid[3]), int(cells.grid[4]), int(cells.grid[5])
    room, k, shift = new.other.shape[0], 0, images.scratch
    new.start[0] = 0
    for i in range(radius.shape[0]):
        box = cells.cell[i]
        cx, cy, cz = box % nx, box // nx % ny, box // nx // ny
        for bz in range(cz - mz, cz + mz + 1):
            for by in range(cy - my, cy + my + 1):
                for bx in range(cx - mx, cx + mx + 1):
                    az, ay, ax = bz // nz, by // ny, bx // nx
                    at = ((bz - az * nz) * ny + by - ay * ny) * nx + bx - ax * nx
                    for m in range(cells.start[at], cells.start[at + 1]):
                        j = int(cells.order[m])
                        if j < i:
                            continue
                        shift[0] = ax - images.home[j, 0] + images.home[i, 0]
                        shift[1] = ay - images.home[j, 1] + images.home[i, 1]
                        shift[2] = az - images.home[j, 2] + images.home[i, 2]
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


@fused_inline_kernel
def image_vector(h: Floats, pairs: Contacts, k: np.uint64) -> Vector:
    """``h s`` of a listed pair, of the edges or of their rates."""
    a, b, c = pairs.notes[k, IMAGE], pairs.notes[k, IMAGE + 1], pairs.notes[k, IMAGE + 2]
    return h[0, 0] * a + h[0, 1] * b + h[0, 2] * c, h[1, 1] * b + h[1, 2] * c, h[2, 2] * c


@inline_kernel
def take_motion(pairs: Contacts, images: Images, k: np.uint64, q: Index, central: bool, scratch: Floats) -> None:
    """Take the motion of the image from the differences of the velocities at place q of the scratch."""
    x, y, z = image_vector(images.rate, pairs, k)
    at = FOUR * (DV_ROWS + q)
    scratch[at] -= x
    scratch[at + np.uint64(1)] -= y
    scratch[at + np.uint64(2)] -= z
    if central:
        at = FOUR * (DASHPOT_ROWS + q)
        scratch[at] -= x
        scratch[at + np.uint64(1)] -= y
        scratch[at + np.uint64(2)] -= z


@inline_kernel
def add_share(pairs: Contacts, images: Images, k: np.uint64, q: Index, scratch: Floats) -> None:
    """Add a contact's part of the stress and of the power of the images, after the laws."""
    g, d, moves, share = (
        vector(scratch, PUSH + q),
        vector(scratch, D + q),
        image_vector(images.rate, pairs, k),
        images.share,
    )
    for a in range(3):
        for b in range(3):
            share[3 * a + b] += g[a] * d[b]
        share[POWER] += g[a] * moves[a]


@inline_kernel
def clear_share(images: Images) -> None:
    """Begin new sums of a step, and keep the power of the one before."""
    images.power[0] = images.share[POWER]
    for c in range(POWER + 1):
        images.share[c] = 0.0
