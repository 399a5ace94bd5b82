"""Kernels of the lists of neighbours of spheres: cells, order of the spheres, pairs, spheres at planes.

As in 2D (`ninedisk.core.dem.plane.neighbour_kernels`), with layers of rows of cells: the pairs of a sphere are with spheres of higher
rows, so that those of a stripe of layers reach no further than the first layer of the next one.
"""

from __future__ import annotations

from math import floor, sqrt
from typing import NamedTuple

import numpy as np

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.plane.neighbour_kernels import next_skin, order_by_cell, permute
from ninedisk.core.dem.space.law_kernels import neck_of
from ninedisk.core.dem.space.registers import WIDE
from ninedisk.core.dem.space.state import (
    BETA,
    DRAG,
    HERTZ,
    IMAGE,
    KN,
    KS,
    MEMORY_WIDTH,
    MU,
    NECK,
    NOTES_WIDTH_IMAGES,
    NOTES_WIDTH_STICKY,
    REDUCED,
    ROLL,
    ROLL_DRAG,
    ROLLING,
    SHEAR,
    SPRING,
    STICKS,
    TWIST,
    TWIST_DRAG,
    Contacts,
    Floats,
    Integers,
    Numbers,
    State,
    Vector,
)
from ninedisk.core.dem.space.state import MEMORY_WIDTH_RESISTED as ALL
from ninedisk.core.dem.state import Cells

REBUILD_COST = 10.0
"""Cost of a rebuild over that of the pairs out of contact in a step, per sphere, with a skin of a mean radius (measured: 200 ns over 8
pairs of 2.5 ns), see `next_skin`."""

STRIPE = 100
"""Spheres that a stripe has at least, so that what each costs beside its contacts does not count."""

IN_LAYER, LAYERS, IN_ROW = 3, 4, 5
"""Entries of the grid after the lower corner: cells of a layer, layers, cells of a row."""


class Materials(NamedTuple):
    """What decides the law of a pair: by the scene's numbers of the spheres ``of`` and ``fixed``, by materials ``pair`` and ``plane``.

    Pairs of fixed bodies are not listed. Spheres are all listed at a plane that ``moves``: nothing shows how far it gets until the next
    list.
    """

    of: Integers
    fixed: Integers
    pair: Integers
    plane: Integers
    moves: Integers


@inline_kernel
def box_around(x: Floats, n: int) -> tuple[bool, Vector, Vector]:
    """Whether coordinates and extents are finite, lower corner and extents of the box around the n centres [m]."""
    low_x, low_y, low_z = x[0], x[1], x[2]
    high_x, high_y, high_z = low_x, low_y, low_z
    finite = True
    for i in range(n):
        finite = finite and np.isfinite(x[WIDE * i] + x[WIDE * i + 1] + x[WIDE * i + 2])
        low_x, high_x = min(low_x, x[WIDE * i]), max(high_x, x[WIDE * i])
        low_y, high_y = min(low_y, x[WIDE * i + 1]), max(high_y, x[WIDE * i + 1])
        low_z, high_z = min(low_z, x[WIDE * i + 2]), max(high_z, x[WIDE * i + 2])
    long = high_x - low_x, high_y - low_y, high_z - low_z
    return bool(finite and np.isfinite(long[0] + long[1] + long[2])), (low_x, low_y, low_z), long


@inline_kernel
def axes_of(long: Vector) -> tuple[int, int, int]:
    """Axes of a box with these sides along which cells, rows and layers of cells follow each other: layers along the longest one."""
    high = 0 if long[0] >= long[1] and long[0] >= long[2] else 1 if long[1] >= long[2] else 2
    wide, deep = (high + 1) % 3, (high + 2) % 3
    if long[wide] > long[deep]:
        wide, deep = deep, wide
    return wide, deep, high


@kernel
def sort_into_cells(x: Floats, width: float, cells: Cells) -> bool:
    """Counting sort of the centres into cubic cells; layers are along the longest side of the box around them, rows along the shortest.

    Parameters
    ----------
    x : ndarray, shape (WIDE n,)
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
    n, grid = cells.cell.shape[0], cells.grid
    finite, low, long = box_around(x, n)
    if not finite:
        return False
    wide, deep, high = axes_of(long)
    room = cells.start.shape[0] - 1
    while (floor(long[wide] / width) + 1.0) * (floor(long[deep] / width) + 1.0) * (
        floor(long[high] / width) + 1.0
    ) > room:
        width *= 1.25
    nx, ny, nz = int(long[wide] / width) + 1, int(long[deep] / width) + 1, int(long[high] / width) + 1
    grid[IN_LAYER], grid[LAYERS], grid[IN_ROW] = nx * ny, nz, nx
    for i in range(n):
        layer, line = int((x[WIDE * i + high] - low[high]) / width), int((x[WIDE * i + deep] - low[deep]) / width)
        cells.cell[i] = (layer * ny + line) * nx + int((x[WIDE * i + wide] - low[wide]) / width)
    order_by_cell(cells, n, nx * ny * nz)
    return True


@inline_kernel
def permute_vectors(values: Floats, order: Numbers, scratch: Floats) -> None:
    """``values[k] = values[order[k]]`` for vectors, shape (WIDE n,), or (0,)."""
    if values.shape[0] > 0:
        for k in range(order.shape[0]):
            for c in range(WIDE):
                scratch[WIDE * k + c] = values[WIDE * order[k] + c]
        for q in range(values.shape[0]):
            values[q] = scratch[q]


@inline_kernel
def divide(n: int, cells: Cells, stripe: Integers) -> None:
    """Stripes of whole layers of cells, as many as there are; of fewer layers the more there is room for. Unused stripes are empty.

    The division depends on the positions alone, never on the number of threads.
    """
    room = stripe.shape[0] - 1
    in_layer, layers = int(cells.grid[IN_LAYER]), int(cells.grid[LAYERS])
    used = 0
    stripe[0] = 0
    least = max(STRIPE, n // room)
    for layer in range(1, layers if room > 1 else 0):
        first = cells.start[layer * in_layer]
        if used < room - 1 and first - stripe[used] >= least and n - first >= STRIPE:
            used += 1
            stripe[used] = first
    for s in range(used + 1, room + 1):
        stripe[s] = n


@inline_kernel
def put_in_order(state: State, listed: Integers, cells: Cells) -> None:
    """Bring the spheres into the order of the cells; forces serve as scratch."""
    order, scratch = cells.order, state.force
    for values in (state.x, state.v, state.omega, state.angle, state.v_now, state.omega_now, state.mobility):
        permute_vectors(values, order, scratch)
    for column in (state.mass, state.inv_mass, state.inv_inertia, state.radius):
        permute(column, order, scratch)
    for numbers in (state.name, listed):
        for k in range(order.shape[0]):
            scratch[k] = numbers[order[k]]
        for k in range(order.shape[0]):
            numbers[k] = int(scratch[k])
    # A counting sort is stable: sorted once more, the spheres stay where they are.
    for c in range(int(cells.grid[IN_LAYER]) * int(cells.grid[LAYERS])):
        for k in range(cells.start[c], cells.start[c + 1]):
            order[k], cells.cell[k] = k, c


@kernel
def begin_lists(
    state: State,
    listed: Integers,
    cells: Cells,
    stripe: Integers,
    in_order: bool,
    skin: float,
    steps: int,
    sizes: tuple[float, float, float, float],
) -> float:
    """Cells, order and stripes of the spheres for new lists; those in use know them by their ``listed`` rows. Forces serve as scratch.

    Parameters
    ----------
    listed : ndarray of int64, shape (n,)
        Row that each sphere has in the lists in use.
    stripe : ndarray of int64, shape (s + 1,)
        Out: first row of each stripe.
    in_order : bool
        Whether spheres are kept in the order of the cells.
    skin, steps
        Of the lists in use, see `next_skin`.
    sizes : tuple
        Mean and largest radius, least and largest skin [m].

    Returns
    -------
    float
        The new skin [m]; -1 if a position is not finite.
    """
    mean, widest, least, most = sizes
    skin = next_skin(skin, steps, REBUILD_COST, mean, least, most)
    if not sort_into_cells(state.x, 2.0 * widest + skin, cells):
        return -1.0
    if in_order:
        put_in_order(state, listed, cells)
    for q in range(state.built.shape[0]):
        state.built[q] = state.x[q]
    divide(cells.order.shape[0], cells, stripe)
    return skin


@inline_kernel
def about_contact(state: State, i: int) -> float:
    """``1/(I + m R^2)`` of a sphere about its contact [1/(kg m^2)]; 0 where it is fixed or does not turn."""
    a, b = state.inv_inertia[i], state.inv_mass[i]
    return a * b / (b + a * state.radius[i] * state.radius[i]) if b > 0.0 else 0.0


@inline_kernel
def dashpot(beta: float, stiffness: float, inverse: float) -> float:
    """``2 beta sqrt(stiffness/inverse)``, 0 for bodies that nothing moves."""
    return 2.0 * beta * sqrt(stiffness / inverse) if inverse > 0.0 else 0.0


@inline_kernel
def record_pair(
    new: Contacts,
    k: int,
    laws: Floats,
    number: int,
    reduced: float,
    inv_mass: float,
    about: float,
    inv_inertia: float,
) -> None:
    """Law, notes and empty memory of the listed pair k, from its reduced radius and sums of 1/m, `about_contact` and 1/I."""
    law = laws[number]
    new.law[k] = number
    for c in range(new.memory.shape[1]):
        new.memory[k, c] = reduced if c == REDUCED else 0.0
    # Hertz' dashpot has the tangent stiffness, 3/2 of the secant one (Tsuji).
    new.notes[k, DRAG] = dashpot(law[BETA], law[KN] * (1.5 * 5.0 / 6.0 if law[HERTZ] > 0.0 else 1.0), inv_mass)
    if new.memory.shape[1] > MEMORY_WIDTH:
        new.notes[k, ROLL_DRAG] = dashpot(law[ROLL + 3], law[ROLL + 2], about)
        new.notes[k, TWIST_DRAG] = dashpot(law[TWIST + 3], law[TWIST + 2], inv_inertia)
    if new.notes.shape[1] == NOTES_WIDTH_STICKY:  # 3 a_c^2/R
        new.notes[k, NECK] = -3.0 * law[STICKS] * reduced ** (1.0 / 3.0)


@inline_kernel
def inherit(old: Contacts, o: int, new: Contacts, k: int, turned: bool) -> None:
    """Memory of the listed pair o for the pair k, which has its bodies the other way round if it is ``turned``."""
    side = -1.0 if turned else 1.0
    if new.notes.shape[1] == NOTES_WIDTH_STICKY and old.notes[o, NECK] > 0.0:
        new.notes[k, NECK] = abs(new.notes[k, NECK])
    for c in range(new.memory.shape[1]):
        new.memory[k, c] = old.memory[o, c]
    for c in range(3):
        new.memory[k, SHEAR + c] *= side
        if new.memory.shape[1] == ALL:
            new.memory[k, ROLLING + c] *= side


@inline_kernel
def enter_pair(
    state: State,
    listed: Integers,
    materials: Materials,
    laws: Floats,
    i: int,
    j: int,
    old: Contacts,
    new: Contacts,
    k: int,
) -> None:
    """Make the spheres i and j the listed pair k, with the memory that it has in the old list."""
    radius, inv_mass, inv_inertia, name = state.radius, state.inv_mass, state.inv_inertia, state.name
    number = materials.pair[materials.of[name[i]], materials.of[name[j]]]
    about = about_contact(state, i) + about_contact(state, j)
    masses, inertias = inv_mass[i] + inv_mass[j], inv_inertia[i] + inv_inertia[j]
    record_pair(new, k, laws, number, radius[i] * radius[j] / (radius[i] + radius[j]), masses, about, inertias)
    new.row[k], new.other[k] = i, j
    a, b = min(listed[i], listed[j]), max(listed[i], listed[j])
    for o in range(old.start[a], old.start[a + 1]):
        if old.other[o] == b:
            inherit(old, o, new, k, a != listed[i])
            break


@kernel
def list_pairs(
    state: State,
    listed: Integers,
    cells: Cells,
    materials: Materials,
    laws: Floats,
    in_order: bool,
    skin: float,
    old: Contacts,
    new: Contacts,
) -> bool:
    """List all pairs of spheres with a gap below ``skin`` [m], with the memory of the old list; False if ``new`` is too small."""
    x, radius, name = state.x, state.radius, state.name
    n, nx, nz = radius.shape[0], int(cells.grid[IN_ROW]), int(cells.grid[LAYERS])
    ny = int(cells.grid[IN_LAYER]) // nx
    room, k = new.other.shape[0], 0
    new.start[0] = 0
    for i in range(n):
        line, column = cells.cell[i] // nx, cells.cell[i] % nx
        layer, line = line // ny, line % ny
        first, last = max(column - 1, 0), min(column + 1, nx - 1)
        for z in range(layer if in_order else max(layer - 1, 0), min(layer + 2, nz)):
            for y in range(line if in_order and z == layer else max(line - 1, 0), min(line + 2, ny)):
                at = (z * ny + y) * nx
                begin = cells.start[at + first]
                for m in range(max(begin, i + 1) if in_order else begin, cells.start[at + last + 1]):
                    j = m if in_order else int(cells.order[m])
                    if j <= i:
                        continue
                    dx, dy, dz = (
                        x[WIDE * j] - x[WIDE * i],
                        x[WIDE * j + 1] - x[WIDE * i + 1],
                        x[WIDE * j + 2] - x[WIDE * i + 2],
                    )
                    reach = radius[i] + radius[j]
                    if dx * dx + dy * dy + dz * dz >= (reach + skin) * (reach + skin):
                        continue
                    if materials.fixed[name[i]] and materials.fixed[name[j]]:
                        continue
                    if k == room:
                        return False
                    enter_pair(state, listed, materials, laws, i, j, old, new, k)
                    k += 1
        new.start[i + 1] = k
    return True


@kernel
def list_planes(
    state: State,
    listed: Integers,
    materials: Materials,
    laws: Floats,
    skin: float,
    place: Integers,
    old: Contacts,
    new: Contacts,
) -> bool:
    """List the spheres with a gap below ``skin`` [m] to each plane, with the memory of the old lists; False if ``new`` is too small.

    ``place``, shape (n,), is scratch.
    """
    x, radius, name = state.x, state.radius, state.name
    room, k = new.other.shape[0], 0
    new.start[0] = 0
    for w in range(state.now.shape[0]):
        for i in range(radius.shape[0]):
            place[i] = -1
        for o in range(old.start[w], old.start[w + 1]):
            place[old.other[o]] = o
        for i in range(radius.shape[0]):
            height = 0.0
            for c in range(3):
                height += (x[WIDE * i + c] - state.now[w, c]) * state.now[w, 3 + c]
            if materials.fixed[name[i]] or not (height < radius[i] + skin or materials.moves[w]):
                continue
            if k == room:
                return False
            number = materials.plane[w, materials.of[name[i]]]
            record_pair(
                new, k, laws, number, radius[i], state.inv_mass[i], about_contact(state, i), state.inv_inertia[i]
            )
            new.row[k], new.other[k] = w, i
            if place[listed[i]] >= 0:
                inherit(old, place[listed[i]], new, k, False)
            k += 1
        new.start[w + 1] = k
    return True


@kernel
def widen_by_necks(contacts: Contacts, laws: Floats, overlap: Floats, radius: Floats) -> None:
    """Overlaps and contact radii [m] of the listed pairs that a neck of JKR's holds, from overlaps of either sign; none of other pairs."""
    for k in range(overlap.shape[0]):
        gap = contacts.notes[k, NECK] if laws[contacts.law[k], STICKS] > 0.0 else 0.0
        if gap > 0.0:
            overlap[k] = max(overlap[k], -gap)
            a_c, s = neck_of(overlap[k], gap, contacts.memory[k, REDUCED])
            radius[k] = a_c * s * s
        else:
            overlap[k] = max(overlap[k], 0.0)
            radius[k] = sqrt(contacts.memory[k, REDUCED] * overlap[k])


@kernel
def stiffest(
    state: State, contacts: Contacts, laws: Floats, edges: Floats, at_planes: bool, share: float, sums: Floats
) -> None:
    """Adds stiffness [1/s^2] and dashpots in C' [1/s] over the masses of listed pairs that touch to those of their spheres, shape (n, 2).

    ``share`` of the dashpots is in C' (`ninedisk.core.dem.space.critical`); ``edges`` are those of a periodic cell [m], where there is one.

    With p and q the ends of one spring and a, b its stiffnesses over the masses, ``(p - q)^2 <= (1 + b/a) p^2 + (1 + a/b) q^2``: no
    eigenvalue of the contacts together exceeds the largest sum of ``a + b`` over those of one sphere. Of a single contact it is that sum.
    """
    x = state.x
    for k in range(contacts.start[contacts.start.shape[0] - 1]):
        i, j = contacts.other[k], contacts.row[k]
        distance = 0.0
        if at_planes:
            overlap = state.radius[i]
            for c in range(3):
                overlap -= (x[WIDE * i + c] - state.now[j, c]) * state.now[j, 3 + c]
        else:
            for c in range(3):
                d = x[WIDE * i + c] - x[WIDE * j + c]
                if contacts.notes.shape[1] == NOTES_WIDTH_IMAGES:  # i is the second one
                    for e in range(3):
                        d += edges[c, e] * contacts.notes[k, IMAGE + e]
                distance += d**2
            overlap = state.radius[i] + state.radius[j] - sqrt(distance)
        law = laws[contacts.law[k]]
        gap = contacts.notes[k, NECK] if law[STICKS] > 0.0 else 0.0
        if not overlap > min(0.0, -gap):
            continue
        inverse, turn = state.inv_mass[i], state.inv_inertia[i]
        arms = turn * state.radius[i] ** 2
        if not at_planes:
            inverse, turn = inverse + state.inv_mass[j], turn + state.inv_inertia[j]
            arms += state.inv_inertia[j] * state.radius[j] ** 2
        normal, across, drag = law[KN], law[KS] if law[MU] > 0.0 else 0.0, contacts.notes[k, DRAG]
        if law[HERTZ] > 0.0:
            a = sqrt(contacts.memory[k, REDUCED] * max(overlap, 0.0))
            if law[STICKS] > 0.0:  # a neck is nowhere stiffer than Hertz' contact of its radius
                a_c, s = neck_of(overlap, abs(gap), contacts.memory[k, REDUCED])
                a = a_c * s * s
            normal, across, drag = 1.5 * normal * a, across * a, drag * sqrt(a)
        normal, across, drag, twist, slowed = (
            normal * inverse,
            across * (inverse + arms),
            share * drag * inverse,
            0.0,
            0.0,
        )
        if law[ROLL] == SPRING:
            # Shear and rolling move the same spins, twisting those about the normal.
            across += law[ROLL + 2] * turn
            slowed = share * contacts.notes[k, ROLL_DRAG] * turn
        if law[TWIST] == SPRING:
            twist = law[TWIST + 2] * turn
            slowed = max(slowed, share * contacts.notes[k, TWIST_DRAG] * turn)
        stiffness, dashpots = max(normal, max(across, twist)), max(drag, slowed)
        sums[i, 0] += stiffness
        sums[i, 1] += dashpots
        if not at_planes:
            sums[j, 0] += stiffness
            sums[j, 1] += dashpots
