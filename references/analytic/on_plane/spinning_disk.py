"""Disk put on a horizontal plane with a spin and no velocity: it is driven by friction, then rolls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import positive, times_of
from ninedisk.references.analytic.on_plane.slip_to_roll import UNIFORM_DISK

FloatArray = NDArray[np.float64]


class SpinHistory(NamedTuple):
    """``x`` [m], ``vx`` [m/s] and ``spin`` [rad/s] (positive when rolling forward) at the times asked for."""

    x: FloatArray
    vx: FloatArray
    spin: FloatArray


def slip_end(*, mu: float, spin: float, g: float, radius: float, inertia_ratio: float = UNIFORM_DISK) -> float:
    """Time at which rolling starts [s]: ``k R omega0/((1 + k) mu g)``, ``R omega0/(3 mu g)`` for a disk.

    The slip ``R omega - v`` falls at ``mu g (1 + 1/k)``, k the inertia ratio.

    Parameters
    ----------
    mu : float
        Friction coefficient, > 0.
    spin : float
        Initial spin omega0 [rad/s], > 0.
    g : float
        Gravity [m/s^2], > 0.
    radius : float
        Radius [m], > 0.
    inertia_ratio : float
        ``I/(m R^2)``, > 0.
    """
    positive(mu=mu, spin=spin, g=g, radius=radius, inertia_ratio=inertia_ratio)
    return inertia_ratio * radius * spin / ((1.0 + inertia_ratio) * mu * g)


def spinning_disk(
    t: ArrayLike, *, mu: float, spin: float, g: float, radius: float, inertia_ratio: float = UNIFORM_DISK
) -> SpinHistory:
    """History of the disk: ``vx = mu g t``, ``omega = omega0 - mu g t/(k R)`` while it slips, constant afterwards.

    Parameters are those of `slip_end`, and ``t``, the times [s], >= 0.

    Returns
    -------
    SpinHistory
        Arrays of the shape of ``t``.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: Newton's and Euler's equations with Coulomb friction mu m g at the lowest point, derived here.
    """
    end = slip_end(mu=mu, spin=spin, g=g, radius=radius, inertia_ratio=inertia_ratio)
    times = times_of(t)
    slip = np.minimum(times, end)
    vx = mu * g * slip
    x = mu * g * slip**2 / 2.0 + mu * g * end * (times - slip)
    return SpinHistory(x=x, vx=vx, spin=spin - vx / (inertia_ratio * radius))


def energy_kept(inertia_ratio: float = UNIFORM_DISK) -> float:
    """Part of the kinetic energy that is left once the disk rolls [-]: ``k/(1 + k)``, 1/3 for a disk, whatever mu and g.

    ``m v R + I omega`` keeps its value ``k m R^2 omega0`` about a point of the plane, so that it rolls at ``k R omega0/(1 + k)``.
    """
    positive(inertia_ratio=inertia_ratio)
    return inertia_ratio / (1.0 + inertia_ratio)
