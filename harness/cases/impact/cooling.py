"""Gas of smooth disks or spheres whose collisions lose energy: Haff's law within what so few of them scatter, and each collision's loss.

The same disks are followed from collision to collision without a time step; how long that binds an engine is derived.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.claims import Cells, Claim, UndecidedError, Verdict, scalar
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    contact_softness,
    contact_step,
    last,
    numerics_of,
    phase_error,
    single,
    whole_steps,
)
from ninedisk.harness.cases.differences import checks_with_allowance
from ninedisk.harness.cases.impact.binary import beta_for
from ninedisk.harness.cases.impact.gas import (
    MASS,
    MEETING,
    NAMES,
    RADIUS,
    contact_free_level,
    energy_bounds,
    expected_collisions,
    overlaps_squared,
    wall_gaps,
)
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.gas import haff_spread, haff_time, pair_rate, rate_in_box
from ninedisk.references.analytic.impact.hard_disks import hard_disks
from ninedisk.references.analytic.impact.spring_dashpot import contact_duration

MIXED = 10.0
"""Collisions of each disk, elastic ones, between the lattice and the start: the density and the velocities are those of equilibrium."""

THEORY = 0.03
"""Error of Haff's rate: Enskog's factor and, as the gas cools, velocities that no longer are independent; 3 % agreement is usual."""

SIGMAS = 4.0
"""Standard deviations among gases that a cell may be off by: one in 16,000 is farther."""

CONFIDENCE = 2.58
"""Of the mean over seeds, in standard deviations: 99 %."""

PARTED = 0.03
"""Part of the first energy, six collisions' losses, by which disturbed motions of the same disks may differ before they bind no more."""

DISTURBED = 6
"""Disturbed motions."""

CHANGED = 1e-9
"""Part of the mean speed by which a velocity changes in a collision at least."""


def haffs_law(cells: Cells) -> Verdict:
    """Mean of ln(T/T0) at the end over the seeds, against Haff's law."""
    ends = [(cell, scalar(cell, "ln_temperature")) for cell in cells if cell.observed is not None]
    if len(ends) < 2:
        raise UndecidedError("it takes two seeds at least")
    values = np.array([value for _, value in ends])
    laws = [law_at_end(cell.params, cell.setup) for cell, _ in ends if cell.setup is not None]
    expected, sigma = float(np.mean([law.expected for law in laws])), laws[0].spread
    width = CONFIDENCE * sigma / math.sqrt(len(values))
    off = float(values.mean()) - expected
    text = (
        f"ln(T/T0) = {values.mean():.3f} +- {width:.3f} (99 %, {len(values)} seeds; they scatter by {values.std(ddof=1):.3f}, "
        f"{sigma:.3f} expected); Haff's law {expected:.3f} +- {laws[0].theory:.3f}"
    )
    return abs(off) <= width + laws[0].theory, text


class CoolingGas:
    """Equal disks that begin in equilibrium, in a box with elastic smooth walls; nothing but their collisions takes energy.

    Walls that lose nothing make no gradients; that there are fewer partners at them, and that disks have less room than the box, is
    in the rate. Energies are relative to the first one.
    """

    id = "gas/cooling"
    version = 1
    title = "Cooling gas of inelastic disks"
    source = "Haff (1983), J. Fluid Mech. 134, 401; collision rate of dense disks: Enskog, Henderson (1975)"
    requirement = (
        "each collision takes 1 - e^2 of its energy of approach and none adds any; the energy falls as 1/(1 + t/t0)^2 within the "
        "scatter of gases of so few disks"
    )
    figures: tuple[Figure, ...] = (
        Figure(
            kind="places",
            title="Cooling of each gas",
            quantities=(Plotted("ln_temperature", "ln(T/T0) at the end [-]", at="seed"),),
            at_label="seed",
            shows="How far each gas has cooled, by the seed of its velocities, beside Haff's law.",
            allows="Gases of so few disks scatter about the law by 0.11, one seed like the other and one engine like the other once their "
            "motions have parted: only the mean over seeds decides, and the claim below says within what.",
        ),
        Figure(
            title="Cooling",
            quantities=(Plotted("cooling", "sqrt(T0/T) - 1"), Plotted("kinetic_level", "energy over the first")),
            shows="By Haff's law the first is a straight line, t/t0.",
            allows="Engines agree as long as each follows the same disks from collision to collision, and part after some collisions of "
            "each disk; the table of errors says how long that motion binds.",
        ),
    )
    claims: tuple[Claim, ...] = (
        Claim(
            id="haffs-law",
            place="Haff (1983)",
            text="T = T0/(1 + t/t0)^2 with 1/t0 = (1 - e^2) times a quarter of the rate of collisions.",
            decided_by="ln(T/T0) at the end, the mean over the seeds: confirmed if its 99 % confidence interval, by the scatter that is "
            "derived for so many disks, and 3 % of the rate for the theory include Haff's law.",
            rule=haffs_law,
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="seed", default=1, low=0, high=2**31, whole=True, in_id=True, help="of the random velocities"),
        Parameter(name="restitution", default=0.7, low=0.1, high=0.99, unit="-", help="of two disks; walls have 1"),
        Parameter(name="rows", default=8, low=4, high=12, whole=True, unit="-", help="disks in a row and in a column"),
        Parameter(name="spacing", default=5.6, low=3.0, high=20.0, unit="m", help="the box has that much for each disk of a row"),
        Parameter.positive("speed", 5.0, unit="m/s", help="root mean square of the velocities"),
        Parameter.positive("dt", 0.01, unit="s", help="step; sampling of spring engines"),
        Parameter.positive("duration", 8.0, unit="s", help="length of the run"),
        Parameter.positive("kn", 1e5, unit="N/m", help="stiffness of spring engines: contacts of 13 ms"),
        Parameter(name="phase", default=0.1, low=1e-3, high=0.5, unit="-", only_for="spring",
                  help="omega dt of a contact of two disks at most, where contact_dt does not say otherwise"),
        CONTACT_DT,
        *(replace(each, default="newton") if each.name == "impact" else each for each in CONTACT_DYNAMICS),
    )  # fmt: skip

    dimension = 2

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Four seeds."""
        return [{"seed": seed} for seed in (1, 2, 3, 4)]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """The disks where elastic collisions have brought them from a lattice."""
        kn, speed = params["kn"], params["speed"]
        if speed * math.sqrt(0.5 * MASS / kn) > 0.05 * RADIUS or speed * params["dt"] > 0.1 * RADIUS:
            raise ParameterError(
                f"kn = {kn:g} N/m with dt = {params['dt']:g} s is not allowed: disks would overlap by more than a twentieth of the radius, "
                f"or move by more than a tenth of it in a step; use kn > {0.5 * MASS * (20.0 * speed / RADIUS) ** 2:.3g} and "
                f"dt < {0.1 * RADIUS / speed:.3g}"
            )
        x, v = _start(params["rows"], params["spacing"], speed, params["seed"], self.dimension)
        return self.setup(params, x, v)

    def setup(self, params: Mapping[str, Any], x: FloatArray, v: FloatArray) -> Setup:
        """The disks in their box."""
        kn, e, n, side = params["kn"], params["restitution"], len(x), _side(params)
        elastic = ContactLaw(kn=kn, restitution=1.0, regularised=True)
        faces = (
            ((0.0, 0.0), (1.0, 0.0)),
            ((side, 0.0), (-1.0, 0.0)),
            ((0.0, 0.0), (0.0, 1.0)),
            ((0.0, side), (0.0, -1.0)),
        )
        scene = Scene(
            disks=Disks(x=x, v=v, radius=np.full(n, RADIUS), mass=np.full(n, MASS)),
            disk_disk=ContactLaw(kn=kn, beta=beta_for(e), restitution=e, regularised=True),
            walls=tuple(
                Wall(name=name, point=point, normal=normal, law=elastic)
                for name, (point, normal) in zip(NAMES, faces, strict=True)
            ),
        )
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=own_step(params),
            theta=1.0 / (1.0 + e),
        )
        return Setup(scene=scene, numerics=numerics, watch=(), labels={})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Energies over the first one, what they rise by, and the loss of the collisions that can be distinguished from the others.

        ``kinetic_level`` is the largest kinetic energy of five samples: while springs touch they hold some; ``energy`` has that of springs.
        ``kinetic_rise`` is without what impacts feed in which Newton's restitution does not bound the energy, see `_wall_energy`.
        ``loss`` is what collisions of two disks that meet nobody else meanwhile lose, over their energy of approach.
        """
        kinetic = 0.5 * MASS * (history.v**2).sum(axis=(1, 2))
        gaps = wall_gaps(params, history.x)
        elastic = 0.5 * params["kn"] * ((np.maximum(-gaps, 0.0) ** 2).sum(axis=1) + overlaps_squared(history.x))
        first = 0.5 * MASS * float((setup.scene.bodies.v**2).sum())
        held = contact_free_level(kinetic / first)
        series = {
            "kinetic": ("1", kinetic / first),
            "kinetic_level": ("1", held),
            "energy": ("1", (kinetic + elastic) / first),
            "cooling": ("1", 1.0 / np.sqrt(held) - 1.0),
        }
        scalars = {
            f"{name}_rise": ("1", _largest_rise(values)) for name, (_, values) in series.items() if name != "cooling"
        }
        scalars["kinetic_rise"] = ("1", _largest_rise((kinetic - _wall_energy(params, history)) / first))
        scalars["ln_temperature"] = ("1", math.log(last(held)) if last(held) > 0.0 else math.nan)
        scalars["loss"] = ("1", _loss(history, params["speed"]))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """What a collision loses, and that none adds; the law itself holds of many gases, not of one."""
        return (
            Headline(name="energy lost in a collision", use="impacts", quantity="loss", expected=1.0 - params["restitution"] ** 2,
                     source="Newton's restitution", scale=1.0, scale_is="energy of approach"),
            Headline(name="energy fed by collisions", use="energy", quantity="kinetic_level_rise", expected=0.0,
                     source="Newton's restitution", scale=1.0, scale_is="initial energy"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """The law within the scatter, the very motion while it binds, and each collision."""
        law, times = law_at_end(params, setup), setup.numerics.sampled_steps() * setup.numerics.dt
        lag = _lag(params, setup, engine)
        delay = lag * 2.0 / len(setup.scene.bodies) * _rate(params, self.dimension)
        theory = law.theory * (1.0 + delay / THEORY)
        atol = SIGMAS * law.spread + theory
        why = (
            f"{SIGMAS:g} standard deviations, {law.spread:.3g}, of gases of {len(setup.scene.bodies)} {setup.scene.noun}s; "
            f"{THEORY:.0%} of the rate for the theory, and {delay:.1%} for collisions that take {lag:.2g} s"
        )
        grown, source = 1.0 + law.elapsed, f"Haff's law: {self.source}"
        found = [
            Check(quantity="ln_temperature", norm="scalar", truth="analytic", expected=law.expected, source=source, atol=atol,
                  scale=1.0, why=why),
            Check(quantity="cooling", norm="max", truth="analytic", expected=np.asarray(times / law.time), source=source,
                  atol=grown * math.expm1(0.5 * atol), why=f"ln T may be off by {atol:.3g} at the end: {why}"),
            *_motion_checks(params, setup, observed, engine, lag),
        ]  # fmt: skip

        def sharp(setup: Setup, engine: EngineInfo) -> list[Check]:
            return _collision_checks(params, setup, engine)

        return [*found, *checks_with_allowance(Difference.NORMAL_TURNS_IN_IMPACT, setup, engine, sharp)]


@lru_cache(maxsize=32)
def _start(rows: int, spacing: float, speed: float, seed: int, dimension: int = 2) -> tuple[FloatArray, FloatArray]:
    """Centres and velocities, shapes (n, d), `MIXED` elastic collisions of each disk after a lattice with velocities that have no mean."""
    v = np.random.default_rng(seed).standard_normal((rows**dimension, dimension))
    v -= v.mean(axis=0)
    v *= speed / math.sqrt(float((v**2).sum(axis=1).mean()))
    place = spacing * (np.arange(rows) + 0.5)
    x = np.array([each[::-1] for each in product(place, repeat=dimension)])
    rate = pair_rate(
        n=len(x),
        area=(rows * spacing) ** dimension,
        radius=RADIUS,
        thermal=speed / math.sqrt(dimension),
        dimension=dimension,
    )
    time = MIXED * len(x) / (2.0 * rate)
    mixed = hard_disks(x=x, v=v, radius=RADIUS, side=rows * spacing, restitution=1.0, times=[time])
    return mixed.x[0], mixed.v[0]


def _side(params: Mapping[str, Any]) -> float:
    return float(params["rows"] * params["spacing"])


def own_step(params: Mapping[str, Any]) -> float:
    """Contact step of spring engines [s]."""
    return contact_step(params["dt"], params["phase"] / math.sqrt(2.0 * params["kn"] / MASS))


def _rate(params: Mapping[str, Any], d: int) -> float:
    """Collisions of pairs per second at the start, walls and all."""
    n, side = params["rows"] ** d, _side(params)
    bulk = pair_rate(n=n, area=side**d, radius=RADIUS, thermal=params["speed"] / math.sqrt(d), dimension=d)
    return bulk * rate_in_box(n=n, side=side, radius=RADIUS, dimension=d)


class Law(NamedTuple):
    """Haff's law of a variant: t0 [s]; at the end t/t0, ln(T/T0), its scatter among gases and the theory's own error."""

    time: float
    elapsed: float
    expected: float
    spread: float
    theory: float


def law_at_end(params: Mapping[str, Any], setup: Setup) -> Law:
    """Haff's law with the rate in the box; an error of the rate by a part p is one of ln T by ``2 p (t/t0)/(1 + t/t0)``."""
    d, side, e = setup.scene.dimension, _side(params), params["restitution"]
    n, thermal = params["rows"] ** d, params["speed"] / math.sqrt(d)
    time = haff_time(n=n, area=side**d, radius=RADIUS, thermal=thermal, restitution=e, dimension=d)
    time /= rate_in_box(n=n, side=side, radius=RADIUS, dimension=d)
    elapsed = setup.numerics.n_steps * setup.numerics.dt / time
    return Law(
        time=time,
        elapsed=elapsed,
        expected=-2.0 * math.log1p(elapsed),
        spread=haff_spread(n=n, restitution=e, elapsed=elapsed, dimension=d),
        theory=2.0 * THEORY * elapsed / (1.0 + elapsed),
    )


def _lag(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> float:
    """Time [s] by which an engine's collisions are late, or that they take."""
    law, numerics = setup.scene.law_of_bodies, setup.numerics
    lasts = contact_duration(kn=params["kn"], m_eff=0.5 * MASS, beta=law.beta) if engine.contact == "spring" else 0.0
    return max(numerics.dt, lasts)


class _Motion(NamedTuple):
    """Energy at the samples over the first, NaN from where it binds no more; how long it does [s], and the collisions until then."""

    energy: FloatArray
    until: float
    collisions: int


@lru_cache(maxsize=32)
def _motion(
    rows: int, spacing: float, speed: float, seed: int, d: int, e: float, lag: float, times: tuple[float, ...]
) -> _Motion:
    """The event-driven motion, and how long others stay near it that begin a way of ``lag`` elsewhere.

    Every collision that is late by a time step, or that takes the time of a contact, displaces the disks by the displacement of that time.
    """
    x, v = _start(rows, spacing, speed, seed, d)
    box: dict[str, Any] = {"v": v, "radius": RADIUS, "side": rows * spacing, "restitution": e, "times": times}
    own = hard_disks(x=x, **box)
    energy = (own.v**2).sum(axis=(1, 2)) / (v**2).sum()
    rng, apart = np.random.default_rng(0), np.zeros(len(times))
    for _ in range(DISTURBED):
        moved = _displaced(x, speed * lag * rng.uniform(-1.0, 1.0, x.shape), rows * spacing)
        other = hard_disks(x=moved, **box)
        apart = np.maximum(apart, np.abs((other.v**2).sum(axis=(1, 2)) / (v**2).sum() - energy))
    part = np.flatnonzero(apart > PARTED)
    first = int(part[0]) if len(part) else len(times)
    return _Motion(
        np.where(np.arange(len(times)) < first, energy, np.nan),
        times[max(first - 1, 0)],
        int(own.collisions[max(first - 1, 0)]),
    )


def _displaced(x: FloatArray, path: FloatArray, side: float) -> FloatArray:
    """Centres displaced by ``path``, disk by disk, where that leaves them in the box and apart."""
    moved = x.copy()
    for i, step in enumerate(path):
        there = moved[i] + step
        others = np.delete(moved, i, axis=0)
        free = np.hypot.reduce((others - there).T).min() > 2.0 * RADIUS
        if free and (there > RADIUS).all() and (there < side - RADIUS).all():
            moved[i] = there
    return moved


MOST_COMPARED = 800
"""Samples of the begin of a run, that the event-driven motion is followed for."""


def _motion_checks(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, lag: float
) -> list[Check]:
    t = observed.t
    key = (
        params["rows"],
        params["spacing"],
        params["speed"],
        params["seed"],
        setup.scene.dimension,
        params["restitution"],
        lag,
    )
    motion = _motion(*key, tuple(t[:MOST_COMPARED].tolist()))
    expected = np.full(len(t), np.nan)
    expected[: len(motion.energy)] = motion.energy
    quantity = "energy" if engine.contact == "spring" else "kinetic"
    lost = -math.expm1(-2.0 * motion.collisions / len(setup.scene.bodies) * 4.0 * contact_softness(engine))
    return [
        Check(quantity=quantity, norm="max", truth="exact-step", expected=expected, scale=1.0,
              source=f"event by event, until {motion.until:.2f} s: {motion.collisions} collisions of two {setup.scene.noun}s",
              atol=2.0 * PARTED + lost,
              why=f"motions that begin {params['speed'] * lag:.2g} m apart, the displacement in a step or contact, differ by {PARTED:g} "
              "of the energy by then; twice that for what each collision adds"),
    ]  # fmt: skip


def _collision_checks(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> list[Check]:
    """What no number of collisions changes: none adds energy, and what each takes.

    Of springs the normal turns in a contact by ``v_t t_c/sigma``, so that the energy of approach along the impulse is another one than
    that of touch: by ``<v_t^2 v_n> t_c/(sigma <v_n^2>) = sqrt(pi/8) a t_c/sigma`` over collisions and for each direction across,
    ``a^2 = 2 kT/m``; twice that, since the same turn is in the loss.
    """
    e, numerics = params["restitution"], setup.numerics
    hits = expected_collisions(params, setup)
    held = engine if engine.contact != "soft" else replace(engine, contact="impulse", softness=None)
    rises = energy_bounds(params, setup, held, hits)
    quantity, rise, reason = "kinetic", rises.atol, rises.why
    if engine.contact == "spring":
        quantity = "energy"
    elif Difference.IMPACT_AS_SPRINGS in engine.differences:
        # Half a step of a spring's motion, in own steps of the part of dt in which a contact takes its load up: a phase of 2 pi times that.
        quantity, own = "kinetic_level", 2.0 * math.pi * contact_softness(engine)
        rise += own**2 * (SIGMAS * math.sqrt(2.0 * hits.all / 90.0) + 0.25 * MEETING) / len(setup.scene.bodies)
        reason = f"an impact is a spring's motion over half a step, omega dt = {own:.3g}: phases of {hits.all:.0f} collisions"
    share = 1.0 - e**2
    d = setup.scene.dimension
    relative, sigma = params["speed"] * math.sqrt(2.0 / d), 2.0 * RADIUS
    off, why = 1e-9 + 1e3 * single(engine, 1.0, 1), "Newton's restitution: round-off"
    lasts = 0.0
    if engine.contact == "spring":
        phase = math.sqrt(2.0 * params["kn"] / MASS) * (numerics.contact_dt or numerics.dt)
        lasts = contact_duration(kn=params["kn"], m_eff=0.5 * MASS, beta=setup.scene.law_of_bodies.beta)
        off += 2.0 * e**2 * phase_error(phase, setup.scene.law_of_bodies.beta)
        why = f"omega dt = {phase:.3g}; the normal turns in a contact of {lasts:.2g} s"
    elif engine.contact == "soft" or Difference.NORMAL_TURNS_IN_IMPACT in engine.differences:
        lasts = numerics.dt
        off += 2.0 * (1.0 + e) * contact_softness(engine)
        why = f"soft contacts, or normals that turn, within a step: {lasts:.2g} s"
    off += 2.0 * (d - 1) * math.sqrt(math.pi / 8.0) * relative * lasts / sigma * share
    return [
        Check(quantity=f"{quantity}_rise", norm="scalar", truth="analytic", expected=0.0, source="collisions with e < 1 take energy",
              atol=rise, scale=1.0, why=reason),
        Check(quantity="loss", norm="scalar", truth="analytic", expected=share, source="1 - e^2 of the energy of approach",
              atol=off, why=why),
    ]  # fmt: skip


def _largest_rise(values: FloatArray) -> float:
    """Largest rise above the least value so far."""
    return float((values - np.minimum.accumulate(values)).max())


def _wall_energy(params: Mapping[str, Any], history: History) -> FloatArray:
    """Kinetic energy [J] gained so far in impacts of disks with a wall and with each other in one step, shape (s,).

    Newton's law takes energy from every collision, and from several at once if they all have the same restitution; disks have e, walls 1.
    Where a disk meets both it then may feed energy (Glocker 2013, Multibody Syst. Dyn. 29, 77), and the engine that does has kept the law.
    Disks meet whose gap is less than they can move in a step, and whose velocities change.
    """
    v, fed = history.v, np.zeros(len(history.v))
    if not np.isfinite(v).all():
        return fed
    energy = 0.5 * MASS * (v**2).sum(axis=2)
    gaps = wall_gaps(params, history.x).reshape(len(v), -1, v.shape[1] * v.shape[2])
    for k in np.flatnonzero(np.diff(energy.sum(axis=1)) > 0.0):
        changed = (v[k + 1] != v[k]).any(axis=1)
        path = 2.0 * math.sqrt(2.0 * float(energy[k][changed].max()) / MASS) * float(history.t[k + 1] - history.t[k])
        x = history.x[k]
        meets = np.linalg.norm(x[:, None] - x[None], axis=2) < 2.0 * RADIUS + path
        meets &= changed[:, None] & changed[None]
        for _ in range(len(x).bit_length()):
            meets = meets @ meets
        at_wall = changed & (gaps[k].reshape(-1, *x.shape) < path).any(axis=(0, 2))
        gain = energy[k + 1] - energy[k]
        for group in np.unique(meets[changed], axis=0):
            if group.sum() > 1 and at_wall[group].any():
                fed[k + 1] += max(float(gain[group].sum()), 0.0)
    return np.asarray(np.cumsum(fed))


def _loss(history: History, speed: float) -> float:
    """Energy that collisions of two disks lose over their energy of approach; NaN where none can be distinguished from the others."""
    lost = approach = 0.0
    for i, j, before, after in _pairs(history, speed):
        g, kick = history.v[before, j] - history.v[before, i], history.v[after, i] - history.v[before, i]
        normal = kick / math.hypot(*kick)
        approach += 0.25 * float(g @ normal) ** 2
        energy = [(history.v[at, i] ** 2).sum() + (history.v[at, j] ** 2).sum() for at in (before, after)]
        lost += 0.5 * float(energy[0] - energy[1])
    return lost / approach if approach > 0.0 else math.nan


def _pairs(history: History, speed: float) -> Iterator[tuple[int, int, int, int]]:
    """Disks whose velocities change together and by opposite amounts while no other's does, and the samples before and after."""
    v = history.v
    if not np.isfinite(v).all():
        return
    least = max(CHANGED, 1e2 * float(np.finfo(np.float32).eps) * bool((v == v.astype(np.float32)).all())) * speed
    changes = np.abs(np.diff(v, axis=0)).max(axis=2) > least  # (s - 1, n)
    runs: dict[tuple[int, int], list[int]] = {}
    for i in range(v.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate(([False], changes[:, i], [False])).astype(np.int8)))
        for begin, end in edges.reshape(-1, 2).tolist():
            runs.setdefault((begin, end), []).append(i)
    for (begin, end), disks in runs.items():
        if len(disks) == 2 and begin > 0 and end < len(v) - 1:
            i, j = disks
            total = v[end, i] + v[end, j] - v[begin, i] - v[begin, j]
            if np.abs(total).max() <= 2.0 * least:
                yield i, j, begin, end


CASE = CoolingGas()
