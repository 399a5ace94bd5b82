"""Bodies in space: what does not change in a run, their state, and their motion in a step without contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.space.rotations import applied, exponential, middle_of_step, product, turned_diagonal
from ninedisk.core.scene import BodyForce, SphereScene


class Solid(NamedTuple):
    """Data of n bodies that do not change.

    Attributes
    ----------
    mass : ndarray, shape (n,)
        [kg].
    moments : ndarray, shape (n, 3)
        Moments of inertia about the axes of the bodies [kg m^2].
    free : ndarray of bool, shape (n, 3)
        Components of the velocity that are not held.
    turning : ndarray of bool, shape (n,)
        Bodies whose spin is not prescribed.
    gyrating : ndarray of bool, shape (n,)
        Those of them whose moments of inertia are not the same about all axes.
    weight : ndarray, shape (n, 6)
        Force of gravity [N], and no torque.
    xi : float
        Global damping [1/s].
    forces : tuple of BodyForce
    """

    mass: FloatArray
    moments: FloatArray
    free: NDArray[np.bool_]
    turning: NDArray[np.bool_]
    gyrating: NDArray[np.bool_]
    weight: FloatArray
    xi: float
    forces: tuple[BodyForce, ...]

    def load(self, begin: float, end: float) -> FloatArray:
        """Mean force [N] and torque [N m] from ``begin`` to ``end`` [s], shape (n, 6): impulses are exact wherever a force ends."""
        load = self.weight.copy()
        for each in self.forces:
            share = max(0.0, min(end, each.end) - max(begin, each.begin)) / (end - begin)
            load[each.disk] += share * np.append(each.force, each.torque)
        return load

    def inertia(self, quaternion: FloatArray) -> FloatArray:
        """Inertia tensors in the axes of the scene, shape (n, 3, 3) [kg m^2]."""
        return turned_diagonal(quaternion, self.moments)

    def spin(self, quaternion: FloatArray, momentum: FloatArray) -> FloatArray:
        """Spins [rad/s] of angular momenta, shape (n, 3)."""
        spin = momentum / self.moments
        some = self.gyrating
        spin[some] = applied(turned_diagonal(quaternion[some], 1.0 / self.moments[some]), momentum[some])
        return spin


def solid_of(scene: SphereScene) -> Solid:
    """The bodies of a scene."""
    spheres = scene.spheres
    moments = np.broadcast_to(spheres.inertia.reshape(len(spheres), -1), (len(spheres), 3)).copy()
    unequal = np.any(moments != moments[:, :1], axis=1)
    weight = np.zeros((len(spheres), 6))
    weight[:, :3] = spheres.mass[:, None] * np.array(scene.gravity)
    return Solid(
        mass=spheres.mass,
        moments=moments,
        free=~spheres.held,
        turning=spheres.rotating,
        gyrating=unequal & spheres.rotating,
        weight=weight,
        xi=scene.xi,
        forces=scene.forces,
    )


@dataclass(frozen=True)
class State:
    """State of n bodies at a time.

    Attributes
    ----------
    x : ndarray, shape (n, 3)
        Centres [m].
    quaternion : ndarray, shape (n, 4)
        Rotations from the bodies' frames to the scene's.
    v, omega : ndarray, shape (n, 3)
        Velocities [m/s] and spins [rad/s] in the axes of the scene.
    momentum : ndarray, shape (n, 3)
        Angular momenta about the centres [kg m^2/s]: the spin follows from them.
    angle : ndarray, shape (n, 3)
        Integrals of the spins [rad].
    """

    x: FloatArray
    quaternion: FloatArray
    v: FloatArray
    omega: FloatArray
    momentum: FloatArray
    angle: FloatArray


def first_state(scene: SphereScene, solid: Solid) -> State:
    """The state at time 0."""
    spheres = scene.spheres
    momentum = applied(solid.inertia(spheres.quaternion), spheres.omega)
    return State(spheres.x, spheres.quaternion, spheres.v, spheres.omega, momentum, np.zeros_like(spheres.x))


class FreeStep:
    """A step of length ``dt`` by the theta scheme, without contacts, and what contact forces add to it.

    With ``dx = dt (theta v1 + (1 - theta) v0)``, and angular momenta L about the centres in the axes of the scene::

        m (v1 - v0)/dt + xi m dx/dt = f,    (L1 - L0)/dt + xi (theta L1 + (1 - theta) L0) = torque

    The body turns by ``dt w`` with ``w = I_m^-1 (theta L1 + (1 - theta) L0)``, ``I_m`` the inertia in the middle of the motion without
    contacts. Where there are none that is the implicit midpoint rule (`ninedisk.core.cd.space.rotations.middle_of_step`). Contact
    velocities are those of ``I_m^-1 L0`` and ``I_m^-1 L1``, so that the motion is linear in the forces. Forces change L by their moments
    exactly.

    Parameters
    ----------
    solid : Solid
    state : State
    load : ndarray, shape (n, 6)
        Mean force [N] and torque [N m].
    dt, theta : float

    Attributes
    ----------
    before, without : ndarray, shape (n, 6)
        Velocities [m/s] and spins [rad/s] at the start, and at the end without contacts.
    inverse : ndarray, shape (n, 6, 6)
        ``(M (1/dt + theta xi))^-1``, 0 where the motion is prescribed.
    movable : ndarray of bool, shape (n,)
        Bodies that forces can move.
    """

    def __init__(self, solid: Solid, state: State, load: FloatArray, dt: float, theta: float) -> None:
        self._solid, self._state, self._dt, self._theta = solid, state, dt, theta
        now, self._rate = 1.0 / dt - (1.0 - theta) * solid.xi, 1.0 / dt + theta * solid.xi
        v = np.where(solid.free, (load[:, :3] / solid.mass[:, None] + state.v * now) / self._rate, state.v)
        self._momentum = (load[:, 3:] + state.momentum * now) / self._rate
        self._tensor = np.zeros((len(v), 3, 3))
        self._tensor[:, range(3), range(3)] = 1.0 / solid.moments
        some = solid.gyrating
        if some.any():
            mean = theta * self._momentum[some] + (1.0 - theta) * state.momentum[some]
            middle = middle_of_step(state.quaternion[some], solid.moments[some], mean, dt)
            self._tensor[some] = turned_diagonal(middle, 1.0 / solid.moments[some])
        turning = solid.turning[:, None]
        spin_0 = np.where(turning, applied(self._tensor, state.momentum), state.omega)
        spin_1 = np.where(turning, applied(self._tensor, self._momentum), state.omega)
        self.before, self.without = np.column_stack([state.v, spin_0]), np.column_stack([v, spin_1])
        self.inverse = np.zeros((len(v), 6, 6))
        self.inverse[:, range(3), range(3)] = solid.free / solid.mass[:, None] / self._rate
        self.inverse[:, 3:, 3:] = np.where(turning[:, :, None], self._tensor, 0.0) / self._rate
        self.movable = solid.free.any(axis=1) | solid.turning

    def displacement(self, velocity: FloatArray) -> FloatArray:
        """Displacements [m] and turns [rad], shape (n, 6), of velocities at the end of the step."""
        return self._dt * (self._theta * velocity + (1.0 - self._theta) * self.before)

    def end(self, velocity: FloatArray, moment: FloatArray) -> State:
        """State at the end of the step.

        Parameters
        ----------
        velocity : ndarray, shape (n, 6)
            Velocities and spins at the end.
        moment : ndarray, shape (n, 3)
            Moments of the contact forces about the centres [N m].
        """
        solid, state = self._solid, self._state
        turned = self.displacement(velocity)[:, 3:]
        quaternion = product(exponential(turned), state.quaternion)
        momentum = np.where(solid.turning[:, None], self._momentum + moment / self._rate, 0.0)
        spin = np.where(solid.turning[:, None], solid.spin(quaternion, momentum), state.omega)
        x = state.x + self.displacement(velocity)[:, :3]
        return State(x, quaternion, velocity[:, :3], spin, momentum, state.angle + turned)
