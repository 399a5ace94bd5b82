"""Kernels of Coulomb's law as a piecewise linear equation: its value, what contacts do, and where a way through their statuses has its
next kink.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem_kernels import Contacts, body_velocities, contact_velocity
from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]

OPEN, STICK, PLUS, MINUS = range(4)
"""Statuses: slip has ``q = mu p`` or ``q = -mu p``; a smooth contact that is closed counts as PLUS."""


@inline_kernel
def _status(mu: float, z_n: float, z_t: float) -> int:
    if z_n <= 0.0:
        return OPEN
    if mu > 0.0 and abs(z_t) <= mu * z_n:
        return STICK
    return PLUS if z_t > 0.0 or mu == 0.0 else MINUS


@kernel
def statuses_at(mu: Floats, z: Floats, status: Longs) -> None:
    """Status of each contact, shape (c,), by ``z = r - rho u``, shape (c, 2), and ``mu``, shape (c,)."""
    for k in range(mu.shape[0]):
        status[k] = _status(mu[k], z[k, 0], z[k, 1])


@kernel
def law_error(
    contacts: Contacts,
    inverse_mass: Floats,
    force: Floats,
    offset: Floats,
    shear_0: Floats,
    rho: Floats,
    side: Floats,
    soft: Floats,
    z: Floats,
    held: Floats,
    status: Longs,
    r: Floats,
    u: Floats,
    error: Floats,
    v: Floats,
) -> float:
    """Coulomb's law at ``z``, with the compliance ``soft/rho`` on the change of the forces: ``|rho F(z)|``.

    Parameters
    ----------
    contacts, inverse_mass, force, offset, shear_0, rho
        As in `ninedisk.core.cd.problem.ContactProblem`.
    side : ndarray, shape (4,)
        Sign of the friction force by status.
    soft : ndarray, shape (c,)
        Compliance of each contact over ``1/rho``.
    z, held : ndarray, shape (c, 2)
        ``r - rho u``, and the forces that the compliance holds.
    status : ndarray of int64, shape (c,)
        Out: of the contacts.
    r, u, error : ndarray, shape (c, 2)
        Out: ``r = P(z)``; ``u = W r + b + soft/rho (r - held)``; ``F(z) = u + (z - r)/rho``.
    v : ndarray, shape (b, 3)
        Work space.
    """
    bodies, normal, arms, mu, compliance = contacts
    statuses_at(mu, z, status)
    for k in range(bodies.shape[0]):
        p = z[k, 0] if status[k] != OPEN else 0.0
        r[k, 0], r[k, 1] = p, z[k, 1] if status[k] == STICK else side[status[k]] * mu[k] * p
    body_velocities(bodies, normal, arms, inverse_mass, force, r, v)
    size = 0.0
    for k in range(bodies.shape[0]):
        un, ut = contact_velocity(k, bodies, normal, arms, v)
        p, q = r[k, 0], r[k, 1]
        un += offset[k, 0] + compliance[k, 0] * p + soft[k] / rho[k] * (p - held[k, 0])
        ut += offset[k, 1] + compliance[k, 1] * (q - shear_0[k]) + soft[k] / rho[k] * (q - held[k, 1])
        u[k, 0], u[k, 1] = un, ut
        n, t = un + (z[k, 0] - p) / rho[k], ut + (z[k, 1] - q) / rho[k]
        error[k, 0], error[k, 1] = n, t
        size += rho[k] * rho[k] * (n * n + t * t)
    return sqrt(size)


@kernel
def remaining_velocities(
    contacts: Contacts,
    inverse_mass: Floats,
    nothing: Floats,
    rho: Floats,
    soft: Floats,
    u: Floats,
    dr: Floats,
    v: Floats,
    left: Floats,
) -> None:
    """``left = u - W dr - soft/rho dr``: what a change ``dr`` of the forces leaves of contact velocities ``u``, shape (c, 2) each.

    Other arguments as in `law_error`; ``nothing`` are loads of zero, shape (b, 3).
    """
    bodies, normal, arms, _mu, compliance = contacts
    body_velocities(bodies, normal, arms, inverse_mass, nothing, dr, v)
    for k in range(bodies.shape[0]):
        un, ut = contact_velocity(k, bodies, normal, arms, v)
        left[k, 0] = u[k, 0] - un - (compliance[k, 0] + soft[k] / rho[k]) * dr[k, 0]
        left[k, 1] = u[k, 1] - ut - (compliance[k, 1] + soft[k] / rho[k]) * dr[k, 1]


@inline_kernel
def _margin(status: int, border: int, mu: float, z_n: float, z_t: float) -> float:
    """Distance from a border of the status, of ``z_n = 0``, ``z_t = mu z_n`` and ``z_t = - mu z_n``; 0 where it is none of it."""
    if border == 0:
        return -z_n if status == OPEN else (0.0 if status == STICK else z_n)
    side = 1.0 if border == 1 else -1.0
    beyond = side * z_t - mu * z_n
    slips = status == PLUS if border == 1 else status == MINUS
    if mu == 0.0 or not (slips or status == STICK):
        return 0.0
    return beyond if slips else -beyond


@kernel
def next_kink(
    mu: Floats, status: Longs, z: Floats, rate: Floats, ahead: float, contact: int, border: int
) -> tuple[float, float, int, int]:
    """How far a way leads until a status changes: direction of t, length, contact, border.

    Parameters
    ----------
    mu : ndarray, shape (c,)
    status : ndarray of int64, shape (c,)
    z, rate : ndarray, shape (c, 2)
        Where the way is, and ``dz/dt``.
    ahead : float
        Direction of t, if no border has been crossed.
    contact, border : int
        Crossed last, -1 for none: into the piece that was entered. Where the sign of the determinant changes, t turns back.
    """
    if contact >= 0:
        grows = _margin(status[contact], border, mu[contact], rate[contact, 0], rate[contact, 1])
        ahead = 1.0 if grows > 0.0 else -1.0
    length, at, which = inf, 0, 0
    for k in range(mu.shape[0]):
        for i in range(3):
            growth = ahead * _margin(status[k], i, mu[k], rate[k, 0], rate[k, 1])
            if growth < 0.0 and not (k == contact and i == border):
                step = max(_margin(status[k], i, mu[k], z[k, 0], z[k, 1]), 0.0) / -growth
                if step < length:
                    length, at, which = step, k, i
    return ahead, length, at, which


@kernel
def keep_alike(bodies: Ints, ratio: float, soft: Floats, most: Floats) -> None:
    """Raise ``soft``, shape (c,), until no contact has less than ``ratio`` times that of another one at one of its ``bodies``.

    Parameters
    ----------
    bodies : ndarray of int, shape (c, 2)
        -1 for a body whose motion is prescribed: that hands nothing on.
    ratio : float
        Up to 1: then all that hang together get the most of them.
    soft : ndarray, shape (c,)
        Changed in place.
    most : ndarray, shape (b,)
        Work space, zero: most compliance at each body.
    """
    for k in range(bodies.shape[0]):
        for body in bodies[k]:
            if body >= 0:
                most[body] = max(most[body], soft[k])
    raised = True
    while raised:
        raised = False
        for k in range(bodies.shape[0]):
            least = 0.0
            for body in bodies[k]:
                if body >= 0:
                    least = max(least, ratio * most[body])
            if soft[k] < least:
                soft[k], raised = least, True
                for body in bodies[k]:
                    if body >= 0:
                        most[body] = max(most[body], least)
