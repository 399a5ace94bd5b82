"""Particle sliding on a rigid plane under the associated rule at theta = 1: exact steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import count, finite, not_negative, positive

FloatArray = NDArray[np.float64]


class SlidingSteps(NamedTuple):
    """State after each step 0..n_steps, every array of shape (n_steps + 1,).

    ``x`` [m] and ``vx`` [m/s] along the plane (down an incline), ``gap`` [m] and ``vy`` [m/s] normal to it (velocities NaN in the
    quasi-static case, which has no time), ``fn`` and ``fs`` [N] of the step that ends there (NaN in row 0).
    """

    x: FloatArray
    vx: FloatArray
    gap: FloatArray
    vy: FloatArray
    fn: FloatArray
    fs: FloatArray


def quasistatic_sliding(
    *, mu: float, increment: float, n_steps: int, normal_load: float, gap_0: float = 0.0
) -> SlidingSteps:
    """Equal tangential increments, imposed in the static limit under a constant normal load.

    The load keeps the contact active, so every step ends with ``gap = mu |increment|`` whatever the gap before
    (``du_N = g_0 - mu lambda``): the first increment lifts by ``mu |increment| - gap_0``, later ones by nothing.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    increment : float
        Tangential displacement of each step [m], not 0.
    n_steps : int
        Number of increments.
    normal_load : float
        Force onto the plane [N], > 0: without it nothing closes the gap.
    gap_0 : float
        Gap at the start [m], >= 0.

    Returns
    -------
    SlidingSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: Lim's thesis, appendix A.3.1, equation (A.2).
    """
    finite(increment=increment)
    if increment == 0.0:
        raise ValueError("increment = 0 is not allowed: nothing slides")
    positive(normal_load=normal_load)
    not_negative(mu=mu, gap_0=gap_0)
    count(n_steps=n_steps)
    n = np.arange(n_steps + 1, dtype=np.float64)
    unknown = np.full(n_steps + 1, np.nan)
    gap = np.where(n == 0, gap_0, mu * abs(increment))
    fn = np.where(n == 0, np.nan, normal_load)
    return SlidingSteps(x=n * increment, vx=unknown, gap=gap, vy=unknown.copy(), fn=fn, fs=mu * fn)


def dynamic_sliding(*, mu: float, g0: float, speed: float, dt: float, mass: float, n_steps: int) -> SlidingSteps:
    """Particle thrown along the plane at ``speed`` with gap ``g0``, no gravity, theta = 1.

    The contact of a step stays inactive, ``p = q = 0``, if its free motion ends with ``gap >= mu dx``; at the start
    this is ``g0 >= mu v dt``, i.e. ``dt <= dt_cr`` (A.5), and then every step is free. Otherwise (A.3) gives
    ``du_y = P = (mu v dt - g0)/(1 + mu^2)`` (A.4), ``du_x = v dt - mu P`` and ``p = m P/dt^2``. The next step starts
    with ``gap = mu du_x`` and rises at ``du_y/dt > 0``, so it and all later ones are free.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    g0 : float
        Gap at the start [m], >= 0.
    speed : float
        Tangential velocity at the start [m/s], > 0.
    dt : float
        Time step [s], > 0.
    mass : float
        Mass [kg], > 0.
    n_steps : int
        Number of steps.

    Returns
    -------
    SlidingSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: Lim's thesis, appendix A.3.2, (A.3)-(A.5). For dt < dt_cr the printed (A.4) is negative and
    would need tension.
    """
    positive(speed=speed, dt=dt, mass=mass)
    not_negative(mu=mu, g0=g0)
    count(n_steps=n_steps)
    ext = np.longdouble
    step, v, friction = ext(dt), ext(speed), ext(mu)
    lift = max((friction * v * step - ext(g0)) / (1 + friction**2), ext(0))
    later = np.arange(n_steps + 1).astype(ext)
    moved = later > 0
    vx = np.where(moved, v - friction * lift / step, v)
    vy = np.where(moved, lift / step, ext(0))
    fn = np.where(later == 1, ext(mass) * lift / step**2, ext(0))
    fn[0] = np.nan
    columns = (later * step * vx, vx, ext(g0) + later * step * vy, vy, fn, friction * fn)
    return SlidingSteps(*(column.astype(np.float64) for column in columns))
