"""How far an engine's scheme or springs may take the block from the continuous solution, derived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.case import FloatArray, Observed, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    follows_associated_rule,
    round_off_speed,
    single,
    slack_time,
    soft_reason,
    softness,
    summed_round_off,
)
from ninedisk.references.analytic.incline import acceleration, critical_mu

NAMES = ("x", "vx", "gap", "fn", "fs")

SETTLING = 40.0
"""Time in units of 1/omega after which a critically damped contact is in equilibrium to round-off: 41 exp(-40) =
2e-16."""


class Bounds(NamedTuple):
    """Absolute tolerances by quantity with their reasons.

    ``rest_gap`` is the gap at rest [m]; ``forces_from`` marks the samples at which forces are compared, shape (s,), and
    ``settled_only`` says that the gap is compared at those only. Of the second half of the run, ``creep`` is the way
    [m] that a stuck block may make, ``force`` the error of fs and fn together [N] and ``gain`` that of vx [m/s]. Where
    ``chatter`` [N] is not zero, forces are not compared step by step but as means over that half, which it bounds.
    """

    atol: Mapping[str, float]
    why: Mapping[str, str]
    rest_gap: float
    forces_from: NDArray[np.bool_]
    settled_only: bool
    creep: float
    force: float
    gain: float
    chatter: float = 0.0


def spring_bounds(params: Mapping[str, Any], setup: Setup, observed: Observed) -> Bounds:
    """Engines with contact springs.

    With preload the scheme is exact for the block's constant acceleration; what remains is round-off. The overlap is
    the difference of the height and the radius, known to a few units in the last place of the radius, so that fn is
    uncertain by kn times that, and velocities by `round_off_speed`.
    """
    law, disks = setup.scene.walls[0].law, setup.scene.disks
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    radius, mass = float(disks.radius[0]), params["mass"]
    angle = math.radians(params["angle_deg"])
    pull = params["g"] * math.sin(angle)
    normal = mass * params["g"] * math.cos(angle)
    t_end = float(observed.t[-1])
    steps = t_end / contact_dt
    length = 8.0 * float(np.spacing(radius))
    v_max = acceleration(mu=params["mu"], angle=angle, g=params["g"]) * t_end
    speed = (1.0 + params["mu"]) * round_off_speed(radius, contact_dt) + summed_round_off(v_max, steps)
    way = speed * t_end + summed_round_off(v_max * t_end / 2.0, steps)
    force = law.kn * length + 1e-13 * normal
    atol = {"x": way, "vx": speed, "gap": length, "fn": force, "fs": (params["mu"] + law.ks / law.kn) * force}
    exact = "constant acceleration, exact in the scheme; round-off of the overlap times kn"
    why = dict.fromkeys((*NAMES, "creep"), exact)
    after = np.asarray(observed.t > 0.0)
    settled_only = not params["preload"]
    exact_bounds = Bounds(
        atol, why, -normal / law.kn, after, settled_only, creep=way, force=atol["fs"] + atol["fn"], gain=speed
    )
    return (
        exact_bounds if params["preload"] else _without_preload(params, exact_bounds, law.kn, law.ks, pull, observed.t)
    )


def _without_preload(
    params: Mapping[str, Any], exact: Bounds, kn: float, ks: float, pull: float, t: FloatArray
) -> Bounds:
    """Add what the start without preload does to the block.

    Two things delay friction. The shear spring has to be stretched: loaded at once by the driving force F it lets the
    block reach ``F/sqrt(m ks)``. The cap has to rise: a critically damped fn follows ``1 - exp(-tau)(1 - tau)``, tau =
    omega t, and the deficit lets the block gain ``(F/m omega) tau exp(-tau)``, at most 1/e of ``F/sqrt(m kn)``. Omega
    is the lower of the two contact frequencies. A sliding block keeps the velocity; one that should stick loses it at
    ``mu g cos - pull`` and then swings about its place without damping, its force between the cap and as far below the
    driving force.
    """
    mass, mu, angle = params["mass"], params["mu"], math.radians(params["angle_deg"])
    omega = math.sqrt(min(kn, ks) / mass)
    offset = (1.0 + math.exp(-1.0)) * pull / omega
    t_end = float(t[-1])
    settled = np.asarray(t >= SETTLING / omega)
    atol, why = dict(exact.atol), dict(exact.why)
    start = f"start without preload: velocity offset up to (1 + 1/e) F/sqrt(m k) = {offset:.3g} m/s"
    why |= {"x": start, "vx": start, "creep": start, "fs": start}
    atol["vx"] += offset
    spare = params["g"] * (mu * math.cos(angle) - math.sin(angle))
    if mu < critical_mu(angle=angle) or spare <= 0.0:
        atol["x"] += offset * t_end
        return exact._replace(atol=atol, why=why, forces_from=settled)
    stop = offset / spare
    swing = mass * spare
    atol["x"] += offset * min(stop, t_end) + 2.0 * mass * pull / ks
    atol["fs"] += swing
    why["fs"] = "start without preload: the stuck block swings on its shear spring, up to the cap"
    creep = exact.creep + 2.0 * swing / ks + offset * max(stop - t_end / 2.0, 0.0)
    return exact._replace(
        atol=atol,
        why=why,
        forces_from=settled,
        creep=creep,
        force=exact.force + swing,
        gain=exact.gain + swing / math.sqrt(mass * ks) + (offset if stop > t_end / 2.0 else 0.0),
    )


def first_order_bounds(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> Bounds:
    """Rigid contacts: positions off by ``a t dt/2``, and what the associated rule's lift adds.

    From the exact steps of the known schemes: position-first and semi-implicit Euler ``-+ a t dt/2``, theta scheme
    ``(2 theta - 1) a t dt/2``, associated rule ``a t dt (1/2 - mu^2)``, velocity ``-a mu^2 dt``, gap ``mu dt vx``,
    first force ``m mu a`` above its final value. See `chatter_bounds` for convex models that detect contacts by overlap.
    """
    numerics, mu, mass = setup.numerics, params["mu"], params["mass"]
    angle, dt = math.radians(params["angle_deg"]), setup.numerics.dt
    steps = setup.numerics.sampled_steps()
    t_end = float(steps[-1]) * dt
    a = acceleration(mu=mu, angle=angle, g=params["g"])
    weight, kn = mass * params["g"], setup.scene.walls[0].law.kn
    associated = engine.contact == "cd" and follows_associated_rule(engine, numerics)
    lift = 1.0 if associated else 0.0
    slack = slack_time(engine, dt, t_end)
    speed = params["g"] * slack + single(engine, params["g"] * t_end, numerics.n_steps)
    atol = {
        "x": a * t_end * dt * (0.5 + lift * mu**2) + 1e-12 * t_end + speed * t_end,
        "vx": a * mu**2 * dt * lift + 1e-12 + speed,
        "gap": mu * dt * a * t_end * lift + 1e-12 + speed * t_end,
        "fn": mass * mu * a * lift + 1e-10 * weight,
        "fs": mu * mass * mu * a * lift + 1e-10 * weight,
    }
    # An impulse of one step is the small difference of velocities that carry the round-off of one step.
    force = softness(engine) * weight + single(engine, weight, 1)
    atol |= {"fn": atol["fn"] + force, "fs": atol["fs"] + force}
    rule = "; dilation of the associated rule" if associated else ""
    if engine.keeps_kn:
        atol["gap"] += weight / kn
        rule += "; overlap of the weight over kn"
        if not params["preload"]:
            landing = mass * weight / kn / dt**2
            atol |= {"fn": atol["fn"] + landing, "fs": atol["fs"] + mu * landing}
            rule += ", into which the block sinks within a step at the earliest"
    rule += soft_reason(engine) + ("; single precision" if engine.precision == "float32" else "")
    why = {
        "x": "first order in dt: a t dt/2" + rule,
        "vx": "constant acceleration: exact velocities, round-off" + rule,
        "gap": "rigid contact: round-off" + rule,
        "fn": "equilibrium: round-off of the contact solver" + rule,
        "fs": "equilibrium: round-off of the contact solver" + rule,
        "creep": "a rigid contact that sticks does not move: round-off of the steps" + rule,
    }
    # Step-mean forces have no value before the first step.
    bounds = Bounds(
        atol,
        why,
        0.0,
        np.asarray(steps > 0),
        False,
        creep=(1e-12 + speed) * t_end,
        force=atol["fs"] + atol["fn"],
        gain=atol["vx"],
    )
    if engine.friction_lags and not params["preload"]:
        bounds = _first_step_smooth(params, bounds, dt, t_end)
    return chatter_bounds(params, setup, bounds) if chatters(engine) and a > 0.0 else bounds


def _first_step_smooth(params: Mapping[str, Any], bounds: Bounds, dt: float, t_end: float) -> Bounds:
    """Add what a first step without friction does: an offset of the velocity, kept while sliding, braked where it should stick."""
    mu, angle, g = params["mu"], math.radians(params["angle_deg"]), params["g"]
    offset = min(mu * math.cos(angle), math.sin(angle)) * g * dt
    spare = g * (mu * math.cos(angle) - math.sin(angle))
    stop = offset / spare if spare > 0.0 else math.inf
    start = f"friction is bounded by the step before, which has none at the start: velocity offset {offset:.3g} m/s"
    why = {name: text if name in ("gap", "fn") else f"{text}; {start}" for name, text in bounds.why.items()}
    atol = dict(bounds.atol)
    atol["vx"] += offset
    atol["x"] += offset * (min(stop, t_end) + dt)
    late = max(stop - 0.5 * t_end, 0.0) if spare > 0.0 else 0.0
    after = bounds.forces_from.copy()
    after[: int(np.argmax(after)) + 1] = False
    # A block that should stick slides until it has stopped, with friction mu fn instead of the driving force.
    slides = params["mass"] * spare if spare > 0.0 else 0.0
    atol["fs"] += slides
    return bounds._replace(
        atol=atol,
        why=why,
        forces_from=after,
        creep=bounds.creep + offset * late,
        gain=bounds.gain + offset * (late > 0.0),
    )


def chatters(engine: EngineInfo) -> bool:
    """Whether a sliding block of this engine leaves the plane and lands again: a convex model that detects contacts by overlap."""
    return engine.dilates and engine.contact != "cd"


def chatter_bounds(params: Mapping[str, Any], setup: Setup, bounds: Bounds) -> Bounds:
    """Add the flights of a sliding block that leaves the plane and lands again.

    A step in touch gives the block the normal velocity ``mu vx`` at most; one without contact lets it fall freely, by ``g cos
    dt``. As friction is mu times the normal force while the block slides, momentum gives ``vx = a t - mu vy`` at every step;
    a landing may stop the block, which takes from friction ``mu vy`` at most. With a bounded vy the error of vx does not grow,
    and means of the forces are off by the change of m vy alone.
    """
    mu, dt = params["mu"], setup.numerics.dt
    angle = math.radians(params["angle_deg"])
    t_end = float(setup.numerics.n_steps) * dt
    fall = params["g"] * math.cos(angle) * dt
    lift = mu * (acceleration(mu=mu, angle=angle, g=params["g"]) * t_end + mu * fall)
    atol, why = dict(bounds.atol), dict(bounds.why)
    depth = (fall + lift) * dt + lift**2 / (2.0 * params["g"] * math.cos(angle))
    atol["vx"] += mu * (fall + 2.0 * lift)
    atol["x"] += mu * lift * t_end + mu * depth
    atol["gap"] += depth
    impulse = params["mass"] * (fall + lift)
    chatter = f"a sliding contact opens and lands again: normal velocities from {-fall:.3g} to {lift:.3g} m/s"
    why = {name: f"{text}; {chatter}" for name, text in why.items()}
    half = 0.5 * t_end
    return bounds._replace(
        atol=atol, why=why, force=2.0 * (bounds.force + impulse / half), gain=bounds.gain, chatter=impulse / half
    )
