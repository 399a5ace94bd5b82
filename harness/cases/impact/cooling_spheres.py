"""Cooling gas in space: Haff's law of inelastic spheres."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.law import SphereLaw, damping_ratio
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import Check, FloatArray, KnownDifference, Observed, Setup, SphereSetup, Value
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.cases.common import CONTACT_DYNAMICS, whole_steps
from ninedisk.harness.cases.differences import FINDING_WORDS
from ninedisk.harness.cases.impact.cooling import CoolingGas, law_at_end, own_step
from ninedisk.harness.cases.impact.gas import MASS, RADIUS
from ninedisk.references.analytic.impact.spring_dashpot import restitution_of_beta

CHANGED = {"rows": 4, "spacing": 4.2, "duration": 2.0}
"""64 spheres that fill 6 % of a cube."""
MOST_ROWS = 9
"""729 spheres are mixed in a second; of a cube of 12 rows, 1,728, it takes four."""


class CoolingSpheres(CoolingGas):
    """As `CoolingGas`, of spheres in a cube."""

    id = "spheres/cooling"
    title = "Cooling gas of inelastic spheres"
    source = "Haff (1983), J. Fluid Mech. 134, 401; collision rate of dense spheres: Enskog, Carnahan & Starling (1969)"
    requirement = CoolingGas.requirement.replace("disk", "sphere")
    figures = tuple(replace(each, allows=each.allows.replace("disk", "sphere")) for each in CoolingGas.figures)
    parameters = tuple(
        replace(
            each,
            default=CHANGED.get(each.name, each.default),
            high=MOST_ROWS if each.name == "rows" else each.high,
            help=each.help.replace("disk", "sphere"),
        )
        for each in CoolingGas.parameters
        if each.name not in {known.name for known in CONTACT_DYNAMICS}
    )
    dimension = 3
    claims = (
        replace(
            CoolingGas.claims[0],
            id="haffs-law-of-spheres",
            text="T = T0/(1 + t/t0)^2 with 1/t0 = (1 - e^2) times a sixth of the rate of collisions.",
            decided_by=CoolingGas.claims[0].decided_by.replace("disk", "sphere"),
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Two seeds: the least of which a mean has an error."""
        return [{"seed": 1}, {"seed": 2}]

    def setup(self, params: Mapping[str, Any], x: FloatArray, v: FloatArray) -> Setup:
        """The spheres in their cube; dashpots may pull, as the damping ratio has it."""
        kn, e, n, side = params["kn"], params["restitution"], len(x), params["rows"] * params["spacing"]
        elastic = SphereLaw(kn=kn, restitution=1.0, regularised=True)
        walls = [
            PlaneWall(
                name=f"{name} {axis}",
                point=(at, at, at),
                normal=tuple(sign * float(k == c) for c in range(3)),  # type: ignore[arg-type]
                law=elastic,
            )
            for k, axis in enumerate("xyz")
            for name, at, sign in (("low", 0.0, 1.0), ("high", side, -1.0))
        ]
        scene = SphereScene(
            spheres=Spheres(x=x, v=v, radius=np.full(n, RADIUS), mass=np.full(n, MASS)),
            sphere_sphere=SphereLaw(kn=kn, beta=damping_ratio(e), restitution=e, regularised=True),
            walls=tuple(walls),
        )
        own = own_step(params) if params["contact_dt"] is None else params["contact_dt"]
        numerics = Numerics(
            dt=params["dt"],
            n_steps=whole_steps(params, params["duration"]),
            contact_dt=own,
            impact="newton",
            sliding="coulomb",
        )
        return SphereSetup(scene=scene, numerics=numerics, watch=(), labels={})

    def checks(
        self, params: Mapping[str, Any], setup: Setup, observed: Observed, engine: EngineInfo
    ) -> Sequence[Check]:
        """As in the plane; with what dashpots that never pull explain: each collision keeps ``e_0^2`` of `restitution_of_beta` for e^2."""
        found = super().checks(params, setup, observed, engine)
        if Difference.DASHPOT_NEVER_PULLS not in engine.differences:
            return found
        e, kept = params["restitution"], restitution_of_beta(setup.scene.law_of_bodies.beta)
        less = kept**2 - e**2
        right = law_at_end(params, setup)
        # The rate is that of 1 - e^2: t/t0 is as much smaller.
        slower = right.elapsed * (1.0 - kept**2) / (1.0 - e**2)
        warmer = -2.0 * math.log1p(slower) - right.expected
        sizes = {
            "loss": less,
            "ln_temperature": warmer,
            "cooling": right.elapsed - slower,
            # Nearer to the first energy than to the last, and at most what is between both laws.
            "energy": math.exp(right.expected) * math.expm1(warmer),
        }
        why = "each collision keeps e_0^2 = exp(-2 c/omega arccos(...)) of a dashpot that is cut off, not e^2"
        words = FINDING_WORDS[Difference.DASHPOT_NEVER_PULLS]
        return [
            replace(check, known=KnownDifference(finding=f"{engine.id}/{words}", size=check.atol + 1.1 * sizes[check.quantity], why=why))
            if check.quantity in sizes
            else check
            for check in found
        ]  # fmt: skip


CASE = CoolingSpheres()
