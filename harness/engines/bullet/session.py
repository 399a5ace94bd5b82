"""A scene in pybullet.

- A disk is a sphere whose three moments of inertia are the disk's; with no force along z it stays at z = 0 to the
  last bit and its z moment is the only one that matters. Moments of 0 are Bullet's way to block rotation.
- A wall is an infinite plane. A sphere on it has one contact with the exact normal; on the face of a box, whose contact
  comes from a general convex algorithm, the normal is off by 1e-14 and velocities by as much.
- The coefficients of a pair are the PRODUCT of its bodies' ones, see `product_factors`.
- A box is a box. Where the scene has some, a wall is the face of a large box: a box on a plane has one contact in a step, where its corner
  is lowest, and cannot rest on it; two boxes have up to four, all found anew in each step.
- Contacts begin where the gap is below `contactBreakingThreshold`. Bullet's 0.02 m makes a contact of a body in flight
  and takes a fall's speed away ahead of the impact; here it is some units of round-off, so that bodies which touch are
  in contact whatever the rounding of their coordinates. Between spheres contacts begin with an overlap: radii are
  larger by half that length.
- Bullet has lengths compiled into it and asks for moving bodies between 0.05 and 10 units across: its spheres of 5e5 never touch
  a plane, rolling ones of 5e-4 lose it for single steps. It is given lengths in a unit that makes the mean radius about 1, a
  power of two, so that the change of units rounds nothing.
- The solver does all its iterations (`solverResidualThreshold` 0).
- Before each step a wall gets its exact pose and the velocity that takes it to the next. In 3D a body without mass that moves with v and
  turns with omega meets contacts in a step with ``v + dt omega x v``: Bullet adds what the velocity changes by in the body's own frame. It
  is given the v for which that is the prescribed one.
- A pair's resistance to rolling [m], and to spinning, is the sum of each body's own times the other's friction: walls have all of it.
"""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import Any

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.boxes import has_boxes
from ninedisk.harness.api.knobs import given_knobs, recorded_knobs
from ninedisk.harness.engines.boxes import ContactSums
from ninedisk.harness.engines.bullet.adapter import KNOBS, OPTIONS
from ninedisk.harness.engines.lengths import touch_length, wall_reach
from ninedisk.harness.engines.package import product_factors
from ninedisk.harness.engines.world import WorldSession, from_z, quaternion_of, signed_angle, three_components

ENGINE_VERSION = version("pybullet")

OWN = "Bullet's own"
"""A setting that a stock run leaves alone."""

PARAMETERS = {
    "iterations": "numSolverIterations",
    "restitution_threshold": "restitutionVelocityThreshold",
    "contact_erp": "contactERP",
    "breaking_threshold": "contactBreakingThreshold",
}
DAMPINGS = {"linear_damping": "linearDamping", "angular_damping": "angularDamping"}
"""Bullet's own names of the adapter's knobs, of the world and of a body."""

_UNLIMITED = 1e30
"""Limit [m/s, rad/s] of a body's velocities; Bullet's own is 100."""

BOX_SWEEPS = 10
"""Sweeps over the contacts of a scene with boxes, in units of those of spheres: the corners of a face share one load, and 200 sweeps leave
a third of it in a step."""


class BulletSession(WorldSession):
    """The `Session` of one run."""

    engine = "Bullet"

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        super().__init__(scene, numerics, pairs)
        options = read_options("bullet", OPTIONS, numerics)
        stock = options["bullet.profile"] == "stock"
        touch = 0.0 if stock else touch_length(scene, numerics, "Bullet")
        bodies = scene.bodies
        radii = bodies.radius
        self.unit = 2.0 ** -round(math.log2(float(radii.mean()))) if len(radii) and not stock else 1.0
        self.solid = has_boxes(scene)
        # Two boxes touch where they overlap, spheres and planes within the threshold.
        self.inflate = 0.5 * touch if len(bodies) > 1 or self.solid else 0.0
        self.reach = wall_reach(scene, numerics, "Bullet") if self.solid else 0.0
        parameters = {
            "numSolverIterations": options["bullet.iterations"] * (BOX_SWEEPS if has_boxes(scene) else 1),
            "solverResidualThreshold": 0.0,
            "contactERP": options["bullet.contact_erp"],
            "contactBreakingThreshold": touch * self.unit,
            "contactSlop": 0.0,
            "restitutionVelocityThreshold": 0.0,
            "enableConeFriction": int(options["bullet.friction"] == "cone"),
            "deterministicOverlappingPairs": 1,
        }
        self.undamped = {"linearDamping": 0.0, "angularDamping": 0.0, "maxJointVelocity": _UNLIMITED}
        if stock:  # what a script leaves alone
            parameters = {"numSolverIterations": options["bullet.iterations"], "deterministicOverlappingPairs": 1}
            given = given_knobs("bullet", KNOBS, numerics)
            parameters |= {PARAMETERS[name]: value for name, value in given.items() if name in PARAMETERS}
            self.undamped = {DAMPINGS[name]: value for name, value in given.items() if name in DAMPINGS}
            options = {name: options[name] for name in ("bullet.profile", "bullet.iterations")}
            options |= recorded_knobs("bullet", given)
        self.settings: dict[str, Any] = {
            **options,
            **{f"bullet.{name}": value for name, value in parameters.items()},
            "bullet.lengths_per_metre": self.unit,
            "bullet.linearDamping": OWN if stock else 0.0,
            "bullet.angularDamping": OWN if stock else 0.0,
            **(
                dict.fromkeys(
                    ("bullet.contactERP", "bullet.contactBreakingThreshold", "bullet.enableConeFriction"), OWN
                )
                if stock
                else {}
            ),
            "bullet.useMaximalCoordinates": False,
            "bullet.friction_of_a_pair": "product",
            "bullet.restitution_of_a_pair": "product",
        }
        self.world = BulletClient(connection_mode=pybullet.DIRECT)
        self.world.setTimeStep(self.dt)
        self.world.setGravity(*(self.unit * component for component in three_components(scene.gravity)))
        self.world.setPhysicsEngineParameter(**parameters)
        law, walls = scene.law_of_bodies, [wall.law for wall in scene.walls]
        alone = len(bodies) < 2
        friction = product_factors(None if alone else law.mu, [wall.mu for wall in walls])
        bounce = product_factors(None if alone else law.restitution or 0.0, [wall.restitution or 0.0 for wall in walls])
        self.share = friction[0]
        self.disks = [self._disk(i, friction[0], bounce[0]) for i in range(len(bodies))]
        self.walls = [self._wall(k, friction[1][k], bounce[1][k]) for k in range(len(scene.walls))]
        self.number = {body: number for number, body in enumerate([*self.disks, *self.walls])}

    def step(self, *, last: bool) -> None:
        """Step the world, and follow the rotations: Bullet knows orientations, and moves bodies with the spins of the step's end."""
        if last and self.solid:
            self.centres = self._centres()  # contacts are found at the begin of a step
        self.world.stepSimulation()
        for i, body in enumerate(self.disks):
            if self.scene.dimension == 3:
                self.angle[i] += self.dt * np.array(self.world.getBaseVelocity(body)[1])
            else:
                _, (_, _, z, w) = self.world.getBasePositionAndOrientation(body)
                self.angle[i] += math.remainder(2.0 * math.atan2(z, w) - self.angle[i], math.tau)

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        for i, body in enumerate(self.disks):
            position, turn = self.world.getBasePositionAndOrientation(body)
            if history.quaternion is not None:
                history.quaternion[row, i] = turn[3], *turn[:3]
            velocity, spin = self.world.getBaseVelocity(body)
            size = history.x.shape[2]
            history.x[row, i], history.v[row, i] = np.array([position[:size], velocity[:size]]) / self.unit
            history.omega[row, i] = spin[2] if size == 2 else spin
        history.angle[row] = self.angle

    def impulses(self) -> dict[Pair, FloatArray]:
        """Impulse [N s] of the last step on the first body of each touching pair."""
        sums, size = ContactSums(self.scene), self.scene.dimension
        for contact in self.world.getContactPoints():
            one, two = self.number[contact[1]], self.number[contact[2]]
            # Bullet's normal points from its second body to its first; its forces act on the first.
            parts = ((contact[9], contact[7]), (contact[10], contact[11]), (contact[12], contact[13]))
            on_first = sum((force * np.array(direction[:size]) for force, direction in parts), np.zeros(size)) * (
                self.dt / self.unit
            )
            if self.solid:
                sums.add(one, two, on_first, np.array(contact[5]) / self.unit, self.centres)
            else:
                sums.add(one, two, on_first)
        self.moments = sums.moments
        return sums.impulses

    def _centres(self) -> FloatArray:
        """Centres of all bodies [m]."""
        return np.array([self.world.getBasePositionAndOrientation(body)[0] for body in self.disks]) / self.unit

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:
        """Set a wall's pose and its chord velocity over the coming step."""
        half = 0.5 * signed_angle(self.scene.walls[k].normal, facing)
        body, place = self.walls[k], [*(here * self.unit), 0.0]
        self.world.resetBasePositionAndOrientation(body, place, [0.0, 0.0, math.sin(half), math.cos(half)])
        self.world.resetBaseVelocity(body, [*((there - here) * (self.unit / self.dt)), 0.0], [0.0, 0.0, rate])

    def drive_3d(self, k: int, point: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray) -> None:
        """Set a wall's pose and its velocities over the coming step."""
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

    def push(self, i: int, load: FloatArray) -> None:
        """Bullet forgets forces after a step."""
        body, unit = self.disks[i], self.unit
        place, _ = self.world.getBasePositionAndOrientation(body)
        self.world.applyExternalForce(body, -1, (unit * load[:3]).tolist(), place, pybullet.WORLD_FRAME)
        self.world.applyExternalTorque(body, -1, (unit**2 * load[3:]).tolist(), pybullet.WORLD_FRAME)

    def _disk(self, i: int, friction: float, restitution: float) -> int:
        disks = self.scene.bodies
        turn = [0.0, 0.0, 0.0, 1.0]
        if self.solid:
            turn = [*disks.quaternion[i][1:].tolist(), float(disks.quaternion[i][0])]
        if self.solid and disks.boxes[i]:
            half = (self.unit * (disks.half_sizes[i] + self.inflate)).tolist()
            shape = self.world.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
        else:
            radius = self.unit * (float(disks.radius[i]) + self.inflate)
            shape = self.world.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius)
        place = three_components(self.unit * disks.x[i])
        # A body without mass is Bullet's static one.
        mass = 0.0 if self.fixed[i] or i in self.driven else float(disks.mass[i])
        body: int = self.world.createMultiBody(mass, shape, basePosition=place, baseOrientation=turn)
        inertia = self.unit**2 * np.full(3, disks.inertia[i]) if disks.rotating[i] else np.zeros(3)
        self.world.changeDynamics(
            body,
            -1,
            localInertiaDiagonal=inertia.tolist(),
            lateralFriction=friction,
            restitution=restitution,
            rollingFriction=0.0,
            spinningFriction=0.0,
            **self.undamped,
        )
        self.world.resetBaseVelocity(body, three_components(self.unit * disks.v[i]), three_components(disks.omega[i]))
        return body

    def _wall(self, k: int, friction: float, restitution: float) -> int:
        wall = self.scene.walls[k]
        if self.solid:
            shape = self._wide_box(np.array(wall.normal))
        else:
            shape = self.world.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=three_components(wall.normal))
        body: int = self.world.createMultiBody(
            0.0, shape, basePosition=three_components([self.unit * c for c in wall.point])
        )
        self.world.changeDynamics(
            body,
            -1,
            lateralFriction=friction,
            restitution=restitution,
            **self._resistances(k),
        )
        return body

    def _wide_box(self, normal: FloatArray) -> int:
        """A box one of whose faces is the wall."""
        reach, (w, x, y, z) = self.unit * self.reach, from_z(normal)
        shape: int = self.world.createCollisionShape(
            pybullet.GEOM_BOX,
            halfExtents=[reach] * 3,
            collisionFramePosition=((self.unit * self.inflate - reach) * normal).tolist(),
            collisionFrameOrientation=[x, y, z, w],
        )
        return shape

    def _resistances(self, k: int) -> dict[str, float]:
        """Lengths that times fn are a wall's torques, in Bullet's unit, over the spheres' share of the friction."""
        law, arm = self.scene.walls[k].law, self.unit * float(self.scene.bodies.radius.max(initial=0.0))
        given: dict[str, Any] = {"rollingFriction": None, "spinningFriction": None}
        if self.scene.dimension == 3:
            given = {"rollingFriction": law.rolling, "spinningFriction": law.twisting}
        return {name: 0.0 if each is None else each.mu * arm / self.share for name, each in given.items()}
