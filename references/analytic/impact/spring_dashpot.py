"""Linear spring and dashpot without tension: restitution, duration and history of one contact."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import not_negative, number, positive, times_of

FloatArray = NDArray[np.float64]


def restitution_of_beta(beta: float) -> float:
    """Restitution [-] of ``Fn = max(kn delta + c delta', 0)``, ``c = 2 beta sqrt(m_eff kn)``.

    The contact ends where the force, not the overlap, returns to zero. Solved for the velocity there::

        e = exp(-2 beta h(beta)),   h = arccos(beta)/sqrt(1 - beta^2) below 1,   h(1) = 1,
                                    h = arcosh(beta)/sqrt(beta^2 - 1) beyond 1

    which equals ``exp(-(beta/s)(pi - atan2(2 beta s, 1 - 2 beta^2)))``, ``exp(-2)`` and
    ``exp(-(beta/s) ln((beta + s)/(beta - s)))``. For a large beta e tends to ``1/(4 beta^2)``.

    Parameters
    ----------
    beta : float
        Contact damping ratio [-], >= 0.

    Notes
    -----
    Source: Schwager & Poeschel (2007), doi:10.1007/s10035-007-0065-z; rederived. The textbook ``exp(-pi beta/s)``
    lets the contact pull.
    """
    not_negative(beta=beta)
    return math.exp(-_log_loss(beta))


def beta_of_restitution(restitution: float) -> float:
    """Damping ratio [-] that gives a restitution; inverse of `restitution_of_beta`.

    Parameters
    ----------
    restitution : float
        Coefficient of restitution, in (0, 1].

    Raises
    ------
    ValueError
        If the restitution is outside (0, 1]. No finite dashpot gives 0.
    """
    if not 0.0 < number(restitution) <= 1.0:
        raise ValueError(
            f"restitution = {restitution!r} is not allowed for a spring and dashpot: it must lie in (0, 1], since "
            "e = 0 needs an infinite damping ratio; choose a small e such as 0.001 (beta = 15.7), or an engine with an "
            "impact law"
        )
    if restitution == 1.0:
        return 0.0
    from scipy.optimize import brentq  # slow to import, and most runs do not need it

    target = -math.log(restitution)
    # arcosh(beta) >= ln(beta) makes e(beta) <= 1/beta^2, so the root lies below 1/sqrt(e).
    return float(
        brentq(lambda beta: _log_loss(beta) - target, 0.0, 1.0 / math.sqrt(restitution), xtol=1e-300, rtol=1e-15)
    )


def contact_duration(*, kn: float, m_eff: float, beta: float) -> float:
    """Time from touch until the force returns to zero [s]: ``2 h(beta) sqrt(m_eff/kn)``, h as in `restitution_of_beta`.

    Parameters
    ----------
    kn : float
        Stiffness [N/m], > 0.
    m_eff : float
        ``m1 m2/(m1 + m2)`` of two bodies, the mass of the one against a wall [kg], > 0.
    beta : float
        Contact damping ratio [-], >= 0.
    """
    positive(kn=kn, m_eff=m_eff)
    return 2.0 * _half_angle_over_sine(beta) * math.sqrt(m_eff / kn)


def contact_history(
    t: ArrayLike, *, kn: float, m_eff: float, beta: float, speed: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Overlap, its rate and the force of an impact that touches at time 0.

    ``delta = v exp(-beta omega t) S(t)`` with ``S = sin(s omega t)/(s omega)`` (hyperbolic beyond beta = 1) while the
    force acts. From `contact_duration` on the bodies part uniformly at ``e v``; they still overlap for a while if
    beta > 0.

    Parameters
    ----------
    t : array_like
        Times since touch [s], >= 0.
    kn : float
        Stiffness [N/m], > 0.
    m_eff : float
        Effective mass [kg], > 0.
    beta : float
        Contact damping ratio [-], >= 0.
    speed : float
        Approach velocity [m/s], > 0.

    Returns
    -------
    delta, rate, fn : ndarray
        Overlap [m] (negative once open), its time derivative [m/s] and normal force [N], of the shape of ``t``.
    """
    positive(speed=speed)
    end = contact_duration(kn=kn, m_eff=m_eff, beta=beta)
    times = times_of(t)
    omega = math.sqrt(kn / m_eff)
    overlap, rate = free_contact(np.minimum(times, end), omega, beta)
    leave = restitution_of_beta(beta)
    touching = times < end
    delta = speed * np.where(touching, overlap, overlap - leave * (times - end))
    velocity = speed * np.where(touching, rate, -leave)
    fn = np.where(touching, kn * delta + 2.0 * beta * math.sqrt(m_eff * kn) * velocity, 0.0)
    return delta, velocity, fn


def free_contact(t: FloatArray, omega: float, beta: float) -> tuple[FloatArray, FloatArray]:
    """Overlap [s] and rate [-] at times ``t`` [s] for unit approach velocity while the force acts; omega [rad/s], beta >= 0."""
    positive(omega=omega)
    not_negative(beta=beta)
    t = times_of(t)
    square = (1.0 - beta) * (1.0 + beta)
    if square > 0.0:
        wd = omega * math.sqrt(square)
        cosine, sine = np.exp(-beta * omega * t) * np.cos(wd * t), np.exp(-beta * omega * t) * np.sin(wd * t) / wd
    elif square < 0.0:
        kappa = math.sqrt(-square)
        slow, fast = np.exp(-omega / (beta + kappa) * t), np.exp(-omega * (beta + kappa) * t)
        cosine, sine = (slow + fast) / 2.0, (slow - fast) / (2.0 * kappa * omega)
    else:
        cosine, sine = np.exp(-omega * t), np.exp(-omega * t) * t
    return np.asarray(sine), np.asarray(cosine - beta * omega * sine)


def _half_angle_over_sine(beta: float) -> float:
    """``h(beta)``: ``alpha/sin(alpha)`` with ``cos(alpha) = beta``, continued beyond 1.

    ``1 - beta`` is exact near 1, so the quotient keeps full precision there; only beta = 1 itself is a limit.
    """
    not_negative(beta=beta)
    if beta < 1.0:
        return 2.0 * math.atan2(math.sqrt(1.0 - beta), math.sqrt(1.0 + beta)) / math.sqrt((1.0 - beta) * (1.0 + beta))
    if beta > 1.0:
        return math.acosh(beta) / (math.sqrt(beta - 1.0) * math.sqrt(beta + 1.0))
    return 1.0


def _log_loss(beta: float) -> float:
    return 2.0 * beta * _half_angle_over_sine(beta)
