"""Row of equal disks hit at one end: who takes the velocity, by several laws, and which of them binds an engine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    contact_softness,
    contact_step,
    drift_in_flight,
    flight_checks,
    last,
    numerics_of,
    phase_error,
    series_and_final,
    single,
    soft_reason,
    whole_steps,
)
from ninedisk.harness.cases.impact.binary import ROUND_OFF, beta_for
from ninedisk.references.analytic.impact.chain import ChainHistory, chain_of_collisions, chain_of_springs, touching_row
from ninedisk.references.exact_steps.chain import ChainSteps, chain_theta

RADIUS = 1.0

PHASE, DAMPED_PHASE = 0.04, 0.05
"""Default resolution of the row's fastest mode: ``omega dt <= PHASE`` and ``beta omega dt <= DAMPED_PHASE``."""

AFTER = 6
"""Steps ``dt`` after the last event in a run of default length."""


class NewtonCradle:
    """Disk 1 hits a row of disks at rest; no gravity, no friction.

    With gaps the row is a sequence of collisions of two, and all engines have one truth. A row that touches has several, each of
    them keeping momentum, and energy for e = 1: springs hand most of the velocity to the last disk and throw the first one back;
    Newton's law at all contacts at once moves all except the first disk on together; contact dynamics by theta's own law does as
    Newton's. None of them is what a cradle of steel balls shows, and none is an error: the reports name the law by which an engine
    is judged.
    """

    id = "chain/newton-cradle"
    version = 1
    title = "Row of disks hit at one end"
    source = (
        "Newton's restitution, one by one or at all contacts (Moreau 1988); linear springs: Herrmann & Schmaelzle, "
        "Am. J. Phys. 49 (1981) 761"
    )
    requirement = (
        "momentum always conserved, energy for e = 1; with gaps the last disk takes all; touching rows by the law of the engine's "
        "contacts"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="n", default=3, low=2, high=8, whole=True, unit="-", in_id=True, help="number of disks"),
        Parameter(name="gap", default=0.02, low=0.0, unit="m", in_id=True, help="gap between neighbours; 0: the row touches"),
        Parameter(name="restitution", default=1.0, low=0.0, high=1.0, unit="-",
                  help="coefficient of restitution; beta and theta follow from it"),
        Parameter.positive("dt", 2e-3, unit="s", help="step; sampling of spring engines"),
        Parameter.positive("speed", 1.0, unit="m/s", help="initial velocity of disk 1"),
        Parameter.positive("mass", math.pi, unit="kg", help="mass of each disk"),
        Parameter.positive("kn", 1e6, unit="N/m", help="stiffness of spring engines"),
        CONTACT_DT,
        Parameter.positive("duration", None, unit="s", help="length of the run; none: until all disks have parted and some steps more"),
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """With gaps, by Newton's law too; touching rows of three and five; a plastic one."""
        return (
            {"n": 3, "gap": 0.02},
            {"n": 3, "gap": 0.02, "impact": "newton"},
            {"n": 3, "gap": 0.0},
            {"n": 5, "gap": 0.0},
            {"n": 3, "gap": 0.0, "restitution": 0.0},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Disks on the x axis."""
        n, dt, kn, mass = params["n"], params["dt"], params["kn"], params["mass"]
        beta = beta_for(params["restitution"])
        law = ContactLaw(kn=kn, beta=beta, restitution=params["restitution"], regularised=True)
        place = np.concatenate(([0.0], np.cumsum(2.0 * RADIUS + np.array(gaps_of(params)))))
        v = np.zeros((n, 2))
        v[0, 0] = params["speed"]
        disks = Disks(x=np.column_stack([place, np.zeros(n)]), v=v, radius=np.full(n, RADIUS), mass=np.full(n, mass))
        scene = Scene(disks=disks, disk_disk=law)
        omega = 2.0 * math.sqrt(kn / mass)
        target = min(PHASE, DAMPED_PHASE / beta if beta > 0.0 else math.inf) / omega
        watch = tuple((i, i + 1) for i in range(n - 1))
        numerics = numerics_of(
            params, n_steps=1, contact_dt=contact_step(dt, target), theta=1.0 / (1.0 + params["restitution"])
        )
        setup = Setup(scene=scene, numerics=numerics, watch=watch, labels={"first": watch[0], "last": watch[-1]})
        end = spring_chain(params, setup)[1]
        if params["gap"] > 0.0:
            end = max(end, float(collisions(params).t[-1]))
        steps = whole_steps(
            params, end + AFTER * dt, at_least=end + 2.0 * dt, event="the last collision, spread over its steps,"
        )
        return Setup(scene=scene, numerics=numerics.replace(n_steps=steps), watch=watch, labels=setup.labels)

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Velocities along the row, kinetic energy and momentum."""
        mass, speed, v = params["mass"], params["speed"], history.v
        energy = 0.5 * mass * (v**2).sum(axis=(1, 2))
        momentum = mass * v[:, :, 0].sum(axis=1)
        series = {f"vx_{k + 1}": ("m/s", v[:, k, 0]) for k in range(params["n"])}
        series |= {
            "energy": ("J", energy),
            "momentum_x": ("kg m/s", momentum),
            "speed_across": ("m/s", np.abs(v[:, :, 1]).max(axis=1)),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        scalars["handed_on"] = ("1", last(v[:, -1, 0]) / speed)
        scalars["drift_in_flight"] = ("m/s", drift_in_flight(setup, history))
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Speed handed on and energy kept; in a row that touches the contacts' law decides on both, unless all energy is kept.

        Energy of a plastic row that touches: by any law the disks end with one speed, ``1/n`` of the first.
        """
        n, e, speed, mass = params["n"], params["restitution"], params["speed"], params["mass"]
        first = 0.5 * mass * speed**2
        last_speed, kept = math.nan, math.nan
        if params["gap"] > 0.0:
            final = collisions(params).v[-1]
            last_speed, kept = float(final[-1]), float((final**2).sum()) / speed**2
        elif e in (0.0, 1.0):
            last_speed, kept = (math.nan, 1.0) if e else (speed / n, 1.0 / n)
        return (
            Headline(name="speed of the last disk", use="impacts", quantity=f"vx_{n}_final", expected=last_speed,
                     source="one collision after the other, Newton's restitution", scale=speed, scale_is="speed of the first disk"),
            Headline(name="energy kept", use="impacts", quantity="energy_final", expected=kept * first,
                     source="Newton's restitution", scale=first, scale_is="initial energy"),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Conservation for all; velocities by the law that binds the engine, or the exact steps of its scheme."""
        speed, mass, numerics = params["speed"], params["mass"], setup.numerics
        found: list[Check] = []
        stepped = engine.scheme == "theta"
        if stepped:
            found += self._stepped(params, setup, observed)
        if not stepped or numerics.impact == "newton" or params["gap"] == 0.0:
            found += self._by_law(params, setup, observed, engine)
        momentum, n = mass * speed, params["n"]
        rough = n * single(engine, momentum, numerics.n_steps)
        conserved = "each impulse acts on two disks in opposite directions: round-off of a few operations"
        on_axis = "all centres lie on the x axis: no force has a y component"
        common: dict[str, Any] = {"norm": "max", "truth": "analytic"}
        found += [
            Check(quantity="momentum_x", expected=momentum, source="conservation", why=conserved,
                  atol=n * 1e-13 * momentum + rough, **common),
            Check(quantity="speed_across", expected=0.0, source="symmetry", why=on_axis,
                  atol=1e-13 * speed + single(engine, speed, 1), scale=speed, **common),
        ]  # fmt: skip
        return [*found, *flight_checks(setup, engine)]

    def _by_law(self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
        truth, mass, n = binding_truth(params, setup, observed, engine), params["mass"], params["n"]
        names = [f"vx_{k + 1}" for k in range(n)]
        expected = {name: truth.v[:, k] for k, name in enumerate(names)}
        expected["energy"] = 0.5 * mass * (truth.v**2).sum(axis=1)
        of_energy = mass * truth.atol * (float(np.abs(truth.final).sum()) + params["speed"] + n * truth.atol)
        tolerance = dict.fromkeys(names, (truth.atol, 0.0, truth.why)) | {"energy": (of_energy, 0.0, truth.why)}
        found = series_and_final(
            (*names, "energy"), expected, truth="analytic", source=truth.source, tolerance=tolerance,
            sizes=dict.fromkeys(names, params["speed"]),
        )  # fmt: skip
        found.append(
            Check(quantity="handed_on", norm="scalar", truth="analytic", expected=float(truth.final[-1]) / params["speed"],
                  source=truth.source, atol=truth.atol / params["speed"], why=truth.why)
        )  # fmt: skip
        return found

    def _stepped(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> list[Check]:
        steps, numerics, mass = exact_steps(params, setup), setup.numerics, params["mass"]
        names = [f"vx_{k + 1}" for k in range(params["n"])]
        expected = {name: steps.v[observed.step, k] for k, name in enumerate(names)}
        expected["energy"] = 0.5 * mass * (steps.v[observed.step] ** 2).sum(axis=1)
        source = (
            f"theta scheme, theta = {numerics.theta:g}, impact {numerics.impact}: complementarity problem of every step"
        )
        why = "exact solution of this very scheme: round-off of the steps and of the solver; a gap's is divided by dt"
        speed = params["speed"]
        floor = 1e-10 * speed
        tolerance = dict.fromkeys(names, (floor, EXACT_STEP_RTOL, why))
        tolerance["energy"] = (2.0 * mass * speed * floor, EXACT_STEP_RTOL, why)
        sizes = dict.fromkeys(names, speed)
        return series_and_final(
            (*names, "energy"), expected, truth="exact-step", source=source, tolerance=tolerance, sizes=sizes
        )


class Truth(NamedTuple):
    """Velocities at the samples, shape (s, n), NaN while an impact goes on; absolute tolerance [m/s]; final ones; and why."""

    v: FloatArray
    final: FloatArray
    atol: float
    source: str
    why: str


def gaps_of(params: Mapping[str, Any]) -> tuple[float, ...]:
    """Gaps between the disks of the row [m]."""
    return (float(params["gap"]),) * int(params["n"] - 1)


@lru_cache(maxsize=32)
def _springs(gaps: tuple[float, ...], speed: float, mass: float, kn: float, beta: float) -> tuple[ChainHistory, float]:
    return chain_of_springs(gaps=gaps, speed=speed, mass=mass, kn=kn, beta=beta)


def spring_chain(params: Mapping[str, Any], setup: Setup) -> tuple[ChainHistory, float]:
    """The row of springs of this variant.

    Raises
    ------
    ParameterError
        If the row moves by less than the rounding of its gaps, or does not end.
    """
    law = setup.scene.disk_disk
    try:
        return _springs(gaps_of(params), params["speed"], params["mass"], law.kn, law.beta)
    except ValueError as error:
        raise ParameterError(
            f"gap = {params['gap']:g} m, speed = {params['speed']:g} m/s, mass = {params['mass']:g} kg, kn = {params['kn']:g} N/m "
            f"and restitution = {params['restitution']:g} together are not allowed: {error}; move them towards their defaults"
        ) from error


def collisions(params: Mapping[str, Any]) -> ChainHistory:
    """Two disks at a time, in a row with gaps.

    Raises
    ------
    ParameterError
        If the collisions coincide or never end.
    """
    try:
        return chain_of_collisions(gaps=gaps_of(params), speed=params["speed"], restitution=params["restitution"])
    except ValueError as error:
        raise ParameterError(
            f"restitution = {params['restitution']:g} with gap = {params['gap']:g} m: {error}"
        ) from error


def binding_truth(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> Truth:
    """The law that binds an engine.

    With gaps all engines have the same truth but for e < 1: one collision after the other. In a row that touches, springs
    (and engines whose impacts are a spring's motion over their own steps) spread the impact over all contacts; engines that
    solve for impulses at all contacts at once follow Newton's law at each of them.
    """
    if engine.contact == "spring":
        return _by_springs(params, setup, observed)
    dt, t = setup.numerics.dt, observed.t
    e, speed = params["restitution"], params["speed"]
    atol = speed * (ROUND_OFF + (params["n"] - 1) * (1.0 + e) * contact_softness(engine))
    atol += 2.0 * single(engine, speed, setup.numerics.n_steps)
    why = "impulses at velocity level: round-off" + (" of single precision" if engine.precision == "float32" else "")
    why += soft_reason(engine)
    if params["gap"] > 0.0:
        history = collisions(params)
        v = history.velocities(t)
        for k, event in enumerate(history.t[1:]):
            v[np.abs(t - event) <= (k + 2.5) * dt] = np.nan
        return Truth(v, history.v[-1], atol, "one collision after the other, Newton's restitution", why)
    if Difference.IMPACT_AS_SPRINGS in engine.differences:
        history, _ = spring_chain(params, setup)
        final, source = (
            history.v[-1],
            "linear springs in a row, pushing only: the engine's impacts are a spring's motion",
        )
    else:
        final = touching_row(n=params["n"], speed=speed, restitution=e)
        source = "Newton's law at all contacts at once (Moreau)"
    v = np.where((t > 1.5 * dt)[:, None], final, np.nan)
    return Truth(v, final, atol + EXACT_STEP_RTOL * speed, source, f"{why}; residual of a solver of several contacts")


def _by_springs(params: Mapping[str, Any], setup: Setup, observed: Observed) -> Truth:
    """Event by event.

    Each contact begins and ends somewhere in a contact step, and its speeds are off by what
    `ninedisk.harness.cases.common.phase_error` derives: of the approach by the square of the phase, of what is left of it by a
    dashpot's share. While several contacts act, the frequencies of the scheme are high by ``(omega dt)^2/24``, at most that of the
    row's fastest mode, which turns the modes' phases by that times omega T.
    """
    law, t = setup.scene.disk_disk, observed.t
    history, end = spring_chain(params, setup)
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    phase = math.sqrt(2.0 * law.kn / params["mass"]) * contact_dt
    fast = math.sqrt(2.0) * phase
    left = float(np.abs(np.diff(history.v[-1])).max()) / params["speed"]
    share = (params["n"] - 1) * phase_error(phase, law.beta, left)
    share += fast**3 / 24.0 * _time_of_many(history) / contact_dt
    first = params["gap"] / params["speed"]
    dt = setup.numerics.dt
    v = np.where((t < first - 1.5 * dt)[:, None], history.v[0], history.v[-1])
    v[(t >= first - 1.5 * dt) & (t <= end + 1.5 * dt)] = np.nan
    why = f"phase of each contact in the contact step, and of the row's modes: omega dt = {phase:.3g}, beta = {law.beta:.4g}"
    source = "linear springs in a row, pushing only: solved event by event"
    return Truth(v, history.v[-1], params["speed"] * (share + ROUND_OFF), source, why)


def _time_of_many(history: ChainHistory) -> float:
    """Time [s] of pieces at whose begin or end more than one contact is closed."""
    closed = (np.diff(history.x, axis=1) <= 0.0).sum(axis=1) > 1
    return float(np.diff(history.t)[closed[:-1] | closed[1:]].sum())


def exact_steps(params: Mapping[str, Any], setup: Setup) -> ChainSteps:
    """Exact steps of the theta scheme on this variant."""
    numerics = setup.numerics
    return chain_theta(
        gaps=gaps_of(params),
        speed=params["speed"],
        dt=numerics.dt,
        theta=numerics.theta,
        restitution=params["restitution"] if numerics.impact == "newton" else None,
        n_steps=numerics.n_steps,
    )


CASE = NewtonCradle()
