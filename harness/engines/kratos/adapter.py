"""Adapter of Kratos DEM (explicit DEM, BSD): a separate process, walls as moving edges and triangles."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import LEVER_ARMS, ROLLING, Capability, capabilities_needed
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.engines.lengths import wall_reach
from ninedisk.harness.engines.process import package_version
from ninedisk.harness.engines.spring import (
    ARMS,
    NOTE_MEAN,
    Fit,
    SpringEngine,
    carries_shear,
    disk_laws,
    hertz,
    plane_laws,
    sphere_laws,
    uneven_planes,
    wall_laws,
    wall_turns,
)
from ninedisk.harness.engines.symmetry import no_disk_can_turn

PACKAGES = ("KratosDEMApplication", "KratosMultiphysics")
CAPABILITIES_3D = frozenset(
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
)
CAPABILITIES = frozenset(
    {
        Capability.LINEAR_CONTACT,
        Capability.SHEAR_SPRING,
        Capability.FRICTION,
        Capability.CONTACT_DAMPING,
        Capability.GLOBAL_DAMPING_CENTRAL,
        Capability.GLOBAL_DAMPING_LAGGED,
        Capability.MOVING_WALLS,
        Capability.ROTATING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.DISK_INERTIA,
        Capability.LEVER_ARM_OVERLAP,
        Capability.SLIP_END,
        Capability.MATERIALS,
        Capability.ROLLING_CONSTANT,
        Capability.ROLLING_VISCOUS,
        Capability.BODY_FORCES,
        Capability.SPHERES,
        Capability.HERTZ_MINDLIN,
    }
)

NOTE_SYMMETRY = (
    "by symmetry no disk of this scene turns (each lies on a mirror of it), so that Kratos' lever arms play no part"
)
NOTE_ARMS = "lever arm of shear torque and slip: R - overlap/2 between disks, but R - overlap at walls"
NOTE_ROTATION = (
    "slip by rotation is measured between the normals and arms of either end of a step, and shear forces at walls are projected on "
    "the new tangent: off by the square of the rotation in a step"
)
NOTE_WALL_VELOCITY = "a wall's velocity enters the slip on the wall's surface, as the mean over the step"
NOTE_TURNING = (
    "Kratos keeps the forces of walls along fixed axes: where a wall turns, its shear forces gain the normal force times the rotation "
    "in every step, up to the friction limit; with the lever arms that makes up to 2.5 % of the largest normal and 4.6 % of the largest "
    "shear force of the nine-disk distortion"
)
NOTE_KEPT = (
    "the engine's neighbours keep the shear force of their last contact while they are apart, as long as they stay within the search "
    "tolerance: the second contact goes on from it"
)
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; never tension"
NOTE_NO_DASHPOT = (
    "Kratos' dashpots act along the shear spring too, and its forces on walls cannot be taken apart where a dashpot acts: contact "
    "damping is expressed between smooth disks only"
)
NOTE_ROLLING = (
    "rolling resistance by DEMRollingFrictionModelConstantTorque and ...ViscousTorque, with R less the overlap at walls"
)
NOTE_ROLLING_PAIRS = (
    "between two disks Kratos gives each a torque of rolling resistance with its own radius and not with the reduced one of both: they are "
    "not opposite, and with equal disks twice as large"
)
NOTE_ONE_DASHPOT = "one damping ratio for all pairs of disks"

# Notes on scenes of 3D.
NOTE_ARMS_3D = "lever arm of shear torque and slip: R - overlap/2 between spheres, but R - overlap at planes"
NOTE_DASHPOT_3D = (
    "dashpot with the velocity of t_{n-1/2}; never tension: rebounds are faster than with one that may pull"
)
NOTE_NO_DASHPOT_3D = (
    "Kratos' dashpots act along the shear spring too, and its forces of planes cannot be taken apart where one is rough and another has a "
    "dashpot: contact damping is expressed without friction only"
)
NOTE_ROUGH_HERTZ = (
    "Kratos' shear force beside Hertz' law grows by 8 G* a ds, and shrinks with the contact radius where that falls: none of the scene's "
    "rules of unloading"
)
NOTE_TURNING_3D = (
    "forces of planes keep their direction: where a plane turns, shear forces gain the normal force times the rotation"
)
NOTE_ONE_LAW = "one normal model for all contacts: linear and Hertz' beside each other are two"
NOTE_MODULI = "E* of a contact comes of the moduli of both bodies: no materials have those of this scene"


FACTS = EngineInfo(
    id="kratos",
    name="Kratos DEM",
    scheme="central-difference",
    contact="spring",
    licence="BSD-4-Clause",
    how_it_runs="subprocess: Python with Kratos as a package, scene and history as JSON",
    install="pip install KratosMultiphysics KratosDEMApplication",
    capabilities=CAPABILITIES,
    turns_shear="to first order",
    arms_at_walls=frozenset(),
    differences={
        Difference.FIXED_WALL_SHEAR: NOTE_TURNING,
        Difference.KEEPS_OPENED_SHEAR: NOTE_KEPT,
        Difference.SHEAR_KEEPS_TWIST: str(Difference.SHEAR_KEEPS_TWIST),
        Difference.DASHPOT_NEVER_PULLS: str(Difference.DASHPOT_NEVER_PULLS),
    },
)


class Kratos(SpringEngine):
    """Kratos DEM: cylinders in 2D, spheres in 3D, symplectic Euler, one thread."""

    id = "kratos"
    facts = FACTS
    driver = Path(__file__).with_name("driver.py")
    dashpot_note = NOTE_DASHPOT
    capabilities_3d = CAPABILITIES_3D
    dashpot_note_3d = NOTE_DASHPOT_3D
    chosen: Mapping[str, Any] = {
        "global damping": "external force -xi m v and moment -xi I w; central form by nodal masses and inertias times 1 + xi dt/2",
        "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
        "walls": "RigidEdge2D2N, one each, nodes placed by the driver at t_n before the forces at t_n",
        "element": "CylinderParticle2D",
        "scheme": "Symplectic_Euler, Direct_Integration",
        "NeighbourSearchFrequency": 1,
    }
    chosen_3d: Mapping[str, Any] = {
        "element": "SphericParticle3D",
        "scheme": "Symplectic_Euler, Direct_Integration",
        "walls": "RigidFace3D3N, one each, nodes placed by the driver at t_n before the forces at t_n",
        "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
        "NeighbourSearchFrequency": 1,
    }

    def installed(self) -> tuple[str | None, str]:
        """Version of Kratos' application, which needs the core beside it."""
        (version, reason), (core, without) = map(package_version, PACKAGES)
        return version if core else None, reason or without

    def fit(self, scene: Scene, numerics: Numerics, fit: Fit) -> None:
        """EXACT for smooth walls and disks that roll on each other with the arm R - overlap/2, or where symmetry forbids turning.

        APPROXIMATE where a lever arm differs or rough walls turn.
        """
        between, at_walls = disk_laws(scene), [(wall, law) for wall in scene.walls for law in wall_laws(scene, wall)]
        rough_walls = [(wall, law) for wall, law in at_walls if carries_shear(law)]
        fit.missing -= ARMS
        if capabilities_needed(scene, numerics) & ARMS:
            if no_disk_can_turn(scene):
                fit.notes.append(NOTE_SYMMETRY)
            else:
                fit.notes += [NOTE_ARMS, NOTE_ROTATION]
                arms = {LEVER_ARMS[law.lever_arm] for law in between if carries_shear(law)} - {
                    Capability.LEVER_ARM_OVERLAP
                }
                fit.near |= arms | {LEVER_ARMS[law.lever_arm] for _, law in rough_walls}
        if any(wall_turns(wall.motion) for wall, _ in rough_walls):
            fit.notes += [NOTE_WALL_VELOCITY, NOTE_TURNING]
            fit.approximate = True
        resisted = (
            {law.rolling.model for law in scene.laws_in_use if law.rolling} if scene.disks.rotating.any() else set()
        )
        if resisted:
            fit.notes.append(NOTE_ROLLING)
            fit.approximate = True
            between_disks = {law.rolling.model for law in between if law.rolling}
            for model in sorted(between_disks):
                fit.lacks(ROLLING[model], NOTE_ROLLING_PAIRS)
        damped = [law for law in scene.laws_in_use if law.beta > 0.0]
        if any(law.beta > 0.0 for _, law in at_walls) or any(carries_shear(law) for law in damped):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_NO_DASHPOT)
        if damped and len(between) > 1:
            fit.lacks(Capability.MATERIALS, NOTE_ONE_DASHPOT)

    def fit_3d(self, scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG002
        """Lever arms, smooth planes where they turn, and dashpots without friction alone."""
        fit.missing -= ARMS
        planes = [law for wall in scene.walls for law in plane_laws(scene, wall)]
        if scene.spheres.rotating.any():
            asked = [law for law in sphere_laws(scene) if carries_shear(law) and law.lever_arm != "overlap"]
            fit.near |= {LEVER_ARMS[law.lever_arm] for law in (*asked, *filter(carries_shear, planes))}
            if fit.near:
                fit.notes.append(NOTE_ARMS_3D)
        if any(wall_turns(wall.motion) and any(map(carries_shear, plane_laws(scene, wall))) for wall in scene.walls):
            fit.lacks(Capability.ROTATING_WALLS, NOTE_TURNING_3D)
        if uneven_planes(scene):
            fit.equivalent = True
            fit.notes.append(NOTE_MEAN)
        damped = [law for law in scene.laws_in_use if law.beta > 0.0]
        if any(map(carries_shear, damped)) or (
            any(law.beta > 0.0 for law in planes) and any(map(carries_shear, planes))
        ):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_NO_DASHPOT_3D)
        fit.approximate = bool(damped)
        kinds = {law.hertz for law in scene.laws_in_use}
        if len(kinds) > 1:
            fit.lacks(Capability.MATERIALS, NOTE_ONE_LAW)
        elif kinds == {True}:
            if any(map(carries_shear, scene.laws_in_use)):
                fit.lacks(Capability.SHEAR_SPRING, NOTE_ROUGH_HERTZ)
            if moduli(scene) is None:
                fit.lacks(Capability.HERTZ_MINDLIN, NOTE_MODULI)

    def extra(self, scene: Scene | SphereScene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Also the length of walls, and moduli of Hertz' law."""
        return {
            **super().extra(scene, numerics, folder),
            "elastic": moduli(scene) if isinstance(scene, SphereScene) and hertz(scene) else [],
            "reach": wall_reach(scene, numerics, self.id),
        }


def moduli(scene: SphereScene) -> list[float] | None:
    """Young's moduli [Pa], with nu = 0, of the spheres and of each wall; None where no materials have the scene's E*."""
    own = [law.e_star for wall in scene.walls for law in plane_laws(scene, wall)]
    # Of one sphere the law between spheres says nothing.
    sphere = 2.0 * scene.sphere_sphere.e_star if len(scene.spheres) > 1 else 2.0 * min(own, default=1.0)
    if any(e_star >= sphere for e_star in own):
        return None
    return [sphere, *(1.0 / (1.0 / e_star - 1.0 / sphere) for e_star in own)]


ENGINE = Kratos()
