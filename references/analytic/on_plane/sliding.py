"""Associated sliding rule, single dynamic step: (A.4) and (A.5)."""

from __future__ import annotations

import math

from ninedisk.references._validate import not_negative, positive


def normal_displacement_as_printed(*, mu: float, speed: float, dt: float, g0: float) -> float:
    """(A.4) as printed [m]: ``(mu v dt - g0)/(1 + mu^2)``; negative, hence wrong, for ``dt < critical_dt``.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    speed : float
        Tangential velocity [m/s], > 0.
    dt : float
        Time step [s], > 0.
    g0 : float
        Gap at the start [m], >= 0.
    """
    positive(speed=speed, dt=dt)
    not_negative(mu=mu, g0=g0)
    return (mu * speed * dt - g0) / (1.0 + mu**2)


def critical_dt(*, mu: float, speed: float, g0: float) -> float:
    """(A.5): largest step without dilation [s], ``g0/(mu v)``; infinite for mu = 0.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    speed : float
        Tangential velocity [m/s], > 0.
    g0 : float
        Gap at the start [m], >= 0.
    """
    positive(speed=speed)
    not_negative(mu=mu, g0=g0)
    return g0 / (mu * speed) if mu > 0.0 else math.inf
