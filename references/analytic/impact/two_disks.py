"""Impact of two unequal disks, off the centre and with spins: impulses of the rigid disks, or of springs with Coulomb's cap."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, fraction, pair, positive
from ninedisk.references.analytic.impact.oblique_impact import rigid_rebound, spring_rebound

FloatArray = NDArray[np.float64]


class Springs(NamedTuple):
    """Stiffnesses [N/m], > 0, and damping ratio of the normal dashpot, >= 0."""

    kn: float
    ks: float
    beta: float


class Impact(NamedTuple):
    """Velocities and spins after an impact, shape (2, 3) [m/s, m/s, rad/s], and its impulses [N s].

    ``normal`` pushes the disks apart; ``shear`` on the first disk counts along ``t = (-n_y, n_x)``.
    """

    velocity: FloatArray
    normal: float
    shear: float


def two_disk_impact(
    *,
    direction: tuple[float, float],
    velocity: ArrayLike,
    radius: ArrayLike,
    mass: ArrayLike,
    inertia: ArrayLike,
    mu: float,
    restitution: float,
    springs: Springs | None = None,
) -> Impact:
    """What an impact along ``direction`` makes of two disks, short enough for the direction to stay.

    The relative velocity at the contact changes as that of one disk on a plane, with the mass ``m = 1/(1/m_1 + 1/m_2)`` towards
    it and ``m/(1 + 1/k)``, ``1/k = m (R_1^2/I_1 + R_2^2/I_2)``, along it.

    Parameters
    ----------
    direction : (float, float)
        Unit normal n from the first disk to the second.
    velocity : array_like, shape (2, 3)
        Velocities [m/s] and spins [rad/s] before, which approach along n.
    radius, mass, inertia : array_like, shape (2,)
        [m], [kg], [kg m^2], > 0.
    mu, restitution : float
        Friction coefficient, >= 0, and coefficient of restitution in [0, 1], which springs do not use.
    springs : Springs or None
        The contact's springs; None: rigid disks.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: `ninedisk.references.analytic.impact.oblique_impact` for the relative motion; the balance of impulses.
    """
    before = array("velocity", velocity, dimensions=(2,))
    r, m, turn = (array("radius, mass, inertia", each, dimensions=(1,)) for each in (radius, mass, inertia))
    if before.shape != (2, 3) or not len(r) == len(m) == len(turn) == 2:
        raise ValueError(
            "velocity, radius, mass or inertia is not allowed: they are two rows of three, and two numbers each"
        )
    for one in (*r, *m, *turn):
        positive(radius_mass_inertia=one)
    fraction(restitution=restitution)
    if not (springs is None or isinstance(springs, Springs)):
        raise ValueError(f"springs = {springs!r} is not allowed: use `Springs`, or None for rigid disks")
    n = np.array(pair("direction", direction))
    if not abs(np.hypot(*n) - 1.0) < 1e-12:
        raise ValueError(f"direction = {direction!r} is not allowed: it must be a unit vector")
    t = np.array([-n[1], n[0]])
    relative = before[0, :2] - before[1, :2]
    slip = float(relative @ t + r @ before[:, 2])
    m_eff = 1.0 / float((1.0 / m).sum())
    approach = float(relative @ n)
    reduced = {
        "velocity": (slip, -approach), "spin": 0.0, "radius": 1.0, "inertia_ratio": 1.0 / (m_eff * float((r**2 / turn).sum())),
        "mu": mu,
    }  # fmt: skip
    if springs is None:
        found = rigid_rebound(**reduced, restitution=restitution)  # type: ignore[arg-type]
    else:
        found = spring_rebound(**reduced, mass=m_eff, **springs._asdict())  # type: ignore[arg-type]
    normal, shear = m_eff * (found.vy + approach), m_eff * (found.vx - slip)
    push = -normal * n + shear * t
    after = before.copy()
    after[0, :2] += push / m[0]
    after[1, :2] -= push / m[1]
    after[:, 2] += r * shear / turn
    return Impact(after, normal, shear)
