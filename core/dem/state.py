"""Arrays of a DEM run, grouped as the kernels read them. All are float64 unless said."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

KN, KS, MU, BETA, TORQUE_OVERLAP, SLIP_OVERLAP, WALL_MID, SLIP_MIDDLE = range(8)
"""Columns of a law row: kn [N/m], ks [N/m], mu, beta, lever arm R - overlap/2 (1) or R (0) of the torque and of the slip, wall
velocity at mid-overlap (1) or on the surface (0), slip in the middle of the step (1) or at its end (0)."""

STEP, PENDING, ROW, REBUILDS, BUILT = range(5)
"""Entries of the clock: contact steps done; 1 if forces at this step are still to be found; next sample row; list
rebuilds so far; step of the last one."""

GRAINS_STOPPED = 4
"""What `advance` returns, beside the codes of `search_kernels`, if the memory of the outlines' contacts says why a step stopped."""


BEHIND_WALL = 5
"""What `advance` returns if the centre of a disk is behind a wall: `WallArrays.behind` says which."""


class DiskArrays(NamedTuple):
    """State of n disks at ``t_n``: positions at ``t_n``, velocities at ``t_{n-1/2}`` (at n = 0: ``t_0``).

    Large runs keep the disks in the order of the cells of the contact search; ``name`` and ``place`` translate.

    Attributes
    ----------
    x, v : shape (n, 2), [m], [m/s]
    angle, omega : shape (n,), [rad], [rad/s]
    radius, inv_mass, inv_inertia : shape (n,), [m], [1/kg], [1/(kg m^2)]; ``inv_mass`` is 0 for a disk that is fixed, and
        ``inv_inertia`` for one that does not rotate
    force : shape (n, 2), contact forces at ``t_n`` [N]; scratch during a rebuild
    torque : shape (n,), contact torques at ``t_n`` [N m]; scratch during a rebuild
    v_now : shape (n, 2), velocity that contact dashpots see [m/s]; shape (0, 2) where there is none, or where it is ``v``
    moved : ndarray of float32, shape (n, 2), displacement since the last rebuild of the lists [m]
    name : ndarray of uint32, shape (n,), number that the scene gives to the disk in this row
    place : ndarray of uint32, shape (n,), row of the scene's disk
    listed : ndarray of uint32, shape (n,), row that this disk had when the lists in use were built
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
    moved: NDArray[np.float32]
    name: NDArray[np.uint32]
    place: NDArray[np.uint32]
    listed: NDArray[np.uint32]


class Views(NamedTuple):
    """What the force kernel reads of the disks as plain vectors, and what stays the same for each listed pair; n disks.

    Arrays of one dimension and unsigned indices spare the address arithmetic of rows, strides and negative indices, a third of the
    kernel's instructions.

    Attributes
    ----------
    x, v, seen, force : shape (2 n,)
        The memory of ``DiskArrays.x``, ``v``, the velocities that dashpots see (``v_now`` or ``v``) and ``force``.
    moved : ndarray of float32, shape (2 n,)
        The memory of ``DiskArrays.moved``.
    row : ndarray of uint32, shape (capacity of the list,)
        First disk of each listed disk-disk pair.
    damping : shape (capacity of the list,)
        Dashpot coefficient of each listed disk-disk pair [N s/m].
    """

    x: FloatArray
    v: FloatArray
    seen: FloatArray
    force: FloatArray
    moved: NDArray[np.float32]
    row: NDArray[np.uint32]
    damping: FloatArray


class WallArrays(NamedTuple):
    """State of m walls; s stripes.

    Attributes
    ----------
    now, built : shape (m, 11)
        Pose and velocity (columns of `place_walls`) at ``t_n`` and at the last rebuild.
    middle : shape (m, 11)
        Pose and velocity at ``t_{n-1/2}`` (at n = 0: ``t_0``).
    extent : shape (m,)
        Largest distance of a disk's centre from the wall's point at the last rebuild [m].
    law : shape (m, 8)
        Law rows.
    load, load_before : shape (m, 3)
        Force of the disks on the wall [N] and its torque about the origin [N m], at ``t_n`` and ``t_{n-1}``.
    share : shape (s, m, 3)
        Part of the load that each stripe contributes.
    behind : shape (s, 3)
        1 + number of a disk of each stripe whose centre is behind a wall, that wall, and the height [m]; 0 where there is none.
    passed : ndarray of int64, shape (1,)
        1 if there is such a disk in any stripe.
    """

    now: FloatArray
    built: FloatArray
    middle: FloatArray
    extent: FloatArray
    law: FloatArray
    load: FloatArray
    load_before: FloatArray
    share: FloatArray
    behind: FloatArray
    passed: NDArray[np.int64]


class Team(NamedTuple):
    """What the threads of a run share; s stripes, at most t threads.

    Disks are divided into stripes of whole rows of cells, in ascending order; a pair belongs to the stripe of its first disk and
    touches no further than the next stripe. Even stripes at once, then odd ones, never write to the same disk at the same time, and
    every sum is formed in an order that does not depend on the number of threads.

    Attributes
    ----------
    stripe : ndarray of int64, shape (s + 1,)
        First row of each stripe; unused stripes are empty.
    border : ndarray of int64, shape (s,)
        First row of each stripe whose disk no pair of the stripe before touches.
    flags : ndarray of int64, shape (t * PAD,)
        Barrier, see `ninedisk.core.threads`.
    far : ndarray, shape (t * PAD,)
        Largest squared displacement since the last rebuild among each thread's disks [m^2].
    code : ndarray of int64, shape (1,)
        Outcome of the last rebuild.
    scratch : ndarray, shape (t, SCRATCH + 2 * PAD)
        Scratch of each thread's pairs; the rest keeps two threads' apart.
    """

    stripe: NDArray[np.int64]
    border: NDArray[np.int64]
    flags: NDArray[np.int64]
    far: FloatArray
    code: NDArray[np.int64]
    scratch: FloatArray


class Kick(NamedTuple):
    """Scalars of a kick and drift: ``v+ = keep v- + gain (F/m + g)``, ``x+ = x + dt v+``.

    Attributes
    ----------
    keep, gain : float
        [-] and [s].
    ahead : float
        ``v_n`` that dashpots see is extrapolated from ``v_{n-1/2}`` by this part of the last change of velocity.
    dt : float
        Contact step [s].
    gravity_x, gravity_y : float
        [m/s^2].
    """

    keep: float
    gain: float
    ahead: float
    dt: float
    gravity_x: float
    gravity_y: float


class StepConstants(NamedTuple):
    """Scalars of the scheme.

    Attributes
    ----------
    first, kick : Kick
        The half kick from ``t_0`` to ``t_{1/2}``, and all later ones.
    radius : float
        Mean radius [m].
    first_skin, least_skin, most_skin : float
        Skin of the first neighbour lists and limits of later ones [m].
    lagged : bool
        Whether dashpots see ``v_{n-1/2}`` instead of ``v_n``.
    sorted : bool
        Whether disks are kept in the order of the cells.
    """

    first: Kick
    kick: Kick
    radius: float
    first_skin: float
    least_skin: float
    most_skin: float
    lagged: bool
    sorted: bool


class Samples(NamedTuple):
    """Where the kernels write sampled steps; s samples, k chosen disks, c watched pairs, m walls.

    Attributes
    ----------
    at : ndarray of int64, shape (s,)
        Contact steps to sample, ascending.
    chosen : ndarray of int64, shape (k,)
        Disks whose motion is recorded, by their number in the scene.
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
