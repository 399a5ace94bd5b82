"""Kernels of the contacts between disks, by chunks of the neighbour list.

A loop that looks at a pair, decides whether it touches and finds its forces is bound by wrong guesses of the processor: which pairs
touch, and how many partners a disk has. So the pairs of a chunk go through three loops without any branch: differences of the two
disks into a scratch in the fastest cache, forces of all pairs in vector registers (a pair out of contact gets zero), sums into the disks.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import fused_inline_kernel, fused_kernel, kernel
from ninedisk.core.dem.force_kernels import dashpot, shear_force
from ninedisk.core.dem.neighbour_kernels import NeighbourList
from ninedisk.core.dem.state import BETA, KN, KS, MU, SLIP_MIDDLE, SLIP_OVERLAP, TORQUE_OVERLAP, DiskArrays, Views

Index = int | np.uint64
"""Entry of the list: kernels index with unsigned numbers, which plain Python's `range` turns into its own."""

CHUNK = 128
"""Pairs that go through the loops together."""

DX, DY, REACH, VX, VY, ROLL, SPIN, SEEN_X, SEEN_Y = (np.uint64(c * CHUNK) for c in range(9))
"""Where the scratch holds, for each pair: ``x_j - x_i``, sum of the radii, ``v_i - v_j``, ``R_i omega_i + R_j omega_j``, ``omega_i +
omega_j``, and the difference of the velocities that dashpots see, if they see other ones."""

GX, GY, SHEAR, ARM_LOSS = DX, DY, REACH, VX
"""Where the results take their place: the force on ``i``, ``fs``, and what the overlap takes from each body's torque."""

SCRATCH = 9 * CHUNK


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
def gather_seen(views: Views, pairs: NeighbourList, begin: Index, end: Index, scratch: NDArray[np.float64]) -> None:
    """Differences of the velocities that dashpots see, into the scratch."""
    seen, row, other = views.seen, views.row, pairs.other
    one = np.uint64(1)
    for k in range(begin, end):
        q, i, j = k - begin, np.uint64(row[k]), np.uint64(other[k])
        scratch[SEEN_X + q] = seen[i + i] - seen[j + j]
        scratch[SEEN_Y + q] = seen[i + i + one] - seen[j + j + one]


def _pair_forces(seen_x: np.uint64, seen_y: np.uint64) -> Callable[..., None]:
    """Kernel of the forces where the scratch holds the velocities that dashpots see at ``seen_x`` and ``seen_y``.

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
            rate = scratch[seen_x + q] * nx + scratch[seen_y + q] * ny
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


pair_forces_lagged, pair_forces_seen = _pair_forces(VX, VY), _pair_forces(SEEN_X, SEEN_Y)


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
            gather_seen(views, pairs, low, high, scratch)
            pair_forces_seen(pairs, views.damping, law, slip_dt, low, high, scratch)
        else:
            pair_forces_lagged(pairs, views.damping, law, slip_dt, low, high, scratch)
        scatter(disks, views, pairs, low, high, scratch)
