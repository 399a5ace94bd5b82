"""Spheres in space in YADE: what of them it has, and how its conventions are the scene's."""

from __future__ import annotations

from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.engines.spring import IN_SPACE, NOTE_MEAN, Fit, InSpace, fit_arms, rough, uneven_planes

NOTE_ARM = "lever arm of shear torque and slip: R - overlap/2, for spheres and planes (ScGeom), whose slip is that of mid-overlap"
NOTE_ROTATION = (
    "shear forces are turned with the normal and about it by the mean spin, to first order each (ScGeom::rotate)"
)
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; never tension: rebounds are faster than with one that may pull"
NOTE_ADHESION_DAMPED = "beside adhesion YADE's dashpot pulls with the pull-off force at most"
NOTE_RESISTANCE = (
    "rolling springs by Law2_ScGeom_MindlinPhys_Mindlin (includeMoment) and Law2_ScGeom6D_CohFrictPhys_CohesionMoment"
)
NOTE_RESISTANCE_DAMPED = "rolling and twisting springs of YADE have no dashpots, nor has a linear contact beside them"
NOTE_TWISTING_HERTZ = "twisting springs of MindlinPhys have no cap"
NOTE_PULL = "YADE's friction has the pull-off once beside the normal force (friction_pull = 1)"
NOTE_NO_CAP = "a cap of 0 is none in MindlinPhys"


def fit(scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG001
    """One lever arm for all contacts; which springs resist spins beside which law."""
    fit_arms(scene, fit, "overlap", "overlap")
    laws = scene.laws_in_use
    if any(map(rough, laws)):
        fit.notes += [NOTE_ARM, NOTE_ROTATION]
    fit.approximate = any(law.beta > 0.0 for law in laws)
    if any(law.surface_energy > 0.0 and law.friction_pull != 1.0 and rough(law) for law in laws):
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


CHOSEN: dict[str, Any] = {
    "reported_velocities": "synchronised to t_n with the forces at t_n",
    "walls": "fixed boxes placed by the driver at t_n before the forces at t_n",
    "lever_arm": "R - overlap/2",
    "wall_velocity_at": "mid-overlap",
    "avoidGranularRatcheting": False,
    "newton_damping": 0.0,
}

YADE_IN_SPACE = InSpace(
    capabilities=IN_SPACE
    | {
        Capability.LEVER_ARM_OVERLAP,
        Capability.UNLOADING_FORCE,
        Capability.ROTATING_WALLS,
        Capability.HELD_MOTION,
        Capability.ROLLING_SPRING,
        Capability.TWISTING_SPRING,
        Capability.SURFACE_DMT,
    },
    fit=fit,
    chosen=CHOSEN,
    dashpot_note=NOTE_DASHPOT,
)
