"""Adhesive contact of elastic spheres (Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301): force, pull-off, rebound.

With the surface energy g of one face (work of adhesion ``2 g``) the contact radius a gives ``delta = a^2/R - 2 sqrt(pi g a/E*)`` and
``fn = 4 E* a^3/(3 R) - 4 sqrt(pi g E* a^3)``. Where ``d delta/d a = 0`` the neck breaks: ``a_c^3 = pi g R^2/(4 E*)``. In units of it, with
``a = a_c s^2``: ``delta = (a_c^2/R) (s^4 - 4 s)``, ``fn = (4 E* a_c^3/R) (s^6/3 - 2 s^3)``, and the contact is stable where ``s > 1``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, positive

FloatArray = NDArray[np.float64]


class Neck(NamedTuple):
    """``pull_off`` [N], the largest pull, and the overlap [m] where it is; ``touching_force`` [N], the pull at overlap 0;
    ``zero_load_radius`` [m]; radius [m], overlap [m] (negative) and pull [N] at which the neck breaks where the distance is prescribed;
    ``loss`` [J] of one approach and separation, and of one whose neck parts at the largest pull."""

    pull_off: float
    touching_force: float
    zero_load_radius: float
    breaking_radius: float
    breaking_overlap: float
    breaking_force: float
    loss: float
    pull_off_overlap: float
    pull_off_loss: float


def neck(*, e_star: float, surface_energy: float, radius: float) -> Neck:
    """Closed forms of a contact that begins at overlap 0 and ends where its neck breaks.

    The loss is the work of the pull from overlap 0 to the break, which the approach does not give:
    ``integral fn d delta = (8 E* a_c^5/R^2) [s^10/15 - 2 s^7/3 + s^4]`` from ``s^3 = 4`` (overlap 0) to 1, which is
    ``(8 E* a_c^5/R^2) (2 + 3 16^(2/3))/5 = 7.09 (w^5 R^4/E*^2)^(1/3)`` with ``w = 2 g`` (Thornton & Ning, Powder Technology 99 (1998) 154).
    The largest pull is where ``s^3 = 3``.

    Parameters
    ----------
    e_star : float
        ``E*`` [Pa], > 0.
    surface_energy : float
        g of one face [J/m^2], > 0.
    radius : float
        Reduced radius R [m], > 0.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    positive(e_star=e_star, surface_energy=surface_energy, radius=radius)
    e, g, r = e_star, surface_energy, radius
    a = (math.pi * g * r**2 / (4.0 * e)) ** (1.0 / 3.0)
    pull_off = 3.0 * math.pi * g * r
    return Neck(
        pull_off=pull_off,
        touching_force=8.0 / 9.0 * pull_off,
        zero_load_radius=36.0 ** (1.0 / 3.0) * a,
        breaking_radius=a,
        breaking_overlap=-3.0 * a**2 / r,
        breaking_force=5.0 / 9.0 * pull_off,
        loss=8.0 * e * a**5 / r**2 * (2.0 + 3.0 * 16.0 ** (2.0 / 3.0)) / 5.0,
        pull_off_overlap=-(3.0 ** (1.0 / 3.0)) * a**2 / r,
        pull_off_loss=8.0 * e * a**5 / r**2 * (3.0 * 16.0 ** (2.0 / 3.0) - 6.0 * 3.0 ** (1.0 / 3.0)) / 5.0,
    )


def stable_contact(
    overlap: ArrayLike, *, e_star: float, surface_energy: float, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Contact radius [m] and force [N], positive where it pushes, on the stable branch; arguments as in `neck`.

    With ``s = 1 + t`` the quartic is ``t^2 (t^2 + 4 t + 6) = delta R/a_c^2 + 3 = q^2``; ``t sqrt(t^2 + 4 t + 6) = q`` has one simple root
    t >= 0 and no difference of large numbers, at the break too. Newton's method from ``q/sqrt(6)``, which is too large, falls to it.

    Parameters
    ----------
    overlap : array_like
        ``delta`` [m], between that at which the neck breaks and R.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    end = neck(e_star=e_star, surface_energy=surface_energy, radius=radius)
    delta = array("overlap", overlap)
    if np.any((delta < end.breaking_overlap) | (delta >= radius)):
        raise ValueError(
            f"overlap in [{float(delta.min()):g}, {float(delta.max()):g}] m is not allowed: it must lie between {end.breaking_overlap:g}, "
            f"where the neck breaks, and the reduced radius {radius:g} m"
        )
    a = end.breaking_radius
    q = np.sqrt((delta - end.breaking_overlap) * radius) / a
    t = q / math.sqrt(6.0)
    for _ in range(100):
        root = np.sqrt(t * t + 4.0 * t + 6.0)
        step = (t * root - q) * root / (2.0 * t * t + 6.0 * t + 6.0)
        t = t - step
        if np.all(np.abs(step) <= 4e-16 * t):
            break
    s = 1.0 + t
    return a * s**2, 4.0 * e_star * a**3 / radius * (s**6 / 3.0 - 2.0 * s**3)


def sticking_speed(*, e_star: float, surface_energy: float, radius: float, m_eff: float) -> float:
    """Speed of approach [m/s] up to which bodies stick: ``sqrt(2 loss/m_eff)``; ``m_eff`` [kg] > 0, the others as in `neck`."""
    positive(m_eff=m_eff)
    return math.sqrt(2.0 * neck(e_star=e_star, surface_energy=surface_energy, radius=radius).loss / m_eff)


def restitution(*, speed: float, e_star: float, surface_energy: float, radius: float, m_eff: float) -> float:
    """Coefficient of restitution [-] at a speed of approach [m/s] > 0: ``sqrt(1 - (v_s/v)^2)``, 0 up to v_s (`sticking_speed`)."""
    slow = sticking_speed(e_star=e_star, surface_energy=surface_energy, radius=radius, m_eff=m_eff)
    positive(speed=speed)
    share = slow / speed
    return math.sqrt((1.0 - share) * (1.0 + share)) if share < 1.0 else 0.0
