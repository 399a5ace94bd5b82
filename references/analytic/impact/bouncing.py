"""Disk dropped on a horizontal plane: bounces by a coefficient of restitution, or by a spring and dashpot under the disk's weight."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, count, fraction, not_negative, positive
from ninedisk.references.analytic.impact.spring_dashpot import free_contact

FloatArray = NDArray[np.float64]

GRID = 64
"""Points per 1/omega, or per e-fold of time from beta = 1 on, on which the end of a contact is bracketed."""
MOST_SPRINGS = 10_000
"""Flights between contacts of springs: the end of each contact is found by a root."""
SETTLED = 40.0
"""Decay times after which a contact that still pushes is at rest: exp(-40) is below round-off."""


class Bounces(NamedTuple):
    """Flights between contacts, n of them after the fall; all of shape (n + 1,), entry 0 is the fall.

    ``leave`` is when a flight begins [s] (0 for the fall), ``gap`` the gap there [m], ``speed`` the velocity up [m/s], ``land`` when
    it ends, with the gap 0 again. ``contact`` [s] is how long the contact before the flight lasted.
    """

    leave: FloatArray
    gap: FloatArray
    speed: FloatArray
    land: FloatArray
    contact: FloatArray

    def apex(self, g: float) -> tuple[FloatArray, FloatArray]:
        """Heights [m] and times [s] of the highest points of the flights."""
        positive(g=g)
        return self.gap + self.speed**2 / (2.0 * g), self.leave + self.speed / g

    def motion(self, t: ArrayLike, g: float) -> tuple[FloatArray, FloatArray]:
        """Gap [m] and velocity [m/s] during the flights; NaN in contacts and after the last flight."""
        positive(g=g)
        times = array("t", t)
        height, velocity = np.full(times.shape, np.nan), np.full(times.shape, np.nan)
        for leave, gap, speed, land in zip(self.leave, self.gap, self.speed, self.land, strict=True):
            inside = (times >= leave) & (times <= land)
            since = times[inside] - leave
            height[inside] = gap + speed * since - 0.5 * g * since**2
            velocity[inside] = speed - g * since
        return height, velocity


def landing_speed(*, height: float, g: float) -> float:
    """Speed after a fall from rest [m/s]: ``sqrt(2 g h)``; height [m] and g [m/s^2] > 0."""
    positive(height=height, g=g)
    return math.sqrt(2.0 * g * height)


def zeno_time(*, height: float, g: float, restitution: float) -> float:
    """Time at which a rigid disk has made all its bounces [s]: ``sqrt(2 h/g) (1 + e)/(1 - e)``.

    Flight k lasts ``2 e^k sqrt(2 h/g)``: a geometric series.

    Parameters
    ----------
    height : float
        Gap from which it is dropped [m], > 0.
    g : float
        Gravity [m/s^2], > 0.
    restitution : float
        Coefficient of restitution, in [0, 1).
    """
    positive(height=height, g=g)
    fraction(restitution=restitution)
    if restitution == 1.0:
        raise ValueError(
            f"restitution = {restitution!r} is not allowed: it must lie in [0, 1), or the bounces never end"
        )
    return math.sqrt(2.0 * height / g) * (1.0 + restitution) / (1.0 - restitution)


def rigid_bounces(*, height: float, g: float, restitution: float, bounces: int) -> Bounces:
    """Fall and first flights with Newton's law: flight k begins with ``e^k sqrt(2 g h)`` and reaches ``e^(2k) h``.

    Parameters
    ----------
    height : float
        Gap from which the disk is dropped [m], > 0.
    g : float
        Gravity [m/s^2], > 0.
    restitution : float
        Coefficient of restitution e, in [0, 1].
    bounces : int
        Number of flights after the fall.
    """
    positive(height=height, g=g)
    count(bounces=bounces)
    fraction(restitution=restitution)
    speed = landing_speed(height=height, g=g) * restitution ** np.arange(1, bounces + 1, dtype=np.float64)
    land = math.sqrt(2.0 * height / g) + np.concatenate(([0.0], np.cumsum(2.0 * speed / g)))
    return Bounces(
        leave=np.concatenate(([0.0], land[:-1])),
        gap=np.concatenate(([height], np.zeros(bounces))),
        speed=np.concatenate(([0.0], speed)),
        land=land,
        contact=np.zeros(bounces + 1),
    )


class LoadedContact(NamedTuple):
    """End of a contact: how long it lasted [s], velocity up [m/s] and overlap [m] as the force vanishes."""

    duration: float
    speed: float
    overlap: float


def loaded_contact(*, kn: float, mass: float, beta: float, speed: float, g: float) -> LoadedContact | None:
    """One contact of spring and dashpot without tension under the weight, from touch to the end of its force.

    With ``omega^2 = kn/m``: ``delta'' + 2 beta omega delta' + omega^2 delta = g``. In terms of S, the free motion that begins
    with velocity 1, and ``C = S' + 2 beta omega S``, the one that begins with displacement 1,
    ``delta = g/omega^2 (1 - C) + v S``. The contact ends at the first zero of ``omega^2 delta + 2 beta omega delta'``.

    Parameters
    ----------
    kn : float
        Stiffness [N/m], > 0.
    mass : float
        Mass [kg], > 0.
    beta : float
        Contact damping ratio [-], >= 0.
    speed : float
        Velocity at touch [m/s], > 0.
    g : float
        Gravity [m/s^2], >= 0.

    Returns
    -------
    LoadedContact or None
        None where the force never vanishes: the disk stays and comes to rest.

    Notes
    -----
    Source: equation of motion above, solved here; with g = 0 it is `ninedisk.references.analytic.impact.spring_dashpot`.
    """
    positive(kn=kn, mass=mass, speed=speed)
    not_negative(beta=beta, g=g)
    from scipy.optimize import brentq  # slow to import, and most runs do not need it

    omega = math.sqrt(kn / mass)

    def state(t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        sine, rate = free_contact(np.asarray(t, dtype=np.float64), omega, beta)
        overlap = g / omega**2 * (1.0 - rate - 2.0 * beta * omega * sine) + speed * sine
        return overlap, g * sine + speed * rate

    def push(t: ArrayLike) -> FloatArray:
        overlap, rate = state(t)
        return np.asarray(omega * overlap + 2.0 * beta * rate)

    grid = np.concatenate(([0.0], _candidates(beta))) / omega
    pulls = np.flatnonzero(push(grid[1:]) < 0.0)
    if not len(pulls):
        return None
    first = int(pulls[0]) + 1
    low = grid[max(first - 1, 1)] if first > 1 else grid[1] * 1e-9
    end = float(brentq(lambda t: float(push(t)), low, grid[first], xtol=1e-300, rtol=1e-15))
    overlap, rate = state(end)
    return LoadedContact(duration=end, speed=-float(rate), overlap=float(overlap))


def _candidates(beta: float) -> FloatArray:
    """Times, in units of 1/omega, between which the end of a contact is bracketed; some thousands, whatever the damping.

    The force is ``g - delta''``. Below beta = 1 its swing decays, so that its first minimum is the lowest: what has not ended after one
    period, or after `SETTLED` decay times, never does. From 1 on two exponentials decay at very different rates: the times are spread
    over both, `GRID` of them for each e-fold.
    """
    if beta < 1.0:
        period = 2.0 * math.pi / math.sqrt((1.0 - beta) * (1.0 + beta))
        longest = period if beta == 0.0 else min(period, SETTLED / beta)
        return np.linspace(0.0, longest, math.ceil(longest * GRID * max(1.0, 2.0 * beta)) + 1)[1:]
    first, longest = 1.0 / (GRID * 2.0 * beta), SETTLED * (beta + math.sqrt(beta**2 - 1.0))
    return np.geomspace(first, longest, math.ceil(GRID * math.log(longest / first)))


def spring_bounces(*, height: float, g: float, kn: float, mass: float, beta: float, bounces: int) -> Bounces:
    """Fall and first flights of a disk whose contacts are springs and dashpots; fewer where it comes to rest before.

    Parameters are those of `loaded_contact`, and

    height : float
        Gap from which the disk is dropped [m], > 0.
    bounces : int
        Number of flights after the fall, at most.

    Notes
    -----
    A flight begins with the overlap that a dashpot without tension leaves, and ends with the gap 0. One that never frees itself
    from that overlap is no flight: the disk rests.
    """
    count(bounces=bounces, most=MOST_SPRINGS)
    velocity = landing_speed(height=height, g=g)
    rows = [(0.0, height, 0.0, velocity / g, 0.0)]
    for _ in range(bounces):
        end = loaded_contact(kn=kn, mass=mass, beta=beta, speed=velocity, g=g)
        if end is None or end.speed**2 <= 2.0 * g * end.overlap:
            break
        leave = rows[-1][3] + end.duration
        velocity = math.sqrt(end.speed**2 - 2.0 * g * end.overlap)
        rows.append((leave, -end.overlap, end.speed, leave + (end.speed + velocity) / g, end.duration))
    return Bounces(*(np.array(column) for column in zip(*rows, strict=True)))
