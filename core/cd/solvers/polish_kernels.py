"""Kernels of Coulomb's law as a piecewise linear equation: what contacts do, and where a way through their statuses has its next kink."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

OPEN, STICK, PLUS, MINUS = range(4)
"""Statuses: slip has ``q = mu p`` or ``q = -mu p``; a smooth contact that is closed counts as PLUS."""


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
