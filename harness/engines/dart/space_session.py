"""Spheres in space in dartpy: as disks of the plane, see `ninedisk.harness.engines.dart.session`, with three components.

A sphere is on a free joint, or on a translational one where it cannot turn; fixed and driven spheres are immobile skeletons, as walls are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import dartpy
import numpy as np

from ninedisk.core.history import History
from ninedisk.core.validate import FloatArray
from ninedisk.harness.engines.dart.session import ENGINE_VERSION, DartSession
from ninedisk.harness.engines.space import SpaceSession, vector_of

__all__ = ["ENGINE_VERSION", "DartSpaceSession"]


class DartSpaceSession(SpaceSession, DartSession):
    """The `Session` of one run."""

    def step(self, *, last: bool) -> None:  # noqa: ARG002
        """Step the world, and sum the spins: DART moves bodies with those of the step's end."""
        self.world.step()
        for i, disk in enumerate(self.disks):
            self.angle[i] += self.dt * disk.getBodyNode(0).getAngularVelocity()

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        for i, disk in enumerate(self.disks):
            body = disk.getBodyNode(0)
            history.x[row, i], history.v[row, i] = body.getTransform().translation(), body.getLinearVelocity()
            history.angle[row, i], history.omega[row, i] = self.angle[i], body.getAngularVelocity()

    def drive_wall(
        self, k: int, point: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray
    ) -> None:
        """Set a plane's pose and its velocities over the coming step."""
        self.walls[k].setPositions([*vector_of(rotation), *point])
        self.walls[k].setVelocities([*rate, *velocity])

    def drive_sphere(self, i: int, place: FloatArray) -> None:
        """Set a sphere's pose and velocities."""
        self.disks[i].setPositions([0.0, 0.0, 0.0, *place])
        self.disks[i].setVelocities([*self.scene.spheres.omega[i], *self.scene.spheres.v[i]])

    def _disk(self, i: int, friction: float, restitution: float) -> Any:
        spheres = self.scene.spheres
        skeleton = dartpy.dynamics.Skeleton(f"sphere {i}")
        turning = bool(spheres.rotating[i]) or i in self.driven
        if turning:
            _, body = skeleton.createFreeJointAndBodyNodePair()
        else:
            _, body = skeleton.createTranslationalJointAndBodyNodePair()
        self._give_sphere(body, i, friction, restitution)
        still = np.zeros(3 if turning else 0)
        skeleton.setPositions([*still, *spheres.x[i]])
        skeleton.setVelocities([*(spheres.omega[i] if turning else still), *spheres.v[i]])
        skeleton.setMobile(not (self.fixed[i] or i in self.driven))
        self.world.addSkeleton(skeleton)
        return skeleton

    def place_wall(self, skeleton: Any, point: Sequence[float]) -> Any:
        """The body of a plane, at its place."""
        _, body = skeleton.createFreeJointAndBodyNodePair()
        skeleton.setPositions([0.0, 0.0, 0.0, *point])
        return body
