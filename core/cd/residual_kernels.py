"""Kernel that sums up how far a pair of velocities and contact forces is from a solution."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.cd.cone_kernels import project_on_cone
from ninedisk.core.cd.problem_kernels import contact_velocity

Floats = NDArray[np.float64]

EPSILON = 2.220446049250313e-16
MAP, FORCE, FREE_MAP, WORK, GAP, VIOLATION, ENERGY_W, ENERGY_B, LARGEST, NOISE_MAP, NOISE_WORK, NOISE = range(12)
OFF_BALANCE, KINETIC, RHO, SIZE = range(12, 16)
SUMS = 16
NATURAL_MAP, COMPLEMENTARITY, DUALITY_GAP, STATIONARITY, FLOOR_MAP, FLOOR_GAP = range(6)
"""Order of the figures, that of `ninedisk.core.cd.residuals.Residuals`."""

ROUND_OFF = 16.0
"""Multiple of the estimated evaluation error below which a figure says nothing."""

UNRESOLVED = 1e-3
"""Where the offsets' resolution alone makes up more than this fraction of the forces, the forces are round-off of the scene."""


@kernel
def sum_residuals(
    bodies: NDArray[np.int32],
    normal: Floats,
    arms: Floats,
    offset: Floats,
    compliance: Floats,
    shear_0: Floats,
    mu: Floats,
    rho: Floats,
    b: Floats,
    v: Floats,
    r: Floats,
    coulomb: bool,
    sums: Floats,
) -> None:
    """Sums over the contacts from which `residuals.measure` forms its figures; arguments as in `ContactProblem`.

    With ``u = H v + g + C (r - (0, q0))``, for Coulomb ``u_n`` increased by ``mu |u_t|``, P the projection on the cone and
    ``noise`` the round-off error of evaluating ``u``, ``sums`` receives

    ``MAP`` |r - P(r - rho u)|^2, ``FORCE`` |r|^2, ``FREE_MAP`` |P(-rho b)|^2, ``WORK`` sum |r.u|, ``GAP`` sum r.u,
    ``VIOLATION`` sum of max(0, mu |u_t| - u_n), ``ENERGY_W`` sum r.(u - b), ``ENERGY_B`` sum r.b, ``LARGEST`` max p,
    ``NOISE_MAP`` |rho noise|^2, ``NOISE_WORK`` sum |r| noise, ``NOISE`` sum of the noise, ``RHO`` sum rho^2, ``SIZE`` sum |r|_1.
    """
    for m in range(SUMS):
        sums[m] = 0.0
    for k in range(bodies.shape[0]):
        p, q = r[k, 0], r[k, 1]
        un, ut = contact_velocity(k, bodies, normal, arms, v)
        size = abs(offset[k, 0]) + abs(offset[k, 1]) + compliance[k, 0] * p
        size += compliance[k, 1] * (abs(q) + abs(shear_0[k]))
        for side in range(2):
            i = bodies[k, side]
            if i >= 0:
                arm = abs(arms[k, side]) + abs(arms[k, 2 + side])
                size += abs(v[i, 0]) + abs(v[i, 1]) + arm * abs(v[i, 2])
        un += offset[k, 0] + compliance[k, 0] * p
        ut += offset[k, 1] + compliance[k, 1] * (q - shear_0[k])
        friction = mu[k] * abs(ut)
        work_w = p * (un - b[k, 0]) + q * (ut - b[k, 1])
        if coulomb:
            un += friction
        if mu[k] == 0.0:
            ut = 0.0
        p_map, q_map = project_on_cone(p - rho[k] * un, q - rho[k] * ut, mu[k])
        sums[MAP] += (p - p_map) ** 2 + (q - q_map) ** 2
        sums[FORCE] += p * p + q * q
        bt = b[k, 1] if mu[k] > 0.0 else 0.0
        p_map, q_map = project_on_cone(-rho[k] * b[k, 0], -rho[k] * bt, mu[k])
        sums[FREE_MAP] += p_map * p_map + q_map * q_map
        work = p * un + q * ut
        sums[WORK] += abs(work)
        sums[GAP] += work
        sums[VIOLATION] += max(0.0, friction - un)
        sums[ENERGY_W] += work_w
        sums[ENERGY_B] += p * b[k, 0] + q * b[k, 1]
        sums[LARGEST] = max(sums[LARGEST], p)
        noise = EPSILON * size
        sums[NOISE_MAP] += (rho[k] * noise) ** 2
        sums[NOISE_WORK] += (p + abs(q)) * noise
        sums[NOISE] += noise
        sums[RHO] += rho[k] * rho[k]
        sums[SIZE] += p + abs(q)


@kernel
def sum_kinetic(inverse_mass: Floats, v: Floats, balanced: Floats, sums: Floats) -> None:
    """``OFF_BALANCE`` |v - balanced|_M^2 and ``KINETIC`` |v|_M^2 over the unknowns that are free, arrays of shape (b, 3)."""
    off, size = 0.0, 0.0
    for i in range(v.shape[0]):
        for d in range(3):
            if inverse_mass[i, d] > 0.0:
                wrong = v[i, d] - balanced[i, d]
                off += wrong * wrong / inverse_mass[i, d]
                size += v[i, d] * v[i, d] / inverse_mass[i, d]
    sums[OFF_BALANCE], sums[KINETIC] = off, size


@kernel
def figures_of(sums: Floats, n_contacts: int, resolution: float, figures: Floats) -> None:
    """The figures of `ninedisk.core.cd.residuals.Residuals` from the sums of both other kernels."""
    unbalance = sums[OFF_BALANCE]
    energy = 0.5 * (abs(sums[ENERGY_W]) + abs(sums[ENERGY_B]))
    force = max(sqrt(sums[FORCE]), sqrt(sums[FREE_MAP]))
    largest = sums[LARGEST]
    gap = abs(sums[GAP]) + largest * sums[VIOLATION] + 0.5 * unbalance
    # A velocity of size |v| in the kinetic norm is known to eps |v| at best, whatever the contacts do.
    noise_v = (EPSILON * EPSILON) * sums[KINETIC]
    floor_map = ROUND_OFF * sqrt(sums[NOISE_MAP])
    floor_gap = ROUND_OFF * (sums[NOISE_WORK] + largest * sums[NOISE] + 0.5 * noise_v)
    unsure = resolution * sqrt(sums[RHO])
    if unsure > UNRESOLVED * force:
        floor_map += unsure
        floor_gap += resolution * (sums[SIZE] + largest * n_contacts)
    figures[NATURAL_MAP] = _ratio(sqrt(sums[MAP]), force)
    figures[COMPLEMENTARITY] = _ratio(sums[WORK], energy)
    figures[DUALITY_GAP] = _ratio(gap, energy)
    figures[STATIONARITY] = _ratio(sqrt(unbalance), sqrt(energy))
    figures[FLOOR_MAP] = _ratio(floor_map, force)
    figures[FLOOR_GAP] = _ratio(floor_gap, energy)


@inline_kernel
def _ratio(value: float, scale: float) -> float:
    if value == 0.0:
        return 0.0
    return value / scale if scale > 0.0 else inf


@inline_kernel
def reached(figures: Floats, tolerance: float) -> bool:
    """Whether natural map and duality gap are below ``tolerance`` or at the floor of round-off."""
    near = figures[NATURAL_MAP] <= max(tolerance, figures[FLOOR_MAP])
    return bool(near and figures[DUALITY_GAP] <= max(tolerance, figures[FLOOR_GAP]))
