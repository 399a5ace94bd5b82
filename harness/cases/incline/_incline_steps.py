"""Exact time-discrete truths of the block on an incline, by the engine's scheme."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ninedisk.harness.api.case import Check, Observed, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import EXACT_STEP_RTOL, series_and_final, single
from ninedisk.harness.cases.incline._incline_bounds import NAMES
from ninedisk.references.exact_steps.incline import (
    InclineSteps,
    associated_incline,
    coulomb_incline_theta,
    position_first_euler_incline,
    semi_implicit_euler_incline,
)


def exact_step_checks(params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo) -> list[Check]:
    """Every quantity against the exact steps of the engine's scheme; none where no closed form is known."""
    steps, scheme = _scheme_solution(params, setup, engine)
    if steps is None:
        return []
    expected = {name: getattr(steps, name)[observed.step] for name in NAMES}
    why = "exact solution of this very scheme: round-off of the steps"
    touch = "a length of a metre, rounded"
    speed = params["g"] * float(observed.t[-1])
    if engine.precision == "float32":
        why, touch = f"{why} in single precision", f"{touch} in single precision"
    count, weight = setup.numerics.n_steps, params["mass"] * params["g"]
    of_speed, of_force = single(engine, speed, count), single(engine, weight, 1)
    way = of_speed * float(observed.t[-1])
    tolerance = {
        "x": (1e-15 * speed + way, EXACT_STEP_RTOL, why),
        "vx": (1e-15 * speed + of_speed, EXACT_STEP_RTOL, why),
        "gap": (1e-12 + way, EXACT_STEP_RTOL, touch),
        "fn": (of_force, EXACT_STEP_RTOL, why),
        "fs": (of_force, EXACT_STEP_RTOL, why),
    }
    return series_and_final(NAMES, expected, truth="exact-step", source=scheme, tolerance=tolerance)


def _scheme_solution(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> tuple[InclineSteps | None, str]:
    """Exact steps of the engine's scheme and their name; None where no closed form is known."""
    numerics = setup.numerics
    block = {
        "mu": params["mu"],
        "angle": math.radians(params["angle_deg"]),
        "g": params["g"],
        "mass": params["mass"],
        "dt": numerics.dt,
        "n_steps": numerics.n_steps,
    }
    if engine.contact == "spring":
        return None, ""
    if engine.scheme == "position-first-euler":
        return position_first_euler_incline(**block), "position-first Euler, x = (A.7)(1 - dt/t)"
    if engine.scheme == "semi-implicit-euler":
        return semi_implicit_euler_incline(**block), "semi-implicit Euler, x = (A.7)(1 + dt/t)"
    if engine.scheme == "moreau-jean":
        theta = engine.option("theta", numerics)
        return coulomb_incline_theta(**block, theta=theta), f"Moreau-Jean, theta = {theta:g}, Coulomb"
    if engine.scheme == "theta" and numerics.sliding == "coulomb":
        return coulomb_incline_theta(
            **block, theta=numerics.theta
        ), f"theta scheme, theta = {numerics.theta:g}, Coulomb"
    if engine.scheme == "theta" and numerics.theta == 1.0:
        return associated_incline(**block), "theta scheme, theta = 1, associated sliding rule"
    return None, ""
