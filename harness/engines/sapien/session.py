"""A scene in SAPIEN, whose bodies are PhysX's.

- A disk is a sphere whose three moments of inertia are the disk's; with no force along z it stays at z = 0. Moments of 0 are PhysX's
  way to block rotation.
- A wall is an infinite plane: static, or kinematic where it moves. PhysX takes a kinematic body's velocity from the difference of two
  poses in single precision; the body is kept near the origin, as a plane may be moved along itself.
- A pair's coefficients would be the mean of its bodies'; see `channels`.
- Bodies touch at the sum of both rest offsets, some units of round-off: what touches is in contact whatever the rounding of its
  coordinates. PhysX lets a gap close within a step, so one of round-off would take a part of the load away. Its own contact offset of
  0.01 m makes a contact of a body in flight, whose restitution is then 0.8 of what it should be in some cases.
- No overlap is taken out (``max_depenetration_velocity``): what takes it out would stay in the momentum.
- PhysX has lengths in it: it is given lengths in a unit, a power of two, that makes the mean radius large against them.
- SAPIEN reports normal impulses. Friction of rough pairs, and the forces on walls with it, are not observed.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # that there is no display
    import sapien
    from sapien import physx

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.knobs import given_knobs, recorded_knobs
from ninedisk.harness.engines.boxes import ContactSums
from ninedisk.harness.engines.lengths import largest_extent, longest_path, wall_reach
from ninedisk.harness.engines.sapien.adapter import KNOBS, OPTIONS
from ninedisk.harness.engines.sapien.channels import class_of, surfaces
from ninedisk.harness.engines.world import (
    WorldSession,
    from_z,
    three_components,
)

ENGINE_VERSION = version("sapien")

OWN = "SAPIEN's own"
"""A setting that a stock run leaves alone."""

_UNLIMITED = 1e16
"""Limit [m/s, rad/s] of a body's velocities, whose square single precision holds; PhysX's own for spins is 100."""

_NO_CORRECTION = 1e-12
"""Speed [m/s] with which overlaps are taken out; PhysX refuses 0."""

_TOUCH_ULPS = 8.0
"""A gap is a sum of a few coordinates of bodies and walls, each rounded to half a unit in the last place."""

_AHEAD = 2.0**-12
"""By this part of it a contact begins before bodies touch: PhysX wants contact offsets above rest offsets, and contacts that are still
open rub less than mu."""

_RADIUS = 2.0**17
"""Mean radius in PhysX's lengths. Friction pulls bodies back to where they met while they are within a few centimetres, whatever their
size: at 1 a rolling disk slips by 4e-4 of its speed, and a ball that rolls off two others takes up to three times as long."""


class SapienSession(WorldSession):
    """The `Session` of one run."""

    engine = "SAPIEN"

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        super().__init__(scene, numerics, pairs)
        options = read_options("sapien", OPTIONS, numerics)
        self.stock = options["sapien.profile"] == "stock"
        given = given_knobs("sapien", KNOBS, numerics) if self.stock else {}
        options |= {f"sapien.{name}": value for name, value in given.items() if f"sapien.{name}" in options}
        self.iterations = options["sapien.position_iterations"], options["sapien.velocity_iterations"]
        self.contact_offset: float | None = given.get("contact_offset")
        bodies = scene.bodies
        scaled = len(bodies) > 0 and not self.stock
        self.unit = _RADIUS * 2.0 ** -round(math.log2(float(bodies.radius.mean()))) if scaled else 1.0
        wall_reach(scene, numerics, "SAPIEN")  # raises where paths are no finite lengths
        extent = self.unit * (largest_extent(scene) + longest_path(scene, numerics))
        self.touch = _TOUCH_ULPS * float(np.spacing(np.float32(extent)))
        self.solid = has_boxes(scene)
        own = physx.PhysxSceneConfig()
        config = {
            "bounce_threshold": given.get("bounce_threshold", float(own.bounce_threshold)) if self.stock else 0.0,
            "enable_tgs": options["sapien.solver"] == "tgs",
            "enable_pcm": True,
            "enable_ccd": False,
            "enable_enhanced_determinism": False,  # it gives impulses of one pair to another: sapien/impulses-of-other-contacts
            "enable_friction_every_iteration": True,
        }
        limits = {
            "linear_damping": 0.0,
            "angular_damping": 0.0,
            "sleep_threshold": 0.0,
            "max_linear_velocity": _UNLIMITED,
            "max_angular_velocity": _UNLIMITED,
            "max_depenetration_velocity": _NO_CORRECTION,
        }
        self.limits = {} if self.stock else limits
        self.settings: dict[str, Any] = {
            **options,
            **{f"sapien.{name}": value for name, value in config.items()},
            **{f"sapien.{name}": OWN if self.stock else value for name, value in limits.items()},
            "sapien.contact_offset": given.get("contact_offset", OWN)
            if self.stock
            else 0.5 * (1.0 + _AHEAD) * self.touch / self.unit,
            "sapien.rest_offset": OWN if self.stock else 0.5 * self.touch / self.unit,
            "sapien.lengths_per_metre": self.unit,
            **recorded_knobs("sapien", given),
            "sapien.pair_coefficients": "the scene's own, by one shape for each law",
        }
        gravity = self.unit * np.array(three_components(scene.gravity))
        physx.set_scene_config(gravity=gravity.astype(np.float32), **config)
        self.world = physx.PhysxCpuSystem()
        self.world.timestep = self.dt
        self.space = sapien.Scene([self.world])
        self.surfaces = surfaces(scene)
        self.bodies = [self._body(i) for i in range(len(bodies))]
        self.walls = [self._wall(k) for k in range(len(scene.walls))]
        self.number = {body.entity.per_scene_id: k for k, body in enumerate([*self.bodies, *self.walls])}
        n = len(bodies)
        self.rough = [c for c, pair in enumerate(pairs) if scene.law(pair).mu > 0.0]
        self.rough_walls = [k for k in range(len(scene.walls)) if any(scene.law((i, n + k)).mu > 0.0 for i in range(n))]
        self.before = np.zeros((n, 3))

    def step(self, *, last: bool) -> None:
        """Step the world, and follow the rotations: PhysX moves bodies with the velocities of the step's end."""
        if last and self.solid:
            self.before = self._places()
        self.world.step()
        for i, body in enumerate(self.bodies):
            if self.scene.dimension == 3:
                self.angle[i] += self.dt * np.array(body.angular_velocity, dtype=np.float64)
            else:
                w, _, _, z = (float(each) for each in body.entity.pose.q)
                self.angle[i] += math.remainder(2.0 * math.atan2(z, w) - self.angle[i], math.tau)

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        size = self.scene.dimension
        history.x[row], history.angle[row] = self._places()[:, :size], self.angle
        for i, body in enumerate(self.bodies):
            spin = np.array(body.angular_velocity, dtype=np.float64)
            history.v[row, i] = np.array(body.linear_velocity, dtype=np.float64)[:size] / self.unit
            history.omega[row, i] = spin if size == 3 else spin[2]
            if history.quaternion is not None:
                history.quaternion[row, i] = body.entity.pose.q

    def _places(self) -> FloatArray:
        """Centres [m], shape (n, 3)."""
        return np.array([body.entity.pose.p for body in self.bodies], dtype=np.float64).reshape(-1, 3) / self.unit

    def impulses(self) -> Mapping[Pair, FloatArray]:
        """Normal impulse [N s] of the last step on the first body of each touching pair."""
        sums, size = ContactSums(self.scene), self.scene.dimension
        for contact in self.world.get_contacts():
            one, two = (self.number[body.entity.per_scene_id] for body in contact.bodies)
            for point in contact.points:  # PhysX's impulse acts on its first body
                on_one = np.array(point.impulse, dtype=np.float64)[:size] / self.unit
                sums.add(one, two, on_one, np.array(point.position, dtype=np.float64) / self.unit, self.before)
        self.moments = sums.moments
        return sums.impulses

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and of the contacts what SAPIEN reports."""
        super().observe(history, row)
        history.fs[row, self.rough] = history.wall_force[row, self.rough_walls] = np.nan
        if history.moment is not None:
            history.moment[row, self.rough] = np.nan

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:  # noqa: ARG002
        """Set a wall's place and its chord velocity over the coming step."""
        self._drive(k, three_components(here), three_components((there - here) / self.dt))

    def drive_3d(self, k: int, point: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray) -> None:  # noqa: ARG002
        """Set a wall's place and its velocity over the coming step."""
        self._drive(k, point.tolist(), velocity.tolist())

    def drive_sphere(self, i: int, place: FloatArray) -> None:
        """Set a sphere's place and velocity."""
        self._move(self.bodies[i], place, self.scene.spheres.v[i])

    def _drive(self, k: int, point: list[float], velocity: list[float]) -> None:
        wall = self.scene.walls[k]
        if wall.motion:
            normal = np.array(three_components(wall.normal))
            along = normal @ (np.array(point) - three_components(wall.point))
            self._move(self.walls[k], along * normal, np.array(velocity))

    def _move(self, body: Any, place: FloatArray, velocity: FloatArray) -> None:
        body.entity.set_pose(sapien.Pose(self.unit * place))
        body.set_kinematic_target(sapien.Pose(self.unit * (place + self.dt * velocity)))

    def push(self, i: int, load: FloatArray) -> None:
        """PhysX forgets forces after a step."""
        self.bodies[i].add_force_torque((self.unit * load[:3]).tolist(), (self.unit**2 * load[3:]).tolist(), "force")

    def _body(self, i: int) -> Any:
        bodies = self.scene.bodies
        body = physx.PhysxRigidDynamicComponent()
        shape = physx.PhysxCollisionShapeSphere
        size: Any = self.unit * float(bodies.radius[i])
        turn = [1.0, 0.0, 0.0, 0.0]
        if self.solid:
            turn = bodies.quaternion[i].tolist()
            if bodies.boxes[i]:
                shape, size = physx.PhysxCollisionShapeBox, (self.unit * bodies.half_sizes[i]).tolist()
        for surface in self.surfaces[class_of(self.scene, i)]:
            self._attach(body, lambda material: shape(size, material), surface)
        moving = not (self.fixed[i] or i in self.driven)
        body.kinematic = not moving
        body.mass = float(bodies.mass[i])
        inertia = self.unit**2 * np.broadcast_to(bodies.inertia[i], 3) if bodies.rotating[i] else np.zeros(3)
        body.inertia = inertia.astype(np.float32)
        body.solver_position_iterations, body.solver_velocity_iterations = self.iterations
        for name, value in self.limits.items():
            speed = name.endswith(("linear_velocity", "depenetration_velocity"))
            setattr(body, name, value * self.unit if speed else value)
        self._place(body, sapien.Pose([self.unit * c for c in three_components(bodies.x[i])], turn))
        if moving:
            body.linear_velocity = [self.unit * c for c in three_components(bodies.v[i])]
            body.angular_velocity = three_components(bodies.omega[i])
        return body

    def _wall(self, k: int) -> Any:
        wall = self.scene.walls[k]
        body = physx.PhysxRigidDynamicComponent() if wall.motion else physx.PhysxRigidStaticComponent()
        # PhysX's plane faces its own x; from_z gives the rotation that takes z there.
        w, x, y, z = from_z(np.array(three_components(wall.normal)))
        local = sapien.Pose([self.unit * c for c in three_components(wall.point)], [w, x, y, z])
        upright = sapien.Pose([0.0, 0.0, 0.0], [math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0])
        for surface in self.surfaces[class_of(self.scene, len(self.scene.bodies) + k)]:
            self._attach(body, physx.PhysxCollisionShapePlane, surface, local * upright)
        if wall.motion:
            body.kinematic = True
        self._place(body, sapien.Pose())
        return body

    def _attach(self, body: Any, make: Any, surface: Any, local: Any = None) -> None:
        shape = make(physx.PhysxMaterial(surface.mu, surface.mu, surface.restitution))
        shape.set_collision_groups([surface.mask, surface.meets, 0, 0])
        if not self.stock:
            shape.contact_offset, shape.rest_offset = 0.5 * (1.0 + _AHEAD) * self.touch, 0.5 * self.touch
        elif self.contact_offset is not None:
            shape.contact_offset = self.contact_offset
        if local is not None:
            shape.local_pose = local
        body.attach(shape)

    def _place(self, body: Any, pose: Any) -> None:
        entity = sapien.Entity()
        entity.add_component(body)
        entity.set_pose(pose)
        self.space.add_entity(entity)
