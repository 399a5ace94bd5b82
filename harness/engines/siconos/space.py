"""Spheres in space in Siconos: what of them it has, and the planes' way."""

from __future__ import annotations

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import SphereScene
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.capabilities import OF_RIGID_SPHERES, Capability
from ninedisk.harness.engines.space import PlanePoses, twists

IN_SPACE = OF_RIGID_SPHERES | {Capability.MATERIALS}

NOTE_LEMKE = "Lemke's method is one of the plane, whose friction is no cone: leave siconos.solver at nsgs"


def plane_path(scene: SphereScene, numerics: Numerics) -> FloatArray:
    """Point [m], normal, velocity [m/s] and spin [rad/s] over the coming step of each plane at each step, shape (k, m, 12).

    One row where all planes rest: the last row lasts.
    """
    poses, dt = PlanePoses(scene), numerics.dt
    found = []
    for step in range(numerics.n_steps + 1 if poses.moving else 1):
        here = poses(step * dt)
        found.append(np.hstack([here.point, here.normal, *twists(here, poses((step + 1) * dt), dt)]))
    return np.array(found)
