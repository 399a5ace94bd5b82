"""How far an engine's scheme or springs may take the block from the continuous solution, derived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.case import FloatArray, Observed, Setup
from ninedisk.harness.cases._shared import SOFT_TOLERANCE, round_off_speed, summed_round_off
from ninedisk.harness.engine import EngineInfo
from ninedisk.references.analytic.incline import acceleration, critical_mu

NAMES = ("x", "vx", "gap", "fn", "fs")

SETTLING = 40.0
"""Time in units of 1/omega after which a critically damped contact is in equilibrium to round-off: 41 exp(-40) =
2e-16."""


class Bounds(NamedTuple):
    """Absolute tolerances by quantity with their reasons.

    ``rest_gap`` is the gap at rest [m]; ``forces_from`` marks the samples at which forces are compared, shape (s,), and
    ``settled_only`` says that the gap is compared at those only. Of the second half of the run, ``creep`` is the way
    [m] that a stuck block may make, ``force`` the error of fs and fn together [N] and ``gain`` that of vx [m/s].
    """

    atol: Mapping[str, float]
    why: Mapping[str, str]
    rest_gap: float
    forces_from: NDArray[np.bool_]
    settled_only: bool
    creep: float
    force: float
    gain: float


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

    From the exact steps of the four known schemes: position-first and semi-implicit Euler ``-+ a t dt/2``, theta scheme
    ``(2 theta - 1) a t dt/2``, associated rule ``a t dt (1/2 - mu^2)``, velocity ``-a mu^2 dt``, gap ``mu dt vx``,
    first force ``m mu a`` above its final value.
    """
    numerics, mu, mass = setup.numerics, params["mu"], params["mass"]
    angle, dt = math.radians(params["angle_deg"]), setup.numerics.dt
    steps = setup.numerics.sampled_steps()
    t_end = float(steps[-1]) * dt
    a = acceleration(mu=mu, angle=angle, g=params["g"])
    weight = mass * params["g"]
    associated = engine.contact == "cd" and numerics.sliding == "associated"
    lift = 1.0 if associated else 0.0
    atol = {
        "x": a * t_end * dt * (0.5 + lift * mu**2),
        "vx": a * mu**2 * dt * lift,
        "gap": mu * dt * a * t_end * lift,
        "fn": mass * mu * a * lift,
        "fs": mu * mass * mu * a * lift,
    }
    floor = {"x": 1e-12 * t_end, "vx": 1e-12, "gap": 1e-12, "fn": 1e-10 * weight, "fs": 1e-10 * weight}
    soft = SOFT_TOLERANCE if engine.contact == "soft" else 0.0
    scale = {"x": params["g"] * t_end**2, "vx": params["g"] * t_end, "gap": 0.5, "fn": weight, "fs": weight}
    atol = {name: atol[name] + floor[name] + soft * scale[name] for name in NAMES}
    rule = "; dilation of the associated rule" if associated else ""
    why = {
        "x": "first order in dt: a t dt/2" + rule,
        "vx": "constant acceleration: exact velocities, round-off" + rule,
        "gap": "rigid contact: round-off" + rule,
        "fn": "equilibrium: round-off of the contact solver" + rule,
        "fs": "equilibrium: round-off of the contact solver" + rule,
        "creep": "a rigid contact that sticks does not move: round-off of the steps",
    }
    if soft:
        why = dict.fromkeys(why, "contact soft in a way of its own: 1 % of gravity's effect")
    creep = 1e-12 * t_end + soft * scale["x"]
    # Step-mean forces have no value before the first step.
    return Bounds(
        atol, why, 0.0, np.asarray(steps > 0), False, creep=creep, force=atol["fs"] + atol["fn"], gain=atol["vx"]
    )
