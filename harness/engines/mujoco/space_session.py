"""Spheres in space in MuJoCo: as disks of the plane, see `ninedisk.harness.engines.mujoco.session`, with three components.

- A sphere is a body on three slides and a ball joint; one that cannot turn has no ball joint, or, if it spins, an inertia that no torque
  can change. After each substep its orientation is undone, which a sphere does not show: spins are then those of the scene's axes.
- A plane that moves is a face of a box on such joints, of a mass and an inertia that nothing can change, and without weight; so is a sphere
  whose whole motion is prescribed. Bodies whose pose alone is prescribed (mocap) meet contacts as if they were at rest.
- Resistances to twisting and rolling of the model "constant" are MuJoCo's own, of a contact of four or six dimensions: all share one
  cone with the friction, and twisting has a coefficient of 1e-5 m at least where there is rolling.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from ninedisk.core.history import History
from ninedisk.core.validate import FloatArray
from ninedisk.harness.engines.mujoco.session import _BLOCKED, ENGINE_VERSION, MuJoCoSession, _name
from ninedisk.harness.engines.plane import finite_state, wall_reach
from ninedisk.harness.engines.space import (
    PlanePoses,
    driven_spheres,
    from_z,
    quaternion_of,
    rotation_of,
    twists,
    write_contacts,
    write_driven,
)

__all__ = ["ENGINE_VERSION", "MuJoCoSpaceSession"]

_UPRIGHT = (1.0, 0.0, 0.0, 0.0)

_PRESCRIBED = 1e8
"""Mass and inertia of a body whose motion is prescribed, in units of a sphere's: a step, at whose end it is put right, changes it by 1e-8
of what it changes a sphere. From 1e12 on MuJoCo's solver loses contact forces in the round-off of so large a body's energy."""


class MuJoCoSpaceSession(MuJoCoSession):
    """The `Session` of one run."""

    def __init__(self, scene: Any, numerics: Any, pairs: Any) -> None:
        self.poses, self.driven = PlanePoses(scene), driven_spheres(scene)
        self.reach = wall_reach(scene, numerics, "MuJoCo")
        self.boxes = [k for k, wall in enumerate(scene.walls) if wall.motion]
        super().__init__(scene, numerics, pairs)

    def begin(self) -> None:
        """The state of time 0."""
        spheres = self.scene.spheres
        turns = spheres.rotating | spheres.omega.any(axis=1)
        self.slides = {b: self._joint(b) for b in [*self.free, *(len(spheres) + k for k in self.boxes)]}
        self.turning = [i for i in self.free if turns[i]]
        self.angle = np.zeros_like(spheres.omega)
        self.turned: list[tuple[slice, FloatArray]] = []
        for i in self.free:
            _, dof = self.slides[i]
            self.data.qvel[dof : dof + 3] = spheres.v[i]
            if turns[i]:
                self.data.qvel[dof + 3 : dof + 6] = spheres.omega[i]
        self.quaternions = np.array([self.slides[i][0] + 3 + np.arange(4) for i in self.turning], dtype=int).reshape(
            -1, 4
        )
        self.spins = np.array([self.slides[i][1] + 3 + np.arange(3) for i in self.turning], dtype=int).reshape(-1, 3)

    def _joint(self, body: int) -> tuple[int, int]:
        """Where the positions and where the velocities of a body's joints begin."""
        first = self.model.body(_name(body)).jntadr[0]
        return int(self.model.jnt_qposadr[first]), int(self.model.jnt_dofadr[first])

    def advance(self, n_steps: int) -> None:
        """Step the model; impulses are summed over the substeps of the last step only."""
        model, data, step, h = self.model, self.data, mujoco.mj_step, self.h
        place, velocity, upright = data.qpos, data.qvel, np.tile(_UPRIGHT, (len(self.turning), 1))
        angle, turn = self.angle[self.turning], np.empty((len(self.turning), 3))
        for remaining in range(n_steps, 0, -1):
            self._prescribe()
            self.impulses.clear()
            for _ in range(self.substeps):
                step(model, data)
                for dofs, rotation in self.turned:  # the velocity of a point off the axis turns within the step
                    velocity[dofs] = rotation @ velocity[dofs]
                if self.turning:
                    velocity.take(self.spins, out=turn, mode="clip")
                    turn *= h
                    angle += turn
                    place[self.quaternions] = upright
                if remaining == 1:
                    self._add_impulses()
            self.done += 1
        self.angle[self.turning] = angle

    def _prescribe(self) -> None:
        """Put moving planes and spheres where they are, with the velocities of the coming step."""
        t = self.done * self.dt
        for i in self.driven:
            place, dof = self.slides[i]
            self.data.qpos[place : place + 3] = t * self.scene.spheres.v[i]
            self.data.qvel[dof : dof + 3] = self.scene.spheres.v[i]
        if not self.boxes:
            return
        here = self.poses(t)
        velocity, rate = twists(here, self.poses(t + self.dt), self.dt)
        self.turned.clear()
        for k in self.boxes:
            place, dof = self.slides[len(self.scene.spheres) + k]
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
        spheres = self.scene.spheres
        history.x[row], history.v[row], history.omega[row], history.angle[row] = spheres.x, 0.0, 0.0, self.angle
        for i in self.free:
            place, dof = self.slides[i]
            history.x[row, i] += self.data.qpos[place : place + 3]
            history.v[row, i] = self.data.qvel[dof : dof + 3]
        history.omega[row, self.turning] = self.data.qvel[self.spins]
        finite_state("MuJoCo", self.done, history.x[row], history.v[row], history.omega[row])
        self._check_warnings()
        pose = self.poses(self.done * self.dt)
        write_driven(self.scene, history, row, self.done * self.dt)
        write_contacts(self.scene, history, row, pose, self.summed(), self.dt)

    def still(self) -> list[bool]:
        """Which bodies and walls no contact can move."""
        return [kept or i in self.driven for i, kept in enumerate(super().still())]

    def friction(self, law: Any) -> tuple[int, list[float]]:
        """Dimension of a contact's forces and coefficients of both slips [-], of twisting and of both rollings [-], times the radius."""
        rolling, twisting = (0.0 if each is None else each.mu for each in (law.rolling, law.twisting))
        condim = 6 if rolling else 4 if twisting else 3 if law.mu else 1
        return condim, [law.mu, law.mu, twisting, rolling, rolling]

    def _add_pair(self, spec: Any, pair: tuple[int, int]) -> None:
        super()._add_pair(spec, pair)
        radii = self.scene.spheres.radius[[body for body in pair if body < len(self.scene.spheres)]]
        added = spec.pairs[-1]
        added.friction[2:] = added.friction[2:] / float((1.0 / radii).sum())

    def _add_disk(self, spec: Any, i: int) -> None:
        spheres = self.scene.spheres
        mass, radius = float(spheres.mass[i]), float(spheres.radius[i])
        sphere = {"name": _name(i), "type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [radius, 0.0, 0.0]}
        if self.fixed[i]:
            spec.worldbody.add_geom(pos=spheres.x[i], contype=0, conaffinity=0, **sphere)
            return
        driven = i in self.driven
        inertia = float(spheres.inertia[i]) if spheres.rotating[i] else _BLOCKED * mass * radius**2
        turns = bool(spheres.rotating[i]) or bool(spheres.omega[i].any())
        if driven:
            mass, inertia = _PRESCRIBED * mass, _PRESCRIBED * float(spheres.inertia[i])
        body = _body(spec, _name(i), spheres.x[i], mass, inertia, turns=turns, weightless=driven)
        body.add_geom(contype=0, conaffinity=0, **sphere)

    def _add_wall(self, spec: Any, k: int) -> None:
        wall, name = self.scene.walls[k], _name(len(self.scene.spheres) + k)
        facing = from_z(np.array(wall.normal))
        if k not in self.boxes:
            plane = mujoco.mjtGeom.mjGEOM_PLANE
            shape = {"type": plane, "pos": wall.point, "size": [0.0, 0.0, 1.0]}
            spec.worldbody.add_geom(name=name, quat=facing, contype=0, conaffinity=0, **shape)
            return
        mass = _PRESCRIBED * float(self.scene.spheres.mass.max(initial=1e-300))
        body = _body(spec, name, wall.point, mass, mass * self.reach**2, turns=True, weightless=True)
        box, middle = mujoco.mjtGeom.mjGEOM_BOX, -self.reach * np.array(wall.normal)
        body.add_geom(name=name, type=box, pos=middle, quat=facing, size=[self.reach] * 3, contype=0, conaffinity=0)


def _body(spec: Any, name: str, place: Any, mass: float, inertia: float, *, turns: bool, weightless: bool) -> Any:
    body = spec.worldbody.add_body(
        name=name,
        pos=place,
        mass=mass,
        inertia=[inertia] * 3,
        ipos=[0.0] * 3,
        explicitinertial=True,
        gravcomp=float(weightless),
    )
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    if turns:
        body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL)
    return body
