"""Head-on collision of two disks with Newton's restitution."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import finite, fraction, not_negative, positive, times_of

FloatArray = NDArray[np.float64]


class CollisionHistory(NamedTuple):
    """Velocities [m/s], kinetic energy [J] and momentum [kg m/s] at the times asked for."""

    vx_1: FloatArray
    vx_2: FloatArray
    vy_1: FloatArray
    vy_2: FloatArray
    energy: FloatArray
    momentum_x: FloatArray


def final_velocities(
    *, v_1: float, v_2: float, mass_1: float, mass_2: float, restitution: float
) -> tuple[float, float]:
    """Velocities after the impact [m/s]: centre of mass kept, relative velocity times ``-e``.

    Parameters
    ----------
    v_1, v_2 : float
        Velocities before [m/s].
    mass_1, mass_2 : float
        Masses [kg], > 0.
    restitution : float
        Coefficient of restitution e, in [0, 1].

    Raises
    ------
    ValueError
        If a mass or the restitution is out of range.
    """
    finite(v_1=v_1, v_2=v_2)
    positive(mass_1=mass_1, mass_2=mass_2)
    fraction(restitution=restitution)
    exchanged = (1.0 + restitution) * (v_1 - v_2) / (mass_1 + mass_2)
    return v_1 - mass_2 * exchanged, v_2 + mass_1 * exchanged


def collision_history(
    t: ArrayLike, *, gap: float, speed: float, mass_1: float, mass_2: float, restitution: float
) -> CollisionHistory:
    """Piecewise constant history of disk 1 moving at ``speed`` towards disk 2 at rest.

    The impact is at ``gap/speed``; a time equal to it counts as before.

    Parameters
    ----------
    t : array_like
        Times [s].
    gap : float
        Gap at time 0 [m], >= 0.
    speed : float
        Velocity of disk 1 [m/s], > 0.
    mass_1, mass_2 : float
        Masses [kg], > 0.
    restitution : float
        Coefficient of restitution, in [0, 1].

    Returns
    -------
    CollisionHistory
        Arrays of the shape of ``t``.
    """
    positive(speed=speed)
    not_negative(gap=gap)
    after_1, after_2 = final_velocities(v_1=speed, v_2=0.0, mass_1=mass_1, mass_2=mass_2, restitution=restitution)
    before = times_of(t) <= gap / speed
    vx_1, vx_2 = np.where(before, speed, after_1), np.where(before, 0.0, after_2)
    zero = np.zeros_like(vx_1)
    return CollisionHistory(
        vx_1=vx_1,
        vx_2=vx_2,
        vy_1=zero,
        vy_2=zero.copy(),
        energy=(mass_1 * vx_1**2 + mass_2 * vx_2**2) / 2.0,
        momentum_x=np.full_like(vx_1, mass_1 * speed),
    )
