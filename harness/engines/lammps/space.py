"""Spheres in space in LAMMPS: what of them it has, and how its conventions are the scene's."""

from __future__ import annotations

from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import UNLOADING, Capability
from ninedisk.harness.engines.spring import (
    IN_SPACE,
    NOTE_MEAN,
    NOTE_OVERDAMPED,
    NOTE_UNIFORM,
    Fit,
    InSpace,
    fit_arms,
    plane_laws,
    rough,
    sphere_laws,
    turns,
    uneven_planes,
    uniform,
)

NOTE_ARMS = (
    "pair_style granular: lever arm R - overlap/2 of the shear torque between spheres, R of their slip and at walls"
)
NOTE_DASHPOT = "dashpot by coeff_restitution, with the velocity of t_{n-1/2}"
NOTE_PULLED = "where a dashpot pulls LAMMPS cuts off friction at mu times its pull, the scene at 0"
NOTE_ADHESION = "LAMMPS refuses the law's dashpot beside surface energy"
NOTE_PULL = "LAMMPS' friction has twice the pull-off beside the normal force (friction_pull = 2)"
NOTE_JKR_WALL = "a region of LAMMPS lets go at gap 0, where a neck of JKR's still holds"
NOTE_RESISTANCE = "rolling and twisting sds: stiffnesses kr/R^2 and kr, R the reduced radius"
NOTE_TWIST = "at its cap LAMMPS' twisting torque has the sign of the twist's rate, the scene's that of its spring"
NOTE_RESISTANCE_DAMPED = "rolling and twisting sds cut off the sum of spring and dashpot, the scene its spring alone"
NOTE_RESISTANCE_WALLS = "LAMMPS' rolling and twisting do not see the spin of a wall"
NOTE_ONE_AXIS = "a region of LAMMPS turns about one axis"


def fit(scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG001
    """Lever arms, walls that turn about one axis, what dashpots and surface energy can be together."""
    fit_arms(scene, fit, "torque-overlap", "radius")
    laws = scene.laws_in_use
    if any(map(rough, sphere_laws(scene))):
        fit.notes.append(NOTE_ARMS)
    if not uniform(scene):
        fit.lacks(Capability.DISK_INERTIA, NOTE_UNIFORM)
    if any(law.beta >= 1.0 for law in laws):
        fit.lacks(Capability.CONTACT_DAMPING, NOTE_OVERDAMPED)
    if any(law.beta > 0.0 and rough(law) for law in laws):
        fit.approximate = True
        fit.notes.append(NOTE_PULLED)
    if any(law.surface_energy > 0.0 and law.beta > 0.0 for law in laws):
        fit.lacks(Capability.CONTACT_DAMPING, NOTE_ADHESION)
    if any(law.surface_energy > 0.0 and law.friction_pull != 2.0 and rough(law) for law in laws):
        fit.approximate = True
        fit.notes.append(NOTE_PULL)
    if any(
        law.surface_energy > 0.0 and law.surface == "jkr" for wall in scene.walls for law in plane_laws(scene, wall)
    ):
        fit.lacks(Capability.SURFACE_JKR, NOTE_JKR_WALL)
    resisted = [each for law in laws for each in (law.rolling, law.twisting) if each is not None]
    if resisted and scene.spheres.rotating.any():
        fit.notes.append(NOTE_RESISTANCE)
        if any(law.twisting for law in laws):
            fit.approximate = True
            fit.notes.append(NOTE_TWIST)
        if any(each.beta > 0.0 for each in resisted):
            fit.lacks(Capability.ROLLING_SPRING, NOTE_RESISTANCE_DAMPED)
        if any(
            turns(w.motion) and any(law.rolling or law.twisting for law in plane_laws(scene, w)) for w in scene.walls
        ):
            fit.lacks(Capability.ROTATING_WALLS, NOTE_RESISTANCE_WALLS)
    for wall in scene.walls:
        spins = np.array([segment.angular_velocity for segment in wall.motion]).reshape(-1, 3)
        if np.linalg.matrix_rank(spins, tol=1e-12 * np.abs(spins).max(initial=0.0)) > 1:
            fit.lacks(Capability.ROTATING_WALLS, NOTE_ONE_AXIS)
    if uneven_planes(scene):
        fit.equivalent = True
        fit.notes.append(NOTE_MEAN)


CHOSEN: dict[str, Any] = {
    "pair style": "granular: hooke or hertz, linear_history or mindlin, mindlin/force, mindlin_rescale",
    "reported_velocities": "synchronised to t_n with the forces at t_n",
    "walls": "fix wall/gran/region on planes that move and rotate by variables of the step",
    "lever_arm": "R - overlap/2 of the torque between spheres, R of their slip and at walls",
    "limit_damping": False,
    "neigh_modify": "delay 0 every 1 check yes",
}

LAMMPS_IN_SPACE = InSpace(
    capabilities=IN_SPACE
    | frozenset(UNLOADING.values())
    | {
        Capability.LEVER_ARM_RADIUS,
        Capability.LEVER_ARM_TORQUE,
        Capability.ROTATING_WALLS,
        Capability.HELD_MOTION,
        Capability.ROLLING_SPRING,
        Capability.TWISTING_SPRING,
        Capability.SURFACE_DMT,
        Capability.SURFACE_JKR,
    },
    fit=fit,
    chosen=CHOSEN,
    dashpot_note=NOTE_DASHPOT,
)
