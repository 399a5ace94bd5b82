"""Kernels of the kick and drift.

Global damping ``m a + xi m v = F`` in the central form is ``v+ = ((1 - a) v- + dt F/m)/(1 + a)`` with ``a = xi dt/2``; in the
lagged form ``v+ = v- + dt (F/m - xi v-)``. The start is synchronised: ``v_{1/2} = v_0 + dt (F_0/m - xi v_0)/2``.
"""

from __future__ import annotations

import numpy as np

from ninedisk.core._cache import inline_kernel, kernel
from ninedisk.core.dem.state import DiskArrays, Kick, Views


@inline_kernel
def farther(far: float, d2: float) -> float:
    """The larger of two squared displacements; NaN once one of them is NaN."""
    return d2 if d2 > far or d2 != d2 else far


@inline_kernel
def falls(inv_mass: float) -> float:
    """1 for a disk that gravity moves, 0 for a fixed one."""
    return 1.0 if inv_mass > 0.0 else 0.0


@kernel
def kick_and_drift(disks: DiskArrays, views: Views, kick: Kick, begin: int, end: int) -> float:
    """Velocities to ``t_{n+1/2}``, positions to ``t_{n+1}`` of the disks ``begin .. end-1``; clears their forces.

    Returns
    -------
    float
        Largest squared displacement since the last rebuild of the lists [m^2]; NaN if any is NaN.
    """
    x, v, force, torques = views.x, views.v, views.force, disks.torque
    omega, angle, moved = disks.omega, disks.angle, disks.moved
    keep, gain, dt = kick.keep, kick.gain, kick.dt
    extrapolated = disks.v_now.shape[0] > 0
    one = np.uint64(1)
    far = 0.0
    for i in range(np.uint64(begin), np.uint64(end)):
        ix, iy = i + i, i + i + one
        weight = falls(disks.inv_mass[i])
        vx = keep * v[ix] + gain * (force[ix] * disks.inv_mass[i] + weight * kick.gravity_x)
        vy = keep * v[iy] + gain * (force[iy] * disks.inv_mass[i] + weight * kick.gravity_y)
        if extrapolated:
            views.seen[ix] = vx + kick.ahead * (vx - v[ix])
            views.seen[iy] = vy + kick.ahead * (vy - v[iy])
        v[ix], v[iy] = vx, vy
        dx, dy = dt * vx, dt * vy
        x[ix] += dx
        x[iy] += dy
        spin = omega[i]
        if disks.inv_inertia[i] > 0.0:
            spin = keep * spin + gain * (torques[i] * disks.inv_inertia[i])
            omega[i] = spin
        angle[i] += dt * spin
        force[ix], force[iy], torques[i] = 0.0, 0.0, 0.0
        mx, my = np.float32(moved[i, 0] + dx), np.float32(moved[i, 1] + dy)
        moved[i, 0], moved[i, 1] = mx, my
        far = farther(far, float(mx * mx + my * my))
    return far
