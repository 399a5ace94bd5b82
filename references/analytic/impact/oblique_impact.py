"""Disk that hits a plane at an angle: impulses of the rigid disk, and those of linear springs with Coulomb's cap."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import finite, flag, fraction, not_negative, pair, positive, positive_or_inf
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration, contact_history, restitution_of_beta

FloatArray = NDArray[np.float64]

STEPS = 4096
"""Points in a contact between which a change from sticking to sliding is bracketed."""


class Rebound(NamedTuple):
    """Velocity along the plane ``vx`` and away from it ``vy`` [m/s], and spin [rad/s], positive when rolling forward."""

    vx: float
    vy: float
    spin: float


def rigid_rebound(
    *,
    velocity: tuple[float, float],
    spin: float,
    radius: float,
    inertia_ratio: float,
    mu: float,
    restitution: float,
    dilates: bool = False,
) -> Rebound:
    """Rebound by Newton's restitution and Coulomb's law for the impulses.

    The normal impulse is ``m (1 + e) v_n``. The lowest point, with the slip ``u = vx - R omega``, stops if the tangential impulse
    that this takes, ``m u/(1 + 1/k)``, a third of ``m u`` for a disk, is at most mu times the normal one; else the disk slides
    through the impact and loses ``mu (1 + e) v_n`` of vx. Under the associated rule of convex contact models a sliding contact opens,
    ``vy = e v_n + mu |u'|`` with the slip u' that is left: the normal impulse is
    ``m ((1 + e) v_n + mu |u|)/(1 + mu^2 (1 + 1/k))``, and friction mu times that.

    Parameters
    ----------
    velocity : (float, float)
        Velocity along the plane and away from it, the latter < 0 [m/s].
    spin : float
        Spin, positive when rolling forward [rad/s].
    radius : float
        Radius [m], > 0.
    inertia_ratio : float
        ``k = I/(m R^2)``, > 0; ``inf`` for a disk that cannot turn.
    mu : float
        Friction coefficient, >= 0.
    restitution : float
        Coefficient of restitution e, in [0, 1].
    dilates : bool
        True: the associated sliding rule.

    Notes
    -----
    Source: Walton (1993), in Particulate Two-Phase Flow, ch. 25, for spheres; the impulse balance holds for any k.
    """
    _check(velocity, spin, radius, inertia_ratio, mu)
    fraction(restitution=restitution)
    flag(dilates=dilates)
    turn = 1.0 / inertia_ratio
    slip = velocity[0] - radius * spin
    normal = (1.0 + restitution) * -velocity[1]
    stops = abs(slip) / (1.0 + turn)
    if dilates and stops > mu * normal:
        normal = (normal + mu * abs(slip)) / (1.0 + mu**2 * (1.0 + turn))
    lost = math.copysign(min(stops, mu * normal), slip)
    return Rebound(velocity[0] - lost, velocity[1] + normal, spin + lost * turn / radius)


def spring_rebound(
    *,
    velocity: tuple[float, float],
    spin: float,
    radius: float,
    inertia_ratio: float,
    mu: float,
    mass: float,
    kn: float,
    ks: float,
    beta: float,
) -> Rebound:
    """Rebound by a linear normal spring with dashpot, an incremental shear spring and Coulomb's cap.

    The normal motion is that of `ninedisk.references.analytic.impact.spring_dashpot` whatever the friction. Along the plane, with the
    shear force f per unit mass against forward slip, ``u' = -(1 + 1/k) f``, and f either

    - follows the spring, ``f' = (ks/m) u``: a harmonic motion with ``Omega^2 = (1 + 1/k) ks/m``; or
    - is at the cap, ``f = +-mu fn/m``, as long as the spring would stretch at least as fast as the cap rises, in the sense of f.
      The integral of fn is the momentum that the normal motion has exchanged, so that u is known there as well.

    What happens in a contact is a sequence of such phases; each end is found to round-off.

    Parameters are those of `rigid_rebound`, and

    mass : float
        Mass [kg], > 0.
    kn, ks : float
        Stiffnesses [N/m], > 0.
    beta : float
        Normal damping ratio, >= 0.

    Notes
    -----
    Source: Di Maio & Di Renzo (2004), Chem. Eng. Sci. 59, 3461, for beta = 0; the sequence of phases is general.
    """
    _check(velocity, spin, radius, inertia_ratio, mu)
    positive(mass=mass, kn=kn, ks=ks)
    not_negative(beta=beta)
    motion = _Tangential(-velocity[1], 1.0 / inertia_ratio + 1.0, mu, mass, kn, ks, beta)
    slip = velocity[0] - radius * spin
    lost = motion.lost(slip)
    return Rebound(
        velocity[0] - lost,
        restitution_of_beta(beta) * -velocity[1],
        spin + lost / (inertia_ratio * radius),
    )


def _check(velocity: tuple[float, float], spin: float, radius: float, inertia_ratio: float, mu: float) -> None:
    """Raise ValueError where an argument that both kinds of rebound have is out of its range."""
    if not pair("velocity", velocity)[1] < 0.0:
        raise ValueError(f"velocity = {velocity!r} is not allowed: its second part leads to the plane and must be < 0")
    finite(spin=spin)
    positive(radius=radius)
    positive_or_inf(inertia_ratio=inertia_ratio)
    not_negative(mu=mu)


class _Tangential:
    """The motion along the plane in one contact; forces are per unit mass [m/s^2]."""

    def __init__(self, speed: float, ease: float, mu: float, mass: float, kn: float, ks: float, beta: float) -> None:
        self.speed, self.ease, self.mu, self.stiff = speed, ease, mu, ks / mass
        self.swing = math.sqrt(ease * self.stiff)
        self.normal = {"kn": kn, "m_eff": mass, "beta": beta, "speed": speed}
        self.omega, self.beta = math.sqrt(kn / mass), beta
        self.end = contact_duration(kn=kn, m_eff=mass, beta=beta)

    def lost(self, slip: float) -> float:
        """Velocity along the plane that the contact takes away [m/s]."""
        t, u, f, first = 0.0, slip, 0.0, slip
        sliding = False
        while t < self.end:
            t, u, f = self._slide(t, u, f) if sliding else self._stick(t, u, f)
            sliding = not sliding
        return (first - u) / self.ease

    def _stick(self, t: float, u: float, f: float) -> tuple[float, float, float]:
        """To the time at which the spring reaches the cap; state there."""

        def state(at: FloatArray) -> tuple[FloatArray, FloatArray]:
            c, s = np.cos(self.swing * (at - t)), np.sin(self.swing * (at - t))
            return u * c - self.ease * f / self.swing * s, f * c + self.stiff / self.swing * u * s

        # A contact that begins to stick is still at the cap, and inside it after a moment.
        stop = self._first(t, lambda at: self._cap(at) - np.abs(state(at)[1]), skip=f != 0.0)
        slip, force = state(np.asarray(stop))
        return stop, float(slip), float(force)

    def _slide(self, t: float, u: float, f: float) -> tuple[float, float, float]:
        """To the time at which the spring would stretch more slowly than the cap; state there."""
        sense = math.copysign(1.0, f if f != 0.0 else u)

        def slip(at: FloatArray) -> FloatArray:
            return np.asarray(u - sense * self.ease * self.mu * (self._exchanged(at) - self._exchanged(np.asarray(t))))

        stop = self._first(t, lambda at: sense * self.stiff * slip(at) - self._cap_rate(at), skip=False)
        here = np.asarray(stop)
        return stop, float(slip(here)), sense * float(self._cap(here))

    def _first(self, t: float, inside: Callable[[FloatArray], FloatArray], *, skip: bool) -> float:
        """First time from ``t`` on at which ``inside`` becomes negative; the contact's end where it never does."""
        from scipy.optimize import brentq  # slow to import, and most runs do not need it

        grid = t + (self.end - t) * np.linspace(0.0, 1.0, STEPS + 1)[:-1]
        values = np.asarray(inside(grid))
        found = np.flatnonzero(values[int(skip) :] < 0.0)
        if not len(found):
            return self.end
        k = int(skip) + int(found[0])
        if k == 0 or (k == 1 and not skip and values[0] == 0.0):
            return t
        if values[k - 1] <= 0.0:
            return float(grid[k])
        return float(brentq(lambda at: float(inside(np.asarray(at))), grid[k - 1], grid[k], xtol=1e-300, rtol=1e-15))

    def _at(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rate of the overlap [m/s] and normal force per unit mass [m/s^2]."""
        _, rate, fn = contact_history(np.minimum(t, np.nextafter(self.end, 0.0)), **self.normal)
        return rate, fn / self.normal["m_eff"]

    def _cap(self, t: FloatArray) -> FloatArray:
        return self.mu * self._at(t)[1]

    def _exchanged(self, t: FloatArray) -> FloatArray:
        """Integral of fn/m since touch: what the approach velocity has lost."""
        return self.speed - self._at(t)[0]

    def _cap_rate(self, t: FloatArray) -> FloatArray:
        """``mu d(fn/m)/dt`` with ``fn/m = omega^2 delta + 2 beta omega delta'`` and ``delta'' = -fn/m``."""
        rate, force = self._at(t)
        return np.asarray(self.mu * (self.omega**2 * rate - 2.0 * self.beta * self.omega * force))
