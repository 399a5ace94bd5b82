"""Spheres in space in Bullet: what of them it has."""

from __future__ import annotations

import numpy as np

from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.capabilities import OF_RIGID_SPHERES, Capability
from ninedisk.harness.engines.space import partly_held

IN_SPACE = OF_RIGID_SPHERES | {Capability.ROLLING_CONSTANT, Capability.TWISTING_CONSTANT}


def refused_in_space(scene: SphereScene) -> list[str]:
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
