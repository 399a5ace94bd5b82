"""A scene as a `pymunk.Space`.

- The coefficients of a pair are the PRODUCT of its two shapes' ones. Every disk has therefore one circle that meets
  disks only (friction ``sqrt(mu)``, elasticity ``sqrt(e)`` of the disk-disk law) and one that meets walls only (both 1,
  so that the wall's own coefficients are the pair's); shape filters keep the two apart.
- A wall is a thick polygon on a kinematic body. A circle that exactly touches a polygon is in contact; on a segment it
  would fall freely for one step.
- A fixed disk is a static body, without the circle that meets walls.
- Before each step a wall's body gets the velocity that takes it to its exact pose at the end of the step.
- Walls are raised, and circles that meet circles made larger, by ``touch`` in all, some units of round-off: bodies
  which touch are then in contact whatever the rounding of their coordinates. ``collision_slop`` is that same length, so
  that nothing pushes them apart. Circles that meet walls keep their radius, the lever arm of friction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pymunk

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import FloatArray, Scene
from ninedisk.harness.api.knobs import recorded_knobs
from ninedisk.harness.engines.lengths import touch_length, wall_reach
from ninedisk.harness.engines.world import WorldSession, signed_angle

_MEETS_DISKS, _MEETS_WALLS, _WALL = 1, 2, 4


class PymunkSession(WorldSession):
    """The `Session` of one run."""

    engine = "pymunk"

    def __init__(
        self,
        scene: Scene,
        numerics: Numerics,
        pairs: tuple[Pair, ...],
        *,
        options: Mapping[str, Any],
        knobs: Mapping[str, Any],
    ) -> None:
        super().__init__(scene, numerics, pairs)
        self.reach = wall_reach(scene, numerics, "pymunk")
        stock = options["pymunk.profile"] == "stock"
        self.touch = 0.0 if stock else touch_length(scene, numerics, "pymunk")
        self.space = pymunk.Space()
        self.space.gravity = scene.gravity
        self.space.iterations = options["pymunk.iterations"]
        self.space.collision_bias = options["pymunk.collision_bias"]
        given = knobs if stock else {}
        for name, value in given.items():
            setattr(self.space, name, value)
        if not stock:
            self.space.collision_slop = self.touch
        # Chipmunk keeps the impulses of a contact that opened, and adds those of the next touch to them: reported forces, and the
        # cone that bounds friction, would grow with every hop. A contact that opens is forgotten after that very step.
        if not stock:
            self.space.collision_persistence = 1
        self.settings: dict[str, Any] = {
            **options,
            "pymunk.collision_slop": self.space.collision_slop,
            "pymunk.collision_persistence": self.space.collision_persistence,
            "pymunk.damping": self.space.damping,
            "wall_half_length": self.reach,
            **recorded_knobs("pymunk", given),
        }
        self.walls = [self._wall(k) for k in range(len(scene.walls))]
        self.disks = [self._disk(i) for i in range(len(scene.disks))]
        self.number = {body: number for number, body in enumerate([*self.disks, *self.walls])}
        if scene.laws:
            self.space.on_collision(pre_solve=self._pair_law)

    def step(self, *, last: bool) -> None:  # noqa: ARG002
        """Step the space."""
        self.space.step(self.dt)

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        for i, body in enumerate(self.disks):
            history.x[row, i] = body.position
            history.v[row, i] = body.velocity
            history.angle[row, i] = body.angle
            history.omega[row, i] = body.angular_velocity

    def impulses(self) -> dict[Pair, FloatArray]:
        """Impulse [N s] of the last step on the first body of each touching pair that is watched or has a wall."""
        found: dict[Pair, FloatArray] = {}

        def collect(arbiter: pymunk.Arbiter) -> None:
            # pymunk reports the impulse on the body of the arbiter's first shape.
            one, two = (self.number[shape.body] for shape in arbiter.shapes if shape.body is not None)
            impulse = np.array(arbiter.total_impulse)
            found[min(one, two), max(one, two)] = impulse if one < two else -impulse

        for body in {self.disks[i] for i, _ in self.pairs} | set(self.walls):
            body.each_arbiter(collect)
        return found

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:
        """Set a wall's pose and its chord velocity over the coming step."""
        body = self.walls[k]
        body.position = tuple(here.tolist())
        body.angle = signed_angle(self.scene.walls[k].normal, facing)
        body.velocity = tuple(((there - here) / self.dt).tolist())
        body.angular_velocity = rate
        self.space.reindex_shapes_for_body(body)

    def push(self, i: int, load: FloatArray) -> None:
        """Chipmunk forgets forces after a step."""
        self.disks[i].force = (float(load[0]), float(load[1]))
        self.disks[i].torque = float(load[5])

    def _pair_law(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        """Friction and restitution of the pair's own law, in place of the products of the shapes' ones."""
        one, two = sorted(self.number[shape.body] for shape in arbiter.shapes if shape.body is not None)
        law = self.scene.law((one, two))
        arbiter.friction, arbiter.restitution = law.mu, law.restitution or 0.0

    def _disk(self, i: int) -> pymunk.Body:
        disks, law, fixed = self.scene.disks, self.scene.disk_disk, self.fixed[i]
        if fixed:
            body = pymunk.Body(body_type=pymunk.Body.STATIC)
        else:
            body = pymunk.Body(float(disks.mass[i]), float(disks.inertia[i]) if disks.rotating[i] else math.inf)
        body.position = tuple(disks.x[i].tolist())
        if not fixed:
            body.velocity = tuple(disks.v[i].tolist())
            body.angular_velocity = float(disks.omega[i])
        self.space.add(body)
        radius = float(disks.radius[i])
        if len(disks) > 1:
            circle = pymunk.Circle(body, radius + 0.5 * self.touch)
            circle.filter = pymunk.ShapeFilter(categories=_MEETS_DISKS, mask=_MEETS_DISKS)
            circle.friction, circle.elasticity = math.sqrt(law.mu), math.sqrt(law.restitution or 0.0)
            self.space.add(circle)
        if self.scene.walls and not fixed:
            circle = pymunk.Circle(body, radius)
            circle.filter = pymunk.ShapeFilter(categories=_MEETS_WALLS, mask=_WALL)
            circle.friction, circle.elasticity = 1.0, 1.0
            self.space.add(circle)
        return body

    def _wall(self, k: int) -> pymunk.Body:
        wall, reach = self.scene.walls[k], self.reach
        body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        body.position = wall.point
        n = np.array(wall.normal)
        t = np.array([-n[1], n[0]])
        top, bottom = self.touch * n, -reach * n
        corners = (top - reach * t, top + reach * t, bottom + reach * t, bottom - reach * t)
        shape = pymunk.Poly(body, [tuple(corner.tolist()) for corner in corners])
        shape.filter = pymunk.ShapeFilter(categories=_WALL, mask=_MEETS_WALLS)
        shape.friction, shape.elasticity = wall.law.mu, wall.law.restitution or 0.0
        self.space.add(body, shape)
        return body
