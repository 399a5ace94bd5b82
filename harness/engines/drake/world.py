"""A scene as a Drake plant: bodies on joints, in 2D of z = 0, walls as half-spaces, point contacts.

- A disk is a sphere on a planar joint, which has Drake's linear damping, or on two prismatic joints where it cannot turn; a sphere of 3D is
  on a floating joint, or on three prismatic ones.
- Point contacts of two geometries act as their stiffnesses in series, and friction is twice that of the coefficients: see
  `shares_in_series`.
- A box meets walls with its eight corners, tiny spheres as models that come with Drake have them: Drake's point contact gives a box one
  point on a plane, where it is deepest.
- Walls do not meet each other; a wall that moves is a separate body, of a mass that no disk can disturb.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    AddContactMaterial,
    CollisionFilterDeclaration,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    PlanarJoint,
    PrismaticJoint,
    QuaternionFloatingJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.boxes import has_boxes, rotation_matrix
from ninedisk.harness.engines.boxes import CORNERS, ContactSums
from ninedisk.harness.engines.world import quaternion_of, three_components

ENGINE_VERSION = version("drake")

IMMOVABLE = 1e30
"""Mass [kg] of a wall that moves: the forces of a run change its velocity by less than round-off."""

APPROXIMATIONS = {"sap": DiscreteContactApproximation.kSap, "lagged": DiscreteContactApproximation.kLagged}


class Surfaces(NamedTuple):
    """What contacts are made of, by geometry: the disks', then each wall's.

    ``stiffness`` [N/m] and ``friction`` [-] are the shares of `shares_in_series`; without stiffness, contacts have Drake's own, with its
    own dissipation. ``dissipation`` [s/m] is Hunt and Crossley's, ``relaxation_time`` [s] that of SAP (None: not used).
    ``changed`` holds what `AddContactMaterial` gets of contacts with Drake's own stiffness.
    """

    stiffness: tuple[float, list[float]] | None
    friction: tuple[float, list[float]]
    dissipation: float = 0.0
    relaxation_time: float | None = None
    changed: Mapping[str, float] = MappingProxyType({})

    def properties(self, wall: int | None) -> Any:
        """Drake's properties of a disk (None) or of a wall."""
        mu, properties = _share(self.friction, wall), ProximityProperties()
        friction = CoulombFriction(mu, mu)
        if self.stiffness is None:
            AddContactMaterial(friction=friction, properties=properties, **self.changed)
            if self.relaxation_time is not None:
                properties.AddProperty("material", "relaxation_time", self.relaxation_time)
            return properties
        AddContactMaterial(
            dissipation=self.dissipation,
            point_stiffness=_share(self.stiffness, wall),
            friction=friction,
            properties=properties,
        )
        if self.relaxation_time is not None:
            properties.AddProperty("material", "relaxation_time", self.relaxation_time)
        return properties


def _share(shares: tuple[float, list[float]], wall: int | None) -> float:
    """That of the disks (None) or of a wall."""
    return shares[0] if wall is None else shares[1][wall]


class DrakeWorld:
    """Plant, context and simulator of one run.

    Parameters
    ----------
    scene : Scene
    time_step : float
        Step of a discrete plant [s]; 0: continuous.
    surfaces : Surfaces
    approximation : str
        Contact approximation of a discrete plant, ``"sap"`` or ``"lagged"``.
    stiction_tolerance : float or None
        Slip velocity [m/s] up to which the lagged approximation's friction grows.
    near_rigid_threshold : float or None
        SAP makes contacts softer that would respond within a step; 0: none.
    driven : bool
        Whether walls are bodies of their own that `drive` moves.
    blocked : bool
        Whether disks that cannot turn need joints without rotation; no torque acts in a scene without friction.
    inflate : float
        Length [m] by which radii are larger than the scene's.
    """

    def __init__(
        self,
        scene: Scene | SphereScene,
        *,
        time_step: float,
        surfaces: Surfaces,
        approximation: str = "sap",
        stiction_tolerance: float | None = None,
        near_rigid_threshold: float | None = None,
        driven: bool = False,
        blocked: bool = True,
        inflate: float = 0.0,
    ) -> None:
        self.scene = scene
        builder = DiagramBuilder()
        self.plant, geometry = AddMultibodyPlantSceneGraph(builder, time_step)
        plant = self.plant
        plant.set_contact_model(ContactModel.kPoint)
        if time_step > 0.0:
            plant.set_discrete_contact_approximation(APPROXIMATIONS[approximation])
        plant.mutable_gravity_field().set_gravity_vector(three_components(scene.gravity))
        self.number: dict[int, int] = {}
        self.solid = has_boxes(scene)
        self.disks = [self._disk(i, surfaces, blocked, inflate) for i in range(len(scene.bodies))]
        self.prescribed = plant.AddModelInstance("walls")
        plant.set_gravity_enabled(self.prescribed, False)  # no weight, or walls would fall with their immovable mass
        self.walls = [self._wall(k, surfaces, driven) for k in range(len(scene.walls))]
        if near_rigid_threshold is not None:
            plant.set_sap_near_rigid_threshold(near_rigid_threshold)
        plant.Finalize()
        if stiction_tolerance is not None:
            plant.set_stiction_tolerance(stiction_tolerance)
        apart = [body for body, number in self.number.items() if number >= len(scene.bodies)]
        shapes = [g for body in apart for g in plant.GetCollisionGeometriesForBody(plant.get_body(BodyIndex(body)))]
        geometry.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(shapes)))
        diagram = builder.Build()
        self.simulator = Simulator(diagram)
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        for i, joint in enumerate(self.disks):
            joint.set(self.context, scene.bodies.x[i], scene.bodies.v[i], scene.bodies.omega[i])

    def state(self) -> tuple[NDArray[np.float64], ...]:
        """Centres, velocities, rotations and spins of the disks."""
        rows = [joint.get(self.context) for joint in self.disks]
        columns = tuple(np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
        bodies = self.scene.bodies
        return columns if columns else (bodies.x, bodies.v, bodies.omega, bodies.omega)

    def forces(self, centres: NDArray[np.float64]) -> ContactSums:
        """Forces [N] on the first body of each touching pair; ``centres`` of all bodies where the contacts were found [m]."""
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        sums, size = ContactSums(self.scene), self.scene.dimension
        for c in range(results.num_point_pair_contacts()):
            contact = results.point_pair_contact_info(c)
            one, two = (self.number[int(index)] for index in (contact.bodyA_index(), contact.bodyB_index()))
            sums.add(two, one, np.array(contact.contact_force()[:size]), np.array(contact.contact_point()), centres)
        return sums

    def quaternions(self) -> NDArray[np.float64]:
        """Rotations of the bodies of a scene with boxes, shape (n, 4)."""
        found = []
        for number, index in sorted((number, index) for index, number in self.number.items()):
            if number < len(self.scene.bodies):
                pose = self.plant.get_body(BodyIndex(index)).EvalPoseInWorld(self.context)
                found.append(quaternion_of(pose.rotation().matrix()))
        return np.array(found)

    def drive(self, k: int, point: NDArray[np.float64], velocity: NDArray[np.float64]) -> None:
        """Put a wall's point somewhere [m] and give it a velocity [m/s]."""
        self.walls[k].set(self.context, point, velocity, 0.0)

    def _disk(self, i: int, surfaces: Surfaces, blocked: bool, inflate: float) -> Any:
        disks, plant = self.scene.bodies, self.plant
        mass, inertia = float(disks.mass[i]), np.full(3, disks.inertia[i])
        body = plant.AddRigidBody(f"disk {i}", SpatialInertia(mass, np.zeros(3), UnitInertia(*(inertia / mass))))
        self.number[int(body.index())] = i
        if self.solid and disks.boxes[i]:
            for c, corner in enumerate(CORNERS * disks.half_sizes[i]):
                tip = Sphere(inflate)
                pose, name = RigidTransform(corner), f"disk {i} corner {c}"
                plant.RegisterCollisionGeometry(body, pose, tip, name, surfaces.properties(None))
        else:
            sphere = Sphere(float(disks.radius[i]) + inflate)
            plant.RegisterCollisionGeometry(body, RigidTransform(), sphere, f"disk {i}", surfaces.properties(None))
        if blocked and not disks.rotating[i]:
            return _SlidingJoint(plant, body, f"disk {i}", self.scene)
        if isinstance(self.scene, SphereScene):
            return _FloatingJoint(plant, body, f"disk {i}", self.scene.spheres.quaternion[i])
        xi = self.scene.xi
        turning = xi * float(inertia[2]) if disks.rotating[i] else 0.0
        return _TurningJoint(plant, body, f"disk {i}", [xi * mass, xi * mass, turning])

    def _wall(self, k: int, surfaces: Surfaces, driven: bool) -> Any:
        wall, plant = self.scene.walls[k], self.plant
        # Drake's own stiffness counts the heaviest body, be it welded to the world or not.
        mass = IMMOVABLE if surfaces.stiffness is not None else float(self.scene.bodies.mass.min(initial=1.0))
        inertia = SpatialInertia(mass, np.zeros(3), UnitInertia(1.0, 1.0, 1.0))
        body = plant.AddRigidBody(f"wall {k}", self.prescribed, inertia)
        self.number[int(body.index())] = len(self.scene.bodies) + k
        pose = HalfSpace.MakePose(three_components(wall.normal), np.zeros(3))
        plant.RegisterCollisionGeometry(body, pose, HalfSpace(), f"wall {k}", surfaces.properties(k))
        if driven:
            return _TurningJoint(plant, body, f"wall {k}", [0.0, 0.0, 0.0])
        return plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(three_components(wall.point)))


class _TurningJoint:
    """A body that moves and turns in 2D."""

    def __init__(self, plant: Any, body: Any, name: str, damping: Sequence[float]) -> None:
        self.joint = plant.AddJoint(PlanarJoint(name, plant.world_frame(), body.body_frame(), damping))

    def set(self, context: Any, x: NDArray[np.float64], v: NDArray[np.float64], spin: float) -> None:
        """Set centre [m], velocity [m/s] and spin [rad/s]; the angle becomes 0."""
        self.joint.set_pose(context, x, 0.0)
        self.joint.set_translational_velocity(context, v)
        self.joint.set_angular_velocity(context, spin)

    def get(self, context: Any) -> tuple[Any, Any, float, float]:
        """Centre, velocity, angle, spin."""
        joint = self.joint
        pose = joint.get_translation(context), joint.get_translational_velocity(context)
        return *pose, joint.get_rotation(context), joint.get_angular_velocity(context)


class _FloatingJoint:
    """A body that moves and turns in 3D."""

    def __init__(self, plant: Any, body: Any, name: str, quaternion: NDArray[np.float64]) -> None:
        self.turned = RotationMatrix(rotation_matrix(quaternion))
        self.joint = plant.AddJoint(QuaternionFloatingJoint(name, plant.world_frame(), body.body_frame()))

    def set(self, context: Any, x: NDArray[np.float64], v: NDArray[np.float64], spin: Any) -> None:
        """Set centre [m], velocity [m/s] and spin [rad/s], and the orientation of time 0."""
        self.joint.SetPose(context, RigidTransform(self.turned, x))
        self.joint.set_translational_velocity(context, v)
        self.joint.set_angular_velocity(context, spin)

    def get(self, context: Any) -> tuple[Any, ...]:
        """Centre, velocity, nothing for the integral of the spin, spin."""
        joint = self.joint
        x, v = joint.get_translation(context), joint.get_translational_velocity(context)
        return x, v, np.full(3, np.nan), joint.get_angular_velocity(context)


class _SlidingJoint:
    """A body that moves and does not turn."""

    def __init__(self, plant: Any, body: Any, name: str, scene: Scene | SphereScene) -> None:
        damping = scene.xi * body.default_mass() if isinstance(scene, Scene) else 0.0
        axes = "xyz"[: scene.dimension]
        carriers = [plant.AddRigidBody(f"{name} carrier {axis}", SpatialInertia.Zero()) for axis in axes[1:]]
        own = body.body_frame()
        if has_boxes(scene):  # moves along the axes of the scene, turned as at time 0
            kept = RotationMatrix(rotation_matrix(scene.bodies.quaternion[int(name.split()[-1])]).T)
            own = plant.AddFrame(FixedOffsetFrame(f"{name} kept", own, RigidTransform(kept)))
        frames = [plant.world_frame(), *(each.body_frame() for each in carriers), own]
        self.still = np.zeros(3) if scene.dimension == 3 else 0.0
        self.joints = [
            plant.AddJoint(PrismaticJoint(f"{name} {axis}", frames[k], frames[k + 1], np.eye(3)[k], damping=damping))
            for k, axis in enumerate(axes)
        ]

    def set(self, context: Any, x: NDArray[np.float64], v: NDArray[np.float64], spin: Any) -> None:  # noqa: ARG002
        """Set centre [m] and velocity [m/s]."""
        for k, joint in enumerate(self.joints):
            joint.set_translation(context, x[k])
            joint.set_translation_rate(context, v[k])

    def get(self, context: Any) -> tuple[Any, ...]:
        """Centre, velocity, angle, spin."""
        x = [joint.get_translation(context) for joint in self.joints]
        return x, [joint.get_translation_rate(context) for joint in self.joints], self.still, self.still
