"""Kernels that order contacts by stripes, so that threads can sweep over them with the same result whatever their number.

The bodies are numbered by their distance from a corner of the packing, counted in contacts: breadth first, from a body as
remote as possible. Contacts then join bodies of one level or of two neighbouring ones. A stripe is some levels in a row, and
a contact belongs to the stripe of its first body. So it changes bodies of that stripe and of the next one, and every second
stripe can be swept at the same time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

NX, NY, ARM_NI, ARM_NJ, ARM_TI, ARM_TJ, G_N, G_T, C_N, C_T, MU, W_NN, W_NT, W_TT, P, Q = range(16)
"""Columns of a contact's row: normal, arms, offset, compliance, friction, Delassus block, force. ``G_T`` holds ``g_t - c_t q0``."""
ROW = 16
"""Numbers in a row: two cache lines."""


@kernel
def moving_bodies(bodies: Ints, inverse_mass: Floats, moving: Ints) -> None:
    """``bodies``, shape (c, 2), with -1 for those that no force moves: they join no contacts."""
    for k in range(bodies.shape[0]):
        for side in range(2):
            i = bodies[k, side]
            moving[k, side] = i
            if i >= 0 and inverse_mass[i, 0] == 0.0 and inverse_mass[i, 1] == 0.0 and inverse_mass[i, 2] == 0.0:
                moving[k, side] = -1


@kernel
def list_contacts(moving: Ints, first: Ints, contacts: Ints) -> None:
    """Contacts of each body: ``contacts[first[i] : first[i + 1]]``, shapes (b + 1,) and (2 c,)."""
    b = first.shape[0] - 1
    for i in range(b + 1):
        first[i] = 0
    for k in range(moving.shape[0]):
        for side in range(2):
            if moving[k, side] >= 0:
                first[moving[k, side] + 1] += 1
    for i in range(b):
        first[i + 1] += first[i]
    for k in range(moving.shape[0]):
        for side in range(2):
            i = moving[k, side]
            if i >= 0:
                contacts[first[i]] = k
                first[i] += 1
    for i in range(b, 0, -1):
        first[i] = first[i - 1]
    first[0] = 0


@kernel
def number_bodies(moving: Ints, first: Ints, contacts: Ints, place: Ints, queue: Ints, level: Ints) -> None:
    """Number the bodies breadth first, one connected part after the other.

    Parameters
    ----------
    moving, first, contacts
        Of `moving_bodies` and `list_contacts`.
    place : ndarray, shape (b,)
        Out: number of each body.
    queue : ndarray, shape (b,)
        Out: bodies by number.
    level : ndarray, shape (b,)
        Out: level of each number; it never falls, and the levels of two bodies in contact differ by 1 at most.
    """
    b = place.shape[0]
    for i in range(b):
        place[i] = -1
    done, top = 0, 0
    for i in range(b):
        if place[i] < 0:
            # The body reached last from anywhere lies at an end of the part; from there the levels are small and many.
            end = _reach(i, done, top, moving, first, contacts, place, queue, level)
            remote = queue[end - 1]
            for m in range(done, end):
                place[queue[m]] = -1
            done = _reach(remote, done, top, moving, first, contacts, place, queue, level)
            top = level[done - 1] + 1


@inline_kernel
def _reach(
    start: int,
    done: int,
    top: int,
    moving: Ints,
    first: Ints,
    contacts: Ints,
    place: Ints,
    queue: Ints,
    level: Ints,
) -> int:
    """Number all bodies that can be reached from ``start``, from ``done`` on; the number after the last one."""
    place[start], queue[done], level[done] = done, start, top
    end, at = done + 1, done
    while at < end:
        i = queue[at]
        for m in range(first[i], first[i + 1]):
            k = contacts[m]
            j = moving[k, 0] + moving[k, 1] - i
            if moving[k, 0] >= 0 and moving[k, 1] >= 0 and place[j] < 0:
                place[j], queue[end], level[end] = end, j, level[at] + 1
                end += 1
        at += 1
    return end


@kernel
def own_contacts(moving: Ints, place: Ints, first: Ints, contacts: Ints) -> None:
    """Contacts by the lower number of their bodies: ``contacts[first[m] : first[m + 1]]``; those of no moving body go to the last."""
    b = place.shape[0]
    for m in range(b + 1):
        first[m] = 0
    for k in range(moving.shape[0]):
        first[_owner(k, moving, place) + 1] += 1
    for m in range(b):
        first[m + 1] += first[m]
    for k in range(moving.shape[0]):
        m = _owner(k, moving, place)
        contacts[first[m]] = k
        first[m] += 1
    for m in range(b, 0, -1):
        first[m] = first[m - 1]
    first[0] = 0


@inline_kernel
def _owner(k: int, moving: Ints, place: Ints) -> int:
    owner: int = place.shape[0] - 1
    for side in range(2):
        if moving[k, side] >= 0:
            owner = min(owner, int(place[moving[k, side]]))
    return owner


@kernel
def cut_stripes(first: Ints, contacts: Ints, level: Ints, order: Ints, bounds: Ints) -> int:
    """Cut the bodies between levels into stripes with similar numbers of contacts, and put these in order.

    In a stripe come the first contacts of all its bodies, then the second ones and so on: neighbours in the order then hardly
    ever have a body in common, and the processor need not finish one before it begins the next.

    Parameters
    ----------
    first, contacts
        Of `own_contacts`.
    level
        Of `number_bodies`.
    order : ndarray, shape (c,)
        Out: contacts by place in the sweep.
    bounds : ndarray, shape (s + 1,)
        Out: places of the first contacts of the stripes.

    Returns
    -------
    int
        Number of stripes, <= s: fewer where there are fewer levels.
    """
    b, c, most = level.shape[0], order.shape[0], bounds.shape[0] - 1
    begin = at = stripes = 0
    bounds[0] = 0
    for m in range(1, b + 1):
        between = m < b and level[m] > level[m - 1] and at < first[m] < c
        if not (m == b or (between and first[m] * most >= c * (stripes + 1))):
            continue
        rank = 0
        while at < first[m]:
            for i in range(begin, m):
                if first[i] + rank < first[i + 1]:
                    order[at] = contacts[first[i] + rank]
                    at += 1
            rank += 1
        begin, stripes = m, stripes + 1
        bounds[stripes] = at
    return stripes


@kernel
def pack_rows(
    order: Ints,
    place: Ints,
    moving: Ints,
    normal: Floats,
    arms: Floats,
    offset: Floats,
    compliance: Floats,
    shear_0: Floats,
    mu: Floats,
    blocks: Floats,
    r: Floats,
    pairs: Ints,
    rows: Floats,
) -> None:
    """Rows, shape (c, `ROW`), of the contacts in ``order``, and the numbers ``pairs``, shape (c, 2), of their bodies."""
    for m in range(order.shape[0]):
        k = order[m]
        for side in range(2):
            i = moving[k, side]
            pairs[m, side] = place[i] if i >= 0 else -1
        rows[m, NX], rows[m, NY] = normal[k, 0], normal[k, 1]
        for d in range(4):
            rows[m, ARM_NI + d] = arms[k, d]
        rows[m, G_N], rows[m, G_T] = offset[k, 0], offset[k, 1] - compliance[k, 1] * shear_0[k]
        rows[m, C_N], rows[m, C_T], rows[m, MU] = compliance[k, 0], compliance[k, 1], mu[k]
        for d in range(3):
            rows[m, W_NN + d] = blocks[k, d]
        rows[m, P], rows[m, Q] = r[k, 0], r[k, 1]


@kernel
def unpack_forces(order: Ints, rows: Floats, r: Floats) -> None:
    """Contact forces ``r``, shape (c, 2), in the problem's order."""
    for m in range(order.shape[0]):
        r[order[m], 0], r[order[m], 1] = rows[m, P], rows[m, Q]


@kernel
def gather_bodies(queue: Ints, values: Floats, numbered: Floats) -> None:
    """``numbered[m] = values[queue[m]]``, shape (b, 3)."""
    for m in range(queue.shape[0]):
        for d in range(3):
            numbered[m, d] = values[queue[m], d]
