"""Adapter of YADE (explicit DEM, GPL): runs as its own process, disks as blocked spheres, walls as fixed boxes."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import EXTRAS, GRAINS, SPACE, Capability
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.engines.spring import (
    ARMS,
    NOTE_MEAN,
    SPRINGS_3D,
    Fit,
    SpringEngine,
    carries_shear,
    fit_arms,
    uneven_planes,
    wall_laws,
    wall_turns,
)
from ninedisk.harness.run.process_guard import guarded_environment

_FOREIGN = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "VIRTUAL_ENV", "DISPLAY", "OMPI_COMM_WORLD_RANK")
YADE_HAS = frozenset(
    {
        Capability.MATERIALS,
        Capability.BODY_FORCES,
        Capability.ROLLING_VISCOUS,
        Capability.ROLLING_SPRING,
        Capability.COHESION,
    }
)
"""Of what few engines have."""

CAPABILITIES_3D = SPRINGS_3D | {
    Capability.LEVER_ARM_OVERLAP,
    Capability.UNLOADING_FORCE,
    Capability.ROTATING_WALLS,
    Capability.HELD_MOTION,
    Capability.ROLLING_SPRING,
    Capability.TWISTING_SPRING,
    Capability.SURFACE_DMT,
}

CAPABILITIES = (
    frozenset(Capability)
    - GRAINS
    - (SPACE - CAPABILITIES_3D)
    - (EXTRAS - YADE_HAS)
    - {
        Capability.RESTITUTION,
        Capability.LEVER_ARM_RADIUS,
        Capability.LEVER_ARM_TORQUE,
        Capability.SLIP_MIDDLE,
        Capability.FIXED_DISKS,
        Capability.HELD_MOTION,
        Capability.QUASI_STATIC,
    }
)

EXPLICIT = "https://yade-dem.org/doc/formulation.html"
"""States that motion is integrated explicitly, with inertia."""

NOTE_ARM = "lever arm of shear torque and slip: R - overlap/2, for disks and walls (ScGeom)"
NOTE_WALL = "a wall's velocity enters the slip at the middle of the overlap"
NOTE_ROTATION = (
    "shear forces are turned with the contact normal to first order (ScGeom::rotate): they grow by half the square of the "
    "normal's rotation in each step"
)
NOTE_ROLLING = {
    "viscous": (
        "rolling resistance by ViscElPhys with mRtype 1, documented as a constant torque: YADE drops the unit vector of the relative spin, "
        "so that it is the viscous torque mR fn omega"
    ),
    "elastic-plastic": "rolling resistance by Law2_ScGeom6D_CohFrictPhys_CohesionMoment with useIncrementalForm",
}
NOTE_ROLLING_ONE_LAW = "rolling springs are in a law without dashpots and without other rolling resistance"
NOTE_COHESION = "linear cohesion is a spring of kn - cohesion; friction and rolling see kn/(kn - cohesion) of its force"
NOTE_COHESION_DAMPED = "YADE's dashpot never pulls"
NOTE_DASHPOT = "dashpot by Law2_ScGeom_ViscElPhys_Basic, with the velocity of t_{n-1/2}; never tension"

# Notes on scenes of 3D.
NOTE_ARM_3D = "lever arm of shear torque and slip: R - overlap/2, for spheres and planes (ScGeom), whose slip is that of mid-overlap"
NOTE_ROTATION_3D = (
    "shear forces are turned with the normal and about it by the mean spin, to first order each (ScGeom::rotate)"
)
NOTE_DASHPOT_3D = (
    "dashpot with the velocity of t_{n-1/2}; never tension: rebounds are faster than with one that may pull"
)
NOTE_ADHESION_DAMPED = "beside adhesion YADE's dashpot pulls with the pull-off force at most"
NOTE_RESISTANCE = (
    "rolling springs by Law2_ScGeom_MindlinPhys_Mindlin (includeMoment) and Law2_ScGeom6D_CohFrictPhys_CohesionMoment"
)
NOTE_RESISTANCE_DAMPED = "rolling and twisting springs of YADE have no dashpots, nor has a linear contact beside them"
NOTE_TWISTING_HERTZ = "twisting springs of MindlinPhys have no cap"
NOTE_PULL = "YADE's friction has the pull-off once beside the normal force (friction_pull = 1)"
NOTE_NO_CAP = "a cap of 0 is none in MindlinPhys"


@cache
def _version(program: str) -> tuple[str | None, str]:
    """Version of the YADE at this path, or None and the reason."""
    try:
        done = subprocess.run(
            [program, "--version"],
            capture_output=True,
            text=True,
            timeout=30,
            env=guarded_environment(_clean()),
            check=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return None, f"{program} --version fails: {error}"
    _, found, version = done.stdout.partition("Yade version:")
    if not found or not version.strip():
        return None, f"{program} --version answers {done.stdout.strip()[:80]!r}"
    return version.split()[0], ""


def _clean() -> dict[str, str]:
    """Environment without what belongs to another Python or to a display."""
    return {key: value for key, value in os.environ.items() if key not in _FOREIGN}


FACTS = EngineInfo(
    id="yade",
    name="YADE",
    scheme="central-difference",
    contact="spring",
    differences={each: str(each) for each in (Difference.DASHPOT_NEVER_PULLS, Difference.SPRINGS_TURN_WITH_TWIST)},
    licence="GPL-2.0-or-later",
    how_it_runs="subprocess `yade -n -x -j1`, scene and history as JSON",
    install="apt-get install yade",
    capabilities=CAPABILITIES,
    turns_shear="to first order",
    out_of_scope={Capability.QUASI_STATIC: EXPLICIT},
)


class Yade(SpringEngine):
    """YADE: Cundall-Strack contacts, leap-frog, one thread."""

    id = "yade"
    facts = FACTS
    driver = Path(__file__).with_name("driver.py")
    dashpot_note = NOTE_DASHPOT
    capabilities_3d = CAPABILITIES_3D
    dashpot_note_3d = NOTE_DASHPOT_3D
    chosen: Mapping[str, Any] = {
        "reported_velocities": "synchronised to t_n with the forces at t_n",
        "walls": "fixed boxes placed by the driver at t_n before the forces at t_n",
        "lever_arm": "R - overlap/2",
        "wall_velocity_at": "mid-overlap",
        "avoidGranularRatcheting": False,
        "newton_damping": 0.0,
    }
    chosen_3d: Mapping[str, Any] = {
        "reported_velocities": "synchronised to t_n with the forces at t_n",
        "walls": "fixed boxes placed by the driver at t_n before the forces at t_n",
        "lever_arm": "R - overlap/2",
        "wall_velocity_at": "mid-overlap",
        "avoidGranularRatcheting": False,
        "newton_damping": 0.0,
    }

    def installed(self) -> tuple[str | None, str]:
        """Version of YADE; it is asked once per process."""
        program = shutil.which("yade")
        return _version(program) if program else (None, "there is no command `yade` on PATH")

    def command(self) -> Sequence[str]:
        """YADE without display, ending with the script, on one thread."""
        return [shutil.which("yade") or "yade", "-n", "-x", "-j1", str(self.driver)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """Its own home: YADE starts IPython, which writes there."""
        home = str(folder)
        return {
            **_clean(),
            "HOME": home,
            "TMPDIR": home,
            "IPYTHONDIR": home,
            "MPLCONFIGDIR": home,
            "OMP_NUM_THREADS": "1",
        }

    def fit(self, scene: Scene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG002
        """One lever arm for all contacts, and a wall's velocity at the middle of the overlap."""
        fit.near |= fit.missing & ARMS
        fit.missing -= ARMS
        turning = [
            law for wall in scene.walls if wall_turns(wall.motion) for law in wall_laws(scene, wall) if law.mu > 0.0
        ]
        fit.approximate = any(law.wall_velocity_at != "mid-overlap" for law in turning)
        laws = scene.laws_in_use
        models = sorted({law.rolling.model for law in laws if law.rolling}) if scene.disks.rotating.any() else []
        fit.notes += [NOTE_ROLLING[model] for model in models if model in NOTE_ROLLING]
        damped = any(law.beta > 0.0 or (law.rolling is not None and law.rolling.beta > 0.0) for law in laws)
        if "elastic-plastic" in models and (len(models) > 1 or damped):
            fit.lacks(Capability.ROLLING_SPRING, NOTE_ROLLING_ONE_LAW)
        if any(law.cohesion > 0.0 for law in laws):
            fit.notes.append(NOTE_COHESION)
            if any(law.cohesion > 0.0 and law.beta > 0.0 for law in laws):
                fit.lacks(Capability.COHESION, NOTE_COHESION_DAMPED)
        if any(law.mu > 0.0 for law in laws):
            fit.notes += [NOTE_ARM, NOTE_ROTATION, *([NOTE_WALL] if turning else [])]

    def fit_3d(self, scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG002
        """One lever arm for all contacts; which springs resist spins beside which law."""
        fit_arms(scene, fit, "overlap", "overlap")
        laws = scene.laws_in_use
        if any(map(carries_shear, laws)):
            fit.notes += [NOTE_ARM_3D, NOTE_ROTATION_3D]
        fit.approximate = any(law.beta > 0.0 for law in laws)
        if any(law.surface_energy > 0.0 and law.friction_pull != 1.0 and carries_shear(law) for law in laws):
            fit.approximate = True
            fit.notes.append(NOTE_PULL)
        if any(law.surface_energy > 0.0 and law.beta > 0.0 for law in laws):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_ADHESION_DAMPED)
        resisted = [law for law in laws if law.rolling or law.twisting] if scene.spheres.rotating.any() else []
        if resisted:
            fit.notes.append(NOTE_RESISTANCE)
            springs = [each for law in resisted for each in (law.rolling, law.twisting) if each is not None]
            linear = any(not law.hertz for law in resisted)
            if any(each.beta > 0.0 for each in springs) or (
                linear and any(law.beta > 0.0 and not law.hertz for law in laws)
            ):
                fit.lacks(Capability.ROLLING_SPRING, NOTE_RESISTANCE_DAMPED)
            if any(law.hertz and law.twisting for law in resisted):
                fit.lacks(Capability.TWISTING_SPRING, NOTE_TWISTING_HERTZ)
            if any(law.hertz and law.rolling and law.rolling.mu == 0.0 for law in resisted):
                fit.lacks(Capability.ROLLING_SPRING, NOTE_NO_CAP)
        if uneven_planes(scene):
            fit.equivalent = True
            fit.notes.append(NOTE_MEAN)


ENGINE = Yade()
