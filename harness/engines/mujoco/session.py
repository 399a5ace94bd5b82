"""A scene in MuJoCo.

- A disk is a sphere on a body with three slides and a hinge about z, with the disk's mass and inertia; nothing pushes it
  away from z = 0. The third slide makes MuJoCo's estimate of a contact's inverse mass, a mean over three directions,
  exact. A disk that cannot turn has no hinge, or, if it spins, one with an inertia beyond the reach of any torque.
- A wall is an infinite plane of the world, a fixed disk a sphere of the world.
- Every pair of bodies is an explicit contact pair with the scene's own friction, and its ``solref`` in the form ``(-k,
  -b)``: the relative acceleration that MuJoCo asks for is ``-b v - k r``, per unit mass. Its own combination of two geoms'
  friction (the larger one) has no say.
- The oscillator: an elastic contact lasts ``contact_time`` steps, so that ``k = omega^2 = (pi/(contact_time dt))^2``. The
  damping is that of the linear spring and dashpot without tension with the restitution of the pair, at most ``1/h``, which
  ends an impact in one substep h and leaves ``(omega h)^2`` of its speed at most.
- The impedance d is the same at any overlap. The two force laws of a contact are, per unit mass and with the compliance
  ``R = (1 - d)/d``: ``a_n + (b/d) v_n + (k/d) r + R f_n = mu |w|`` and ``w = a_t + (b_t/d) v_t + (R/impratio) f_t``, w zero
  where it sticks. In steady sliding w is ``(b_t/d) v_t``: what it adds to the overlap is ``mu b_t v_t/k``. The contact stays
  closed while that is less than the load's own ``(1 - d) f_n/k``, so that ``b_t`` has to be small; a damper that is to end
  slip within substeps needs ``b_t/d`` of the order of ``1/h``: hence a small d.

In 3D:

- A sphere is a body on three slides and a ball joint; one that cannot turn has no ball joint, or, if it spins, an inertia that no torque
  can change. After each substep its orientation is undone, which a sphere does not show: spins are then those of the scene's axes.
- A wall that moves is a face of a box on such joints, of a mass and an inertia that nothing can change, and without weight; so is a sphere
  whose whole motion is prescribed. Bodies whose pose alone is prescribed (mocap) meet contacts as if they were at rest.
- A box is a geom of that shape, whose contacts have less damping each, see `MuJoCoSession.contacts_at_once`; its orientation is kept,
  and its spin turned from the body's frame to the scene's after each substep.
- Resistances to twisting and rolling of the model "constant" are MuJoCo's own, of a contact of four or six dimensions: all share one
  cone with the friction, and twisting has a coefficient of 1e-5 m at least where there is rolling.
"""

from __future__ import annotations

import math
from importlib.metadata import version
from itertools import combinations
from typing import Any

import mujoco
import numpy as np

from ninedisk.core.history import History, Pair
from ninedisk.core.law import SphereLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import read_options
from ninedisk.core.scene import ContactLaw
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.boxes import has_boxes, quaternion_product, rotation_matrix
from ninedisk.harness.api.engine import EngineError
from ninedisk.harness.api.knobs import given_knobs, recorded_knobs
from ninedisk.harness.engines.boxes import CORNERS, ContactSums
from ninedisk.harness.engines.lengths import wall_reach
from ninedisk.harness.engines.mujoco.adapter import KNOBS, OPTIONS
from ninedisk.harness.engines.world import (
    driven_spheres,
    finite_state,
    from_z,
    mean_loads,
    poses_of,
    quaternion_of,
    rotation_of,
    three_components,
    twists,
    write_contacts,
    write_driven,
)
from ninedisk.references.analytic.impact.spring_dashpot import beta_of_restitution

ENGINE_VERSION = version("mujoco")

CONES = {"elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC, "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL}

_BLOCKED = 1e15
"""Inertia of a disk that spins and cannot change its spin, in units of m R^2: what torques add is rounded away. From 1e16 on
the line search of MuJoCo's solver loses the forces in the round-off of so large a body's energy."""

_UPRIGHT = (1.0, 0.0, 0.0, 0.0)

_PRESCRIBED = 1e8
"""Mass and inertia of a body whose motion is prescribed, in units of a sphere's: a step, at whose end it is put right, changes it by 1e-8
of what it changes a sphere. From 1e12 on MuJoCo's solver loses contact forces in the round-off of so large a body's energy."""


class MuJoCoSession:
    """The `Session` of one run."""

    poses: Any
    """What gives the walls' poses at a time."""

    def __init__(self, scene: Any, numerics: Numerics, pairs: tuple[Pair, ...]) -> None:  # noqa: ARG002
        self.options = read_options("mujoco", OPTIONS, numerics)
        self.scene, self.dt, self.done, self.size = scene, numerics.dt, 0, scene.dimension
        self.poses, bodies = poses_of(scene), scene.bodies
        self.driven = driven_spheres(scene) if self.size == 3 else []
        self.boxes = [k for k, wall in enumerate(scene.walls) if wall.motion]
        self.reach = wall_reach(scene, numerics, "MuJoCo") if self.size == 3 else 0.0
        self.fixed = bodies.fixed
        self.free = np.flatnonzero(~self.fixed).tolist()
        self.substeps = self.options["mujoco.substeps"]
        self.h = self.dt / self.substeps
        self.omega = math.pi / (self.options["mujoco.contact_time"] * self.dt)
        impedance = self.options["mujoco.impedance"]
        self.slip_damping = impedance * self.options["mujoco.slip_damping"] / self.h
        self.stock = self.options["mujoco.profile"] == "stock"
        self.given = given_knobs("mujoco", KNOBS, numerics) if self.stock else {}
        self.options["mujoco.cone"] = self.given.get("cone", self.options["mujoco.cone"])
        pyramid = self.options["mujoco.cone"] == "pyramidal"
        # MuJoCo's ratio of the impedances of friction and of the normal is that of the edges' here, which are both.
        impratio = 1.0 if pyramid else (1.0 - impedance) / impedance / self.options["mujoco.slip_compliance"]
        self.settings: dict[str, Any] = {
            **self.options,
            "mujoco.timestep": self.h,
            "mujoco.integrator": "Euler",
            "mujoco.solver": "Newton",
            "mujoco.impratio": impratio,
            "mujoco.solref": {name: self._solref(law) for name, law in _laws(scene)},
            "mujoco.solreffriction": [0.0, -self.slip_damping],
            "mujoco.solimp": [impedance, impedance],
            "mujoco.margin": 0.0,
            "mujoco.pair_friction": "the scene's own, explicit contact pairs",
        }
        if self.stock:
            impratio = self.given.get("impratio", 1.0)
            self.settings = {
                "mujoco.profile": "stock",
                "mujoco.timestep": self.h,
                **{f"mujoco.{name}": self.options[f"mujoco.{name}"] for name in ("cone", "tolerance", "iterations")},
                "mujoco.solref, solimp, margin, gap, impratio, integrator, solver": "MuJoCo's own",
                "mujoco.pair_friction": "the scene's own, explicit contact pairs",
                **recorded_knobs("mujoco", self.given),
            }
        self.model = self._model(impratio)
        self.data = mujoco.MjData(self.model)
        self.impulses: dict[Pair, list[float]] = {}
        self.sums = ContactSums(scene)
        self.wrench = np.zeros(6)
        self.number = {
            mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, _name(k)): k for k in range(scene.n_bodies)
        }
        self.initialise()

    def initialise(self) -> None:
        """The state of time 0."""
        bodies = self.scene.bodies
        turns = bodies.rotating | (bodies.omega != 0.0).reshape(len(bodies), -1).any(axis=1)
        moving = [*self.free, *(len(bodies) + k for k in self.boxes)]
        self.joints = {b: self._joint(b) for b in moving}
        self.turning = [i for i in self.free if turns[i]]
        self.solids = [i for i in self.turning if has_boxes(self.scene) and bodies.boxes[i]]
        self.body_ids = [self.model.body(_name(i)).id if i in self.joints else 0 for i in range(len(bodies))]
        self.angle = np.zeros_like(bodies.omega)
        self.turned: list[tuple[slice, FloatArray]] = []
        for i in self.free:
            dof, omega = self.joints[i][1], np.atleast_1d(bodies.omega[i])
            self.data.qvel[dof : dof + self.size] = bodies.v[i]
            if i in self.solids:  # a ball joint keeps the spin in the body's frame; a sphere's is that of the scene
                omega = rotation_matrix(bodies.quaternion[i]).T @ omega
            if turns[i]:
                self.data.qvel[dof + 3 : dof + 3 + len(omega)] = omega
        places, dofs = (np.array([self.joints[i][k] + 3 for i in self.turning], dtype=int) for k in (0, 1))
        self.quaternions, self.spins = places[:, None] + np.arange(4), dofs[:, None] + np.arange(3)
        self.hinges = dofs

    def _joint(self, body: int) -> tuple[int, int]:
        """Where the positions and where the velocities of a body's joints begin."""
        first = self.model.body(_name(body)).jntadr[0]
        return int(self.model.jnt_qposadr[first]), int(self.model.jnt_dofadr[first])

    def warm_up(self) -> None:
        """Nothing: MuJoCo is native code and its model is compiled in the set-up."""

    def advance(self, n_steps: int) -> None:
        """Step the model; impulses are summed over the substeps of the last step only."""
        if self.size == 3:
            self._advance_3d(n_steps)
            return
        if self.scene.forces:
            for ahead in range(n_steps - 1):
                self._push(self.done + ahead)
                mujoco.mj_step(self.model, self.data, nstep=self.substeps)
            self._push(self.done + n_steps - 1)
        elif n_steps > 1:
            mujoco.mj_step(self.model, self.data, nstep=(n_steps - 1) * self.substeps)
        self.impulses.clear()
        for _ in range(self.substeps):
            mujoco.mj_step(self.model, self.data)
            self._add_impulses()
        self.done += n_steps

    def _advance_3d(self, n_steps: int) -> None:
        """Step the model; impulses are summed over the substeps of the last step only."""
        model, data, step, h = self.model, self.data, mujoco.mj_step, self.h
        round_ones = [k for k, i in enumerate(self.turning) if i not in self.solids]
        quaternions = self.quaternions[round_ones]
        place, velocity, upright = data.qpos, data.qvel, np.tile(_UPRIGHT, (len(round_ones), 1))
        solids = [(k, i) for k, i in enumerate(self.turning) if i in self.solids]
        angle, turn = self.angle[self.turning], np.empty((len(self.turning), 3))
        for remaining in range(n_steps, 0, -1):
            self._prescribe()
            if self.scene.forces:
                self._push(self.done)
            self.impulses.clear()
            self.sums = ContactSums(self.scene)
            for _ in range(self.substeps):
                step(model, data)
                for dofs, rotation in self.turned:  # the velocity of a point off the axis turns within the step
                    velocity[dofs] = rotation @ velocity[dofs]
                if self.turning:
                    velocity.take(self.spins, out=turn, mode="clip")
                    for k, i in solids:
                        turn[k] = rotation_matrix(self._quaternion(i)) @ turn[k]
                    turn *= h
                    angle += turn
                    place[quaternions] = upright
                if remaining == 1:
                    self._add_impulses()
            self.done += 1
        self.angle[self.turning] = angle

    def _quaternion(self, i: int) -> FloatArray:
        """Orientation of a body now; a joint's is relative to the one that the model was made with."""
        start = np.array(self.scene.spheres.quaternion[i])
        if i not in self.solids:
            return start
        place = self.joints[i][0] + 3
        return quaternion_product(start, np.array(self.data.qpos[place : place + 4]))

    def _prescribe(self) -> None:
        """Put moving walls and spheres where they are, with the velocities of the coming step."""
        t = self.done * self.dt
        for i in self.driven:
            place, dof = self.joints[i]
            self.data.qpos[place : place + 3] = t * self.scene.spheres.v[i]
            self.data.qvel[dof : dof + 3] = self.scene.spheres.v[i]
        if not self.boxes:
            return
        here = self.poses(t)
        velocity, rate = twists(here, self.poses(t + self.dt), self.dt)
        self.turned.clear()
        for k in self.boxes:
            place, dof = self.joints[len(self.scene.spheres) + k]
            self.data.qpos[place : place + 3] = here.point[k] - self.scene.walls[k].point
            self.data.qpos[place + 3 : place + 7] = quaternion_of(here.rotation[k])
            self.data.qvel[dof : dof + 3] = velocity[k]
            self.data.qvel[dof + 3 : dof + 6] = (
                here.rotation[k].T @ rate[k]
            )  # a ball joint's spin is in the body's frame
            if rate[k].any() and velocity[k].any():
                self.turned.append((slice(dof, dof + 3), rotation_of(self.h * rate[k])))

    def observe(self, history: History, row: int) -> None:
        """Copy the state, and the contact impulses of the last step as forces."""
        bodies, size, position, velocity = self.scene.bodies, self.size, self.data.qpos, self.data.qvel
        history.x[row], history.v[row], history.omega[row], history.angle[row] = bodies.x, 0.0, 0.0, self.angle
        for i in self.free:
            place, dof = self.joints[i]
            history.x[row, i] += position[place : place + size]
            history.v[row, i] = velocity[dof : dof + size]
        if size == 3:
            history.omega[row, self.turning] = velocity[self.spins]
            if history.quaternion is not None:
                for i in range(len(bodies)):
                    history.quaternion[row, i] = self._quaternion(i)
                for i in self.solids:
                    history.omega[row, i] = rotation_matrix(history.quaternion[row, i]) @ history.omega[row, i]
        else:  # all joints are scalar, so that one index serves positions and velocities
            history.omega[row, self.turning] = velocity[self.hinges]
            history.angle[row, self.turning] = position[self.hinges]
        finite_state("MuJoCo", self.done, history.x[row], history.v[row], history.omega[row])
        self._check_warnings()
        if self.driven:
            write_driven(self.scene, history, row, self.done * self.dt)
        pose, impulses = self.poses(self.done * self.dt), self.summed_impulses()
        write_contacts(self.scene, history, row, pose, impulses, self.dt, self.sums.moments)

    def summed_impulses(self) -> dict[Pair, FloatArray] | None:
        """Impulses of the last step; None before the first."""
        if self.sums.moments is not None:
            return self.sums.impulses if self.done else None
        return {pair: np.array(total) for pair, total in self.impulses.items()} if self.done else None

    def _push(self, step: int) -> None:
        """Forces and torques of the step that begins at ``step``; they last until they are set anew."""
        loads = mean_loads(self.scene, step * self.dt, (step + 1) * self.dt)
        for i in self.free:
            self.data.xfrc_applied[self.body_ids[i]] = loads[i]

    def _add_impulses(self) -> None:
        """Add what the contacts of a substep exert: numbers, as arrays of two or three take ten times as long."""
        data, size, wrench = self.data, self.size, self.wrench
        count = data.ncon
        if not count:
            return
        contact = data.contact
        frames, force = contact.frame.reshape(count, 3, 3), wrench[:3]
        for c, (first, second) in enumerate(contact.geom.tolist()):
            mujoco.mj_contactForce(self.model, data, c, wrench)
            # Rows of the frame are normal and tangents; the force acts on the second geom.
            impulse = (force @ frames[c]).tolist()
            one, two = self.number[first], self.number[second]
            if self.sums.moments is not None:  # bodies are where the contacts were found until the next substep
                self.sums.add(two, one, self.h * np.array(impulse), contact.pos[c], self._centres())
                continue
            pair, sign = ((one, two), -self.h) if one < two else ((two, one), self.h)
            total = self.impulses.get(pair)
            if total is None:
                total = self.impulses[pair] = [0.0] * size
            for k in range(size):
                total[k] += sign * impulse[k]

    def _centres(self) -> FloatArray:
        """Centres of all bodies where the contacts of the last substep were found [m]."""
        centres = np.array(self.scene.spheres.x)
        centres[self.free] = self.data.xpos[[self.body_ids[i] for i in self.free]]
        return centres

    def _check_warnings(self) -> None:
        """Raise where MuJoCo has warned: a full buffer or a bad state is no result."""
        for name, warning in mujoco.mjtWarning.__members__.items():
            if name.startswith("mjWARN_") and self.data.warning[int(warning)].number:
                raise EngineError(f"MuJoCo warned of {name} by step {self.done}; reduce dt")

    def contacts_at_once(self, pair: Pair) -> tuple[float, float]:
        """By how much the contacts of a pair together respond more than one at the centres, to normal forces and to friction.

        1 for spheres. At a low impedance the dampers of a box's contacts act side by side, each with its full part of the velocity: each
        has that much less damping, or a substep would reverse the velocity.
        """
        bodies = self.scene.bodies
        solid = [i for i in pair if i < len(bodies) and bodies.boxes[i]] if has_boxes(self.scene) else []
        if not solid:
            return 1.0, 1.0
        found = np.max([face_response(bodies.half_sizes[i], bodies.inertia[i] / bodies.mass[i]) for i in solid], axis=0)
        normal, shear = found * (1.0 if len(solid) == 1 else 2.0)  # two faces have up to eight common corners
        return float(normal), float(shear)

    def _solref(self, law: ContactLaw | SphereLaw, at_once: float = 1.0) -> list[float]:
        """Stiffness [1/s^2] and damping [1/s] of a contact's oscillator, negative as MuJoCo wants them."""
        restitution, damping = law.restitution or 0.0, 1.0 / (self.h * at_once)
        if restitution > 0.0:
            damping = min(2.0 * beta_of_restitution(restitution) * self.omega, damping)
        return [-(self.omega**2), -damping]

    def _model(self, impratio: float) -> Any:
        spec = mujoco.MjSpec()
        option, options = spec.option, self.options
        option.timestep = self.h
        option.gravity = three_components(self.scene.gravity)
        option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        option.cone = CONES[options["mujoco.cone"]]
        option.impratio = impratio
        option.tolerance = options["mujoco.tolerance"]
        option.iterations = options["mujoco.iterations"]
        option.noslip_iterations = self.given.get("noslip_iterations", 0)
        # A state that is no longer finite must be seen; MuJoCo would begin again from the initial one.
        option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        spec.compiler.boundmass = spec.compiler.boundinertia = 0.0
        n = len(self.scene.bodies)
        for i in range(n):
            self._add_disk(spec, i)
        for k in range(len(self.scene.walls)):
            self._add_wall(spec, k)
        still = self.immovable_bodies()
        for one, two in combinations(range(self.scene.n_bodies), 2):
            if one < n and not (still[one] and still[two]):
                self._add_pair(spec, (one, two))
        try:
            model = spec.compile()
        except ValueError as error:
            raise EngineError(f"MuJoCo refused the scene: {error}") from error
        if (
            not self.stock
        ):  # scale of the solver's tolerance; MuJoCo's own would count the inertias of blocked rotations
            model.stat.meaninertia = float(self.scene.bodies.mass.mean()) if n else 1.0
        return model

    def immovable_bodies(self) -> list[bool]:
        """Which bodies and walls no contact can move: two of them have none."""
        bodies = (kept or i in self.driven for i, kept in enumerate(self.fixed.tolist()))
        return [*bodies, *(True for _ in self.scene.walls)]

    def _add_disk(self, spec: Any, i: int) -> None:
        bodies = self.scene.bodies
        mass, radius, place = float(bodies.mass[i]), float(bodies.radius[i]), three_components(bodies.x[i])
        shape = {"name": _name(i), "type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [radius, 0.0, 0.0]}
        turn: Any = _UPRIGHT
        if self.size == 3:
            turn = bodies.quaternion[i].tolist()
            if bodies.boxes[i]:
                shape |= {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": bodies.half_sizes[i].tolist()}
        if self.fixed[i]:
            spec.worldbody.add_geom(pos=place, quat=turn, contype=0, conaffinity=0, **shape)
            return
        driven, turns = i in self.driven, bool(bodies.rotating[i]) or bool(np.any(bodies.omega[i]))
        inertia = np.full(3, bodies.inertia[i]) if bodies.rotating[i] else np.full(3, _BLOCKED * mass * radius**2)
        if driven:  # the same about all axes: it keeps its spin
            mass, inertia = _PRESCRIBED * mass, np.full(3, _PRESCRIBED * float(np.max(bodies.inertia[i])))
        body = self._body(spec, _name(i), place, mass, inertia, turns=turns, weightless=driven, turn=turn)
        body.add_geom(contype=0, conaffinity=0, **shape)

    def _add_wall(self, spec: Any, k: int) -> None:
        wall, name, half = self.scene.walls[k], _name(len(self.scene.bodies) + k), math.sqrt(0.5)
        # In 2D a quarter turn about z x n takes the plane's own normal, z, to n.
        flat = [half, -half * wall.normal[1], half * wall.normal[0], 0.0]
        facing = flat if self.size == 2 else from_z(np.array(wall.normal))
        if k not in self.boxes:
            plane = mujoco.mjtGeom.mjGEOM_PLANE
            shape = {"type": plane, "pos": three_components(wall.point), "size": [0.0, 0.0, 1.0]}
            spec.worldbody.add_geom(name=name, quat=facing, contype=0, conaffinity=0, **shape)
            return
        mass = _PRESCRIBED * float(self.scene.bodies.mass.max(initial=1e-300))
        inertia = np.full(3, mass * self.reach**2)
        body = self._body(spec, name, wall.point, mass, inertia, turns=True, weightless=True)
        box, middle = mujoco.mjtGeom.mjGEOM_BOX, -self.reach * np.array(wall.normal)
        body.add_geom(name=name, type=box, pos=middle, quat=facing, size=[self.reach] * 3, contype=0, conaffinity=0)

    def _body(
        self,
        spec: Any,
        name: str,
        place: Any,
        mass: float,
        inertia: FloatArray,
        *,
        turns: bool,
        weightless: bool,
        turn: Any = _UPRIGHT,
    ) -> Any:
        """A body on three slides and, where it turns, a hinge about z or in 3D a ball joint."""
        body = spec.worldbody.add_body(
            name=name,
            pos=place,
            quat=turn,
            mass=mass,
            inertia=inertia.tolist(),
            ipos=[0.0] * 3,
            explicitinertial=True,
            gravcomp=float(weightless),
        )
        for axis in rotation_matrix(
            np.array(turn)
        ):  # of a joint in the body's frame: its rows there are the axes of the scene
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        if turns and self.size == 2:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
        elif turns:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL)
        return body

    def friction(self, law: Any, pair: Pair) -> tuple[int, list[float]]:
        """Dimension of a contact's forces and coefficients of both slips [-], of twisting and of both rollings [m]."""
        if self.size == 2:
            return 3 if law.mu > 0.0 else 1, [law.mu, law.mu, 0.0, 0.0, 0.0]
        rolling, twisting = (0.0 if each is None else each.mu for each in (law.rolling, law.twisting))
        radii = self.scene.spheres.radius[[body for body in pair if body < len(self.scene.spheres)]]
        per_length = float((1.0 / radii).sum())
        resistances = [each / per_length for each in (twisting, rolling, rolling)]
        return 6 if rolling else 4 if twisting else 3 if law.mu else 1, [law.mu, law.mu, *resistances]

    def _softness(self) -> dict[str, Any]:
        """What a stock run changes of MuJoCo's own solref and solimp."""
        changed: dict[str, Any] = {}
        if "solref_time" in self.given:
            changed["solref"] = [self.given["solref_time"], 1.0]
        if "impedance" in self.given:
            least = self.given["impedance"]
            changed["solimp"] = [least, max(least, 0.95), 0.001, 0.5, 2.0]
        return changed

    def _add_pair(self, spec: Any, pair: Pair) -> None:
        law, impedance = self.scene.law(pair), self.options["mujoco.impedance"]
        condim, friction = self.friction(law, pair)
        if self.stock:
            names = {"geomname1": _name(pair[0]), "geomname2": _name(pair[1])}
            spec.add_pair(**names, condim=condim, friction=friction, **self._softness())
            return
        normal, shear = self.contacts_at_once(pair)
        spec.add_pair(
            geomname1=_name(pair[0]),
            geomname2=_name(pair[1]),
            condim=condim,
            friction=friction,
            solref=self._solref(law, normal),
            solreffriction=[0.0, -self.slip_damping / shear],
            solimp=[impedance, impedance, 1.0, 0.5, 2.0],
            margin=0.0,
            gap=0.0,
        )


def face_response(half: FloatArray, inertia: FloatArray) -> tuple[float, float]:
    """Largest response of a box to forces at the four corners of a face, over that of its centre: to normal forces, and to friction.

    Parameters
    ----------
    half : array, shape (3,)
        Half the edges [m].
    inertia : array, shape (3,)
        Moments of inertia over the mass [m^2].
    """
    largest = [1.0, 1.0]
    for face in range(3):
        corners = half * CORNERS[CORNERS[:, face] < 0.0]
        for k, directions in enumerate((np.eye(3)[[face]], np.delete(np.eye(3), face, axis=0))):
            rows = np.array([[*d, *(np.cross(corner, d) / np.sqrt(inertia))] for corner in corners for d in directions])
            largest[k] = max(largest[k], float(np.linalg.eigvalsh(rows @ rows.T)[-1]))
    return largest[0], largest[1]


def _name(body: int) -> str:
    return f"body {body}"


def _laws(scene: Any) -> list[tuple[str, Any]]:
    return [
        (f"{scene.noun}-{scene.noun}", scene.law_of_bodies),
        *((f"wall {wall.name}", wall.law) for wall in scene.walls),
        *((f"{one} and {two}", law) for (one, two), law in scene.laws.items()),
    ]
