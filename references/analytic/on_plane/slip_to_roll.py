"""Disk thrown with slip on a horizontal plane: sliding, then rolling."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import positive, times_of

FloatArray = NDArray[np.float64]

UNIFORM_DISK = 0.5
"""Inertia ratio ``I/(m R^2)`` of a uniform disk; 0.4 for a uniform sphere."""


class RollHistory(NamedTuple):
    """``x`` [m], ``vx`` [m/s] and ``spin`` [rad/s] (counter-clockwise positive) at the times asked for."""

    x: FloatArray
    vx: FloatArray
    spin: FloatArray


def slip_end(*, mu: float, speed: float, g: float, inertia_ratio: float = UNIFORM_DISK) -> float:
    """Time at which rolling starts [s]: ``k v0/((1 + k) mu g)``, ``v0/(3 mu g)`` for a disk.

    The slip velocity ``v + R spin`` falls at ``mu g (1 + 1/k)``, k the inertia ratio.

    Parameters
    ----------
    mu : float
        Friction coefficient, > 0: without friction the slip never ends.
    speed : float
        Initial velocity v0 along x without spin [m/s], > 0.
    g : float
        Gravity [m/s^2], > 0.
    inertia_ratio : float
        ``I/(m R^2)``, > 0.
    """
    positive(mu=mu, speed=speed, g=g, inertia_ratio=inertia_ratio)
    return inertia_ratio * speed / ((1.0 + inertia_ratio) * mu * g)


def rolling_speed(*, speed: float, inertia_ratio: float = UNIFORM_DISK) -> float:
    """Velocity once it rolls [m/s]: ``v0/(1 + k)``, ``2 v0/3`` for a disk, whatever mu and g.

    Friction has no moment about a point of the plane, so ``m v R - I spin`` keeps its value ``m v0 R``.

    Parameters
    ----------
    speed : float
        Initial velocity [m/s], > 0.
    inertia_ratio : float
        ``I/(m R^2)``, > 0.
    """
    positive(speed=speed, inertia_ratio=inertia_ratio)
    return speed / (1.0 + inertia_ratio)


def slip_to_roll(
    t: ArrayLike, *, mu: float, speed: float, g: float, radius: float, inertia_ratio: float = UNIFORM_DISK
) -> RollHistory:
    """History of the disk: ``vx = v0 - mu g t``, ``spin = -mu g t/(k R)`` while it slips, constant afterwards.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu : float
        Friction coefficient, > 0.
    speed : float
        Initial velocity along x, no spin [m/s], > 0.
    g : float
        Gravity [m/s^2], > 0.
    radius : float
        Radius [m], > 0.
    inertia_ratio : float
        ``I/(m R^2)``, > 0.

    Returns
    -------
    RollHistory
        Arrays of the shape of ``t``; rolling to the right spins clockwise: ``spin = -vx/radius``.
    """
    positive(radius=radius)
    end = slip_end(mu=mu, speed=speed, g=g, inertia_ratio=inertia_ratio)
    times = times_of(t)
    slip = np.minimum(times, end)
    final = rolling_speed(speed=speed, inertia_ratio=inertia_ratio)
    x = speed * slip - mu * g * slip**2 / 2.0 + final * (times - slip)
    return RollHistory(x=x, vx=speed - mu * g * slip, spin=-mu * g * slip / (inertia_ratio * radius))


def stop_time(*, mu: float, speed: float, g: float) -> float:
    """Time at which a disk that cannot rotate stops [s]: ``v0/(mu g)``; mu, speed [m/s], g [m/s^2] > 0."""
    positive(mu=mu, speed=speed, g=g)
    return speed / (mu * g)


def slide_to_stop(t: ArrayLike, *, mu: float, speed: float, g: float) -> RollHistory:
    """History of a disk that cannot rotate: decelerates at ``mu g`` and stops after ``v0^2/(2 mu g)``.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu : float
        Friction coefficient, > 0.
    speed : float
        Initial velocity along x [m/s], > 0.
    g : float
        Gravity [m/s^2], > 0.
    """
    slip = np.minimum(times_of(t), stop_time(mu=mu, speed=speed, g=g))
    return RollHistory(x=speed * slip - mu * g * slip**2 / 2.0, vx=speed - mu * g * slip, spin=np.zeros_like(slip))


def spring_overshoot(*, mu: float, g: float, mass: float, ks: float, inertia_ratio: float = UNIFORM_DISK) -> float:
    """Amplitude of the velocity's oscillation that an elastic shear spring leaves in the rolling phase [m/s].

    When the slip velocity u reaches 0 the spring still carries ``mu m g``. From there ``u' = -(1 + 1/k) F/m`` and
    ``F' = ks u``: ``F = mu m g cos(omega t)`` with ``omega^2 = (1 + 1/k) ks/m``, and ``vx' = -F/m`` gives
    ``vx = v0/(1 + k) - (mu g/omega) sin(omega t)``. For a disk the amplitude is ``mu g sqrt(3 m/ks)/3``. It never
    decays without damping; the cap is met again only in the instants where ``|F| = mu m g``.

    Parameters
    ----------
    mu : float
        Friction coefficient, > 0.
    g : float
        Gravity [m/s^2], > 0.
    mass : float
        Mass [kg], > 0.
    ks : float
        Shear stiffness [N/m], > 0.
    inertia_ratio : float
        ``I/(m R^2)``, > 0.
    """
    positive(mu=mu, g=g, mass=mass, ks=ks, inertia_ratio=inertia_ratio)
    return mu * g * math.sqrt(mass * inertia_ratio / ((1.0 + inertia_ratio) * ks))
