"""Kernels of the nonsmooth Gauss-Seidel sweep, over contacts one by one or by stripes that threads share.

Threads give the same result whatever their number. The bodies are numbered by their distance from a corner of the packing, counted in
contacts: breadth first, from a body as remote as possible. Contacts then join bodies of one level or of two neighbouring ones. A
stripe is some levels in a row, and a contact belongs to the stripe of its first body. So it changes bodies of that stripe and of the
next one, and every second stripe can be swept at the same time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem_kernels import (
    Contacts,
    add_contact_force,
    contact_velocity,
    project_on_cone,
    solve_associated_contact,
    solve_coulomb_contact,
)
from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.thread_kernels import wait_for_all

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


FEWEST = 2
"""Sweeps between two measurements at the start: on few contacts a measurement costs as much as some sweeps."""


NX, NY, ARM_NI, ARM_NJ, ARM_TI, ARM_TJ, G_N, G_T, C_N, C_T, MU, W_NN, W_NT, W_TT, P, Q = range(16)
"""Columns of a contact's row: normal, arms, offset, compliance, friction, Delassus block, force. ``G_T`` holds ``g_t - c_t q0``."""
ROW = 16
"""Numbers in a row: two cache lines."""


@kernel
def next_batch(done: int) -> int:
    """Sweeps until the next measurement: it costs about one and sets v anew from r; the distance grows with the number of sweeps."""
    return max(FEWEST, done // 4)


@inline_kernel
def _solve_contact(
    un: float,
    ut: float,
    p: float,
    q: float,
    w_nn: float,
    w_nt: float,
    w_tt: float,
    mu: float,
    relaxation: float,
    coulomb: bool,
) -> tuple[float, float]:
    """New force of a contact with the block ``w`` that has the velocity ``(un, ut)`` under the force ``(p, q)``."""
    bn = un - w_nn * p - w_nt * q
    bt = ut - w_nt * p - w_tt * q
    if coulomb:
        p_new, q_new = solve_coulomb_contact(w_nn, w_nt, w_tt, bn, bt, mu)
    else:
        p_new, q_new = solve_associated_contact(w_nn, w_nt, w_tt, bn, bt, mu)
    if relaxation != 1.0:
        return project_on_cone(p + relaxation * (p_new - p), q + relaxation * (q_new - q), mu)
    return p_new, q_new


@kernel
def sweep(
    contacts: Contacts,
    inverse_mass: Floats,
    offset: Floats,
    shear_0: Floats,
    blocks: Floats,
    relaxation: float,
    coulomb: bool,
    count: int,
    v: Floats,
    r: Floats,
) -> None:
    """``count`` sweeps over all contacts; each contact is solved exactly with the others held fixed.

    Parameters
    ----------
    contacts, inverse_mass, offset, shear_0, blocks
        As in `ContactProblem`.
    relaxation : float
        The change of a contact's force is multiplied by this and projected back on the cone.
    coulomb : bool
        Coulomb's law instead of the associated rule.
    count : int
    v : ndarray, shape (b, 3)
        Velocities ``M^-1 (f + H' r)``, kept up to date.
    r : ndarray, shape (c, 2)
        Contact forces, updated in place.

    Notes
    -----
    Nonsmooth Gauss-Seidel: M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Engrg. 177
    (1999) 235-257.
    """
    bodies, normal, arms, mu, compliance = contacts
    for _ in range(count):
        for k in range(bodies.shape[0]):
            p, q = r[k, 0], r[k, 1]
            un, ut = contact_velocity(k, bodies, normal, arms, v)
            un += offset[k, 0] + compliance[k, 0] * p
            ut += offset[k, 1] + compliance[k, 1] * (q - shear_0[k])
            p_new, q_new = _solve_contact(
                un, ut, p, q, blocks[k, 0], blocks[k, 1], blocks[k, 2], mu[k], relaxation, coulomb
            )
            dp, dq = p_new - p, q_new - q
            if dp != 0.0 or dq != 0.0:
                r[k, 0], r[k, 1] = p_new, q_new
                add_contact_force(k, dp, dq, bodies, normal, arms, inverse_mass, v)


@kernel
def sweep_stripes(
    thread: int,
    threads: int,
    flags: NDArray[np.int64],
    bounds: Ints,
    pairs: Ints,
    inverse_mass: Floats,
    relaxation: float,
    coulomb: bool,
    count: int,
    v: Floats,
    rows: Floats,
) -> int:
    """The share of a thread in ``count`` sweeps over stripes of contacts: first all even ones, then all odd ones.

    Stripes of one parity have no body in common, so the result is that of one thread.

    Parameters
    ----------
    flags : ndarray of int64
        Of `wait_for_all`.
    bounds, pairs, rows
        Of `cut_stripes` and `pack_rows`; the forces in the rows are updated in place.
    inverse_mass, v : ndarray, shape (b, 3)
        As in `sweep`, by the bodies' numbers.
    relaxation, coulomb, count
        As in `sweep`.
    """
    stripes = bounds.shape[0] - 1
    low, high = stripes * thread // threads, stripes * (thread + 1) // threads
    wait_for_all(flags, thread, threads)
    for _ in range(count):
        for parity in range(2):
            for s in range(low + (low + parity) % 2, high, 2):
                for m in range(bounds[s], bounds[s + 1]):
                    _sweep_row(m, pairs, inverse_mass, relaxation, coulomb, v, rows)
            wait_for_all(flags, thread, threads)
    return 0


@inline_kernel
def _sweep_row(
    m: int, pairs: Ints, inverse_mass: Floats, relaxation: float, coulomb: bool, v: Floats, rows: Floats
) -> None:
    i, j = pairs[m, 0], pairs[m, 1]
    nx, ny, p, q = rows[m, NX], rows[m, NY], rows[m, P], rows[m, Q]
    un, ut = rows[m, G_N] + rows[m, C_N] * p, rows[m, G_T] + rows[m, C_T] * q
    if i >= 0:
        un += -nx * v[i, 0] - ny * v[i, 1] + rows[m, ARM_NI] * v[i, 2]
        ut += -ny * v[i, 0] + nx * v[i, 1] + rows[m, ARM_TI] * v[i, 2]
    if j >= 0:
        un += nx * v[j, 0] + ny * v[j, 1] + rows[m, ARM_NJ] * v[j, 2]
        ut += ny * v[j, 0] - nx * v[j, 1] + rows[m, ARM_TJ] * v[j, 2]
    p_new, q_new = _solve_contact(
        un, ut, p, q, rows[m, W_NN], rows[m, W_NT], rows[m, W_TT], rows[m, MU], relaxation, coulomb
    )
    dp, dq = p_new - p, q_new - q
    if dp == 0.0 and dq == 0.0:
        return
    rows[m, P], rows[m, Q] = p_new, q_new
    fx, fy = -nx * dp - ny * dq, -ny * dp + nx * dq
    if i >= 0:
        v[i, 0] += inverse_mass[i, 0] * fx
        v[i, 1] += inverse_mass[i, 1] * fy
        v[i, 2] += inverse_mass[i, 2] * (rows[m, ARM_NI] * dp + rows[m, ARM_TI] * dq)
    if j >= 0:
        v[j, 0] -= inverse_mass[j, 0] * fx
        v[j, 1] -= inverse_mass[j, 1] * fy
        v[j, 2] += inverse_mass[j, 2] * (rows[m, ARM_NJ] * dp + rows[m, ARM_TJ] * dq)


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
    contacts: Contacts,
    offset: Floats,
    shear_0: Floats,
    blocks: Floats,
    r: Floats,
    pairs: Ints,
    rows: Floats,
) -> None:
    """Rows, shape (c, `ROW`), of the contacts in ``order``, and the numbers ``pairs``, shape (c, 2), of their bodies."""
    _, normal, arms, mu, compliance = contacts
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
