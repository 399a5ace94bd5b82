"""Kernel of the critical time step: Lanczos' method on the matrix whose largest eigenvalue is 1/dt."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel

ROUND_OFF = 1e-14
"""Length of a new vector, over the largest entry of the tridiagonal matrix, below which there is no further direction."""


class Network(NamedTuple):
    """Springs and dashpots of all contacts, the masses, global damping.

    Attributes
    ----------
    springs : ndarray, shape (c, 9)
        Normal x, y from the first to the second body, ``sqrt(kn)/2``, ``sqrt(ks)/2`` [sqrt(N/m)], lever arms [m] of the shear force about
        both bodies, and of the normal force (0 on disks; signs as in `grain_kernels`), and the dashpot's part in C' [N s/m].
    bodies : ndarray of int64, shape (c, 2)
        Bodies of each contact; the second is -1 for a wall.
    rolls : ndarray, shape (r, 2)
        ``sqrt(kr)/2`` [sqrt(N m)] of rolling springs, and the dashpot's part in C' [N m s].
    rolling : ndarray of int64, shape (r, 2)
        Bodies of each; the second is -1 for a wall.
    root : ndarray, shape (n, 3)
        ``M^-1/2`` per degree of freedom x, y, rotation; 0 where blocked.
    drag : float
        What global damping adds to C' [1/s].
    """

    springs: NDArray[np.float64]
    bodies: NDArray[np.int64]
    rolls: NDArray[np.float64]
    rolling: NDArray[np.int64]
    root: NDArray[np.float64]
    drag: float


@inline_kernel
def apply(network: Network, given: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """``out = [[C', B/2], [B'/2, 0]] given``; see `ninedisk.core.dem.critical`."""
    springs, bodies, rolls, rolling, root, drag = network
    first = root.size
    for i in range(root.shape[0]):
        for d in range(3):
            out[3 * i + d] = drag * given[3 * i + d]
    for c in range(springs.shape[0]):
        i, j = bodies[c, 0], bodies[c, 1]
        nx, ny, half_n, half_s = springs[c, 0], springs[c, 1], springs[c, 2], springs[c, 3]
        ai, aj, bi, bj, dashpot = springs[c, 4], springs[c, 5], springs[c, 6], springs[c, 7], springs[c, 8]
        ux, uy = given[3 * i] * root[i, 0], given[3 * i + 1] * root[i, 1]
        turn = given[3 * i + 2] * root[i, 2]
        slip, closing = turn * ai, -turn * bi
        if j >= 0:
            ux -= given[3 * j] * root[j, 0]
            uy -= given[3 * j + 1] * root[j, 1]
            turn = given[3 * j + 2] * root[j, 2]
            slip += turn * aj
            closing += turn * bj
        closing += ux * nx + uy * ny
        slip += uy * nx - ux * ny
        k = first + 2 * c
        normal = dashpot * closing + half_n * given[k]
        shear = half_s * given[k + 1]
        out[k], out[k + 1] = half_n * closing, half_s * slip
        fx, fy = normal * nx - shear * ny, normal * ny + shear * nx
        out[3 * i] += root[i, 0] * fx
        out[3 * i + 1] += root[i, 1] * fy
        out[3 * i + 2] += root[i, 2] * (ai * shear - bi * normal)
        if j >= 0:
            out[3 * j] -= root[j, 0] * fx
            out[3 * j + 1] -= root[j, 1] * fy
            out[3 * j + 2] += root[j, 2] * (aj * shear + bj * normal)
    first += 2 * springs.shape[0]
    for c in range(rolls.shape[0]):
        i, j, half, dashpot = rolling[c, 0], rolling[c, 1], rolls[c, 0], rolls[c, 1]
        turn = given[3 * i + 2] * root[i, 2]
        if j >= 0:
            turn -= given[3 * j + 2] * root[j, 2]
        moment = dashpot * turn + half * given[first + c]
        out[first + c] = half * turn
        out[3 * i + 2] += root[i, 2] * moment
        if j >= 0:
            out[3 * j + 2] -= root[j, 2] * moment


@kernel
def lanczos(
    network: Network,
    vector: NDArray[np.float64],
    before: NDArray[np.float64],
    work: NDArray[np.float64],
    diagonal: NDArray[np.float64],
    beside: NDArray[np.float64],
    begin: int,
    end: int,
) -> int:
    """Rows ``begin .. end-1`` of the tridiagonal matrix whose largest eigenvalue tends to that of the scheme (Lanczos 1950).

    Vectors are not made orthogonal anew: what round-off lets come back are copies of eigenvalues that are found already.

    Parameters
    ----------
    network : Network
    vector, before, work : ndarray, shape (3 n + 2 c + r,)
        Present vector, of length 1 and without blocked entries; the one before; scratch. In and out.
    diagonal, beside : ndarray, shape (at least end,)
        The matrix [1/s]: out. ``beside[k]`` couples rows k and k + 1.
    begin, end : int

    Returns
    -------
    int
        Rows found in all: fewer than ``end`` if the vectors so far hold their own images, so that eigenvalues are exact.
    """
    size = vector.shape[0]
    largest = 0.0
    for k in range(begin):
        largest = max(largest, abs(diagonal[k]), beside[k])
    for k in range(begin, end):
        apply(network, vector, work)
        along = 0.0
        for q in range(size):
            along += vector[q] * work[q]
        back = beside[k - 1] if k > 0 else 0.0
        square = 0.0
        for q in range(size):
            work[q] -= along * vector[q] + back * before[q]
            square += work[q] * work[q]
        length = sqrt(square)
        diagonal[k], beside[k] = along, length
        largest = max(largest, abs(along), length)
        if length <= ROUND_OFF * largest:
            return k + 1
        for q in range(size):
            before[q] = vector[q]
            vector[q] = work[q] / length
    return end
