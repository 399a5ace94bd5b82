"""Spheres in space in pybullet: as disks of the plane, see `ninedisk.harness.engines.bullet.session`, with three components.

A body without mass that moves with v and turns with omega meets contacts in a step with ``v + dt omega x v``: Bullet adds what the
velocity changes by in the body's own frame. It is given the v for which that is the prescribed one.

A pair's resistance to rolling [m], and to spinning, is the sum of each body's own times the other's friction: walls have all of it.
"""

from __future__ import annotations

import numpy as np

from ninedisk.core.validate import FloatArray
from ninedisk.harness.engines.bullet.session import ENGINE_VERSION, BulletSession
from ninedisk.harness.engines.space import SpaceSession, quaternion_of

__all__ = ["ENGINE_VERSION", "BulletSpaceSession"]


class BulletSpaceSession(SpaceSession, BulletSession):
    """The `Session` of one run."""

    def step(self, *, last: bool) -> None:  # noqa: ARG002
        """Step the world, and sum the spins: Bullet moves bodies with those of the step's end."""
        self.world.stepSimulation()
        for i, body in enumerate(self.disks):
            self.angle[i] += self.dt * np.array(self.world.getBaseVelocity(body)[1])

    def prescribed(self, i: int) -> bool:
        """Whether nothing moves a body: it is fixed, or its motion is prescribed."""
        return super().prescribed(i) or i in self.driven

    def resistances(self, k: int) -> dict[str, float]:
        """Lengths that times fn are torques, in Bullet's unit, over the spheres' share of the friction."""
        law, arm = self.scene.walls[k].law, self.unit * float(self.scene.spheres.radius.max(initial=0.0))
        given = {"rollingFriction": law.rolling, "spinningFriction": law.twisting}
        return {name: 0.0 if each is None else each.mu * arm / self.share for name, each in given.items()}

    def drive_wall(
        self, k: int, point: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray
    ) -> None:
        """Set a plane's pose and its velocities over the coming step."""
        w, x, y, z = quaternion_of(rotation)
        body = self.walls[k]
        self.world.resetBasePositionAndOrientation(body, (self.unit * point).tolist(), [x, y, z, w])
        self._move(body, velocity, rate)

    def drive_sphere(self, i: int, place: FloatArray) -> None:
        """Set a sphere's pose and velocities."""
        body, spheres = self.disks[i], self.scene.spheres
        self.world.resetBasePositionAndOrientation(body, (self.unit * place).tolist(), [0.0, 0.0, 0.0, 1.0])
        self._move(body, spheres.v[i], spheres.omega[i])

    def _move(self, body: int, velocity: FloatArray, rate: FloatArray) -> None:
        x, y, z = self.dt * rate
        seen = np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        self.world.resetBaseVelocity(body, (self.unit * np.linalg.solve(seen, velocity)).tolist(), rate.tolist())
