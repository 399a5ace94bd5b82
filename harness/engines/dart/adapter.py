"""DART (dartpy): rigid contacts as a complementarity problem at velocity level, a process of its own.

One step detects contacts at its begin, solves for velocities and then moves positions with them, as the semi-implicit Euler
scheme does; but DART adds a "constraint force mixing" of 1e-5 to the diagonal of the problem, so that a contact gives way by
that fraction of what it should withstand: the exact steps of the rigid scheme do not bind it.
`ninedisk.harness.engines.dart.session` says how a scene is realised.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.engines.package import RigidPackageEngine, package_facts, prescribed_spins

CAPABILITIES = frozenset(
    {
        Capability.FRICTION,
        Capability.RESTITUTION,
        Capability.MOVING_WALLS,
        Capability.ROTATING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.DISK_INERTIA,
        Capability.BODY_FORCES,
    }
)

NO_SPRINGS = "https://dartsim.github.io/dart/v6.13.2/"
"""States that contacts are complementarity conditions that guarantee non-penetration."""

FORCE_MIXING = 1e-5
"""DART's own; its Python package does not let one change it."""

OPTIONS = {
    "solver": Option(
        default="nsgs",
        choices=("nsgs", "dantzig"),
        why="Gauss-Seidel with Coulomb's cone, swept until it has converged; DART's default, dantzig, is 1.3 % off the weight "
        "of a stack of three disks in its first two steps, and the same where there is one contact",
    ),
    "collision_detector": Option(
        default="dart",
        choices=("dart", "fcl", "ode", "bullet"),
        why="DART's own has closed forms for spheres and planes",
    ),
}


FACTS = package_facts(
    "dartpy",
    id="dart",
    name="DART",
    scheme="semi-implicit Euler, regularised",
    contact="soft",
    softness=FORCE_MIXING,
    softness_why="constraint force mixing: that part is added to the diagonal of the contacts' problem",
    options=OPTIONS,
    out_of_scope=dict.fromkeys((Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING), NO_SPRINGS),
    licence="BSD-2-Clause",
    capabilities=CAPABILITIES,
)


class DartEngine(RigidPackageEngine):
    """Adapter of DART."""

    id = "dart"
    session = "ninedisk.harness.engines.dart.session:DartSession"
    distribution = "dartpy"
    facts = FACTS

    def refusals(self, scene: Scene, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """What the smaller of two coefficients, and a body without the rotation's degree of freedom, cannot express."""
        found = []
        if len(scene.disks) > 1:
            found += [
                f"DART gives a pair the smaller of its bodies' friction coefficients: wall {wall.name!r} cannot have "
                f"{wall.law.mu:g} where disks have {scene.disk_disk.mu:g} among themselves"
                for wall in scene.walls
                if wall.law.mu > scene.disk_disk.mu
            ]
            between = scene.disk_disk.restitution or 0.0
            found += [
                f"DART's restitution of a pair is the product of two factors of at most 1: wall {wall.name!r} cannot have "
                f"{wall.law.restitution:g} where disks have {between:g} among themselves; the limit is the root of that"
                for wall in scene.walls
                if wall.law.restitution and wall.law.restitution > math.sqrt(between)
            ]
        return found + prescribed_spins(scene, "DART")

    def approximations(self, scene: Scene, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """The regularisation."""
        return [f"DART's contacts give way by {FORCE_MIXING:g} of what they should withstand (constraint force mixing)"]


ENGINE = DartEngine()
