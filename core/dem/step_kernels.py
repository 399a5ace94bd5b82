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
from ninedisk.core.contacts.search_kernels import (
    NOT_FINITE,
    OK,
    Cells,
    NeighbourList,
    build_pairs,
    build_wall_pairs,
    sort_into_cells,
)
from ninedisk.core.dem.force_kernels import disk_disk_forces, disk_wall_forces
from ninedisk.core.dem.sample_kernels import record
from ninedisk.core.dem.state import PENDING, REBUILDS, ROW, STEP, DiskArrays, Samples, StepConstants, WallArrays
from ninedisk.core.geometry.motion_kernels import WallMotion, place_walls


@kernel
def kick_and_drift(disks: DiskArrays, step: StepConstants, first: bool) -> float:
    """Velocities to ``t_{n+1/2}``, positions to ``t_{n+1}``.

    Parameters
    ----------
    disks : DiskArrays
    step : StepConstants
    first : bool
        True for the half kick from ``t_0``.

    Returns
    -------
    float
        Largest squared displacement since the last rebuild [m^2]; NaN if any is NaN.
    """
    keep, gain = (step.keep0, step.gain0) if first else (step.keep, step.gain)
    # v_n is extrapolated from v_{n-1/2} with the acceleration before: half the kick, or all of it after the half kick.
    ahead = 0.0 if step.lagged else (1.0 if first else 0.5)
    far = 0.0
    for i in range(disks.x.shape[0]):
        vx = keep * disks.v[i, 0] + gain * (disks.force[i, 0] * disks.inv_mass[i] + step.gravity_x)
        vy = keep * disks.v[i, 1] + gain * (disks.force[i, 1] * disks.inv_mass[i] + step.gravity_y)
        if step.damped:
            disks.v_now[i, 0] = vx + ahead * (vx - disks.v[i, 0])
            disks.v_now[i, 1] = vy + ahead * (vy - disks.v[i, 1])
        disks.v[i, 0], disks.v[i, 1] = vx, vy
        x, y = disks.x[i, 0] + step.dt * vx, disks.x[i, 1] + step.dt * vy
        disks.x[i, 0], disks.x[i, 1] = x, y
        if disks.inv_inertia[i] > 0.0:
            disks.omega[i] = keep * disks.omega[i] + gain * (disks.torque[i] * disks.inv_inertia[i])
        disks.angle[i] += step.dt * disks.omega[i]
        dx, dy = x - disks.x_built[i, 0], y - disks.x_built[i, 1]
        d2 = dx * dx + dy * dy
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
def mark_built(disks: DiskArrays, walls: WallArrays) -> None:
    """Remember the positions of the rebuild that just happened."""
    for i in range(disks.x.shape[0]):
        disks.x_built[i, 0], disks.x_built[i, 1] = disks.x[i, 0], disks.x[i, 1]
    for w in range(walls.now.shape[0]):
        extent = 0.0
        for c in range(9):
            walls.built[w, c] = walls.now[w, c]
        for i in range(disks.x.shape[0]):
            dx, dy = disks.x[i, 0] - walls.now[w, 0], disks.x[i, 1] - walls.now[w, 1]
            extent = max(extent, dx * dx + dy * dy)
        walls.extent[w] = sqrt(extent)


@inline_kernel
def copy_list(source: NeighbourList, target: NeighbourList) -> None:
    """Copy a freshly built list over the one in use."""
    rows = source.start.shape[0]
    for k in range(rows):
        target.start[k] = source.start[k]
    for k in range(source.start[rows - 1]):
        target.other[k] = source.other[k]
        target.shear[k] = source.shear[k]


@kernel
def rebuild(
    disks: DiskArrays,
    walls: WallArrays,
    pairs: NeighbourList,
    wall_pairs: NeighbourList,
    spare: NeighbourList,
    wall_spare: NeighbourList,
    cells: Cells,
    skin: float,
    widest: float,
) -> int:
    """Rebuild both lists, shear forces carried over; on any code but OK the lists in use are untouched."""
    if not sort_into_cells(disks.x, 2.0 * widest + skin, cells):
        return NOT_FINITE
    code = build_pairs(disks.x, disks.radius, skin, cells, pairs, spare)
    if code != OK:
        return code
    code = build_wall_pairs(disks.x, disks.radius, skin, walls.now, wall_pairs, wall_spare)
    if code != OK:
        return code
    copy_list(spare, pairs)
    copy_list(wall_spare, wall_pairs)
    mark_built(disks, walls)
    return OK


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
    clock: NDArray[np.int64],
    work: NDArray[np.float64],
    widest: float,
    target: int,
) -> int:
    """Advance to contact step ``target``; sample on the way.

    Parameters
    ----------
    disks, walls, motion, pairs, wall_pairs, law, step, samples
        See their classes; ``law`` is the disk-disk law row, shape (6,).
    spare, wall_spare, cells
        Work arrays of the rebuild.
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
        OK when ``target`` is reached. Otherwise a code of `search_kernels`, with ``clock[PENDING]`` = 1: the caller mends the
        cause (grows a list) and calls again.
    """
    skin = step.skin
    while clock[STEP] < target or clock[PENDING] == 1:
        n = clock[STEP]
        stale = clock[PENDING] == 1
        if not stale:
            far = kick_and_drift(disks, step, n == 0)
            n += 1
            clock[STEP] = n
            clock[PENDING] = 1
            t, t_half = n * step.dt, (n - 0.5) * step.dt
            place_walls(motion, t, t_half, t_half if step.lagged else t, walls.now)
            limit = min(0.5 * skin, skin - wall_drift(walls, skin))
            stale = not (limit > 0.0 and far < limit * limit)
        if stale:
            code = rebuild(disks, walls, pairs, wall_pairs, spare, wall_spare, cells, skin, widest)
            if code != OK:
                return code
            clock[REBUILDS] += 1
        for i in range(disks.x.shape[0]):
            disks.force[i, 0], disks.force[i, 1], disks.torque[i] = 0.0, 0.0, 0.0
        slip_dt = step.dt if n > 0 else 0.0
        disk_disk_forces(disks, pairs, law, slip_dt)
        disk_wall_forces(disks, walls, wall_pairs, slip_dt)
        work[0] += wall_work_of_step(walls, slip_dt)
        clock[PENDING] = 0
        if clock[ROW] < samples.at.shape[0] and samples.at[clock[ROW]] == n:
            record(disks, walls, pairs, wall_pairs, law, step, samples, clock[ROW], n == 0, work[0])
            clock[ROW] += 1
    return OK
