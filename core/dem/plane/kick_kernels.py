"""Kernels of the kick and drift.

Global damping ``m a + xi m v = F`` in the central form is ``v+ = ((1 - a) v- + dt F/m)/(1 + a)`` with ``a = xi dt/2``; in the
lagged form ``v+ = v- + dt (F/m - xi v-)``. The start is synchronised: ``v_{1/2} = v_0 + dt (F_0/m - xi v_0)/2``.

Each loop writes to few arrays and branches on nothing: the compiler, which has to make sure that no two of them overlap, then takes
several disks at a time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.state import MASS, DiskArrays, Kick, Views

NUMBER = np.int64(0x7FFFFFFFFFFFFFFF)
"""All bits of a number but its sign."""


@inline_kernel
def farther(far: float, d2: float) -> float:
    """The larger of two squared displacements; NaN once one of them is NaN."""
    return d2 if d2 > far or d2 != d2 else far


@inline_kernel
def farthest(x: NDArray[np.float64], built: NDArray[np.float64], begin: int, end: int) -> float:
    """Largest square of the displacements from ``built`` to ``x`` of the disks ``begin .. end-1`` [m^2]; NaN if any is NaN.

    Differences of positions have one rounding each, however many steps lie between them. Without their sign the bits of numbers, read as
    integers, are in the order of the numbers, and those of NaN come after all.
    """
    one = np.uint64(1)
    bits = np.int64(0)
    for i in range(np.uint64(begin), np.uint64(end)):
        mx, my = x[i + i] - built[i + i], x[i + i + one] - built[i + i + one]
        bits = max(bits, np.int64(np.float64(mx * mx + my * my).view(np.int64) & NUMBER))
    return float(np.int64(bits).view(np.float64))


@inline_kernel
def gravity_factor(inv_mass: float) -> float:
    """1 for a disk that gravity moves, 0 for a fixed one."""
    return 1.0 if inv_mass > 0.0 else 0.0


@inline_kernel
def is_free(disks: DiskArrays, i: int, d: int) -> bool:
    """Whether a component of the velocity of the disk in row i is not held, beside those of fixed disks, which nothing moves anyway."""
    return disks.free[disks.name[i], d] > 0.0 if disks.free.shape[0] > 0 else True


@inline_kernel
def is_fixed(disks: DiskArrays, i: int) -> bool:
    """Whether the disk in row i is fixed, and not only held in both directions."""
    return mass_of(disks, i) == 0.0


@inline_kernel
def mass_of(disks: DiskArrays, i: int) -> float:
    """Mass of the disk in row i [kg]; 0 of a fixed one, whose energy is none of the run's."""
    if disks.inv_mass[i] > 0.0:
        return float(1.0 / disks.inv_mass[i])
    return float(disks.free[disks.name[i], MASS]) if disks.free.shape[0] > 0 else 0.0


@inline_kernel
def damping_loss(disks: DiskArrays, views: Views, step: Kick, begin: int, end: int) -> None:
    """Energy that global damping takes from the disks ``begin .. end-1`` in the kick that follows [J], into ``disks.braked``."""
    one = np.uint64(1)
    v, force, omega, keep, gain, seen, mean = (
        views.v,
        views.force,
        disks.omega,
        step.keep,
        step.gain,
        step.seen,
        step.mean,
    )
    for i in range(np.uint64(begin), np.uint64(end)):
        ix, iy = i + i, i + i + one
        inv_mass, inv_inertia = disks.inv_mass[i], disks.inv_inertia[i]
        change_x = (keep - 1.0) * v[ix] + gain * (force[ix] * inv_mass + step.gravity_x)
        change_y = (keep - 1.0) * v[iy] + gain * (force[iy] * inv_mass + step.gravity_y)
        if disks.free.shape[0] > 0:  # what is held here is at rest
            change_x = change_x if is_free(disks, i, 0) else 0.0
            change_y = change_y if is_free(disks, i, 1) else 0.0
        change = (keep - 1.0) * omega[i] + gain * (disks.torque[i] * inv_inertia)
        way = (v[ix] + seen * change_x) * (v[ix] + mean * change_x) + (v[iy] + seen * change_y) * (
            v[iy] + mean * change_y
        )
        turn = (omega[i] + seen * change) * (omega[i] + mean * change)
        taken = way / inv_mass if inv_mass > 0.0 else 0.0
        taken += turn / inv_inertia if inv_inertia > 0.0 else 0.0
        disks.braked[i] += step.drag * taken


@inline_kernel
def kick(
    v: NDArray[np.float64], force: NDArray[np.float64], inv_mass: NDArray[np.float64], step: Kick, begin: int, end: int
) -> None:
    """Velocities of the disks ``begin .. end-1`` to ``t_{n+1/2}``; clears their forces."""
    one = np.uint64(1)
    keep, gain = step.keep, step.gain
    for i in range(np.uint64(begin), np.uint64(end)):
        ix, iy = i + i, i + i + one
        weight = gravity_factor(inv_mass[i])
        v[ix] = keep * v[ix] + gain * (force[ix] * inv_mass[i] + weight * step.gravity_x)
        v[iy] = keep * v[iy] + gain * (force[iy] * inv_mass[i] + weight * step.gravity_y)
        force[ix], force[iy] = 0.0, 0.0


@inline_kernel
def kick_held(disks: DiskArrays, views: Views, step: Kick, begin: int, end: int) -> None:
    """`kick` where components of velocities are held, which stay."""
    v, force, free, one = views.v, views.force, disks.free, np.uint64(1)
    for i in range(np.uint64(begin), np.uint64(end)):
        ix, iy, name = i + i, i + i + one, disks.name[i]
        inverse, weight = disks.inv_mass[i], gravity_factor(disks.inv_mass[i])
        vx = step.keep * v[ix] + step.gain * (force[ix] * inverse + weight * step.gravity_x)
        vy = step.keep * v[iy] + step.gain * (force[iy] * inverse + weight * step.gravity_y)
        v[ix] = vx if free[name, 0] > 0.0 else v[ix]
        v[iy] = vy if free[name, 1] > 0.0 else v[iy]
        force[ix], force[iy] = 0.0, 0.0


@inline_kernel
def drift(x: NDArray[np.float64], v: NDArray[np.float64], dt: float, begin: int, end: int) -> None:
    """Positions of the disks ``begin .. end-1`` to ``t_{n+1}``."""
    for q in range(np.uint64(2 * begin), np.uint64(2 * end)):
        x[q] += dt * v[q]


@inline_kernel
def turn(
    omega: NDArray[np.float64],
    angle: NDArray[np.float64],
    torque: NDArray[np.float64],
    inv_inertia: NDArray[np.float64],
    step: Kick,
    begin: int,
    end: int,
) -> None:
    """Spins of the disks ``begin .. end-1`` to ``t_{n+1/2}`` and angles to ``t_{n+1}``; clears their torques."""
    keep, gain, dt = step.keep, step.gain, step.dt
    for i in range(np.uint64(begin), np.uint64(end)):
        before = omega[i]
        spin = keep * before + gain * (torque[i] * inv_inertia[i])
        spin = spin if inv_inertia[i] > 0.0 else before
        omega[i] = spin
        angle[i] += dt * spin
        torque[i] = 0.0


@inline_kernel
def predict_spins(disks: DiskArrays, step: Kick, begin: int, end: int) -> None:
    """Spins that rolling resistance of the disks ``begin .. end-1`` sees at the end of the step that `turn` is about to do."""
    omega, torque, inv_inertia = disks.omega, disks.torque, disks.inv_inertia
    for i in range(np.uint64(begin), np.uint64(end)):
        after = step.keep * omega[i] + step.gain * (torque[i] * inv_inertia[i])
        change = after - omega[i] if inv_inertia[i] > 0.0 else 0.0
        disks.omega_now[i] = omega[i] + change + step.ahead * change


@kernel
def kick_and_drift(disks: DiskArrays, views: Views, step: Kick, begin: int, end: int) -> None:
    """Velocities to ``t_{n+1/2}``, positions to ``t_{n+1}`` of the disks ``begin .. end-1``; clears their forces."""
    x, v, dashpot_v = views.x, views.v, views.dashpot_v
    first, last = np.uint64(2 * begin), np.uint64(2 * end)
    extrapolated = disks.v_now.shape[0] > 0
    if disks.braked.shape[0] > 0:
        damping_loss(disks, views, step, begin, end)
    if extrapolated:
        for q in range(first, last):
            dashpot_v[q] = v[q]
    if disks.free.shape[0] > 0:
        kick_held(disks, views, step, begin, end)
    else:
        kick(v, views.force, disks.inv_mass, step, begin, end)
    if extrapolated:
        for q in range(first, last):
            dashpot_v[q] = v[q] + step.ahead * (v[q] - dashpot_v[q])
    drift(x, v, step.dt, begin, end)
    if disks.omega_now.shape[0] > 0:
        predict_spins(disks, step, begin, end)
    turn(disks.omega, disks.angle, disks.torque, disks.inv_inertia, step, begin, end)
