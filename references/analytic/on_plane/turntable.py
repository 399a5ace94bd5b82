"""Sphere that rolls without slip on a plane that turns about its normal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import pair_of, positive, times_of

FloatArray = NDArray[np.float64]


UNIFORM_SPHERE = 0.4
"""Inertia ratio ``I/(m R^2)``."""


class CircularMotion(NamedTuple):
    """Place [m] and velocity [m/s] in the plane, each of shape (s, 2), and the angular speed [rad/s] on the circle."""

    x: FloatArray
    v: FloatArray
    rate: float


def turntable(*, start: ArrayLike, v: ArrayLike, turn: float, t: ArrayLike) -> CircularMotion:
    """The centre moves on a circle at 2/7 of the plane's angular speed.

    With k the inertia ratio of a uniform sphere, friction F in the plane gives ``m v' = F`` and ``k m R^2 w' = -R z x F``, with z the
    normal. No slip at the foot,
    ``v - R w x z = Omega z x x``, differentiated: ``v' - R w' x z = Omega z x v``, and ``(z x F) x z = F`` makes the second term
    ``v'/k``. So ``v' = (k/(1 + k)) Omega z x v``: v turns at that rate and keeps its size, whatever friction, mass and radius.

    Parameters
    ----------
    start, v : array_like, shape (2,)
        At time 0, from the axis [m], [m/s].
    turn : float
        Angular speed Omega of the plane about its normal [rad/s], > 0.
    t : array_like, shape (s,)
        [s].

    Notes
    -----
    Source: derived above; E. J. Routh, Dynamics of a System of Rigid Bodies, art. 240; K. Weckesser, Am. J. Phys. 65 (1997) 736.
    """
    positive(turn=turn)
    times = times_of(t)
    rate = turn * UNIFORM_SPHERE / (1.0 + UNIFORM_SPHERE)
    x, u = pair_of("start", start), pair_of("v", v)
    c, s = np.cos(rate * times)[:, None], np.sin(rate * times)[:, None]
    across = np.array([-u[1], u[0]])
    return CircularMotion(x + (s * u + (1.0 - c) * across) / rate, c * u + s * across, rate)
