"""Spheres in a ring on a plane that bear one on top: statics with friction and without."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from ninedisk.references._validate import count, not_negative, positive, times_of

FloatArray = NDArray[np.float64]


class RingForces(NamedTuple):
    """Of each leg [N]: normal force and friction ``top_n``, ``top_s`` at the top sphere, ``floor_n``, ``floor_s`` at the plane; and the
    least friction coefficients ``top_mu``, ``floor_mu`` [-] with which the heap stands."""

    top_n: float
    top_s: float
    floor_n: float
    floor_s: float
    top_mu: float
    floor_mu: float


def ring_angle(*, n: int, spread: float = 1.0) -> float:
    """Angle [rad] between the vertical and the lines from the top's centre to those of n equal spheres, ``spread`` diameters apart.

    The ring's radius is ``spread R/sin(pi/n)``: ``sin(angle) = spread/(2 sin(pi/n))``, ``1/sqrt(3)`` for a tetrahedron and ``1/sqrt(2)``
    for a pyramid on four.

    Raises
    ------
    ValueError
        If an argument is out of range, or the top sphere falls through the ring.
    """
    count(least=2, n=n)
    positive(spread=spread)
    sine = 0.5 * spread / math.sin(math.pi / n)
    if sine >= 1.0:
        raise ValueError(f"spread = {spread!r} is not allowed: the top sphere falls through a ring of {n}; use less than "
                         f"{2.0 * math.sin(math.pi / n):g}")  # fmt: skip
    return math.asin(sine)


def ring_forces(*, n: int, angle: float, top: float, each: float) -> RingForces:
    """Forces of a ring of n spheres, touching nothing but the plane and the top sphere.

    A sphere of the ring has friction at two places, whose moments about its centre cancel: both are T. Along the plane ``N sin = T (1 +
    cos)``, hence ``T = N tan(angle/2)``; the top asks for ``n (N cos + T sin) = top``, and as ``cos + sin tan(angle/2) = 1`` each leg bears
    ``N = top/n``. The plane bears ``each + top/n``. For n > 3 this is the mean of the legs: forces that alternate around the ring
    are in equilibrium as well.

    Parameters
    ----------
    n : int
        Spheres of the ring, >= 2.
    angle : float
        Of the lines of centres to the vertical [rad], in (0, pi/2).
    top, each : float
        Weight of the top sphere and of each sphere of the ring [N], > 0 and >= 0.

    Notes
    -----
    Source: statics; in the plane, n = 2, e.g. Coulomb's and Rankine's heaps of cylinders.
    """
    count(least=2, n=n)
    positive(angle=angle, top=top)
    not_negative(each=each)
    if angle >= 0.5 * math.pi:
        raise ValueError(f"angle = {angle!r} rad is not allowed: it must lie in (0, pi/2); degrees must be converted")
    leg, least = top / n, math.tan(0.5 * angle)
    return RingForces(leg, leg * least, each + leg, leg * least, least, least * leg / (each + leg))


def top_displacement(
    t: ArrayLike, *, n: int, angle: float, mu: float, top: float, each: float, radius: float, g: float
) -> FloatArray:
    """How far the top has come down [m], shape (s,), where friction ``mu`` is below ``ring_forces().top_mu``: integrated to 1e-12.

    The top slides on all legs alike, T = mu N, and they roll on the plane. With the leg's distance from the axis ``2R sin`` and the top's
    height over it ``2R cos``, the sphere's ``1 + k = 7/5`` and the masses m = each/g, M = top/g::

        (7/5) m r'' = N (sin - mu (1 + cos)),    M z'' = n N (cos + mu sin) - M g

    and N is eliminated, so that ``(M sin + A cos) angle'' = M g/(2R) + (A sin - M cos) angle'^2`` with
    ``A = (7/5) n m (cos + mu sin)/(sin - mu (1 + cos))``.

    Parameters
    ----------
    t : array_like, shape (s,)
        Times [s], ascending, >= 0, until the top reaches the plane at the latest.
    n, angle, top, each
        As of `ring_forces`.
    mu : float
        Friction coefficient [-] of all contacts, >= 0 and below the least one with which the heap stands.
    radius, g : float
        Of all spheres [m], gravity [m/s^2], > 0.

    Notes
    -----
    Source: Newton and Euler for rigid spheres with Coulomb friction; derived here.
    """
    least = ring_forces(n=n, angle=angle, top=top, each=each).top_mu
    positive(radius=radius, g=g, each=each)
    not_negative(mu=mu)
    if mu >= least:
        raise ValueError(f"mu = {mu!r} is not allowed: the heap stands; use one below {least:g}")
    times = times_of(t)
    if times.ndim != 1 or np.any(np.diff(times) < 0.0):
        raise ValueError(f"t of shape {times.shape} is not allowed to descend, or to be no row of numbers")
    mass, weight = top / g, 1.4 * n * each / g

    def rates(_: float, state: FloatArray) -> tuple[float, float]:
        s, c, turn = math.sin(state[0]), math.cos(state[0]), float(state[1])
        a = weight * (c + mu * s) / (s - mu * (1.0 + c))
        return turn, (top / (2.0 * radius) + (a * s - mass * c) * turn**2) / (mass * s + a * c)

    def landed(_: float, state: FloatArray) -> float:
        return float(math.cos(state[0]))

    landed.terminal = True  # type: ignore[attr-defined]
    end = float(times.max(initial=0.0))
    found = solve_ivp(rates, (0.0, max(end, 1e-300)), (angle, 0.0), method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True,
                      events=landed)  # fmt: skip
    assert found.sol is not None
    if found.t[-1] < end:
        raise ValueError(f"t = {end!r} s is not allowed: the top is down at {found.t[-1]:g} s; use earlier times")
    down: FloatArray = 2.0 * radius * (math.cos(angle) - np.cos(found.sol(times)[0]))
    return down
