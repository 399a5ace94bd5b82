"""A scene in SAPIEN, whose bodies are PhysX's.

- A disk is a sphere whose three moments of inertia are the disk's; with no force along z it stays at z = 0. Moments of 0 are PhysX's
  way to block rotation; locked axes instead are an approximation of it, with which a sliding disk has 0.7 % too little friction.
- A wall is an infinite plane: static, or kinematic where it moves. PhysX takes a kinematic body's velocity from the difference of two poses
  in single precision; the body is therefore kept near the origin, as a plane may be moved along itself.
- A pair's coefficients would be the MEAN of its bodies' ones; see `channels`.
- Contacts begin where the gap is below the sum of both contact offsets. PhysX's 0.01 m each make a contact of a body in flight, whose
  restitution is 0.8 of what it should be in some of these cases; here they are some units of round-off, and bodies which touch are in contact whatever
  the rounding of their coordinates.
- No overlap is taken out (``max_depenetration_velocity``): what takes it out would stay in the momentum.
- PhysX has lengths in it, for bodies of about 1: it is given lengths in a unit that makes the mean radius about 1, a power of two.
- SAPIEN reports normal impulses. Friction follows from the momentum of the step where that is unique (`unseen_friction`), else it is
  not observed.
"""

from __future__ import annotations

import math
import warnings
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
from ninedisk.harness.api.boxes import has_boxes, rotation_matrix
from ninedisk.harness.engines.lengths import largest_extent, longest_path, wall_reach
from ninedisk.harness.engines.sapien.adapter import OPTIONS
from ninedisk.harness.engines.sapien.channels import class_of, surfaces
from ninedisk.harness.engines.unseen_friction import Push, frictions
from ninedisk.harness.engines.world import (
    WorldSession,
    from_z,
    quaternion_of,
    rotation_of,
    signed_angle,
    three_components,
)

ENGINE_VERSION = version("sapien")

OWN = "SAPIEN's own"
"""A setting that a stock run leaves alone."""

_UNLIMITED = 1e16
"""Limit [m/s, rad/s] of a body's velocities, whose square single precision holds; PhysX's own for spins is 100."""

_NO_CORRECTION = 1e-12
"""Speed [m/s] with which overlaps are taken out; PhysX refuses 0."""

_TOUCH_ULPS = 16.0
"""A gap is a sum of a few coordinates of bodies and walls, each rounded to half a unit in the last place."""

_EPS = float(np.finfo(np.float32).eps)


class SapienSession(WorldSession):
    """The `Session` of one run."""

    engine = "SAPIEN"

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        super().__init__(scene, numerics, pairs)
        options = read_options("sapien", OPTIONS, numerics)
        self.stock = options["sapien.profile"] == "stock"
        self.iterations = options["sapien.position_iterations"], options["sapien.velocity_iterations"]
        bodies = scene.bodies
        scaled = len(bodies) > 0 and not self.stock
        self.unit = 2.0 ** -round(math.log2(float(bodies.radius.mean()))) if scaled else 1.0
        wall_reach(scene, numerics, "SAPIEN")  # raises where paths are no finite lengths
        extent = self.unit * (largest_extent(scene) + longest_path(scene, numerics))
        self.touch = _TOUCH_ULPS * float(np.spacing(np.float32(extent)))
        self.solid = has_boxes(scene)
        own = physx.PhysxSceneConfig()
        config = {
            "bounce_threshold": float(own.bounce_threshold) if self.stock else 0.0,
            "enable_tgs": options["sapien.solver"] == "tgs",
            "enable_pcm": True,
            "enable_ccd": False,
            "enable_enhanced_determinism": not self.stock,
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
            "sapien.contact_offset": OWN if self.stock else self.touch / self.unit,
            "sapien.rest_offset": 0.0,
            "sapien.lengths_per_metre": self.unit,
            "sapien.pair_coefficients": "the scene's own, by one shape for each law",
            "sapien.friction_impulses": "from the momentum of the step, where unique",
        }
        gravity = self.unit * np.array(three_components(scene.gravity))
        physx.set_scene_config(gravity=gravity.astype(np.float32), **config)
        self.world = physx.PhysxCpuSystem()
        self.world.timestep = self.dt
        self.space = sapien.Scene([self.world])
        self.surfaces = surfaces(scene)
        self.disks = [self._disk(i) for i in range(len(bodies))]
        self.walls = [self._wall(k) for k in range(len(scene.walls))]
        self.number = {body.entity.per_scene_id: k for k, body in enumerate([*self.disks, *self.walls])}
        self.loads = np.zeros((len(bodies), 3))
        self.before: tuple[FloatArray, ...] = ()

    def step(self, *, last: bool) -> None:
        """Step the world, and follow the rotations: PhysX moves bodies with the velocities of the step's end."""
        if last:
            self.before = self._state()
        self.world.step()
        for i, body in enumerate(self.disks):
            if self.scene.dimension == 3:
                self.angle[i] += self.dt * np.float64(body.angular_velocity)
            else:
                w, _, _, z = np.float64(body.entity.pose.q)
                self.angle[i] += math.remainder(2.0 * math.atan2(z, w) - self.angle[i], math.tau)
        if not last:
            self.loads[:] = 0.0

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        size = self.scene.dimension
        x, v, spin, turn = self._state()
        history.x[row], history.v[row], history.angle[row] = x[:, :size], v[:, :size], self.angle
        history.omega[row] = spin if size == 3 else spin[:, 2]
        if history.quaternion is not None:
            history.quaternion[row] = turn

    def _state(self) -> tuple[FloatArray, ...]:
        """Positions [m], velocities [m/s], spins [rad/s] and orientations of all bodies."""
        poses = [body.entity.pose for body in self.disks]
        n = len(poses)
        return (
            np.array([pose.p for pose in poses], dtype=np.float64).reshape(n, 3) / self.unit,
            np.array([body.linear_velocity for body in self.disks], dtype=np.float64).reshape(n, 3) / self.unit,
            np.array([body.angular_velocity for body in self.disks], dtype=np.float64).reshape(n, 3),
            np.array([pose.q for pose in poses], dtype=np.float64).reshape(n, 4),
        )

    def impulses(self) -> dict[Pair, FloatArray]:
        """Impulse [N s] of the last step on the first body of each touching pair; components that are not observed are NaN."""
        scene, bodies, size = self.scene, self.scene.bodies, self.scene.dimension
        pushes = self._pushes()
        x, v, spin, turn = self._state()
        free = [not (self.fixed[i] or i in self.driven) for i in range(len(bodies))]
        mass = np.asarray(bodies.mass, dtype=np.float64)
        given = mass[:, None] * self.dt * np.array(scene.gravity)
        if size == 2:
            given = given + self.dt * self.loads[:, :2]
        left = (mass[:, None] * (v - self.before[1])[:, :size]) - given
        fastest = max(float(np.abs(v).max(initial=0.0)), float(np.abs(self.before[1]).max(initial=0.0)))
        most = max((float(np.abs(push.impulse).max()) for push in pushes.values()), default=0.0)
        noise = 100.0 * _EPS * (float(mass.max(initial=0.0)) * fastest + most)
        rubbed = frictions(pushes, left, free, noise)
        self.loads[:] = 0.0
        total = {pair: push.impulse + rubbed.get(pair, 0.0) for pair, push in pushes.items()}
        if self.solid:
            self.moments = self._moments(pushes, spin, turn, free)
        return total

    def _pushes(self) -> dict[Pair, Push]:
        size = self.scene.dimension
        impulse: dict[Pair, FloatArray] = {}
        place: dict[Pair, FloatArray] = {}
        for contact in self.world.get_contacts():
            one, two = (self.number[body.entity.per_scene_id] for body in contact.bodies)
            pair, sign = ((one, two), 1.0) if one < two else ((two, one), -1.0)
            for point in contact.points:  # PhysX's impulse acts on its first body
                part = np.float64(point.impulse) / self.unit
                impulse[pair] = impulse.get(pair, np.zeros(3)) + sign * part
                weighted = np.linalg.norm(part) * np.float64(point.position) / self.unit
                place[pair] = place.get(pair, np.zeros(3)) + weighted
        return {
            pair: Push(on_first[:size], place[pair] / (np.linalg.norm(on_first) or 1.0), self.scene.law(pair).mu > 0.0)
            for pair, on_first in impulse.items()
        }

    def _moments(
        self, pushes: dict[Pair, Push], spin: FloatArray, turn: FloatArray, free: list[bool]
    ) -> dict[Pair, FloatArray]:
        """Moments [N m s] about the centre of the first body: all of its change of spin where that is its one contact."""
        found = {}
        for pair, push in pushes.items():
            i = pair[0]
            alone = free[i] and sum(i in other for other in pushes) == 1
            if alone and self.scene.bodies.rotating[i]:
                axes = rotation_matrix(self.before[3][i])
                inertia = axes @ np.diag(np.broadcast_to(self.scene.bodies.inertia[i], 3)) @ axes.T
                found[pair] = inertia @ (spin[i] - self.before[2][i])
            elif push.rough:
                found[pair] = np.full(3, np.nan)
            else:
                found[pair] = np.cross(push.place - self.before[0][i], push.impulse)
        return found

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:
        """Set a wall's pose and its chord velocity over the coming step."""
        angle = signed_angle(self.scene.walls[k].normal, facing)
        velocity = np.array([*((there - here) / self.dt), 0.0])
        self.drive_3d(
            k, np.array([*here, 0.0]), rotation_of(np.array([0.0, 0.0, angle])), velocity, np.array([0.0, 0.0, rate])
        )

    def drive_3d(self, k: int, point: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray) -> None:
        """Set a wall's pose and its velocities over the coming step."""
        wall = self.scene.walls[k]
        normal = rotation @ np.array(three_components(wall.normal))
        # The plane's body, of which the wall is a face at the same distance as at time 0: moved along the plane it is the same plane.
        away = point - rotation @ np.array(three_components(wall.point))
        place = (away @ normal) * normal
        self._move(self.walls[k], place, rotation, velocity + np.cross(rate, place - point), rate)

    def drive_sphere(self, i: int, place: FloatArray) -> None:
        """Set a sphere's pose and velocities."""
        self._move(self.disks[i], place, np.eye(3), self.scene.spheres.v[i], self.scene.spheres.omega[i])

    def _move(self, body: Any, place: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray) -> None:
        turned = rotation_of(self.dt * rate) @ rotation
        body.entity.set_pose(sapien.Pose(self.unit * place, quaternion_of(rotation)))
        body.set_kinematic_target(sapien.Pose(self.unit * (place + self.dt * velocity), quaternion_of(turned)))

    def push(self, i: int, load: FloatArray) -> None:
        """PhysX forgets forces after a step."""
        self.loads[i] = load
        force, torque = [load[0] * self.unit, load[1] * self.unit, 0.0], [0.0, 0.0, load[2] * self.unit**2]
        self.disks[i].add_force_torque(force, torque, "force")

    def _disk(self, i: int) -> Any:
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
            speed = name.endswith("linear_velocity") or name.endswith("depenetration_velocity")
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
            shape.contact_offset, shape.rest_offset = 0.5 * self.touch, 0.0
        if local is not None:
            shape.local_pose = local
        body.attach(shape)

    def _place(self, body: Any, pose: Any) -> None:
        entity = sapien.Entity()
        entity.add_component(body)
        entity.set_pose(pose)
        self.space.add_entity(entity)
