"""One step: its contact problem under the theta scheme and in the static limit, and the search for the contacts that it needs.

`ninedisk.core.cd.batch` takes many dynamic steps at once, by the same kernels.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.contact_kernels import (
    FED,
    MISSED,
    NEARBY,
    Bodies,
    Frames,
    Loads,
    Start,
    carry_springs,
    closing_gaps,
    contact_compliances,
    dynamic_terms,
    note_impact_work,
    note_losses,
    pulls_of_step,
    start_step,
    step_displacements,
    surface_displacement,
)
from ninedisk.core.cd.contacts import ContactMemory, GrainFrames, Place, contact_frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.problem import ContactProblem, Sliding
from ninedisk.core.cd.problem_kernels import contact_forces_on_bodies, contact_velocities
from ninedisk.core.cd.solvers.coulomb import WARM_FROM
from ninedisk.core.cd.solvers.outcome import SolverResult
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.errors import InvalidSceneError, NoEquilibriumError, NonFiniteStateError, SolverNotConvergedError
from ninedisk.core.pose import PIVOT_VX, PIVOT_VY, PIVOT_X, PIVOT_Y, TURN_RATE
from ninedisk.core.scene import Scene

TOUCHING = 1e-9
"""Overlap over radius up to which a rigid contact counts as touching: the rounding of a scene's coordinates."""

LIKELY = 0.3
"""Gap at the end of the guess up to which a pair enters at once, over the root mean square displacement of the step: in flows nine steps
of ten miss no other pair, where without it they miss some in two to three solutions."""
WITH_MISSED = 2.0
"""Gap up to which pairs enter with those that a solution missed, over the largest overlap of these."""


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

    def pulls(self, frames: Frames) -> FloatArray:
        """Attraction of each contact beside the forces of the problem, shape (c,) [N]: see `pulls_of_step`."""
        ...

    def solve(self, frames: Frames, forces: FloatArray, start: FloatArray) -> Solved:
        """Solve with these contacts; ``forces`` are those of the last step, ``start`` a guess of the new ones, shape (c, 2)."""
        ...


def bodies_of(scene: Scene) -> Bodies:
    """The data of a scene's disks, with the load of gravity."""
    disks = scene.disks
    mass = np.column_stack([disks.mass, disks.mass, disks.inertia])
    inverse = np.where(disks.held.all(axis=1), 0.0, 1.0 / disks.mass)
    free = np.column_stack([~disks.held, disks.rotating])
    load = np.column_stack([disks.mass * scene.gravity[0], disks.mass * scene.gravity[1], np.zeros(len(disks))])
    return Bodies(mass, inverse, free, load, scene.xi)


def loads_of(scene: Scene) -> Loads:
    """A scene's gravity and its forces on single disks."""
    forces = scene.forces
    return Loads(
        steady=bodies_of(scene).load,
        disk=np.array([force.disk for force in forces], dtype=np.int64),
        force=np.array([(*force.force, force.torque) for force in forces]).reshape(len(forces), 3),
        begin=np.array([force.begin for force in forces]),
        end=np.array([force.end for force in forces]),
    )


def relative(frames: Frames, motion: FloatArray) -> FloatArray:
    """``H motion``: opening and tangential part, shape (c, 2), of velocities or displacements, shape (b, 3)."""
    u = np.empty((frames.size, 2))
    contact_velocities(frames.bodies, frames.normal, frames.arms, motion, u)
    return u


def pull_on_bodies(bodies: Bodies, frames: Frames, pull: FloatArray) -> FloatArray:
    """Load on the bodies, shape (b, 3) [N], [N], [N m], of contacts that attract by ``pull``, shape (c,) [N]."""
    load, r = np.empty(bodies.mass.shape), np.column_stack([-pull, np.zeros(len(pull))])
    contact_forces_on_bodies(frames.bodies, frames.normal, frames.arms, bodies.free.astype(np.float64), r, load)
    return load


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
    contact of disks alone never does, as its W has no coupling of normal and shear. The sum of the terms that are positive is in
    ``impact_gain`` of the history's energies and in the run's remarks: at least what E grows by, as others may lose at the same time.
    Walls that move add the work of their motion, which is counted as theirs.

    With friction and ``e > 0`` a step can have no solution where bodies are wedged, see `ninedisk.core.cd.laws.wedging_corners`.

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
        self._dt, self._theta = dt, theta
        self._round_off, self._resolution = round_off, round_off / (theta * dt)
        self._mass = dynamic_mass(bodies, dt, theta)
        self._start = Start(np.empty_like(v0), np.empty_like(v0), np.empty_like(v0))
        start_step(bodies, v0, dt, theta, self._start)

    def guess(self) -> FloatArray:
        """Displacements of the free flight."""
        return self._displacement(self._start.force / self._mass)

    def problem(self, frames: Frames, forces: FloatArray) -> ContactProblem:
        """The contact problem of the step, in velocities [m/s] and forces [N]."""
        offset, compliance = np.empty((frames.size, 2)), np.empty((frames.size, 2))
        inverse, begin = self._bodies.inverse, self._start
        dynamic_terms(
            frames, self._laws.arrays, inverse, begin, self._dt, self._theta, self._round_off, offset, compliance
        )
        force = self._start.force
        if self._laws.pulls:
            force = force + pull_on_bodies(self._bodies, frames, self.pulls(frames))
        return ContactProblem(
            mass=self._mass,
            force=force,
            bodies=frames.bodies,
            normal=frames.normal,
            arms=frames.arms,
            offset=offset,
            mu=self._laws.mu[frames.row],
            compliance=compliance,
            shear_0=forces[:, 1],
            resolution=self._resolution,
        )

    def solve(self, frames: Frames, forces: FloatArray, start: FloatArray) -> Solved:
        """Solve the step with these contacts; raises as `ContactSolver.solve`."""
        result = self._solver.solve(self.problem(frames, forces), start, at_rest=self._at_rest)
        return Solved(self._displacement(result.v), result.v + self._start.prescribed, result.r, result)

    def pulls(self, frames: Frames) -> FloatArray:
        """Attraction of each contact beside the forces of the problem, shape (c,) [N]: see `pulls_of_step`."""
        pull, laws = np.empty(frames.size), self._laws
        touching = MISSED * self._round_off
        pulls_of_step(frames, laws.arrays, laws.adhesion, self._bodies.inverse, self._dt, touching, pull)
        return pull

    def note_losses(
        self,
        frames: Frames,
        solved: Solved,
        steady: FloatArray,
        shear_0: FloatArray,
        spring: FloatArray,
        losses: FloatArray,
    ) -> None:
        """Add to ``losses`` by the kernel of this name; ``solved`` has the forces that act."""
        v = np.where(self._bodies.free, solved.v, 0.0)
        laws, begin = self._laws.arrays, self._start
        note_losses(
            frames, laws, self._bodies, steady, begin, v, solved.dx, solved.r, shear_0, spring, self._dt, self._theta, losses
        )  # fmt: skip

    def note_impacts(self, step: int, frames: Frames, solved: Solved, blocks: FloatArray, gains: FloatArray) -> None:
        """Add to ``gains`` the energy that impacts fed, by `note_impact_work`; ``blocks`` are the Delassus blocks, shape (c, 3)."""
        v = np.where(self._bodies.free, solved.v, 0.0)
        slack, resolution = FED * self._solver.options.tolerance, self._resolution * self._theta
        note_impact_work(
            step, slack, resolution, frames, blocks, self._laws.arrays, self._start, v, solved.r, self._dt, gains
        )

    def _displacement(self, v: FloatArray) -> FloatArray:
        dx = np.empty_like(v)
        step_displacements(self._bodies, self._start, v, self._dt, self._theta, dx)
        return dx


def carried_springs(
    frames: Frames, place: Place, solved: Solved, laws: LawTable, bodies: Bodies, dt: float
) -> tuple[FloatArray, FloatArray]:
    """Forces of the normal springs and shear forces with which the next step begins, shape (c,) each [N]: see `carry_springs`."""
    spring, shear, inverse = np.empty(frames.size), np.empty(frames.size), bodies.inverse
    before, after, dx = place.before, place.after, solved.dx
    carry_springs(frames, place.x, before, after, dx, laws.arrays, inverse, dt, solved.r, spring, shear)
    return spring, shear


def solve_with_contacts(
    step: Step,
    place: Place,
    finder: PairFinder,
    laws: LawTable,
    memory: ContactMemory,
    sliding: Sliding,
    margin: float = 0.0,
    start: ContactMemory | None = None,
    grains: GrainFrames | None = None,
) -> tuple[Frames, Solved]:
    """Solve a step on a set of contacts that grows until no pair outside it is violated.

    A pair enters if its gap at the end of the step, minus ``mu`` times its slip under the associated rule, is not
    positive: first for the motion without contacts, then for each solution, and a solution starts from the one before. Where contacts
    are many, rigid pairs that come near enter with them, as another solution costs more than some open contacts. The search covers every
    pair that the displacements found can bring that far, so the final solution violates no contact, listed or not. The gap is that along
    the normal at the start of the step: exact on disks and walls, or on the safe side; on outlines that turn by an angle a and have the
    radius of curvature rho it errs by ``rho a^2/2``.

    Parameters
    ----------
    step : Step
    place : Place
    finder : PairFinder
    laws : LawTable
    memory : ContactMemory
        Forces of the last step.
    sliding : {"associated", "coulomb"}
    margin : float
        Pairs with a gap up to this [m] enter at once.
    start : ContactMemory, optional
        Guess of the step's forces; None: those of the last step.
    grains : GrainFrames, optional
        Where bodies have outlines.

    Returns
    -------
    frames : Frames
        Contacts of the step.
    solved : Solved
    """
    tolerance = MISSED * place.round_off()
    dilation = laws.mu if sliding == "associated" else np.zeros_like(laws.mu)
    factor = 1.0 + float(dilation.max())
    walls = place.wall_displacement()

    def reach_of(dx: FloatArray) -> float:
        return factor * (2.0 * surface_displacement(dx, place.radius) + walls) + max(margin, 2.0 * tolerance)

    def near(reach: float) -> Frames:
        return frames_within(reach, place, finder, laws, grains)

    def closing(frames: Frames, dx: FloatArray) -> FloatArray:
        out = np.empty(frames.size)
        closing_gaps(frames, dilation, dx, out)
        return out

    dx = step.guess()
    reach = max(2.0 * reach_of(dx), NEARBY * float(place.radius.min()))
    frames = near(reach)
    gaps = closing(frames, dx)
    inside = gaps < max(margin, tolerance)
    start, springs, iterations = memory if start is None else start, memory.springs(), 0
    # Laws that do not care whether a contact that stays open is among those of the problem.
    indifferent = np.isnan(laws.restitution) & ~laws.elastic
    # Under Newton's law a contact is one only once its gap closes; one with a stretched shear spring would hold on by it (associated rule).
    stretched = laws.elastic[frames.row] & (_forces(springs, frames, grains)[:, 1] != 0.0)
    if laws.pulls:
        inside |= step.pulls(frames) > 0.0
    inside |= start.same(frames.pairs, start.pairs) & np.isnan(laws.restitution[frames.row]) & ~stretched
    if many := int(inside.sum()) > WARM_FROM:
        inside |= indifferent[frames.row] & (gaps < LIKELY * sqrt(float((dx[:, :2] ** 2).sum(axis=1).mean())))
    while True:
        chosen = frames.pick(inside)
        solved = step.solve(chosen, _forces(springs, chosen, grains), _forces(start, chosen, grains))
        start, iterations = memory.renewed(chosen.pairs, solved.r, chosen.place), iterations + solved.result.iterations
        needed = reach_of(solved.dx)
        if needed > reach:
            reach = 1.5 * needed
            frames = near(reach)
            inside = memory.same(frames.pairs, chosen.pairs) if grains is None else _is_among(frames, chosen)
        gaps = closing(frames, solved.dx)
        missed = ~inside & (gaps < -tolerance)
        if not missed.any():
            return chosen, solved._replace(result=replace(solved.result, iterations=iterations))
        if many:
            # The new contacts move others by about their depth.
            missed |= indifferent[frames.row] & (gaps < -WITH_MISSED * float(gaps[missed].min()))
        inside |= missed


def frames_within(reach: float, place: Place, finder: PairFinder, laws: LawTable, grains: GrainFrames | None) -> Frames:
    """Contacts with a gap below ``reach`` [m] at the end of the step if no body moved."""
    pairs = finder.within(place.x, place.after, reach)
    if grains is not None:
        return grains.frames(place, pairs, reach)
    return contact_frames(pairs, place, laws)


def _forces(memory: ContactMemory, frames: Frames, grains: GrainFrames | None) -> FloatArray:
    """Forces that a memory has for the contacts, shape (c, 2) [N]."""
    return memory.of(frames.pairs) if grains is None else grains.inherited(memory, frames)


def _is_among(frames: Frames, others: Frames) -> NDArray[np.bool_]:
    """Which contacts of a step are among others of the same step: outlines can meet in several places."""

    def names(some: Frames) -> list[tuple[float, ...]]:
        return [(*pair, *place) for pair, place in zip(some.pairs.tolist(), some.place.tolist(), strict=True)]

    known = set(names(others))
    return np.array([name in known for name in names(frames)], dtype=bool)


def initial_forces(
    scene: Scene, laws: LawTable, finder: PairFinder, place: Place, grains: GrainFrames | None, inverse: FloatArray
) -> ContactMemory:
    """Forces at time 0: elastic contacts by their overlap, its rate and the scene's shear forces, rigid ones by nothing.

    ``inverse``, shape (n,), are the inverse masses that dashpots see (`Bodies`), 0 where there are no rates.

    A shear force of a pair that touches at several places belongs to the deepest contact. More than ``mu`` times the normal force
    is cut off to that, as the DEM does it: a contact cannot hold it.

    Raises
    ------
    InvalidSceneError
        If rigid bodies overlap, centres coincide, or a shear force belongs to a contact that cannot hold one.
    """
    n, radius = len(scene.disks), scene.disks.radius
    reach = 1e-12 * float(radius.max())
    try:
        frames = frames_within(reach, place, finder, laws, grains)
    except NonFiniteStateError as error:
        raise InvalidSceneError(f"{error}; move one") from error
    pairs, elastic, depth = frames.pairs, laws.elastic[frames.row], np.maximum(0.0, -frames.gap)
    smaller = np.where(pairs[:, 1] < n, radius[np.minimum(pairs[:, 1], n - 1)], np.inf)
    bad = ~elastic & (depth > TOUCHING * np.minimum(radius[pairs[:, 0]], smaller))
    if bad.any():
        k = int(np.argmax(np.where(bad, depth, 0.0)))
        names = " and ".join(scene.body_name(int(body)) for body in pairs[k])
        raise InvalidSceneError(
            f"{names} overlap by {depth[k]:g} m and their contact is rigid: move them apart, or make it elastic "
            "(cd.contacts = elastic)"
        )
    spring = np.where(elastic, laws.kn[frames.row] * depth, 0.0)
    dashpots = initial_dashpots(scene, laws, place, frames, inverse)
    push = np.where(spring > 0.0, np.maximum(spring + dashpots, 0.0), spring)
    forces, pull = np.column_stack([push, np.zeros(len(pairs))]), None
    if laws.pulls:
        pull = np.where((spring > 0.0) & laws.viscous_pull[frames.row], np.maximum(-spring - dashpots, 0.0), 0.0)
    at = {(int(pairs[k, 0]), int(pairs[k, 1])): int(k) for k in np.argsort(depth, kind="stable")}
    for pair, shear in scene.initial_shear.items():
        if shear == 0.0:
            continue
        names = " and ".join(scene.body_name(body) for body in pair)
        k = at.get(pair, -1)
        if k < 0 or not elastic[k] or laws.mu[frames.row[k]] == 0.0:
            raise InvalidSceneError(
                f"the initial shear force {shear:g} N belongs to {names}, whose contact does not hold one (open, rigid or "
                "smooth): give it an overlap, elasticity, mu > 0 and ks > 0, or drop the entry"
            )
        most = laws.mu[frames.row[k]] * forces[k, 0]
        forces[k, 1] = min(max(shear, -most), most)
    return ContactMemory(scene.n_bodies, pairs, forces, frames.place, spring=spring, pull=pull)


def initial_dashpots(scene: Scene, laws: LawTable, place: Place, frames: Frames, inverse: FloatArray) -> FloatArray:
    """Forces of the dashpots at time 0, shape (c,) [N], positive where contacts close."""
    disks, i, j = scene.disks, *frames.pairs.T
    of_wall = j >= len(disks)
    inverse = inverse[i] + np.where(of_wall, 0.0, inverse[np.where(of_wall, 0, j)])
    beta, kn = np.where(inverse > 0.0, laws.beta[frames.row], 0.0), laws.kn[frames.row]
    opening = relative(frames, np.column_stack([disks.v, disks.omega]))[:, 0]
    for k in np.flatnonzero(of_wall):
        wall, inward = place.before[j[k] - len(disks)], -frames.normal[k]
        foot = place.x[i[k]] - ((place.x[i[k]] - wall[:2]) @ inward) * inward
        lever = foot - wall[[PIVOT_X, PIVOT_Y]]
        opening[k] -= (wall[[PIVOT_VX, PIVOT_VY]] + wall[TURN_RATE] * np.array([-lever[1], lever[0]])) @ inward
    return -2.0 * beta * np.sqrt(kn / np.where(inverse > 0.0, inverse, 1.0)) * opening


WEIGHT = 1e-3
"""Proximal stiffness over contact stiffness: small, so that a few iterations reach the limit, and large enough that displacements
follow from forces without loss of digits."""
BALANCE = 1e-10
"""Largest unbalanced force of an equilibrium, relative to the largest force: what the residual of the solver, 1e-12, leaves."""
MAX_ITERATIONS = 400


class StaticStep:
    """Series step without inertia: ``0 = f + H' r`` under the prescribed displacements.

    The mass matrix is dropped (``theta dt`` to infinity in the theta scheme). What remains can be singular: disks that no
    contact holds, modes without energy. It is solved by the proximal-point method: a small stiffness ``s M`` ties every disk to
    the last iterate, beginning with no displacement,

        s M (dx_k+1 - dx_k) = f + H' r_k+1,

    which tends to an equilibrium if there is one, and leaves the part of ``dx`` on which neither load nor contacts do work at
    zero: the displacement of least norm. Under a load that no contact forces balance, ``dx`` grows without bound.

    Parameters
    ----------
    bodies : Bodies
    laws : LawTable
    solver : ContactSolver
    prescribed : ndarray, shape (b, 3)
        Displacements of the unknowns that are not free [m], [m], [rad]; 0 elsewhere.
    radius : ndarray, shape (b,)
        Radii [m].
    length : float
        Displacement [m] that the walls prescribe, 0 if none.
    round_off : float
        Rounding error of a gap [m].

    Notes
    -----
    R. T. Rockafellar, "Monotone operators and the proximal point algorithm", SIAM J. Control Optim. 14 (1976) 877-898.
    """

    def __init__(
        self,
        bodies: Bodies,
        laws: LawTable,
        solver: ContactSolver,
        prescribed: FloatArray,
        radius: FloatArray,
        length: float,
        round_off: float,
    ) -> None:
        self._bodies, self._laws, self._solver = bodies, laws, solver
        self._prescribed, self._radius, self._round_off = prescribed, radius, round_off
        self._length = max(length, float(np.abs(prescribed[:, :2]).max())) or 1e-3 * float(radius.min())

    def guess(self) -> FloatArray:
        """Displacements that are prescribed; no disk moves by itself."""
        return self._prescribed

    def pulls(self, frames: Frames) -> FloatArray:
        """Attraction of each contact beside the forces of the problem, shape (c,) [N]: see `pulls_of_step`."""
        pull, laws = np.empty(frames.size), self._laws
        touching, still = MISSED * self._round_off, np.zeros(len(self._radius))
        pulls_of_step(frames, laws.arrays, laws.adhesion, still, 1.0, touching, pull)
        return pull

    def problem(self, frames: Frames, forces: FloatArray, mass: FloatArray, near: FloatArray) -> ContactProblem:
        """Proximal problem around the displacements ``near``, in displacements [m] and forces [N]."""
        free, compliance = self._bodies.free, np.empty((frames.size, 2))
        contact_compliances(frames.row, self._laws.arrays, 1.0, compliance)
        force = np.where(free, self._bodies.load + mass * near, 0.0)
        if self._laws.pulls:
            force += pull_on_bodies(self._bodies, frames, self.pulls(frames))
        return ContactProblem(
            mass=np.where(free, mass, np.inf),
            force=force,
            bodies=frames.bodies,
            normal=frames.normal,
            arms=frames.arms,
            offset=np.column_stack([frames.gap, frames.shift]) + relative(frames, self._prescribed),
            mu=self._laws.mu[frames.row],
            compliance=compliance,
            shear_0=forces[:, 1],
            resolution=self._round_off,
        )

    def solve(self, frames: Frames, forces: FloatArray, start: FloatArray) -> Solved:
        """Find the equilibrium.

        Raises
        ------
        NoEquilibriumError
            If the load drives a mechanism or exceeds what the contacts can bear, naming the disks that move.
        SolverNotConvergedError, InfeasibleContactsError
            As `ContactSolver.solve` does.
        """
        mass, elastic = self._proximal_mass(frames)
        arm = np.column_stack([np.ones((len(mass), 2)), 1.0 / self._radius])
        dx = np.zeros_like(mass)
        for _ in range(MAX_ITERATIONS):
            result = self._solver.solve(self.problem(frames, forces, mass, dx), start)
            unbalanced = np.where(self._bodies.free, mass * (result.v - dx), 0.0) * arm
            dx, start = result.v, result.r
            largest = max(float(np.abs(self._bodies.load * arm).max()), float(np.abs(start).max(initial=0.0)))
            if float(np.abs(unbalanced).max()) <= BALANCE * largest:
                total = dx + self._prescribed
                return Solved(total, np.zeros_like(total), result.r, result)
            displacement = np.hypot(dx[:, 0], dx[:, 1]) + np.abs(dx[:, 2]) * self._radius
            if (displacement > self._radius).any():
                raise NoEquilibriumError(_unbounded_motion(displacement, unbalanced, largest))
            if not elastic:
                mass = 0.5 * mass
        raise SolverNotConvergedError(
            f"the static step is not in balance after {MAX_ITERATIONS} iterations: unbalanced force "
            f"{float(np.abs(unbalanced).max()):.3g} N, largest force {largest:.3g} N; the contacts are close to their limit: "
            "reduce the load or the prescribed displacement, or give the contacts more friction",
            iterations=MAX_ITERATIONS,
        )

    def _proximal_mass(self, frames: Frames) -> tuple[FloatArray, bool]:
        mass = self._bodies.mass
        stiff = np.where(self._laws.elastic[frames.row], self._laws.kn[frames.row], 0.0)
        if (stiff > 0.0).any():
            return mass * (WEIGHT * float(stiff.max()) / float(mass[:, 0].max())), True
        force = float(np.abs(self._bodies.load[:, :2]).max()) or 1.0
        return mass * (force / self._length / float(mass[:, 0].max())), False


def _unbounded_motion(displacement: FloatArray, unbalanced: FloatArray, largest: float) -> str:
    order = np.argsort(-displacement)
    moving = [int(i) for i in order if displacement[i] > 0.5 * displacement[order[0]]]
    names = ", ".join(str(i) for i in moving[:8]) + (f" and {len(moving) - 8} more" if len(moving) > 8 else "")
    force = float(np.abs(unbalanced).max())
    return (
        f"there is no equilibrium near: the load moves disk(s) {names} by more than a radius and {force:.3g} N of at most "
        f"{largest:.3g} N stay unbalanced. Either a mechanism is free to follow the load, or friction and walls cannot bear it: "
        "hold or support these disks, reduce the load, or run with inertia (regime = dynamic)"
    )


def zero_energy_modes(problem: ContactProblem, r: FloatArray) -> int:
    """Number of independent displacements that strain no active contact: rattlers, gears, mechanisms without load.

    Parameters
    ----------
    problem : ContactProblem
    r : ndarray, shape (c, 2)
        Contact forces; a contact with ``p > 0`` holds its normal, one below the friction limit also its tangent.

    Returns
    -------
    int
        Rank deficiency of the active rows of the Jacobian on the free unknowns; a dense decomposition.
    """
    p, q = r[:, 0], np.abs(r[:, 1])
    bears = p > 1e-9 * float(p.max(initial=0.0))
    sticks = bears & (problem.mu > 0.0) & (q < problem.mu * p * (1.0 - 1e-9))
    rows = problem.jacobian().toarray()[np.column_stack([bears, sticks]).ravel()]
    free = problem.free.ravel() > 0.0
    if not len(rows):
        return int(free.sum())
    return int(free.sum()) - int(np.linalg.matrix_rank(rows[:, free]))
