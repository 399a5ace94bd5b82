"""Kernels of the loop over central-difference steps.

One cycle: positions of disks and walls at ``t_n``, forces at ``t_n``, velocities at ``t_{n+1/2}``, positions at ``t_{n+1}``.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.force_kernels import disk_disk_forces, disk_wall_forces, note_pairs
from ninedisk.core.dem.grain_kernels import grain_forces
from ninedisk.core.dem.kick_kernels import farther, kick_and_drift
from ninedisk.core.dem.neighbour_kernels import OK, Cells, NeighbourList, next_skin, rebuild
from ninedisk.core.dem.sample_kernels import record, record_contacts
from ninedisk.core.dem.state import (
    BEHIND_WALL,
    BUILT,
    CODE,
    GRAINS_STOPPED,
    PENDING,
    REBUILDS,
    ROW,
    STEP,
    DiskArrays,
    Kick,
    Outlines,
    Samples,
    StepConstants,
    Team,
    Views,
    WallArrays,
)
from ninedisk.core.motion_kernels import WallMotion, place_walls
from ninedisk.core.thread_kernels import PAD, wait_for_all

BLOCK = 2048
"""Disks whose forces are found before they are kicked, so many as stay in the second cache (300 kB) and the memory behind it still
sees long runs."""

SURE = 1.001
"""Displacements since a rebuild are summed in single precision: ten thousand roundings of 6e-8 each stay below a thousandth."""


@inline_kernel
def wall_drift(walls: WallArrays, skin: float) -> float:
    """Bound on how far a wall's surface came closer to any disk since the last rebuild [m].

    The height ``h = (x - p).n`` changes by ``(x - p).(n - n_b) - (p - p_b).n_b``; a wall that slides along itself counts 0.
    """
    worst = 0.0
    for w in range(walls.now.shape[0]):
        px, py = walls.now[w, 0] - walls.built[w, 0], walls.now[w, 1] - walls.built[w, 1]
        nx, ny = walls.now[w, 2] - walls.built[w, 2], walls.now[w, 3] - walls.built[w, 3]
        along = abs(px * walls.built[w, 2] + py * walls.built[w, 3])
        turn = sqrt(nx * nx + ny * ny)
        if turn > 0.0:
            turn *= walls.extent[w] + skin + sqrt(px * px + py * py)
        worst = max(worst, along + turn)
    return worst


@inline_kernel
def clear_share(walls: WallArrays, stripe: int) -> None:
    """Begin a new sum of the stripe's share of the loads."""
    for w in range(walls.now.shape[0]):
        for c in range(3):
            walls.share[stripe, w, c] = 0.0


@inline_kernel
def stripe_forces(
    disks: DiskArrays,
    views: Views,
    walls: WallArrays,
    pairs: NeighbourList,
    wall_pairs: NeighbourList,
    law: NDArray[np.float64],
    slip_dt: float,
    kick: Kick,
    moves_on: bool,
    team: Team,
    parity: int,
    me: int,
    crew: int,
) -> float:
    """Forces of every ``crew``-th even (parity 0) or odd (1) stripe, beginning with thread ``me``'s first.

    Disks that are in order and have been a row of the list have all their forces, and no later row reads them. So, if the step
    ``moves_on``, they are kicked block by block, while they are in the fast caches: all in odd stripes, whose even neighbours are
    done; in even ones all but those of the border, which the odd stripe before still touches.

    Returns
    -------
    float
        Largest squared displacement of the kicked disks since the last rebuild [m^2]; NaN if any is NaN.
    """
    stripe = team.stripe
    far = 0.0
    for s in range(parity + 2 * me, stripe.shape[0] - 1, 2 * crew):
        end = stripe[s + 1]
        kicked_from = team.border[s] if parity == 0 else stripe[s]
        clear_share(walls, s)
        for low in range(stripe[s], end, BLOCK):
            high = min(low + BLOCK, end)
            disk_disk_forces(disks, views, pairs, law, slip_dt, low, high, team.scratch[me])
            # Disks at a wall are few and far between: the pairs have brought them into the caches.
            disk_wall_forces(disks, walls, wall_pairs, slip_dt, low, high, s)
            if moves_on:
                far = farther(far, kick_and_drift(disks, views, kick, max(low, kicked_from), high))
    return far


@inline_kernel
def kick_borders(disks: DiskArrays, views: Views, kick: Kick, team: Team, me: int, crew: int) -> float:
    """Kick of the borders of the even stripes of thread ``me``; returns what `kick_and_drift` does."""
    far = 0.0
    for s in range(2 * me, team.stripe.shape[0] - 1, 2 * crew):
        far = farther(far, kick_and_drift(disks, views, kick, team.stripe[s], team.border[s]))
    return far


@inline_kernel
def gather_loads(walls: WallArrays) -> None:
    """Loads of the walls from the shares of the stripes, summed in the order of the stripes."""
    for w in range(walls.now.shape[0]):
        for c in range(3):
            total = 0.0
            for s in range(walls.share.shape[0]):
                total += walls.share[s, w, c]
            walls.load[w, c] = total


@inline_kernel
def wall_work_of_step(walls: WallArrays, dt: float) -> float:
    """Work of the walls on the disks during the last step [J], loads by the trapezoidal rule; keeps the loads."""
    work = 0.0
    for w in range(walls.now.shape[0]):
        fx = 0.5 * (walls.load[w, 0] + walls.load_before[w, 0])
        fy = 0.5 * (walls.load[w, 1] + walls.load_before[w, 1])
        torque = 0.5 * (walls.load[w, 2] + walls.load_before[w, 2])
        torque -= walls.now[w, 4] * fy - walls.now[w, 5] * fx
        work -= dt * (fx * walls.now[w, 6] + fy * walls.now[w, 7] + torque * walls.now[w, 8])
        for c in range(3):
            walls.load_before[w, c] = walls.load[w, c]
    return work


@kernel
def advance(
    me: int,
    crew: int,
    disks: DiskArrays,
    views: Views,
    walls: WallArrays,
    motion: WallMotion,
    pairs: NeighbourList,
    wall_pairs: NeighbourList,
    spare: NeighbourList,
    wall_spare: NeighbourList,
    cells: Cells,
    law: NDArray[np.float64],
    step: StepConstants,
    samples: Samples,
    team: Team,
    outlines: Outlines | None,
    clock: NDArray[np.int64],
    work: NDArray[np.float64],
    skin: NDArray[np.float64],
    widest: float,
    target: int,
) -> int:
    """Advance to contact step ``target``; sample on the way. All threads of a crew call it with the same arguments but ``me``.

    Thread 0 alone moves the walls, rebuilds, sums loads and samples; a barrier separates what one thread writes from what another
    one reads.

    Parameters
    ----------
    me, crew : int
        This thread's number and the number of threads.
    disks, views, walls, motion, pairs, wall_pairs, law, step, samples, team
        See their classes; ``law`` is the disk-disk law row, shape (8,).
    spare, wall_spare, cells
        Work arrays of the rebuild.
    outlines : Outlines or None
        None, for which the compiler leaves out whatever concerns outlines, if all bodies are disks with the disks' law.
    clock : ndarray of int64, shape (5,)
        See `ninedisk.core.dem.state`; in and out.
    work : ndarray, shape (1,)
        Work of the walls so far [J]; in and out.
    skin : ndarray, shape (1,)
        Skin of the lists in use [m]; in and out.
    widest : float
        Largest radius [m].
    target : int

    Returns
    -------
    int
        OK when ``target`` is reached. Otherwise a code of `search_kernels`, or `GRAINS_STOPPED`, with ``clock[PENDING]`` = 1: the caller
        mends the cause (grows a list) and calls again; after `BEHIND_WALL` nothing can go on.
    """
    n, row = clock[STEP], clock[ROW]
    pending = clock[PENDING] == 1
    stale = pending and clock[BUILT] < n
    moved_on = False
    far = 0.0
    wait_for_all(team.flags, me, crew)
    while n < target or pending:
        if not pending:
            if not moved_on:
                count = disks.x.shape[0]
                kick = step.first if n == 0 else step.kick
                far = kick_and_drift(disks, views, kick, count * me // crew, count * (me + 1) // crew)
            team.far[me * PAD] = far
            n += 1
            if me == 0:
                clock[STEP], clock[PENDING] = n, 1
                t, t_half = n * step.kick.dt, (n - 0.5) * step.kick.dt
                place_walls(motion, t, t_half, t_half if step.lagged else t, walls.now)
                place_walls(motion, t_half, t_half, t_half, walls.middle)
            wait_for_all(team.flags, me, crew)
            for other in range(crew):
                far = farther(far, team.far[other * PAD])
            limit = min(0.5 * skin[0], skin[0] - wall_drift(walls, skin[0]))
            stale = not (limit > 0.0 and SURE * far < limit * limit)
        if stale:
            wait_for_all(team.flags, me, crew)
            if me == 0:
                wider = next_skin(skin[0], n - clock[BUILT], step)
                team.code[0] = rebuild(
                    disks, walls, pairs, wall_pairs, spare, wall_spare, cells, team, wider, widest, step.sorted
                )
                if team.code[0] == OK:
                    note_pairs(disks, views, pairs, law)
                    skin[0], clock[BUILT] = wider, n
                    clock[REBUILDS] += 1
            wait_for_all(team.flags, me, crew)
            if team.code[0] != OK:
                return int(team.code[0])
        pending, stale = False, False
        slip_dt = step.kick.dt if n > 0 else 0.0
        sampled = row < samples.at.shape[0] and samples.at[row] == n
        moved_on = False
        if outlines is None:
            # Samples and the end of the run need the forces at this step, which a kick clears.
            moved_on = 0 < n < target and not sampled
            far = stripe_forces(
                disks, views, walls, pairs, wall_pairs, law, slip_dt, step.kick, moved_on, team, 0, me, crew
            )
            wait_for_all(team.flags, me, crew)
            far = farther(
                far,
                stripe_forces(
                    disks, views, walls, pairs, wall_pairs, law, slip_dt, step.kick, moved_on, team, 1, me, crew
                ),
            )
            wait_for_all(team.flags, me, crew)
            if moved_on and walls.passed[0] == 0:
                far = farther(far, kick_borders(disks, views, step.kick, team, me, crew))
        else:
            if me == 0:
                grain_forces(disks, walls, pairs, wall_pairs, law, outlines, step, n, slip_dt)
            wait_for_all(team.flags, me, crew)
            if outlines.memory.mark[CODE] != 0:
                return GRAINS_STOPPED
        if walls.passed[0] != 0:
            return BEHIND_WALL
        if me == 0:
            gather_loads(walls)
            work[0] += wall_work_of_step(walls, slip_dt)
            clock[PENDING] = 0
            if sampled:
                record(disks, views, walls, pairs, wall_pairs, law, step, samples, row, n == 0, work[0])
                if outlines is not None:
                    record_contacts(disks, walls, law, outlines, samples, row)
                clock[ROW] = row + 1
        if sampled:
            row += 1
            wait_for_all(team.flags, me, crew)
    wait_for_all(team.flags, me, crew)
    return OK
