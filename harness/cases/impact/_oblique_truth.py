"""What binds an engine on an oblique impact: rigid impulses, springs with Coulomb's cap, or the exact steps of its scheme."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ninedisk.harness.api.case import FloatArray, Observed, Setup
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.cases.common import follows_associated_rule, single, soft_reason, softness
from ninedisk.harness.cases.impact._impact import ROUND_OFF
from ninedisk.references.analytic.oblique_impact import Rebound, rigid_rebound, spring_rebound
from ninedisk.references.analytic.slip_to_roll import UNIFORM_DISK
from ninedisk.references.analytic.spring_dashpot import restitution_of_beta
from ninedisk.references.exact_steps.plane_contact import PlaneSteps, plane_contact_theta

NAMES = ("vx", "vy", "spin", "slip", "energy")


class Truth(NamedTuple):
    """Rebound that binds an engine, absolute tolerances of its velocities by name, and why."""

    rebound: Rebound
    atol: Mapping[str, float]
    source: str
    why: str


def inertia_ratio(params: Mapping[str, Any]) -> float:
    """``I/(m R^2)``; infinite for a disk that cannot turn."""
    return UNIFORM_DISK if params["rotating"] else math.inf


def curves_of(rebound: Rebound, setup: Setup) -> dict[str, float]:
    """Values of `NAMES` after the impact."""
    disks = setup.scene.disks
    radius, mass = float(disks.radius[0]), float(disks.mass[0])
    energy = 0.5 * mass * (rebound.vx**2 + rebound.vy**2) + 0.5 * float(disks.inertia[0]) * rebound.spin**2
    slip = rebound.vx - radius * rebound.spin
    return {"vx": rebound.vx, "vy": rebound.vy, "spin": rebound.spin, "slip": slip, "energy": energy}


def before(params: Mapping[str, Any]) -> Rebound:
    """Velocities before the impact."""
    return Rebound(params["vt"], -params["vn"], params["spin"])


def binding_truth(params: Mapping[str, Any], setup: Setup, engine: EngineInfo, beta: float) -> Truth:
    """The rebound by the kind of the engine's contacts."""
    if engine.contact == "spring":
        return _spring(params, setup, beta)
    return _rigid(params, setup, engine)


def _rigid(params: Mapping[str, Any], setup: Setup, engine: EngineInfo) -> Truth:
    """Newton and Coulomb; the impulse of one step is exact but for round-off and what a soft contact lets through."""
    e, mu, radius = params["restitution"], params["mu"], float(setup.scene.disks.radius[0])
    dilates = follows_associated_rule(engine, setup.numerics)
    found = rigid_rebound(
        velocity=(params["vt"], -params["vn"]),
        spin=params["spin"],
        radius=radius,
        inertia_ratio=inertia_ratio(params),
        mu=mu,
        restitution=e,
        dilates=dilates,
    )
    # A soft contact misses a part of each impulse; friction takes part of what the normal impulse misses.
    normal = found.vy + params["vn"]
    along = abs(found.vx - params["vt"])
    largest = max(abs(params["vt"]), params["vn"], abs(params["spin"]) * radius)
    floor = ROUND_OFF * largest + 2.0 * single(engine, largest, 1)
    vx, vy = floor + (along + mu * normal) * softness(engine), floor + normal * softness(engine)
    why = "impulses of one step at velocity level: round-off"
    why += (" of single precision" if engine.precision == "float32" else "") + soft_reason(engine)
    rule = "the associated sliding rule" if dilates else "Coulomb's law"
    return Truth(found, _tolerances(params, setup, vx, vy), f"Newton's restitution and {rule} for the impulses", why)


def _spring(params: Mapping[str, Any], setup: Setup, beta: float) -> Truth:
    """Springs, phase by phase.

    Normal restitution: as in `ninedisk.harness.cases.impact._impact.binding_impact`. Along the plane the contact of a scheme begins with
    a whole step's stretch of the shear spring whatever the part of the step in touch: ``ks u dt`` at most, which swings with Omega
    and so leaves ``Omega dt u``; a contact that slides from the start cuts it off. Where a contact begins to slide or to stick
    within a step, the force is off by what one step changes its slope by, for that step: second order. Where in the overlap
    friction acts is open: an arm R - overlap, or a slip so measured, changes both velocities by the overlap over R at most.
    """
    law, disks = setup.scene.walls[0].law, setup.scene.disks
    mass, radius = float(disks.mass[0]), float(disks.radius[0])
    found = spring_rebound(
        velocity=(params["vt"], -params["vn"]),
        spin=params["spin"],
        radius=radius,
        inertia_ratio=inertia_ratio(params),
        mu=law.mu,
        mass=mass,
        kn=law.kn,
        ks=law.ks,
        beta=beta,
    )
    e = restitution_of_beta(beta)
    contact_dt = setup.numerics.contact_dt or setup.numerics.dt
    phase = math.sqrt(law.kn / mass) * contact_dt
    damped = 2.0 * beta * phase
    normal = (e * (phase**2 / 8.0 * (1.0 + phase**2) + damped * (1.0 + damped)) + ROUND_OFF) * params["vn"]
    ease = 1.0 + 1.0 / inertia_ratio(params)
    slip = abs(params["vt"] - radius * params["spin"])
    swing = math.sqrt(ease * law.ks / mass) * contact_dt
    overlap = params["vn"] * math.sqrt(mass / law.kn) / radius
    lost = abs(found.vx - params["vt"])
    slides = slip * law.ks > params["mu"] * params["vn"] * law.kn and beta == 0.0
    first = 0.0 if slides else swing
    along = params["mu"] * normal + (first + swing**2) * slip / ease + 2.0 * overlap * lost + ROUND_OFF * slip
    regime = f"{'slides' if slides else 'sticks'} at first, Omega dt = {swing:.3g}"
    why = f"phase of the impact in the contact step: omega dt = {phase:.3g}, beta = {beta:.4g}; {regime}; overlap/R = {overlap:.2g}"
    return Truth(
        found, _tolerances(params, setup, along, normal), "linear springs with Coulomb's cap, phase by phase", why
    )


def _tolerances(params: Mapping[str, Any], setup: Setup, vx: float, vy: float) -> dict[str, float]:
    """Of the quantities that follow from vx and vy: friction turns the disk by 1/(k R) for each unit of vx."""
    disks = setup.scene.disks
    mass, radius, turn = float(disks.mass[0]), float(disks.radius[0]), 1.0 / inertia_ratio(params)
    spin = turn * vx / radius
    fastest = {
        "vx": abs(params["vt"]) + radius * abs(params["spin"]),
        "vy": params["vn"],
        "spin": abs(params["spin"]) + turn * abs(params["vt"]) / radius,
    }
    inertia = float(disks.inertia[0]) if params["rotating"] else 0.0
    energy = mass * (vx * (fastest["vx"] + vx) + vy * (fastest["vy"] + vy)) + inertia * spin * (fastest["spin"] + spin)
    return {"vx": vx, "vy": vy, "spin": spin, "slip": (1.0 + turn) * vx, "energy": energy}


def exact_steps(params: Mapping[str, Any], setup: Setup) -> PlaneSteps:
    """Exact steps of the theta scheme on this variant."""
    disks, numerics = setup.scene.disks, setup.numerics
    return plane_contact_theta(
        mass=float(disks.mass[0]),
        radius=float(disks.radius[0]),
        inertia_ratio=inertia_ratio(params),
        gap=params["gap"],
        velocity=(params["vt"], -params["vn"]),
        spin=params["spin"],
        g=0.0,
        mu=params["mu"],
        dt=numerics.dt,
        theta=numerics.theta,
        restitution=params["restitution"] if numerics.impact == "newton" else None,
        dilates=numerics.sliding == "associated",
        n_steps=numerics.n_steps,
    )


def exact_curves(params: Mapping[str, Any], setup: Setup, observed: Observed) -> dict[str, FloatArray]:
    """Series of the exact steps at the samples, gap and way included."""
    steps, disks = exact_steps(params, setup), setup.scene.disks
    mass, inertia, radius = float(disks.mass[0]), float(disks.inertia[0]), float(disks.radius[0])
    energy = 0.5 * mass * (steps.vx**2 + steps.vy**2) + 0.5 * inertia * steps.spin**2
    curves = {**steps._asdict(), "slip": steps.vx - radius * steps.spin, "energy": energy}
    return {name: np.asarray(curve)[observed.step] for name, curve in curves.items()}
