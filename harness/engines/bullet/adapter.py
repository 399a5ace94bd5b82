"""Bullet (pybullet): rigid contacts, sequential impulses at velocity level, a process of its own.

One step detects contacts at its begin, solves for velocities and then moves positions with them: ``semi-implicit-euler``.
`ninedisk.harness.engines.bullet.session` says how a scene is realised.
"""

from __future__ import annotations

from collections.abc import Sequence

from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.engines.package import RigidPackageEngine, package_version
from ninedisk.harness.engines.spring import laws_in_use

CAPABILITIES = frozenset(
    {
        Capability.FRICTION,
        Capability.RESTITUTION,
        Capability.MOVING_WALLS,
        Capability.ROTATING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.FIXED_DISKS,
        Capability.DISK_INERTIA,
    }
)

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
}

MAX_FRICTION = 10.0
"""Bullet caps the coefficient of a pair here."""


class BulletEngine(RigidPackageEngine):
    """Adapter of Bullet."""

    id = "bullet"
    session = "ninedisk.harness.engines.bullet.session:BulletSession"
    options = OPTIONS

    def info(self) -> EngineInfo:
        """Facts about the installed pybullet; does not import it."""
        version, because = package_version("pybullet")
        return EngineInfo(
            id=self.id,
            name="Bullet",
            version=version,
            scheme="semi-implicit-euler",
            contact="impulse",
            options=OPTIONS,
            licence="zlib",
            how_it_runs="process of its own (Python package pybullet)",
            precision="float64",
            threads=1,
            install="pip install pybullet",
            capabilities=CAPABILITIES,
            not_installed_because=because,
        )

    def refusals(self, scene: Scene, numerics: Numerics) -> Sequence[str]:  # noqa: ARG002
        """A friction that Bullet would cap in silence."""
        return [
            f"Bullet caps the friction of a pair at {MAX_FRICTION:g}, the scene has {law.mu:g}"
            for law in laws_in_use(scene)
            if law.mu > MAX_FRICTION
        ]


ENGINE = BulletEngine()
