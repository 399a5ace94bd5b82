"""Kernel that assembles ``M + H' D H`` into a fixed sparsity pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import kernel

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


@kernel
def jacobian_rows(normal: Floats, arms: Floats, bodies: NDArray[np.int32], free: Floats, rows: Floats) -> None:
    """Jacobian as dense rows, shape (c, 2, 6): columns of body i, then j; blocked unknowns have zeros."""
    for k in range(bodies.shape[0]):
        nx, ny = normal[k, 0], normal[k, 1]
        for side in range(2):
            b = bodies[k, side]
            sign = -1.0 if side == 0 else 1.0
            c = 3 * side
            for d in range(3):
                rows[k, 0, c + d] = 0.0
                rows[k, 1, c + d] = 0.0
            if b >= 0:
                rows[k, 0, c] = sign * nx * free[b, 0]
                rows[k, 0, c + 1] = sign * ny * free[b, 1]
                rows[k, 0, c + 2] = arms[k, side] * free[b, 2]
                rows[k, 1, c] = sign * ny * free[b, 0]
                rows[k, 1, c + 1] = -sign * nx * free[b, 1]
                rows[k, 1, c + 2] = arms[k, 2 + side] * free[b, 2]


@kernel
def assemble(
    bodies: NDArray[np.int32],
    rows: Floats,
    mass: Floats,
    free: Floats,
    d: Floats,
    diagonal: Longs,
    block: Longs,
    data: Floats,
) -> None:
    """Upper triangle of ``M + H' D H`` in compressed columns; rows of blocked unknowns are those of the identity.

    Parameters
    ----------
    bodies, mass, free
        As in `ContactProblem`.
    rows : ndarray, shape (c, 2, 6)
        From `jacobian_rows`.
    d : ndarray, shape (c, 3)
        Symmetric 2 x 2 blocks ``(D_nn, D_nt, D_tt)``.
    diagonal : ndarray of int64, shape (b, 3)
        Position in ``data`` of the entry (0, k) of each body's diagonal block.
    block : ndarray of int64, shape (c, 4)
        Position of the entries (0, k), k = 0..2, of the off-diagonal block of each contact, and 1 if the block's rows
        belong to body i (0: to body j); -1 if there is none.
    data : ndarray
        Out.
    """
    for m in range(data.shape[0]):
        data[m] = 0.0
    for i in range(mass.shape[0]):
        for c in range(3):
            data[diagonal[i, c] + c] = mass[i, c] if free[i, c] > 0.0 else 1.0
    for k in range(bodies.shape[0]):
        nn, nt, tt = d[k, 0], d[k, 1], d[k, 2]
        for side in range(2):
            i = bodies[k, side]
            if i < 0:
                continue
            o = 3 * side
            for c in range(3):
                en = nn * rows[k, 0, o + c] + nt * rows[k, 1, o + c]
                et = nt * rows[k, 0, o + c] + tt * rows[k, 1, o + c]
                for a in range(c + 1):
                    data[diagonal[i, c] + a] += rows[k, 0, o + a] * en + rows[k, 1, o + a] * et
        if block[k, 0] >= 0:
            above, left = (0, 3) if block[k, 3] == 1 else (3, 0)
            for c in range(3):
                en = nn * rows[k, 0, left + c] + nt * rows[k, 1, left + c]
                et = nt * rows[k, 0, left + c] + tt * rows[k, 1, left + c]
                for a in range(3):
                    data[block[k, c] + a] += rows[k, 0, above + a] * en + rows[k, 1, above + a] * et
