"""A scene in dartpy.

- A disk is a sphere on a planar joint (x, y, angle), or on one without angle where it cannot turn; its moment of inertia is
  the disk's. A sphere of 3D is on a free joint, or on a translational one where it cannot turn; fixed and driven ones are immobile
  skeletons, as walls are.
- A wall is an infinite plane on an immobile skeleton; before each step it gets its exact pose and the velocity that takes it
  to the next.
- A box is a box. Where the scene has some, a wall is the face of a large box: of a box on a plane DART's own collision detector makes
  one contact, at the middle of the face.
- A pair's friction is the SMALLER of its bodies' coefficients, its restitution their PRODUCT (see `product_factors`).
- Walls are raised, and radii enlarged, by half of ``touch`` each, some units of round-off: bodies which touch are then
  in contact whatever the rounding of their coordinates.
- Overlaps are corrected by split impulses, which leave no momentum behind; without them DART adds velocities up to 1e-3 m/s.
- No body is put to sleep.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import dartpy
import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.boxes import has_boxes, rotation_matrix
from ninedisk.harness.api.knobs import given_knobs, recorded_knobs
from ninedisk.harness.engines.boxes import ContactSums
from ninedisk.harness.engines.dart.adapter import FORCE_MIXING, KNOBS, OPTIONS
from ninedisk.harness.engines.lengths import touch_length, wall_reach
from ninedisk.harness.engines.package import product_factors
from ninedisk.harness.engines.world import (
    WorldSession,
    from_z,
    quaternion_of,
    signed_angle,
    three_components,
    vector_of,
)

ENGINE_VERSION = str(dartpy.__version__)

_UNLIMITED = 1e30
"""Friction of a disk that meets walls only: the wall's coefficient is then the pair's."""

SWEEP_TOLERANCE, MAX_SWEEPS = 1e-12, 10_000
"""Residual, of the size of DART's regularisation squared, and sweeps that a stack of dozens of bodies needs at most."""

BOX_TOLERANCE, BOX_SWEEPS = 1e-6, 1_000
"""The same of scenes with boxes: the contacts of a face reach no smaller residual, and a step that does not reach it is solved anew by
DART's dantzig, with a pyramid of friction."""

DETECTORS = {
    "dart": dartpy.collision.DARTCollisionDetector,
    "fcl": dartpy.collision.FCLCollisionDetector,
    "ode": dartpy.collision.OdeCollisionDetector,
    "bullet": dartpy.collision.BulletCollisionDetector,
}


class DartSession(WorldSession):
    """The `Session` of one run."""

    engine = "DART"

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        super().__init__(scene, numerics, pairs)
        options = read_options("dart", OPTIONS, numerics)
        stock = options["dart.profile"] == "stock"
        given = given_knobs("dart", KNOBS, numerics) if stock else {}
        options |= {f"dart.{name}": given[name] for name in ("solver", "collision_detector") if name in given}
        split = given.get("split_impulse", "off") == "on" if stock else True
        self.touch = 0.0 if stock else touch_length(scene, numerics, "DART")
        self.solid = has_boxes(scene)
        self.reach = wall_reach(scene, numerics, "DART") if self.solid else 0.0
        sweeps = options["dart.solver"] == "nsgs"
        tolerance, most = (BOX_TOLERANCE, BOX_SWEEPS) if self.solid else (SWEEP_TOLERANCE, MAX_SWEEPS)
        self.settings: dict[str, Any] = {
            **options,
            "dart.split_impulse": split,
            "dart.deactivation": False,
            "dart.constraint_force_mixing": FORCE_MIXING,
            "dart.touch": self.touch,
            **({"dart.tolerance": tolerance, "dart.max_sweeps": most} if sweeps else {}),
            "dart.friction_of_a_pair": "the smaller one",
            "dart.restitution_of_a_pair": "product",
            **recorded_knobs("dart", given),
        }
        self.world = dartpy.simulation.World("ninedisk")
        self.world.setTimeStep(self.dt)
        self.world.setGravity(three_components(scene.gravity))
        awake = self.world.getDeactivationOptions()
        awake.mEnabled = False
        self.world.setDeactivationOptions(awake)
        solver = self.world.getConstraintSolver()
        solver.setCollisionDetector(DETECTORS[options["dart.collision_detector"]]())
        if sweeps:  # dantzig is DART's default, and Python cannot construct another one
            solver.setBoxedLcpSolver(_gauss_seidel(tolerance, most))
        solver.setSplitImpulseEnabled(split)
        alone = len(scene.bodies) < 2
        bounce = product_factors(
            None if alone else scene.law_of_bodies.restitution or 0.0,
            [wall.law.restitution or 0.0 for wall in scene.walls],
        )
        friction = _UNLIMITED if alone else scene.law_of_bodies.mu
        self.number: dict[str, int] = {}
        self.disks = [self._disk(i, friction, bounce[0]) for i in range(len(scene.bodies))]
        self.walls = [self._wall(k, bounce[1][k]) for k in range(len(scene.walls))]

    def step(self, *, last: bool) -> None:
        """Step the world, and sum the spins of spheres: DART moves bodies with those of the step's end."""
        if last and self.solid:  # contacts are found at the begin of a step
            self.centres = np.array([each.getBodyNode(0).getTransform().translation() for each in self.disks])
        self.world.step()
        if self.scene.dimension == 3:
            for i, sphere in enumerate(self.disks):
                self.angle[i] += self.dt * sphere.getBodyNode(0).getAngularVelocity()

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        for i, disk in enumerate(self.disks):
            if self.scene.dimension == 3:
                body = disk.getBodyNode(0)
                history.x[row, i], history.v[row, i] = body.getTransform().translation(), body.getLinearVelocity()
                if history.quaternion is not None:
                    history.quaternion[row, i] = quaternion_of(np.array(body.getTransform().rotation()))
                history.angle[row, i], history.omega[row, i] = self.angle[i], body.getAngularVelocity()
                continue
            position, velocity = disk.getPositions(), disk.getVelocities()
            history.x[row, i], history.v[row, i] = position[:2], velocity[:2]
            turning = len(position) > 2
            history.angle[row, i], history.omega[row, i] = (position[2], velocity[2]) if turning else (0.0, 0.0)

    def impulses(self) -> dict[Pair, FloatArray]:
        """Impulse [N s] of the last step on the first body of each touching pair."""
        sums, size = ContactSums(self.scene), self.scene.dimension
        for contact in self.world.getLastCollisionResult().getContacts():
            objects = (contact.collisionObject1, contact.collisionObject2)
            one, two = (self.number[each.getShapeFrame().getName()] for each in objects)
            on_first = np.array(contact.force[:size]) * self.dt  # DART's force acts on its first object
            if self.solid:
                sums.add(one, two, on_first, np.array(contact.point), self.centres)
            else:
                sums.add(one, two, on_first)
        self.moments = sums.moments
        return sums.impulses

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:
        """Set a wall's pose and its chord velocity over the coming step."""
        self.walls[k].setPositions([*here, signed_angle(self.scene.walls[k].normal, facing)])
        self.walls[k].setVelocities([*((there - here) / self.dt), rate])

    def drive_3d(self, k: int, point: FloatArray, rotation: FloatArray, velocity: FloatArray, rate: FloatArray) -> None:
        """Set a wall's pose and its velocities over the coming step."""
        self.walls[k].setPositions([*vector_of(rotation), *point])
        self.walls[k].setVelocities([*rate, *velocity])

    def drive_sphere(self, i: int, place: FloatArray) -> None:
        """Set a sphere's pose and velocities."""
        self.disks[i].setPositions([0.0, 0.0, 0.0, *place])
        self.disks[i].setVelocities([*self.scene.spheres.omega[i], *self.scene.spheres.v[i]])

    def push(self, i: int, load: FloatArray) -> None:
        """DART forgets forces after a step."""
        body = self.disks[i].getBodyNode(0)
        body.setExtForce(load[:3].tolist(), [0.0, 0.0, 0.0], False)
        body.setExtTorque(load[3:].tolist(), False)

    def _disk(self, i: int, friction: float, restitution: float) -> Any:
        bodies, flat = self.scene.bodies, self.scene.dimension == 2
        skeleton = dartpy.dynamics.Skeleton(f"{self.scene.noun} {i}")
        turning = bool(bodies.rotating[i]) or i in self.driven
        if turning:
            body = self._turning_joint(skeleton)
        elif flat:
            joint, body = skeleton.createTranslationalJoint2DAndBodyNodePair()
            joint.setXYPlane()
        else:
            joint, body = skeleton.createTranslationalJointAndBodyNodePair()
            if self.solid:  # moves along the axes of the scene, turned as at time 0
                kept = dartpy.math.Isometry3()
                kept.set_rotation(rotation_matrix(bodies.quaternion[i]).T)
                joint.setTransformFromChildBodyNode(kept)
        self._give_shape(body, i, friction, restitution)
        omega = [] if not turning else [float(bodies.omega[i])] if flat else bodies.omega[i].tolist()
        turned = (
            vector_of(rotation_matrix(bodies.quaternion[i])).tolist()
            if self.solid and turning
            else [0.0 for _ in omega]
        )
        skeleton.setPositions(self._coordinates(bodies.x[i], turned))
        skeleton.setVelocities(self._coordinates(bodies.v[i], omega))
        if not flat:
            skeleton.setMobile(not (self.fixed[i] or i in self.driven))
        self.world.addSkeleton(skeleton)
        return skeleton

    def _turning_joint(self, skeleton: Any) -> Any:
        """A body that moves and turns."""
        if self.scene.dimension == 3:
            return skeleton.createFreeJointAndBodyNodePair()[1]
        joint, body = skeleton.createPlanarJointAndBodyNodePair()
        joint.setXYPlane()
        return body

    def _coordinates(self, place: Sequence[float], turn: Sequence[float]) -> list[float]:
        """Numbers of a joint: rotations come last in 2D, first in 3D."""
        return [*place, *turn] if self.scene.dimension == 2 else [*turn, *place]

    def _give_shape(self, body: Any, i: int, friction: float, restitution: float) -> None:
        bodies = self.scene.bodies
        if self.solid and bodies.boxes[i]:
            shape = dartpy.dynamics.BoxShape(2.0 * bodies.half_sizes[i] + self.touch)
        else:
            shape = dartpy.dynamics.SphereShape(float(bodies.radius[i]) + 0.5 * self.touch)
        self._give_surface(body, shape, i, friction, restitution)
        inertia = np.diag(np.full(3, bodies.inertia[i]))
        body.setInertia(dartpy.dynamics.Inertia(float(bodies.mass[i]), [0.0, 0.0, 0.0], inertia))

    def _wall(self, k: int, restitution: float) -> Any:
        wall = self.scene.walls[k]
        skeleton = dartpy.dynamics.Skeleton(f"wall {k}")
        body = self._turning_joint(skeleton)
        skeleton.setPositions(self._coordinates(wall.point, [0.0] if self.scene.dimension == 2 else [0.0] * 3))
        number = len(self.scene.bodies) + k
        if self.solid:
            wide = dartpy.dynamics.BoxShape([2.0 * self.reach] * 3)
            surface = self._give_surface(body, wide, number, wall.law.mu, restitution)
            facing = rotation_matrix(np.array(from_z(np.array(wall.normal))))
            surface.setRelativeRotation(facing)
            surface.setRelativeTranslation((0.5 * self.touch - self.reach) * np.array(wall.normal))
        else:
            plane = dartpy.dynamics.PlaneShape(three_components(wall.normal), 0.5 * self.touch)
            self._give_surface(body, plane, number, wall.law.mu, restitution)
        skeleton.setMobile(False)
        self.world.addSkeleton(skeleton)
        return skeleton

    def _give_surface(self, body: Any, shape: Any, number: int, friction: float, restitution: float) -> Any:
        name = f"body {number}"
        self.number[name] = number
        surface = body.createShapeNode(shape, name)
        surface.createCollisionAspect()
        contact = surface.createDynamicsAspect()
        contact.setFrictionCoeff(friction)
        contact.setRestitutionCoeff(restitution)
        return surface


def _gauss_seidel(tolerance: float, sweeps: int) -> Any:
    """DART's non-smooth Gauss-Seidel with Coulomb's cone."""
    solver = dartpy.constraint.NsgsFrictionSolver()
    options = solver.getOptions()
    options.law = dartpy.constraint.NsgsFrictionSolver.Law.Coulomb
    options.tolerance, options.maxSweeps = tolerance, sweeps
    solver.setOptions(options)
    return solver
