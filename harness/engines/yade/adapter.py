"""Adapter of YADE (explicit DEM, GPL): runs as a process of its own, disks as blocked spheres, walls as fixed boxes."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import GRAINS, LEVER_ARMS, Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.spring import NOTE_SLIP_END, OF_SLIP_AT, contact_steps, laws_in_use
from ninedisk.harness.run.warden import owned
from ninedisk.harness.wire.external import ExternalEngine

DRIVER = Path(__file__).with_name("driver.py")
_FOREIGN = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "VIRTUAL_ENV", "DISPLAY", "OMPI_COMM_WORLD_RANK")
CAPABILITIES = (
    frozenset(Capability)
    - GRAINS
    - {
        Capability.RESTITUTION,
        Capability.LEVER_ARM_RADIUS,
        Capability.LEVER_ARM_TORQUE,
        Capability.SLIP_MIDDLE,
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
NOTE_DASHPOT = "dashpot by Law2_ScGeom_ViscElPhys_Basic, with the velocity of t_{n-1/2}; never tension"


@cache
def _version(program: str) -> tuple[str | None, str]:
    """Version of the YADE at this path, or None and the reason."""
    try:
        done = subprocess.run(
            [program, "--version"], capture_output=True, text=True, timeout=30, env=owned(_clean()), check=True
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


class Yade(ExternalEngine):
    """YADE: Cundall-Strack contacts, leap-frog, one thread."""

    id = "yade"

    def info(self) -> EngineInfo:
        """Facts about YADE; its version is asked once per process."""
        program = shutil.which("yade")
        version, reason = _version(program) if program else (None, "there is no command `yade` on PATH")
        return EngineInfo(
            id=self.id,
            name="YADE",
            version=version,
            scheme="central-difference",
            contact="spring",
            licence="GPL-2.0-or-later",
            how_it_runs="subprocess `yade -n -x -j1`, scene and history as JSON",
            precision="float64",
            threads=1,
            install="apt-get install yade",
            capabilities=CAPABILITIES,
            not_installed_because=reason,
            turns_shear="to first order",
            out_of_scope={Capability.QUASI_STATIC: EXPLICIT},
        )

    def command(self) -> Sequence[str]:
        """YADE without display, ending with the script, on one thread."""
        return [shutil.which("yade") or "yade", "-n", "-x", "-j1", str(DRIVER)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """A home of its own: YADE starts IPython, which writes there."""
        home = str(folder)
        return {
            **_clean(),
            "HOME": home,
            "TMPDIR": home,
            "IPYTHONDIR": home,
            "MPLCONFIGDIR": home,
            "OMP_NUM_THREADS": "1",
        }

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """EXACT where YADE's conventions are the scene's.

        APPROXIMATE where a lever arm or wall velocity differs, EQUIVALENT where a dashpot sees v_{n-1/2} though the numerics
        ask for the central form, or slip is asked for in the middle of the step (the same physics, first order in the step).
        """
        missing = capabilities_needed(scene, numerics) - CAPABILITIES
        notes = _notes(scene)
        early = missing & OF_SLIP_AT
        missing -= early
        notes += (NOTE_SLIP_END,) if early else ()
        if missing - frozenset(LEVER_ARMS.values()):
            return Support(SupportLevel.NO, tuple(sorted(missing)), notes)
        if missing or _other_wall_velocity(scene):
            return Support(SupportLevel.APPROXIMATE, tuple(sorted(missing)), notes)
        late = numerics.damping_form == "central" and any(law.beta > 0.0 for law in laws_in_use(scene))
        return Support(SupportLevel.EQUIVALENT if late or early else SupportLevel.EXACT, (), notes)

    def extra(self, scene: Scene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Contact step and the walls' path at every contact step (a file: it can be long)."""
        count, contact_dt = contact_steps(scene, numerics)
        path = folder / "wall_path.npy"
        np.save(path, wall_path(scene, contact_dt, count * numerics.n_steps))
        return {"substeps": count, "contact_dt": contact_dt, "wall_path": str(path)}

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run YADE; raises as `ExternalEngine.run`."""
        done = super().run(scene, numerics, watch)
        count, contact_dt = contact_steps(scene, numerics)
        chosen = {
            "contact_dt": contact_dt,
            "contact_steps_per_dt": count,
            "damping_form": numerics.damping_form,
            "start": "half kick: v(1/2) = v0 + dt/2 (F0/m - xi v0), set by the driver",
            "reported_velocities": "synchronised to t_n with the forces at t_n",
            "walls": "fixed boxes placed by the driver at t_n before the forces at t_n",
            "lever_arm": "R - overlap/2",
            "wall_velocity_at": "mid-overlap",
            "avoidGranularRatcheting": False,
            "newton_damping": 0.0,
            "threads": 1,
        }
        return EngineRun(history=done.history, timings=done.timings, settings={**chosen, **done.settings})


def _notes(scene: Scene) -> tuple[str, ...]:
    laws = laws_in_use(scene)
    notes: list[str] = []
    if any(law.mu > 0.0 for law in laws):
        notes += [NOTE_ARM, NOTE_ROTATION]
        if _walls_turn(scene):
            notes.append(NOTE_WALL)
    if any(law.beta > 0.0 for law in laws):
        notes.append(NOTE_DASHPOT)
    return tuple(notes)


def _walls_turn(scene: Scene) -> bool:
    return any(segment.angular_velocity for wall in scene.walls if wall.law.mu > 0.0 for segment in wall.motion)


def _other_wall_velocity(scene: Scene) -> bool:
    return any(
        wall.law.mu > 0.0
        and wall.law.wall_velocity_at != "mid-overlap"
        and any(s.angular_velocity for s in wall.motion)
        for wall in scene.walls
    )


ENGINE = Yade()
