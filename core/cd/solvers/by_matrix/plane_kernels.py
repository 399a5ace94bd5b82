"""Kernels of a contact problem that is given by its Delassus matrix alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem_kernels import solve_associated_contact, solve_coulomb_contact
from ninedisk.core.compile import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@kernel
def sweep_matrix(
    pointers: Ints,
    columns: Ints,
    values: Floats,
    b: Floats,
    mu: Floats,
    blocks: Floats,
    coulomb: bool,
    count: int,
    r: Floats,
) -> None:
    """``count`` sweeps of nonsmooth Gauss-Seidel on ``u = W r + b``; each contact is solved exactly with the others held fixed.

    Parameters
    ----------
    pointers, columns, values
        W in compressed sparse rows.
    b, r : ndarray, shape (2 c,)
        Contact velocities without forces; forces, normal and tangential in turn, updated in place.
    mu : ndarray, shape (c,)
    blocks : ndarray, shape (c, 3)
        ``(W_nn, W_nt, W_tt)`` of the diagonal.
    coulomb : bool
        Coulomb's law instead of the associated rule.
    """
    for _ in range(count):
        for k in range(mu.shape[0]):
            u_n, u_t = b[2 * k], b[2 * k + 1]
            for m in range(pointers[2 * k], pointers[2 * k + 1]):
                u_n += values[m] * r[columns[m]]
            for m in range(pointers[2 * k + 1], pointers[2 * k + 2]):
                u_t += values[m] * r[columns[m]]
            w_nn, w_nt, w_tt = blocks[k, 0], blocks[k, 1], blocks[k, 2]
            p, q = r[2 * k], r[2 * k + 1]
            rest_n, rest_t = u_n - w_nn * p - w_nt * q, u_t - w_nt * p - w_tt * q
            if coulomb:
                r[2 * k], r[2 * k + 1] = solve_coulomb_contact(w_nn, w_nt, w_tt, rest_n, rest_t, mu[k])
            else:
                r[2 * k], r[2 * k + 1] = solve_associated_contact(w_nn, w_nt, w_tt, rest_n, rest_t, mu[k])
