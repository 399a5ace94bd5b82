"""Adapter of LIGGGHTS (explicit DEM of spheres, GPL): Debian's library in a process of its own, walls as moving meshes."""

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
from ninedisk.core.scene import Scene, SphereScene, Wall
from ninedisk.harness.api.capabilities import SPACE, Capability
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.api.support import contact_steps
from ninedisk.harness.engines.liggghts.space import LIGGGHTS_IN_SPACE
from ninedisk.harness.engines.plane import no_disk_can_turn, wall_reach
from ninedisk.harness.engines.process import without_mpi
from ninedisk.harness.engines.spring import ARMS, Fit, SpringEngine, rough
from ninedisk.harness.run.warden import owned

DRIVER = Path(__file__).with_name("driver.py")
LIBRARY = "libliggghts.so.3"
LDCONFIG = "/sbin/ldconfig"
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
) | (SPACE & LIGGGHTS_IN_SPACE.capabilities)
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


@cache
def _library() -> tuple[str, str]:
    """Path of LIGGGHTS' library and "", or "" and the reason."""
    try:
        done = subprocess.run([LDCONFIG, "-p"], capture_output=True, text=True, timeout=30, env=owned(), check=True)
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
    in_space = LIGGGHTS_IN_SPACE
    chosen: Mapping[str, Any] = {
        "global damping": "fix viscous; central form by masses times 1 + xi dt/2",
        "reported_velocities": "synchronised to t_n with the forces at t_n",
        "walls": "one triangle each, fix move/mesh linear/variable",
        "particles": "spheres at z = 0, forces along z set to 0",
        "gammat": 0.0,
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
        if Capability.CURVED_WALL_MOTION not in fit.missing and not _steps_hold_segments(scene, numerics):
            fit.lacks(Capability.MOVING_WALLS, NOTE_SEGMENTS)
        if any(scene.initial_shear.values()) and not _can_preload(scene):
            fit.lacks(Capability.PRELOAD, NOTE_PRELOAD)
        if any(wall.law.beta > 0.0 and wall.motion and any(wall.motion[0].velocity) for wall in scene.walls):
            fit.equivalent = True
            fit.notes.append(NOTE_WALL_START)

    def extra(self, scene: Scene | SphereScene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Also the walls' velocities by contact step, the length of walls, and where the library is."""
        given = super().extra(scene, numerics, folder)
        if isinstance(scene, SphereScene):
            return {**given, "library": _library()[0], "version": self.info().version}
        return {
            **given,
            "wall_legs": [_legs(wall, given["contact_dt"]) for wall in scene.walls],
            "reach": wall_reach(scene, numerics, self.id),
            "library": _library()[0],
            "version": self.info().version,
        }


def _steps_hold_segments(scene: Scene, numerics: Numerics) -> bool:
    """Whether every segment of the walls' motion ends at a contact step (relative tolerance 1e-9: a decimal's round-off)."""
    if not any(wall.motion for wall in scene.walls):
        return True
    _, contact_dt = contact_steps(scene, numerics.replace(allow_unstable=True))
    ends = [end for wall in scene.walls for end in np.cumsum([s.duration for s in wall.motion]) if np.isfinite(end)]
    return all(abs(end / contact_dt - round(end / contact_dt)) <= 1e-9 * end / contact_dt for end in ends)


def _legs(wall: Wall, contact_dt: float) -> list[tuple[int, int, tuple[float, float]]]:
    """Contact steps after which and up to which the wall moves, and its velocity [m/s]; rests left out."""
    legs, begin = [], 0
    for segment in wall.motion:
        last = 2**31 - 2 if np.isinf(segment.duration) else begin + round(segment.duration / contact_dt)
        if any(segment.velocity):
            legs.append((begin, last, segment.velocity))
        begin = last
    return legs


def _can_preload(scene: Scene) -> bool:
    """Whether every preloaded contact is that of a disk with a rough wall and with nothing else."""
    x, radius, n = scene.disks.x, scene.disks.radius, len(scene.disks)
    for (i, j), force in scene.initial_shear.items():
        if not force:
            continue
        law = scene.law((i, j))
        if j < n or not rough(law):
            return False
        away = np.hypot(*(x - x[i]).T) - radius - radius[i]
        away[i] = np.inf
        heights = [(x[i] - wall.point) @ np.asarray(wall.normal) - radius[i] for wall in scene.walls]
        if (away < 0.0).any() or sum(height < 0.0 for height in heights) != 1:
            return False
    return True


ENGINE = Liggghts()
