"""A round body that rolls off a larger held one, or off two that touch: how fast it falls, where it slips, where it leaves."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, finite, positive, times_of

FloatArray = NDArray[np.float64]


class Saddle(NamedTuple):
    """A sphere in the groove of two held spheres.

    Attributes
    ----------
    arm : float
        Distance p of its centre from the line of the held centres [m].
    inertia : float
        J, inertia about that line over the mass, with the spin of rolling [m^2].
    """

    arm: float
    inertia: float


def saddle(*, radius: float, held_radius: float) -> Saddle:
    """Arm and inertia of a uniform sphere that rolls over two equal held spheres which touch each other.

    The centre moves on a circle about the line of the held centres, of radius ``p = sqrt((R + r)^2 - R^2)``. The contacts are
    ``p r/(R + r)`` below it; without slip the spin about that line is ``(R + r)/r`` of the centre's angular speed. With the
    moment ``(2/5) m r^2`` the energy ``m J theta'^2/2 + m g p cos(theta)`` is kept,
    ``J = p^2 + (2/5)(R + r)^2``: ``theta'' = g p sin(theta)/J``.

    Parameters
    ----------
    radius, held_radius : float
        r of the sphere, R of the two held ones [m], > 0.

    Notes
    -----
    Source: derived above. Growth rates: Vyas et al., Comput. Phys. Commun. 310 (2025) 109524, as LAMMPS' scene has them.
    """
    positive(radius=radius, held_radius=held_radius)
    reach = radius + held_radius
    return Saddle(
        math.sqrt(radius * (2.0 * held_radius + radius)), radius * (2.0 * held_radius + radius) + 0.4 * reach**2
    )


def fall_time(*, reached: ArrayLike, start: float) -> FloatArray:
    """Time, times the growth rate L, in which ``theta'' = L^2 sin(theta)`` takes a body at rest from one angle to others.

    With ``k = cos(start/2)`` it is ``K(k) - F(arcsin(cos(theta/2)/k), k)``, elliptic integrals: a pendulum seen from its top.

    Parameters
    ----------
    reached : array_like
        Angles from the top [rad], a number or shape (s,); one below ``start`` takes no time.
    start : float
        [rad], in [1e-12, pi).

    Returns
    -------
    ndarray
        As ``reached`` [-].
    """
    from scipy.special import ellipkinc, ellipkm1  # slow to import, and most runs do not need it

    _angle(start)
    angle = np.clip(array("reached", reached, dimensions=(0, 1)), start, math.pi)
    k = math.cos(0.5 * start)
    share = np.clip(np.cos(0.5 * angle) / k, 0.0, 1.0)
    return np.asarray(np.maximum(ellipkm1(math.sin(0.5 * start) ** 2) - ellipkinc(np.arcsin(share), k**2), 0.0))


def falling(*, t: ArrayLike, rate: float, start: float) -> FloatArray:
    """Angle from the top [rad] of a body that ``theta'' = rate^2 sin(theta)`` takes from rest, at times.

    ``cos(theta/2) = k cn(L t)/dn(L t)``, the inverse of `fall_time`.

    Parameters
    ----------
    t : array_like, shape (s,)
        [s], below the time at which it is at the bottom.
    rate : float
        Growth rate L [1/s], > 0.
    start : float
        [rad], in [1e-12, pi).
    """
    from scipy.special import ellipj  # slow to import, and most runs do not need it

    positive(rate=rate)
    _angle(start)
    k = math.cos(0.5 * start)
    _, cn, dn, _ = ellipj(rate * times_of(t), k**2)
    return np.asarray(2.0 * np.arccos(np.clip(k * cn / dn, -1.0, 1.0)))


class Departure(NamedTuple):
    """Where a body that rolls off a round one slips and leaves.

    Attributes
    ----------
    slips, leaves : float
        Angles from the top at which sliding begins and at which the normal force ends [rad].
    rate : float
        Angular speed of the centre about the axis when it leaves [rad/s].
    turned : float
        Spin of the body then, over that of rolling at the same speed [-].
    lasts : float
        Time from the slip to the end of the contact [s].
    """

    slips: float
    leaves: float
    rate: float
    turned: float
    lasts: float


def rolled_off(*, mu: float, inertia_ratio: float, arm: float, g: float, start: float = 0.0) -> Departure:
    """A body that rolls from rest over a round one slides where friction no longer suffices, and leaves.

    The centre moves on a circle of radius p. Let k be the inertia ratio ``I/(m r^2)``, r the arm of friction, and theta_0 the start. While
    it rolls, ``theta'^2 = 2 g (cos(theta_0) - cos(theta))/((1 + k) p)``, the force towards the centre is ``m g cos(theta) - m p theta'^2``
    and friction ``m g k sin(theta)/(1 + k)``. It slips where ``k sin(theta) = mu ((3 + k) cos(theta) - 2 cos(theta_0))``. From there on
    ``w = theta'^2`` obeys ``w' = 2 mu w + 2 (g/p)(sin(theta) - mu cos(theta))``, solved by
    ``C exp(2 mu theta) - (2 g/p)((1 - 2 mu^2) cos(theta) + 3 mu sin(theta))/(1 + 4 mu^2)``. It leaves where ``p w = g cos(theta)``;
    friction adds ``mu (g cos(theta) - p w)/k`` to the rate of the spin's speed. For mu without bound and from the top it leaves at
    ``cos(theta) = 2/(3 + k)``: 4/7 of a disk, 10/17 of a sphere.

    Parameters
    ----------
    mu : float
        Friction coefficient, in (0, 100]: more is no other motion, and its exponential is beyond numbers.
    inertia_ratio : float
        k, > 0.
    arm : float
        p: radius of the circle [m], > 0.
    g : float
        [m/s^2], > 0.
    start : float
        Angle theta_0 of rest [rad], in [0, pi/2), where it rolls and does not slip at once.

    Notes
    -----
    Source: derived above.
    """
    positive(mu=mu, inertia_ratio=inertia_ratio, arm=arm, g=g)
    _angle(start, least=0.0, most=0.5 * math.pi)
    if mu > 100.0:
        raise ValueError(
            f"mu = {mu!r} is not allowed: it must be at most 100, where the body no longer slides before it leaves"
        )
    from scipy.optimize import brentq  # slow to import, and most runs do not need it

    k, top = inertia_ratio, math.cos(start)
    slips = math.acos(2.0 * mu * top / math.hypot(k, mu * (3.0 + k))) - math.atan2(k, mu * (3.0 + k))
    if slips <= start:
        raise ValueError(
            f"mu = {mu!r} is not allowed at start = {start!r} rad: the body slips at once; it must roll at first"
        )

    def added(angle: float) -> float:
        """Particular solution of w, over g/p."""
        return -2.0 * ((1.0 - 2.0 * mu**2) * math.cos(angle) + 3.0 * mu * math.sin(angle)) / (1.0 + 4.0 * mu**2)

    kept = 2.0 * (top - math.cos(slips)) / (1.0 + k) - added(slips)

    def squared(angle: float) -> float:
        """theta'^2 over g/p."""
        return kept * math.exp(2.0 * mu * (angle - slips)) + added(angle)

    leaves = float(brentq(lambda angle: math.cos(angle) - squared(angle), slips, 0.5 * math.pi, xtol=1e-15))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    half = 0.5 * (leaves - slips)
    angles = slips + half * (1.0 + nodes)
    speeds = np.array([squared(float(angle)) for angle in angles])
    gained = mu / k * half * float(weights @ ((np.cos(angles) - speeds) / np.sqrt(speeds)))
    root, rolling, end = math.sqrt(g / arm), math.sqrt(squared(slips)), math.sqrt(squared(leaves))
    return Departure(
        slips, leaves, root * end, (rolling + gained) / end, half * float(weights @ (1.0 / np.sqrt(speeds))) / root
    )


def _angle(start: float, least: float = 1e-12, most: float = math.pi) -> None:
    finite(start=start)
    if not least <= start < most:
        raise ValueError(
            f"start = {start!r} rad is not allowed: it must lie in [{least:g}, {most:.4g}); degrees must be converted"
        )
