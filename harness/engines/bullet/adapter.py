"""Bullet (pybullet): rigid contacts, sequential impulses at velocity level, a process of its own.

One step detects contacts at its begin, solves for velocities and then moves positions with them: ``semi-implicit-euler``.
`ninedisk.harness.engines.bullet.session` says how a scene is realised.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import OF_RIGID, Capability
from ninedisk.harness.engines.bullet.space import IN_SPACE, refused_in_space
from ninedisk.harness.engines.package import RigidPackageEngine, package_facts

CAPABILITIES = OF_RIGID | {
    Capability.DISK_INERTIA,
    Capability.BODY_FORCES,
    Capability.SPHERES,
    Capability.TWISTING_CONSTANT,
}

OPTIONS = {
    "iterations": Option(
        default=200,
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

MAX_FRICTION = 10.0
"""Bullet caps the coefficient of a pair here."""


FACTS = package_facts(
    "pybullet",
    id="bullet",
    name="Bullet",
    scheme="semi-implicit-euler",
    contact="impulse",
    sweeps="iterations",
    options=OPTIONS,
    licence="zlib",
    capabilities=CAPABILITIES,
)


class BulletEngine(RigidPackageEngine):
    """Adapter of Bullet."""

    id = "bullet"
    session = "ninedisk.harness.engines.bullet.session:BulletSession"
    session_in_space = "ninedisk.harness.engines.bullet.space_session:BulletSpaceSession"
    in_space = IN_SPACE
    distribution = "pybullet"
    facts = FACTS

    def refusals(self, scene: Any, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """A friction that Bullet would cap in silence; bodies that are held in part."""
        refused = refused_in_space(scene) if isinstance(scene, SphereScene) else []
        return refused + [
            f"Bullet caps the friction of a pair at {MAX_FRICTION:g}, the scene has {law.mu:g}"
            for law in scene.laws_in_use
            if law.mu > MAX_FRICTION
        ]


ENGINE = BulletEngine()
