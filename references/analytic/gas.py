"""Collision rates of a dilute gas of equal hard disks in equilibrium."""

from __future__ import annotations

import math

from ninedisk.references._validate import count, positive


def pair_rate(*, n: int, area: float, radius: float, thermal: float) -> float:
    """Collisions of two disks per second among n: ``n Gamma/2``, ``Gamma = 2 rho sigma chi sqrt(pi) v``.

    With the density rho, the diameter sigma, ``v = sqrt(kT/m)`` and Enskog's factor ``chi = (1 - 7 eta/16)/(1 - eta)^2`` of the disks'
    share eta of the area.

    Parameters
    ----------
    n : int
        Number of disks.
    area : float
        Area of the box [m^2], > 0.
    radius : float
        Radius [m], > 0.
    thermal : float
        ``sqrt(kT/m)`` [m/s], > 0: the root mean square of one component of the velocities.

    Notes
    -----
    Source: Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases, in two dimensions; chi of Henderson (1975), Mol. Phys.
    30, 971.
    """
    count(n=n)
    positive(area=area, radius=radius, thermal=thermal)
    share = n * math.pi * radius**2 / area
    if share >= 0.7:
        raise ValueError(
            f"n = {n!r} disks are not allowed in that area: they would fill {share:.2f} of it; a gas has less than 0.7"
        )
    chi = (1.0 - 7.0 * share / 16.0) / (1.0 - share) ** 2
    return n / area * 2.0 * radius * chi * math.sqrt(math.pi) * thermal * n


def wall_rate(*, n: int, area: float, length: float, thermal: float) -> float:
    """Hits of walls per second: ``rho L v/sqrt(2 pi)``.

    Parameters
    ----------
    n : int
        Number of disks.
    area : float
        Area that their centres may be in [m^2], > 0.
    length : float
        Length of the walls that bound it [m], > 0.
    thermal : float
        ``sqrt(kT/m)`` [m/s], > 0.

    Notes
    -----
    Source: flux of a Maxwellian gas; corrections of the density near walls are left out.
    """
    count(n=n)
    positive(area=area, length=length, thermal=thermal)
    return n / area * length * thermal / math.sqrt(2.0 * math.pi)
