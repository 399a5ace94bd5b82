"""Disks in a box that a wall squeezes: where their energy goes, channel by channel."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.case import Check, FloatArray, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import CONTACT_DYNAMICS, at_observed
from ninedisk.harness.cases.impact.binary import beta_for
from ninedisk.harness.results.figures import Figure, Plotted

RADII = (0.1, 0.08, 0.09)
"""Of the disks of each row, in turn [m]; their mass is that of `DENSITY`."""
DENSITY, GRAVITY, XI = 100.0, 10.0, 0.3
"""[kg/m^2], [m/s^2], [1/s]."""
COLUMNS, ROWS, PITCH = 5, 4, 0.22
SQUEEZE, SPEED = 0.25, 0.8
"""How long a side wall comes in [s], and how fast [m/s]."""
RESTITUTION, BETA = 0.5, 0.15

STATE = ("kinetic", "elastic", "gravity")
LOSSES = ("friction_loss", "dashpot_loss", "impact_loss", "damping_loss")
OWN = ("scheme_loss",)
"""What an implicit scheme loses itself and reports; it may be of either sign."""
FED = ("wall_work", "force_work")
WORDS = {
    "kinetic": "kinetic energy", "elastic": "energy of the contact springs", "gravity": "potential energy",
    "friction_loss": "lost by friction", "dashpot_loss": "lost in dashpots", "impact_loss": "lost in impacts",
    "damping_loss": "lost by global damping", "scheme_loss": "lost by the scheme",
    "wall_work": "work of the wall",
}  # fmt: skip


class Budget:
    """A heap of disks falls into a box, one side wall of which comes in for a while.

    Whatever becomes of the disks, which is chaotic and no matter here, energies and losses together grow by what the wall does. And what
    friction, dashpots, impacts and global damping have taken never comes back: a channel that falls feeds energy. An engine that
    does not report a channel has no balance, and is not judged by it.
    """

    id = "energy/budget"
    version = 1
    title = "Energy budget of a squeezed heap"
    beside_headlines = (
        (
            "*",
            "a heap has no closed form but its balance: a wrong law whose energies balance moves no number that is known",
        ),
    )
    source = "balance of energy; no loss is ever negative"
    losses: tuple[str, ...] = LOSSES
    own: tuple[str, ...] = OWN
    requirement = "energies, losses and works add up at every time, and no loss ever falls"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            name="contacts", default="elastic", choices=("elastic", "rigid"), in_id=True,
            help="springs with dashpots, or rigid contacts with a restitution",
        ),
        Parameter(name="mu", default=0.4, low=0.0, high=2.0, unit="-", in_id=True, help="friction coefficient"),
        Parameter(name="dt", default=1e-4, low=0.0, low_open=True, high=1e-3, unit="s", help="step of every engine"),
        Parameter(name="duration", default=0.6, low=0.0, low_open=True, high=10.0, unit="s", help="length of the run"),
        Parameter(name="theta", default=1.0, low=0.5, high=1.0, unit="-", only_for="cd", help="parameter of the theta scheme"),
        *(replace(each, default="coulomb") if each.name == "sliding" else each for each in CONTACT_DYNAMICS),
    )  # fmt: skip
    figures: tuple[Figure, ...] = (
        Figure(
            title="Where the energy is",
            kind="budget",
            quantities=(
                *(Plotted(f"energy_{name}", WORDS[name]) for name in (*STATE, *LOSSES, *OWN)),
                Plotted("energy_wall_work", WORDS["wall_work"], "-"),
            ),
            shows="Energies and losses of each engine that reports them all, stacked, less the work of the wall: what there was at the "
            "start, wherever it went. The heap falls, is squeezed, and comes to rest.",
            allows="A flat top is a balance that closes. A band that narrows with time where it is a loss feeds energy.",
        ),
    )

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both kinds of contact, with friction and without."""
        return [{"contacts": "elastic"}, {"contacts": "rigid"}, {"contacts": "elastic", "mu": 0.0}]

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Rows of unequal disks, apart from each other, which fly at random."""
        law = _law(params)
        rng = np.random.default_rng(7)
        places = np.array([(PITCH * (i + 0.55), PITCH * (j + 0.6)) for j in range(ROWS) for i in range(COLUMNS)])
        radius = np.resize(np.array(RADII), len(places))
        width, squeeze = PITCH * (COLUMNS + 0.1), WallSegment(duration=SQUEEZE, velocity=(-SPEED, 0.0))
        walls = (
            Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
            Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
            Wall(name="right", point=(width, 0.0), normal=(-1.0, 0.0), law=law, motion=(squeeze,)),
        )
        disks = Disks(
            x=places, v=rng.normal(0.0, 0.5, places.shape), omega=rng.normal(0.0, 3.0, len(places)),
            radius=radius, mass=DENSITY * math.pi * radius**2,
        )  # fmt: skip
        dt = params["dt"]
        steps = max(1, round(params["duration"] / dt))
        numerics = Numerics(
            dt=dt, n_steps=steps, contact_dt=dt, sample_every=max(1, steps // 300), energy_budget=True,
            theta=params["theta"], impact=params["impact"], sliding=params["sliding"], solver=params["solver"],
        )  # fmt: skip
        scene = Scene(disks=disks, disk_disk=law, walls=walls, gravity=(0.0, -GRAVITY), xi=XI)
        return Setup(scene=scene, numerics=numerics, watch=())

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:
        """Energies and losses as the engine reports them, their balance, and how far each loss is below what it was.

        A channel that the scene's physics has not, an engine may leave out: friction where mu is 0, of impacts and dashpots one, and
        forces on disks.
        """
        blank = np.full(len(history.step), np.nan)
        reported = {name: np.asarray(values) for name, values in history.energy.items()}
        if "dashpot_loss" in reported or "impact_loss" in reported:
            reported = {name: np.zeros_like(blank) for name in ("dashpot_loss", "impact_loss")} | reported
        reported = {name: np.zeros_like(blank) for name in ("force_work", *self.own)} | reported
        if params["mu"] == 0.0:
            reported.setdefault("friction_loss", np.zeros_like(blank))
        energy: dict[str, FloatArray] = {
            name: reported.get(name, blank) for name in (*STATE, *self.losses, *self.own, *FED)
        }
        energy["gravity"] = energy["gravity"] - _floor_energy(setup.scene)
        total = sum((energy[name] for name in (*STATE, *self.losses, *self.own)), start=np.zeros_like(blank))
        total = total - sum((energy[name] for name in FED), start=np.zeros_like(blank))
        series = {f"energy_{name}": ("J", values) for name, values in energy.items() if name != "force_work"}
        series["energy_balance"] = ("J", total - total[0])
        for name in self._losses(params):
            series[f"energy_{name}_fed"] = ("J", np.maximum.accumulate(energy[name]) - energy[name])
        missing = float(np.abs(series["energy_balance"][1]).max())
        return Observed(step=history.step, t=history.t, series=series, scalars={"energy_missing": ("J", missing)})

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """What the channels together do not account for, at worst."""
        return (
            Headline(name="energy missing from the budget", use="energy", quantity="energy_missing", expected=0.0,
                     source="balance of energy", scale=_initial_energy(setup.scene), scale_is="energy that the disks exchange"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """The balance and every loss, to the scheme's order or to round-off."""
        size, zero = _initial_energy(setup.scene), np.zeros(len(observed.step))
        if engine.scheme == "theta":
            off, why = 1e-11, "solver tolerance of 1e-12 and round-off, added up over some thousand steps"
        else:
            phase = self.rate(setup.scene) * setup.numerics.dt
            off = phase**2
            why = f"second order: impacts change energies by (omega dt)^2 of what they exchange, omega dt = {phase:.2g}"
        found = []
        for name in ("energy_balance", *(f"energy_{name}_fed" for name in self._losses(params))):
            found.append(
                Check(
                    quantity=name, norm="max", truth="analytic", expected=at_observed(observed, engine, name, zero),
                    source="balance of energy" if name == "energy_balance" else "a loss never feeds", scale=size,
                    atol=size * (off if name == "energy_balance" or "dashpot" in name else min(off, 1e-11)), why=why,
                )
            )  # fmt: skip
        return found

    def rate(self, scene: Any) -> float:
        """Fastest angular frequency of a contact [rad/s]."""
        return math.sqrt(scene.law_of_bodies.kn / float(scene.bodies.mass.min()))

    def _losses(self, params: Mapping[str, Any]) -> tuple[str, ...]:
        """Losses that the scene can have."""
        return tuple(name for name in self.losses if name != "friction_loss" or params["mu"] > 0.0)


def _law(params: Mapping[str, Any]) -> ContactLaw:
    rigid = params["contacts"] == "rigid"
    kn = 1e5 if rigid else 3e4
    return ContactLaw(
        kn=kn, ks=0.5 * kn, mu=params["mu"], beta=beta_for(RESTITUTION) if rigid else BETA,
        restitution=RESTITUTION if rigid else None, regularised=rigid,
    )  # fmt: skip


def _floor_energy(scene: Any) -> float:
    """Energy of position of the bodies where each of them touches the floor [J]."""
    return float((scene.bodies.mass * scene.bodies.radius).sum()) * GRAVITY


def _initial_energy(scene: Any) -> float:
    """Energy that the bodies have at the beginning, of motion and of their height above the floor [J]."""
    bodies = scene.bodies
    turns = bodies.inertia @ bodies.omega.reshape(len(bodies), -1) ** 2
    kinetic = 0.5 * float((bodies.mass @ bodies.v**2).sum() + turns.sum())
    return kinetic + GRAVITY * float((bodies.mass * bodies.x[:, -1]).sum()) - _floor_energy(scene)


CASE = Budget()
