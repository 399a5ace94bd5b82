"""A scene as a `Box2D.b2World`.

- Box2D has constants that are lengths and velocities, compiled into it: impacts slower than ``b2_velocityThreshold``, 1,
  are plastic whatever the restitution, no body moves by more than ``b2_maxTranslation``, 2, in a step, and overlaps up to
  ``b2_linearSlop``, 0.005, stay. The scene is therefore given to it in its own units, see `Units`: powers of two, so
  that the change of units rounds nothing.
- Friction and restitution of a contact are set on the contact itself when it begins; Box2D's own combination of two
  fixtures' coefficients (geometric mean, larger one) has no say.
- A wall is a thick polygon on a kinematic body that is turned with it. Polygons have a skin of ``b2_polygonRadius``; the
  polygon's face lies that much below the wall's surface.
- Walls are raised, and circles larger, by half of ``touch`` each, some units of single precision's round-off: bodies which
  touch are then in contact whatever the rounding of their coordinates. ``touch`` is far below the slop, so that nothing
  pushes them apart.
- No sleeping, which is a flag of each body, and no continuous collision detection: it would end the step of a fast body at
  the time of impact.
- Before each step a moving wall gets its exact pose and the velocity that takes it to the next.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, NamedTuple

import Box2D
import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.scene import ContactLaw, Scene
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.api.knobs import given_knobs, recorded_knobs
from ninedisk.harness.engines.box2d.adapter import KNOBS, OPTIONS
from ninedisk.harness.engines.lengths import largest_extent, longest_path, top_speed, wall_reach
from ninedisk.harness.engines.world import WorldSession, signed_angle

ENGINE_VERSION = version("Box2D")

_EXTENT = 2.0**10
"""Largest coordinate, in Box2D's length: its round-off, 6e-5, is then a hundredth of the slop, 0.005."""

_STEP = 0.5 * Box2D.b2_maxTranslation
"""Way of the fastest body in a step, in Box2D's length: half of what Box2D allows, for bodies that impacts make faster."""

_THRESHOLD = 2.0**-20
"""Largest speed of an impact that is taken as plastic, in units of the scene's highest speed: a millionth."""

_TOUCH_ULPS = 8.0
"""A gap is a sum of a few coordinates, each rounded to half a unit in the last place."""


class Units(NamedTuple):
    """Box2D's length, time and mass in metres, seconds and kilograms: powers of two."""

    length: float
    time: float
    mass: float

    @property
    def velocity(self) -> float:
        """Box2D's velocity [m/s]."""
        return self.length / self.time


def units_of(scene: Scene, numerics: Numerics) -> Units:
    """Units in which Box2D's compiled-in lengths and velocity are small beside the scene's.

    The length is the smallest that keeps coordinates below `_EXTENT` and ways in a step below `_STEP`; then the time is
    such that `_THRESHOLD` times the highest speed is Box2D's velocity threshold.
    """
    fall = math.hypot(*scene.gravity) * numerics.dt * numerics.n_steps
    speed = top_speed(scene) + fall or 1.0
    length = _power_of_two(
        max((largest_extent(scene) + longest_path(scene, numerics)) / _EXTENT, speed * numerics.dt / _STEP)
    )
    time = _power_of_two(Box2D.b2_velocityThreshold * length / (_THRESHOLD * speed))
    return Units(length=length, time=time, mass=_power_of_two(float(scene.disks.mass.max(initial=1.0))))


def _power_of_two(at_least: float) -> float:
    return float(2.0 ** math.ceil(math.log2(at_least)))


class Box2DSession(WorldSession):
    """The `Session` of one run."""

    engine = "Box2D"

    def __init__(self, scene: Scene, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:
        super().__init__(scene, numerics, pairs)
        options = read_options("box2d", OPTIONS, numerics)
        self.reach = wall_reach(scene, numerics, "Box2D")
        stock = options["box2d.profile"] == "stock"
        given = given_knobs("box2d", KNOBS, numerics) if stock else {}
        options |= {f"box2d.{name}": value for name, value in given.items() if f"box2d.{name}" in options}
        continuous = given.get("continuous", "on") == "on" if stock else False
        self.units = units = Units(given.get("length_unit", 1.0), 1.0, 1.0) if stock else units_of(scene, numerics)
        extent = (largest_extent(scene) + longest_path(scene, numerics)) / units.length
        self.touch = 0.0 if stock else _TOUCH_ULPS * float(np.spacing(np.float32(extent)))
        self.iterations = options["box2d.velocity_iterations"], options["box2d.position_iterations"]
        gravity = np.array(scene.gravity) / units.velocity * units.time
        self.world = Box2D.b2World(gravity=_pair(gravity), doSleep=False)
        self.world.continuousPhysics = continuous
        self.world.warmStarting = True
        self.settings: dict[str, Any] = {
            **options,
            "box2d.unit_of_length": units.length,
            "box2d.unit_of_time": units.time,
            "box2d.unit_of_mass": units.mass,
            "box2d.velocity_threshold": Box2D.b2_velocityThreshold * units.velocity,
            "box2d.linear_slop": Box2D.b2_linearSlop * units.length,
            "box2d.polygon_radius": Box2D.b2_polygonRadius * units.length,
            "box2d.baumgarte": Box2D.b2_baumgarte,
            "box2d.touch": self.touch * units.length,
            "box2d.allow_sleep": False,
            "box2d.continuous_physics": continuous,
            "box2d.warm_starting": True,
            "box2d.pair_coefficients": "the scene's own, set on each contact",
            "wall_half_length": self.reach,
            **recorded_knobs("box2d", given),
        }
        self.walls = [self._wall(k) for k in range(len(scene.walls))]
        self.disks = [self._disk(i) for i in range(len(scene.disks))]
        self.laws, self.recorder = _Laws(scene), _Recorder(scene)

    def step(self, *, last: bool) -> None:
        """Step the world; impulses are recorded in the last step only."""
        self.world.contactListener = self.recorder if last else self.laws
        step = self.dt / self.units.time
        self.recorder.forget()
        self.world.Step(step, *self.iterations)
        self._check_speeds(step)

    def copy(self, history: History, row: int) -> None:
        """Copy the state."""
        length, velocity, time = self.units.length, self.units.velocity, self.units.time
        for i, body in enumerate(self.disks):
            history.x[row, i] = np.multiply(body.position, length)
            history.v[row, i] = np.multiply(body.linearVelocity, velocity)
            history.angle[row, i] = body.angle
            history.omega[row, i] = body.angularVelocity / time

    def impulses(self) -> dict[Pair, FloatArray]:
        """Those of the last step."""
        scale = self.units.mass * self.units.velocity
        return {pair: scale * impulse for pair, impulse in self.recorder.impulses.items()}

    def drive(self, k: int, here: FloatArray, there: FloatArray, facing: FloatArray, rate: float) -> None:
        """Set a wall's pose and its chord velocity over the coming step."""
        body = self.walls[k]
        body.transform = (_pair(here / self.units.length), _tilt(facing))
        body.linearVelocity = _pair((there - here) / self.dt / self.units.velocity)
        body.angularVelocity = rate * self.units.time

    def push(self, i: int, load: FloatArray) -> None:
        """Box2D forgets forces after a step."""
        units, body = self.units, self.disks[i]
        of_force = units.mass * units.velocity / units.time
        body.ApplyForce(_pair(load[:2] / of_force), body.worldCenter, True)
        body.ApplyTorque(float(load[5]) / (of_force * units.length), True)

    def _check_speeds(self, step: float) -> None:
        """Raise where Box2D has cut a velocity off, which it does in silence."""
        fastest = 0.999 * Box2D.b2_maxTranslation / step
        spinning = 0.999 * Box2D.b2_maxRotation / step
        for i, body in enumerate(self.disks):
            v = body.linearVelocity
            if math.hypot(v[0], v[1]) >= fastest:
                limit = Box2D.b2_maxTranslation * self.units.length / self.dt
                raise EngineError(
                    f"Box2D: disk {i} has reached {limit:g} m/s at step {self.done + 1}, the speed at which Box2D cuts "
                    "velocities off in these units; reduce dt"
                )
            if abs(body.angularVelocity) >= spinning:
                raise EngineError(
                    f"Box2D: disk {i} turns by a quarter turn in step {self.done + 1}, where Box2D cuts spins off; reduce dt"
                )

    def _disk(self, i: int) -> Any:
        disks, units = self.scene.disks, self.units
        place = _pair(disks.x[i] / units.length)
        if self.fixed[i]:
            body = self.world.CreateStaticBody(position=place, userData=i)
        else:
            # The world's flag alone does not keep bodies awake; one that sleeps reports no force.
            body = self.world.CreateDynamicBody(
                position=place, fixedRotation=not disks.rotating[i], userData=i, allowSleep=False
            )
        body.CreateFixture(
            shape=Box2D.b2CircleShape(radius=float(disks.radius[i]) / units.length + 0.5 * self.touch), density=0.0
        )
        if self.fixed[i]:
            return body
        body.massData = Box2D.b2MassData(
            mass=float(disks.mass[i]) / units.mass,
            I=float(disks.inertia[i]) / (units.mass * units.length**2),
            center=(0.0, 0.0),
        )
        body.linearVelocity = _pair(disks.v[i] / units.velocity)
        body.angularVelocity = float(disks.omega[i]) * units.time
        return body

    def _wall(self, k: int) -> Any:
        wall, reach = self.scene.walls[k], self.reach / self.units.length
        body = self.world.CreateKinematicBody(
            position=_pair(np.array(wall.point) / self.units.length),
            angle=_tilt(np.array(wall.normal)),
            userData=len(self.scene.disks) + k,
        )
        face = 0.5 * self.touch - Box2D.b2_polygonRadius if self.touch else 0.0
        corners = [(-reach, -reach), (reach, -reach), (reach, face), (-reach, face)]
        body.CreateFixture(shape=Box2D.b2PolygonShape(vertices=corners), density=0.0)
        return body


class _Laws(Box2D.b2ContactListener):  # type: ignore[misc]
    """Gives each contact the friction and restitution of its pair."""

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self.scene = scene

    def BeginContact(self, contact: Any) -> None:  # noqa: N802
        law: ContactLaw = self.scene.law(_bodies(contact)[0])
        contact.friction, contact.restitution = law.mu, law.restitution or 0.0


class _Recorder(_Laws):
    """Keeps the impulses of a step, in Box2D's units, on the first body of each pair."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.forget()

    def forget(self) -> None:
        """Begin a step."""
        self._normal: dict[Pair, FloatArray] = {}
        self._impulses: dict[Pair, FloatArray] = {}

    @property
    def impulses(self) -> Mapping[Pair, FloatArray]:
        """Impulse by pair, shape (2,)."""
        return self._impulses

    def PreSolve(self, contact: Any, _old: Any) -> None:  # noqa: N802
        # The solver uses the normal of the step's begin; once it is done, the contact has that of the end.
        manifold = contact.worldManifold  # a copy that owns its normal: it must live while that is read
        self._normal[_bodies(contact)[0]] = np.array(manifold.normal)

    def PostSolve(self, contact: Any, impulse: Any) -> None:  # noqa: N802
        pair, sign = _bodies(contact)
        n = self._normal[pair]
        along, across = impulse.normalImpulses[0], impulse.tangentImpulses[0]
        self._impulses[pair] = sign * (along * n + across * np.array([n[1], -n[0]]))


def _bodies(contact: Any) -> tuple[Pair, float]:
    """The pair, and the sign of the impulse on its first body; Box2D's acts on its second fixture's body."""
    one, two = contact.fixtureA.body.userData, contact.fixtureB.body.userData
    return ((one, two), -1.0) if one < two else ((two, one), 1.0)


def _tilt(normal: FloatArray) -> float:
    """Angle [rad] by which a wall that faces up is turned."""
    return signed_angle((0.0, 1.0), normal)


def _pair(vector: FloatArray) -> tuple[float, float]:
    return float(vector[0]), float(vector[1])
