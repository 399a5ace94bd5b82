"""Adapter of ESyS-Particle (explicit DEM of spheres, Apache): a process under mpirun, smooth infinite walls; disks do not rotate."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.capabilities import SPACE, Capability, capabilities_needed
from ninedisk.harness.api.engine import Difference, EngineInfo
from ninedisk.harness.engines.lengths import wall_reach
from ninedisk.harness.engines.process import clean_environment, system_python, system_version, without_mpi
from ninedisk.harness.engines.spring import (
    NOTE_OVERDAMPED,
    NOTE_UNIFORM,
    SPRINGS_3D,
    Fit,
    SpringEngine,
    carries_shear,
    fit_arms,
    plane_laws,
    sphere_laws,
    uniform,
)
from ninedisk.harness.engines.symmetry import OF_SLIP, no_contact_can_slip

DRIVER = Path(__file__).with_name("driver.py")
PROGRAMS = ("esysparticle", "mpirun")
CAPABILITIES_3D = SPRINGS_3D | {Capability.LEVER_ARM_OVERLAP, Capability.ROTATING_WALLS}
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
) | (SPACE & CAPABILITIES_3D)
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

# Notes on scenes of 3D.
NOTE_PLANES = "planes are smooth linear springs (NRotElasticWall): no friction, no dashpot and no Hertz law at a plane"
NOTE_ROUGH_HERTZ = (
    "HertzMindlin sees no spins and forgets its shear force with every search of neighbours, HertzMindlinVisco has no shear spring: "
    "friction is expressed beside the linear law only"
)
NOTE_LINEAR_DASHPOT = (
    "LinearDashpot acts along the surface as well: contact damping is expressed beside Hertz' law only"
)
NOTE_ARM = (
    "lever arm of shear torque and slip: a share of the distance by the radii, R - overlap/2 between equal spheres"
)
NOTE_DIRECTION = "shear forces keep their direction in space while their contact turns (RotFriction, whose option rigid does nothing)"
NOTE_ONE_LAW = "Hertz' law is one for all contacts: HertzMindlinVisco takes no tags of spheres"
NOTE_BLOCKED_SPIN = "a sphere whose rotation is blocked has no spin"
NOTE_DASHPOT_3D = "dashpot with the velocity of t_{n-1/2}; it may pull"
NOTE_FORCES_3D = (
    "shear forces by restart files; normal forces from the forces on spheres and planes, where those give them"
)


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
    """ESyS-Particle: in 2D linear elastic contacts of non-rotating spheres, leap-frog, one worker process."""

    id = "esys-particle"
    facts = FACTS
    driver = DRIVER
    capabilities_3d = CAPABILITIES_3D
    dashpot_note_3d = NOTE_DASHPOT_3D
    chosen: Mapping[str, Any] = {
        "global damping": "velocities scaled by the driver between steps, masses times 1 + xi dt/2 in the central form; "
        "LinDamping is implicit and iterates to 3e-5 only",
        "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
        "walls": "infinite planes moved by the driver before each step",
        "particles": "NRotSphere in the plane z = 0 (force2dComputations)",
        "interactions": "NRotElastic without scaling, NRotElasticWall",
        "processes": "a master and one worker",
    }
    chosen_3d: Mapping[str, Any] = {
        "particles": "RotSphere",
        "reported_velocities": "(v(n-1/2) + v(n+1/2))/2",
        "walls": "infinite planes moved and turned by the driver before each step; normalK is kn/(pi R), by tags of equal radii",
        "rigid": False,
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

    def fit_3d(self, scene: SphereScene, numerics: Numerics, fit: Fit) -> None:  # noqa: ARG002
        """Smooth linear planes; friction beside the linear law, dashpots beside Hertz'."""
        fit_arms(scene, fit, "overlap", "overlap")
        between, laws = sphere_laws(scene), scene.laws_in_use
        planes = [law for wall in scene.walls for law in plane_laws(scene, wall)]
        asked = [
            (Capability.SHEAR_SPRING, any(map(carries_shear, planes))),
            (Capability.CONTACT_DAMPING, any(law.beta > 0.0 for law in planes)),
            (Capability.HERTZ_MINDLIN, any(law.hertz for law in planes)),
        ]
        if lacking := [capability for capability, needed in asked if needed]:
            fit.missing.update(lacking)
            fit.notes.append(NOTE_PLANES)
        if any(law.hertz and carries_shear(law) for law in between):
            fit.lacks(Capability.SHEAR_SPRING, NOTE_ROUGH_HERTZ)
        if any(law.beta > 0.0 and not law.hertz for law in between):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_LINEAR_DASHPOT)
        if any(law.beta >= 1.0 for law in between):
            fit.lacks(Capability.CONTACT_DAMPING, NOTE_OVERDAMPED)
        if len(laws) > 1 and any(law.hertz for law in laws):
            fit.lacks(Capability.MATERIALS, NOTE_ONE_LAW)
        if not uniform(scene):
            fit.lacks(Capability.DISK_INERTIA, NOTE_UNIFORM)
        if scene.spheres.omega[~scene.spheres.rotating].any():
            fit.lacks(Capability.BLOCKED_ROTATION, NOTE_BLOCKED_SPIN)
        if any(map(carries_shear, between)):
            fit.approximate = True
            fit.notes += [NOTE_ARM, NOTE_DIRECTION]
            if scene.spheres.rotating.any() and len(np.unique(scene.spheres.radius)) > 1:
                fit.near.add(Capability.LEVER_ARM_OVERLAP)
        fit.notes += [] if fit.missing else [NOTE_FORCES_3D]

    def extra(self, scene: Scene | SphereScene, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Also the size of the domain."""
        return {**super().extra(scene, numerics, folder), "reach": wall_reach(scene, numerics, self.id)}


ENGINE = EsysParticle()
