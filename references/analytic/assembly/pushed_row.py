"""Row of equal disks between two walls, one of which moves in: a linear chain, solved by its modes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import MOST, count, finite, not_negative, positive, times_of
from ninedisk.references.analytic.assembly.compression import ramp_response

FloatArray = NDArray[np.float64]

MOST_DISKS = 1_000
"""Of a row: its modes are a square table."""


class ChainModes(NamedTuple):
    """``omega`` [rad/s], shape (n,); ``shape`` of disk i in mode j, (n, n); ``drive`` [1/s^2], (n,): acceleration of a mode per unit
    displacement of the wall."""

    omega: NDArray[np.longdouble]
    shape: NDArray[np.longdouble]
    drive: NDArray[np.longdouble]


def chain_modes(*, n: int, kn: float, mass: float) -> ChainModes:
    """Modes of n disks and n + 1 springs with fixed ends: ``omega_j = 2 sqrt(kn/m) sin(j pi/(2 (n + 1)))``, shapes ``sin(i j pi/(n + 1))``.

    Parameters
    ----------
    n : int
        Number of disks, 1 .. `MOST_DISKS`.
    kn : float
        Normal stiffness of every contact [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.

    Notes
    -----
    Source: e.g. Goldstein, *Classical Mechanics*, chapter 6; the sum of ``sin^2`` over the disks is ``(n + 1)/2``, and the wall acts on
    the first disk alone, hence ``drive_j = (kn/m) 2/(n + 1) sin(j pi/(n + 1))``.
    """
    count(n=n, least=1, most=MOST_DISKS)
    positive(kn=kn, mass=mass)
    ext = np.longdouble
    pi = 4 * np.arctan(ext(1))
    j = np.arange(1, n + 1).astype(ext)
    stiffness = ext(kn) / ext(mass)
    shape = np.sin(np.outer(j, j) * pi / (n + 1))
    return ChainModes(
        2 * np.sqrt(stiffness) * np.sin(j * pi / (2 * (n + 1))), shape, stiffness * 2 / (n + 1) * shape[0]
    )


def chain_forces(
    t: ArrayLike, *, n: int, kn: float, mass: float, xi: float, v_wall: float, t_wall: float
) -> FloatArray:
    """Change of the contact forces since time 0 [N], while every contact stays closed.

    The first wall moves in by ``w = v_wall min(t, t_wall)``; each mode is ``q'' + xi q' + omega^2 q = drive w``, a ramp that stops.

    Parameters
    ----------
    t : array_like, shape (s,)
        Times [s], >= 0.
    n, kn, mass
        As in `chain_modes`.
    xi : float
        Global damping [1/s], >= 0.
    v_wall : float
        Speed of the first wall [m/s].
    t_wall : float
        Duration of its motion [s], >= 0.

    Returns
    -------
    ndarray, shape (s, n + 1)
        Contact 0 is that of the moving wall, contact n that of the resting one.
    """
    not_negative(xi=xi, t_wall=t_wall)
    finite(v_wall=v_wall)
    modes = chain_modes(n=n, kn=kn, mass=mass)
    times = times_of(t)
    if times.ndim != 1 or len(times) * n > 10 * MOST:
        raise ValueError(
            f"t of shape {times.shape} is not allowed: it must have one dimension, and at most {10 * MOST} times disks"
        )
    q = np.empty((len(times), n))
    for j in range(n):
        omega = float(modes.omega[j])
        response = ramp_response(times, omega, xi) - ramp_response(np.maximum(times - t_wall, 0.0), omega, xi)
        q[:, j] = float(modes.drive[j]) / omega**2 * v_wall * response
    wall = v_wall * np.minimum(times, t_wall)
    return forces_of(modes, q, wall, kn).astype(np.float64)


def forces_of(
    modes: ChainModes, q: NDArray[np.floating], wall: NDArray[np.floating], kn: float
) -> NDArray[np.longdouble]:
    """Forces ``kn (u_k - u_(k+1))`` [N], shape (s, n + 1), of modal coordinates ``q`` (s, n) and the wall's way ``wall`` (s,) [m]."""
    ways = np.column_stack([wall, q @ modes.shape.T, np.zeros(len(wall))])
    return np.asarray(np.longdouble(kn) * -np.diff(ways, axis=1), dtype=np.longdouble)


def static_force(*, n: int, kn: float, path: float) -> float:
    """Change of every contact force once all is at rest [N]: ``kn w/(n + 1)``, n + 1 equal springs in series."""
    count(n=n, least=1)
    positive(kn=kn)
    finite(path=path)
    return kn * path / (n + 1)


def mode_forces(*, n: int, kn: float, mass: float, v_wall: float) -> FloatArray:
    """Largest force [N] that each mode's swing can have after a ramp starts or stops, shape (n,): ``2 kn dq``.

    The swing of a mode under a ramp has the amplitude ``drive v/omega^3``, twice that once the ramp has stopped as well, and a
    contact sees the difference of two neighbours' shapes, ``2 sin(j pi/(2 (n + 1)))`` at most.
    """
    finite(v_wall=v_wall)
    modes = chain_modes(n=n, kn=kn, mass=mass)
    j = np.arange(1, n + 1)
    steepest = 2.0 * np.sin(j * math.pi / (2 * (n + 1)))
    return np.asarray(2.0 * kn * steepest * np.abs(modes.drive * v_wall / modes.omega**3), dtype=np.float64)
