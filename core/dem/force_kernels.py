"""Forces of disks on each other and on walls: linear spring, dashpot without tension, incremental shear, Coulomb cap.

Source: Cundall & Strack, Geotechnique 29 (1979) 47-65; conventions of `ninedisk.core.scene`: ``n`` points from ``i`` to
``j``, ``t = (-n_y, n_x)``, the force on ``i`` is ``-fn n + fs t``. With lever arms ``a_i, a_j`` the slip of ``i`` past ``j`` is
``vt = (v_i - v_j).t + a_i omega_i + a_j omega_j`` and both bodies receive the torque ``a fs``; a law may take another arm for the
torque than for the slip.

With velocities of ``t_{n-1/2}`` the slip of a step is the midpoint rule where normal, arms and walls are those of that time, too. Between
disks that are ``d = x_j - x_i`` apart at ``t_n`` these are those of ``m = d - (dt/2) d'``, and since ``m x d' = d x d'`` the turned
tangent ``t_m`` gives ``-t_m.d' = -(d x d')/|m|``: the slip by translation with the normal of ``t_n``, times ``|d|/|m|``. With the
normal of ``t_n`` it is of first order, and drifts along closed paths (`ContactLaw.slip_at`).

Contacts between disks are computed by chunks of the neighbour list. A loop that looks at a pair, decides whether it touches and finds its
forces is bound by wrong guesses of the processor: which pairs touch, and how many partners a disk has. So the pairs of a chunk go through
three loops without any branch: differences of the two disks into a scratch in the fastest cache, forces of all pairs in vector registers
(a pair out of contact gets zero), sums into the disks.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_inline_kernel, fused_kernel, inline_kernel, kernel
from ninedisk.core.dem.state import (
    BETA,
    KN,
    KS,
    MU,
    SLIP_MIDDLE,
    SLIP_OVERLAP,
    TORQUE_OVERLAP,
    WALL_MID,
    DiskArrays,
    NeighbourList,
    Views,
    WallArrays,
)
from ninedisk.core.motion_kernels import (
    DASHPOT_VX,
    DASHPOT_VY,
    NORMAL_X,
    NORMAL_Y,
    PIVOT_VX,
    PIVOT_VY,
    PIVOT_X,
    PIVOT_Y,
    POINT_X,
    POINT_Y,
    TURN_RATE,
)

Index = int | np.uint64
"""Entry of the list: kernels index with unsigned numbers, which plain Python's `range` turns into its own."""

CHUNK = 128
"""Pairs that go through the loops together."""

DX, DY, REACH, VX, VY, ROLL, SPIN, DASHPOT_X, DASHPOT_Y = (np.uint64(c * CHUNK) for c in range(9))
"""Where the scratch holds, for each pair: ``x_j - x_i``, sum of the radii, ``v_i - v_j``, ``R_i omega_i + R_j omega_j``, ``omega_i +
omega_j``, and the difference of the velocities that dashpots see, if they see other ones."""

GX, GY, SHEAR, ARM_LOSS = DX, DY, REACH, VX
"""Where the results take their place: the force on ``i``, ``fs``, and what the overlap takes from each body's torque."""

SCRATCH = 9 * CHUNK


@inline_kernel
def dashpot(kn: float, beta: float, inv_m_eff: float) -> float:
    """Coefficient of the contact dashpot [N s/m] ``2 beta sqrt(m_eff kn)``, from ``inv_m_eff = 1/m_i + 1/m_j`` [1/kg].

    Two bodies that nothing moves have none.
    """
    if inv_m_eff == 0.0:
        return 0.0
    return 2.0 * beta * sqrt(kn / inv_m_eff)


@inline_kernel
def normal_force(overlap: float, rate: float, kn: float, beta: float, inv_m_eff: float) -> float:
    """Normal force [N] ``max(kn overlap + c rate, 0)`` with the dashpot ``c``.

    Parameters
    ----------
    overlap : float
        [m], > 0.
    rate : float
        Time derivative of the overlap [m/s].
    kn : float
        [N/m].
    beta : float
        Contact damping ratio [-].
    inv_m_eff : float
        ``1/m_i + 1/m_j`` [1/kg].
    """
    force = kn * overlap
    if beta > 0.0:
        force = max(force + dashpot(kn, beta, inv_m_eff) * rate, 0.0)
    return force


@fused_inline_kernel
def shear_force(before: float, slip: float, ks: float, cap: float) -> float:
    """Shear force [N] after the slip increment [m], clipped to ``cap = mu fn`` with its sign kept."""
    force = before - ks * slip
    if force > cap:
        return cap
    if force < -cap:
        return -cap
    return force


@inline_kernel
def first_from(pairs: NeighbourList, low: int, high: int, disk: int) -> int:
    """First entry of ``low .. high-1`` whose disk is not below ``disk``; entries ascend."""
    while low < high:
        middle = (low + high) // 2
        if pairs.other[middle] < disk:
            low = middle + 1
        else:
            high = middle
    return low


@inline_kernel
def note_behind(disks: DiskArrays, walls: WallArrays, stripe: int, i: int, w: int, height: float) -> None:
    """Note the disk in row i, whose centre lies ``height`` <= 0 above wall w; fixed disks, which have no contacts with walls, may.

    Every disk behind a wall is in the wall's list, which has no lower limit: one that got there in a single step has moved farther than
    the skin lasts, and the lists are new. Walls that face each other and cross leave every disk behind one of them.
    """
    walls.behind[stripe, 0], walls.behind[stripe, 1], walls.behind[stripe, 2] = 1.0 + disks.name[i], w, height
    walls.passed[0] = 1


@kernel
def disk_wall_forces(
    disks: DiskArrays, walls: WallArrays, pairs: NeighbourList, slip_dt: float, begin: int, end: int, stripe: int
) -> None:
    """Add the forces of the contacts between walls and some disks; update shear forces, add to this stripe's share of the loads.

    Parameters are those of `disk_disk_forces`, the disks being ``begin .. end-1``; rows of ``pairs`` are walls, with
    ascending disks. The normal from disk to wall is the opposite of
    the wall's. The wall's velocity at a point ``q`` is ``v_pivot + spin x (q - pivot)``, with ``q`` the foot of the disk's
    centre on the surface or the middle of the overlap, for the slip at ``t_{n-1/2}`` where that is measured there; the reaction acts at
    the foot.
    """
    dashpot_v = disks.v_now if disks.v_now.shape[0] > 0 else disks.v
    for w in range(walls.now.shape[0]):
        kn, ks, mu, beta = walls.law[w, KN], walls.law[w, KS], walls.law[w, MU], walls.law[w, BETA]
        half, depth = 0.5 * walls.law[w, TORQUE_OVERLAP], 0.5 * walls.law[w, WALL_MID]
        half_slip = 0.5 * walls.law[w, SLIP_OVERLAP]
        rough = mu > 0.0 and ks > 0.0
        px, py, ux, uy = walls.now[w, POINT_X], walls.now[w, POINT_Y], walls.now[w, NORMAL_X], walls.now[w, NORMAL_Y]
        cx, cy, spin = walls.now[w, PIVOT_X], walls.now[w, PIVOT_Y], walls.now[w, TURN_RATE]
        rate_x, rate_y = walls.now[w, DASHPOT_VX], walls.now[w, DASHPOT_VY]
        back, sliding = 0.5 * slip_dt * walls.law[w, SLIP_MIDDLE], walls.now
        if walls.law[w, SLIP_MIDDLE] > 0.0:
            sliding = walls.middle
        sx, sy, tx, ty = sliding[w, POINT_X], sliding[w, POINT_Y], -sliding[w, NORMAL_Y], sliding[w, NORMAL_X]
        vx, vy = (
            sliding[w, PIVOT_VX] + spin * (sliding[w, PIVOT_Y] - sy),
            sliding[w, PIVOT_VY] + spin * (sx - sliding[w, PIVOT_X]),
        )
        load_x, load_y, load_t = walls.share[stripe, w, 0], walls.share[stripe, w, 1], walls.share[stripe, w, 2]
        last = pairs.start[w + 1]
        for k in range(first_from(pairs, pairs.start[w], last, begin), last):
            i = pairs.other[k]
            if i >= end:
                break
            height = (disks.x[i, 0] - px) * ux + (disks.x[i, 1] - py) * uy
            overlap = disks.radius[i] - height
            if overlap <= 0.0:
                pairs.shear[k] = 0.0
                continue
            if height <= 0.0 and disks.inv_mass[i] > 0.0:
                note_behind(disks, walls, stripe, i, w, height)
            foot_x, foot_y = disks.x[i, 0] - height * ux, disks.x[i, 1] - height * uy
            qx, qy = foot_x - depth * overlap * ux - cx, foot_y - depth * overlap * uy - cy
            rate = (rate_x - spin * qy - dashpot_v[i, 0]) * ux + (rate_y + spin * qx - dashpot_v[i, 1]) * uy
            fn = normal_force(overlap, rate, kn, beta, disks.inv_mass[i])
            gx, gy = fn * ux, fn * uy
            if rough:
                arm = disks.radius[i] - half * overlap
                # Along itself a wall moves at all points of its surface as at its own, and deeper down so much less.
                vt = (vx - disks.v[i, 0]) * tx + (vy - disks.v[i, 1]) * ty
                height = (disks.x[i, 0] - back * disks.v[i, 0] - sx) * ty - (
                    disks.x[i, 1] - back * disks.v[i, 1] - sy
                ) * tx
                sunk = disks.radius[i] - height
                vt -= spin * depth * sunk
                vt += (disks.radius[i] - half_slip * sunk) * disks.omega[i]
                fs = shear_force(pairs.shear[k], vt * slip_dt, ks, mu * fn)
                pairs.shear[k] = fs
                gx += fs * uy
                gy -= fs * ux
                disks.torque[i] += arm * fs
            disks.force[i, 0] += gx
            disks.force[i, 1] += gy
            load_x -= gx
            load_y -= gy
            load_t -= foot_x * gy - foot_y * gx
        walls.share[stripe, w, 0], walls.share[stripe, w, 1], walls.share[stripe, w, 2] = load_x, load_y, load_t


@kernel
def note_pairs(disks: DiskArrays, views: Views, pairs: NeighbourList, law: NDArray[np.float64]) -> None:
    """Row and dashpot coefficient [N s/m] of each listed pair, into ``views``."""
    for i in range(disks.x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            views.row[k] = i
            views.damping[k] = dashpot(law[KN], law[BETA], disks.inv_mass[i] + disks.inv_mass[pairs.other[k]])


@fused_inline_kernel
def gather(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    begin: Index,
    end: Index,
    scratch: NDArray[np.float64],
) -> None:
    """Differences of the disks of the pairs ``begin .. end-1``, into the scratch."""
    x, v, radius, omega, row, other = views.x, views.v, disks.radius, disks.omega, views.row, pairs.other
    one = np.uint64(1)
    for k in range(begin, end):
        q, i, j = k - begin, np.uint64(row[k]), np.uint64(other[k])
        ix, iy, jx, jy = i + i, i + i + one, j + j, j + j + one
        ri, rj, wi, wj = radius[i], radius[j], omega[i], omega[j]
        scratch[DX + q], scratch[DY + q], scratch[REACH + q] = x[jx] - x[ix], x[jy] - x[iy], ri + rj
        scratch[VX + q], scratch[VY + q] = v[ix] - v[jx], v[iy] - v[jy]
        scratch[ROLL + q], scratch[SPIN + q] = ri * wi + rj * wj, wi + wj


@fused_inline_kernel
def gather_dashpots(views: Views, pairs: NeighbourList, begin: Index, end: Index, scratch: NDArray[np.float64]) -> None:
    """Differences of the velocities that dashpots see, into the scratch."""
    dashpot_v, row, other = views.dashpot_v, views.row, pairs.other
    one = np.uint64(1)
    for k in range(begin, end):
        q, i, j = k - begin, np.uint64(row[k]), np.uint64(other[k])
        scratch[DASHPOT_X + q] = dashpot_v[i + i] - dashpot_v[j + j]
        scratch[DASHPOT_Y + q] = dashpot_v[i + i + one] - dashpot_v[j + j + one]


def _pair_forces(dashpot_x: np.uint64, dashpot_y: np.uint64) -> Callable[..., None]:
    """Kernel of the forces where the scratch holds the velocities that dashpots see at ``dashpot_x`` and ``dashpot_y``.

    The compiler has to know all distances in the scratch: only then it finds that no pair waits for another one.
    """

    @fused_inline_kernel
    def pair_forces(
        pairs: NeighbourList,
        damping: NDArray[np.float64],
        law: NDArray[np.float64],
        slip_dt: float,
        begin: Index,
        end: Index,
        scratch: NDArray[np.float64],
    ) -> None:
        """Forces of the pairs ``begin .. end-1`` from their differences, which they replace; updates the shear forces."""
        shear = pairs.shear
        kn, ks = law[KN], law[KS]
        mu = law[MU] if ks > 0.0 else 0.0
        half, half_slip = 0.5 * law[TORQUE_OVERLAP], 0.5 * law[SLIP_OVERLAP]
        back = 0.5 * slip_dt * law[SLIP_MIDDLE]
        for q in range(end - begin):
            k = begin + q
            dx, dy = scratch[DX + q], scratch[DY + q]
            d = sqrt(dx * dx + dy * dy)
            overlap, inv_d = scratch[REACH + q] - d, 1.0 / d
            nx, ny = dx * inv_d, dy * inv_d
            rate = scratch[dashpot_x + q] * nx + scratch[dashpot_y + q] * ny
            fn = max(kn * overlap + damping[k] * rate, 0.0)
            vx, vy = scratch[VX + q], scratch[VY + q]
            mx, my = dx + back * vx, dy + back * vy
            inv_m = 1.0 / sqrt(mx * mx + my * my)
            vt = (vy * dx - vx * dy) * inv_m
            vt += scratch[ROLL + q] - half_slip * (scratch[REACH + q] - (mx * mx + my * my) * inv_m) * scratch[SPIN + q]
            fs = shear_force(shear[k], vt * slip_dt, ks, mu * fn)
            if overlap <= 0.0:
                fn, fs = 0.0, 0.0
            shear[k] = fs
            scratch[GX + q], scratch[GY + q] = -fn * nx - fs * ny, fs * nx - fn * ny
            scratch[SHEAR + q], scratch[ARM_LOSS + q] = fs, half * overlap * fs

    return pair_forces


pair_forces_lagged, pair_forces_extrapolated = _pair_forces(VX, VY), _pair_forces(DASHPOT_X, DASHPOT_Y)


@fused_inline_kernel
def scatter(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    begin: Index,
    end: Index,
    scratch: NDArray[np.float64],
) -> None:
    """Add the forces of the pairs ``begin .. end-1`` to their disks, pair by pair in the order of the list."""
    force, torque, radius, row, other = views.force, disks.torque, disks.radius, views.row, pairs.other
    one = np.uint64(1)
    for k in range(begin, end):
        q, i, j = k - begin, np.uint64(row[k]), np.uint64(other[k])
        ix, iy, jx, jy = i + i, i + i + one, j + j, j + j + one
        gx, gy, fs, loss = scratch[GX + q], scratch[GY + q], scratch[SHEAR + q], scratch[ARM_LOSS + q]
        force[ix] += gx
        force[iy] += gy
        force[jx] -= gx
        force[jy] -= gy
        torque[i] += radius[i] * fs - loss
        torque[j] += radius[j] * fs - loss


@fused_kernel
def disk_disk_forces(
    disks: DiskArrays,
    views: Views,
    pairs: NeighbourList,
    law: NDArray[np.float64],
    slip_dt: float,
    begin: int,
    end: int,
    scratch: NDArray[np.float64],
) -> None:
    """Add the forces of the disk-disk contacts in some rows to ``disks.force`` and ``disks.torque``; update shear forces.

    Parameters
    ----------
    disks : DiskArrays
    views : Views
        The same disks, and the list's rows and dashpots as `note_pairs` finds them.
    pairs : NeighbourList
        Rows are the disks with the smaller number.
    law : ndarray, shape (8,)
        Law row.
    slip_dt : float
        Time over which slip accumulates [s]: ``dt``, or 0 for the forces at time 0.
    begin, end : int
        Rows of the list.
    scratch : ndarray, shape (SCRATCH,)
        This thread's own.
    """
    chunk = np.uint64(CHUNK)
    extrapolated = disks.v_now.shape[0] > 0
    last = np.uint64(pairs.start[end])
    for low in range(np.uint64(pairs.start[begin]), last, chunk):
        high = min(low + chunk, last)
        gather(disks, views, pairs, low, high, scratch)
        if extrapolated:
            gather_dashpots(views, pairs, low, high, scratch)
            pair_forces_extrapolated(pairs, views.damping, law, slip_dt, low, high, scratch)
        else:
            pair_forces_lagged(pairs, views.damping, law, slip_dt, low, high, scratch)
        scatter(disks, views, pairs, low, high, scratch)
