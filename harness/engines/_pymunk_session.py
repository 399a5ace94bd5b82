"""A scene as a `pymunk.Space`.

- The coefficients of a pair are the PRODUCT of its two shapes' ones. Every disk has therefore one circle that meets
  disks only (friction ``sqrt(mu)``, elasticity ``sqrt(e)`` of the disk-disk law) and one that meets walls only (both 1,
  so that the wall's own coefficients are the pair's); shape filters keep the two apart.
- A wall is a thick polygon on a kinematic body. A circle that exactly touches a polygon is in contact; on a segment it
  would fall freely for one step.
- Before each step a wall's body gets the velocity that takes it to its exact pose at the end of the step.
- Walls are raised, and circles that meet circles made larger, by ``touch`` in all, some units of round-off: bodies
  which touch are then in contact whatever the rounding of their coordinates. ``collision_slop`` is that same length, so
  that nothing pushes them apart. Circles that meet walls keep their radius, the lever arm of friction.
- ``collision_bias`` 0 takes out in one step, by a pseudo-velocity that leaves no momentum behind, the penetration that
  an impact within a step causes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pymunk
from numpy.typing import NDArray

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.engine import EngineError

FloatArray = NDArray[np.float64]

DEFAULTS: Mapping[str, float] = {"pymunk.iterations": 100, "pymunk.collision_bias": 0.0}
"""A single contact needs one iteration; 100 serve groups of a few dozen, where 10, pymunk's default, do not."""

_MEETS_DISKS, _MEETS_WALLS, _WALL = 1, 2, 4
_TOUCH_ULPS = 16.0
"""A gap is a sum of a few coordinates of walls' corners and of disks, each rounded to half a unit in the last place."""


class PymunkSession:
    """The `Session` of one run."""

    def __init__(self, scene: Scene, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        options = read_options(numerics)
        self.scene, self.dt, self.pairs, self.done = scene, numerics.dt, pairs, 0
        self.reach = 4.0 * (_size(scene) + _path(scene, numerics))
        if not math.isfinite(self.reach):
            raise EngineError(
                "pymunk: the bodies' way over the run is no finite length; reduce velocities, dt or n_steps"
            )
        self.touch = _TOUCH_ULPS * float(np.spacing(self.reach))
        self.space = pymunk.Space()
        self.space.gravity = scene.gravity
        self.space.iterations = int(options["pymunk.iterations"])
        self.space.collision_bias = options["pymunk.collision_bias"]
        self.space.collision_slop = self.touch
        self.settings: dict[str, Any] = {
            **options,
            "pymunk.collision_slop": self.touch,
            "pymunk.collision_persistence": self.space.collision_persistence,
            "pymunk.damping": self.space.damping,
            "wall_half_length": self.reach,
        }
        self.poses = _WallPoses(scene)
        self.walls = [self._wall(k) for k in range(len(scene.walls))]
        self.disks = [self._disk(i) for i in range(len(scene.disks))]
        self.number = {body: number for number, body in enumerate([*self.disks, *self.walls])}

    def warm_up(self) -> None:
        """Compile the walls' motion where there is any; pymunk itself is native code."""
        self.poses(0.0)

    def advance(self, n_steps: int) -> None:
        """Step the space; moving walls reach their exact pose at the end of each step."""
        for _ in range(n_steps):
            if self.poses.moving:
                self._drive_walls()
            self.space.step(self.dt)
            self.done += 1

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and the contact impulses of the last step as forces."""
        for i, body in enumerate(self.disks):
            history.x[row, i] = body.position
            history.v[row, i] = body.velocity
            history.angle[row, i] = body.angle
            history.omega[row, i] = body.angular_velocity
        if not (np.isfinite(history.x[row]).all() and np.isfinite(history.v[row]).all()):
            raise EngineError(f"pymunk: the state is no longer finite at step {self.done}; reduce dt")
        point, normal = self.poses(self.done * self.dt)
        history.wall_point[row] = point
        history.wall_angle[row] = np.arctan2(normal[:, 1], normal[:, 0])
        impulses = self._impulses() if self.done else {}
        for c, (i, j) in enumerate(self.pairs):
            n, gap = self._contact_frame(history.x[row], point, normal, i, j)
            history.gap[row, c] = gap
            if self.done:
                force = impulses.get((i, j), np.zeros(2)) / self.dt
                history.fn[row, c] = -(force @ n)
                history.fs[row, c] = force @ np.array([-n[1], n[0]])
        if self.done:
            history.wall_force[row] = 0.0
            for (_, j), impulse in impulses.items():
                if j >= len(self.disks):
                    history.wall_force[row, j - len(self.disks)] -= impulse / self.dt

    def _contact_frame(
        self, x: FloatArray, point: FloatArray, normal: FloatArray, i: int, j: int
    ) -> tuple[FloatArray, float]:
        """Unit normal from body i to body j, and the gap [m]."""
        radius, wall = self.scene.disks.radius, j - len(self.disks)
        if wall >= 0:
            return -normal[wall], float((x[i] - point[wall]) @ normal[wall] - radius[i])
        apart = x[j] - x[i]
        distance = float(np.hypot(apart[0], apart[1]))
        return apart / distance, distance - float(radius[i] + radius[j])

    def _impulses(self) -> dict[Pair, FloatArray]:
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

    def _drive_walls(self) -> None:
        """Set the walls' chord velocities over the coming step."""
        here, facing = self.poses(self.done * self.dt)
        there, to_face = self.poses((self.done + 1) * self.dt)
        for k, body in enumerate(self.walls):
            first = self.scene.walls[k].normal
            body.position = tuple(here[k].tolist())
            body.angle = _turn(first, facing[k])
            body.velocity = tuple(((there[k] - here[k]) / self.dt).tolist())
            body.angular_velocity = _turn(facing[k], to_face[k]) / self.dt
            self.space.reindex_shapes_for_body(body)

    def _disk(self, i: int) -> pymunk.Body:
        disks, law = self.scene.disks, self.scene.disk_disk
        body = pymunk.Body(float(disks.mass[i]), float(disks.inertia[i]) if disks.rotating[i] else math.inf)
        body.position = tuple(disks.x[i].tolist())
        body.velocity = tuple(disks.v[i].tolist())
        body.angular_velocity = float(disks.omega[i])
        self.space.add(body)
        radius = float(disks.radius[i])
        if len(disks) > 1:
            circle = pymunk.Circle(body, radius + 0.5 * self.touch)
            circle.filter = pymunk.ShapeFilter(categories=_MEETS_DISKS, mask=_MEETS_DISKS)
            circle.friction, circle.elasticity = math.sqrt(law.mu), math.sqrt(law.restitution or 0.0)
            self.space.add(circle)
        if self.scene.walls:
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


class _WallPoses:
    """Surface point [m] and normal of each wall at a time, both of shape (m, 2)."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.moving = any(wall.motion for wall in scene.walls)

    def __call__(self, t: float) -> tuple[FloatArray, FloatArray]:
        if not self.moving:
            walls = self.scene.walls
            point, normal = [wall.point for wall in walls], [wall.normal for wall in walls]
            return np.array(point).reshape(-1, 2), np.array(normal).reshape(-1, 2)
        from ninedisk.core.geometry.motion import compile_motion, wall_poses  # loads Numba, so only where needed

        if not hasattr(self, "table"):
            self.table = compile_motion(self.scene.walls)
        pose = wall_poses(self.table, t)
        return pose[:, 0:2].copy(), pose[:, 2:4].copy()


def read_options(numerics: Numerics) -> dict[str, float]:
    """Settings of this engine: the defaults, then ``numerics.options``.

    Raises
    ------
    InvalidNumericsError
        Unknown name, or a value outside its range.
    """
    options = dict(DEFAULTS)
    for name, value in numerics.options.items():
        if not name.startswith("pymunk."):
            continue
        if name not in DEFAULTS:
            raise InvalidNumericsError(f"the option {name!r} is unknown: use one of {', '.join(DEFAULTS)}")
        options[name] = value
    iterations, bias = options["pymunk.iterations"], options["pymunk.collision_bias"]
    if iterations != int(iterations) or iterations < 1:
        raise InvalidNumericsError(f"pymunk.iterations = {iterations!r} is not allowed: it must be a whole number >= 1")
    if not 0.0 <= bias <= 1.0:
        raise InvalidNumericsError(f"pymunk.collision_bias = {bias!r} is not allowed: it must lie in [0, 1]")
    return options


def _turn(one: FloatArray | tuple[float, float], two: FloatArray) -> float:
    """Signed angle from one direction to another [rad], in (-pi, pi]."""
    return math.atan2(one[0] * two[1] - one[1] * two[0], one[0] * two[0] + one[1] * two[1])


def _size(scene: Scene) -> float:
    """Largest distance from the origin that disks and walls' points reach at time 0 [m]."""
    far = [float(np.abs(scene.disks.x).max() + scene.disks.radius.max())] if len(scene.disks) else []
    return max([*far, *(max(abs(wall.point[0]), abs(wall.point[1])) for wall in scene.walls)], default=1.0)


def _path(scene: Scene, numerics: Numerics) -> float:
    """Path [m] of the fastest body over the run, were it free: walls must be longer than that."""
    t = numerics.dt * numerics.n_steps
    speed = float(np.hypot(scene.disks.v[:, 0], scene.disks.v[:, 1]).max(initial=0.0))
    spin = float(np.abs(scene.disks.omega * scene.disks.radius).max(initial=0.0))
    driven = max((abs(v) for wall in scene.walls for seg in wall.motion for v in seg.velocity), default=0.0)
    return (speed + spin + 2.0 * driven) * t + 0.5 * math.hypot(*scene.gravity) * t * t
