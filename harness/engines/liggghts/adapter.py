"""Adapter of LIGGGHTS (explicit DEM of spheres, GPL): Debian's library in a process of its own, walls as moving meshes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, Wall
from ninedisk.harness.api.capabilities import LEVER_ARMS, Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.plane import no_disk_can_turn, wall_reach
from ninedisk.harness.engines.spring import NOTE_SLIP_END, OF_SLIP_AT, contact_steps, laws_in_use
from ninedisk.harness.run.warden import owned
from ninedisk.harness.wire.external import ExternalEngine

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
)
OF_TURNING = frozenset({Capability.DISK_INERTIA, *LEVER_ARMS.values()})
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


class Liggghts(ExternalEngine):
    """LIGGGHTS: hooke/stiffness contacts with history, velocity Verlet, one thread."""

    id = "liggghts"

    def info(self) -> EngineInfo:
        """Facts about LIGGGHTS; its version is that in the name of its library, which is not loaded."""
        path, reason = _library()
        version = re.search(r"\.so\.(\d+\.\d+\.\d+)$", path)
        if path and not version:
            reason = f"the name of its library, {path}, holds no version"
        return EngineInfo(
            id=self.id,
            name="LIGGGHTS",
            version=version[1] if version else None,
            scheme="central-difference",
            contact="spring",
            licence="GPL-2.0-or-later",
            how_it_runs="subprocess: Python with LIGGGHTS as a library, scene and history as JSON",
            precision="float64",
            threads=1,
            install="apt-get install liggghts",
            capabilities=CAPABILITIES,
            not_installed_because=reason,
            turns_shear="to first order",
        )

    def command(self) -> Sequence[str]:
        """This Python with the driver; no user site, no current folder on its path."""
        return [sys.executable, "-P", "-s", str(DRIVER)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """One thread, no traces of a surrounding MPI run, and MPI without network devices."""
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("OMPI_", "PMIX_", "PRTE_"))}
        return {**kept, "TMPDIR": str(folder), "OMP_NUM_THREADS": "1", "OMPI_MCA_btl": "self"}

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """EXACT where no disk turns, by blocking or by symmetry, and the walls' motion is a polygon in time.

        EQUIVALENT where dashpots see v_{n-1/2} though the numerics ask for the central form, or walls at rest at time 0, and where
        slip is asked for in the middle of the step.
        """
        missing, laws = set(capabilities_needed(scene, numerics)), laws_in_use(scene)
        notes: list[str] = []
        early = missing & OF_SLIP_AT - CAPABILITIES
        missing -= early
        notes += [NOTE_SLIP_END] if early else []
        if Capability.DISK_INERTIA in missing:
            symmetric = no_disk_can_turn(scene)
            notes.append(NOTE_SYMMETRY if symmetric else NOTE_SPHERE)
            missing -= OF_TURNING if symmetric else set()
        missing -= CAPABILITIES
        if scene.xi > 0.0 and scene.disks.omega[scene.disks.rotating].any():
            central = numerics.damping_form == "central"
            missing.add(Capability.GLOBAL_DAMPING_CENTRAL if central else Capability.GLOBAL_DAMPING_LAGGED)
            notes.append(NOTE_SPIN)
        if Capability.CURVED_WALL_MOTION not in missing and not _steps_hold_segments(scene, numerics):
            missing.add(Capability.MOVING_WALLS)
            notes.append(NOTE_SEGMENTS)
        if any(scene.initial_shear.values()) and not _can_preload(scene):
            missing.add(Capability.PRELOAD)
            notes.append(NOTE_PRELOAD)
        damped = any(law.beta > 0.0 for law in laws)
        notes += [NOTE_DASHPOT] if damped else []
        if missing:
            return Support(SupportLevel.NO, tuple(sorted(missing)), tuple(notes))
        starts = any(wall.law.beta > 0.0 and wall.motion and any(wall.motion[0].velocity) for wall in scene.walls)
        notes += [NOTE_WALL_START] if starts else []
        late = starts or bool(early) or (damped and numerics.damping_form == "central")
        return Support(SupportLevel.EQUIVALENT if late else SupportLevel.EXACT, (), tuple(notes))

    def extra(self, scene: Scene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Contact step, the walls' velocities and poses by contact step, the length of walls, and where the library is."""
        count, contact_dt = contact_steps(scene, numerics)
        path = folder / "wall_path.npy"
        np.save(path, wall_path(scene, contact_dt, count * numerics.n_steps))
        return {
            "substeps": count,
            "contact_dt": contact_dt,
            "wall_path": str(path),
            "wall_legs": [_legs(wall, contact_dt) for wall in scene.walls],
            "reach": wall_reach(scene, numerics, self.id),
            "library": _library()[0],
            "version": self.info().version,
        }

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run LIGGGHTS; raises as `ExternalEngine.run`."""
        done = super().run(scene, numerics, watch)
        count, contact_dt = contact_steps(scene, numerics)
        chosen = {
            "contact_dt": contact_dt,
            "contact_steps_per_dt": count,
            "damping_form": numerics.damping_form,
            "global damping": "fix viscous; central form by masses times 1 + xi dt/2",
            "start": "half kick: v(1/2) = v0 + dt/2 (F0/m - xi v0), set by the driver",
            "reported_velocities": "synchronised to t_n with the forces at t_n",
            "walls": "one triangle each, fix move/mesh linear/variable",
            "particles": "spheres at z = 0, forces along z set to 0",
            "gammat": 0.0,
            "neigh_modify": "delay 0 every 1 check yes",
            "threads": 1,
        }
        return EngineRun(history=done.history, timings=done.timings, settings={**chosen, **done.settings})


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
        if j < n or not (law.mu > 0.0 and law.ks > 0.0):
            return False
        away = np.hypot(*(x - x[i]).T) - radius - radius[i]
        away[i] = np.inf
        heights = [(x[i] - wall.point) @ np.asarray(wall.normal) - radius[i] for wall in scene.walls]
        if (away < 0.0).any() or sum(height < 0.0 for height in heights) != 1:
            return False
    return True


ENGINE = Liggghts()
