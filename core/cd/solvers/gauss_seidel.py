"""Projected (nonsmooth) Gauss-Seidel, optionally over-relaxed: the field's baseline, and the Coulomb solver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Residuals, Sliding, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import gauss_seidel_kernels as kernels
from ninedisk.core.cd.solvers.feasibility import PROOF_AFTER, check_feasible
from ninedisk.core.cd.solvers.gauss_seidel_kernels import next_batch, sweep, sweep_stripes
from ninedisk.core.cd.solvers.outcome import SolverResult, Stopwatch, not_converged
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError, SolverNotConvergedError
from ninedisk.core.thread_kernels import PAD
from ninedisk.core.threads import run_in_threads
from ninedisk.core.validate import numbers

MAX_SWEEPS = 1_000_000
STRIPED_FROM = 1_000
"""Contacts from which they are swept in stripes, with any number of threads: below, a sweep takes less than threads need to meet."""


MOST_STRIPES = 64
"""Stripes, half of which are swept at the same time: enough to share them out evenly, and each of many contacts."""


def solve_gauss_seidel(
    problem: ContactProblem,
    options: SolverOptions | None = None,
    *,
    sliding: Sliding = "associated",
    start: FloatArray | None = None,
) -> SolverResult:
    """Sweep over the contacts until natural map and duality gap are below the tolerance.

    Each contact's 2 x 2 problem is solved exactly by cases; with ``options.relaxation`` other than 1 the step is
    stretched and projected back on the cone. The result does not depend on ``options.threads``.

    Parameters
    ----------
    problem : ContactProblem
    options : SolverOptions, optional
    sliding : {"associated", "coulomb"}
    start : array_like, shape (c, 2), optional
        Contact forces to start from; they are projected on the cones.

    Returns
    -------
    SolverResult

    Raises
    ------
    SolverNotConvergedError
        At the iteration or time limit, with the figures reached, if ``options.accept`` does not allow these.
    InfeasibleContactsError
        If no motion satisfies the contacts; that is looked into after `PROOF_AFTER` sweeps.
    """
    options = options or SolverOptions()
    limit = options.max_iterations or MAX_SWEEPS
    sweeps = GaussSeidel(problem, options, sliding, start)
    found = sweeps.solve(min(PROOF_AFTER, limit))
    if found is None and sweeps.done >= PROOF_AFTER:
        check_feasible(problem, sliding=sliding, seconds=options.time_limit)
        found = sweeps.solve(limit)
    return found or sweeps.give_up()


class GaussSeidel:
    """Sweeps that can be interrupted, and go on where they ended.

    Parameters
    ----------
    problem, options, sliding, start
        As in `solve_gauss_seidel`.

    Attributes
    ----------
    r : ndarray, shape (c, 2)
        Contact forces reached, inside the cones; not to be changed.
    done : int
        Sweeps.
    """

    def __init__(
        self, problem: ContactProblem, options: SolverOptions, sliding: Sliding, start: FloatArray | None = None
    ) -> None:
        self.problem, self.options, self.sliding = problem, options, sliding
        self.r, self.done = starting_forces(problem, start), 0
        self._advance = _sweeps(problem, options, sliding == "coulomb", self.r)
        self._clock = Stopwatch(options.time_limit)
        self._best: SolverResult | None = None

    def solve(self, limit: int) -> SolverResult | None:
        """Sweep until the tolerance is reached, or ``limit`` sweeps in all or the time limit: then None."""
        problem, r, clock, tolerance = self.problem, self.r, self._clock, self.options.tolerance
        while True:
            v, residuals = problem.body_velocity(r), self.residuals()
            if self._best is None or residuals.worst < self._best.residuals.worst or residuals.reached(tolerance):
                self._best = SolverResult(
                    solver="gauss-seidel",
                    sliding=self.sliding,
                    v=v.copy(),
                    r=r.copy(),
                    iterations=self.done,
                    residuals=residuals,
                    seconds=clock.seconds,
                )
            if residuals.reached(tolerance):
                return self._best
            if self.done >= limit or clock.over:
                return None
            batch = min(next_batch(self.done), limit - self.done, max(1, 20_000_000 // (problem.n_contacts + 1)))
            self._advance(batch, v, r)
            self.done += batch

    def residuals(self) -> Residuals:
        """Those of the forces reached."""
        return measure(self.problem, self.problem.body_velocity(self.r), self.r, sliding=self.sliding)

    def give_up(self, others: Sequence[SolverNotConvergedError] = ()) -> SolverResult:
        """The best forces so far, those of other methods that gave up included, if ``options.accept`` allows them; else raise
        `SolverNotConvergedError` with their figures.
        """
        assert self._best is not None
        for other in others:
            if other.forces is not None:
                v = self.problem.body_velocity(other.forces)
                residuals = measure(self.problem, v, other.forces, sliding=self.sliding)
                if residuals.worst < self._best.residuals.worst:
                    self._best = replace(self._best, v=v, r=other.forces, residuals=residuals)
        if self.options.accept is not None and self._best.residuals.reached(self.options.accept):
            return replace(self._best, iterations=self.done, seconds=self._clock.seconds)
        not_converged(
            "gauss-seidel",
            self.options,
            self.done,
            (self._best.r, self._best.residuals),
            self._clock,
            "Use the interior-point solver, loosen the tolerance, or raise max_iterations or time_limit."
            if self.sliding == "associated"
            else "Raise max_iterations or time_limit, try a relaxation between 0.5 and 1.5, or loosen the tolerance; "
            "in a run, cd.accept lets it go on with the best forces.",
        )


def _sweeps(
    problem: ContactProblem, options: SolverOptions, coulomb: bool, r: FloatArray
) -> Callable[[int, FloatArray, FloatArray], None]:
    """``advance(count, v, r)``: that many sweeps; between two calls ``r`` must stay as it is, ``v`` may be set anew from it."""
    if problem.n_contacts >= STRIPED_FROM:
        stripes = Stripes(problem, r, options.threads)
        return lambda count, v, r: stripes.sweep(count, options.relaxation, coulomb, v, r)
    return lambda count, v, r: sweep(
        problem.contacts,
        problem.inverse_mass,
        problem.offset,
        problem.shear_0,
        problem.blocks,
        options.relaxation,
        coulomb,
        count,
        v,
        r,
    )


class Stripes:
    """The contacts of a problem in stripes; their order depends on the problem alone.

    Parameters
    ----------
    problem : ContactProblem
    r : ndarray, shape (c, 2)
        Initial contact forces.
    threads : int

    Attributes
    ----------
    order : ndarray of int32, shape (c,)
        The problem's contacts by stripes.
    pairs : ndarray of int32, shape (c, 2)
        Their bodies, renumbered so that contacts close in order have bodies close in memory; -1 for one that does not move.
    bounds : ndarray of int32, shape (s + 1,)
        Places in ``order`` of the first contacts of the stripes.
    """

    def __init__(self, problem: ContactProblem, r: FloatArray, threads: int) -> None:
        b, c = problem.n_bodies, problem.n_contacts
        moving, contacts = np.empty((c, 2), dtype=np.int32), np.empty(2 * c, dtype=np.int32)
        first, bounds = np.empty(b + 1, dtype=np.int32), np.empty(MOST_STRIPES + 1, dtype=np.int32)
        place, self._queue, level = (np.empty(b, dtype=np.int32) for _ in range(3))
        self.order = np.empty(c, dtype=np.int32)
        kernels.moving_bodies(problem.bodies, problem.inverse_mass, moving)
        kernels.list_contacts(moving, first, contacts)
        kernels.number_bodies(moving, first, contacts, place, self._queue, level)
        kernels.own_contacts(moving, place, first, contacts)
        count = kernels.cut_stripes(first, contacts, level, self.order, bounds)
        self.bounds = bounds[: count + 1]
        self.pairs, self._rows = np.empty((c, 2), dtype=np.int32), np.empty((c, kernels.ROW))
        load = (problem.offset, problem.shear_0, problem.blocks)
        kernels.pack_rows(self.order, place, moving, problem.contacts, *load, r, self.pairs, self._rows)
        self._inverse_mass, self._v = np.empty((b, 3)), np.empty((b, 3))
        kernels.gather_bodies(self._queue, problem.inverse_mass, self._inverse_mass)
        self._threads = min(threads, count)
        self._flags = np.zeros(self._threads * PAD, dtype=np.int64)

    def sweep(self, count: int, relaxation: float, coulomb: bool, v: FloatArray, r: FloatArray) -> None:
        """``count`` sweeps from the velocities ``v``, shape (b, 3), of the forces that it left; these into ``r``, shape (c, 2)."""
        kernels.gather_bodies(self._queue, v, self._v)
        shared = (self._flags, self.bounds, self.pairs, self._inverse_mass, relaxation, coulomb, count)
        run_in_threads(sweep_stripes, self._threads, (*shared, self._v, self._rows))
        kernels.unpack_forces(self.order, self._rows, r)


def starting_forces(problem: ContactProblem, start: ArrayLike | None) -> NDArray[np.float64]:
    """Contact forces, shape (c, 2), inside the cones: ``start`` projected, or zero.

    Raises
    ------
    InvalidNumericsError
        If ``start`` has the wrong shape or is not finite.
    """
    shape = (problem.n_contacts, 2)
    if start is None:
        return np.zeros(shape)
    try:
        r = numbers("start", start)
    except InvalidSceneError as error:
        raise InvalidNumericsError(str(error)) from error
    if r.shape != shape or not np.isfinite(r).all():
        raise InvalidNumericsError(
            f"start, the starting forces, must be finite and of shape {shape}; they have shape {r.shape}"
        )
    p, q, mu = r[:, 0], np.abs(r[:, 1]), problem.mu
    outside = q > mu * p
    along = np.maximum(0.0, (p + mu * q) / (1.0 + mu * mu))
    r[:, 1] = np.where(outside, np.sign(r[:, 1]) * mu * along, r[:, 1])
    r[:, 0] = np.where(outside, along, p)
    return r
