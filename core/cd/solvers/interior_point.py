"""Primal-dual interior-point method for the associated rule (Mehrotra's predictor-corrector, body-space matrix)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.residuals import Residuals, measure
from ninedisk.core.cd.result import SolverOptions, SolverResult, Stopwatch, not_converged
from ninedisk.core.cd.solvers.body_matrix import BodyGraph, BodyMatrix
from ninedisk.core.cd.solvers.feasibility import check_feasible
from ninedisk.core.cd.solvers.interior_point_run import Run

FloatArray = NDArray[np.float64]

MAX_ITERATIONS = 200
STALL = 20
"""Iterations without progress after which the method gives up."""
REFINEMENTS = 3
"""Corrections of the forces, at most, after which momentum is balanced as well as round-off allows."""


class InteriorPoint:
    """Interior-point solver that keeps the symbolic factorisation while the contact graph lasts.

    Parameters
    ----------
    options : SolverOptions, optional
    """

    def __init__(self, options: SolverOptions | None = None) -> None:
        self.options = options or SolverOptions()
        self._graph: BodyGraph | None = None

    def solve(self, problem: ContactProblem, *, start: FloatArray | None = None) -> SolverResult:
        """Solve the convex program of the associated rule.

        Parameters
        ----------
        problem : ContactProblem
        start : array_like, shape (c, 2), optional
            Contact forces of a neighbouring problem; they are moved into the interior of the cones.

        Returns
        -------
        SolverResult

        Raises
        ------
        SolverNotConvergedError
            At the iteration or time limit or where no more progress is made, with the figures reached.
        InfeasibleContactsError
            If no motion satisfies the contacts.

        Notes
        -----
        S. Mehrotra, "On the implementation of a primal-dual interior point method", SIAM J. Optim. 2 (1992) 575-601.
        M. Colombo, J. Gondzio, "Further development of multiple centrality correctors for interior point methods", Comput.
        Optim. Appl. 41 (2008) 277-305.
        J. Gondzio, "Multiple centrality corrections in a primal-dual method for linear programming", Comput. Optim. Appl. 6
        (1996) 137-156.
        """
        clock = Stopwatch(self.options.time_limit)
        # Where no contact force is needed, every iterate would be infinitely far off relative to the solution 0.
        free = np.zeros((problem.n_contacts, 2))
        unloaded = measure(problem, problem.body_velocity(free), free)
        if unloaded.reached(self.options.tolerance):
            return self._result(problem.body_velocity(free), free, 0, unloaded, clock)
        if self._graph is None or not self._graph.fits(problem, self.options.factoriser):
            self._graph = BodyGraph(problem.n_bodies, problem.bodies, self.options.factoriser)
        run = Run(problem, BodyMatrix(problem, self._graph), start)
        limit = self.options.max_iterations or MAX_ITERATIONS
        best, best_point, since = run.residuals(), run.point, 0
        lowest = np.array([best.natural_map, best.duality_gap])
        iterations = 0
        while not best.reached(self.options.tolerance) and iterations < limit and since < STALL and not clock.over:
            if not run.iterate():
                break
            iterations += 1
            residuals = run.residuals()
            figures = np.array([residuals.natural_map, residuals.duality_gap])
            # Either figure counts as progress: forces that have to grow by orders of magnitude leave the gap where it is.
            since = 0 if (figures < 0.9 * lowest).any() else since + 1
            lowest = np.minimum(lowest, figures)
            # A figure at its floor may exceed an earlier one: what counts is whether the tolerance is reached.
            if residuals.worst < best.worst or residuals.reached(self.options.tolerance):
                best, best_point = residuals, run.point
        if best.reached(self.options.tolerance):
            # Velocities that follow from the forces conserve momentum to the last bit; they replace the iterate's own
            # unless the mass is so small that they lose the accuracy asked for (static limit).
            for _ in range(REFINEMENTS + 1):
                v = problem.body_velocity(run.point.r)
                balanced = measure(problem, v, run.point.r)
                if balanced.reached(self.options.tolerance):
                    return self._result(v, run.point.r, iterations, balanced, clock)
                run.refine()
            return self._result(best_point.v, best_point.r, iterations, best, clock)
        check_feasible(problem, seconds=self.options.time_limit)
        not_converged(
            "interior-point",
            self.options,
            iterations,
            best,
            clock,
            "Loosen the tolerance, raise max_iterations or time_limit, or give the contacts a small compliance.",
        )

    @staticmethod
    def _result(v: FloatArray, r: FloatArray, iterations: int, residuals: Residuals, clock: Stopwatch) -> SolverResult:
        return SolverResult(
            solver="interior-point",
            sliding="associated",
            v=v,
            r=r,
            iterations=iterations,
            residuals=residuals,
            seconds=clock.seconds,
        )
