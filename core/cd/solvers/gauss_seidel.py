"""Projected (nonsmooth) Gauss-Seidel, optionally over-relaxed: the field's baseline, and the Coulomb solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.residuals import Residuals, Sliding, measure
from ninedisk.core.cd.result import SolverOptions, SolverResult, Stopwatch, not_converged
from ninedisk.core.cd.solvers.feasibility import PROOF_AFTER, check_feasible
from ninedisk.core.cd.solvers.gauss_seidel_kernels import next_batch, sweep
from ninedisk.core.cd.solvers.start import starting_forces
from ninedisk.core.cd.solvers.stripes import Stripes

FloatArray = NDArray[np.float64]
MAX_SWEEPS = 1_000_000
STRIPED_FROM = 1_000
"""Contacts from which they are swept in stripes, with any number of threads: below, a sweep takes less than threads need to meet."""


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
        At the iteration or time limit, with the figures reached.
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
        self._best: Residuals | None = None

    def solve(self, limit: int) -> SolverResult | None:
        """Sweep until the tolerance is reached, or ``limit`` sweeps in all or the time limit: then None."""
        problem, r, clock = self.problem, self.r, self._clock
        while True:
            v, residuals = problem.body_velocity(r), self.residuals()
            if self._best is None or residuals.worst < self._best.worst:
                self._best = residuals
            if residuals.reached(self.options.tolerance):
                return SolverResult(
                    solver="gauss-seidel",
                    sliding=self.sliding,
                    v=v,
                    r=r,
                    iterations=self.done,
                    residuals=residuals,
                    seconds=clock.seconds,
                )
            if self.done >= limit or clock.over:
                return None
            batch = min(next_batch(self.done), limit - self.done, max(1, 20_000_000 // (problem.n_contacts + 1)))
            self._advance(batch, v, r)
            self.done += batch

    def residuals(self) -> Residuals:
        """Those of the forces reached."""
        return measure(self.problem, self.problem.body_velocity(self.r), self.r, sliding=self.sliding)

    def give_up(self) -> NoReturn:
        """Raise `SolverNotConvergedError` with the best figures so far."""
        assert self._best is not None
        not_converged(
            "gauss-seidel",
            self.options,
            self.done,
            self._best,
            self._clock,
            "Use the interior-point solver, loosen the tolerance, or raise max_iterations or time_limit."
            if self.sliding == "associated"
            else "Raise max_iterations or time_limit, try a relaxation between 0.5 and 1.5, or loosen the tolerance.",
        )


def _sweeps(
    problem: ContactProblem, options: SolverOptions, coulomb: bool, r: FloatArray
) -> Callable[[int, FloatArray, FloatArray], None]:
    """``advance(count, v, r)``: that many sweeps; between two calls ``r`` must stay as it is, ``v`` may be set anew from it."""
    if problem.n_contacts >= STRIPED_FROM:
        stripes = Stripes(problem, r, options.threads)
        return lambda count, v, r: stripes.sweep(count, options.relaxation, coulomb, v, r)
    return lambda count, v, r: sweep(
        problem.bodies,
        problem.normal,
        problem.arms,
        problem.inverse_mass,
        problem.offset,
        problem.compliance,
        problem.shear_0,
        problem.mu,
        problem.blocks,
        options.relaxation,
        coulomb,
        count,
        v,
        r,
    )
