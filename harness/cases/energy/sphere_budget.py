"""Spheres in a box that a wall squeezes: where their energy goes, channel by channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.law import SphereLaw, damping_ratio
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.harness.api.case import Parameter, Setup, SphereSetup, Value
from ninedisk.harness.cases.energy.budget import (
    DENSITY,
    GRAVITY,
    PITCH,
    RADII,
    RESTITUTION,
    SPEED,
    SQUEEZE,
    STATE,
    WORDS,
    Budget,
)
from ninedisk.harness.results.figures import Figure, Plotted
from ninedisk.references.analytic.impact.hertz import hertz_impact

LOSSES, OWN = ("friction_loss", "dashpot_loss"), ("law_loss",)
"""Channels of spheres; what the law of the shear spring takes as the contact radius changes may be of either sign."""
CHANNELS = {name: WORDS[name] for name in (*STATE, *LOSSES)} | {"law_loss": "taken by the shear spring's law"}
SIDE, LAYERS = 2, 4
E_STAR, G_STAR = 1e6, 4e5
KN = 3e4


class SphereBudget(Budget):
    """As `Budget`, of spheres, whose shear springs change their stiffness with the contact: what that takes or feeds is a channel too."""

    id = "spheres/budget"
    title = "Energy budget of squeezed spheres"
    beside_headlines = (
        (
            "*",
            "a heap has no closed form but its balance: a wrong law whose energies balance moves no number that is known",
        ),
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="contacts", default="hertz", choices=("hertz", "linear"), in_id=True,
            help="Hertz-Mindlin, or linear springs",
        ),
        Parameter(
            name="unloading", default="force", choices=("none", "force", "rescale"), in_id=True,
            help="shear spring of Hertz-Mindlin while the contact radius changes",
        ),
        *(replace(each, default=2e-5) if each.name == "dt" else each for each in Budget.parameters if each.name in ("mu", "dt")),
        Parameter(name="duration", default=0.5, low=0.0, low_open=True, high=10.0, unit="s", help="length of the run"),
    )  # fmt: skip
    losses, own = LOSSES, OWN
    dimension = 3
    figures: tuple[Figure, ...] = (
        replace(
            Budget.figures[0],
            quantities=(
                *(Plotted(f"energy_{name}", words) for name, words in CHANNELS.items()),
                Plotted("energy_wall_work", WORDS["wall_work"], "-"),
            ),
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """The three rules of unloading, and linear springs."""
        return [{}, {"unloading": "none"}, {"unloading": "rescale"}, {"contacts": "linear"}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Layers of unequal spheres, apart from each other, which fly at random."""
        stiff: dict[str, Any] = (
            {"kn": KN, "ks": 0.5 * KN} if params["contacts"] == "linear" else {"e_star": E_STAR, "g_star": G_STAR}
        )
        law = SphereLaw(mu=params["mu"], beta=damping_ratio(RESTITUTION), unloading=params["unloading"], **stiff)
        rng = np.random.default_rng(7)
        cells = np.stack(np.meshgrid(range(SIDE), range(SIDE), range(LAYERS), indexing="ij"), axis=-1).reshape(-1, 3)
        x = PITCH * (cells + np.array([0.55, 0.55, 0.6]))
        radius = np.resize(np.array(RADII), len(x))
        width, squeeze = PITCH * (SIDE + 0.1), PlaneSegment(duration=SQUEEZE, velocity=(-0.25 * SPEED, 0.0, 0.0))
        walls = [
            PlaneWall(name=name, point=point, normal=normal, law=law, motion=(squeeze,) if name == "right" else ())
            for name, point, normal in (
                ("floor", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
                ("left", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
                ("right", (width, 0.0, 0.0), (-1.0, 0.0, 0.0)),
                ("front", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
                ("back", (0.0, width, 0.0), (0.0, -1.0, 0.0)),
            )
        ]
        spheres = Spheres(
            x=x, v=rng.normal(0.0, 0.5, x.shape), omega=rng.normal(0.0, 3.0, x.shape), radius=radius,
            mass=10.0 * DENSITY * 4.0 / 3.0 * np.pi * radius**3,
        )  # fmt: skip
        scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=tuple(walls), gravity=(0.0, 0.0, -GRAVITY))
        dt = params["dt"]
        steps = max(1, round(params["duration"] / dt))
        numerics = Numerics(
            dt=dt, n_steps=steps, contact_dt=dt, sample_every=max(1, steps // 300), energy_budget=True
        , impact="newton", sliding="coulomb")  # fmt: skip
        return SphereSetup(scene=scene, numerics=numerics, watch=())

    def rate(self, scene: SphereScene) -> float:
        """As in the plane; of Hertz' contact that of half its impact at the speed of all the energy per sphere."""
        law, spheres = scene.sphere_sphere, scene.spheres
        if not law.hertz:
            return super().rate(scene)
        speed = 2.0 * np.sqrt(2.0 * GRAVITY * float(spheres.x[:, 2].max()))
        mass, radius = float(spheres.mass.min()), 0.5 * float(spheres.radius.min())
        hit = hertz_impact(e_star=law.e_star, radius=radius, mass=0.5 * mass, speed=speed)
        return float(np.pi / hit.duration)


CASE = SphereBudget()
