"""Impact on a linear spring and dashpot beside a linear attraction: restitution and duration, or capture."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import not_negative, number, positive, times_of
from ninedisk.references.analytic.impact.spring_dashpot import free_contact

FloatArray = NDArray[np.float64]


class Rebound(NamedTuple):
    """``restitution`` [-], ``duration`` of the overlap [s] and ``deepest`` overlap [m]."""

    restitution: float
    duration: float
    deepest: float


class Cohesive(NamedTuple):
    """Overlap [m] (negative once open), its ``rate`` [m/s] and the normal force ``fn`` [N], positive where it pushes."""

    overlap: FloatArray
    rate: FloatArray
    fn: FloatArray


def is_captured(*, kn: float, cohesion: float, beta: float) -> bool:
    """Whether bodies that hit each other never part: ``beta >= sqrt(1 - c/kn)``; arguments as in `cohesive_rebound`."""
    return _oscillator(kn, cohesion, beta, 1.0)[0] >= 1.0


def cohesive_rebound(*, kn: float, cohesion: float, beta: float, m_eff: float, speed: float) -> Rebound:
    """Impact with ``fn = (kn - c) delta + 2 beta sqrt(m_eff kn) delta'`` while bodies overlap, pulls included.

    With ``omega_c^2 = (kn - c)/m_eff`` and ``z = beta/sqrt(1 - c/kn)`` the overlap is ``v exp(-z omega_c t) sin(s omega_c t)/(s omega_c)``,
    ``s = sqrt(1 - z^2)``. It ends after ``pi/(s omega_c)`` at ``exp(-pi z/s)`` of the speed; from ``z = 1`` on it never ends.

    Parameters
    ----------
    kn : float
        Normal stiffness [N/m], > 0.
    cohesion : float
        Attraction by overlap c [N/m], in [0, kn).
    beta : float
        Contact damping ratio of kn [-], >= 0.
    m_eff : float
        ``m1 m2/(m1 + m2)`` [kg], > 0.
    speed : float
        Of approach [m/s], > 0.

    Raises
    ------
    ValueError
        If an argument is out of range, or the bodies never part: `is_captured`.

    Notes
    -----
    Source: damped linear oscillator, derived here. From c = kn on there is no force that parts the bodies.
    """
    z, omega = _oscillator(kn, cohesion, beta, m_eff)
    positive(speed=speed)
    if z >= 1.0:
        raise ValueError(
            f"beta = {beta!r} is not allowed: with cohesion = {cohesion!r} N/m bodies never part from {math.sqrt(1.0 - cohesion / kn):g} on"
        )
    s = math.sqrt((1.0 - z) * (1.0 + z))
    half = 2.0 * math.atan2(math.sqrt(1.0 - z), math.sqrt(1.0 + z)) / s  # arccos(z)/s, when the overlap is deepest
    return Rebound(math.exp(-math.pi * z / s), math.pi / (s * omega), speed / omega * math.exp(-z * half))


def cohesive_contact(t: ArrayLike, *, kn: float, cohesion: float, beta: float, m_eff: float, speed: float) -> Cohesive:
    """Overlap, rate and force of such an impact that touches at time 0; bodies that part do so uniformly.

    Parameters
    ----------
    t : array_like
        Times since touch [s], >= 0.
    kn, cohesion, beta, m_eff, speed : float
        As in `cohesive_rebound`.
    """
    z, omega = _oscillator(kn, cohesion, beta, m_eff)
    positive(speed=speed)
    times = times_of(t)
    overlap, rate = free_contact(times, omega, z)
    delta, velocity, touching = speed * overlap, speed * rate, np.ones_like(times, dtype=bool)
    if z < 1.0:
        found = cohesive_rebound(kn=kn, cohesion=cohesion, beta=beta, m_eff=m_eff, speed=speed)
        touching = times < found.duration
        leave = found.restitution * speed
        delta = np.where(touching, delta, -leave * (times - found.duration))
        velocity = np.where(touching, velocity, -leave)
    fn = np.where(touching, (kn - cohesion) * delta + 2.0 * beta * math.sqrt(m_eff * kn) * velocity, 0.0)
    return Cohesive(delta, velocity, fn)


def _oscillator(kn: float, cohesion: float, beta: float, m_eff: float) -> tuple[float, float]:
    """Damping ratio and frequency [rad/s] of the spring that cohesion leaves."""
    positive(kn=kn, m_eff=m_eff)
    not_negative(cohesion=cohesion, beta=beta)
    if not number(cohesion) < kn:
        raise ValueError(
            f"cohesion = {cohesion!r} N/m is not allowed: it must be below kn = {kn!r} N/m, beyond which bodies collapse into each other"
        )
    left = (kn - cohesion) / kn
    return beta / math.sqrt(left), math.sqrt(kn * left / m_eff)
