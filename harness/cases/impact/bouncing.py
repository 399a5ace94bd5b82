"""Disk dropped on a plane: it bounces lower and lower, and rests after a finite time.

Which bounces bind an engine follows from the kind of its contacts; how far its step may take it from them is derived.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, ParameterError, Setup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DT,
    CONTACT_DYNAMICS,
    GRAVITY,
    contact_softness,
    contact_step,
    last,
    numerics_of,
    phase_error,
    round_off_speed,
    single,
    single_precision,
    slack_time,
    soft_reason,
    summed_round_off,
    whole_steps,
)
from ninedisk.harness.cases.impact.binary import beta_for
from ninedisk.references.analytic.impact.bouncing import (
    Bounces,
    landing_speed,
    rigid_bounces,
    spring_bounces,
    zeno_time,
)
from ninedisk.references.exact_steps.plane_contact import plane_contact_theta

RADIUS, MASS = 1.0, math.pi
"""Unit radius and density."""

PAIR = (0, 1)
PHASE, DAMPED_PHASE = 0.025, 0.01
"""Default resolution of the contact: ``omega dt <= PHASE`` and ``beta omega dt <= DAMPED_PHASE``."""

REST = 1.25
"""Default duration in units of the time by which a rigid disk rests."""


FOLLOWED = 1e-6
"""Part of the largest speed that the growth of rounding errors may reach in steps that are compared as exact."""


class BouncingDisk:
    """A disk falls from rest on a plane; no friction.

    Engines with springs are held to the bounces of their own spring and dashpot under the disk's weight, contacts of finite length
    included; rigid ones to the geometric series of Newton's law. Each flight is compared at its highest point, whose height and
    time follow from two samples to round-off, and as a curve.
    """

    id = "impact/bouncing-disk"
    version = 2
    title = "Bouncing disk"
    source = "geometric series of Newton's restitution; spring and dashpot under weight: equation of motion, solved in closed form"
    requirement = "flight k reaches e^(2k) h; with e < 1 the disk rests after sqrt(2 h/g) (1 + e)/(1 - e); with e = 1 it never does"
    parameters: tuple[Parameter, ...] = (
        Parameter(name="restitution", default=0.5, low=0.0, high=1.0, unit="-", in_id=True,
                  help="coefficient of restitution; beta and theta follow from it"),
        Parameter.positive("height", 0.45, unit="m", help="gap from which the disk is dropped"),
        GRAVITY,
        Parameter.positive("dt", 2e-4, unit="s", help="step; sampling of spring engines"),
        Parameter(name="bounces", default=3, low=1, high=12, whole=True, help="flights after the fall that are compared, at most"),
        Parameter.positive("kn", 1e6, unit="N/m", help="stiffness of spring engines: 1e6 makes a contact of 6 ms"),
        CONTACT_DT,
        Parameter.positive("duration", None, unit="s",
                           help="length of the run; none: until it rests and a quarter more; for e > 0.9 the bounces that are compared"),
        *CONTACT_DYNAMICS,
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Half the speed kept, all of it, none of it, and that in coarse steps; Newton's law in contact dynamics."""
        return (
            {"restitution": 0.5},
            {"restitution": 1.0},
            {"restitution": 0.0},
            {"restitution": 0.0, "dt": 2e-3},
            {"restitution": 0.5, "impact": "newton"},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk above a horizontal plane."""
        kn, g, e = params["kn"], params["g"], params["restitution"]
        beta, omega = beta_for(e), math.sqrt(kn / MASS)
        speed = landing_speed(height=params["height"], g=g)
        if speed / omega + 2.0 * g / omega**2 >= RADIUS:
            raise ParameterError(
                f"kn = {kn:g} N/m is not allowed: the disk would sink into the plane by its radius; "
                f"use kn > {4.0 * MASS * max(speed / RADIUS, math.sqrt(g / RADIUS)) ** 2:.2g}"
            )
        law = ContactLaw(kn=kn, beta=beta, restitution=e, regularised=True)
        scene = Scene(
            disks=Disks(
                x=np.array([[0.0, RADIUS + params["height"]]]), radius=np.array([RADIUS]), mass=np.array([MASS])
            ),
            disk_disk=law,
            walls=(Wall(name="plane", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),),
            gravity=(0.0, -g),
        )
        dt = params["dt"]
        target = min(PHASE, DAMPED_PHASE / beta if beta > 0.0 else math.inf) / omega
        fall = speed / g
        if e <= 0.9:
            length = REST * max(zeno_time(height=params["height"], g=g, restitution=e), 2.0 * fall)
        else:
            length = fall * (1.0 + sum(2.0 * e**k for k in range(1, params["bounces"] + 1)))
            length += params["bounces"] * 2.0 * math.pi / omega
        numerics = numerics_of(
            params,
            n_steps=whole_steps(params, length, at_least=fall, event="the fall"),
            contact_dt=contact_step(dt, target),
            theta=1.0 / (1.0 + e),
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Gap, velocity and energy; height and time of each flight's highest point; when the disk is at rest for good.

        ``bounce_first`` and ``bounce_last`` are the heights of the first and the last flight that is compared, 0 where there is none.

        The highest point lies between samples whose velocities have different signs: from the first of them the parabola of free
        flight gives both numbers.
        """
        g, mass = params["g"], float(setup.scene.disks.mass[0])
        gap, vy = history.gap[:, 0], history.v[:, 0, 1]
        series = {
            "gap": ("m", gap),
            "vy": ("m/s", vy),
            "energy": ("J", mass * (0.5 * (history.v[:, 0] ** 2).sum(axis=1) + g * gap)),
        }
        scalars = {f"{name}_final": (unit, last(values)) for name, (unit, values) in series.items()}
        tops = np.flatnonzero((vy[1:-1] > 0.0) & (vy[2:] <= 0.0)) + 1
        for k in range(1, params["bounces"] + 1):
            found = k <= len(tops)
            i = int(tops[k - 1]) if found else 0
            scalars[f"apex_{k}"] = ("m", float(gap[i] + vy[i] ** 2 / (2.0 * g)) if found else math.nan)
            scalars[f"apex_time_{k}"] = ("s", float(history.t[i] + vy[i] / g) if found else math.nan)
        known = bool(np.isfinite(gap).all() and np.isfinite(vy).all())
        for name, k in (("bounce_first", 1), ("bounce_last", params["bounces"])):
            height = scalars[f"apex_{k}"][1] if k <= len(tops) else 0.0
            scalars[name] = ("m", max(height, 0.0) if known else math.nan)
        heights = [scalars[f"apex_{k}"][1] for k in range(1, params["bounces"] + 1)]
        scalars["height_lost"] = (
            "m",
            max(0.0, params["height"] - min(heights)) if np.isfinite(heights).all() else math.nan,
        )
        # Written so that a NaN counts as motion.
        moving = np.flatnonzero(~(gap <= rest_level(params)))
        rests = len(moving) > 0 and moving[-1] + 1 < len(gap)
        scalars["rest_time"] = ("s", float(history.t[moving[-1] + 1]) if rests else math.nan)
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Newton's restitution on a rigid plane: heights of the first bounce, of the last one that is compared, and at rest."""
        e, height, bounces = params["restitution"], params["height"], params["bounces"]
        common: dict[str, Any] = {
            "source": "flight k reaches e^(2k) h",
            "scale": height,
            "scale_is": "height of the fall",
        }
        return (
            Headline(name="height of the first bounce", use="impacts", quantity="bounce_first", expected=e**2 * height, **common),
            Headline(name="height of the last bounce", use="energy" if e == 1.0 else "impacts", quantity="bounce_last",
                     expected=e ** (2 * bounces) * height, **common),
            Headline(name="height at rest", use="rest", quantity="gap_final", expected=0.0 if e == 0.0 else math.nan, **common),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps for contact dynamics; flights, highest points and rest for all whose impact law is that of the scene."""
        found: list[Check] = []
        if engine.scheme == "theta":
            found += _stepped(params, setup, observed, engine)
            if setup.numerics.impact != "newton" and params["restitution"] != 0.0:
                return found
        return [*found, *_flights(binding_truth(params, setup, observed, engine), params["height"])]


def _flights(truth: Truth, height: float) -> list[Check]:
    """Heights are relative to that of the fall, of which the last flights are a small part."""
    common: dict[str, Any] = {"truth": "analytic", "source": truth.source, "why": truth.why}
    curves = [
        Check(quantity=name, norm="max", expected=curve, atol=truth.atol[name], **common)
        for name, curve in truth.curves.items()
    ]
    numbers = [
        Check(
            quantity=name,
            norm="scalar",
            expected=value,
            atol=truth.atol[name],
            scale=0.0 if "time" in name else height,
            **common,
        )
        for name, value in truth.scalars.items()
    ]
    return [*curves, *numbers]


def _stepped(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    exact, numerics = exact_curves(params, setup, observed, engine), setup.numerics
    source = f"theta scheme, theta = {numerics.theta:g}, impact {numerics.impact}: every step"
    why = "exact solution of this very scheme: round-off, which the phase of each impact in its step makes grow"
    return [
        Check(
            quantity=name, norm="max", truth="exact-step", expected=curve, source=source, atol=exact.atol[name], why=why
        )
        for name, curve in exact.curves.items()
    ]


class Truth(NamedTuple):
    """Curves (NaN where they say nothing) and numbers that bind an engine, absolute tolerances by name, and why."""

    curves: Mapping[str, FloatArray]
    scalars: Mapping[str, float]
    atol: Mapping[str, float]
    source: str
    why: str


class Errors(NamedTuple):
    """Bounds of one flight: of the speed at the level of the plane [m/s], and of the time of its begin [s]."""

    speed: float
    time: float


def rest_level(params: Mapping[str, Any]) -> float:
    """Gap [m] below which the disk counts as at rest: between the heights of the last flight that is compared and the next."""
    e = params["restitution"]
    return (
        float(params["height"] * e ** (2 * params["bounces"] + 1)) if 0.0 < e < 1.0 else 0.1 * float(params["height"])
    )


def binding_truth(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> Truth:
    """Flights with their tolerances."""
    law, mass = setup.scene.walls[0].law, float(setup.scene.disks.mass[0])
    case = {"height": params["height"], "g": params["g"], "bounces": params["bounces"] if params["restitution"] else 0}
    spring = engine.contact == "spring"
    if spring:
        flights = spring_bounces(kn=law.kn, mass=mass, beta=law.beta, **case)
        errors = _spring_errors(params, setup, flights)
        source = f"spring and dashpot under the weight, beta = {law.beta:.4g}"
        why = (
            f"phase of each impact in the contact step: omega dt = {_phase(setup):.3g}; errors of speed and time add up"
        )
        rest = -mass * params["g"] / law.kn
        settled = 8.0 * float(np.spacing(1.0 + params["height"]))
    else:
        flights = rigid_bounces(restitution=params["restitution"], **case)
        errors = _step_errors(params, setup, engine, flights)
        source = "Newton's restitution"
        why = "an impact falls anywhere in a step, and its speed and place with it: first order in dt, bounce by bounce"
        why += soft_reason(engine) + single_precision(engine)
        rest = -mass * params["g"] / law.kn if Difference.KEEPS_KN in engine.differences else 0.0
        # A soft contact lets a part of the landing speed through, a part of that in the next step, and so on; then of gravity's.
        slack, fall = slack_time(engine, setup.numerics.dt), math.sqrt(2.0 * params["g"] * params["height"])
        settled = _landed_height(params, setup, engine) + 1e-12 + slack * (fall + params["g"] * float(observed.t[-1]))
    lost = None if spring else _height_lost(params, setup, engine)
    return _collect(
        params, setup, observed, flights, errors, _Words(source, why), (rest, settled), spring=spring, lost=lost
    )


class _Words(NamedTuple):
    source: str
    why: str


def _collect(
    params: Mapping[str, Any],
    setup: Setup,
    observed: Observed,
    flights: Bounces,
    errors: list[Errors],
    words: _Words,
    at_rest: tuple[float, float],
    *,
    spring: bool,
    lost: float | None = None,
) -> Truth:
    """Curves and numbers of the flights; a sample as near to a contact as the time's error says nothing."""
    g, dt, t = params["g"], setup.numerics.dt, observed.t
    mass = float(setup.scene.disks.mass[0])
    gap, vy = flights.motion(t, g)
    for leave, land, error in zip(flights.leave, flights.land, errors, strict=True):
        begin, end = error.time + 1.5 * dt, error.time + 2.0 * error.speed / g + 1.5 * dt
        near = (np.abs(t - land) <= end) | ((np.abs(t - leave) <= begin) & (leave > 0.0))
        gap[near], vy[near] = np.nan, np.nan
    height, top = flights.apex(g)
    fastest = np.sqrt(flights.speed**2 + 2.0 * g * flights.gap)
    drift = [2.0 * error.speed + g * error.time for error in errors]
    shift = [
        w * (error.time + 2.0 * error.speed / g) + error.speed**2 / g for w, error in zip(fastest, errors, strict=True)
    ]
    of_energy = [mass * error.speed * (w + error.speed) for w, error in zip(fastest, errors, strict=True)]
    atol = {"gap": max(shift), "vy": max(drift), "energy": max(of_energy)}
    scalars: dict[str, float] = {}
    for k in range(1, len(height)):
        scalars |= {f"apex_{k}": float(height[k]), f"apex_time_{k}": float(top[k])}
        atol[f"apex_{k}"] = errors[k].speed * (fastest[k] + errors[k].speed) / g
        atol[f"apex_time_{k}"] = errors[k].time + errors[k].speed / g
    complete = len(height) == params["bounces"] + 1
    above = rest_level(params)
    # A flight that is hardly higher than the level may pass it between two samples, or stay below it by the step's error.
    if (
        0.0 < params["restitution"] < 1.0
        and complete
        and height[-1] - above > g * dt**2 + atol[f"apex_{len(height) - 1}"]
    ):
        scalars["rest_time"] = float(top[-1] + math.sqrt(2.0 * (height[-1] - above) / g))
        # As late as the flight, and as its parabola, met at the level with this slope, is high.
        steep = math.sqrt(2.0 * g * (height[-1] - above))
        atol["rest_time"] = dt + errors[-1].time + errors[-1].speed / g + atol[f"apex_{len(height) - 1}"] / steep
    if params["restitution"] == 1.0 and complete and lost is not None:
        scalars["height_lost"], atol["height_lost"] = 0.0, lost
    if (
        params["restitution"] < 1.0
        and setup.numerics.n_steps * dt > 1.1 * float(flights.land[-1])
        and _comes_to_rest(setup, spring=spring)
    ):
        scalars["gap_final"], atol["gap_final"] = at_rest
    energy = mass * (0.5 * vy**2 + g * gap)
    return Truth({"gap": gap, "vy": vy, "energy": energy}, scalars, atol, words.source, words.why)


def _comes_to_rest(setup: Setup, *, spring: bool) -> bool:
    """Whether the last part of the run is long enough for a dashpot to end what the bounces leave: a tenth of it, 40 decay times."""
    law, mass = setup.scene.walls[0].law, float(setup.scene.disks.mass[0])
    if not spring:
        return True
    omega = math.sqrt(law.kn / mass)
    slow = law.beta if law.beta < 1.0 else 1.0 / (law.beta + math.sqrt(law.beta**2 - 1.0))
    return 0.1 * setup.numerics.n_steps * setup.numerics.dt * slow * omega > 40.0


def _phase(setup: Setup) -> float:
    law, mass = setup.scene.walls[0].law, float(setup.scene.disks.mass[0])
    return math.sqrt(law.kn / mass) * (setup.numerics.contact_dt or setup.numerics.dt)


def _spring_errors(params: Mapping[str, Any], setup: Setup, flights: Bounces) -> list[Errors]:
    """Flights of a central-difference scheme.

    Free flight is exact. Each contact changes the speed by what `ninedisk.harness.cases.common.phase_error` derives, relative to
    it; the weight adds its own share, ``g dt`` at either end, where it is at work for a part of a step with or without the spring.
    The contact's length is uncertain by a step and a half, and flights by twice the error of the speed over g.
    """
    law, g = setup.scene.walls[0].law, params["g"]
    contact_dt, phase = setup.numerics.contact_dt or setup.numerics.dt, _phase(setup)
    relative = phase_error(phase, law.beta)
    rounding = round_off_speed(1.0 + params["height"], contact_dt)
    found, speed, time = [Errors(rounding, 0.0)], rounding, 0.0
    landing = math.sqrt(2.0 * g * params["height"])
    for k in range(1, len(flights.leave)):
        after = math.sqrt(float(flights.speed[k]) ** 2 + 2.0 * g * float(flights.gap[k]))
        kept = after / landing
        time += speed / g + 1.5 * contact_dt
        speed = kept * speed + relative * after + phase**2 * g * contact_dt + rounding
        found.append(Errors(speed, time))
        time += speed / g
        landing = after
    return found


def _step_errors(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, flights: Bounces) -> list[Errors]:
    """Flights of engines whose impacts last a step.

    Falling for n steps, the schemes' velocities are exact at the steps, and heights off by ``g t dt/2``: seen at the level of the
    plane, the speed is off by ``g dt/2``. An impact of speed w takes place before or after the step's own ``g dt``, and sees a gap of
    up to ``w dt`` of either sign, that is a speed off by ``g dt``, of which e are left. What leaves does so from the same gap, which
    takes ``g dt/e`` from its speed e w where that gave ``e g dt``, or gives them where it took: ``(1/e - e) g dt``; or from the
    plane itself, where the overlap is put right: ``e g dt``. A step's time is lost at either end. A soft contact lets through a part
    of each impulse.
    """
    g, dt, e = params["g"], setup.numerics.dt, params["restitution"]
    steps = setup.numerics.n_steps
    largest = math.sqrt(2.0 * g * params["height"])
    rounding = 1e-12 * largest + single(engine, largest, steps)
    speed, time = 0.5 * g * dt + rounding, 0.0
    found = [Errors(speed, time)]
    for k in range(1, len(flights.leave)):
        time += speed / g + dt
        missed = (1.0 + e) * contact_softness(engine) * float(flights.speed[k]) / e
        speed = e * (speed + g * dt) + max(1.0 / e - e, e) * g * dt + 0.5 * g * dt + missed + rounding
        found.append(Errors(speed, time))
        time += speed / g
    return found


def _height_lost(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> float:
    """Height [m] that bounces with restitution 1 may lose in all.

    An impact that is turned before the step's own ``g dt`` loses that, one that is turned after it gains it. What the gap adds is no
    loss: a disk that leaves from where it was turned gets the gap's energy back, and one that is put on the plane gains the overlap's.
    A bounce loses ``g dt`` of the speed at most, then, and heights by samples are off by ``g dt/2`` of the speed, once.
    """
    g, dt, bounces = params["g"], setup.numerics.dt, params["bounces"]
    landing = math.sqrt(2.0 * g * params["height"])
    missed = 2.0 * contact_softness(engine) * landing
    rounding = 1e-12 * landing + single(engine, landing, setup.numerics.n_steps)
    return float(landing / g * (bounces * (g * dt + missed) + 0.5 * g * dt + rounding))


def _landed_height(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> float:
    """Overlap or height [m] of a disk at rest: what the last landing leaves.

    A plastic one may see the whole way of its step. Others go on until the speed that `_step_errors` adds to each bounce is all
    there is: ``u = e u + c g dt``, ``c = e + max(1/e - e, e) + 1/2``; a place that is rounded to single precision adds its rounding
    in a step.
    """
    g, dt, e = params["g"], setup.numerics.dt, params["restitution"]
    if e == 0.0:
        return float(dt * (math.sqrt(2.0 * g * params["height"]) + g * dt))
    if e == 1.0:
        return math.inf
    rough = single(engine, RADIUS + params["height"], 1.0) / dt
    last = ((e + max(1.0 / e - e, e) + 0.5) * g * dt + rough) / (1.0 - e)
    return float(max(last * dt, last**2 / (2.0 * g)))


class SteppedCurves(NamedTuple):
    """Gap and velocity of the exact steps at the samples, NaN once rounding has grown too far, and absolute tolerances by name."""

    curves: Mapping[str, FloatArray]
    atol: Mapping[str, float]


def exact_curves(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo | None = None
) -> SteppedCurves:
    """The theta scheme's exact steps, as far as an engine can follow them.

    Theta's own impact law depends on where in a step the impact falls: a gap that is off by delta changes the speed by
    ``delta/(theta dt)``, which a flight of n steps turns into a gap off by ``n delta/theta``. The rounding of positions therefore
    grows by some hundred times with every bounce. Steps after an impact count as long as that bound of the speed stays below
    `FOLLOWED` of the largest speed. Newton's law does not depend on the phase, and its errors add up only. An engine in single precision
    starts from coarser roundings.
    """
    disks, numerics = setup.scene.disks, setup.numerics
    steps = plane_contact_theta(
        radius=float(disks.radius[0]),
        inertia_ratio=0.5,
        gap=params["height"],
        velocity=(0.0, 0.0),
        spin=0.0,
        g=params["g"],
        mu=0.0,
        dt=numerics.dt,
        theta=numerics.theta,
        restitution=params["restitution"] if numerics.impact == "newton" else None,
        dilates=numerics.sliding == "associated",
        n_steps=numerics.n_steps,
    )
    theta, dt = numerics.theta, numerics.dt
    largest, size = float(np.abs(steps.vy).max()), float(disks.radius[0]) + params["height"]
    struck = np.flatnonzero(np.diff(steps.vy) > 0.0) + 1
    first = struck[np.diff(struck, prepend=-9) > 2]  # an impact takes one step or two
    end, speed, gap = (
        numerics.n_steps,
        1e-12 * largest,
        summed_round_off(size, until := float(first[0]) if len(first) else numerics.n_steps),
    )
    if engine is not None:
        gap += single(engine, size, until)
    if numerics.impact != "newton":
        for now, then in pairwise([*first.tolist(), numerics.n_steps]):
            grown = max(1.0, (1.0 - theta) / theta) * gap / (theta * dt)
            if grown > FOLLOWED * largest:
                end = now - 2  # rounding may place an impact a step before
                break
            speed = max(speed, grown)
            gap += speed * (then - now) * dt
    atol = {"gap": gap + 1e-12 * size, "vy": speed}
    shown = observed.step <= end
    curves = {name: np.where(shown, getattr(steps, name)[observed.step], np.nan) for name in atol}
    return SteppedCurves(curves, atol)


CASE = BouncingDisk()
