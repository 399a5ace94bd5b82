"""Kernels of the steps of the DEM of spheres, side by side in threads.

Leapfrog: ``v_{n+1/2} = v_{n-1/2} + dt F_n/m``, ``x_{n+1} = x_n + dt v_{n+1/2}``, begun by half a kick.

Spheres are divided into stripes of layers of cells as disks are into stripes of rows (`ninedisk.core.dem.state.Team`): even stripes at
once, then odd ones, and every sum is formed in an order that does not depend on the number of threads.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_kernel, inline_kernel, kernel
from ninedisk.core.dem.kick_kernels import NUMBER, farther
from ninedisk.core.dem.state import Team
from ninedisk.core.spheres.kernels import (
    FOUR,
    ONE,
    TWO,
    Contacts,
    Floats,
    Integers,
    Losses,
    Motion,
    State,
    cross,
    dot,
    forces_of_planes,
    forces_of_spheres,
    place_planes,
    plus,
    row,
    scaled,
)
from ninedisk.core.spheres.registers import blend, scale
from ninedisk.core.thread_kernels import PAD, wait_for_all

SURE = 1.001
"""Displacements since a rebuild are summed in single precision: ten thousand roundings of 6e-8 each stay below a thousandth."""

BLOCK = 512
"""Spheres whose forces are found before they are kicked, so many as stay in the second cache."""

STEP, PENDING, BUILT, REBUILDS = range(4)
"""Entries of the clock: contact steps done, 1 while the forces of this step are missing, step of the last rebuild, rebuilds so far."""

OK, FAR, BEHIND = 0, 1, 2
"""Why `advance` ended: all steps done, the lists of neighbours are too old, a centre is behind a plane."""


@inline_kernel
def farthest(moved: NDArray[np.float32], begin: int, end: int) -> float:
    """Largest square of the displacements of the spheres ``begin .. end-1`` [m^2]; NaN if any is NaN (`ninedisk.core.dem.kick_kernels`)."""
    bits = np.int32(0)
    for i in range(np.uint64(begin), np.uint64(end)):
        a, b, c = moved[FOUR * i], moved[FOUR * i + ONE], moved[FOUR * i + TWO]
        bits = max(bits, np.int32(np.float32(a * a + b * b + c * c).view(np.int32) & NUMBER))
    return float(np.int32(bits).view(np.float32))


@fused_kernel
def kick_and_drift(state: State, gravity: Floats, dt: float, first: bool, central: bool, begin: int, end: int) -> float:
    """Velocities to ``t_{n+1/2}``, positions to ``t_{n+1}`` of the spheres ``begin .. end-1``; their forces become their weights.

    ``first``: from ``t_0``, by half a kick. Each loop writes to few arrays, so that the compiler can take several spheres at a time.

    Returns
    -------
    float
        Largest squared displacement since the last rebuild of the lists [m^2]; NaN if any is NaN.
    """
    x, v, omega, angle, force, torque = state.x, state.v, state.omega, state.angle, state.force, state.torque
    mobility, inv_inertia, mass, moved, v_now = state.mobility, state.inv_inertia, state.mass, state.moved, state.v_now
    kick, ahead = (0.5 * dt, 1.0) if first else (dt, 0.5)
    low, high = FOUR * np.uint64(begin), FOUR * np.uint64(end)
    sees_spins = state.omega_now.shape[0] > 0
    if central:
        for q in range(low, high):
            gain = kick * mobility[q] * force[q]
            v[q] += gain
            v_now[q] = v[q] + ahead * gain
    else:
        for q in range(low, high):
            v[q] += kick * mobility[q] * force[q]
    for q in range(low, high):
        way = dt * v[q]
        x[q] += way
        moved[q] = np.float32(moved[q] + way)
    for i in range(np.uint64(begin), np.uint64(end)):
        blend(omega, i, 1.0, omega, i, kick * inv_inertia[i], torque, i)
        if sees_spins:
            blend(state.omega_now, i, 1.0, omega, i, ahead * kick * inv_inertia[i], torque, i)
        blend(angle, i, 1.0, angle, i, dt, omega, i)
        scale(force, i, mass[i], gravity, np.uint64(0))
    for q in range(low, high):
        torque[q] = 0.0
    return farthest(moved, begin, end)


@inline_kernel
def stripe_forces(
    state: State,
    pairs: Contacts,
    at_planes: Contacts,
    laws: Floats,
    losses: Losses | None,
    team: Team,
    picked: Integers,
    gravity: Floats,
    dt: float,
    slip_dt: float,
    central: bool,
    moves_on: bool,
    parity: int,
    thread: int,
    threads: int,
) -> float:
    """Forces of every ``threads``-th even (parity 0) or odd (1) stripe, beginning with the first one of this thread.

    Spheres that have been a row of the list have all their forces, and no later row reads them. So, if the step ``moves_on``, they are
    kicked block by block: all in odd stripes, whose even neighbours are done; in even ones all but those of the border, which the odd
    stripe before still touches.

    Returns
    -------
    float
        What `kick_and_drift` does.
    """
    loss_dt = dt if slip_dt > 0.0 else 0.5 * dt
    stripe, scratch, mine = team.stripe, team.scratch[thread], picked[thread]
    far = 0.0
    for s in range(parity + 2 * thread, stripe.shape[0] - 1, 2 * threads):
        end = stripe[s + 1]
        kicked_from = team.border[s] if parity == 0 else stripe[s]
        for w in range(state.share.shape[1]):
            for c in range(3):
                state.share[s, w, c] = 0.0
                if losses is not None:
                    losses.torque[s, w, c] = 0.0
        for low in range(stripe[s], end, BLOCK):
            high = min(low + BLOCK, end)
            forces_of_spheres(
                state, pairs, laws, losses, slip_dt, loss_dt, central, not moves_on, low, high, s, scratch, mine
            )
            forces_of_planes(
                state, at_planes, laws, losses, slip_dt, loss_dt, central, not moves_on, low, high, s, scratch, mine
            )
            if moves_on:
                far = farther(far, kick_and_drift(state, gravity, dt, False, central, max(low, kicked_from), high))
    return far


@inline_kernel
def any_behind(state: State) -> bool:
    """Whether a stripe has noted a centre behind a plane."""
    found = False
    for s in range(state.behind.shape[0]):
        found = found or state.behind[s, 0] > 0
    return found


@inline_kernel
def gather_loads(state: State) -> None:
    """Loads of the planes, from the shares in the order of the stripes."""
    for w in range(state.load.shape[0]):
        for c in range(3):
            total = 0.0
            for s in range(state.share.shape[0]):
                total += state.share[s, w, c]
            state.load[w, c] = total


@inline_kernel
def lost(losses: Losses, channel: int) -> float:
    """Energy lost in a channel since time 0 [J], in an order that does not depend on the number of threads."""
    total = 0.0
    for s in range(losses.contacts.shape[0]):
        total += losses.contacts[s, channel]
    return total


@inline_kernel
def work_of_planes(state: State, losses: Losses, dt: float) -> None:
    """Add the work of the planes on the spheres in the last step, forces and torques by the trapezoidal rule."""
    loads = losses.loads
    for w in range(state.load.shape[0]):
        for c in range(6):
            loads[w, 1, c] = loads[w, 0, c]
        for c in range(3):
            loads[w, 0, c], loads[w, 0, 3 + c] = state.load[w, c], 0.0
            for s in range(losses.torque.shape[0]):
                loads[w, 0, 3 + c] += losses.torque[s, w, c]
        force = scaled(plus(row(loads[w], 0, 0), 1.0, row(loads[w], 1, 0)), 0.5)
        torque = scaled(plus(row(loads[w], 0, 3), 1.0, row(loads[w], 1, 3)), 0.5)
        torque = plus(torque, -1.0, cross(row(state.middle, w, 6), force))
        losses.work[0] -= dt * (dot(force, row(state.middle, w, 9)) + dot(torque, row(state.middle, w, 12)))


@kernel
def advance(
    thread: int,
    threads: int,
    state: State,
    pairs: Contacts,
    at_planes: Contacts,
    laws: Floats,
    motion: Motion,
    team: Team,
    picked: Integers,
    clock: Integers,
    gravity: Floats,
    target: int,
    dt: float,
    skin: float,
    central: bool,
    losses: Losses | None,
) -> int:
    """Steps until ``clock[STEP]`` is ``target``, with its forces; all threads call it with the same arguments but their number.

    Returns
    -------
    int
        OK; FAR if step ``clock[STEP]`` wants new lists before its forces; BEHIND, with ``state.behind``.
    """
    n, pending = clock[STEP], clock[PENDING] == 1
    count, stripe, border = state.radius.shape[0], team.stripe, team.border
    moved_on = False
    far = 0.0
    wait_for_all(team.flags, thread, threads)
    while n < target or pending:
        if not pending:
            if not moved_on:
                begin, end = count * thread // threads, count * (thread + 1) // threads
                far = kick_and_drift(state, gravity, dt, n == 0, central, begin, end)
            team.far[thread * PAD] = far
            n += 1
        if thread == 0:
            clock[STEP], clock[PENDING] = n, 1
            place_planes(motion, n * dt, state.now)
            place_planes(motion, max((n - 0.5) * dt, 0.0), state.middle)
            place_planes(motion, max((n - 1) * dt, 0.0), state.before)
            if losses is not None and n == target:
                for c in range(losses.before.shape[0]):
                    losses.before[c] = lost(losses, c)
        wait_for_all(team.flags, thread, threads)
        if not pending:
            for other in range(threads):
                far = farther(far, team.far[other * PAD])
            if not 4.0 * SURE * far < skin * skin:
                return FAR
        pending = False
        moved_on = 0 < n < target
        slip_dt = dt if n > 0 else 0.0
        far = stripe_forces(
            state,
            pairs,
            at_planes,
            laws,
            losses,
            team,
            picked,
            gravity,
            dt,
            slip_dt,
            central,
            moved_on,
            0,
            thread,
            threads,
        )
        wait_for_all(team.flags, thread, threads)
        odd = stripe_forces(
            state,
            pairs,
            at_planes,
            laws,
            losses,
            team,
            picked,
            gravity,
            dt,
            slip_dt,
            central,
            moved_on,
            1,
            thread,
            threads,
        )
        far = farther(far, odd)
        wait_for_all(team.flags, thread, threads)
        if any_behind(state):
            return BEHIND
        if thread == 0:
            gather_loads(state)
            if losses is not None:
                work_of_planes(state, losses, slip_dt)
            clock[PENDING] = 0
        if moved_on:
            for s in range(2 * thread, stripe.shape[0] - 1, 2 * threads):
                far = farther(far, kick_and_drift(state, gravity, dt, False, central, stripe[s], border[s]))
    wait_for_all(team.flags, thread, threads)
    return OK
