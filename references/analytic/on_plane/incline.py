"""Block on an incline with Coulomb friction, starting from rest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import not_negative, positive, slope, times_of

FloatArray = NDArray[np.float64]


class InclineHistory(NamedTuple):
    """``x`` [m] and ``vx`` [m/s] down the incline, contact forces ``fn`` and ``fs`` [N], at the times asked for."""

    x: FloatArray
    vx: FloatArray
    fn: FloatArray
    fs: FloatArray


def critical_mu(*, angle: float) -> float:
    """Friction coefficient at which the block stops sliding [-]: ``tan(angle)``, angle in rad, in [0, pi/2)."""
    slope(angle)
    return math.tan(angle)


def acceleration(*, mu: float, angle: float, g: float) -> float:
    """Acceleration down the incline [m/s^2]: ``g (sin - mu cos)``, 0 where the block sticks.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    angle : float
        Slope [rad], in [0, pi/2).
    g : float
        Gravity [m/s^2], > 0.
    """
    positive(g=g)
    not_negative(mu=mu)
    slope(angle)
    # Near the critical mu the difference cancels; sin(angle - atan mu)/cos(atan mu) does not.
    return max(g * math.sin(angle - math.atan(mu)) * math.hypot(1.0, mu), 0.0)


def incline(t: ArrayLike, *, mu: float, angle: float, g: float, mass: float) -> InclineHistory:
    """Motion and contact forces, (A.7) of Lim's thesis with the forces that equilibrium gives.

    Sliding: ``x = a t^2/2``, ``vx = a t``, ``fs = mu m g cos``. Sticking (``mu >= tan(angle)``): ``x = vx = 0``,
    ``fs = m g sin``. Both: ``fn = m g cos``.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu : float
        Friction coefficient, >= 0.
    angle : float
        Slope [rad], in [0, pi/2).
    g : float
        Gravity [m/s^2], > 0.
    mass : float
        Mass [kg], > 0.

    Returns
    -------
    InclineHistory
        Arrays of the shape of ``t``.
    """
    positive(mass=mass)
    a = acceleration(mu=mu, angle=angle, g=g)
    times = times_of(t)
    normal = mass * g * math.cos(angle)
    shear = mu * normal if a > 0.0 else mass * g * math.sin(angle)
    return InclineHistory(
        x=a * times**2 / 2.0, vx=a * times, fn=np.full_like(times, normal), fs=np.full_like(times, shear)
    )
