"""Elastic impact of spheres by Hertz' law, what central differences of a given step make of it, and Nesterenko's solitary wave."""

from __future__ import annotations

import math
from typing import NamedTuple

from ninedisk.references._validate import fraction, pair_of, positive

ROUND_TRIP = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)
"""Duration over ``delta/v``: ``2 int_0^1 dx/sqrt(1 - x^(5/2))``, 2.9432751..."""


class Impact(NamedTuple):
    """Largest force [N], largest overlap [m] and duration [s] of an impact."""

    force: float
    overlap: float
    duration: float


def hertz_impact(*, e_star: float, radius: float, mass: float, speed: float) -> Impact:
    """Two elastic spheres, or a sphere and a plane, that meet head on.

    The energy ``m v^2/2`` is that of the contact, ``(8/15) E* sqrt(R) delta^(5/2)``, where they come to rest.

    Parameters
    ----------
    e_star : float
        E* [Pa], > 0: ``1/E* = sum (1 - nu^2)/E``; a rigid body adds nothing.
    radius, mass : float
        Reduced radius [m] and mass [kg], > 0; at a plane those of the sphere.
    speed : float
        Speed of approach [m/s], > 0.

    Notes
    -----
    Source: Hertz (1881); Johnson, Contact Mechanics (1985), section 11.4.
    """
    positive(e_star=e_star, radius=radius, mass=mass, speed=speed)
    overlap = (15.0 * mass * speed**2 / (16.0 * e_star * math.sqrt(radius))) ** 0.4
    return Impact(1.25 * mass * speed**2 / overlap, overlap, ROUND_TRIP * overlap / speed)


def contact_moduli(first: tuple[float, float], second: tuple[float, float] | None = None) -> tuple[float, float]:
    """E* and G* [Pa] of a contact of bodies ``(E, nu)``, > 0 and in [0, 0.5]; None: a rigid one.

    ``1/E* = sum (1 - nu^2)/E``; ``1/G* = sum (2 - nu)/G`` with ``G = E/(2 (1 + nu))``: Johnson (1985), sections 4.2 and 7.3.
    """
    normal = shear = 0.0
    for name, body in (("first", first), ("second", second)):
        if name == "second" and body is None:
            continue
        young, ratio = pair_of(name, body).tolist()  # type: ignore[arg-type]
        positive(E=young)
        fraction(nu=ratio)
        normal += (1.0 - ratio**2) / young
        shear += (2.0 - ratio) * 2.0 * (1.0 + ratio) / young
    return 1.0 / normal, 1.0 / shear


def hertz_shift(phase: float) -> Impact:
    """What central differences change of an impact without dashpot, relative to `hertz_impact`, to leading order in the step.

    With ``phase = v dt/delta``. The scheme keeps ``m v^2/2 + V + dt^2 (v^2 V''/12 - V'^2/(24 m))`` (Stoermer-Verlet with positions at
    whole steps). At touch V' = V'' = 0; at rest v = 0, so that V is larger by ``dt^2 F^2/(24 m)``, which is ``(25/192) phase^2`` of the
    energy: delta grows by 2/5 and F by 3/5 of that. An integration by parts turns the mean of the two terms over a contact into
    ``dt^2 F^2/(24 m)``; the time is the derivative of the action by the energy E, and the integral of F^2 dt grows as E^(11/10).
    The potential is not smooth at touch, which adds terms of higher order than the second.
    """
    positive(phase=phase)
    energy = 25.0 / 192.0 * phase**2
    squared = 0.8 * math.gamma(1.6) * math.sqrt(math.pi) / math.gamma(2.1)  # int F^2 dt over F_max^2 delta/v
    time = -1.1 * 2.0 * 25.0 / 16.0 * squared / 24.0 * phase**2 / ROUND_TRIP
    return Impact(0.6 * energy, 0.4 * energy, time)


def solitary_speed(*, e_star: float, radius: float, mass: float, speed: float) -> float:
    """Speed [m/s] of Nesterenko's solitary wave in a row of equal spheres that touch without load.

    With ``A = (4/3) E* sqrt(R/2)/m`` and the diameter a, the long-wave equation has ``V = (16/25)^(1/5) a A^(2/5) v^(1/5)`` for the
    largest speed v of a sphere.

    Parameters
    ----------
    e_star, radius, mass : float
        E* [Pa] of a contact, radius [m] and mass [kg] of a sphere, > 0.
    speed : float
        Largest speed of a sphere in the wave [m/s], > 0.

    Notes
    -----
    Source: Nesterenko (1983), J. Appl. Mech. Tech. Phys. 24, 733; Dynamics of Heterogeneous Materials (2001), section 1.3. Waves of five
    diameters are not long beside one: the row of spheres itself differs from it by a per cent or so.
    """
    positive(e_star=e_star, radius=radius, mass=mass, speed=speed)
    stiffness = 4.0 / 3.0 * e_star * math.sqrt(0.5 * radius) / mass
    return float(0.64**0.2 * 2.0 * radius * stiffness**0.4 * speed**0.2)
