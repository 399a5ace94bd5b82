"""Adapter of ESyS-Particle (explicit DEM of spheres, Apache): a process under mpirun, non-rotating spheres, smooth infinite walls."""

from __future__ import annotations

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
from ninedisk.harness.api.capabilities import Capability, capabilities_needed
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support, SupportLevel
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.drake.adapter import OF_SLIP, no_contact_can_slip
from ninedisk.harness.engines.plane import wall_reach
from ninedisk.harness.engines.siconos.adapter import clean_environment, system_python
from ninedisk.harness.engines.spring import contact_steps
from ninedisk.harness.run.warden import owned
from ninedisk.harness.wire.external import ExternalEngine

DRIVER = Path(__file__).with_name("driver.py")
PROGRAMS = ("esysparticle", "mpirun")
CAPABILITIES = frozenset(
    {
        Capability.LINEAR_CONTACT,
        Capability.GLOBAL_DAMPING_CENTRAL,
        Capability.GLOBAL_DAMPING_LAGGED,
        Capability.MOVING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
    }
)
NEEDLESS = OF_SLIP | {Capability.DISK_INERTIA}
"""What no engine needs where no contact can slip: nothing turns the disks either."""

NOTE_SLIP = "the disks' friction is left out: by symmetry no contact of this scene ever slips"
NOTE_SPIN = "particles do not rotate: a disk that begins with a spin cannot be expressed"
NOTE_DASHPOT = "its dashpots pull as well as push: contact damping without tension cannot be expressed"
NOTE_FORCES = (
    "contact forces are those of its law at its positions; each sample is checked against the momenta that it exchanged and the "
    "forces on its walls"
)
VERSION = "import numpy; from esys.lsm.util import InstallInfo; print(InstallInfo.version)"


@cache
def _version(python: tuple[str, ...], *programs: str | None) -> tuple[str | None, str]:
    """Version of the installed ESyS-Particle, or None and the reason."""
    for name, found in zip(PROGRAMS, programs, strict=True):
        if not found:
            return None, f"there is no command `{name}` on PATH"
    try:
        done = subprocess.run(
            python, capture_output=True, text=True, timeout=30, env=owned(clean_environment()), check=False
        )
    except (OSError, subprocess.SubprocessError) as error:
        return None, f"{python[0]} cannot be run: {error}"
    version = done.stdout.strip()
    if done.returncode or not version:
        said = (done.stderr.strip().splitlines() or ["it prints no version"])[-1]
        return None, f"{python[0]} cannot import it: {said}"
    return version, ""


class EsysParticle(ExternalEngine):
    """ESyS-Particle: linear elastic contacts of non-rotating spheres, leap-frog, one worker process."""

    id = "esys-particle"

    def info(self) -> EngineInfo:
        """Facts about ESyS-Particle; its version is asked once per process."""
        version, reason = _version(tuple(system_python("-c", VERSION)), *map(shutil.which, PROGRAMS))
        return EngineInfo(
            id=self.id,
            name="ESyS-Particle",
            version=version,
            scheme="central-difference",
            contact="spring",
            licence="Apache-2.0",
            how_it_runs="subprocess `mpirun -np 2 esysparticle`, scene and history as JSON",
            precision="float64",
            threads=1,
            install="apt-get install esys-particle python3-numpy",
            capabilities=CAPABILITIES,
            not_installed_because=reason,
        )

    def command(self) -> Sequence[str]:
        """A master and one worker, wherever they fit; mpirun hands the standard input to the master."""
        mpirun, program = shutil.which("mpirun") or "mpirun", shutil.which("esysparticle") or "esysparticle"
        return [mpirun, "-np", "2", "--oversubscribe", "--bind-to", "none", program, str(DRIVER)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """No other Python, no traces of a surrounding MPI run; MPI within this machine, as root too, idle while it waits."""
        kept = {
            key: value for key, value in clean_environment().items() if not key.startswith(("OMPI_", "PMIX_", "PRTE_"))
        }
        return {
            **kept,
            "TMPDIR": str(folder),
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_btl": "self,vader",
            "OMPI_MCA_oob_tcp_if_include": "lo",
            "OMPI_MCA_mpi_yield_when_idle": "1",
        }

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        """EXACT for smooth elastic contacts, and for disks whose friction symmetry keeps from acting."""
        missing = set(capabilities_needed(scene, numerics))
        notes: list[str] = []
        if missing & NEEDLESS and no_contact_can_slip(scene):
            missing -= NEEDLESS
            notes.append(NOTE_SLIP)
        laws = [wall.law for wall in scene.walls] + ([scene.disk_disk] if len(scene.disks) > 1 else [])
        if any(law.mu > 0.0 for law in laws) and NOTE_SLIP not in notes:
            missing |= {Capability.FRICTION, Capability.SHEAR_SPRING}
        if any(law.beta > 0.0 for law in laws):
            missing.add(Capability.CONTACT_DAMPING)
            notes.append(NOTE_DASHPOT)
        missing -= CAPABILITIES
        if scene.disks.omega.any():
            notes.append(NOTE_SPIN)
            missing.add(Capability.DISK_INERTIA)
        if missing:
            return Support(SupportLevel.NO, tuple(sorted(missing)), tuple(notes))
        return Support(SupportLevel.EXACT, (), (*notes, NOTE_FORCES))

    def extra(self, scene: Scene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Contact step, the walls' path at every contact step (a file: it can be long), and the size of the domain."""
        count, contact_dt = contact_steps(scene, numerics)
        path = folder / "wall_path.npy"
        np.save(path, wall_path(scene, contact_dt, count * numerics.n_steps))
        return {
            "substeps": count,
            "contact_dt": contact_dt,
            "wall_path": str(path),
            "reach": wall_reach(scene, numerics, self.id),
        }

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run ESyS-Particle; raises as `ExternalEngine.run`."""
        done = super().run(scene, numerics, watch)
        count, contact_dt = contact_steps(scene, numerics)
        chosen = {
            "contact_dt": contact_dt,
            "contact_steps_per_dt": count,
            "damping_form": numerics.damping_form,
            "global damping": "velocities scaled by the driver between steps, masses times 1 + xi dt/2 in the central form; "
            "LinDamping is implicit and iterates to 3e-5 only",
            "start": "half kick: v(1/2) = v0 + dt/2 (F0/m - xi v0), set by the driver",
            "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
            "walls": "infinite planes moved by the driver before each step",
            "particles": "NRotSphere in the plane z = 0 (force2dComputations)",
            "interactions": "NRotElastic without scaling, NRotElasticWall",
            "processes": "a master and one worker",
            "threads": 1,
        }
        return EngineRun(history=done.history, timings=done.timings, settings={**chosen, **done.settings})


ENGINE = EsysParticle()
