"""Stability limits of explicit central differences: single mode and row of three disks between walls."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, form_in_range, not_negative, positive

FloatArray = NDArray[np.float64]

MOST_SIZE = 1_000
"""Rows of a matrix whose eigenvalues are found."""


def row_frequencies(*, kn: float, mass: float) -> FloatArray:
    """Angular frequencies of three equal disks in a row between walls [rad/s], ascending.

    Four equal springs, fixed ends: ``omega_k^2 = (2 - 2 cos(k pi/4)) kn/m``, k = 1, 2, 3, i.e.
    ``2 - sqrt 2, 2, 2 + sqrt 2``.

    Parameters
    ----------
    kn : float
        Normal stiffness of every contact [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.

    Returns
    -------
    ndarray, shape (3,)
    """
    positive(kn=kn, mass=mass)
    return np.sqrt(np.array([2.0 - math.sqrt(2.0), 2.0, 2.0 + math.sqrt(2.0)]) * kn / mass)


def mode_limit(*, omega: float, damping_ratio: float = 0.0, form: Literal["central", "lagged"] = "central") -> float:
    """Largest stable step of one mode [s].

    ``2/omega`` if the damping force sees the mean of old and new velocity ("central"); with the velocity of the last
    half step ("lagged") the root at -1 of ``l^2 - l (2 - (omega dt)^2 - 2 zeta omega dt) + 1 - 2 zeta omega dt``
    gives ``(2/omega) (sqrt(1 + zeta^2) - zeta)``.

    Parameters
    ----------
    omega : float
        Angular frequency [rad/s], > 0.
    damping_ratio : float
        Fraction of critical damping zeta [-], >= 0: ``xi/(2 omega)`` for global damping, beta for the dashpot of a
        binary contact.
    form : {"central", "lagged"}
        Velocity that the damping force sees.

    Notes
    -----
    Source of the lagged form: Belytschko, Liu & Moran, Nonlinear Finite Elements for Continua and Structures,
    chapter 6.
    """
    positive(omega=omega)
    not_negative(damping_ratio=damping_ratio)
    form_in_range(form)
    if form == "central":
        return 2.0 / omega
    # sqrt(1 + z^2) - z = 1/(sqrt(1 + z^2) + z), without cancellation for a large z.
    return 2.0 / omega / (math.hypot(1.0, damping_ratio) + damping_ratio)


def lagged_limit(*, mass: ArrayLike, damping: ArrayLike, stiffness: ArrayLike) -> float:
    """Largest stable step [s] of ``M a + C v_{n-1/2} + K x = 0`` by central differences, any C.

    The characteristic matrix ``l^2 M - l (2 M - dt C - dt^2 K) + M - dt C`` becomes, with ``l = (1 + z)/(1 - z)``,
    ``z^2 (4 M - 2 dt C - dt^2 K) + 2 z dt C + dt^2 K``. With M > 0 and C, K >= 0 its roots lie in the left half-plane
    as long as the leading matrix is positive definite, so the limit is the smallest positive dt at which
    ``4 M - 2 dt C - dt^2 K`` is singular.

    Parameters
    ----------
    mass, damping, stiffness : array_like, shape (n, n)
        Symmetric matrices [kg, N s/m, N/m]; mass positive definite, the others positive semi-definite, not both 0.

    Raises
    ------
    ValueError
        If a matrix is not symmetric or the mass matrix is not positive definite.
    """
    M, C, K = (array(name, given) for name, given in (("mass", mass), ("damping", damping), ("stiffness", stiffness)))
    for name, matrix in (("mass", M), ("damping", C), ("stiffness", K)):
        if matrix.ndim != 2 or not np.array_equal(matrix, matrix.T):
            raise ValueError(f"{name} of shape {matrix.shape} is not a symmetric matrix")
        if matrix.shape != M.shape or not 1 <= len(matrix) <= MOST_SIZE:
            raise ValueError(f"{name} of shape {matrix.shape} is not allowed: all are of one size, at most {MOST_SIZE}")
    if np.linalg.eigvalsh(M).min() <= 0.0:
        raise ValueError("mass is not positive definite: every body needs a mass > 0")
    for name, matrix in (("damping", C), ("stiffness", K)):
        if np.linalg.eigvalsh(matrix).min() < -1e-9 * np.abs(matrix).max():
            raise ValueError(
                f"{name} is not positive semi-definite: no spring pushes further, and no dashpot speeds up"
            )
    if not (C.any() or K.any()):
        raise ValueError("stiffness and damping are both 0: every step is stable")
    n = len(M)
    # s = 1/dt: s^2 x = s M^-1 C/2 x + M^-1 K/4 x; the largest real s is the smallest dt.
    companion = np.block(
        [
            [np.linalg.solve(M, C) / 2.0, np.linalg.solve(M, K) / 4.0],
            [np.eye(n), np.zeros((n, n))],
        ]
    )
    return float(1.0 / np.linalg.eigvals(companion).real.max())


def row_limit(*, kn: float, mass: float, c_disk_disk: float = 0.0, c_wall: float = 0.0, xi: float = 0.0) -> float:
    """Largest stable step [s] of the row of three disks with lagged dashpots and lagged global damping.

    Without damping it is ``2/sqrt((2 + sqrt 2) kn/m)``, which central global damping leaves unchanged.

    Parameters
    ----------
    kn : float
        Normal stiffness of every contact [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.
    c_disk_disk, c_wall : float
        Dashpots of the disk-disk and wall contacts [N s/m], >= 0. A damping ratio beta means
        ``2 beta sqrt(m_eff kn)``, with ``m_eff = m/2`` between disks and m at a wall.
    xi : float
        Global damping [1/s], >= 0.
    """
    positive(kn=kn, mass=mass)
    not_negative(c_disk_disk=c_disk_disk, c_wall=c_wall, xi=xi)

    def chain(wall: float, inner: float) -> FloatArray:
        return np.array([[wall + inner, -inner, 0.0], [-inner, 2.0 * inner, -inner], [0.0, -inner, wall + inner]])

    return lagged_limit(
        mass=mass * np.eye(3), damping=chain(c_wall, c_disk_disk) + xi * mass * np.eye(3), stiffness=chain(kn, kn)
    )
