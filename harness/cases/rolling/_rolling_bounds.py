"""How far schemes, springs and soft contacts may take a disk on an incline from the continuous solution, derived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ninedisk.harness.api.case import Observed, Setup
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
from ninedisk.harness.cases.incline._incline_bounds import chatters
from ninedisk.references.analytic.rolling_incline import RollRates
from ninedisk.references.analytic.slip_to_roll import UNIFORM_DISK

PER_SLIP = 1.0 + 1.0 / UNIFORM_DISK
"""Change of the slip that friction makes together with a unit change of the velocity."""


class RollBounds(NamedTuple):
    """Absolute tolerances by quantity and their reasons, the gap at rest [m], and whether forces are bound step by step."""

    atol: Mapping[str, float]
    why: Mapping[str, str]
    rest_gap: float
    forces: bool = True


def roll_bounds(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, rates: RollRates
) -> RollBounds:
    """Tolerances of the continuous solution for this engine."""
    if engine.contact == "spring":
        return _springs(params, setup, observed, rates)
    return _rigid(params, setup, observed, engine, rates)


def _spread(setup: Setup, *, x: float, vx: float, gap: float, fn: float, fs: float) -> dict[str, float]:
    """Tolerances by quantity; what friction does to vx it does to spin and slip, by ``1/(k R)`` and ``1 + 1/k``."""
    radius = float(setup.scene.disks.radius[0])
    spin = vx / (UNIFORM_DISK * radius)
    return {"x": x, "vx": vx, "spin": spin, "slip": PER_SLIP * vx, "gap": gap, "fn": fn, "fs": fs}


def _springs(params: Mapping[str, Any], setup: Setup, observed: Observed, rates: RollRates) -> RollBounds:
    """Springs begin in the equilibrium of the accelerated disk, and central differences are exact for constant rates.

    What remains is round-off (see `ninedisk.harness.cases.incline._incline_bounds.spring_bounds`) and the arm of the friction: R, or
    within the overlap. An arm ``R - overlap/2`` turns the disk, and so every rate, by overlap/R at most.
    """
    law, radius = setup.scene.walls[0].law, float(setup.scene.disks.radius[0])
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    t_end = float(observed.t[-1])
    steps = t_end / contact_dt
    overlap = rates.fn / law.kn
    arm = overlap / radius
    v_max = rates.along * t_end
    rounding = (1.0 + params["mu"]) * round_off_speed(radius, contact_dt) + summed_round_off(v_max, steps)
    speed = rounding + arm * v_max
    length = 8.0 * float(np.spacing(radius))
    force = law.kn * length + 1e-13 * rates.fn
    atol = _spread(
        setup,
        x=speed * t_end + summed_round_off(v_max * t_end / 2.0, steps),
        vx=speed,
        gap=length,
        fn=force,
        # A rolling disk's shear spring keeps the sum of the slip's rounding errors, and swings about what the arm makes of it.
        fs=(params["mu"] + law.ks / law.kn) * force + 2.0 * arm * rates.fs + law.ks * rounding * contact_dt,
    )
    why = f"constant rates, exact in the scheme: round-off; lever arm within the overlap, {arm:.2g} of R"
    return RollBounds(atol, dict.fromkeys(atol, why), -overlap)


def _rigid(
    params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo, rates: RollRates
) -> RollBounds:
    """Rigid contacts: exact velocities, positions summed from one end of each step, and what dilation adds.

    The associated rule at theta = 1 ends every sliding step with ``gap = mu slip dt``. The normal velocity is then ``mu`` times
    the growth of the slip in a step; its momentum comes from the plane, mu times it from friction. A convex model that
    detects contacts by overlap leaves the plane and lands again: `ninedisk.harness.cases.incline._incline_bounds.chatter_bounds`, the
    slip in place of the block's velocity.
    """
    mu, dt, mass = params["mu"], setup.numerics.dt, float(setup.scene.disks.mass[0])
    g, t_end, kn = params["g"], float(observed.t[-1]), setup.scene.walls[0].law.kn
    slip = rates.slip * t_end
    associated = engine.contact == "cd" and follows_associated_rule(engine, setup.numerics)
    lift = mu * rates.slip * dt if associated else 0.0
    speed = g * slack_time(engine, dt, t_end) + single(engine, g * t_end, setup.numerics.n_steps)
    weight = mass * g
    force = softness(engine) * weight + single(engine, weight, 1) + 1e-10 * weight + mass * lift / dt
    # A contact that gives way lets the disk sink, and friction then acts on a shorter arm.
    yields = rates.fn / kn if engine.keeps_kn else 0.0
    arm = (speed * t_end + yields) / float(setup.scene.disks.radius[0])
    vx = mu * lift + 1e-12 + speed + arm * rates.along * t_end
    depth = 0.0
    chatter = chatters(engine) and rates.slip > 0.0
    if chatter:
        fall = g * math.cos(math.radians(params["angle_deg"])) * dt
        hop = mu * (slip + PER_SLIP * mu * fall)
        depth = (fall + hop) * dt + hop**2 / (2.0 * fall / dt)
        vx += mu * (fall + 2.0 * hop)
        force += 2.0 * mass * (fall + hop) / (0.5 * t_end)
    atol = _spread(
        setup,
        x=rates.along * t_end * dt / 2.0 + vx * t_end + mu * depth,
        vx=vx,
        gap=mu * slip * dt * associated + 1e-12 + speed * t_end + yields + depth,
        fn=force,
        fs=force + 2.0 * arm * rates.fs + rolling_round_off(engine, rates, mass, dt, t_end),
    )
    rule = "; dilation of the associated rule" if associated or chatter else ""
    rule += "; overlap of the weight over kn" if yields else ""
    rule += soft_reason(engine) + ("; single precision" if engine.precision == "float32" else "")
    why = dict.fromkeys(atol, "constant rates: exact velocities, round-off" + rule)
    why |= {"x": "first order in dt: a t dt/2" + rule, "gap": "rigid contact: round-off" + rule}
    return RollBounds(atol, why, 0.0, forces=not chatter)


def rolling_round_off(engine: EngineInfo, rates: RollRates, mass: float, dt: float, t_end: float) -> float:
    """Force [N] of the last bits of velocity and spin in a step, single precision: rolling takes the slip between them away.

    The slip is the difference of two velocities of the size that the disk has reached, each rounded, and the impulse is what it
    takes to end it, ``m/(1 + 1/k)`` times the slip.
    """
    if rates.slip > 0.0:
        return 0.0
    return single(engine, rates.along * t_end, 1) * mass / (PER_SLIP * dt)
