"""Many dynamic steps at once, as long as nothing out of the ordinary happens in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.batch_kernels import (
    HELD,
    ITERATIONS,
    LISTS,
    MORE,
    PLAIN,
    REACH,
    STEP,
    SWEEPS,
    WALL_REACH,
    WORK,
    WORST_GAP,
    WORST_MAP,
    Chosen,
    Near,
    Scheme,
    Scratch,
    State,
    take_steps,
)
from ninedisk.core.cd.contact_kernels import Bodies, Loads, Start
from ninedisk.core.cd.contacts import ContactMemory, empty_frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.problem_kernels import SUMS, Contacts
from ninedisk.core.cd.solvers.coulomb import LOOSE, WARM_FROM
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.cd.step import dynamic_mass
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.scene.motion_kernels import WallMotion

SKIN = 0.1
"""Extra reach of the list of pairs over the smallest radius: it outlasts many steps, and adds hardly a pair in a packing."""
PAIR_STEPS = 20_000
"""Pairs times steps of one call: some ten milliseconds, so that progress and Ctrl-C come through."""
STRETCH = 1.5
"""Factor on changes of forces in long solutions to a loose tolerance: chains of contacts then take a third of the sweeps. From 1.8 on
Coulomb friction does not converge. At a tight tolerance the last digits would oscillate."""
LONGEST_REST = 64
"""Steps taken singly, at most, before the next attempt after several in a row that found a step out of the ordinary."""


class StepBatches:
    """Takes many dynamic steps in one call of a kernel and gives back those that need more.

    Parameters
    ----------
    bodies : Bodies
    loads : Loads
    laws : LawTable
    motion : WallMotion
    radius : ndarray, shape (n,)
        Radii [m].
    finder : PairFinder
    solver : ContactSolver
        Its rule, tolerance and number of sweeps hold here too.
    dt, theta : float
        Step [s] and parameter of the scheme.
    gains : ndarray, shape (6,)
        Energy that impacts feed, see `ninedisk.core.cd.contact_kernels.note_impact_work`; updated.
    losses : ndarray, shape (8,)
        Energy lost, see `ninedisk.core.cd.contact_kernels.note_losses`; updated where ``notes``.
    notes : bool

    Attributes
    ----------
    start : ContactMemory or None
        Forces reached in the step that has to be taken singly; None where it was not begun.
    iterations : int
        Sweeps of all steps taken.
    worst : (float, float)
        Largest natural-map residual and duality gap of the steps taken whose forces are more than round-off.
    """

    def __init__(
        self,
        bodies: Bodies,
        loads: Loads,
        laws: LawTable,
        motion: WallMotion,
        radius: FloatArray,
        finder: PairFinder,
        solver: ContactSolver,
        dt: float,
        theta: float,
        gains: FloatArray,
        losses: FloatArray,
        notes: bool,
    ) -> None:
        n, m = len(radius), len(motion.first) - 1
        self._laws, self._motion, self._finder, self._n = laws, motion, finder, n
        self._gains, self._losses = gains, losses
        self._scheme = Scheme(
            dt=dt,
            theta=theta,
            tolerance=solver.options.tolerance,
            sweeps=solver.sweeps,
            most=solver.most_contacts,
            relaxation=solver.options.relaxation,
            stretch=STRETCH if solver.options.tolerance >= LOOSE else 1.0,
            coulomb=solver.sliding == "coulomb",
            newton=laws.newton,
            notes=notes,
            holds_rest=solver.holds_rest,
            smallest=float(radius.min()),
            radius=radius,
            bodies=bodies,
            loads=loads,
            inverse_mass=1.0 / dynamic_mass(bodies, dt, theta),
            dilation=laws.mu if solver.sliding == "associated" else np.zeros_like(laws.mu),
        )
        self._short = self._scheme._replace(sweeps=solver.many_sweeps)
        force, kept, prescribed, v, dx = (np.empty((n, 3)) for _ in range(5))
        start = Start(force, kept, prescribed)
        self._scratch = Scratch(np.empty((m, 11)), start, v, dx, np.empty(SUMS), np.empty(6))
        self._counts, self._totals = np.zeros(6, dtype=np.int64), np.zeros(5)
        self._extend_lists(0)
        self._take_list(np.empty((0, 2), dtype=np.int64), np.zeros((n, 3)), np.zeros((m, 11)), np.full(2, -np.inf))
        self._rest, self._resting = 1, 0
        self.iterations, self.worst = 0, (0.0, 0.0)
        self.start: ContactMemory | None = None

    def advance(
        self, done: int, last: int, x: FloatArray, v: FloatArray, wall: FloatArray, memory: ContactMemory
    ) -> tuple[int, ContactMemory, float]:
        """Advance from step ``done`` to step ``last``, or as far as it goes.

        Parameters
        ----------
        done, last : int
        x, v : ndarray, shape (n, 3)
            Centres and angles, and their rates; updated.
        wall : ndarray, shape (m, 11)
            Walls; updated.
        memory : ContactMemory
            Forces of the last step.

        Returns
        -------
        done : int
            Last step taken. If it is the one given, the next has to be taken singly.
        memory : ContactMemory
        work : float
            Work of the walls on the disks in these steps [J].
        """
        self.start = None
        if self._resting:
            self._resting -= 1
            return done, memory, 0.0
        counts, totals = self._counts, self._totals
        self._remember(memory)
        many = counts[HELD] > WARM_FROM and self._short.sweeps < self._scheme.sweeps
        scheme = self._short if many else self._scheme
        counts[STEP], counts[ITERATIONS], counts[SWEEPS], counts[PLAIN] = done, 0, 0, 0
        totals[WORK], totals[WORST_MAP], totals[WORST_GAP] = 0.0, *self.worst
        listed_at = -1
        while True:
            target = min(last, done + max(1, PAIR_STEPS // (len(self._near.frames.pairs) + 1)))
            state = State(x, v, wall, *self._pair_memory(), counts, totals, self._gains, self._losses)
            laws, motion = self._laws.arrays, self._motion
            why = take_steps(target, scheme, laws, motion, state, self._near, self._chosen, self._scratch)
            if why == MORE:
                continue
            if why != LISTS or counts[STEP] == listed_at:
                break
            self._list(x, wall, totals[[REACH, WALL_REACH]])
            listed_at, counts[SWEEPS] = int(counts[STEP]), 0
        reached = int(counts[STEP])
        if reached == done:
            if counts[SWEEPS]:
                near = self._near
                inside = near.frames.pairs[near.inside]
                self.start = memory.renewed(inside, near.force[near.inside], np.zeros(inside.shape))
            if not many:  # a few sweeps are no loss: the solver goes on from their contacts and forces
                self._resting, self._rest = self._rest - 1, min(2 * self._rest, LONGEST_REST)
            return done, memory, 0.0
        self._rest = 1
        self.iterations += int(counts[ITERATIONS])
        self.worst = (float(totals[WORST_MAP]), float(totals[WORST_GAP]))
        held = int(counts[HELD])
        pairs, forces = self._pairs[:held].copy(), self._forces[:held].copy()
        spring, shear = self._spring[:held].copy(), self._shear[:held].copy()
        found = memory.renewed(pairs, forces, np.zeros((held, 2)), shear, spring)
        return reached, found, float(totals[WORK])

    def _remember(self, memory: ContactMemory) -> None:
        """Take over the forces of a step that was taken singly."""
        held = len(memory.pairs)
        if held > len(self._pairs):
            self._extend_lists(held)
        self._pairs[:held], self._forces[:held] = memory.pairs, memory.forces
        self._spring[:held], self._shear[:held] = memory.spring, memory.shear
        self._counts[HELD] = held

    def _list(self, x: FloatArray, wall: FloatArray, needed: FloatArray) -> None:
        """List the pairs for steps that need this reach between disks and to walls [m]."""
        reach = 1.5 * needed + SKIN * self._scheme.smallest
        pairs = self._finder.within(np.ascontiguousarray(x[:, :2]), wall, *reach.tolist())
        self._take_list(pairs, x, wall, reach)

    def _take_list(self, pairs: NDArray[np.int64], x: FloatArray, wall: FloatArray, reach: FloatArray) -> None:
        c = len(pairs)
        self._near = Near(
            x=x.copy(),
            wall=wall.copy(),
            reach=reach,
            frames=empty_frames(pairs, self._n, self._laws),
            closing=np.empty(c),
            inside=np.zeros(c, dtype=np.bool_),
            shear=np.empty(c),
            force=np.empty((c, 2)),
        )
        frames = empty_frames(pairs.copy(), self._n, self._laws)
        self._chosen = Chosen(
            frames=frames,
            contacts=Contacts(frames.bodies, frames.normal, frames.arms, mu=np.empty(c), compliance=np.empty((c, 2))),
            offset=np.empty((c, 2)),
            shear_0=np.empty(c),
            blocks=np.empty((c, 3)),
            rho=np.empty(c),
            b=np.empty((c, 2)),
            r=np.empty((c, 2)),
        )
        if c > len(self._pairs):
            held, kept = len(self._pairs), self._pair_memory()
            self._extend_lists(c)
            for mine, other in zip(self._pair_memory(), kept, strict=True):
                mine[:held] = other

    def _extend_lists(self, c: int) -> None:
        self._pairs, self._forces = np.empty((c, 2), dtype=np.int64), np.empty((c, 2))
        self._spring, self._shear = np.empty(c), np.empty(c)

    def _pair_memory(self) -> tuple[NDArray[np.int64], FloatArray, FloatArray, FloatArray]:
        """What the next step needs of the last one, by pair."""
        return self._pairs, self._forces, self._spring, self._shear
