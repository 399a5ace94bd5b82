"""Spheres in space in MuJoCo: what of them it has."""

from __future__ import annotations

from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import OF_RIGID_SPHERES, Capability
from ninedisk.harness.engines.space import partly_held

IN_SPACE = OF_RIGID_SPHERES | {Capability.MATERIALS, Capability.ROLLING_CONSTANT, Capability.TWISTING_CONSTANT}
"""Planes that move are boxes on joints, of an inertia beyond the reach of any force: a body whose pose is prescribed meets contacts as if
it were at rest."""


SHARED_CONE = (
    "friction and resistances to rolling and twisting share one cone: a ball that rolls against a resistance slips by 5/7 (mu_r/mu)^2 "
    "of its rolling speed"
)


def refused_in_space(scene: SphereScene) -> list[str]:
    """Spheres held in part."""
    return partly_held(scene, "MuJoCo")
