"""Spheres in a ring on a plane that bear one on top: statics with friction and without."""

from __future__ import annotations

import math
from typing import NamedTuple

from ninedisk.references._validate import count, not_negative, positive


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


def smooth_legs(*, n: int, angle: float, top: float) -> float:
    """Normal force [N] of each leg where there is no friction and the ring is fixed: ``top/(n cos(angle))``."""
    count(least=2, n=n)
    positive(angle=angle, top=top, cosine=math.cos(angle))
    return top / (n * math.cos(angle))
