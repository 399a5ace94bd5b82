"""Disk that rolls on a plane against rolling resistance: a constant torque, a viscous one, a spring and dashpot that yields."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import not_negative, positive, slope, times_of
from ninedisk.references.analytic.impact.spring_dashpot import free_contact
from ninedisk.references.analytic.on_plane.slip_to_roll import UNIFORM_DISK

FloatArray = NDArray[np.float64]


class Rolled(NamedTuple):
    """Way ``x`` [m] and velocity ``vx`` [m/s] down the plane, acceleration ``ax`` [m/s^2], at the times asked for."""

    x: FloatArray
    vx: FloatArray
    ax: FloatArray


class Stopped(NamedTuple):
    """``time`` [s] after which a disk stands, and its ``path`` [m] until then."""

    time: float
    path: float


class Oscillation(NamedTuple):
    """Undamped angular frequency ``omega`` [rad/s], rotation at rest ``rest`` and at which the spring yields, ``limit`` [rad]."""

    omega: float
    rest: float
    limit: float


class EquivalentDisk(NamedTuple):
    """``mass`` [kg], ``radius`` [m], ``inertia_ratio`` [-], gravity ``g`` [m/s^2] and the factor ``damping`` of the damping ratio [-]."""

    mass: float
    radius: float
    inertia_ratio: float
    g: float
    damping: float


def equivalent_disk(
    *, radius_1: float, radius_2: float, mass_1: float, mass_2: float, inertia_1: float, inertia_2: float, force: float
) -> EquivalentDisk:
    """The disk rolling on a level plane whose spin is the difference of those of two smooth disks pressed against each other.

    With the torque M between them the difference obeys ``I u' = -M``, ``1/I = 1/I_1 + 1/I_2``; M is made of the reduced radius R and the
    force. A rolling disk has ``(1 + k) m R^2 spin' = -M`` and the weight m g: with k = 1 it is the pair for ``m = I/(2 R^2)`` and
    ``m g = force``. The dashpot of an elastic-plastic contact is made of the moments about the contact, ``1/J = sum 1/(I_i + m_i R_i^2)``,
    so that its damping ratio of the pair's swing is ``sqrt(J/I)`` times beta.

    Parameters
    ----------
    radius_1, radius_2, mass_1, mass_2, inertia_1, inertia_2 : float
        [m], [kg], [kg m^2], > 0.
    force : float
        [N], > 0.
    """
    positive(
        radius_1=radius_1,
        radius_2=radius_2,
        mass_1=mass_1,
        mass_2=mass_2,
        inertia_1=inertia_1,
        inertia_2=inertia_2,
        force=force,
    )
    radius = 1.0 / (1.0 / radius_1 + 1.0 / radius_2)
    inertia = 1.0 / (1.0 / inertia_1 + 1.0 / inertia_2)
    about = 1.0 / (1.0 / (inertia_1 + mass_1 * radius_1**2) + 1.0 / (inertia_2 + mass_2 * radius_2**2))
    mass = inertia / radius**2 / 2.0
    return EquivalentDisk(mass, radius, 1.0, force / mass, math.sqrt(about / inertia))


def acceleration(*, mu_r: float, angle: float, g: float, inertia_ratio: float = UNIFORM_DISK) -> float:
    """Acceleration down the plane [m/s^2] of a disk that rolls down against a constant torque: ``g (sin - mu_r cos)/(1 + k)``.

    It is < 0 where the torque outweighs gravity: then a disk that rolls down slows down, and one at rest stays.
    """
    not_negative(mu_r=mu_r)
    slope(angle)
    positive(g=g, inertia_ratio=inertia_ratio)
    # Near the threshold tan(angle) = mu_r the difference cancels; sin(angle - atan mu_r)/cos(atan mu_r) does not.
    return g * math.sin(angle - math.atan(mu_r)) * math.hypot(1.0, mu_r) / (1.0 + inertia_ratio)


def stop(*, mu_r: float, angle: float, g: float, speed: float, inertia_ratio: float = UNIFORM_DISK) -> Stopped:
    """Time and way until a constant torque has stopped a disk that rolls down at ``speed`` >= 0 [m/s].

    On a level plane ``(1 + k) v/(mu_r g)`` and ``(1 + k) v^2/(2 mu_r g)``: 3/2 and 3/4 for a disk.

    Raises
    ------
    ValueError
        If an argument is out of range, or the incline is too steep for the disk to stop.
    """
    a = acceleration(mu_r=mu_r, angle=angle, g=g, inertia_ratio=inertia_ratio)
    not_negative(speed=speed)
    if speed == 0.0 and a <= 0.0:
        return Stopped(0.0, 0.0)
    if a >= 0.0:
        raise ValueError(
            f"angle = {angle!r} rad is not allowed: with mu_r = {mu_r!r} the disk never stops; tan(angle) must be below mu_r"
        )
    return Stopped(-speed / a, -(speed**2) / (2.0 * a))


def against_constant_torque(
    t: ArrayLike, *, mu_r: float, angle: float, g: float, speed: float, inertia_ratio: float = UNIFORM_DISK
) -> Rolled:
    """Rolling without slip against the torque ``mu_r R fn`` (model A), and standing once it has stopped.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu_r : float
        Coefficient of rolling friction, >= 0.
    angle : float
        Slope [rad], in [0, pi/2).
    g : float
        Gravity [m/s^2], > 0.
    speed : float
        Velocity down the plane at time 0 [m/s], >= 0.
    inertia_ratio : float
        ``k = I/(m R^2)``, > 0.

    Notes
    -----
    Source: rigid-body mechanics with the rolling resistance of Ai, Chen, Rotter & Ooi, Powder Technology 206 (2011) 269-282, model A.
    """
    times = times_of(t)
    a = acceleration(mu_r=mu_r, angle=angle, g=g, inertia_ratio=inertia_ratio)
    not_negative(speed=speed)
    end = _end(mu_r=mu_r, angle=angle, g=g, speed=speed, inertia_ratio=inertia_ratio)
    rolling = np.minimum(times, end)
    return Rolled(
        x=speed * rolling + 0.5 * a * rolling**2,
        vx=np.where(times < end, speed + a * rolling, 0.0),
        ax=np.where(times < end, a, 0.0),
    )


def against_viscous_torque(
    t: ArrayLike, *, mu_r: float, angle: float, g: float, speed: float, inertia_ratio: float = UNIFORM_DISK
) -> Rolled:
    """Rolling without slip against the torque ``mu_r R fn v/(1 m/s)`` (model B): ``v' = (g sin - mu_r g cos v/(1 m/s))/(1 + k)``.

    With the rate ``r = mu_r g cos/(1 + k)`` per m/s the velocity tends to ``tan(angle)/mu_r`` m/s as ``exp(-r t)``; a disk neither stops
    on a level plane nor holds on an incline.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu_r, angle, g, speed, inertia_ratio : float
        As in `against_constant_torque`.

    Notes
    -----
    Source: as `against_constant_torque`, model B.
    """
    times = times_of(t)
    not_negative(mu_r=mu_r, speed=speed)
    slope(angle)
    positive(g=g, inertia_ratio=inertia_ratio)
    rate = mu_r * g * math.cos(angle) / (1.0 + inertia_ratio)
    pull = g * math.sin(angle) / (1.0 + inertia_ratio)
    # (1 - exp(-rate t))/rate and its integral, without their quotients where rate t is small.
    z = rate * times
    small = z < 1e-4
    safe = np.where(small, 1.0, z)
    first = np.where(small, 1.0 - z / 2.0 + z**2 / 6.0, -np.expm1(-safe) / safe)
    second = np.where(small, 0.5 - z / 6.0 + z**2 / 24.0, (safe + np.expm1(-safe)) / safe**2)
    vx = speed * np.exp(-z) + pull * times * first
    return Rolled(x=speed * times * first + pull * times**2 * second, vx=vx, ax=pull - rate * vx)


def oscillation(
    *, mu_r: float, kr: float, angle: float, g: float, mass: float, radius: float, inertia_ratio: float = UNIFORM_DISK
) -> Oscillation:
    """Swing of a disk that a rolling spring holds on a plane without slip: ``omega^2 = kr/((1 + k) m R^2)``, ``2 kr/(3 m R^2)`` for a disk.

    It rests turned by ``m g R sin/kr``, and the spring yields at ``mu_r R m g cos/kr``: a disk holds iff ``tan(angle) <= mu_r``.

    Parameters
    ----------
    kr : float
        Rolling stiffness [N m/rad], > 0.
    mass, radius : float
        [kg], [m], > 0.
    mu_r, angle, g, inertia_ratio : float
        As in `against_constant_torque`.
    """
    not_negative(mu_r=mu_r)
    slope(angle)
    positive(kr=kr, g=g, mass=mass, radius=radius, inertia_ratio=inertia_ratio)
    weight = mass * g * radius / kr
    return Oscillation(
        omega=math.sqrt(kr / mass / (1.0 + inertia_ratio)) / radius,
        rest=weight * math.sin(angle),
        limit=weight * mu_r * math.cos(angle),
    )


def against_spring(
    t: ArrayLike,
    *,
    mu_r: float,
    kr: float,
    beta: float,
    angle: float,
    g: float,
    mass: float,
    radius: float,
    speed: float,
    inertia_ratio: float = UNIFORM_DISK,
) -> Rolled:
    """Rolling without slip against an elastic-plastic spring and dashpot (model C), the spring without torque at time 0.

    The dashpot ``2 beta sqrt(I kr)`` with ``I = (1 + k) m R^2`` makes the rotation q of the spring a linear oscillator of damping ratio
    beta, ``q'' + 2 beta omega q' + omega^2 (q - rest) = 0`` (`oscillation`). Where q reaches its limit the spring yields, the dashpot is
    gone and the torque is that of `against_constant_torque`, until the disk stands; then the spring unloads from its limit. As
    ``rest >= 0`` it cannot yield backwards: the swing back ends at ``2 rest - limit >= -limit``.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    kr : float
        Rolling stiffness [N m/rad], > 0.
    beta : float
        Damping ratio, in [0, 1).
    mass, radius : float
        [kg], [m], > 0.
    mu_r, angle, g, speed, inertia_ratio : float
        As in `against_constant_torque`.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: as `against_constant_torque`, model C; derived here.
    """
    times = times_of(t)
    swing = oscillation(mu_r=mu_r, kr=kr, angle=angle, g=g, mass=mass, radius=radius, inertia_ratio=inertia_ratio)
    not_negative(beta=beta, speed=speed)
    if beta >= 1.0:
        raise ValueError(f"beta = {beta!r} is not allowed: this closed form is that of beta < 1")
    x, vx, ax = (np.empty_like(times) for _ in range(3))

    def fill(begin: float, end: float, path: float, held: Rolled) -> None:
        now = (times >= begin) & (times < end)
        for column, values, offset in zip((x, vx, ax), held, (path, 0.0, 0.0), strict=True):
            column[now] = (offset + values)[now]

    def elastic(since: FloatArray, turned: float, spin: float) -> Rolled:
        """Way, velocity and acceleration from a spring turned by ``turned`` [rad] and a disk that spins at ``spin`` [rad/s]."""
        s, rate = free_contact(np.maximum(since, 0.0), swing.omega, beta)
        off = turned - swing.rest
        back = off * (rate + 2.0 * beta * swing.omega * s)
        q, dq = back + spin * s, spin * rate - off * swing.omega**2 * s
        return Rolled(radius * (q - off), radius * dq, -radius * swing.omega * (2.0 * beta * dq + swing.omega * q))

    yields = _yield_time(swing, beta, speed / radius)
    fill(0.0, yields, 0.0, elastic(times, 0.0, speed / radius))
    if math.isinf(yields):
        return Rolled(x, vx, ax)
    at = np.array(yields)
    path, fast, _ = (float(value) for value in elastic(at, 0.0, speed / radius))
    plastic: dict[str, float] = {
        "mu_r": mu_r,
        "angle": angle,
        "g": g,
        "speed": max(fast, 0.0),
        "inertia_ratio": inertia_ratio,
    }
    stands = yields + _end(**plastic)
    rolled = against_constant_torque(np.maximum(times - yields, 0.0), **plastic)
    fill(yields, stands, path, rolled)
    if not math.isinf(stands):
        fill(stands, math.inf, path + stop(**plastic).path, elastic(times - stands, swing.limit, 0.0))
    return Rolled(x, vx, ax)


def _end(*, mu_r: float, angle: float, g: float, speed: float, inertia_ratio: float) -> float:
    """Time [s] of `stop`, inf where the disk never stops."""
    try:
        return stop(mu_r=mu_r, angle=angle, g=g, speed=speed, inertia_ratio=inertia_ratio).time
    except ValueError:
        return math.inf


def _yield_time(swing: Oscillation, beta: float, spin: float) -> float:
    """Time [s] at which a spring without torque at time 0 first yields; inf: never. It is farthest at its first rest, and least there."""
    if spin == swing.rest == 0.0:
        return math.inf
    if swing.limit == 0.0:
        return 0.0
    damped = swing.omega * math.sqrt((1.0 - beta) * (1.0 + beta))
    # q' = 0: tan(damped t) = spin damped/(spin beta omega - rest omega^2).
    farthest = math.atan2(spin * damped, spin * beta * swing.omega - swing.rest * swing.omega**2) / damped

    def beyond(time: float) -> float:
        s, rate = (float(value) for value in free_contact(np.array(time), swing.omega, beta))
        return swing.rest * (1.0 - rate - 2.0 * beta * swing.omega * s) + spin * s - swing.limit

    if not beyond(farthest) > 0.0:
        return math.inf
    from scipy.optimize import brentq  # slow to import, and most runs do not need it

    return float(brentq(beyond, 0.0, farthest, xtol=1e-300, rtol=1e-15))
