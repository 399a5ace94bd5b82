"""Disk on an incline with Coulomb friction, released from rest: it rolls, or slides and spins."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import not_negative, positive, slope, times_of
from ninedisk.references.analytic.on_plane.slip_to_roll import UNIFORM_DISK

FloatArray = NDArray[np.float64]


class RollRates(NamedTuple):
    """Constant rates: acceleration down the incline [m/s^2], of the spin [rad/s^2] (positive when rolling forward) and of the
    slip [m/s^2], and the contact forces ``fn``, ``fs`` [N]."""

    along: float
    spin: float
    slip: float
    fn: float
    fs: float


class RollDown(NamedTuple):
    """``x`` [m], ``vx`` [m/s], ``spin`` [rad/s], ``slip`` [m/s], ``fn`` and ``fs`` [N] at the times asked for."""

    x: FloatArray
    vx: FloatArray
    spin: FloatArray
    slip: FloatArray
    fn: FloatArray
    fs: FloatArray


def rolling_mu(*, angle: float, inertia_ratio: float = UNIFORM_DISK) -> float:
    """Friction coefficient above which the body rolls [-]: ``tan(angle) k/(1 + k)``, ``tan(angle)/3`` for a disk.

    Parameters
    ----------
    angle : float
        Slope [rad], in [0, pi/2).
    inertia_ratio : float
        ``k = I/(m R^2)``, > 0.
    """
    slope(angle)
    positive(inertia_ratio=inertia_ratio)
    return math.tan(angle) * inertia_ratio / (1.0 + inertia_ratio)


def roll_rates(
    *, mu: float, angle: float, g: float, mass: float, radius: float, inertia_ratio: float = UNIFORM_DISK
) -> RollRates:
    """Rates of the released body.

    Newton and Euler, ``m a = m g sin - fs`` and ``k m R^2 alpha = fs R``, with either no slip, ``a = R alpha``, or full
    friction, ``fs = mu m g cos``. Rolling: ``a = g sin/(1 + k)``, ``fs = m g sin k/(1 + k)``: 2/3 and 1/3 for a disk. Sliding:
    ``a = g (sin - mu cos)``, ``alpha = mu g cos/(k R)``, and the slip grows at ``g sin - (1 + 1/k) mu g cos``.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    angle : float
        Slope [rad], in [0, pi/2).
    g : float
        Gravity [m/s^2], > 0.
    mass, radius : float
        Mass [kg] and radius [m], > 0.
    inertia_ratio : float
        ``k = I/(m R^2)``, > 0.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: rigid-body mechanics, e.g. Goldstein, *Classical Mechanics*, section 2.4 (hoop on an incline), for general k.
    """
    positive(g=g, mass=mass, radius=radius)
    not_negative(mu=mu)
    slope(angle)
    normal, pull = g * math.cos(angle), g * math.sin(angle)
    if mu >= rolling_mu(angle=angle, inertia_ratio=inertia_ratio):
        along = pull / (1.0 + inertia_ratio)
        return RollRates(along, along / radius, 0.0, mass * normal, mass * pull * inertia_ratio / (1.0 + inertia_ratio))
    along, turning = pull - mu * normal, mu * normal / inertia_ratio
    return RollRates(along, turning / radius, along - turning, mass * normal, mu * mass * normal)


def roll_down(t: ArrayLike, rates: RollRates) -> RollDown:
    """Motion from rest under constant rates at times ``t`` [s], >= 0; arrays of its shape."""
    times = times_of(t)
    return RollDown(
        x=rates.along * times**2 / 2.0,
        vx=rates.along * times,
        spin=rates.spin * times,
        slip=rates.slip * times,
        fn=np.full_like(times, rates.fn),
        fs=np.full_like(times, rates.fs),
    )
