"""A disk that wedges two others apart, all three without rotation: Rowe's unit cell of a regular packing that yields."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import finite, not_negative, positive, times_of

FloatArray = NDArray[np.float64]


class Wedge(NamedTuple):
    """``angle`` [rad] of the lines of centres to the vertical, forces [N]: ``side`` normal force between disks, ``wall`` on either
    wall, ``floor`` below either lower disk; ``y`` [m] and ``vy`` [m/s] of the upper disk above the lower ones' centres."""

    angle: FloatArray
    side: FloatArray
    wall: FloatArray
    floor: FloatArray
    y: FloatArray
    vy: FloatArray


def wedge(t: ArrayLike, *, mu: float, g: float, mass: float, chord: float, half_width: float, speed: float) -> Wedge:
    """Forces while smooth walls let the lower disks part at ``speed`` each, or (< 0) push them together.

    The lower disks follow their walls, ``b = half_width + speed t``, the upper one ``y = sqrt(chord^2 - b^2)`` with ``y'' = -speed^2
    chord^2/y^3``. Both contacts slide, with friction against it: with ``phi = atan mu``, its sign that of the speed, the force of a
    contact is inclined by ``angle - phi`` to the vertical, hence::

        wall = m (g + y'')/2 tan(angle - phi),   side = m (g + y'')/2 cos(phi)/cos(angle - phi),   floor = m g + m (g + y'')/2

    Slowly moved, vertical over lateral force is ``cot(angle - phi)``: Rowe's stress ratio ``tan(alpha) tan(phi + beta)``, ``beta = 90
    deg - angle`` the direction of sliding, times the ratio of the cell's sides.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu : float
        Friction coefficient between disks, >= 0.
    g : float
        Gravity [m/s^2], > 0.
    mass : float
        Mass of each disk [kg], > 0.
    chord : float
        Distance of the centres of touching disks [m], > 0.
    half_width : float
        Half the distance of the lower centres at time 0 [m].
    speed : float
        Outward velocity of each lower disk [m/s].

    Raises
    ------
    ValueError
        If an argument is out of range, if the upper disk falls through or the lower ones meet, if friction holds it (angle below phi, walls
        parting), or if it would be thrown up.

    Notes
    -----
    Source: P. W. Rowe, *The stress-dilatancy relation for static equilibrium of an assembly of particles in contact*, Proc. R. Soc. A
    269 (1962) 500-527, for the quasi-static ratio; inertia derived here.
    """
    positive(g=g, mass=mass, chord=chord, half_width=half_width)
    not_negative(mu=mu)
    finite(speed=speed)
    times = times_of(t)
    b = half_width + speed * times
    if not ((b > 0.5 * chord).all() and (b < chord).all()):
        raise ValueError(
            f"half_width = {half_width!r} m with speed = {speed!r} m/s is not allowed: it must stay between {0.5 * chord:g} m, where "
            f"the lower disks meet, and {chord:g} m, where the upper one falls through"
        )
    y = np.sqrt(chord**2 - b**2)
    angle = np.arcsin(b / chord)
    phi = math.copysign(math.atan(mu), speed)
    load = 0.5 * mass * (g - speed**2 * chord**2 / y**3)
    if not ((angle > phi).all() and (angle - phi < 0.5 * math.pi).all() and (load > 0.0).all()):
        raise ValueError(
            f"mu = {mu!r} is not allowed: the contacts would hold (or jam) instead of sliding; use a smaller one"
        )
    wall = load * np.tan(angle - phi)
    side = load * math.cos(phi) / np.cos(angle - phi)
    return Wedge(angle=angle, side=side, wall=wall, floor=mass * g + load, y=y, vy=-b * speed / y)
