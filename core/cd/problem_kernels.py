"""Kernels of one contact problem: the map from body to contact velocities and back, the friction cone, how exact a solution is."""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


SINGULAR = 1e-14
"""Relative size below which the determinant of a 2 x 2 block is round-off."""
EPSILON = 2.220446049250313e-16
MAP, FORCE, FREE_MAP, WORK, GAP, VIOLATION, ENERGY_W, ENERGY_B, LARGEST, NOISE_MAP, NOISE_WORK, NOISE = range(12)
OFF_BALANCE, KINETIC, RHO, SIZE, SUMMED_MAP, SUMMED_WORK, SUMMED_NOISE = range(12, 19)
SUMS = 19
NATURAL_MAP, COMPLEMENTARITY, DUALITY_GAP, STATIONARITY, FLOOR_MAP, FLOOR_GAP = range(6)
"""Order of the figures, that of `ninedisk.core.cd.problem.Residuals`."""

ROUND_OFF = 16.0
"""Multiple of the estimated evaluation error below which a figure says nothing."""

SUMMED = 0.25
"""Of the velocity that a contact's own forces give its bodies, what counts in the round-off of theirs: it is a sum of such velocities, far
larger than itself where light bodies bear heavy ones."""

EXPLAINED = 1e-8
"""Largest figure that the round-off of such sums may explain: a packing with bodies of 1 and of 1e6 needs 5e-9."""

UNRESOLVED = 1e-3
"""Where the offsets' resolution alone makes up more than this fraction of the forces, the forces are round-off of the scene."""


class Contacts(NamedTuple):
    """What does not change with the load of c contacts: ``bodies`` (c, 2), ``normal`` (c, 2), ``arms`` (c, 4), ``mu`` (c,) and
    ``compliance`` (c, 2) as in `ninedisk.core.cd.problem.ContactProblem`."""

    bodies: Ints
    normal: Floats
    arms: Floats
    mu: Floats
    compliance: Floats


@inline_kernel
def contact_velocity(k: int, bodies: Ints, normal: Floats, arms: Floats, v: Floats) -> tuple[float, float]:
    """Normal and tangential velocity of contact ``k`` that the body velocities ``v``, shape (b, 3), cause."""
    nx, ny = normal[k, 0], normal[k, 1]
    i, j = bodies[k, 0], bodies[k, 1]
    un = ut = 0.0
    if i >= 0:
        un = -nx * v[i, 0] - ny * v[i, 1] + arms[k, 0] * v[i, 2]
        ut = -ny * v[i, 0] + nx * v[i, 1] + arms[k, 2] * v[i, 2]
    if j >= 0:
        un += nx * v[j, 0] + ny * v[j, 1] + arms[k, 1] * v[j, 2]
        ut += ny * v[j, 0] - nx * v[j, 1] + arms[k, 3] * v[j, 2]
    return un, ut


@inline_kernel
def add_contact_force(
    k: int, p: float, q: float, bodies: Ints, normal: Floats, arms: Floats, weight: Floats, out: Floats
) -> None:
    """Add ``weight * H' (p, q)`` of contact ``k`` to ``out``; ``weight`` and ``out`` have the shape (b, 3)."""
    nx, ny = normal[k, 0], normal[k, 1]
    i, j = bodies[k, 0], bodies[k, 1]
    fx, fy = -nx * p - ny * q, -ny * p + nx * q
    if i >= 0:
        out[i, 0] += weight[i, 0] * fx
        out[i, 1] += weight[i, 1] * fy
        out[i, 2] += weight[i, 2] * (arms[k, 0] * p + arms[k, 2] * q)
    if j >= 0:
        out[j, 0] -= weight[j, 0] * fx
        out[j, 1] -= weight[j, 1] * fy
        out[j, 2] += weight[j, 2] * (arms[k, 1] * p + arms[k, 3] * q)


@kernel
def contact_velocities(bodies: Ints, normal: Floats, arms: Floats, v: Floats, u: Floats) -> None:
    """``u = H v``: contact velocities, shape (c, 2), of the body velocities ``v``, shape (b, 3)."""
    for k in range(bodies.shape[0]):
        u[k, 0], u[k, 1] = contact_velocity(k, bodies, normal, arms, v)


@kernel
def body_velocities(
    bodies: Ints, normal: Floats, arms: Floats, inverse_mass: Floats, force: Floats, r: Floats, v: Floats
) -> None:
    """``v = M^-1 (f + H' r)``: velocities, shape (b, 3), under the loads ``force`` and the contact forces ``r``."""
    for i in range(v.shape[0]):
        for d in range(3):
            v[i, d] = inverse_mass[i, d] * force[i, d]
    for k in range(bodies.shape[0]):
        if r[k, 0] != 0.0 or r[k, 1] != 0.0:
            add_contact_force(k, r[k, 0], r[k, 1], bodies, normal, arms, inverse_mass, v)


@kernel
def contact_forces_on_bodies(bodies: Ints, normal: Floats, arms: Floats, free: Floats, r: Floats, out: Floats) -> None:
    """``out = H' r`` on the free unknowns (``free`` is 1 or 0), shape (b, 3)."""
    for i in range(out.shape[0]):
        for d in range(3):
            out[i, d] = 0.0
    for k in range(bodies.shape[0]):
        add_contact_force(k, r[k, 0], r[k, 1], bodies, normal, arms, free, out)


@kernel
def delassus_blocks(
    bodies: Ints, normal: Floats, arms: Floats, inverse_mass: Floats, compliance: Floats, blocks: Floats
) -> None:
    """Diagonal blocks of ``W = H M^-1 H' + C``: ``blocks[k] = (W_nn, W_nt, W_tt)``, shape (c, 3)."""
    for k in range(bodies.shape[0]):
        nx, ny = normal[k, 0], normal[k, 1]
        nn, nt, tt = compliance[k, 0], 0.0, compliance[k, 1]
        for side in range(2):
            b = bodies[k, side]
            if b >= 0:
                mx, my, mw = inverse_mass[b, 0], inverse_mass[b, 1], inverse_mass[b, 2]
                an, at = arms[k, side], arms[k, 2 + side]
                nn += nx * nx * mx + ny * ny * my + an * an * mw
                nt += nx * ny * (mx - my) + an * at * mw
                tt += ny * ny * mx + nx * nx * my + at * at * mw
        blocks[k, 0], blocks[k, 1], blocks[k, 2] = nn, nt, tt


@kernel
def contact_scales(blocks: Floats, mu: Floats, rho: Floats) -> None:
    """``rho``, shape (c,): the inverse of the largest diagonal entry of each Delassus block; without friction the normal one."""
    for k in range(mu.shape[0]):
        rho[k] = 1.0 / (max(blocks[k, 0], blocks[k, 2]) if mu[k] > 0.0 else blocks[k, 0])


@inline_kernel
def project_on_cone(p: float, q: float, mu: float) -> tuple[float, float]:
    """Nearest point of the cone to the force ``(p, q)`` [N]."""
    size = abs(q)
    if p >= 0.0 and size <= mu * p:
        return p, q
    if p + mu * size <= 0.0:
        return 0.0, 0.0
    p = (p + mu * size) / (1.0 + mu * mu)
    return p, mu * p if q > 0.0 else -mu * p


@inline_kernel
def solve_associated_contact(
    w_nn: float, w_nt: float, w_tt: float, b_n: float, b_t: float, mu: float
) -> tuple[float, float]:
    """Minimise ``1/2 r' W r + b' r`` over the cone, for one contact, exactly.

    The minimum is 0 if b lies in the dual cone (``b_n >= mu |b_t|``), the free minimum ``-W^-1 b`` if that lies in the
    cone, else it lies on the better one of the two rays ``p (1, +-mu)``, where ``p = -(b_n +- mu b_t) / (1, +-mu) W (1, +-mu)'``.
    W is positive semidefinite with ``w_nn > 0``.
    """
    if b_n >= mu * abs(b_t):
        return 0.0, 0.0
    if mu == 0.0:
        return -b_n / w_nn, 0.0
    det = w_nn * w_tt - w_nt * w_nt
    if det > SINGULAR * w_nn * w_tt:
        p = (w_nt * b_t - w_tt * b_n) / det
        q = (w_nt * b_n - w_nn * b_t) / det
        if abs(q) <= mu * p:
            return p, q
    elif w_nn * b_t == w_nt * b_n:
        return -b_n / w_nn, 0.0
    best, p_best, q_best = 0.0, 0.0, 0.0
    for side in range(2):
        slope = mu if side == 0 else -mu
        pull = b_n + slope * b_t
        if pull < 0.0:
            stiff = w_nn + slope * (2.0 * w_nt + slope * w_tt)
            value = -pull * pull / stiff
            if value < best:
                best, p_best, q_best = value, -pull / stiff, -slope * pull / stiff
    return p_best, q_best


@inline_kernel
def solve_coulomb_contact(
    w_nn: float, w_nt: float, w_tt: float, b_n: float, b_t: float, mu: float
) -> tuple[float, float]:
    """Solve ``u = W r + b`` with Coulomb's law (no dilation) for one contact.

    Open if ``b_n >= 0``; else stick if ``-W^-1 b`` lies in the cone; else slip with ``u_n = 0`` and q against the slip:
    ``p = -b_n / (w_nn +- mu w_nt)``. Where neither slip direction is consistent (possible only if ``mu |w_nt|`` exceeds
    ``w_nn``: Painleve's paradox) the one that leaves the smaller error is taken.
    """
    if b_n >= 0.0:
        return 0.0, 0.0
    if mu == 0.0:
        return -b_n / w_nn, 0.0
    det = w_nn * w_tt - w_nt * w_nt
    if det > SINGULAR * w_nn * w_tt:
        p = (w_nt * b_t - w_tt * b_n) / det
        q = (w_nt * b_n - w_nn * b_t) / det
        if abs(q) <= mu * p:
            return p, q
    elif w_nn * b_t == w_nt * b_n:
        return -b_n / w_nn, 0.0
    worst, p_best, q_best = 1e300, -b_n / w_nn, 0.0
    for side in range(2):
        slope = mu if side == 0 else -mu
        stiff = w_nn + slope * w_nt
        if stiff > 0.0:
            p = -b_n / stiff
            slip = b_t + (w_nt + slope * w_tt) * p
            wrong = slip if side == 0 else -slip
            if wrong < worst:
                worst, p_best, q_best = wrong, p, slope * p
    return p_best, q_best


@kernel
def sum_residuals(
    contacts: Contacts,
    offset: Floats,
    shear_0: Floats,
    rho: Floats,
    b: Floats,
    v: Floats,
    r: Floats,
    coulomb: bool,
    sums: Floats,
) -> None:
    """Sums over the contacts from which `ninedisk.core.cd.problem.measure` forms its figures; arguments as in `ContactProblem`.

    With ``u = H v + g + C (r - (0, q0))``, for Coulomb ``u_n`` increased by ``mu |u_t|``, P the projection on the cone and
    ``noise`` the round-off error of evaluating ``u`` from ``v``, and of ``v`` from the forces, ``sums`` receives

    ``MAP`` |r - P(r - rho u)|^2, ``FORCE`` |r|^2, ``FREE_MAP`` |P(-rho b)|^2, ``WORK`` sum |r.u|, ``GAP`` sum r.u,
    ``VIOLATION`` sum of max(0, mu |u_t| - u_n), ``ENERGY_W`` sum r.(u - b), ``ENERGY_B`` sum r.b, ``LARGEST`` max p,
    ``NOISE_MAP`` |rho noise|^2, ``NOISE_WORK`` sum |r| noise, ``NOISE`` sum of the noise, the same with ``SUMMED`` for the noise of
    ``v`` as a sum of velocities, ``RHO`` sum rho^2, ``SIZE`` sum |r|_1.
    """
    bodies, normal, arms, mu, compliance = contacts
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
        summed = EPSILON * SUMMED * (p + abs(q)) / rho[k]
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
        sums[SUMMED_MAP] += (rho[k] * summed) ** 2
        sums[SUMMED_WORK] += (p + abs(q)) * summed
        sums[SUMMED_NOISE] += summed
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
    """The figures of `ninedisk.core.cd.problem.Residuals` from the sums of both other kernels."""
    unbalance = sums[OFF_BALANCE]
    energy = 0.5 * (abs(sums[ENERGY_W]) + abs(sums[ENERGY_B]))
    force = max(sqrt(sums[FORCE]), sqrt(sums[FREE_MAP]))
    largest = sums[LARGEST]
    gap = abs(sums[GAP]) + largest * sums[VIOLATION] + 0.5 * unbalance
    # A velocity of size |v| in the kinetic norm is known to eps |v| at best, whatever the contacts do.
    noise_v = (EPSILON * EPSILON) * sums[KINETIC]
    floor_map = ROUND_OFF * sqrt(sums[NOISE_MAP])
    floor_gap = ROUND_OFF * (sums[NOISE_WORK] + largest * sums[NOISE] + 0.5 * noise_v)
    # Forces of a contradiction grow without end, and their round-off with them: it explains no more than this part.
    floor_map += min(ROUND_OFF * sqrt(sums[SUMMED_MAP]), EXPLAINED * force)
    summed = sums[SUMMED_WORK] + largest * sums[SUMMED_NOISE]
    floor_gap += min(ROUND_OFF * summed, EXPLAINED * energy)
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
