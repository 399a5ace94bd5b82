"""Adapter of LIGGGHTS (explicit DEM of spheres, GPL): Debian's library in its own process, walls as moving meshes."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneWall, Scene, SphereScene, Wall
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.capabilities import SPACE, Capability
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.api.support import contact_steps
from ninedisk.harness.engines.lengths import wall_reach
from ninedisk.harness.engines.process import without_mpi
from ninedisk.harness.engines.spring import (
    ARMS,
    NOTE_OVERDAMPED,
    NOTE_UNIFORM,
    SPRINGS_3D,
    Fit,
    SpringEngine,
    carries_shear,
    fit_arms,
    hertz,
    sphere_laws,
    uniform,
)
from ninedisk.harness.engines.symmetry import no_disk_can_turn
from ninedisk.harness.run.process_guard import guarded_environment

DRIVER = Path(__file__).with_name("driver.py")
LIBRARY = "libliggghts.so.3"
LDCONFIG = "/sbin/ldconfig"
CAPABILITIES_3D = (SPRINGS_3D - {Capability.CURVED_WALL_MOTION}) | {
    Capability.LEVER_ARM_OVERLAP,
    Capability.UNLOADING_NONE,
}
CAPABILITIES = frozenset(
    {
        Capability.LINEAR_CONTACT,
        Capability.SHEAR_SPRING,
        Capability.FRICTION,
        Capability.CONTACT_DAMPING,
        Capability.GLOBAL_DAMPING_CENTRAL,
        Capability.GLOBAL_DAMPING_LAGGED,
        Capability.MOVING_WALLS,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.PRELOAD,
        Capability.SLIP_END,
    }
) | (SPACE & CAPABILITIES_3D)
OF_TURNING = ARMS | {Capability.DISK_INERTIA}
"""What no engine needs where no disk turns."""

NOTE_SYMMETRY = (
    "by symmetry no disk of this scene turns (each lies on a mirror of it), so that the inertia of LIGGGHTS' spheres, 2/5 m R^2, "
    "and its lever arms play no part"
)
NOTE_SPHERE = "particles are spheres, I = 2/5 m R^2: disks that friction turns cannot be expressed"
NOTE_SPIN = "fix viscous leaves spins alone: a spin that global damping should slow down cannot be expressed"
NOTE_DASHPOT = "dashpot with the velocity of t_{n-1/2}; never tension (limitForce)"
NOTE_WALL_START = "dashpots see walls at rest at time 0, and their velocity from the first step on"
NOTE_SEGMENTS = "walls change their velocity at contact steps only: a segment of motion ends within a step"
NOTE_PRELOAD = "a preload is made for disks that touch nothing but one rough wall"

# Notes on scenes of 3D.
NOTE_ARM = "lever arm of shear torque and slip: R - overlap/2, for spheres and planes"
NOTE_PROJECTION = (
    "shear displacements are projected on the new tangent plane: each step takes half the square of its rotation off"
)
NOTE_DASHPOT_3D = "dashpot with the velocity of t_{n-1/2}; it may pull (limitForce off)"
NOTE_PULLED = "where a dashpot pulls LIGGGHTS cuts off friction at mu times its pull, the scene at 0"
NOTE_KEPT = "two spheres that part and soon touch again go on from the shear displacement that they parted with"
NOTE_ONE_LAW = "one normal model for all contacts: linear and Hertz' beside each other are two"
NOTE_MATERIALS = (
    "E* and G* of a contact come of the E and nu (0 to 0.5) of each body: no such materials have those of this scene"
)
NOTE_KINDS = "constants are tables of atom types: at most 50 masses with dashpots of the linear law"
KINDS = 50
RIGID = 1e-13
"""Compliance of a rigid wall in units of the spheres': below what forces show."""


@cache
def _library() -> tuple[str, str]:
    """Path of LIGGGHTS' library and "", or "" and the reason."""
    try:
        done = subprocess.run(
            [LDCONFIG, "-p"], capture_output=True, text=True, timeout=30, env=guarded_environment(), check=True
        )
    except (OSError, subprocess.SubprocessError) as error:
        return "", f"{LDCONFIG} -p fails: {error}"
    for line in done.stdout.splitlines():
        name, _, path = line.partition("=>")
        if name.split()[:1] == [LIBRARY] and Path(path.strip()).exists():
            return os.path.realpath(path.strip()), ""
    return "", f"there is no library {LIBRARY}"


FACTS = EngineInfo(
    id="liggghts",
    name="LIGGGHTS",
    scheme="central-difference",
    contact="spring",
    differences={each: str(each) for each in (Difference.FRICTION_WHILE_PULLED, Difference.SHEAR_KEEPS_TWIST)},
    licence="GPL-2.0-or-later",
    how_it_runs="subprocess: Python with LIGGGHTS as a library, scene and history as JSON",
    install="apt-get install liggghts",
    capabilities=CAPABILITIES,
    turns_shear="to first order",
)


class Liggghts(SpringEngine):
    """LIGGGHTS: hooke/stiffness contacts with history, velocity Verlet, one thread."""

    id = "liggghts"
    facts = FACTS
    driver = DRIVER
    dashpot_note = NOTE_DASHPOT
    capabilities_3d = CAPABILITIES_3D
    dashpot_note_3d = NOTE_DASHPOT_3D
    chosen: Mapping[str, Any] = {
        "global damping": "fix viscous; central form by masses times 1 + xi dt/2",
        "reported_velocities": "synchronised to t_n with the forces at t_n",
        "walls": "one triangle each, fix move/mesh linear/variable",
        "particles": "spheres at z = 0, forces along z set to 0",
        "gammat": 0.0,
        "neigh_modify": "delay 0 every 1 check yes",
    }
    chosen_3d: Mapping[str, Any] = {
        "reported_velocities": "synchronised to t_n with the forces at t_n",
        "walls": "one triangle each, fix move/mesh linear/variable",
        "tangential_damping": "off",
        "limitForce": "off",
        "neigh_modify": "delay 0 every 1 check yes",
    }

    def installed(self) -> tuple[str | None, str]:
        """Version in the name of LIGGGHTS' library, which is not loaded."""
        path, reason = _library()
        version = re.search(r"\.so\.(\d+\.\d+\.\d+)$", path)
        if path and not version:
            reason = f"the name of its library, {path}, holds no version"
        return version[1] if version else None, reason

    def environment(self, folder: Path) -> Mapping[str, str]:
        """One thread, no traces of a surrounding MPI run, and MPI without network devices, whose search takes longer than most runs."""
        alone = {"OMPI_MCA_btl": "self", "OMPI_MCA_pml": "ob1", "OMPI_MCA_ess_singleton_isolated": "1"}
        return {**without_mpi(super().environment(folder)), **alone}

    def fit(self, scene: Scene, numerics: Numerics, fit: Fit) -> None:
        """No disk may turn, by blocking or by symmetry, and the walls' motion must be a polygon in time."""
        if Capability.DISK_INERTIA in fit.missing:
            symmetric = no_disk_can_turn(scene)
            fit.notes.append(NOTE_SYMMETRY if symmetric else NOTE_SPHERE)
            fit.missing -= OF_TURNING if symmetric else set()
        if scene.xi > 0.0 and scene.disks.omega[scene.disks.rotating].any():
            central = numerics.damping_form == "central"
            damping = Capability.GLOBAL_DAMPING_CENTRAL if central else Capability.GLOBAL_DAMPING_LAGGED
            fit.lacks(damping, NOTE_SPIN)
        if Capability.CURVED_WALL_MOTION not in fit.missing and not steps_hold_segments(scene, numerics):
            fit.lacks(Capability.MOVING_WALLS, NOTE_SEGMENTS)
        if any(scene.initial_shear.values()) and not _can_preload(scene):
            fit.lacks(Capability.PRELOAD, NOTE_PRELOAD)
        if any(wall.law.beta > 0.0 and wall.motion and any(wall.motion[0].velocity) for wall in scene.walls):
            fit.equivalent = True
            fit.notes.append(NOTE_WALL_START)

    def fit_3d(self, scene: SphereScene, numerics: Numerics, fit: Fit) -> None:
        """One normal model, materials that have the scene's moduli, walls on polygons in time."""
        fit_arms(scene, fit, "overlap", "overlap")
        laws = scene.laws_in_use
        if any(map(carries_shear, laws)):
            fit.notes += [NOTE_ARM, NOTE_PROJECTION]
        if any(map(carries_shear, sphere_laws(scene))):
            fit.approximate = True
            fit.notes.append(NOTE_KEPT)
        if any(law.beta > 0.0 and carries_shear(law) for law in laws):
            fit.approximate = True
            fit.notes.append(NOTE_PULLED)
        if not uniform(scene):
            fit.lacks(Capability.DISK_INERTIA, NOTE_UNIFORM)
        if any(law.beta >= 1.0 and law.hertz for law in laws):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_OVERDAMPED)
        if len({law.hertz for law in laws}) > 1:
            fit.lacks(Capability.MATERIALS, NOTE_ONE_LAW)
        elif laws and laws[0].hertz and materials(scene) is None:
            fit.lacks(Capability.HERTZ_MINDLIN, NOTE_MATERIALS)
        elif any(law.beta > 0.0 and not law.hertz for law in laws) and len(set(scene.spheres.mass.tolist())) > KINDS:
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_KINDS)
        if not fit.missing & {Capability.ROTATING_WALLS, Capability.CURVED_WALL_MOTION} and not steps_hold_segments(
            scene, numerics
        ):
            fit.lacks(Capability.MOVING_WALLS, NOTE_SEGMENTS)

    def extra(self, scene: Scene | SphereScene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Also materials of Hertz' law, the walls' velocities by contact step, the length of walls, and where the library is."""
        given = super().extra(scene, numerics, folder)
        return {
            **given,
            "elastic": materials(scene) if isinstance(scene, SphereScene) and hertz(scene) else [],
            "wall_legs": [motion_segments(wall, given["contact_dt"]) for wall in scene.walls],
            "reach": wall_reach(scene, numerics, self.id),
            "library": _library()[0],
            "version": self.info().version,
        }


def _can_preload(scene: Scene) -> bool:
    """Whether every preloaded contact is that of a disk with a rough wall and with nothing else."""
    x, radius, n = scene.disks.x, scene.disks.radius, len(scene.disks)
    for (i, j), force in scene.initial_shear.items():
        if not force:
            continue
        law = scene.law((i, j))
        if j < n or not carries_shear(law):
            return False
        away = np.hypot(*(x - x[i]).T) - radius - radius[i]
        away[i] = np.inf
        heights = [(x[i] - wall.point) @ np.asarray(wall.normal) - radius[i] for wall in scene.walls]
        if (away < 0.0).any() or sum(height < 0.0 for height in heights) != 1:
            return False
    return True


def materials(scene: SphereScene) -> list[tuple[float, float]] | None:
    """E [Pa] and nu of the spheres' materials and of the walls whose contacts have the scene's E* and G*; None where there are none.

    The compliances ``(1 - nu^2)/E`` of two bodies add up to ``1/E*``, and ``2 (2 - nu)(1 + nu)/E`` to ``1/G*`` where there is friction.
    """
    names = sorted(set(scene.spheres.material))
    first = [scene.spheres.material.index(name) for name in names]
    last = [len(scene.spheres) - 1 - scene.spheres.material[::-1].index(name) for name in names]
    pairs = [(a, b) for a in range(len(names)) for b in range(a, len(names))]
    bodies = [(a, b, tuple(sorted((first[a], last[b])))) for a, b in pairs]
    found = [(a, b, scene.law((i, j))) for a, b, (i, j) in bodies if i != j]
    found += [
        (a, len(names) + w, scene.law((i, len(scene.spheres) + w)))
        for a, i in enumerate(first)
        for w in range(len(scene.walls))
    ]
    size = len(names) + len(scene.walls)

    def shares(wanted: list[tuple[int, int, float]]) -> FloatArray | None:
        matrix = np.zeros((len(wanted), size))
        for row, (a, b, _) in zip(matrix, wanted, strict=True):
            row[a] += 1.0
            row[b] += 1.0
        values = np.array([value for *_, value in wanted])
        solved: FloatArray = np.linalg.lstsq(matrix, values, rcond=None)[0]
        return solved if np.abs(matrix @ solved - values).max(initial=0.0) <= 1e-12 * values.max(initial=0.0) else None

    normal = shares([(a, b, 1.0 / law.e_star) for a, b, law in found])
    shear = shares([(a, b, 1.0 / law.g_star) for a, b, law in found if carries_shear(law)])
    if normal is None or shear is None:
        return None
    least = RIGID * np.abs(normal).max(initial=0.0)
    answer = []
    for k in range(size):
        asked = any(carries_shear(law) for a, b, law in found if k in (a, b))
        if normal[k] < -least or (asked and shear[k] < -4.0 * least):
            return None
        rigid = normal[k] <= 10.0 * least
        ratio = shear[k] / normal[k] if asked and not rigid else 5.0
        if not 4.0 - 1e-12 <= ratio <= 6.0 + 1e-12:
            return None
        nu = (ratio - 4.0) / (ratio - 2.0)
        nu = min(max(nu, 0.0), 0.5)
        answer.append(((1.0 - nu**2) / max(float(normal[k]), least), float(nu)))
    return answer


def steps_hold_segments(scene: Scene | SphereScene, numerics: Numerics) -> bool:
    """Whether every segment of the walls' motion ends at a contact step (relative tolerance 1e-9: a decimal's round-off)."""
    if not any(wall.motion for wall in scene.walls):
        return True
    _, contact_dt = contact_steps(scene, numerics.replace(allow_unstable=True))
    ends = [end for wall in scene.walls for end in np.cumsum([s.duration for s in wall.motion]) if np.isfinite(end)]
    return all(abs(end / contact_dt - round(end / contact_dt)) <= 1e-9 * end / contact_dt for end in ends)


def motion_segments(wall: Wall | PlaneWall, contact_dt: float) -> list[tuple[int, int, tuple[float, ...]]]:
    """Contact steps after which and up to which the wall moves, and its velocity [m/s]; rests left out."""
    begin, end = 0, 0.0
    found: list[tuple[int, int, tuple[float, ...]]] = []
    for segment in wall.motion:
        end += segment.duration
        last = 2**31 - 2 if np.isinf(end) else round(end / contact_dt)
        if any(segment.velocity):
            found.append((begin, last, segment.velocity))
        begin = last
    return found


ENGINE = Liggghts()
