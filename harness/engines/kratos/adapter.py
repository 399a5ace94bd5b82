"""Adapter of Kratos DEM (explicit DEM of disks, BSD): a process of its own, walls as moving edges."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import LEVER_ARMS, ROLLING, Capability, capabilities_needed
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.engines.kratos.space import KRATOS_IN_SPACE
from ninedisk.harness.engines.plane import no_disk_can_turn, wall_reach
from ninedisk.harness.engines.process import package_version
from ninedisk.harness.engines.spring import ARMS, Fit, SpringEngine, disk_laws, rough, turns, wall_laws

PACKAGES = ("KratosDEMApplication", "KratosMultiphysics")
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
    """Kratos DEM: cylinders in the plane, symplectic Euler, one thread."""

    id = "kratos"
    facts = FACTS
    driver = Path(__file__).with_name("driver.py")
    dashpot_note = NOTE_DASHPOT
    in_space = KRATOS_IN_SPACE
    chosen: Mapping[str, Any] = {
        "global damping": "external force -xi m v and moment -xi I w; central form by nodal masses and inertias times 1 + xi dt/2",
        "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
        "walls": "RigidEdge2D2N, one each, nodes placed by the driver at t_n before the forces at t_n",
        "element": "CylinderParticle2D",
        "scheme": "Symplectic_Euler, Direct_Integration",
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
        rough_walls = [(wall, law) for wall, law in at_walls if rough(law)]
        fit.missing -= ARMS
        if capabilities_needed(scene, numerics) & ARMS:
            if no_disk_can_turn(scene):
                fit.notes.append(NOTE_SYMMETRY)
            else:
                fit.notes += [NOTE_ARMS, NOTE_ROTATION]
                arms = {LEVER_ARMS[law.lever_arm] for law in between if rough(law)} - {Capability.LEVER_ARM_OVERLAP}
                fit.near |= arms | {LEVER_ARMS[law.lever_arm] for _, law in rough_walls}
        if any(turns(wall.motion) for wall, _ in rough_walls):
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
        if any(law.beta > 0.0 for _, law in at_walls) or any(rough(law) for law in damped):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_NO_DASHPOT)
        if damped and len(between) > 1:
            fit.lacks(Capability.MATERIALS, NOTE_ONE_DASHPOT)

    def extra(self, scene: Any, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Also the length of walls."""
        if isinstance(scene, SphereScene):
            return super().extra(scene, numerics, folder)
        return {**super().extra(scene, numerics, folder), "reach": wall_reach(scene, numerics, self.id)}


ENGINE = Kratos()
