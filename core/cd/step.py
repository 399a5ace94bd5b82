"""One step of the theta scheme as a contact problem."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contact_kernels import FED, carry_shear, contact_compliances, dynamic_offsets, note_impact_work
from ninedisk.core.cd.contacts import Frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.place import Place
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.problem_kernels import contact_velocities
from ninedisk.core.cd.result import SolverResult
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.scene import Scene

FloatArray = NDArray[np.float64]


class Bodies(NamedTuple):
    """What does not change from step to step; b disks.

    Attributes
    ----------
    mass : ndarray, shape (b, 3)
        Mass [kg], mass [kg], moment of inertia [kg m^2].
    free : ndarray of bool, shape (b, 3)
        False for unknowns whose motion is prescribed.
    load : ndarray, shape (b, 3)
        External force [N], force [N], torque [N m].
    xi : float
        Global damping [1/s].
    """

    mass: FloatArray
    free: NDArray[np.bool_]
    load: FloatArray
    xi: float


class Solved(NamedTuple):
    """Outcome of a step: displacements ``dx``, shape (b, 3); velocities ``v`` at its end, shape (b, 3); forces ``r``, (c, 2)."""

    dx: FloatArray
    v: FloatArray
    r: FloatArray
    result: SolverResult


class Step(Protocol):
    """A step that can be solved on any set of contacts."""

    def guess(self) -> FloatArray:
        """Displacements without contacts, shape (b, 3) [m], [m], [rad]."""
        ...

    def solve(self, frames: Frames, forces: FloatArray, start: FloatArray) -> Solved:
        """Solve with these contacts; ``forces`` are those of the last step, ``start`` a guess of the new ones, shape (c, 2)."""
        ...


def bodies_of(scene: Scene) -> Bodies:
    """The constant data of a scene's disks."""
    disks = scene.disks
    mass = np.column_stack([disks.mass, disks.mass, disks.inertia])
    free = np.column_stack([~disks.held, disks.rotating])
    load = np.column_stack([disks.mass * scene.gravity[0], disks.mass * scene.gravity[1], np.zeros(len(disks))])
    return Bodies(mass, free, load, scene.xi)


def pair_bodies(frames: Frames, n: int) -> NDArray[np.int32]:
    """Bodies of the contact problem: a wall is a prescribed body, -1."""
    return np.where(frames.pairs < n, frames.pairs, -1).astype(np.int32)


def relative(frames: Frames, motion: FloatArray) -> FloatArray:
    """``H motion``: opening and tangential part, shape (c, 2), of velocities or displacements, shape (b, 3)."""
    u = np.empty((len(frames), 2))
    contact_velocities(pair_bodies(frames, len(motion)), frames.normal, frames.arms, motion, u)
    return u


def compliances(frames: Frames, laws: LawTable, scale: float = 1.0) -> FloatArray:
    """Compliance ``(1/kn, 1/ks)/scale`` [m/N] of each contact, shape (c, 2); 0 where it is rigid or carries no shear force."""
    out = np.empty((len(frames), 2))
    contact_compliances(frames.row, laws.arrays, scale, out)
    return out


def dynamic_mass(bodies: Bodies, dt: float, theta: float) -> FloatArray:
    """``M (1/dt + theta xi)``, shape (b, 3) [kg/s], [kg/s], [kg m^2/s]: what the program of a dynamic step has for a mass; inf blocks."""
    return np.where(bodies.free, bodies.mass * (1.0 / dt + theta * bodies.xi), np.inf)


class DynamicStep:
    """Step of length ``dt`` from the velocities ``v0``.

    The unknowns are the velocities ``v1`` at the end of the step. With ``dx = dt (theta v1 + (1 - theta) v0)``::

        M (v1 - v0)/dt + xi M dx/dt = f + H' r

    and, for each contact, the opening displacement ``gap + H_n dx + p/kn`` and the slip ``shift + H_t dx + (q - q0)/ks``,
    both divided by ``theta dt``, are the contact velocity of the program: the scheme of the source's (A.1) with rotations,
    elasticity and damping. A rigid contact under Newton's law enters at the level of velocities instead, as in Moreau-Jean time
    stepping, with ``u_n + c`` and ``u_t`` at the end of the step: ``c = e u_n0`` for a contact that closes at its start
    (``u_n0 < 0``), and ``c = u_n0`` for one that opens.

    Notes
    -----
    Energy under Newton's law. From the momentum balance, with walls at rest, ``P = dt p`` and ``Q = dt q``, the kinetic energy T and
    ``s = v0 + v1``::

        Delta T = dt f.s/2 - xi dt/2 s.M (theta v1 + (1 - theta) v0) + sum over contacts of (P (u_n0 + u_n) + Q (u_t0 + u_t))/2

    The load's own work is ``f.dx = dt f.s/2 + (theta - 1/2) dt f.(v1 - v0)`` and the damping's is
    ``-xi dt/2 (s.M s/2 + (2 theta - 1) Delta T)``. So with ``kappa = (theta - 1/2) xi dt`` and V the potential of the load, linear in
    the positions, of ``E = (1 + kappa) T + V(x - (theta - 1/2) dt v)``::

        Delta E = sum of (P (u_n0 + u_n) + Q (u_t0 + u_t))/2 - xi dt/4 s.M s

    Without load E is T, but for the factor. Smooth contacts have ``P (u_n + c) = 0``. In Moreau's own form, ``c = e u_n0`` for all
    contacts, ``Delta E`` without load is ``-(1 - e)/(1 + e) P.W P/2`` for one and the same e; with unequal e, or under load, contacts
    that open at the start of the step and are closed by other impulses feed ``(1 - e) P u_n0/2 > 0`` each, and with
    ``c = e min(u_n0, 0)``, which stops them dead, ``P u_n0/2``. With the c above ``u_n0 + u_n`` is ``(1 - e) min(u_n0, 0)`` wherever
    ``P > 0``: no term is positive. E never grows, whatever the coefficients of the contacts, the load, the damping, dt and theta, gaps
    that are left at the start of an impact included, as the sum does not contain them; with e = 1 and xi = 0 it is kept to round-off.
    ``v1 = -v0`` satisfies all conditions of smooth contacts with walls at rest, so that they never contradict each other. A contact
    that opens can be pushed into an overlap of at most ``(2 theta - 1) dt u_n0``, and rebounds in the next step.

    Friction: ``P (u_n + c) + Q u_t <= 0`` by either sliding rule, hence a contact's term is at most ``Q u_t0/2``. That is positive only
    where friction acts along the slip of the step's start, because other impulses of the step turned it round (Kane's paradox); one
    contact of disks alone never does, as its W has no coupling of normal and shear. What is fed is in ``impact_gain`` of the history's
    energies and in the run's remarks. Walls that move add the work of their motion, which is counted as theirs.

    With friction and ``e > 0`` a step can have no solution where bodies are wedged, see `ninedisk.core.cd.wedges.wedging_corners`.

    Parameters
    ----------
    bodies : Bodies
    laws : LawTable
    solver : ContactSolver
    v0 : ndarray, shape (b, 3)
        Velocities at the start of the step [m/s], [m/s], [rad/s].
    dt, theta : float
        Step [s] and parameter of the scheme.
    round_off : float
        Rounding error of a gap [m].
    at_rest : bool
        Whether no body moves in the step's time by more than a gap's rounding, if ``v0`` lasts.
    """

    def __init__(
        self,
        bodies: Bodies,
        laws: LawTable,
        solver: ContactSolver,
        v0: FloatArray,
        dt: float,
        theta: float,
        round_off: float,
        at_rest: bool = False,
    ) -> None:
        self._bodies, self._laws, self._solver, self._at_rest = bodies, laws, solver, at_rest
        self._v0, self._dt, self._theta = v0, dt, theta
        self._round_off, self._resolution = round_off, round_off / (theta * dt)
        self._mass = dynamic_mass(bodies, dt, theta)
        kept = bodies.mass * v0 * (1.0 / dt - (1.0 - theta) * bodies.xi)
        self._force = np.where(bodies.free, bodies.load + kept, 0.0)
        self._prescribed = np.where(bodies.free, 0.0, v0)

    def guess(self) -> FloatArray:
        """Displacements of the free flight."""
        return self._displacement(self._force / self._mass)

    def problem(self, frames: Frames, forces: FloatArray) -> ContactProblem:
        """The contact problem of the step, in velocities [m/s] and forces [N]."""
        theta, dt, laws = self._theta, self._dt, self._laws
        bodies, offset = pair_bodies(frames, len(self._mass)), np.empty((len(frames), 2))
        geometry = (frames.normal, frames.gap, frames.gap_before, frames.shift, frames.arms, frames.row)
        kept = np.where(self._bodies.free, self._v0, 0.0)
        dynamic_offsets(bodies, *geometry, laws.arrays, kept, self._prescribed, dt, theta, self._round_off, offset)
        return ContactProblem(
            mass=self._mass,
            force=self._force,
            bodies=bodies,
            normal=frames.normal,
            arms=frames.arms,
            offset=offset,
            mu=laws.mu[frames.row],
            compliance=compliances(frames, laws, theta * dt),
            shear_0=forces[:, 1],
            resolution=self._resolution,
        )

    def solve(self, frames: Frames, forces: FloatArray, start: FloatArray) -> Solved:
        """Solve the step with these contacts; raises as `ContactSolver.solve`."""
        result = self._solver.solve(self.problem(frames, forces), start, at_rest=self._at_rest)
        return Solved(self._displacement(result.v), result.v + self._prescribed, result.r, result)

    def note_impacts(self, step: int, frames: Frames, solved: Solved, blocks: FloatArray, gains: FloatArray) -> None:
        """Add to ``gains`` the energy that impacts fed, by `note_impact_work`; ``blocks`` are the Delassus blocks, shape (c, 3)."""
        geometry = (frames.normal, frames.gap, frames.gap_before, frames.shift, frames.arms, frames.row)
        free, n = self._bodies.free, len(self._mass)
        kept, after = np.where(free, self._v0, 0.0), np.where(free, solved.v, 0.0)
        slack, resolution = FED * self._solver.options.tolerance, self._resolution * self._theta
        motion = (kept, self._prescribed, after)
        note_impact_work(
            step, slack, resolution, pair_bodies(frames, n), frames.pairs, *geometry, blocks, self._laws.arrays, *motion,
            solved.r, self._dt, gains,
        )  # fmt: skip

    def _displacement(self, v: FloatArray) -> FloatArray:
        theta = self._theta
        free = theta * v + (1.0 - theta) * self._v0
        return self._dt * np.where(self._bodies.free, free, self._prescribed)


def carried_shear(frames: Frames, place: Place, solved: Solved, laws: LawTable) -> FloatArray:
    """Shear forces with which the next step begins, shape (c,) [N]: see `carry_shear`."""
    shear, bodies = np.empty(len(frames)), pair_bodies(frames, len(solved.dx))
    geometry = (frames.normal, frames.gap_before, frames.shift, frames.arms)
    poses = (place.x, place.before, place.after)
    carry_shear(frames.pairs, bodies, frames.row, *poses, *geometry, solved.dx, laws.arrays, solved.r, shear)
    return shear
