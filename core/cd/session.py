"""A contact-dynamics run in progress, and the recorder of its samples."""

from __future__ import annotations

import copy
import json
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import sqrt
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.batch import StepBatches
from ninedisk.core.cd.contact_kernels import (
    DAMPING,
    DASHPOT,
    FORCE_WORK,
    FRICTION,
    GAIN_I,
    GAIN_J,
    GAIN_LARGEST,
    GAIN_STEP,
    GAIN_STEPS,
    GAIN_TOTAL,
    HELD_WORK,
    IMPACT,
    MISSED,
    ROUND_OFF,
    SCHEME,
    STORED,
    Frames,
    place_loads,
    surface_displacement,
)
from ninedisk.core.cd.contacts import ContactMemory, GrainFrames, Place
from ninedisk.core.cd.laws import ADVICE, LawTable, rebounds, wedging_corners
from ninedisk.core.cd.origin import about, origin_near
from ninedisk.core.cd.problem_kernels import UNRESOLVED
from ninedisk.core.cd.settings import read_settings
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError
from ninedisk.core.cd.solvers.outcome import SolverResult
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.cd.step import (
    DynamicStep,
    Solved,
    StaticStep,
    Step,
    bodies_of,
    carried_springs,
    initial_forces,
    loads_of,
    solve_with_contacts,
    zero_energy_modes,
)
from ninedisk.core.dem.neighbours import PairFinder
from ninedisk.core.errors import (
    CoreError,
    InterruptedRunError,
    InvalidNumericsError,
    InvalidSceneError,
    NoEquilibriumError,
    NonFiniteStateError,
    SolverNotConvergedError,
    UnwritableFileError,
)
from ninedisk.core.history import History, Pair
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics, check_memory, check_progress, check_run, chosen_particles, watched_pairs
from ninedisk.core.scene import Disks, Scene, Wall
from ninedisk.core.scene.motion import compile_motion, wall_poses

NEAR = 1e-3
"""Gap over radius of the pairs that a static step considers at once."""
MODES_UP_TO = 300
"""Number of disks up to which modes without energy are counted."""
PROGRESS_EVERY = 0.1
"""Seconds between two reports of progress."""


ENERGIES = (
    "translation",
    "rotation",
    "kinetic",
    "elastic_normal",
    "elastic_shear",
    "elastic",
    "gravity",
    "wall_work",
    "impact_gain",
)
"""Energies that are always sampled."""

BUDGET = {
    "friction_loss": FRICTION,
    "impact_loss": IMPACT,
    "dashpot_loss": DASHPOT,
    "damping_loss": DAMPING,
    "scheme_loss": SCHEME,
    "force_work": FORCE_WORK,
    "held_work": HELD_WORK,
}
"""Energies that are sampled with `Numerics.energy_budget`, and where they are in the losses of `note_losses`. Kinetic, elastic and
gravity's energy and all losses together grow by the works, to round-off."""

LACKS = ("a periodic cell", "Hertz' law", "rolling resistance")
"""What scenes may ask for and contact dynamics lacks (`check_run`)."""


class CdSession:
    """Contact dynamics on one scene.

    A copy (`copy.copy`, `copy.deepcopy`, `pickle`) is a separate session that goes on from the present state, to the same bits.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
        ``theta, impact, sliding, regime, solver`` and the options of `ninedisk.core.cd.settings` choose the method.
    watch : sequence of pairs
        Contacts whose gap, ``fn`` and ``fs`` are recorded.
    particles : sequence of int or None
        Disks whose motion is recorded; None: all.

    Attributes
    ----------
    dt : float
        Step [s]: ``numerics.dt``; ``numerics.contact_dt`` where that is given and all contacts are elastic.
    remarks : list of str
        What a reader of the results should know: corners that can contradict each other, and what `run` finds.
    solves : Counter
        Problems solved by each method.
    iterations : int
        Iterations of all of them together.
    worst : (float, float)
        Largest natural-map residual and duality gap of all steps whose forces are more than round-off.
    loose : list of (int, float)
        Steps whose forces miss the tolerance and were taken since ``cd.accept`` allows them, each with the larger one of its natural
        map and duality gap.

    Raises
    ------
    InvalidSceneError
        If the scene has no disk, rigid contacts overlap or carry an initial shear force, or a law cannot be expressed.
    InvalidNumericsError
        If a setting is not allowed, or steps are too short for the rounding of coordinates far from each other.
    """

    def __init__(
        self, scene: Scene, numerics: Numerics, watch: Sequence[Pair] = (), particles: Sequence[int] | None = None
    ) -> None:
        check_run(scene, numerics, "contact dynamics", LACKS)
        pairs, chosen = watched_pairs(scene, watch), chosen_particles(scene, particles)
        check_memory(numerics, len(chosen), len(scene.walls), len(pairs))
        if numerics.energy_budget and numerics.regime == "quasi-static":
            raise InvalidNumericsError(
                "energy_budget = True is not allowed with regime = 'quasi-static': a series of equilibria has no balance of energy; "
                "leave it out, or run with inertia (regime = 'dynamic')"
            )
        self.scene, self.numerics = scene, numerics
        self.settings = read_settings(numerics)
        self._origin = origin_near(scene)
        scene, walls_back = about(scene, self._origin)
        disks, n = scene.disks, len(scene.disks)
        self._laws = LawTable(scene, numerics, self.settings.contacts)
        self.dt, self.substeps = self._own_step()
        self._bodies, self._loads = bodies_of(scene), loads_of(scene)
        self._solver = ContactSolver(numerics.solver, self.settings.solver_options, numerics.sliding)
        self._finder = PairFinder(disks.radius, len(scene.walls), disks.fixed)
        self._motion = compile_motion(scene.walls)
        self._wall = wall_poses(self._motion, 0.0)
        self._x = np.column_stack([disks.x, np.zeros(n)])
        self._v = np.column_stack([disks.v, disks.omega])
        self._wall_work = 0.0
        self._gains, self._losses = np.zeros(6), np.zeros(8)
        self._notes = numerics.energy_budget
        self._step: Step | None = None
        self._done, self._remarked = 0, False
        self._stopped: CoreError | None = None
        self.remarks = wedging_corners(scene, numerics) if self._laws.newton else rebounds(scene, numerics, self._laws)
        self.solves: Counter[str] = Counter()
        self.iterations, self.worst = 0, (0.0, 0.0)
        self.loose: list[tuple[int, float]] = []
        self._grains = self._grain_frames()
        self._check_resolution()
        seen = 0.0 if numerics.regime == "quasi-static" else self._bodies.inverse
        place = self._place(self._wall)
        self._memory = initial_forces(scene, self._laws, self._finder, place, self._grains, seen * np.ones(n))
        self._batches = self._batches_if_dynamic()
        self._recorder = Recorder(
            self.scene, numerics, self._laws, pairs, chosen, self._grains, self._origin, walls_back
        )
        self._recorder.sample(0, self._x, self._v, self._wall, self._memory, self._totals())
        self._losses[STORED] = self._recorder.history.energy["elastic"][0]

    def run(self, progress: Callable[[int, int], None] | None = None) -> History:
        """Run to the last step: from time 0, or from where the last call stopped, because the callback raised something for instance.

        A session that has reached its last step gives the same history again; one that failed fails again.

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
        NoEquilibriumError
            If a static step has no solution.
        InvalidSceneError
            If rigid contacts contradict each other.
        NonFiniteStateError
            If the state stops being finite.
        BehindWallError
            If the centre of a disk gets behind a wall.
        InvalidNumericsError
            If bodies get so far away that steps are too short for the rounding of their coordinates.
        InterruptedRunError
            If the last call was stopped inside a step.
        """
        check_progress(progress)
        steps, reported = self.numerics.n_steps, time.monotonic()
        for step in self._recorder.stops(steps):
            while self._done < step * self.substeps:
                self._take_steps(step * self.substeps)
                if progress is not None and time.monotonic() - reported > PROGRESS_EVERY:
                    reported = time.monotonic()
                    progress(self._done // self.substeps, steps)
            if self._done == step * self.substeps:
                self._recorder.sample(step, self._x, self._v, self._wall, self._memory, self._totals())
        if progress is not None:
            progress(steps, steps)
        if not self._remarked:
            self._remark()
            self._remarked = True
        return self._recorder.history

    def _totals(self) -> dict[str, float]:
        """Energies that were fed and lost since time 0 [J]."""
        totals = {"wall_work": self._wall_work, "impact_gain": float(self._gains[GAIN_TOTAL])}
        if self._notes:
            totals |= {name: float(self._losses[k]) for name, k in BUDGET.items()}
        return totals

    def __copy__(self) -> CdSession:
        return copy.deepcopy(self)

    def _take_steps(self, last: int) -> None:
        """Take steps up to step ``last``, at least one; what stops it inside a step stops every further attempt."""
        if self._stopped is not None:
            raise self._stopped
        self._stopped = InterruptedRunError(
            f"the run was stopped inside a step after step {self._done // self.substeps}, whose state is lost: begin a new session"
        )
        try:
            self._done = self._advance_to(last, self._done)
            self._check_resolution()
        except CoreError as error:
            self._stopped = error
            raise
        self._stopped = None

    def warm_up(self) -> None:
        """Compile or load the kernels on one step of a copy; this session's state stays as it is."""
        once = self.numerics.replace(n_steps=1, sample_every=1, sample_until=None)
        if self.numerics.solver in ("auto", "interior-point") and self.numerics.sliding == "coulomb":
            # One disk that slides on a floor needs all of them; a step's time limit would have to do for loading them.
            floor = Wall(
                name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=ContactLaw(kn=1.0, mu=0.1, regularised=True)
            )
            disk = Disks(x=np.array([[0.0, 1.0]]), v=np.array([[1.0, 0.0]]), radius=np.ones(1), mass=np.ones(1))
            sliding = Scene(disks=disk, walls=(floor,), disk_disk=floor.law, gravity=(0.0, -1.0))
            plain = Numerics(dt=1e-3, n_steps=1, sample_every=1, sliding="coulomb", solver="interior-point")
            CdSession(sliding, plain).run()
        CdSession(self.scene, once).run()
        if self.numerics.solver in ("auto", "interior-point") and self.numerics.sliding == "associated":
            CdSession(self.scene, once.replace(solver="interior-point")).run()

    def _advance_to(self, last: int, done: int) -> int:
        """Take steps after step ``done``, at least one and none beyond ``last``; the number of the last one taken."""
        if self._batches is not None:
            sweeps = self._batches.iterations
            reached, self._memory, work = self._batches.advance(done, last, self._x, self._v, self._wall, self._memory)
            self._wall_work += work
            if reached > done:
                self.solves["gauss-seidel"] += reached - done
                self.iterations += self._batches.iterations - sweeps
                self.worst = (max(self.worst[0], self._batches.worst[0]), max(self.worst[1], self._batches.worst[1]))
                return reached
        step = done // self.substeps + 1
        try:
            self._advance(done + 1)
        except InfeasibleContactsError as error:
            self._contradiction(step, error)
        except NonFiniteStateError as error:
            raise NonFiniteStateError(f"step {step} (t = {step * self.numerics.dt:g} s): {error}") from error
        except (SolverNotConvergedError, NoEquilibriumError) as error:
            said = str(error).removesuffix(".") + (self._wedged() or ".")
            message = f"step {step} (t = {step * self.numerics.dt:g} s): {said}{self._keep_problem(step)}"
            if isinstance(error, SolverNotConvergedError):
                raise SolverNotConvergedError(
                    message, iterations=error.iterations, residuals=error.residuals
                ) from error
            raise NoEquilibriumError(message) from error
        return done + 1

    def _advance(self, step: int) -> None:
        dt, radius = self.dt, self.scene.disks.radius
        after = wall_poses(self._motion, step * dt)
        place = self._place(after)
        static = self.numerics.regime == "quasi-static"
        place_loads(self._loads, (step - 1) * dt, step * dt, static, self._bodies.load)
        self._step = self._static_step(place) if static else self._dynamic_step(place)
        margin = NEAR * float(radius.min()) if static else 0.0
        start = None if self._batches is None else self._batches.start
        frames, solved = solve_with_contacts(
            self._step,
            place,
            self._finder,
            self._laws,
            self._memory,
            self.numerics.sliding,
            margin,
            start,
            self._grains,
        )
        self._note(step, solved.result)
        pull = self._step.pulls(frames) if self._laws.pulls else None
        multipliers = solved.r
        if pull is not None:
            solved = solved._replace(r=multipliers - np.column_stack([pull, np.zeros(len(pull))]))
        if isinstance(self._step, DynamicStep) and self._laws.newton and self._solver.problem is not None:
            self._step.note_impacts(step, frames, solved, self._solver.problem.blocks, self._gains)
        if not np.isfinite(solved.dx).all():
            raise NonFiniteStateError(
                f"the displacement of disk {int(np.argmin(np.isfinite(solved.dx).all(axis=1)))} is no finite number"
            )
        self._check_walls(self._x + solved.dx, after, step)
        self._wall_work += self._work_of_walls(frames, solved)
        rate = np.inf if static else dt  # the static limit has no rates
        spring, shear = carried_springs(frames, place, solved._replace(r=multipliers), self._laws, self._bodies, rate)
        if self._notes and isinstance(self._step, DynamicStep) and self._solver.problem is not None:
            shear_0 = self._solver.problem.shear_0
            self._step.note_losses(frames, solved, self._loads.steady, shear_0, spring, self._losses)
        self._x = self._x + solved.dx
        self._v = solved.dx / dt if static else solved.v
        self._memory = self._memory.renewed(frames.pairs, multipliers, frames.place, shear, spring, pull)
        self._wall = after
        self._frames = frames

    def _check_walls(self, x: FloatArray, wall: FloatArray, step: int) -> None:
        free = np.flatnonzero(~self.scene.disks.held.all(axis=1))
        if not (len(free) and len(wall)):
            return
        height = x[free, :2] @ wall[:, 2:4].T - np.sum(wall[:, 0:2] * wall[:, 2:4], axis=1)
        if not height.min() > 0.0:
            k, w = np.unravel_index(int(np.argmin(height)), height.shape)
            raise self.scene.behind_wall(
                int(free[k]),
                int(w),
                float(height[k, w]),
                f"step {step} (t = {step * self.dt:g} s)",
                f"dt = {self.dt:g} s",
            )

    def _check_resolution(self) -> None:
        """Refuse steps in which the rounding of gaps makes larger velocities than gravity and forces do."""
        disks, forces = self.scene.disks, self.scene.forces
        pull = max(
            [float(np.hypot(*self.scene.gravity)), *(np.linalg.norm(f.force) / disks.mass[f.disk] for f in forces)]
        )
        place = self._place(self._wall)
        gap = MISSED * place.round_off()
        if self.numerics.regime == "quasi-static" or gap <= pull * self.dt**2 or pull == 0.0:
            return
        raise InvalidNumericsError(
            f"dt = {self.dt:g} s is not allowed where bodies or walls are {gap / (MISSED * ROUND_OFF):.3g} m from where the run began: "
            f"gaps are rounded by up to {gap:.2g} m, which is {gap / self.dt:.2g} m/s in a step, and gravity and forces make "
            f"{pull * self.dt:.2g} m/s; use dt >= {1.1 * sqrt(gap / pull):.2g} s, or place bodies nearer to each other"
        )

    def _place(self, after: FloatArray) -> Place:
        """Where bodies are in a step at whose end the walls are as given."""
        disks = self.scene.disks
        return Place(self._x[:, :2].copy(), disks.angle + self._x[:, 2], disks.radius, self._wall, after, self._origin)

    def _grain_frames(self) -> GrainFrames | None:
        if not np.any(self.scene.disks.outline >= 0):
            return None
        return GrainFrames(self.scene, self._laws)

    def _dynamic_step(self, place: Place) -> DynamicStep:
        theta = self.numerics.theta
        round_off = place.round_off()
        at_rest = surface_displacement(self.dt * self._v, place.radius) <= MISSED * round_off
        return DynamicStep(self._bodies, self._laws, self._solver, self._v, self.dt, theta, round_off, at_rest)

    def _batches_if_dynamic(self) -> StepBatches | None:
        """Takes steps of disks together where they are dynamic and begin with Gauss-Seidel."""
        static = self.numerics.regime == "quasi-static"
        if static or self._solver.sweeps == 0 or self._grains is not None or self._laws.pulls:
            return None
        radius, theta = self.scene.disks.radius, self.numerics.theta
        return StepBatches(
            self._bodies,
            self._loads,
            self._laws,
            self._motion,
            radius,
            self._finder,
            self._solver,
            self.dt,
            theta,
            self._gains,
            self._losses,
            self._notes,
        )

    def _static_step(self, place: Place) -> StaticStep:
        disks = self.scene.disks
        given = self.dt * np.column_stack([disks.v, disks.omega])
        prescribed = np.where(self._bodies.free, 0.0, given)
        return StaticStep(
            self._bodies,
            self._laws,
            self._solver,
            prescribed,
            disks.radius,
            place.wall_displacement(),
            place.round_off(),
        )

    def _own_step(self) -> tuple[float, int]:
        numerics = self.numerics
        if numerics.contact_dt is None or not self._laws.elastic[self._laws.used].all():
            return numerics.dt, 1
        return numerics.contact_dt, numerics.substeps(numerics.contact_dt)

    def _work_of_walls(self, frames: Frames, solved: Solved) -> float:
        """Work of prescribed wall motion on the disks: forces of the step times the walls' own displacement [J]."""
        moved = np.column_stack([frames.gap - frames.gap_before, frames.shift])
        return -float((solved.r * moved).sum())

    def _note(self, step: int, result: SolverResult) -> None:
        self.solves[result.solver] += 1
        self.iterations += result.iterations
        found = result.residuals
        if not found.reached(self.settings.solver_options.tolerance):
            self.loose.append((step, found.worst))
        if max(found.floor_map, found.floor_gap) > UNRESOLVED:
            return
        self.worst = (max(self.worst[0], found.natural_map), max(self.worst[1], found.duality_gap))

    def _remark(self) -> None:
        """Say which steps missed the tolerance, how much energy impacts fed, and how many modes without energy the last static step
        left alone.
        """
        gains, options = self._gains, self.settings.solver_options
        if self.loose:
            at, worst = max(self.loose, key=lambda each: each[1])
            steps = self.numerics.n_steps * self.substeps
            self.remarks.append(
                f"{len(self.loose)} of {steps} steps missed the tolerance {options.tolerance:g} and "
                f"went on with the best forces found, as cd.accept = {options.accept:g} allows: natural map and "
                f"duality gap up to {worst:.3g} (step {at})"
            )
        if gains[GAIN_STEPS]:
            names = " and ".join(self.scene.body_name(int(body)) for body in gains[[GAIN_I, GAIN_J]])
            self.remarks.append(
                f"impacts under Newton's law with friction fed {gains[GAIN_TOTAL]:.3g} J in {int(gains[GAIN_STEPS])} of "
                f"{self.numerics.n_steps} steps, most of it in one step at step {int(gains[GAIN_STEP])}: {gains[GAIN_LARGEST]:.3g} J, "
                f"there most at the contact of {names}. Friction acts on the slip at the end of an impact, which other impulses can "
                "turn round (Kane's paradox): impact = 'theta' feeds none, nor do smooth contacts"
            )
        step = self._step
        if not isinstance(step, StaticStep) or len(self._x) > MODES_UP_TO:
            return
        problem = step.problem(self._frames, self._memory.forces, self._bodies.mass, np.zeros_like(self._x))
        count = zero_energy_modes(problem, self._memory.forces)
        if count:
            self.remarks.append(
                f"{count} displacement mode(s) without energy at the last step (rattlers, rolling gears): the load does no work "
                "on them, and the displacement of least norm was taken"
            )

    def _contradiction(self, step: int, error: InfeasibleContactsError) -> NoReturn:
        raise InvalidSceneError(
            f"step {step} (t = {step * self.numerics.dt:g} s): {error}; disks are numbered from 0, -1 is a wall{self._wedged()}"
            f"{self._keep_problem(step)}"
        ) from error

    def _wedged(self) -> str:
        """What may be behind a step without a solution under Newton's law; ends with a full stop as the sentence before it does."""
        possible = self._laws.newton and bool((self._laws.restitution > 0.0).any() and (self._laws.mu > 0.0).any())
        return (
            f". Newton's restitution with friction can have no solution where bodies are wedged: {ADVICE}."
            if possible
            else ""
        )

    def _keep_problem(self, step: int) -> str:
        """Save the problem that failed, if the option asks for it; the sentence that says so."""
        problem, path = self._solver.problem, self.settings.save_failed
        if problem is None or not path:
            return " (the option cd.save_failed = FILE keeps the problem of a step that fails)"
        notes = {"scene": json.dumps(self.scene.to_dict()), "numerics": json.dumps(self.numerics.to_dict())}
        try:
            replace(problem, notes={**notes, "step": str(step)}).save(path)
        except UnwritableFileError as error:
            return f" The problem could not be kept: {error}."
        return f" The problem is in {path}: ninedisk.core.cd.problem.ContactProblem.load reads it."


class Recorder:
    """History of a run in the making.

    Contact forces are those at the end of a step where all contacts are elastic ("instantaneous"), else the impulses of the
    step over its length ("step-mean"), which have no value before the first step. Bodies are at coordinates about ``origin``, shape (2,),
    and points of walls at ``walls_back``, shape (m, 2), less than in the scene [m].
    """

    def __init__(
        self,
        scene: Scene,
        numerics: Numerics,
        laws: LawTable,
        pairs: tuple[Pair, ...],
        chosen: NDArray[np.int64],
        grains: GrainFrames | None,
        origin: FloatArray,
        walls_back: FloatArray,
    ) -> None:
        self._scene, self._laws, self._chosen, self._grains = scene, laws, chosen, grains
        self._origin, self._walls_back = origin, walls_back
        steps = numerics.sampled_steps()
        self._at = {int(step): row for row, step in enumerate(steps)}
        self.elastic = bool(laws.elastic[laws.used].all())
        history = History.empty(
            steps,
            np.multiply(steps, numerics.dt, dtype=np.float64),
            n_disks=len(chosen),
            n_walls=len(scene.walls),
            pairs=pairs,
            force_meaning="instantaneous" if self.elastic else "step-mean",
            energies=(*ENERGIES, *BUDGET) if numerics.energy_budget else ENERGIES,
        )
        self.history = History(**{**vars(history), "particles": tuple(int(i) for i in chosen)})
        self._pairs = np.array(pairs, dtype=np.int64).reshape(len(pairs), 2)

    def stops(self, last: int) -> list[int]:
        """Steps after which there is something to do: those sampled, and the last one; not step 0."""
        return sorted({*self._at, last} - {0})

    def sample(
        self,
        step: int,
        x: FloatArray,
        v: FloatArray,
        wall: FloatArray,
        memory: ContactMemory,
        totals: Mapping[str, float],
    ) -> None:
        """Write the state after ``step`` if it is a sampled one.

        Parameters
        ----------
        step : int
        x, v : ndarray, shape (n, 3)
            Centre and angle [m], [m], [rad], and their rates.
        wall : ndarray, shape (m, 11)
            Walls at this time.
        memory : ContactMemory
            Contact forces of the step that ends here.
        totals : mapping from name to float
            Energies that were fed and lost since time 0 [J].
        """
        row = self._at.get(step)
        if row is None:
            return
        history, chosen = self.history, self._chosen
        history.x[row], history.v[row] = x[chosen, :2] + self._origin, v[chosen, :2]
        history.angle[row], history.omega[row] = x[chosen, 2], v[chosen, 2]
        history.wall_point[row] = wall[:, 0:2] + self._walls_back
        history.wall_angle[row] = np.arctan2(wall[:, 3], wall[:, 2])
        history.gap[row] = self._gaps(x, wall)
        self._energies(row, x, v, memory, totals)
        if step > 0 or self.elastic:
            forces = memory.of(self._pairs, acting=True) if self._grains is None else memory.sums(self._pairs)
            history.fn[row], history.fs[row] = forces[:, 0], forces[:, 1]
            history.wall_force[row] = self._wall_forces(x, wall, memory)

    def _gaps(self, x: FloatArray, wall: FloatArray) -> FloatArray:
        if self._grains is None or not len(self._pairs):
            return np.array([self._gap(i, j, x, wall) for i, j in self._pairs.tolist()])
        disks = self._scene.disks
        place = Place(x[:, :2].copy(), disks.angle + x[:, 2], disks.radius, wall, wall)
        return self._grains.gaps(place, self._pairs)

    def _gap(self, i: int, j: int, x: FloatArray, wall: FloatArray) -> float:
        radius, w = self._scene.disks.radius, j - len(x)
        if w >= 0:
            return float((x[i, :2] - wall[w, 0:2]) @ wall[w, 2:4] - radius[i])
        return float(np.hypot(*(x[j, :2] - x[i, :2])) - (radius[i] + radius[j]))

    def _wall_forces(self, x: FloatArray, wall: FloatArray, memory: ContactMemory) -> FloatArray:
        """Force of the disks on each wall, shape (m, 2): ``p n - q t`` with n pointing into the wall."""
        total = np.zeros((len(wall), 2))
        of_wall = memory.pairs[:, 1] >= len(x)
        w = memory.pairs[of_wall, 1] - len(x)
        p, q = memory.acting[of_wall].T
        normal = -wall[w, 2:4]
        force = p[:, None] * normal - q[:, None] * np.column_stack([-normal[:, 1], normal[:, 0]])
        np.add.at(total, w, force)
        return total

    def _energies(
        self, row: int, x: FloatArray, v: FloatArray, memory: ContactMemory, totals: Mapping[str, float]
    ) -> None:
        disks, laws, energy = self._scene.disks, self._laws, self.history.energy
        of = laws.rows(memory.pairs)
        soft = laws.elastic[of]
        p, q = memory.spring[soft], memory.forces[soft, 1]
        kn, ks = laws.kn[of[soft]], laws.ks[of[soft]]
        shear = np.divide(q * q, ks, out=np.zeros_like(q), where=ks > 0.0)
        values = {
            "translation": 0.5 * float((disks.mass * (v[:, 0] ** 2 + v[:, 1] ** 2)).sum()),
            "rotation": 0.5 * float((disks.inertia * v[:, 2] ** 2).sum()),
            "elastic_normal": 0.5 * float((p * p / kn).sum()),
            "elastic_shear": 0.5 * float(shear.sum()),
            "gravity": -float((disks.mass * ((x[:, :2] + self._origin) @ np.array(self._scene.gravity))).sum()),
            **totals,
        }
        values["kinetic"] = values["translation"] + values["rotation"]
        values["elastic"] = values["elastic_normal"] + values["elastic_shear"]
        for name, value in values.items():
            energy[name][row] = value
