"""Particle thrown along a plane, a gap above it (appendix A.3.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, TruthKind, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import (
    CONTACT_DYNAMICS,
    EXACT_STEP_RTOL,
    contact_softness,
    contact_step,
    single,
    soft_reason,
)
from ninedisk.harness.cases.differences import follows_associated_rule
from ninedisk.harness.cases.sliding.figures import DYNAMIC_CLAIMS, DYNAMIC_FIGURES
from ninedisk.harness.cases.sliding.scene import KN, MASS, PAIR, RADIUS, observe_particle, particle_on_plane
from ninedisk.references.exact_steps.sliding import SlidingSteps, dynamic_sliding

PHASE = 0.1
"""Resolution of a contact that spring engines would have, were it to close."""


class DynamicSliding:
    """No force acts: the particle flies along the plane at constant speed, and a contact should not notice it.

    The associated rule does notice: a step longer than ``dt_cr = g0/(mu v)`` lifts the particle. ``dt_cr`` is read from the
    observed rise: the step at which (A.4) makes it vanish, or ``dt`` itself, which is then no more than a lower bound, where the
    particle does not rise.
    """

    id = "sliding/dynamic"
    version = 1
    title = "Sliding rule, one dynamic step and on"
    source = "appendix A.3.2, (A.3) to (A.5)"
    requirement = "the first step rises by (mu v dt - g0)/(1 + mu^2) above dt_cr = g0/(mu v), by nothing below"
    figures = DYNAMIC_FIGURES
    claims = DYNAMIC_CLAIMS
    parameters: tuple[Parameter, ...] = (
        Parameter.positive("dt", 0.01, unit="s", in_id=True, help="step"),
        Parameter(name="g0", default=0.001, low=0.0, unit="m", in_id=True, help="gap at time 0"),
        Parameter.positive("mu", 0.3, unit="-", help="friction coefficient"),
        Parameter.positive("speed", 1.0, unit="m/s", help="velocity along the plane"),
        Parameter(name="steps", default=5, low=2, whole=True, help="number of steps"),
        *(parameter for parameter in CONTACT_DYNAMICS if parameter.name != "impact"),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Steps on both sides of dt_cr = 3.33 ms, no gap at all, and Coulomb's law."""
        return (
            {"dt": 0.001, "g0": 0.001},
            {"dt": 0.005, "g0": 0.001},
            {"dt": 0.01, "g0": 0.001},
            {"dt": 0.01, "g0": 0.0},
            {"dt": 0.01, "g0": 0.001, "sliding": "coulomb"},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk above a plane, thrown along it; no gravity."""
        scene = particle_on_plane(params, gap=params["g0"], velocity=params["speed"], held=False, gravity=0.0)
        numerics = Numerics(
            dt=params["dt"],
            n_steps=params["steps"],
            contact_dt=contact_step(params["dt"], PHASE / math.sqrt(KN / MASS)),
            sliding=params["sliding"],
            solver=params["solver"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Way, gap, forces, first rises, and the critical step that the first rise implies."""
        found = observe_particle(setup, history)
        mu, rise = params["mu"], found.scalars["du_y_1"][1]
        implied = params["dt"] - rise * (1.0 + mu**2) / (mu * params["speed"])
        series = {**found.series, "vx": ("m/s", history.v[:, 0, 0]), "vy": ("m/s", history.v[:, 0, 1])}
        scalars = {**found.scalars, "dt_cr": ("s", implied)}
        return Observed(step=found.step, t=found.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """No force acts, so the particle keeps its height and its speed; the associated rule lifts it."""
        return (
            Headline(
                name="lift of the sliding particle",
                use="sliding",
                quantity="gap_final",
                expected=params["g0"],
                source="Newton's first law",
                scale=params["speed"] * float(observed.t[-1]),
                scale_is="distance along the plane",
            ),
            Headline(
                name="distance along the plane",
                use="sliding",
                quantity="x_final",
                expected=params["speed"] * float(observed.t[-1]),
                source="Newton's first law",
                scale=params["speed"] * float(observed.t[-1]),
                scale_is="distance along the plane",
            ),
        )

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact steps of the associated rule, or free flight for all who do not dilate.

        A convex engine that finds contacts by their overlap at a step's begin follows the rule from a start in touch, and sees no
        contact at all across a gap.
        """
        associated = follows_associated_rule(engine, setup.numerics) and (engine.contact == "cd" or params["g0"] == 0.0)
        truth: TruthKind = "exact-step" if associated else "analytic"
        source = "(A.3) to (A.5), every step" if associated else "Coulomb's law: no load, no contact force"
        steps = _steps(params, setup, associated)
        distance = params["speed"] * float(observed.t[-1])
        # Without a load there is nothing that a soft contact could let through, but for the rule that lifts what slides.
        soft, count = contact_softness(engine) if associated else 0.0, setup.numerics.n_steps
        of_speed = single(engine, params["speed"], count)
        # A velocity is rounded in each step; a height is the radius and more, kept to one unit in the last place.
        height = 8.0 * float(np.spacing(RADIUS + params["g0"])) + single(engine, RADIUS + params["g0"], count)
        length = (
            height
            + EXACT_STEP_RTOL * float(np.abs(steps.gap).max())
            + soft * distance
            + of_speed * float(observed.t[-1])
        )
        speed = EXACT_STEP_RTOL * params["speed"] + soft * params["speed"] + of_speed
        impulse = MASS * params["speed"] / params["dt"]
        force = EXACT_STEP_RTOL * (float(np.nanmax(steps.fn)) or impulse)
        force += soft * impulse + single(engine, impulse, 1)
        why = "round-off: of a height of a metre, of the solver's residual" + (soft_reason(engine) if soft else "")
        if of_speed:
            why += "; single precision"
        atol = {
            "x": (EXACT_STEP_RTOL + soft) * distance
            + single(engine, distance, count)
            + of_speed * float(observed.t[-1]),
            "gap": length,
            "vx": speed,
            "vy": speed,
            "fn": force,
            "fs": force,
        }
        after = observed.step > 0
        expected = {
            name: np.where(after, getattr(steps, name)[observed.step], np.nan)
            if name in ("fn", "fs")
            else getattr(steps, name)[observed.step]
            for name in atol
        }
        # A lift that should not be is one over the displacement along the plane, a force that should not be one that stops the particle.
        sizes = {"gap": distance, "vy": params["speed"], "fn": impulse, "fs": impulse}
        found = [
            Check(quantity=name, norm="max", truth=truth, expected=values, source=source, atol=atol[name], why=why,
                  scale=0.0 if np.nan_to_num(values).any() else sizes.get(name, 0.0))
            for name, values in expected.items()
        ]  # fmt: skip
        rise = np.diff(steps.gap)
        critical = params["g0"] / (params["mu"] * params["speed"]) if rise[0] > 0.0 else params["dt"]
        found.append(
            Check(quantity="dt_cr", norm="scalar", truth=truth, expected=critical, source=source, why=why,
                  scale=params["dt"], atol=2.0 * length * (1.0 + params["mu"] ** 2) / (params["mu"] * params["speed"])),
        )  # fmt: skip
        numbers = {"du_y_1": float(rise[0]), "du_y_2": float(rise[1]), "gap_final": float(steps.gap[-1])}
        found += [
            Check(quantity=name, norm="scalar", truth=truth, expected=value, source=source, atol=length, why=why,
                  scale=0.0 if value else distance)
            for name, value in numbers.items()
        ]  # fmt: skip
        return found


def _steps(params: Mapping[str, Any], setup: Setup, associated: bool) -> SlidingSteps:
    """Steps of the associated rule; the limit mu = 0 of the same solution is free flight."""
    return dynamic_sliding(
        mu=params["mu"] if associated else 0.0,
        g0=params["g0"],
        speed=params["speed"],
        dt=setup.numerics.dt,
        mass=MASS,
        n_steps=setup.numerics.n_steps,
    )


CASE = DynamicSliding()
