"""Adapter of ESyS-Particle (explicit DEM of spheres, Apache): a process under mpirun; in the plane spheres without rotation, smooth
infinite walls."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import SPACE, Capability, capabilities_needed
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.engines.esys_particle.space import ESYS_IN_SPACE
from ninedisk.harness.engines.plane import OF_SLIP, no_contact_can_slip, wall_reach
from ninedisk.harness.engines.process import clean_environment, system_python, system_version, without_mpi
from ninedisk.harness.engines.spring import Fit, SpringEngine

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
) | (SPACE & ESYS_IN_SPACE.capabilities)
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


FACTS = EngineInfo(
    id="esys-particle",
    name="ESyS-Particle",
    scheme="central-difference",
    contact="spring",
    licence="Apache-2.0",
    how_it_runs="subprocess `mpirun -np 2 esysparticle`, scene and history as JSON",
    install="apt-get install esys-particle python3-numpy",
    capabilities=CAPABILITIES,
    differences={Difference.SHEAR_KEEPS_DIRECTION: str(Difference.SHEAR_KEEPS_DIRECTION)},
)


class EsysParticle(SpringEngine):
    """ESyS-Particle: in the plane linear elastic contacts of non-rotating spheres, leap-frog, one worker process."""

    id = "esys-particle"
    facts = FACTS
    driver = DRIVER
    in_space = ESYS_IN_SPACE
    chosen: Mapping[str, Any] = {
        "global damping": "velocities scaled by the driver between steps, masses times 1 + xi dt/2 in the central form; "
        "LinDamping is implicit and iterates to 3e-5 only",
        "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
        "walls": "infinite planes moved by the driver before each step",
        "particles": "NRotSphere in the plane z = 0 (force2dComputations)",
        "interactions": "NRotElastic without scaling, NRotElasticWall",
        "processes": "a master and one worker",
    }

    def installed(self) -> tuple[str | None, str]:
        """Version of ESyS-Particle; it is asked once per process."""
        missing = [name for name in PROGRAMS if not shutil.which(name)]
        return (
            (None, f"there is no command `{missing[0]}` on PATH")
            if missing
            else system_version(tuple(system_python("-c", VERSION)))
        )

    copied = None  # mpirun starts it

    def command(self) -> Sequence[str]:
        """A master and one worker, wherever they fit; mpirun hands the standard input to the master."""
        mpirun, program = shutil.which("mpirun") or "mpirun", shutil.which("esysparticle") or "esysparticle"
        return [mpirun, "-np", "2", "--oversubscribe", "--bind-to", "none", program, str(self.driver)]

    def environment(self, folder: Path) -> Mapping[str, str]:
        """No other Python, no traces of a surrounding MPI run; MPI within this machine, as root too, idle while it waits."""
        return {
            **without_mpi(clean_environment()),
            "TMPDIR": str(folder),
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_btl": "self,vader",
            "OMPI_MCA_oob_tcp_if_include": "lo",
            "OMPI_MCA_mpi_yield_when_idle": "1",
        }

    def fit(self, scene: Scene, numerics: Numerics, fit: Fit) -> None:
        """EXACT for smooth elastic contacts, and for disks whose friction symmetry keeps from acting."""
        laws = scene.laws_in_use
        if capabilities_needed(scene, numerics) & NEEDLESS and no_contact_can_slip(scene):
            fit.missing -= NEEDLESS
            fit.notes.append(NOTE_SLIP)
        elif any(law.mu > 0.0 for law in laws):
            fit.missing |= {Capability.FRICTION, Capability.SHEAR_SPRING}
        if any(law.beta > 0.0 for law in laws):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_DASHPOT)
        if scene.disks.omega.any():
            fit.lacks(Capability.DISK_INERTIA, NOTE_SPIN)
        fit.notes += [] if fit.missing else [NOTE_FORCES]

    def extra(self, scene: Scene | SphereScene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Also the size of the domain."""
        return {**super().extra(scene, numerics, folder), "reach": wall_reach(scene, numerics, self.id)}


ENGINE = EsysParticle()
