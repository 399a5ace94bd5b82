"""Free collision of two ellipses: what either contact law keeps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.harness.api.case import Check, Headline, Observed, Parameter, Setup, Value
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import at_observed, contact_step
from ninedisk.harness.cases.nurbs.grains import grains, uniform
from ninedisk.references.analytic.impact.ellipse_collision import ChordWork, MovingEllipse, chord_work

A, B, DENSITY = 1.0, 0.6, 1.0
SPEED = 0.5
"""Velocity of either ellipse towards the other [m/s]."""

PAIR = (0, 1)

DT, END = 0.01, 2.0
"""Sampling interval and length of the run [s]; they are closest at about 0.5 s."""

CONSERVED = 1e-10
"""Of mass times speed (times the longer half-axis): rounding of some ten thousand steps, 1e-16 each."""


class Collision:
    """Two ellipses, turned and spinning, hit each other off centre; nothing else acts.

    Momentum and angular momentum are kept by any law whose forces are opposite and act in one point. An implicit scheme, whose spring
    force is that of the step's end, multiplies the energy of an oscillation by ``1/(1 + theta (omega dt)^2)`` a step, over a
    contact's half period by ``exp(-pi theta omega dt)``. Energy is not: the chord's
    force ``kn overlap`` has no potential away from circles, so that work on the way in and out differ by a part of the order of
    overlap over size, whatever the step (`ninedisk.references.analytic.impact.ellipse_collision`); the law of the common area has one and
    loses what the step makes it lose.
    """

    id = "nurbs/collision"
    version = 1
    title = "Collision of two ellipses"
    source = "conservation laws; derivation in ninedisk.core.law.ContactLaw"
    requirement = (
        "momentum and angular momentum are kept to round-off; energy to the second order of the step by the law of the common "
        "area, and with the chord's changes by its closed form, to the second order of overlap over size"
    )
    parameters: tuple[Parameter, ...] = (
        Parameter(name="contact", default="chord", choices=("chord", "area"), in_id=True, help="law of the normal force"),
        Parameter(name="kn", default=2e3, low=100.0, high=1e8, unit="N/m", in_id=True, help="normal stiffness"),
        Parameter(name="mu", default=0.0, low=0.0, unit="-", help="friction; ks is half of kn"),
        Parameter(name="phase", default=0.03, low=1e-4, high=0.3, unit="-", help="contact step times the contact's frequency, at most"),
    )  # fmt: skip

    def matrix(self) -> Sequence[Mapping[str, Value]]:
        """Both laws, a stiffer contact, a coarser step, and friction."""
        return (
            {"contact": "chord"},
            {"contact": "chord", "kn": 3.2e4},
            {"contact": "area"},
            {"contact": "area", "phase": 0.12},
            {"contact": "chord", "mu": 0.5},
        )

    def build(self, params: Mapping[str, Any]) -> Setup:
        """Two ellipses, closing at 1 m/s."""
        from ninedisk.core.nurbs.shapes import ellipse

        kn, mu = params["kn"], params["mu"]
        law = ContactLaw(kn=kn, ks=0.5 * kn if mu else 0.0, mu=mu, lever_arm="overlap", contact=params["contact"])
        state = {
            "x": [(-1.2, 0.0), (1.2, 0.25)],
            "v": [(SPEED, 0.1), (-SPEED, 0.1)],
            "omega": [0.3, -0.2],
            "angle": [0.5, -0.9],
        }
        scene = Scene(**grains([uniform(DENSITY, ellipse, A, B)], [0, 0], **state), disk_disk=law)
        numerics = Numerics(
            dt=DT, n_steps=round(END / DT), contact_dt=contact_step(DT, params["phase"] / frequency(scene))
        )
        return Setup(scene=scene, numerics=numerics, watch=(PAIR,), labels={"contact": PAIR})

    def observe(self, params: Mapping[str, Any], setup: Setup, history: History) -> Observed:  # noqa: ARG002
        """Momenta, kinetic energy, gap; their largest and final changes."""
        disks, x, v = setup.scene.disks, history.x, history.v
        momentum = (disks.mass[:, None] * v).sum(axis=1)
        moment = disks.mass * (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]) + disks.inertia * history.omega
        turning = moment.sum(axis=1)
        energy = 0.5 * (disks.mass * (v**2).sum(axis=2) + disks.inertia * history.omega**2).sum(axis=1)
        gap = history.gap[:, 0]
        scalars = {
            "momentum_drift": ("kg m/s", float(np.abs(momentum - momentum[0]).max())),
            "angular_momentum_drift": ("kg m^2/s", float(np.abs(turning - turning[0]).max())),
            "energy_change": ("1", float(energy[-1] / energy[0] - 1.0)),
            "overlap_over_size": ("1", float(-gap.min() / B)),
            "final_gap": ("m", float(gap[-1])),
        }
        total = history.energy.get("kinetic", np.nan * energy) + history.energy.get("elastic", np.nan * energy)
        series = {
            "energy": ("J", energy),
            "energy_total": ("J", total),
            "angular_momentum": ("kg m^2/s", turning),
            "gap": ("m", gap),
        }
        return Observed(step=history.step, t=history.t, series=series, scalars=scalars)

    def headlines(self, params: Mapping[str, Any], setup: Setup, observed: Observed) -> Sequence[Headline]:  # noqa: ARG002
        """Elastic grains keep energy and momenta. The chord's force has no potential and so does not: its law's truth is in the checks.

        What friction leaves of the energy has no closed form.
        """
        momentum = float(setup.scene.disks.mass[0]) * SPEED
        return (
            Headline(name="energy kept", use="impacts", quantity="energy_change", expected=math.nan if params["mu"] else 0.0,
                     source="conservation of energy", scale=1.0, scale_is="initial energy"),
            Headline(name="momentum kept", use="impacts", quantity="momentum_drift", expected=0.0,
                     source="conservation of momentum", scale=momentum, scale_is="momentum of an ellipse"),
            Headline(name="angular momentum kept", use="impacts", quantity="angular_momentum_drift", expected=0.0,
                     source="conservation of angular momentum", scale=momentum * A,
                     scale_is="momentum of an ellipse times its half-axis"),
        )  # fmt: skip

    def checks(
        self,
        params: Mapping[str, Any],
        setup: Setup,
        observed: Observed,
        engine: EngineInfo,
    ) -> Sequence[Check]:
        """Conservation; energy where nothing rubs, that of the contact included where the law has one."""
        disks = setup.scene.disks
        momentum = float(disks.mass[0]) * SPEED
        why = "opposite forces in one point: round-off, 1e-16 a step"
        step = float(setup.numerics.contact_dt or setup.numerics.dt)
        moved, lost, implicit = 0.0, 0.0, ""
        if engine.scheme == "theta":
            passing = 2.0 * SPEED + A * float(np.abs(disks.omega).sum())
            moved = 2.0 * momentum * passing * step
            lost = 1.0 - math.exp(-math.pi * setup.numerics.theta * frequency(setup.scene) * step)
            implicit = "; forces of the end of a step at its start's places: first order in the step"
        common: dict[str, Any] = {"norm": "scalar", "truth": "analytic", "expected": 0.0}
        found = [
            Check(quantity="momentum_drift", source="conservation of momentum", atol=CONSERVED * momentum, why=why, scale=momentum,
                  **common),
            Check(quantity="angular_momentum_drift", source="conservation of angular momentum", atol=CONSERVED * momentum * A + moved,
                  why=why + implicit, scale=momentum * A, **common),
        ]  # fmt: skip
        if params["mu"]:
            return found
        if params["contact"] == "area":
            phase = frequency(setup.scene) * step
            atol, why = (
                0.25 * phase**2,
                f"(omega dt)^2/4, omega dt = {phase:.2g}: what central differences lose at a contact's closest",
            )
            whole = at_observed(
                observed, engine, "energy_total", np.full_like(observed.t, observed.series["energy"][1][0])
            )
            found.append(
                Check(quantity="energy_total", norm="max", truth="analytic", expected=whole, rtol=atol,
                      source="conservation of energy, the law's own included", why=why)
            )  # fmt: skip
        else:
            phase = frequency(setup.scene) * step
            work = chord_of(setup.scene)
            expected, deep = work.change / kinetic(setup.scene), work.depth / B
            atol = deep**2 + 0.25 * phase**2 + lost
            why = f"second order in the overlap over the smaller half-axis, {deep:.2g}, and in the step, (omega dt)^2/4{implicit}"
            found.append(
                Check(quantity="energy_change", norm="scalar", truth="analytic", expected=expected, atol=atol, scale=1.0,
                      source="work of the chord's force, leading order in the overlap", why=why)
            )  # fmt: skip
            return found
        return [
            *found,
            Check(quantity="energy_change", source="conservation of energy", atol=atol, why=why, scale=1.0, **common),
        ]


def chord_of(scene: Scene) -> ChordWork:
    """What the chord's force does in the collision, to leading order."""
    disks = scene.disks
    one, two = (
        MovingEllipse(A, B, float(disks.mass[k]), float(disks.inertia[k]), disks.x[k], disks.v[k], float(disks.angle[k]),
                      float(disks.omega[k]))
        for k in PAIR
    )  # fmt: skip
    return chord_work(one, two, kn=scene.disk_disk.kn, until=END)


def kinetic(scene: Scene) -> float:
    """Energy at the start [J]."""
    disks = scene.disks
    return 0.5 * float((disks.mass * (disks.v**2).sum(axis=1) + disks.inertia * disks.omega**2).sum())


def frequency(scene: Scene) -> float:
    """Upper bound of the contact's angular frequency [rad/s]: an ellipse's normal passes its centre at A - B at most."""
    disks = scene.disks
    lever = float((1.0 / disks.mass + (A - B) ** 2 / disks.inertia).sum())
    return math.sqrt(scene.disk_disk.kn * lever)


CASE = Collision()
