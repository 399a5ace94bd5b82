"""Spheres in space in ESyS-Particle: what of them it has, and how its conventions are the scene's."""

from __future__ import annotations

from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.engines.spring import (
    IN_SPACE,
    NOTE_OVERDAMPED,
    NOTE_UNIFORM,
    Fit,
    InSpace,
    fit_arms,
    plane_laws,
    rough,
    sphere_laws,
    uniform,
)

NOTE_PLANES = "planes are smooth linear springs (NRotElasticWall): no friction, no dashpot and no Hertz law at a plane"
NOTE_ROUGH_HERTZ = (
    "HertzMindlin sees no spins and forgets its shear force with every search of neighbours, HertzMindlinVisco has no shear spring: "
    "friction is expressed beside the linear law only"
)
NOTE_LINEAR_DASHPOT = (
    "LinearDashpot acts along the surface as well: contact damping is expressed beside Hertz' law only"
)
NOTE_ARM = (
    "lever arm of shear torque and slip: a share of the distance by the radii, R - overlap/2 between equal spheres"
)
NOTE_DIRECTION = "shear forces keep their direction in space while their contact turns (RotFriction, whose option rigid does nothing)"
NOTE_ONE_LAW = "Hertz' law is one for all contacts: HertzMindlinVisco takes no tags of spheres"
NOTE_BLOCKED_SPIN = "a sphere whose rotation is blocked has no spin"
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; it may pull"
NOTE_FORCES = (
    "shear forces by restart files; normal forces from the forces on spheres and planes, where those tell them"
)


def fit(scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG001
    """Smooth linear planes; friction beside the linear law, dashpots beside Hertz'."""
    fit_arms(scene, fit, "overlap", "overlap")
    between, laws = sphere_laws(scene), scene.laws_in_use
    planes = [law for wall in scene.walls for law in plane_laws(scene, wall)]
    asked = [
        (Capability.SHEAR_SPRING, any(map(rough, planes))),
        (Capability.CONTACT_DAMPING, any(law.beta > 0.0 for law in planes)),
        (Capability.HERTZ_MINDLIN, any(law.hertz for law in planes)),
    ]
    if lacking := [capability for capability, needed in asked if needed]:
        fit.missing.update(lacking)
        fit.notes.append(NOTE_PLANES)
    if any(law.hertz and rough(law) for law in between):
        fit.lacks(Capability.SHEAR_SPRING, NOTE_ROUGH_HERTZ)
    if any(law.beta > 0.0 and not law.hertz for law in between):
        fit.lacks(Capability.CONTACT_DAMPING, NOTE_LINEAR_DASHPOT)
    if any(law.beta >= 1.0 for law in between):
        fit.lacks(Capability.CONTACT_DAMPING, NOTE_OVERDAMPED)
    if len(laws) > 1 and any(law.hertz for law in laws):
        fit.lacks(Capability.MATERIALS, NOTE_ONE_LAW)
    if not uniform(scene):
        fit.lacks(Capability.DISK_INERTIA, NOTE_UNIFORM)
    if scene.spheres.omega[~scene.spheres.rotating].any():
        fit.lacks(Capability.BLOCKED_ROTATION, NOTE_BLOCKED_SPIN)
    if any(map(rough, between)):
        fit.approximate = True
        fit.notes += [NOTE_ARM, NOTE_DIRECTION]
        if scene.spheres.rotating.any() and len(np.unique(scene.spheres.radius)) > 1:
            fit.near.add(Capability.LEVER_ARM_OVERLAP)
    fit.notes += [] if fit.missing else [NOTE_FORCES]


CHOSEN: dict[str, Any] = {
    "particles": "RotSphere",
    "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
    "walls": "infinite planes moved and turned by the driver before each step; normalK is kn/(pi R), by tags of equal radii",
    "rigid": False,
    "processes": "a master and one worker",
}

ESYS_IN_SPACE = InSpace(
    capabilities=IN_SPACE | {Capability.LEVER_ARM_OVERLAP, Capability.ROTATING_WALLS},
    fit=fit,
    chosen=CHOSEN,
    dashpot_note=NOTE_DASHPOT,
)
