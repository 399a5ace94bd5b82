"""Spheres in space in Kratos DEM: what of them it has, and how its conventions are the scene's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import LEVER_ARMS, Capability
from ninedisk.harness.engines.plane import wall_reach
from ninedisk.harness.engines.spring import (
    ARMS,
    NOTE_MEAN,
    Fit,
    InSpace,
    plane_laws,
    rough,
    sphere_laws,
    turns,
    uneven_planes,
)

NOTE_ARMS = "lever arm of shear torque and slip: R - overlap/2 between spheres, but R - overlap at planes"
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; never tension: rebounds are faster than with one that may pull"
NOTE_NO_DASHPOT = (
    "Kratos' dashpots act along the shear spring too, and its forces of planes cannot be taken apart where one is rough and another has a "
    "dashpot: contact damping is expressed without friction only"
)
NOTE_ROUGH_HERTZ = (
    "Kratos' shear force beside Hertz' law grows by 8 G* a ds, and shrinks with the contact radius where that falls: none of the scene's "
    "rules of unloading"
)
NOTE_TURNING = (
    "forces of planes keep their direction: where a plane turns, shear forces gain the normal force times the rotation"
)
NOTE_ONE_LAW = "one normal model for all contacts: linear and Hertz' beside each other are two"
NOTE_MODULI = "E* of a contact comes of the moduli of both bodies: no materials have those of this scene"


def moduli(scene: SphereScene) -> list[float] | None:
    """Young's moduli [Pa], with nu = 0, of the spheres and of each wall; None where no materials have the scene's E*."""
    own = [law.e_star for wall in scene.walls for law in plane_laws(scene, wall)]
    # Of one sphere the law between spheres says nothing.
    sphere = 2.0 * scene.sphere_sphere.e_star if len(scene.spheres) > 1 else 2.0 * min(own, default=1.0)
    if any(e_star >= sphere for e_star in own):
        return None
    return [sphere, *(1.0 / (1.0 / e_star - 1.0 / sphere) for e_star in own)]


def fit(scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG001
    """Lever arms, smooth planes where they turn, and dashpots without friction alone."""
    fit.missing -= ARMS
    planes = [law for wall in scene.walls for law in plane_laws(scene, wall)]
    if scene.spheres.rotating.any():
        asked = [law for law in sphere_laws(scene) if rough(law) and law.lever_arm != "overlap"]
        fit.near |= {LEVER_ARMS[law.lever_arm] for law in (*asked, *filter(rough, planes))}
        if fit.near:
            fit.notes.append(NOTE_ARMS)
    if any(turns(wall.motion) and any(map(rough, plane_laws(scene, wall))) for wall in scene.walls):
        fit.lacks(Capability.ROTATING_WALLS, NOTE_TURNING)
    if uneven_planes(scene):
        fit.equivalent = True
        fit.notes.append(NOTE_MEAN)
    damped = [law for law in scene.laws_in_use if law.beta > 0.0]
    if any(map(rough, damped)) or (any(law.beta > 0.0 for law in planes) and any(map(rough, planes))):
        fit.lacks(Capability.CONTACT_DAMPING, NOTE_NO_DASHPOT)
    fit.approximate = bool(damped)
    hertz = {law.hertz for law in scene.laws_in_use}
    if len(hertz) > 1:
        fit.lacks(Capability.MATERIALS, NOTE_ONE_LAW)
    elif hertz == {True}:
        if any(map(rough, scene.laws_in_use)):
            fit.lacks(Capability.SHEAR_SPRING, NOTE_ROUGH_HERTZ)
        if moduli(scene) is None:
            fit.lacks(Capability.HERTZ_MINDLIN, NOTE_MODULI)


def extra(scene: SphereScene, numerics: Numerics) -> Mapping[str, Any]:
    """Size of the triangles; moduli of Hertz' law."""
    hertz = any(law.hertz for law in scene.laws_in_use)
    return {"elastic": moduli(scene) if hertz else [], "reach": wall_reach(scene, numerics, "kratos")}


KRATOS_IN_SPACE = InSpace(
    capabilities=frozenset(
        {
            Capability.SPHERES,
            Capability.LINEAR_CONTACT,
            Capability.HERTZ_MINDLIN,
            Capability.SHEAR_SPRING,
            Capability.FRICTION,
            Capability.CONTACT_DAMPING,
            Capability.MOVING_WALLS,
            Capability.ROTATING_WALLS,
            Capability.CURVED_WALL_MOTION,
            Capability.GRAVITY,
            Capability.DISK_INERTIA,
            Capability.LEVER_ARM_OVERLAP,
            Capability.SLIP_END,
        }
    ),
    fit=fit,
    chosen={
        "element": "SphericParticle3D",
        "scheme": "Symplectic_Euler, Direct_Integration",
        "walls": "RigidFace3D3N, one each, nodes placed by the driver at t_n before the forces at t_n",
        "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
        "NeighbourSearchFrequency": 1,
    },
    dashpot_note=NOTE_DASHPOT,
    extra=extra,
)
