"""Particle dragged along a plane in the static limit (appendix A.3.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import CONTACT_DYNAMICS
from ninedisk.harness.cases.sliding.figures import QUASISTATIC_CLAIMS, QUASISTATIC_FIGURES
from ninedisk.harness.cases.sliding.scene import MASS, PAIR, RADIUS, observe_particle, particle_on_plane
from ninedisk.references.exact_steps.sliding import quasistatic_sliding

ROUND_OFF = 1e-9
"""Of the rise and of the load: residual of the contact solver (1e-12) and of the static balance (1e-10)."""


class QuasistaticSliding:
    """Equal tangential displacements are imposed on a particle that a constant load presses on a plane.

    The associated rule lifts the particle by ``mu`` times the increment, once. With Coulomb's law it stays on the plane.
    """

    id = "sliding/quasistatic"
    version = 1
    title = "Sliding rule, static limit"
    source = "appendix A.3.1, (A.2)"
    requirement = "the first increment lifts the particle by mu du_T, later ones by nothing"
    figures = QUASISTATIC_FIGURES
    claims = QUASISTATIC_CLAIMS
    parameters: tuple[Parameter, ...] = (
        Parameter(name="mu", default=0.3, low=0.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter.positive("increment", 0.001, unit="m", in_id=True, help="tangential displacement of each step"),
        Parameter(name="steps", default=5, low=2, whole=True, help="number of increments"),
        Parameter.positive("normal_load", 10.0, unit="N", help="force onto the plane, constant"),
        Parameter(name="gap_0", default=0.0, low=0.0, unit="m", help="gap before the first increment"),
        *(parameter for parameter in CONTACT_DYNAMICS if parameter.name != "impact"),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Two increments, a rougher plane, a gap at the start, and Coulomb's law."""
        return (
            {"mu": 0.3, "increment": 0.001},
            {"mu": 0.3, "increment": 0.0001},
            {"mu": 1.2, "increment": 0.001},
            {"mu": 0.3, "increment": 0.001, "gap_0": 0.0005},
            {"mu": 0.3, "increment": 0.001, "sliding": "coulomb"},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """One disk whose motion along the plane is prescribed; a step takes one second, which has no meaning."""
        scene = particle_on_plane(
            params,
            gap=params["gap_0"],
            velocity=params["increment"],
            held=True,
            gravity=params["normal_load"] / MASS,
        )
        numerics = Numerics(
            dt=1.0,
            n_steps=params["steps"],
            regime="quasi-static",
            sliding=params["sliding"],
            solver=params["solver"],
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Way, gap, forces and the rises of the first two increments."""
        return observe_particle(setup, history)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Coulomb's law does not dilate: the particle stays on the plane, and the plane holds it by ``mu`` times the load."""
        steps = setup.numerics.n_steps
        source = "Coulomb's law, equilibrium"
        return (
            Headline(name="lift of the sliding particle", use="sliding", quantity="gap_final", expected=0.0, source=source,
                     scale=params["increment"] * steps, scale_is="distance along the plane"),
            Headline(name="friction force", use="sliding", quantity="fs", expected=params["mu"] * params["normal_load"],
                     source=source, scale=params["normal_load"], scale_is="load", window=(steps, steps)),
        )  # fmt: skip

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """Exact increments of the rule that the engine follows."""
        associated = engine.contact == "cd" and params["sliding"] == "associated"
        steps = quasistatic_sliding(
            mu=params["mu"],
            increment=params["increment"],
            n_steps=setup.numerics.n_steps,
            normal_load=params["normal_load"],
            gap_0=params["gap_0"],
        )
        gap = steps.gap if associated else np.where(observed.step == 0, params["gap_0"], 0.0)
        source = "(A.2): gap = mu du_T after every increment" if associated else "Coulomb's law: no dilation"
        length = ROUND_OFF * max(params["mu"] * params["increment"], params["gap_0"]) + 8.0 * float(np.spacing(RADIUS))
        of_gap = "round-off of the height, a metre, and the residual of the solver"
        of_force = "equilibrium: residual of the solver and of the static balance"
        expected = {"x": steps.x, "gap": gap, "fn": steps.fn, "fs": steps.fs}
        atol = {
            "x": ROUND_OFF * float(steps.x[-1]),
            "gap": length,
            "fn": ROUND_OFF * params["normal_load"],
            "fs": ROUND_OFF * params["mu"] * params["normal_load"],
        }
        found = [
            Check(quantity=name, norm="max", truth="exact-step", expected=values, source=source, atol=atol[name],
                  why=of_force if name in ("fn", "fs") else of_gap,
                  scale=0.0 if np.any(values) else float(steps.x[-1]))
            for name, values in expected.items()
        ]  # fmt: skip
        rise = np.diff(gap)
        numbers = {"du_y_1": float(rise[0]), "du_y_2": float(rise[1]), "gap_final": float(gap[-1])}
        found += [
            Check(
                quantity=name,
                norm="scalar",
                truth="exact-step",
                expected=value,
                source=source,
                atol=length,
                why=of_gap,
                scale=0.0 if value else float(steps.x[-1]),
            )
            for name, value in numbers.items()
        ]
        return found


CASE = QuasistaticSliding()
