"""Kernel of the critical time step: largest eigenfrequency of the contact network by power iteration."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core._cache import kernel


@kernel
def apply_stiffness(
    springs: NDArray[np.float64],
    bodies: NDArray[np.int64],
    root: NDArray[np.float64],
    u: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """``out = M^-1/2 K M^-1/2 u`` for a network of normal and shear springs.

    Parameters
    ----------
    springs : ndarray, shape (c, 8)
        Normal x, y from the first to the second body, kn, ks [N/m], lever arms [m] of the shear force about both bodies, and of the
        normal force (0 on disks; signs as in `grain_kernels`).
    bodies : ndarray of int64, shape (c, 2)
        Disks of each contact; the second is -1 for a wall.
    root : ndarray, shape (n, 3)
        ``M^-1/2`` per degree of freedom x, y, rotation; 0 where blocked.
    u, out : ndarray, shape (n, 3)
    """
    for i in range(out.shape[0]):
        for d in range(3):
            out[i, d] = 0.0
    for c in range(springs.shape[0]):
        i, j = bodies[c, 0], bodies[c, 1]
        nx, ny, kn, ks = springs[c, 0], springs[c, 1], springs[c, 2], springs[c, 3]
        ai, aj, bi, bj = springs[c, 4], springs[c, 5], springs[c, 6], springs[c, 7]
        ux, uy, turn = u[i, 0] * root[i, 0], u[i, 1] * root[i, 1], u[i, 2] * root[i, 2]
        slip, closing = turn * ai, -turn * bi
        if j >= 0:
            ux -= u[j, 0] * root[j, 0]
            uy -= u[j, 1] * root[j, 1]
            turn = u[j, 2] * root[j, 2]
            slip += turn * aj
            closing += turn * bj
        normal = kn * (ux * nx + uy * ny + closing)
        shear = ks * (-ux * ny + uy * nx + slip)
        fx, fy = normal * nx - shear * ny, normal * ny + shear * nx
        out[i, 0] += root[i, 0] * fx
        out[i, 1] += root[i, 1] * fy
        out[i, 2] += root[i, 2] * (ai * shear - bi * normal)
        if j >= 0:
            out[j, 0] -= root[j, 0] * fx
            out[j, 1] -= root[j, 1] * fy
            out[j, 2] += root[j, 2] * (aj * shear + bj * normal)


@kernel
def largest_eigenvalue(
    springs: NDArray[np.float64],
    bodies: NDArray[np.int64],
    root: NDArray[np.float64],
    u: NDArray[np.float64],
    work: NDArray[np.float64],
    iterations: int,
    tolerance: float,
) -> float:
    """Largest eigenvalue ``omega^2`` [1/s^2] plus the norm of its residual, by power iteration.

    Parameters
    ----------
    springs, bodies, root
        See `apply_stiffness`.
    u : ndarray, shape (n, 3)
        Start vector; out: the eigenvector.
    work : ndarray, shape (n, 3)
    iterations : int
    tolerance : float
        Relative residual at which the iteration stops.
    """
    value, residual = 0.0, 0.0
    for _ in range(iterations):
        norm = 0.0
        for i in range(u.shape[0]):
            for d in range(3):
                norm += u[i, d] * u[i, d]
        norm = 1.0 / sqrt(norm)
        for i in range(u.shape[0]):
            for d in range(3):
                u[i, d] *= norm
        apply_stiffness(springs, bodies, root, u, work)
        value, residual = 0.0, 0.0
        for i in range(u.shape[0]):
            for d in range(3):
                value += u[i, d] * work[i, d]
        for i in range(u.shape[0]):
            for d in range(3):
                r = work[i, d] - value * u[i, d]
                residual += r * r
        residual = sqrt(residual)
        if residual <= tolerance * value or value == 0.0:
            break
        for i in range(u.shape[0]):
            for d in range(3):
                u[i, d] = work[i, d]
    return value + residual
