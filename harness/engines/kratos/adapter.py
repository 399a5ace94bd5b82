"""Adapter of Kratos DEM (explicit DEM of disks, BSD): a process of its own, walls as moving edges."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.harness.api.capabilities import LEVER_ARMS, Capability, capabilities_needed
from ninedisk.harness.api.engine import Difference, EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.package import package_version
from ninedisk.harness.engines.plane import no_disk_can_turn, wall_reach
from ninedisk.harness.engines.spring import NOTE_SLIP_END, OF_SLIP_AT, contact_steps
from ninedisk.harness.wire.external import ExternalEngine

DRIVER = Path(__file__).parents[1] / "drivers" / "kratos_driver.py"
PACKAGES = ("KratosDEMApplication", "KratosMultiphysics")
ARMS = frozenset(LEVER_ARMS.values())
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


class Kratos(ExternalEngine):
    """Kratos DEM: cylinders in the plane, symplectic Euler, one thread."""

    id = "kratos"

    def info(self) -> EngineInfo:
        """Facts about Kratos; nothing of it is imported."""
        (version, reason), (core, without) = map(package_version, PACKAGES)
        return EngineInfo(
            id=self.id,
            name="Kratos DEM",
            version=version if core else None,
            scheme="central-difference",
            contact="spring",
            licence="BSD-4-Clause",
            how_it_runs="subprocess: Python with Kratos as a package, scene and history as JSON",
            precision="float64",
            threads=1,
            install="pip install KratosMultiphysics KratosDEMApplication",
            capabilities=CAPABILITIES,
            not_installed_because=reason or without,
            turns_shear="to first order",
            differences={Difference.FIXED_WALL_SHEAR: NOTE_TURNING, Difference.KEEPS_OPENED_SHEAR: NOTE_KEPT},
            arms_at_walls=frozenset(),
        )

    def command(self) -> Sequence[str]:
        """This Python with the driver; no user site, no current folder on its path."""
        return [sys.executable, "-P", "-s", str(DRIVER)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """One thread."""
        return {**super().environment(folder), "OMP_NUM_THREADS": "1"}

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """EXACT for smooth walls and disks that roll on each other with the arm R - overlap/2, and where symmetry forbids turning.

        APPROXIMATE where a lever arm differs or rough walls turn; EQUIVALENT where a dashpot sees v_{n-1/2} though the numerics ask
        for the central form, or slip is asked for in the middle of the step.
        """
        missing = set(capabilities_needed(scene, numerics))
        notes: list[str] = []
        early = missing & OF_SLIP_AT - CAPABILITIES
        missing -= early
        notes += [NOTE_SLIP_END] if early else []
        between = [scene.disk_disk] if len(scene.disks) > 1 else []
        laws = between + [wall.law for wall in scene.walls]
        turning, foreign = False, set[Capability]()
        if missing & ARMS and no_disk_can_turn(scene):
            notes.append(NOTE_SYMMETRY)
        elif missing & ARMS:
            notes += [NOTE_ARMS, NOTE_ROTATION]
            foreign = {LEVER_ARMS[law.lever_arm] for law in between if _rough(law)} - {Capability.LEVER_ARM_OVERLAP}
            foreign |= {LEVER_ARMS[wall.law.lever_arm] for wall in scene.walls if _rough(wall.law)}
        missing -= CAPABILITIES | ARMS
        if any(_rough(wall.law) and any(s.angular_velocity for s in wall.motion) for wall in scene.walls):
            notes += [NOTE_WALL_VELOCITY, NOTE_TURNING]
            turning = True
        damped = [law for law in laws if law.beta > 0.0]
        if any(wall.law.beta > 0.0 for wall in scene.walls) or any(_rough(law) for law in damped):
            missing.add(Capability.CONTACT_DAMPING)
            notes.append(NOTE_NO_DASHPOT)
        if missing:
            return Support(SupportLevel.NO, tuple(sorted(missing | foreign)), tuple(notes))
        notes += [NOTE_DASHPOT] if damped else []
        if foreign or turning:
            return Support(SupportLevel.APPROXIMATE, tuple(sorted(foreign)), tuple(notes))
        late = bool(damped) and numerics.damping_form == "central"
        return Support(SupportLevel.EQUIVALENT if late or early else SupportLevel.EXACT, (), tuple(notes))

    def extra(self, scene: Scene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Contact step, the walls' path at every contact step (a file: it can be long), and the length of walls."""
        count, contact_dt = contact_steps(scene, numerics)
        path = folder / "wall_path.npy"
        np.save(path, wall_path(scene, contact_dt, count * numerics.n_steps))
        reach = wall_reach(scene, numerics, self.id)
        return {"substeps": count, "contact_dt": contact_dt, "wall_path": str(path), "reach": reach}

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run Kratos; raises as `ExternalEngine.run`."""
        done = super().run(scene, numerics, watch)
        count, contact_dt = contact_steps(scene, numerics)
        chosen = {
            "contact_dt": contact_dt,
            "contact_steps_per_dt": count,
            "damping_form": numerics.damping_form,
            "global damping": "external force -xi m v and moment -xi I w; central form by nodal masses and inertias times 1 + xi dt/2",
            "start": "half kick: v(1/2) = v0 + dt/2 (F0/m - xi v0), set by the driver",
            "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
            "walls": "RigidEdge2D2N, one each, nodes placed by the driver at t_n before the forces at t_n",
            "element": "CylinderParticle2D",
            "scheme": "Symplectic_Euler, Direct_Integration",
            "NeighbourSearchFrequency": 1,
            "threads": 1,
        }
        return EngineRun(history=done.history, timings=done.timings, settings={**chosen, **done.settings})


def _rough(law: ContactLaw) -> bool:
    return law.mu > 0.0 and law.ks > 0.0


ENGINE = Kratos()
