"""Collision rates of a gas of equal hard disks or spheres in equilibrium, and how fast one cools whose collisions lose energy."""

from __future__ import annotations

import math

from ninedisk.references._validate import count, fraction, not_negative, positive


def pair_rate(*, n: int, area: float, radius: float, thermal: float, dimension: int = 2) -> float:
    """Collisions of two disks per second among n: ``n Gamma/2``, ``Gamma = 2 rho sigma chi sqrt(pi) v``; of spheres twice sigma^2.

    With the density rho, the diameter sigma, ``v = sqrt(kT/m)`` and Enskog's factor ``chi = (1 - 7 eta/16)/(1 - eta)^2`` of the disks'
    share eta of the area. Of spheres ``Gamma = 4 rho sigma^2 chi sqrt(pi) v`` and ``chi = (1 - eta/2)/(1 - eta)^3``.

    Parameters
    ----------
    n : int
        Number of disks.
    area : float
        Area of the box [m^2], of spheres its volume [m^3], > 0.
    radius : float
        Radius [m], > 0.
    thermal : float
        ``sqrt(kT/m)`` [m/s], > 0: the root mean square of one component of the velocities.
    dimension : int
        2 of disks, 3 of spheres.

    Notes
    -----
    Source: Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases, in two dimensions; chi of Henderson (1975), Mol. Phys.
    30, 971, and of Carnahan & Starling (1969), J. Chem. Phys. 51, 635.
    """
    count(n=n)
    positive(area=area, radius=radius, thermal=thermal)
    _two_or_three(dimension)
    share = n * math.pi * radius**2 / area if dimension == 2 else n * 4.0 / 3.0 * math.pi * radius**3 / area
    if share >= 0.7:
        raise ValueError(
            f"n = {n!r} disks are not allowed in that area: they would fill {share:.2f} of it; a gas has less than 0.7"
        )
    if dimension == 3:
        chi = (1.0 - 0.5 * share) / (1.0 - share) ** 3
        return n / area * 8.0 * radius**2 * chi * math.sqrt(math.pi) * thermal * n
    chi = (1.0 - 7.0 * share / 16.0) / (1.0 - share) ** 2
    return n / area * 2.0 * radius * chi * math.sqrt(math.pi) * thermal * n


def wall_rate(*, n: int, area: float, length: float, thermal: float) -> float:
    """Hits of walls per second: ``rho L v/sqrt(2 pi)``.

    Parameters
    ----------
    n : int
        Number of disks.
    area : float
        Area that their centres may be in [m^2], of spheres the volume [m^3], > 0.
    length : float
        Length of the walls that bound it [m], of spheres their area [m^2], > 0.
    thermal : float
        ``sqrt(kT/m)`` [m/s], > 0.

    Notes
    -----
    Source: flux of a Maxwellian gas; corrections of the density near walls are left out.
    """
    count(n=n)
    positive(area=area, length=length, thermal=thermal)
    return n / area * length * thermal / math.sqrt(2.0 * math.pi)


def haff_time(*, n: int, area: float, radius: float, thermal: float, restitution: float, dimension: int = 2) -> float:
    """Time t0 of Haff's law ``T = T0/(1 + t/t0)^2`` in a bulk [s]: ``1/t0 = (1 - e^2) Gamma/(2 d)`` with the rate Gamma of one disk.

    A collision loses ``(1 - e^2)`` of the energy of approach, which is on average kT, a part 2/(d n) of all in d dimensions.

    Parameters
    ----------
    n, area, radius, thermal, dimension
        As of `pair_rate`, with ``thermal`` at the time 0.
    restitution : float
        In [0, 1).

    Notes
    -----
    Source: Haff (1983), J. Fluid Mech. 134, 401; in the plane van Noije & Ernst (1998), Granular Matter 1, 57, whose correction of the
    Maxwellian velocities vanishes at ``e = 1/sqrt(2)``.
    """
    count(n=n)
    fraction(restitution=restitution)
    if restitution == 1.0:
        raise ValueError("restitution = 1 is not allowed: elastic disks do not cool; use one below 1")
    rate = 2.0 / n * pair_rate(n=n, area=area, radius=radius, thermal=thermal, dimension=dimension)
    return 2.0 * dimension / ((1.0 - restitution**2) * rate)


def rate_in_box(*, n: int, side: float, radius: float, dimension: int = 2) -> float:
    """Rate of collisions of pairs in a square box or a cube over that of a bulk of the same size.

    It is ``(L/B)^2 (1 - 4 s/(pi B) + s^2/(pi B^2)) (1 - 1/n)``. Centres have room ``B = L - 2R``. Two of them touch, at the distance
    s = 2R in the direction phi, in ``(B - s |cos phi|)(B - s |sin phi|)`` of all ``B^2`` places, which is integrated over phi; and each
    disk has n - 1 partners. Of spheres, over the sphere of directions, with q = s/B: ``(L/B)^3 (1 - 3 q/2 + 2 q^2/pi - q^3/(4 pi))``.

    Parameters
    ----------
    n : int
        Number of disks.
    dimension : int
        2 of disks, 3 of spheres.
    side, radius : float
        Of the box and of the disks [m], > 0; the box is wider than two disks.

    Notes
    -----
    Exact for a dilute gas; the density near walls is taken to be that of the middle.
    """
    count(n=n)
    positive(side=side, radius=radius)
    room, reach = side - 2.0 * radius, 2.0 * radius
    if room <= reach:
        raise ValueError(f"side = {side!r} is not allowed: a box must be wider than two disks, {2.0 * reach:g}")
    _two_or_three(dimension)
    share = reach / room
    if dimension == 3:
        apart = 1.0 - 1.5 * share + 2.0 * share**2 / math.pi - share**3 / (4.0 * math.pi)
        return (side / room) ** 3 * apart * (1.0 - 1.0 / n)
    return (side / room) ** 2 * (1.0 - 4.0 * share / math.pi + share**2 / math.pi) * (1.0 - 1.0 / n)


def haff_spread(*, n: int, restitution: float, elapsed: float, dimension: int = 2) -> float:
    """Standard deviation of ln T among gases of n disks that begin with one energy, ``elapsed`` = t/t0 >= 0 after Haff's law began.

    In d dimensions (2 of disks, 3 of spheres) each collision takes ``(1 - e^2) 2 xi/(d n)`` of the energy, xi exponentially distributed
    with mean 1, at random times: twice the variance of a given number of collisions. A gas that is too warm collides more often: in
    ``s = ln(1 + t/t0)`` a deviation decays as exp(-s). So the variance is ``4 (1 - e^2)/(d n) (1 - exp(-2 s))``.

    Notes
    -----
    Derived here; correlations between collisions are left out.
    """
    count(n=n)
    fraction(restitution=restitution)
    not_negative(elapsed=elapsed)
    _two_or_three(dimension)
    return math.sqrt(4.0 / dimension * (1.0 - restitution**2) / n * (1.0 - (1.0 + elapsed) ** -2))


def _two_or_three(dimension: int) -> None:
    count(least=2, dimension=dimension)
    if dimension > 3:
        raise ValueError(f"dimension = {dimension!r} is not allowed: use 2 for disks, 3 for spheres")
