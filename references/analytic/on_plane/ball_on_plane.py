"""Sphere on a horizontal plane in space: it slides, then rolls; it spins against resistance to twisting."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import finite, not_negative, pair_of, positive, times_of
from ninedisk.references.analytic.on_plane.turntable import UNIFORM_SPHERE

FloatArray = NDArray[np.float64]


class BallHistory(NamedTuple):
    """Place ``x`` [m] and velocity ``v`` [m/s] along the plane, velocity ``slip`` [m/s] of the touching point, all (s, 2), and ``spin``
    [rad/s], (s, 3), at the times asked for; z is the plane's normal."""

    x: FloatArray
    v: FloatArray
    slip: FloatArray
    spin: FloatArray


def slip_of(velocity: ArrayLike, spin: ArrayLike, radius: float) -> FloatArray:
    """Velocity of the sphere's lowest point along the plane [m/s], ``v - R spin x z``, shape (2,), of v (2,) and spin (3,)."""
    v, w = pair_of("velocity", velocity), pair_of("spin", spin, 3)
    positive(radius=radius)
    return np.array([v[0] - radius * w[1], v[1] + radius * w[0]])


def slide_and_roll(
    t: ArrayLike,
    *,
    mu: float,
    g: float,
    radius: float,
    velocity: tuple[float, float],
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    inertia_ratio: float = UNIFORM_SPHERE,
) -> BallHistory:
    """A ball with any velocity and spin on a rough plane.

    Friction ``-mu m g u/|u|`` changes the velocity at ``-mu g u/|u|``, the spin by its moment, and the slip u at ``-(1 + 1/k) mu g u/|u|``:
    u keeps its direction, friction is one constant vector, and the centre runs along a parabola until ``|u0| k/((1 + k) mu g)``, that is
    ``2 |u0|/(7 mu g)`` for a sphere, and straight on from there. The spin about z has no part in it. A ball thrown without spin keeps
    ``1/(1 + k)`` of its speed, 5/7.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    mu, g, radius : float
        Friction coefficient [-], gravity [m/s^2], radius [m], > 0.
    velocity, spin : (float, float), (float, float, float)
        At time 0 [m/s], [rad/s].
    inertia_ratio : float
        ``k = I/(m R^2)``, > 0.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: Euler (J. A.), 1758; Coriolis, Theorie mathematique des effets du jeu de billard (1835).
    """
    positive(mu=mu, g=g, radius=radius, inertia_ratio=inertia_ratio)
    times = times_of(t)[..., None]
    v0, w0 = pair_of("velocity", velocity), pair_of("spin", spin, 3)
    u0 = slip_of(v0, w0, radius)
    size = float(np.hypot(*u0))
    along = u0 / size if size > 0.0 else u0
    slides = np.minimum(times, slide_time(slip=size, mu=mu, g=g, inertia_ratio=inertia_ratio))
    push = -mu * g * along
    v = v0 + push * slides
    # The force F at -R z has the moment -R z x F = R (Fy, -Fx, 0).
    turn = np.array([push[1], -push[0], 0.0]) / (inertia_ratio * radius)
    slip = u0 + (1.0 + 1.0 / inertia_ratio) * push * slides
    return BallHistory(
        x=v0 * slides + 0.5 * push * slides**2 + v * (times - slides),
        v=v,
        slip=np.where(slides < times, 0.0, slip),
        spin=w0 + turn * slides,
    )


def slide_time(*, slip: float, mu: float, g: float, inertia_ratio: float = UNIFORM_SPHERE) -> float:
    """Time until a ball rolls [s], ``k |u0|/((1 + k) mu g)``; slip [m/s] >= 0, the others > 0."""
    positive(mu=mu, g=g, inertia_ratio=inertia_ratio)
    not_negative(slip=slip)
    return slip * inertia_ratio / ((1.0 + inertia_ratio) * mu * g)


def twist_time(*, mu_t: float, spin: float, g: float, radius: float, inertia_ratio: float = UNIFORM_SPHERE) -> float:
    """Time [s] after which the torque ``mu_t R m g`` has stopped a spin about the vertical: ``I |spin|/(mu_t R m g)``.

    Parameters
    ----------
    mu_t : float
        Coefficient of twisting friction, > 0.
    spin : float
        [rad/s].
    g, radius, inertia_ratio : float
        Gravity [m/s^2], radius [m], ``k = I/(m R^2)``, > 0.
    """
    positive(mu_t=mu_t, g=g, radius=radius, inertia_ratio=inertia_ratio)
    finite(spin=spin)
    return inertia_ratio * radius * abs(spin) / (mu_t * g)


def against_twisting(
    t: ArrayLike, *, mu_t: float, spin: float, g: float, radius: float, inertia_ratio: float = UNIFORM_SPHERE
) -> FloatArray:
    """Spin about the vertical [rad/s] against the constant torque of `twist_time`, at times ``t`` [s]: it falls linearly, and stays 0."""
    end = twist_time(mu_t=mu_t, spin=spin, g=g, radius=radius, inertia_ratio=inertia_ratio)
    times = times_of(t)
    left: FloatArray = np.where(times < end, spin * (1.0 - times / end), 0.0) if end > 0.0 else np.zeros_like(times)
    return left
