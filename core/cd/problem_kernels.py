"""Kernels of the contact map: from body velocities to contact velocities and back.

A contact between bodies i and j has the unit normal ``n`` from i to j, ``t = (-n_y, n_x)``, and the rows

    normal       u_n = -n.v_i + a_ni w_i + n.v_j + a_nj w_j     (opening)
    tangential   u_t =  t.v_i + a_ti w_i - t.v_j + a_tj w_j     (motion of i's surface along t)

over the three unknowns ``(v_x, v_y, w)`` of each body, ``arms = (a_ni, a_nj, a_ti, a_tj)``; the force of the contact on
body i is then ``-p n + q t``. A body index of -1 stands for a body whose motion is prescribed; its share of ``u`` belongs
to the offset.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


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
