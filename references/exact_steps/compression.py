"""Row of three disks squeezed by smooth walls, stepped by central differences."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import count, form_in_range, not_negative, positive

FloatArray = NDArray[np.float64]


def smooth_row(
    *,
    kn: float,
    mass: float,
    xi: float,
    dt: float,
    n_load: int,
    v_wall: float,
    n_steps: int,
    form: Literal["central", "lagged"] = "central",
) -> tuple[FloatArray, FloatArray]:
    """Contact forces of every step, exact for explicit central differences with global damping.

    Three equal disks in a row touch each other and two walls that move in at ``v_wall`` for ``n_load`` steps. The
    middle disk rests by symmetry. With x the displacement of a side disk towards the middle and w that of its wall
    the disk-disk force is ``kn x``, the wall's is ``kn (w - x)``, and ``m x'' + xi m x' = F = kn w - 2 kn x`` is
    stepped as ``v+ = ((1 - a) v- + dt F/m) / (1 + a)`` with ``a = xi dt/2`` ("central") or
    ``v+ = v- + dt (F/m - xi v-)`` ("lagged"), then ``x+ = x + dt v+``. At rest with F_0 = 0 the start
    ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)`` is 0.

    Parameters
    ----------
    kn : float
        Normal stiffness of every contact [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.
    xi : float
        Global (mass-proportional) damping [1/s], >= 0.
    dt : float
        Time step [s], > 0.
    n_load : int
        Number of steps during which the walls move.
    v_wall : float
        Speed of each wall [m/s], >= 0.
    n_steps : int
        Number of steps.
    form : {"central", "lagged"}
        Velocity that the damping force sees.

    Returns
    -------
    fn_disk_disk, fn_wall : ndarray, shape (n_steps + 1,)
        Normal forces [N] at positions ``t_n = n dt``. Row 0 is the initial state, row 1 has the wall force
        ``kn v_wall dt`` (walls moved once, disks not yet).

    Raises
    ------
    ValueError
        If an argument is out of range, or a contact would open: the row is then no linear oscillator.

    Notes
    -----
    Source: Cundall & Strack (1979), doi:10.1680/geot.1979.29.1.47, for the scheme; the reduction to one oscillator
    follows from symmetry.
    """
    positive(kn=kn, mass=mass, dt=dt)
    not_negative(xi=xi, v_wall=v_wall)
    count(n_load=n_load, n_steps=n_steps)
    form_in_range(form)
    ext = np.longdouble
    step, stiffness, speed, rate = ext(dt), ext(kn), ext(v_wall), ext(xi)
    half = rate * step / 2
    keep, gain = ((1 - half) / (1 + half), 1 / (1 + half)) if form == "central" else (1 - rate * step, ext(1))
    wall = speed * step * np.minimum(np.arange(n_steps + 1), n_load).astype(ext)
    x = np.zeros(n_steps + 1, dtype=ext)
    v = ext(0)
    for n in range(1, n_steps):
        v = keep * v + gain * step * stiffness * (wall[n] - 2 * x[n]) / ext(mass)
        x[n + 1] = x[n] + step * v
    return closed_row(kn=stiffness, x=x, wall=wall)


def closed_row(
    *, kn: np.longdouble, x: NDArray[np.longdouble], wall: NDArray[np.longdouble]
) -> tuple[FloatArray, FloatArray]:
    """Forces ``kn x`` and ``kn (wall - x)`` [N] of a row whose contacts all stay closed.

    Parameters
    ----------
    kn : longdouble
        Normal stiffness [N/m].
    x, wall : ndarray of longdouble, shape (s,)
        Displacements of a side disk and of its wall towards the middle [m].

    Returns
    -------
    fn_disk_disk, fn_wall : ndarray, shape (s,)

    Raises
    ------
    ValueError
        If a force is negative, naming the first step.
    """
    for name, overlap in (("disk-disk", x), ("wall", wall - x)):
        opened = np.flatnonzero(overlap < 0)
        if opened.size:
            raise ValueError(
                f"the {name} contact of the row opens at step {opened[0]} (overlap {float(overlap[opened[0]]):.3g} m): "
                "the closed form needs contacts that stay closed; load more slowly, damp more (xi), or reduce dt"
            )
    return (kn * x).astype(np.float64), (kn * (wall - x)).astype(np.float64)
