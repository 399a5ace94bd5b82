"""Bounces that bind an engine by the kind of its contacts, and how far its step may take it from them, derived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ninedisk.harness.api.case import FloatArray, Observed, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import round_off_speed, single, soft_reason, softness, summed_round_off
from ninedisk.references.analytic.bouncing import Bounces, rigid_bounces, spring_bounces
from ninedisk.references.exact_steps.plane_contact import plane_contact_theta

FOLLOWED = 1e-6
"""Part of the largest speed that the growth of rounding errors may reach in steps that are compared as exact."""


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
        why += soft_reason(engine) + ("; single precision" if engine.precision == "float32" else "")
        rest = -mass * params["g"] / law.kn if engine.keeps_kn else 0.0
        settled = _landed(params, setup) + 1e-12 + softness(engine) * params["height"]
    return _collect(params, setup, observed, flights, errors, _Words(source, why), (rest, settled), spring=spring)


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
    if 0.0 < params["restitution"] < 1.0 and complete:
        above = rest_level(params)
        scalars["rest_time"] = float(top[-1] + math.sqrt(2.0 * (height[-1] - above) / g))
        # As late as the flight, and as its parabola, met at the level with this slope, is high.
        steep = math.sqrt(2.0 * g * (height[-1] - above))
        atol["rest_time"] = dt + errors[-1].time + errors[-1].speed / g + atol[f"apex_{len(height) - 1}"] / steep
    if (
        params["restitution"] < 1.0
        and setup.numerics.n_steps * dt > 1.1 * float(flights.land[-1])
        and _still(setup, spring=spring)
    ):
        scalars["gap_final"], atol["gap_final"] = at_rest
    energy = mass * (0.5 * vy**2 + g * gap)
    return Truth({"gap": gap, "vy": vy, "energy": energy}, scalars, atol, words.source, words.why)


def _still(setup: Setup, *, spring: bool) -> bool:
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

    Free flight is exact. Each contact changes the speed by what `ninedisk.harness.cases.impact._impact.binding_impact` derives, relative to
    it; the weight adds its own share, ``g dt`` at either end, where it is at work for a part of a step with or without the spring.
    The contact's length is uncertain by a step and a half, and flights by twice the error of the speed over g.
    """
    law, g = setup.scene.walls[0].law, params["g"]
    contact_dt, phase = setup.numerics.contact_dt or setup.numerics.dt, _phase(setup)
    damped = 2.0 * law.beta * phase
    relative = phase**2 / 8.0 * (1.0 + phase**2) + damped * (1.0 + damped)
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
    plane, the speed is off by ``g dt/2``. An impact of speed w sees a gap between ``-w dt`` and ``w dt``, that is a speed off by
    ``g dt``, and takes place before or after the step's own ``g dt``. What leaves does so from a place that is again up to ``w dt``
    off, or e w dt where the overlap is put right: for its speed e w, that is ``g dt/e``, or ``g dt``. A step's time is lost at
    either end. A soft contact lets through a part of each impulse.
    """
    g, dt, e = params["g"], setup.numerics.dt, params["restitution"]
    steps = setup.numerics.n_steps
    largest = math.sqrt(2.0 * g * params["height"])
    rounding = 1e-12 * largest + single(engine, largest, steps)
    speed, time = 0.5 * g * dt + rounding, 0.0
    found = [Errors(speed, time)]
    for k in range(1, len(flights.leave)):
        time += speed / g + dt
        missed = (1.0 + e) * softness(engine) * float(flights.speed[k]) / e
        speed = e * (speed + 2.0 * g * dt) + g * dt / e + 0.5 * g * dt + missed + rounding
        found.append(Errors(speed, time))
        time += speed / g
    return found


def _landed(params: Mapping[str, Any], setup: Setup) -> float:
    """Overlap or height [m] of a disk at rest: what the last landing leaves.

    A plastic one may see the whole way of its step. Others go on until the speed that `_step_errors` adds to each bounce is all
    there is: ``u = e u + c g dt``, ``c = 2 e + 1/e + 1/2``.
    """
    g, dt, e = params["g"], setup.numerics.dt, params["restitution"]
    if e == 0.0:
        return float(dt * (math.sqrt(2.0 * g * params["height"]) + g * dt))
    if e == 1.0:
        return math.inf
    last = (2.0 * e + 1.0 / e + 0.5) * g * dt / (1.0 - e)
    return float(max(last * dt, last**2 / (2.0 * g)))


class Stepped(NamedTuple):
    """Gap and velocity of the exact steps at the samples, NaN once rounding has grown too far, and absolute tolerances by name."""

    curves: Mapping[str, FloatArray]
    atol: Mapping[str, float]


def exact_curves(params: Mapping[str, Any], setup: Setup, observed: Observed) -> Stepped:
    """The theta scheme's exact steps, as far as an engine can follow them.

    Theta's own impact law depends on where in a step the impact falls: a gap that is off by delta changes the speed by
    ``delta/(theta dt)``, which a flight of n steps turns into a gap off by ``n delta/theta``. The rounding of positions therefore
    grows by some hundred times with every bounce. Steps after an impact count as long as that bound of the speed stays below
    `FOLLOWED` of the largest speed. Newton's law does not depend on the phase, and its errors add up only.
    """
    disks, numerics = setup.scene.disks, setup.numerics
    steps = plane_contact_theta(
        mass=float(disks.mass[0]),
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
        summed_round_off(size, float(first[0]) if len(first) else numerics.n_steps),
    )
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
    return Stepped(curves, atol)
