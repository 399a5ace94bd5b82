"""Disks that meet a body whose motion is prescribed: a wall that turns, a floor that shakes along itself, a disk that is held."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import fraction, not_negative, pair, positive, times_of

FloatArray = NDArray[np.float64]


class Struck(NamedTuple):
    """Time of an impact [s], velocity after it [m/s], and the speed [m/s] at which the bodies approached."""

    time: float
    velocity: tuple[float, float]
    approach: float


def struck_by_turning_wall(*, place: tuple[float, float], radius: float, rate: float, restitution: float) -> Struck:
    """Disk at rest that a smooth wall strikes, which turns counter-clockwise about the origin and lies along x at time 0.

    With the wall's normal ``n(a) = (-sin a, cos a)`` at the angle a the wall touches where ``place . n(a) = R``, that is at
    ``a = atan2(y, x) - asin(R/r)``. The wall's point there is ``s = sqrt(r^2 - R^2)`` from the origin and moves along n alone, at
    ``rate s``: even a rough wall would not turn the disk. The disk leaves with ``(1 + e) rate s n(a)``.

    Parameters
    ----------
    place : (float, float)
        Centre of the disk [m], x > 0, at least its radius above the wall.
    radius : float
        Radius R [m], > 0.
    rate : float
        Rate of the wall [rad/s], > 0.
    restitution : float
        Coefficient of restitution e, in [0, 1].

    Notes
    -----
    Source: Newton's restitution for the velocity of the wall's point of contact; derived here.
    """
    x, y = pair("place", place)
    positive(radius=radius, rate=rate)
    fraction(restitution=restitution)
    if not (x > 0.0 and y >= radius):
        raise ValueError(
            f"place = {place!r} is not allowed: the disk must be above the wall, x > 0 and y >= {radius!r}"
        )
    far = math.hypot(x, y)
    angle, arm = math.atan2(y, x) - math.asin(radius / far), math.sqrt(far**2 - radius**2)
    speed = (1.0 + restitution) * rate * arm
    return Struck(angle / rate, (-speed * math.sin(angle), speed * math.cos(angle)), rate * arm)


def rebound_from_held_disk(*, place: tuple[float, float], speed: float, reach: float, restitution: float) -> Struck:
    """Disk that flies along +x, starting at ``place``, and hits a smooth disk that is held at the origin.

    It touches where its distance is ``reach``, the sum of the radii, and loses ``(1 + e)`` times its velocity along the line of
    centres; the held disk takes any momentum. For a held disk that moves, these are the velocities relative to it.

    Parameters
    ----------
    place : (float, float)
        First place of the centre [m], x < 0, at least ``reach`` away, and ``|y| < reach``.
    speed, reach : float
        [m/s], [m], > 0.
    restitution : float
        Coefficient of restitution e, in [0, 1].

    Notes
    -----
    Source: Newton's restitution along the line of centres.
    """
    x, y = pair("place", place)
    positive(speed=speed, reach=reach)
    fraction(restitution=restitution)
    if not (x < 0.0 and abs(y) < reach <= math.hypot(x, y)):
        raise ValueError(
            f"place = {place!r} is not allowed: x < 0, |y| < {reach!r}, and at least {reach!r} from the origin"
        )
    nx, ny = -math.sqrt(1.0 - (y / reach) ** 2), y / reach
    lost = (1.0 + restitution) * speed * nx
    return Struck((reach * nx - x) / speed, (speed - lost * nx, -lost * ny), -speed * nx)


class Carried(NamedTuple):
    """Place [m], velocity [m/s] and acceleration [m/s^2] at the times asked for."""

    x: FloatArray
    v: FloatArray
    a: FloatArray


def carried(t: ArrayLike, *, amplitude: float, frequency: float) -> Carried:
    """A floor that starts from rest and shakes along itself, ``A (cos(W t) - 1)``, and a block that sticks to it.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    amplitude, frequency : float
        A [m] and W [rad/s], >= 0. The block sticks if ``A W^2 < mu g``.

    Notes
    -----
    Source: prescribed path.
    """
    not_negative(amplitude=amplitude, frequency=frequency)
    angle = frequency * times_of(t)
    swing = amplitude * np.cos(angle)
    return Carried(swing - amplitude, -amplitude * frequency * np.sin(angle), -(frequency**2) * swing)
