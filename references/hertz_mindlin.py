"""Oblique impact by the incremental Hertz-Mindlin law: integrated to round-off, and step by step as central differences do."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import finite, not_negative, positive, positive_or_inf
from ninedisk.references.analytic.impact.hertz import Impact, hertz_impact

FloatArray = NDArray[np.float64]

UNLOADING = ("none", "force", "rescale")
FINE, COARSE = 1e-12, 1e-10
"""Relative tolerances of two integrations, whose difference is the uncertainty."""

EARLY = 1e-9
"""Time after touch at which the integration begins, over that of the impact: the impulse until then is below 1e-11 of the whole."""

PLACES = (0.0, 0.25, 0.5, 0.75)
"""Where in a step the touch may fall."""


class SpheresAfterImpact(NamedTuple):
    """Two spheres after an impact, in the frame of the touch: n from the first to the second, t along the surface.

    ``first`` and ``second`` are (velocity along n, along t [m/s], spin about n x t [rad/s]).
    """

    first: tuple[float, float, float]
    second: tuple[float, float, float]


class Contact(NamedTuple):
    """Two spheres that meet and their law; an infinite ``radius_2`` is a plane, an infinite ``mass_2`` a body that nothing moves.

    Parameters
    ----------
    radius, mass : float
        Of the first sphere [m], [kg], > 0.
    radius_2, mass_2 : float
        Of the second, > 0 or infinite.
    first, second : (float, float, float)
        Velocity along n, from the first to the second, and along t [m/s], spin about n x t [rad/s].
    e_star, g_star : float
        E*, G* [Pa], > 0 and >= 0.
    mu, beta : float
        Friction coefficient and damping ratio, >= 0.
    unloading : {"none", "force", "rescale"}
    """

    radius: float
    mass: float
    radius_2: float
    mass_2: float
    first: tuple[float, float, float]
    second: tuple[float, float, float]
    e_star: float
    g_star: float
    mu: float
    beta: float
    unloading: str

    def checked(self) -> Contact:
        """Itself, or ValueError where a value is out of its range."""
        positive(radius=self.radius, mass=self.mass, e_star=self.e_star)
        positive_or_inf(radius_2=self.radius_2, mass_2=self.mass_2)
        not_negative(g_star=self.g_star, mu=self.mu, beta=self.beta)
        for name in ("first", "second"):
            for value in getattr(self, name):
                finite(**{name: value})
        if self.unloading not in UNLOADING:
            raise ValueError(f"unloading = {self.unloading!r} is not allowed: use one of {', '.join(UNLOADING)}")
        if not self.first[0] > self.second[0]:
            raise ValueError(
                f"the bodies part at {self.second[0] - self.first[0]:g} m/s: the first must be the faster along n"
            )
        return self

    @property
    def reduced(self) -> tuple[float, float]:
        """Reduced radius [m] and mass [kg]."""
        return 1.0 / (1.0 / self.radius + 1.0 / self.radius_2), 1.0 / (1.0 / self.mass + 1.0 / self.mass_2)

    @property
    def speed(self) -> float:
        """Speed of approach [m/s]."""
        return self.first[0] - self.second[0]

    @property
    def elastic(self) -> Impact:
        """The impact without dashpot."""
        radius, mass = self.reduced
        return hertz_impact(e_star=self.e_star, radius=radius, mass=mass, speed=self.speed)


class _Law:
    """The law in units of the reduced mass, the elastic overlap and the speed of approach."""

    def __init__(self, contact: Contact) -> None:
        _, mass = contact.reduced
        self.long, self.fast, self.mu, self.unloading = (
            contact.elastic.overlap,
            contact.speed,
            contact.mu,
            contact.unloading,
        )
        self.c = 2.5 * contact.beta  # 2 sqrt(5/6) beta sqrt(2 E* a), with (4/3) E* sqrt(R) = 5/4 in these units
        self.kt = 7.5 * contact.g_star / contact.e_star  # 8 G* a over (4/3) E* a, times 5/4
        self.flat = math.isinf(contact.radius_2)
        self.apart = 1.0 if self.flat else (contact.radius + contact.radius_2) / self.long
        # A tangential impulse changes the slip by its inverse mass and both spins, 2/5 m R^2 being the inertia.
        self.turn_1 = 2.5 * mass / contact.mass
        self.turn_2 = 0.0 if math.isinf(contact.mass_2) else 2.5 * mass / contact.mass_2

    def frame(self, p: float, q: float) -> tuple[float, float, float]:
        """Overlap and unit normal of the second sphere displaced by (p, q) from touch, relative to the first."""
        if self.flat:
            return -p, 1.0, 0.0
        x = self.apart + p
        far = math.hypot(x, q)
        return -(2.0 * self.apart * p + p * p + q * q) / (far + self.apart), x / far, q / far

    def normal(self, overlap: float, rate: float) -> float:
        """fn."""
        overlap = max(overlap, 0.0)
        return 1.25 * overlap * math.sqrt(overlap) + self.c * math.sqrt(math.sqrt(overlap)) * rate

    def normal_rate(self, overlap: float, rate: float, second: float) -> float:
        """Its rate, by the first and second derivatives of the overlap."""
        root = math.sqrt(math.sqrt(overlap))
        return (1.875 * root**2 + 0.25 * self.c * root / overlap * rate) * rate + self.c * root * second

    def carried(self, rate: float) -> float:
        """Power of the contact radius that an unstrained change of it takes the shear force along by."""
        return {"force": 0.0, "none": 1.0, "rescale": 2.0 if rate < 0.0 else 1.0}[self.unloading]


def impact(contact: Contact) -> tuple[SpheresAfterImpact, SpheresAfterImpact]:
    """Rebound and its uncertainty, by what two integrations differ, of `FINE`, which is the rebound, and `COARSE`."""
    fine, coarse = rebound(contact), rebound(contact, COARSE)
    off = np.abs(np.subtract(fine, coarse))
    return fine, SpheresAfterImpact(_three(off[0]), _three(off[1]))


def rebound(contact: Contact, tolerance: float = FINE) -> SpheresAfterImpact:
    """Velocities after an impact, integrated to a relative ``tolerance``.

    The law is that of `Contact`: with the overlap delta, the contact radius ``a = sqrt(R delta)`` and the slip u of the surfaces

    - ``fn = (4/3) E* a delta + 2 sqrt(5/6) beta sqrt(2 m E* a) delta'``;
    - the shear force of a contact that sticks grows by ``f' = 8 G* a u + c f a'/a``, c = 0 where the force is kept ("force"), 1 where the
      spring's displacement is ("none"), and 2 while a falls ("rescale");
    - it is cut off at ``mu max(fn, 0)``, and the contact slides as long as the spring would stretch at least as fast as that grows.

    The normal turns with the centres; arms are the radii. Phases of sticking and sliding follow each other, and the end of each is found
    on the integration's dense output.
    """
    contact.checked()
    positive(tolerance=tolerance)
    return _integrated(contact, tolerance)


def _three(row: FloatArray) -> tuple[float, float, float]:
    return float(row[0]), float(row[1]), float(row[2])


@lru_cache(maxsize=256)
def _integrated(contact: Contact, tolerance: float) -> SpheresAfterImpact:
    from scipy.integrate import solve_ivp  # slow to import, and most runs do not need it

    law = _Law(contact)

    def parts(state: FloatArray) -> tuple[float, ...]:
        p, q, wn, wt, turn = (float(each) for each in state[:5])
        overlap, nx, ny = law.frame(p, q)
        return overlap, nx, ny, wn * nx + wt * ny, -wn * ny + wt * nx + turn

    def rates(state: FloatArray, shear: float, shear_rate: float) -> FloatArray:
        overlap, nx, ny, rate, _ = parts(state)
        fn = law.normal(overlap, rate)
        return np.array([
            -state[2], -state[3], -fn * nx + shear * ny, -fn * ny - shear * nx, -(law.turn_1 + law.turn_2) * shear,
            shear, shear_rate,
        ])  # fmt: skip

    def free_rate(state: FloatArray, shear: float) -> float:
        overlap, _, _, rate, slip = parts(state)
        held = max(overlap, 1e-300)
        return law.kt * math.sqrt(held) * slip + law.carried(rate) * shear * rate / (2.0 * held)

    def cap(state: FloatArray) -> float:
        overlap, _, _, rate, _ = parts(state)
        return law.mu * max(law.normal(overlap, rate), 0.0)

    def open_(_: float, state: FloatArray) -> float:
        return parts(state)[0]

    def cap_rate(state: FloatArray, shear: float) -> float:
        overlap, nx, ny, rate, slip = parts(state)
        change = rates(state, shear, 0.0)
        across = slip - float(state[4])
        turning = 0.0 if law.flat else across**2 / (law.apart + float(state[0]))  # of the normal, of higher order
        second = float(change[2]) * nx + float(change[3]) * ny - turning
        return law.mu * law.normal_rate(max(overlap, 1e-300), rate, second)

    def sticks(_: float, state: FloatArray) -> FloatArray:
        return rates(state, float(state[6]), free_rate(state, float(state[6])))

    def slips(_: float, state: FloatArray) -> float:
        return cap(state) - abs(float(state[6]))

    def slides(sense: float) -> tuple[Callable[..., FloatArray], Callable[..., float]]:
        def motion(_: float, state: FloatArray) -> FloatArray:
            return rates(state, sense * cap(state), 0.0)

        def catches(_: float, state: FloatArray) -> float:
            if cap(state) <= 0.0:
                return 1.0
            shear = sense * cap(state)
            return sense * free_rate(state, shear) - cap_rate(state, shear)

        return motion, catches

    # State: place of the second sphere relative to the first, velocity of the first relative to the second, R1 omega1 + R2 omega2, the
    # tangential impulse and the shear force.
    begin = EARLY * contact.elastic.duration * law.fast / law.long
    turn = contact.radius * contact.first[2] + (0.0 if law.flat else contact.radius_2 * contact.second[2])
    along = (contact.first[1] - contact.second[1]) / law.fast
    state = np.array([-begin, -along * begin, 1.0, along, turn / law.fast, 0.0, 0.0])
    state[6] = law.kt * math.sqrt(begin) * parts(state)[4] * begin * (1.0 if law.unloading != "force" else 2.0 / 3.0)
    sliding = abs(state[6]) >= cap(state)
    t, last = begin, 60.0
    for _ in range(200):
        sense = math.copysign(1.0, state[6] if state[6] != 0.0 else parts(state)[4])
        motion, change = slides(sense) if sliding else (sticks, slips)
        events: list[Any] = [open_, change]
        for event in events:
            event.terminal, event.direction = True, -1.0
        found = solve_ivp(
            motion,
            (t, last),
            state,
            method="DOP853",
            rtol=tolerance,
            atol=1e-3 * tolerance,
            max_step=0.1,
            events=events,
        )
        t, state = float(found.t[-1]), found.y[:, -1].copy()
        if sliding:
            state[6] = sense * cap(state)
        if found.t_events is None or len(found.t_events[0]) or not len(found.t_events[1]):
            break
        sliding = not sliding
    return _after_impact(contact, law, state[2], state[3], float(state[5]))


def _after_impact(contact: Contact, law: _Law, wn: float, wt: float, impulse: float) -> SpheresAfterImpact:
    """Both bodies, by the relative velocity after the impact and the tangential impulse."""
    _, mass = contact.reduced
    along_n, along_t = (wn - 1.0) * law.fast, wt * law.fast - (contact.first[1] - contact.second[1])
    one, two = mass / contact.mass, 0.0 if math.isinf(contact.mass_2) else mass / contact.mass_2
    spin_1 = law.turn_1 * law.fast * impulse / contact.radius
    spin_2 = 0.0 if law.turn_2 == 0.0 else law.turn_2 * law.fast * impulse / contact.radius_2
    return SpheresAfterImpact(
        (contact.first[0] + one * along_n, contact.first[1] + one * along_t, contact.first[2] - spin_1),
        (contact.second[0] - two * along_n, contact.second[1] - two * along_t, contact.second[2] - spin_2),
    )


@lru_cache(maxsize=512)
def stepped(contact: Contact, dt: float, place: float, *, lagged: bool) -> SpheresAfterImpact:
    """The same impact by central differences of the step ``dt`` [s], whose touch falls a part ``place`` of a step after a whole one.

    Forces are those of whole steps and velocities those of half steps; a step's slip is that of its middle with the contact radius at
    its end. Dashpots see the velocity of the half step before (``lagged``) or, by one correction, that of the whole step.
    """
    contact.checked()
    positive(dt=dt)
    law = _Law(contact)
    h = dt * law.fast / law.long
    turn = contact.radius * contact.first[2] + (0.0 if law.flat else contact.radius_2 * contact.second[2])
    wn, wt, w = 1.0, (contact.first[1] - contact.second[1]) / law.fast, turn / law.fast
    p, q = (1.0 - place) * h, (1.0 - place) * h * wt  # one step later they overlap by place h
    fs, before, impulse = 0.0, 0.0, 0.0
    while True:
        p, q = p - wn * h, q - wt * h
        overlap, nx, ny = law.frame(p, q)
        if overlap <= 0.0:
            if before > 0.0:
                return _after_impact(contact, law, wn, wt, impulse)
            continue
        rate = wn * nx + wt * ny
        slip = -wn * ny + wt * nx + w
        fn = law.normal(overlap, rate)
        if not lagged:
            fn = law.normal(overlap, rate - 0.5 * h * fn)
        if before > 0.0:
            fs *= (overlap / before) ** (0.5 * law.carried(overlap - before))
        fs += law.kt * math.sqrt(overlap) * slip * h
        most = law.mu * max(fn, 0.0)
        fs = max(-most, min(most, fs))
        wn, wt = wn - h * (fn * nx - fs * ny), wt - h * (fn * ny + fs * nx)
        w -= h * (law.turn_1 + law.turn_2) * fs
        impulse += h * fs
        before = overlap


def scheme_errors(contact: Contact, dt: float, *, lagged: bool = True) -> tuple[float, float, float]:
    """What central differences err by at a step of ``dt`` [s]: largest difference of `stepped` from `rebound` over `PLACES`.

    Along n and along t [m/s], and of the spins [rad/s].
    """
    fine = rebound(contact)
    worst = np.zeros(3)
    for place in PLACES:
        found = stepped(contact, dt, place + 0.01, lagged=lagged)
        for mine, other in zip(fine, found, strict=True):
            worst = np.maximum(worst, np.abs(np.subtract(mine, other)))
    return float(worst[0]), float(worst[1]), float(worst[2])
