"""Bullet (pybullet): rigid contacts, sequential impulses at velocity level, a separate process.

One step detects contacts at its begin, solves for velocities and then moves positions with them: ``semi-implicit-euler``.
`ninedisk.harness.engines.bullet.session` says how a scene is realised.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import PROFILE, Option
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import OF_RIGID, OF_RIGID_SPHERES, Capability
from ninedisk.harness.api.engine import Difference
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.engines.package import RigidPackageEngine, package_facts
from ninedisk.harness.engines.world import partly_held

CAPABILITIES = OF_RIGID | {
    Capability.DISK_INERTIA,
    Capability.BODY_FORCES,
    Capability.BODY_FORCES_3D,
    Capability.SPHERES,
    Capability.TWISTING_CONSTANT,
    Capability.BOXES,
}
CAPABILITIES_3D = OF_RIGID_SPHERES | {
    Capability.BODY_FORCES_3D,
    Capability.ROLLING_CONSTANT,
    Capability.TWISTING_CONSTANT,
    Capability.BOXES,
}

OPTIONS = {
    "profile": PROFILE,
    "iterations": Option(
        default=200,
        stock=50,
        low=1,
        high=1e9,
        whole=True,
        why="a stack of three disks is in equilibrium to 1e-11 in the first step; 10 leave a quarter of its weight",
    ),
    "contact_erp": Option(
        default=0.0,
        high=1.0,
        why="fraction of an overlap that a step takes out as velocity; what it adds to the disks' momentum is no part of "
        "any impact law (Bullet's own value makes e = 1 an e of 1.06 where the impact falls within a step)",
    ),
    "friction": Option(
        default="cone",
        choices=("cone", "pyramid"),
        why="Coulomb's cone, the same in all directions; the pyramid is 1.4 times as strong across its edges",
    ),
}

KNOBS = {
    "iterations": Knob(
        default=50, low=1, high=1e9, whole=True, ladder=(200, 1000), dear=True, why="numSolverIterations"
    ),
    "linear_damping": Knob(
        default=0.04, high=1.0, ladder=(0.0,), why="c of the loss of velocity per second, c (1 + |v|) v"
    ),
    "angular_damping": Knob(default=0.04, high=1.0, ladder=(0.0,), why="the same of spins"),
    "restitution_threshold": Knob(
        default=0.2, high=1e9, ladder=(0.0,), why="restitutionVelocityThreshold [m/s]: slower impacts are plastic"
    ),
    "contact_erp": Knob(
        default=0.2, high=1.0, ladder=(0.0,), why="part of an overlap that a step takes out as velocity"
    ),
    "breaking_threshold": Knob(
        default=0.02,
        high=1e9,
        ladder=(1e-3, 1e-5),
        why="contactBreakingThreshold [m]: gap up to which contacts are kept",
    ),
}
"""Settings under the profile stock."""

MAX_FRICTION = 10.0
"""Bullet caps the coefficient of a pair here."""


FACTS = package_facts(
    "pybullet",
    id="bullet",
    name="Bullet",
    scheme="semi-implicit-euler",
    contact="impulse",
    sweeps="iterations",
    differences={
        Difference.BOX_FRICTION_ASKEW: "Bullet's implicit cone: a box leaves its straight path by up to 8.4 % of it"
    },
    options=OPTIONS,
    licence="zlib",
    capabilities=CAPABILITIES,
)


class BulletEngine(RigidPackageEngine):
    """Adapter of Bullet."""

    id = "bullet"
    session = "ninedisk.harness.engines.bullet.session:BulletSession"
    capabilities_3d = CAPABILITIES_3D
    distribution = "pybullet"
    facts = FACTS
    knobs = KNOBS

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """A friction that Bullet would cap in silence; bodies that are held in part."""
        refused = sphere_refusals(scene) if isinstance(scene, SphereScene) else []
        return refused + [
            f"Bullet caps the friction of a pair at {MAX_FRICTION:g}, the scene has {law.mu:g}"
            for law in scene.laws_in_use
            if law.mu > MAX_FRICTION
        ]


def sphere_refusals(scene: SphereScene) -> list[str]:
    """Spheres held in part, and resistances that no shares of bodies give."""
    found, spheres = partly_held(scene, "Bullet"), scene.spheres
    resisted = [wall.name for wall in scene.walls if wall.law.rolling or wall.law.twisting]
    between = scene.sphere_sphere
    if len(spheres) > 1 and (between.rolling or between.twisting):
        found.append(
            "Bullet's resistance to rolling is a share of each body: here walls alone have one, and spheres none among themselves"
        )
    if resisted and (np.ptp(spheres.radius) > 0.0 or (len(spheres) > 1 and between.mu == 0.0)):
        found.append(
            f"Bullet's resistance to rolling is a length times the other body's friction: wall {resisted[0]!r} cannot have one for spheres "
            "of several radii, or for smooth ones"
        )
    return found


ENGINE = BulletEngine()
