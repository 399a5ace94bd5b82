"""Adapter of Siconos (non-smooth dynamics): Moreau-Jean time stepping with rigid contacts, a separate process.

Siconos is Debian's ``python3-siconos`` and lives under the system's Python only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option, read_options
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.capabilities import OF_RIGID_SPHERES, Capability
from ninedisk.harness.api.engine import Difference, EngineInfo, EngineRun, Support
from ninedisk.harness.api.support import rigid_support, without_spring_preload
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.engines.lengths import longest_path, touch_length
from ninedisk.harness.engines.process import (
    SYSTEM_PYTHON,
    ProcessEngine,
    clean_environment,
    system_python,
    system_version,
)
from ninedisk.harness.engines.world import PlanePoses, twists

INSTALL = "apt-get install python3-siconos"
DRIVER = Path(__file__).with_name("driver.py")
CAPABILITIES = frozenset(
    {
        Capability.FRICTION,
        Capability.RESTITUTION,
        Capability.GLOBAL_DAMPING_CENTRAL,
        Capability.MOVING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.DISK_INERTIA,
        Capability.MATERIALS,
        Capability.BODY_FORCES,
        Capability.SPHERES,
    }
)
CAPABILITIES_3D = OF_RIGID_SPHERES | {Capability.MATERIALS}
OPTIONS: Mapping[str, Option] = {
    "theta": Option(
        default=0.5,
        low=0.5,
        high=1.0,
        why="positions by the trapezoidal rule: exact for a constant acceleration; friction and impact do not depend on it",
    ),
    "solver": Option(default="nsgs", choices=("nsgs", "lemke"), why="exact for one contact, reliable for many"),
    "tolerance": Option(
        default=1e-12,
        low=1e-15,
        high=1e-3,
        why="ten times as much passes as a step's residual; exact steps are held to 1e-10",
    ),
    "max_iterations": Option(
        default=100_000, low=1, whole=True, why="Gauss-Seidel needs some 10^4 sweeps for 500 contacts"
    ),
}

MOST_PAIRS = 1_000
"""Of bodies that may touch."""

NOTE_MANY = (
    "every pair of bodies that may touch is an interaction of its own in Siconos, {pairs} here, and its cost in each step goes with "
    "all of them: with more than 1000 a run takes minutes; use fewer disks"
)
NOTE_THETA = (
    "theta of Moreau-Jean is the option siconos.theta (1/2), not Numerics.theta: it weighs the positions' velocities and "
    "plays no part in the impact law"
)
NOTE_LEMKE = "Lemke's method is one of the plane, whose friction is no cone: leave siconos.solver at nsgs"


def installed_siconos(program: str) -> tuple[str | None, str]:
    """Version of the Siconos of the Python at this path, or None and the reason; it is asked once per process."""
    code = "import siconos.kernel, siconos.numerics, siconos.mechanics.collision.bodies; print(siconos.version)"
    return system_version((program, *system_python("-c", code)[1:]))


def activation_threshold(scene: Scene | SphereScene, numerics: Numerics) -> float:
    """Gap [m] below which a contact is closed: round-off of coordinates, and what the contact solver leaves over the whole run.

    A step passes with ten times the solver's tolerance of the velocities that it prevents. Nothing takes such a velocity back
    from the positions: a stack whose gap had grown beyond round-off by it would lose the contact for a step, and fall.
    """
    tolerance = float(read_options(Siconos.id, OPTIONS, numerics)[f"{Siconos.id}.tolerance"])
    return touch_length(scene, numerics, Siconos.id) + 10.0 * tolerance * longest_path(scene, numerics)


def step_path(scene: SphereScene, numerics: Numerics) -> FloatArray:
    """Point [m], normal, velocity [m/s] and spin [rad/s] over the coming step of each wall of 3D at each step, shape (k, m, 12).

    One row where all walls rest: the last row lasts.
    """
    poses, dt = PlanePoses(scene), numerics.dt
    found = []
    for step in range(numerics.n_steps + 1 if poses.moving else 1):
        here = poses(step * dt)
        found.append(np.hstack([here.point, here.normal, *twists(here, poses((step + 1) * dt), dt)]))
    return np.array(found)


FACTS = EngineInfo(
    id="siconos",
    name="Siconos",
    scheme="moreau-jean",
    contact="impulse",
    differences={Difference.NORMAL_TURNS_IN_IMPACT: str(Difference.NORMAL_TURNS_IN_IMPACT)},
    options=OPTIONS,
    licence="Apache-2.0",
    how_it_runs="subprocess of the system's Python, scene and history as JSON",
    install=INSTALL,
    capabilities=CAPABILITIES,
)


class Siconos(ProcessEngine):
    """Siconos' kernel: Coulomb friction and Newton's impact law at velocity level."""

    id = "siconos"
    facts = FACTS
    driver = DRIVER

    def installed(self) -> tuple[str | None, str]:
        """Version of the system's Siconos."""
        return installed_siconos(SYSTEM_PYTHON)

    def command(self) -> Sequence[str]:
        """The system's Python with the driver."""
        return system_python(str(self.driver))

    def environment(self, folder: Path) -> Mapping[str, str]:
        """The clean environment with temporary files in ``folder``."""
        return {**clean_environment(), "TMPDIR": str(folder)}

    def supports(self, scene: Scene | SphereScene, numerics: Numerics) -> Support:
        """Rigid contacts only; global damping is the central form for theta = 1/2 alone."""
        spheres, options = isinstance(scene, SphereScene), read_options(self.id, OPTIONS, numerics)
        has = set(CAPABILITIES_3D if spheres else CAPABILITIES)
        if options[f"{self.id}.theta"] != 0.5:
            has.discard(Capability.GLOBAL_DAMPING_CENTRAL)
        n = len(scene.bodies)
        pairs = n * (n - 1) // 2 + n * len(scene.walls)
        refused = [NOTE_MANY.format(pairs=pairs)] if pairs > MOST_PAIRS else []
        if spheres and options[f"{self.id}.solver"] == "lemke":
            refused.append(NOTE_LEMKE)
        return rigid_support(scene, numerics, has, refused=refused, remarks=(NOTE_THETA,))

    def extra(self, scene: Any, numerics: Numerics, folder: Path) -> Mapping[str, Any]:
        """Settings, the walls' path at every step (a file: it can be long), and the gap that is round-off."""
        path = folder / "wall_path.npy"
        if isinstance(scene, SphereScene):
            np.save(path, step_path(scene, numerics))
        else:
            np.save(path, wall_path(scene, numerics.dt, numerics.n_steps))
        return {
            "options": read_options(self.id, OPTIONS, numerics),
            "wall_path": str(path),
            "contact_dt": numerics.dt,
            "substeps": 1,
            "threshold": activation_threshold(scene, numerics),
        }

    def run(self, scene: Any, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        """Run Siconos on the scene without the preload of regularising springs.

        Raises
        ------
        InvalidNumericsError
            If ``numerics.options`` holds an unknown or impossible setting of this engine.
        EngineError
            As `ExternalEngine.run`, and where the contact solver misses its tolerance in a step.
        """
        scene = without_spring_preload(scene)
        chosen = {
            **read_options(self.id, OPTIONS, numerics),
            "sliding": "coulomb",
            "impact": "newton",
            "activation": "gap + dt/2 rate <= threshold",
            "activation_threshold": activation_threshold(scene, numerics),
            **(
                {"normal_of_two_spheres": "at the beginning of the step"}
                if isinstance(scene, SphereScene)
                else {
                    "normal_of_two_disks": "at the predicted end of the step, x + dt v; for restitution, at its beginning"
                }
            ),
            "threads": 1,
        }
        done = super().run(scene, numerics, watch)
        return EngineRun(history=done.history, timings=done.timings, settings={**chosen, **done.settings})


ENGINE = Siconos()
