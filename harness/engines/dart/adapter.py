"""DART (dartpy): rigid contacts as a complementarity problem at velocity level, a separate process.

One step detects contacts at its begin, solves for velocities and then moves positions with them, as the semi-implicit Euler
scheme does; but DART adds a "constraint force mixing" of 1e-5 to the diagonal of the problem, so that a contact gives way by
that fraction of what it should withstand: the exact steps of the rigid scheme do not bind it.
`ninedisk.harness.engines.dart.session` says how a scene is realised.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import PROFILE, Option
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import OF_RIGID, OF_RIGID_SPHERES, Capability
from ninedisk.harness.api.engine import Difference
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.engines.package import RigidPackageEngine, package_facts, prescribed_spins
from ninedisk.harness.engines.world import driven_spheres, partly_held

CAPABILITIES = (OF_RIGID - {Capability.FIXED_DISKS}) | {
    Capability.DISK_INERTIA,
    Capability.BODY_FORCES,
    Capability.BODY_FORCES_3D,
    Capability.SPHERES,
    Capability.BOXES,
}

NO_SPRINGS = "https://dartsim.github.io/dart/v6.13.2/"
"""States that contacts are complementarity conditions that guarantee non-penetration."""

FORCE_MIXING = 1e-5
"""DART's own; its Python package does not let one change it."""

OPTIONS = {
    "profile": PROFILE,
    "solver": Option(
        default="nsgs",
        stock="dantzig",
        choices=("nsgs", "dantzig"),
        why="Gauss-Seidel with Coulomb's cone, swept until it has converged; DART's default, dantzig, is 1.3 % off the weight "
        "of a stack of three disks in its first two steps, and the same where there is one contact",
    ),
    "collision_detector": Option(
        default="dart",
        stock="fcl",
        choices=("dart", "fcl", "ode", "bullet"),
        why="DART's own has closed forms for spheres and planes",
    ),
}

KNOBS = {
    "solver": Knob(
        default="dantzig",
        choices=("dantzig", "nsgs"),
        ladder=("nsgs",),
        dear=True,
        why="solver of the contacts' problem",
    ),
    "split_impulse": Knob(
        default="off", choices=("off", "on"), ladder=("on",), why="overlaps are taken out without leaving momentum"
    ),
    "collision_detector": Knob(
        default="fcl", choices=("fcl", "ode", "bullet", "dart"), ladder=("dart",), why="DART's own has closed forms"
    ),
}
"""Settings under the profile stock."""


FACTS = package_facts(
    "dartpy",
    id="dart",
    name="DART",
    scheme="semi-implicit Euler, regularised",
    contact="soft",
    differences={
        Difference.ARM_LESS_OVERLAP: "the place of DART's contact of a sphere and a plane lies in the plane",
        Difference.MISSED_TOLERANCE_GIVES_PYRAMID: "DART solves such a step by dantzig",
    },
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
    capabilities_3d = OF_RIGID_SPHERES | {Capability.BODY_FORCES_3D, Capability.BOXES}
    distribution = "dartpy"
    facts = FACTS
    knobs = KNOBS

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """What the smaller of two coefficients, and a body without the rotation's degree of freedom, cannot express."""
        found = []
        if len(scene.bodies) > 1:
            found += [
                f"DART gives a pair the smaller of its bodies' friction coefficients: wall {wall.name!r} cannot have "
                f"{wall.law.mu:g} where {scene.noun}s have {scene.law_of_bodies.mu:g} among themselves"
                for wall in scene.walls
                if wall.law.mu > scene.law_of_bodies.mu
            ]
            between = scene.law_of_bodies.restitution or 0.0
            found += [
                f"DART's restitution of a pair is the product of two factors of at most 1: wall {wall.name!r} cannot have "
                f"{wall.law.restitution:g} where {scene.noun}s have {between:g} among themselves; the limit is the root of that"
                for wall in scene.walls
                if wall.law.restitution and wall.law.restitution > math.sqrt(between)
            ]
        if isinstance(scene, SphereScene):
            driven = driven_spheres(scene)
            found += partly_held(scene, "DART")
            return found + [why for why in prescribed_spins(scene, "DART") if int(why.split()[1]) not in driven]
        return found + prescribed_spins(scene, "DART")

    def approximations(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """The regularisation."""
        return [
            f"DART's contacts do not remove {FORCE_MIXING:g} of the approach velocity per step (constraint force mixing)"
        ]


ENGINE = DartEngine()
