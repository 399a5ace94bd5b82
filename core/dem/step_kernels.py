"""Kernels of the central-difference step and of the loop over steps.

One cycle: positions of disks and walls at ``t_n``, forces at ``t_n``, velocities at ``t_{n+1/2}``, positions at ``t_{n+1}``.
Global damping ``m a + xi m v = F`` in the central form is ``v+ = ((1 - a) v- + dt F/m)/(1 + a)`` with ``a = xi dt/2``; in the
lagged form ``v+ = v- + dt (F/m - xi v-)``. The start is synchronised: ``v_{1/2} = v_0 + dt (F_0/m - xi v_0)/2``.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core._cache import inline_kernel, kernel
from ninedisk.core._sync import PAD, wait_for_all
from ninedisk.core.contacts.search_kernels import OK, Cells, NeighbourList
from ninedisk.core.dem.force_kernels import disk_disk_forces, disk_wall_forces
from ninedisk.core.dem.grain_kernels import grain_forces
from ninedisk.core.dem.grain_sample_kernels import record_contacts
from ninedisk.core.dem.grain_state import CODE, Outlines
from ninedisk.core.dem.rebuild_kernels import rebuild
from ninedisk.core.dem.sample_kernels import record
from ninedisk.core.dem.state import (
    GRAINS_STOPPED,
    PENDING,
    REBUILDS,
    ROW,
    STEP,
    DiskArrays,
    Samples,
    StepConstants,
    Team,
    WallArrays,
)
from ninedisk.core.geometry.motion_kernels import WallMotion, place_walls

SURE = 1.001
"""Displacements since a rebuild are summed in single precision: ten thousand roundings of 6e-8 each stay below a thousandth."""


@kernel
def kick_and_drift(disks: DiskArrays, step: StepConstants, first: bool, begin: int, end: int) -> float:
    """Velocities to ``t_{n+1/2}``, positions to ``t_{n+1}`` of the disks ``begin .. end-1``; clears their forces.

    Parameters
    ----------
    disks : DiskArrays
    step : StepConstants
    first : bool
        True for the half kick from ``t_0``.
    begin, end : int

    Returns
    -------
    float
        Largest squared displacement since the last rebuild [m^2]; NaN if any is NaN.
    """
    keep, gain = (step.keep0, step.gain0) if first else (step.keep, step.gain)
    # v_n is extrapolated from v_{n-1/2} with the acceleration before: half the kick, or all of it after the half kick.
    ahead = 0.0 if step.lagged else (1.0 if first else 0.5)
    far = 0.0
    for i in range(begin, end):
        vx = keep * disks.v[i, 0] + gain * (disks.force[i, 0] * disks.inv_mass[i] + step.gravity_x)
        vy = keep * disks.v[i, 1] + gain * (disks.force[i, 1] * disks.inv_mass[i] + step.gravity_y)
        if step.damped:
            disks.v_now[i, 0] = vx + ahead * (vx - disks.v[i, 0])
            disks.v_now[i, 1] = vy + ahead * (vy - disks.v[i, 1])
        disks.v[i, 0], disks.v[i, 1] = vx, vy
        dx, dy = step.dt * vx, step.dt * vy
        disks.x[i, 0] += dx
        disks.x[i, 1] += dy
        if disks.inv_inertia[i] > 0.0:
            disks.omega[i] = keep * disks.omega[i] + gain * (disks.torque[i] * disks.inv_inertia[i])
        disks.angle[i] += step.dt * disks.omega[i]
        disks.force[i, 0], disks.force[i, 1], disks.torque[i] = 0.0, 0.0, 0.0
        mx, my = np.float32(disks.moved[i, 0] + dx), np.float32(disks.moved[i, 1] + dy)
        disks.moved[i, 0], disks.moved[i, 1] = mx, my
        d2 = float(mx * mx + my * my)
        if not d2 <= far:
            far = d2
            if not far >= 0.0:
                break
    return far


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
def stripe_forces(
    disks: DiskArrays,
    walls: WallArrays,
    pairs: NeighbourList,
    wall_pairs: NeighbourList,
    law: NDArray[np.float64],
    slip_dt: float,
    stripe: NDArray[np.int64],
    parity: int,
    me: int,
    crew: int,
) -> None:
    """Forces of every ``crew``-th even (parity 0) or odd (1) stripe, beginning with thread ``me``'s first."""
    for s in range(parity + 2 * me, stripe.shape[0] - 1, 2 * crew):
        begin, end = stripe[s], stripe[s + 1]
        disk_disk_forces(disks, pairs, law, slip_dt, begin, end)
        disk_wall_forces(disks, walls, wall_pairs, slip_dt, begin, end, s)


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
    disks, walls, motion, pairs, wall_pairs, law, step, samples, team
        See their classes; ``law`` is the disk-disk law row, shape (7,).
    spare, wall_spare, cells
        Work arrays of the rebuild.
    outlines : Outlines or None
        None, for which the compiler leaves out whatever concerns outlines, if all bodies are disks with the disks' law.
    clock : ndarray of int64, shape (4,)
        See `ninedisk.core.dem.state`; in and out.
    work : ndarray, shape (1,)
        Work of the walls so far [J]; in and out.
    widest : float
        Largest radius [m].
    target : int

    Returns
    -------
    int
        OK when ``target`` is reached. Otherwise a code of `search_kernels`, or `GRAINS_STOPPED`, with ``clock[PENDING]`` = 1: the caller
        mends the cause (grows a list) and calls again.
    """
    skin, n, row = step.skin, clock[STEP], clock[ROW]
    stale = clock[PENDING] == 1
    wait_for_all(team.flags, me, crew)
    while n < target or stale:
        if not stale:
            count = disks.x.shape[0]
            far = kick_and_drift(disks, step, n == 0, count * me // crew, count * (me + 1) // crew)
            team.far[me * PAD] = far
            n += 1
            if me == 0:
                clock[STEP], clock[PENDING] = n, 1
                t, t_half = n * step.dt, (n - 0.5) * step.dt
                place_walls(motion, t, t_half, t_half if step.lagged else t, walls.now)
            wait_for_all(team.flags, me, crew)
            for other in range(crew):
                if not team.far[other * PAD] <= far:
                    far = team.far[other * PAD]
            limit = min(0.5 * skin, skin - wall_drift(walls, skin))
            stale = not (limit > 0.0 and SURE * far < limit * limit)
        if stale:
            if me == 0:
                team.code[0] = rebuild(
                    disks, walls, pairs, wall_pairs, spare, wall_spare, cells, team, skin, widest, step.sorted
                )
                clock[REBUILDS] += 1 if team.code[0] == OK else 0
            wait_for_all(team.flags, me, crew)
            if team.code[0] != OK:
                return int(team.code[0])
        slip_dt = step.dt if n > 0 else 0.0
        if outlines is None:
            stripe_forces(disks, walls, pairs, wall_pairs, law, slip_dt, team.stripe, 0, me, crew)
            wait_for_all(team.flags, me, crew)
            stripe_forces(disks, walls, pairs, wall_pairs, law, slip_dt, team.stripe, 1, me, crew)
            wait_for_all(team.flags, me, crew)
        else:
            if me == 0:
                grain_forces(disks, walls, pairs, wall_pairs, law, outlines, step, n, slip_dt)
            wait_for_all(team.flags, me, crew)
            if outlines.memory.mark[CODE] != 0:
                return GRAINS_STOPPED
        sampled = row < samples.at.shape[0] and samples.at[row] == n
        if me == 0:
            gather_loads(walls)
            work[0] += wall_work_of_step(walls, slip_dt)
            clock[PENDING] = 0
            if sampled:
                record(disks, walls, pairs, wall_pairs, law, step, samples, row, n == 0, work[0])
                if outlines is not None:
                    record_contacts(disks, walls, law, outlines, samples, row)
                clock[ROW] = row + 1
        if sampled:
            row += 1
            wait_for_all(team.flags, me, crew)
        stale = False
    wait_for_all(team.flags, me, crew)
    return OK
