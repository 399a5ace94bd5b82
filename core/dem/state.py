"""Arrays of a DEM run, grouped as the kernels read them. All are float64 unless said."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

KN, KS, MU, BETA, TORQUE_OVERLAP, SLIP_OVERLAP, WALL_MID = range(7)
"""Columns of a law row: kn [N/m], ks [N/m], mu, beta, lever arm R - overlap/2 (1) or R (0) of the torque and of the slip, wall
velocity at mid-overlap (1) or on the surface (0)."""

STEP, PENDING, ROW, REBUILDS = range(4)
"""Entries of the clock: contact steps done; 1 if forces at this step are still to be found; next sample row; list
rebuilds so far."""


class DiskArrays(NamedTuple):
    """State of n disks at ``t_n``: positions at ``t_n``, velocities at ``t_{n-1/2}`` (at n = 0: ``t_0``).

    Attributes
    ----------
    x, v : shape (n, 2), [m], [m/s]
    angle, omega : shape (n,), [rad], [rad/s]
    radius, inv_mass, inv_inertia : shape (n,), [m], [1/kg], [1/(kg m^2)]; ``inv_inertia`` is 0 for a disk that does not
        rotate
    force : shape (n, 2), contact forces at ``t_n`` [N]
    torque : shape (n,), contact torques at ``t_n`` [N m]
    v_now : shape (n, 2), velocity that contact dashpots see [m/s]
    x_built : shape (n, 2), positions at the last rebuild of the lists [m]
    """

    x: FloatArray
    v: FloatArray
    angle: FloatArray
    omega: FloatArray
    radius: FloatArray
    inv_mass: FloatArray
    inv_inertia: FloatArray
    force: FloatArray
    torque: FloatArray
    v_now: FloatArray
    x_built: FloatArray


class WallArrays(NamedTuple):
    """State of m walls.

    Attributes
    ----------
    now, built : shape (m, 11)
        Pose and velocity (columns of `place_walls`) at ``t_n`` and at the last rebuild.
    extent : shape (m,)
        Largest distance of a disk's centre from the wall's point at the last rebuild [m].
    law : shape (m, 7)
        Law rows.
    load, load_before : shape (m, 3)
        Force of the disks on the wall [N] and its torque about the origin [N m], at ``t_n`` and ``t_{n-1}``.
    """

    now: FloatArray
    built: FloatArray
    extent: FloatArray
    law: FloatArray
    load: FloatArray
    load_before: FloatArray


class StepConstants(NamedTuple):
    """Scalars of the scheme.

    Attributes
    ----------
    dt : float
        Contact step [s].
    keep, gain : float
        ``v+ = keep v- + gain (F/m + g)``, [-] and [s].
    keep0, gain0 : float
        The same for the half kick from ``t_0`` to ``t_{1/2}``.
    gravity_x, gravity_y : float
        [m/s^2].
    skin : float
        Skin of the lists [m].
    damped, lagged : bool
        Whether a law has a dashpot; whether dashpots see ``v_{n-1/2}`` instead of ``v_n``.
    """

    dt: float
    keep: float
    gain: float
    keep0: float
    gain0: float
    gravity_x: float
    gravity_y: float
    skin: float
    damped: bool
    lagged: bool


class Samples(NamedTuple):
    """Where the kernels write sampled steps; s samples, k chosen disks, c watched pairs, m walls.

    Attributes
    ----------
    at : ndarray of int64, shape (s,)
        Contact steps to sample, ascending.
    chosen : ndarray of int64, shape (k,)
        Disks whose motion is recorded.
    pairs : ndarray of int64, shape (c, 2)
        Watched pairs as body numbers.
    x, v : shape (s, k, 2)
    angle, omega : shape (s, k)
    gap, fn, fs : shape (s, c)
    wall_point : shape (s, m, 2)
    wall_angle : shape (s, m)
    wall_force : shape (s, m, 2)
    energy : shape (s, 5)
        Translation, rotation, elastic normal, elastic shear, gravity [J].
    wall_work : shape (s,)
        Work of the walls on the disks since time 0 [J].
    """

    at: NDArray[np.int64]
    chosen: NDArray[np.int64]
    pairs: NDArray[np.int64]
    x: FloatArray
    v: FloatArray
    angle: FloatArray
    omega: FloatArray
    gap: FloatArray
    fn: FloatArray
    fs: FloatArray
    wall_point: FloatArray
    wall_angle: FloatArray
    wall_force: FloatArray
    energy: FloatArray
    wall_work: FloatArray
