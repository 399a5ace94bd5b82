"""A run of contact dynamics in space."""

from __future__ import annotations

import copy
import time
from collections import Counter
from collections.abc import Callable, Sequence
from math import sqrt

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.contact_kernels import MISSED
from ninedisk.core.cd.laws import ADVICE, LawTable, rebounds
from ninedisk.core.cd.problem_files import write_problem
from ninedisk.core.cd.settings import read_settings
from ninedisk.core.cd.solvers.by_matrix.cone import load_kernels
from ninedisk.core.cd.space.bodies import FreeStep, first_state, solid_of
from ninedisk.core.cd.space.contacts import ContactSearch, Place
from ninedisk.core.cd.space.recorder import Recorder
from ninedisk.core.cd.space.scope import TOUCHING, check_scene
from ninedisk.core.cd.space.step import ContactStep, Memory, Solved, impact_gain, solve_with_contacts
from ninedisk.core.cd.space.walls import WallPoses
from ninedisk.core.errors import (
    CoreError,
    InterruptedRunError,
    InvalidNumericsError,
    InvalidSceneError,
    NonFiniteStateError,
    SolverNotConvergedError,
    UnwritableFileError,
)
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics, check_memory, check_progress, chosen_particles, watched_pairs
from ninedisk.core.scene import SphereScene
from ninedisk.core.validate import kind_of

PROGRESS_EVERY = 0.1
"""Seconds between two reports of progress."""

TOLERANCE = 1e-8
"""Tolerance of a step where ``cd.tolerance`` is not given: forces of redundant contacts are known to hardly more digits."""

ACCEPT = 1e-6
"""``cd.accept`` where neither is given: forces of some steps of large heaps are not found to more digits, which the remarks report."""


class SpaceSession:
    """Contact dynamics on one scene of spheres, boxes and plane walls; all contacts are rigid.

    A copy (`copy.copy`, `copy.deepcopy`, `pickle`) is a separate session that goes on from the present state, to the same bits.

    Parameters
    ----------
    scene : SphereScene
    numerics : Numerics
        ``theta, impact, sliding`` and the options of `ninedisk.core.cd.settings` choose the method. ``cd.tolerance`` bounds the largest
        relative error of the forces of a step. If it is not given it is 1e-8, and up to 1e-6 is accepted (``cd.accept``) and reported.
    watch : sequence of pairs
        Contacts whose gap, ``fn``, ``fs`` and moment are recorded.
    particles : sequence of int or None
        Bodies whose motion is recorded; None: all.

    Attributes
    ----------
    dt : float
        Step [s].
    remarks : list of str
        What a reader of the results should know.
    solves : Counter
        Problems solved.
    iterations : int
        Iterations of all of them together.
    worst : float
        Largest relative error of the forces of any step.
    loose : list of (int, float)
        Steps whose forces miss the tolerance and were taken since ``cd.accept`` allows them, each with its error.

    Raises
    ------
    InvalidSceneError
        If the scene has no body, contacts overlap, or a law or load is not expressible.
    InvalidNumericsError
        If a setting is not allowed.

    Examples
    --------
    A box of 2 kg on the floor presses with its weight, 20 N:

    >>> law = ContactLaw(kn=1e6, regularised=True)
    >>> floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
    >>> box = Spheres(x=[[0.0, 0.0, 0.5]], mass=2.0, half_sizes=[[0.5, 0.5, 0.5]])
    >>> scene = SphereScene(spheres=box, sphere_sphere=law, walls=[floor], gravity=(0.0, 0.0, -10.0))
    >>> history = simulate(scene, Numerics(dt=0.01, n_steps=2), [(0, 1)], method="cd")
    >>> history.fn[1:, 0].round(9)
    array([20., 20.])
    """

    def __init__(
        self, scene: SphereScene, numerics: Numerics, watch: Sequence[Pair] = (), particles: Sequence[int] | None = None
    ) -> None:
        kind_of("scene", scene, SphereScene)
        kind_of("numerics", numerics, Numerics, error=InvalidNumericsError)
        given = {"cd.tolerance": TOLERANCE, "cd.accept": ACCEPT} if "cd.tolerance" not in numerics.options else {}
        numerics = numerics.replace(options=given | dict(numerics.options))
        self.settings = read_settings(numerics)
        check_scene(scene, numerics)
        pairs, chosen = watched_pairs(scene, watch), chosen_particles(scene, particles)
        check_memory(numerics, 3 * len(chosen), 2 * len(scene.walls), 3 * len(pairs))
        self.scene, self.numerics, self.dt = scene, numerics, numerics.dt
        self._options = self.settings.solver_options
        self._laws = LawTable(scene, numerics, self.settings.contacts)
        self._solid = solid_of(scene)
        self._search = ContactSearch(scene.spheres, self._laws)
        self._poses = WallPoses(scene.walls)
        self._walls = self._poses.at(0.0)
        self._state = first_state(scene, self._solid)
        self._check_overlaps()
        self._memory = Memory.empty()
        self._wall_work, self._impact_gain, self._done = 0.0, 0.0, 0
        self._stopped: CoreError | None = None
        self._contact_step: ContactStep | None = None
        self.remarks = [] if self._laws.newton else rebounds(scene, numerics, self._laws)
        self._remarked = False
        self.solves: Counter[str] = Counter()
        self.iterations, self.worst = 0, 0.0
        self.loose: list[tuple[int, float]] = []
        self._recorder = Recorder(scene, numerics, self._solid, self._search, pairs, chosen)
        self._sample(0)

    def run(self, progress: Callable[[int, int], None] | None = None) -> History:
        """Run to the last step: from time 0, or from where the last call stopped.

        Parameters
        ----------
        progress : callable, optional
            Called with (steps done, steps in all) a few times a second.

        Returns
        -------
        History

        Raises
        ------
        SolverNotConvergedError
            If a step's problem was not solved to its tolerance, nor to ``cd.accept``, with the figures and what to change.
        NonFiniteStateError
            If the state stops being finite.
        BehindWallError
            If the centre of a body gets behind a wall.
        InvalidSceneError
            If prescribed motions drive bodies into each other.
        InvalidNumericsError
            If a body turns too far in a step.
        InterruptedRunError
            If the last call was stopped inside a step.
        """
        check_progress(progress)
        steps, reported = self.numerics.n_steps, time.monotonic()
        for step in self._recorder.stops(steps):
            while self._done < step:
                self._take_step()
                if progress is not None and time.monotonic() - reported > PROGRESS_EVERY:
                    reported = time.monotonic()
                    progress(self._done, steps)
            if self._done == step:
                self._sample(step)
        if progress is not None:
            progress(steps, steps)
        if not self._remarked:
            self._remark()
            self._remarked = True
        return self._recorder.history

    def warm_up(self) -> None:
        """Compile or load the kernels on one step of a copy; this session's state stays as it is."""
        load_kernels()
        SpaceSession(self.scene, self.numerics.replace(n_steps=1, sample_every=1, sample_until=None)).run()

    def __copy__(self) -> SpaceSession:
        return copy.deepcopy(self)

    def _take_step(self) -> None:
        """Take one step; what stops it inside stops every further attempt."""
        if self._stopped is not None:
            raise self._stopped
        step = self._done + 1
        when = f"step {step} (t = {step * self.dt:g} s)"
        self._stopped = InterruptedRunError(
            f"the run was stopped inside a step after step {self._done}, whose state is lost: begin a new session"
        )
        try:
            self._advance(step)
        except SolverNotConvergedError as error:
            message = f"{when}: {str(error).removesuffix('.')}{self._wedged()}{self._keep_problem()}"
            self._stopped = SolverNotConvergedError(
                message, iterations=error.iterations, residuals=error.residuals, forces=error.forces
            )
            raise self._stopped from error
        except (InvalidSceneError, InvalidNumericsError, NonFiniteStateError) as error:
            self._stopped = type(error)(f"{when}: {error}")
            raise self._stopped from error
        except CoreError as error:
            self._stopped = error
            raise
        self._done, self._stopped = step, None

    def _advance(self, step: int) -> None:
        dt, theta = self.dt, self.numerics.theta
        where = self._place(self._poses.at(step * dt))
        round_off = self._search.round_off(where)
        self._check_resolution(round_off)
        free = FreeStep(self._solid, self._state, self._solid.load((step - 1) * dt, step * dt), dt, theta)
        if not np.isfinite(free.without).all():
            self._not_finite(free.without)
        contact_step = ContactStep(free, self._laws, self._options, self.numerics.sliding, dt, theta, round_off)
        self._contact_step = contact_step
        solved = solve_with_contacts(
            contact_step, free, self._search, where, self._laws, self._memory, self.numerics.sliding
        )
        self._note(step, solved, free, round_off)
        state = free.end(solved.velocity, solved.moment)
        if not (np.isfinite(state.x).all() and np.isfinite(state.quaternion).all()):
            self._not_finite(np.column_stack([state.x, state.quaternion]))
        self._check_walls(state.x, where.after, step)
        frames = solved.frames
        moved = np.column_stack([frames.gap - frames.gap_before, frames.shift])
        self._wall_work -= float(np.sum(solved.r * moved))
        self._state, self._walls, self._memory = state, where.after, Memory.of(frames, solved.r)

    def _note(self, step: int, solved: Solved, free: FreeStep, round_off: float) -> None:
        answer = solved.answer
        self.solves["cones"] += solved.solutions
        self.iterations += answer.iterations
        self.worst = max(self.worst, answer.error)
        if answer.error > self._options.tolerance:
            self.loose.append((step, answer.error))
        if self._laws.newton:
            resolution = round_off / self.dt
            self._impact_gain += impact_gain(solved, free, self._laws, self.dt, self._options.tolerance, resolution)

    def _sample(self, step: int) -> None:
        self._recorder.sample(step, self._state, self._walls, self._memory, self._wall_work, self._impact_gain)

    def _place(self, after: FloatArray) -> Place:
        return Place(self._state.x, self._state.quaternion, self._walls, after)

    def _check_overlaps(self) -> None:
        """Refuse contacts that overlap at time 0."""
        radius, n = self.scene.spheres.radius, len(self.scene.spheres)
        frames = self._search.within(self._place(self._walls), 0.0)
        i, j = frames.pairs.T
        smaller = np.minimum(radius[i], np.where(j < n, radius[np.minimum(j, n - 1)], np.inf))
        deep = np.where(-frames.gap > TOUCHING * smaller, -frames.gap, 0.0)
        if deep.any():
            k = int(np.argmax(deep))
            names = " and ".join(self.scene.body_name(int(body)) for body in frames.pairs[k])
            raise InvalidSceneError(f"{names} overlap by {deep[k]:g} m and their contact is rigid: move them apart")

    def _check_resolution(self, round_off: float) -> None:
        """Refuse steps in which the rounding of gaps makes larger velocities than gravity and forces do."""
        mass = self.scene.spheres.mass
        pull = max(
            [
                float(np.linalg.norm(self.scene.gravity)),
                *(float(np.linalg.norm(each.force) / mass[each.disk]) for each in self.scene.forces),
            ]
        )
        gap = MISSED * round_off
        if gap > pull * self.dt**2 and pull > 0.0:
            raise InvalidNumericsError(
                f"dt = {self.dt:g} s is not allowed where bodies or walls are so far from the origin that gaps are rounded by up to "
                f"{gap:.2g} m, which is {gap / self.dt:.2g} m/s in a step, and gravity and forces make {pull * self.dt:.2g} m/s; use dt >= "
                f"{1.1 * sqrt(gap / pull):.2g} s, or move the scene to the origin"
            )

    def _check_walls(self, x: FloatArray, walls: FloatArray, step: int) -> None:
        free = np.flatnonzero(~self.scene.spheres.held.all(axis=1))
        for w, wall in enumerate(walls):
            height = (x[free] - wall[0]) @ wall[1]
            if len(free) and not height.min() > 0.0:
                k = int(np.argmin(height))
                raise self.scene.behind_wall(
                    int(free[k]), w, float(height[k]), f"step {step} (t = {step * self.dt:g} s)", f"dt = {self.dt:g} s"
                )

    def _not_finite(self, values: FloatArray) -> None:
        body = int(np.argmin(np.isfinite(values).all(axis=1)))
        raise NonFiniteStateError(f"the displacement of {self.scene.body_name(body)} is no finite number")

    def _remark(self) -> None:
        if self.loose:
            at, worst = max(self.loose, key=lambda each: each[1])
            self.remarks.append(
                f"{len(self.loose)} of {self.numerics.n_steps} steps missed the tolerance {self._options.tolerance:g} and went on with the "
                f"best forces found, as cd.accept = {self._options.accept:g} allows: largest relative error {worst:.3g} (step {at})"
            )
        if self._impact_gain > 0.0:
            self.remarks.append(
                f"impacts under Newton's law with friction fed {self._impact_gain:.3g} J. Friction acts on the slip at the end of an "
                "impact, which other impulses can turn round (Kane's paradox): impact = 'theta' feeds none, nor do smooth contacts"
            )

    def _wedged(self) -> str:
        possible = self._laws.newton and bool((self._laws.restitution > 0.0).any() and (self._laws.mu > 0.0).any())
        return (
            f". Newton's restitution with friction can have no solution where bodies are wedged: {ADVICE}."
            if possible
            else "."
        )

    def _keep_problem(self) -> str:
        """Save the problem that failed, if the option asks for it; the sentence that says so."""
        problem = None if self._contact_step is None else self._contact_step.problem
        path = self.settings.save_failed
        if problem is None or not path:
            return " (the option cd.save_failed = FILE keeps the problem of a step that fails)"
        try:
            write_problem(path, problem, "npz")
        except UnwritableFileError as error:
            return f" The problem could not be kept: {error}."
        return f" The problem is in {path}: ninedisk.core.cd.problem_files.read_problem reads it."
