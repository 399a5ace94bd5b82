"""Accelerated projected gradient with restarts: the cheap solver for warm starts and loose tolerances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem, measure
from ninedisk.core.cd.settings import SolverOptions, SolverResult, Stopwatch, not_converged
from ninedisk.core.cd.solvers.feasibility import PROOF_AFTER, check_feasible
from ninedisk.core.cd.solvers.gauss_seidel import starting_forces
from ninedisk.core.cd.solvers.projected_gradient_kernels import iterate

FloatArray = NDArray[np.float64]

MAX_ITERATIONS = 200_000
BATCH = 25
"""Iterations between two measurements."""


def solve_projected_gradient(
    problem: ContactProblem, options: SolverOptions | None = None, *, start: FloatArray | None = None
) -> SolverResult:
    """Minimise the convex program of the associated rule by accelerated projected gradients.

    The metric is the inverse of ``problem.rho``, in which the projection on each cone stays exact; the step length is
    found on the way.

    Parameters
    ----------
    problem : ContactProblem
    options : SolverOptions, optional
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
        If no motion satisfies the contacts; that is looked into after `PROOF_AFTER` iterations.
    """
    options = options or SolverOptions()
    clock = Stopwatch(options.time_limit)
    limit = options.max_iterations or MAX_ITERATIONS
    r = starting_forces(problem, start)
    mass = np.where(problem.free > 0.0, problem.mass, 0.0)
    y, r_work = r.copy(), np.empty_like(r)
    v = problem.body_velocity(r)
    v_y, v_work = v.copy(), np.empty_like(v)
    state, sums = np.array([1.0, 1.0]), np.empty(3)
    residuals = best = measure(problem, v, r)
    done, proof_sought = 0, False
    while not residuals.reached(options.tolerance):
        if done >= PROOF_AFTER and not proof_sought:
            check_feasible(problem, seconds=options.time_limit)
            proof_sought = True
        if done >= limit or clock.over:
            not_converged(
                "projected-gradient",
                options,
                done,
                best,
                clock,
                "Use the interior-point solver, loosen the tolerance, or raise max_iterations or time_limit.",
            )
        count = min(BATCH, limit - done)
        iterate(
            problem.bodies,
            problem.normal,
            problem.arms,
            problem.inverse_mass,
            mass,
            problem.offset,
            problem.compliance,
            problem.shear_0,
            problem.mu,
            problem.rho,
            count,
            r,
            v,
            r_work,
            v_work,
            y,
            v_y,
            state,
            sums,
        )
        done += count
        # The velocities are sums of many small changes: set them anew before they are judged.
        v[:], v_y[:] = problem.body_velocity(r), problem.body_velocity(y)
        residuals = measure(problem, v, r)
        if residuals.worst < best.worst:
            best = residuals
    return SolverResult(
        solver="projected-gradient",
        sliding="associated",
        v=v,
        r=r,
        iterations=done,
        residuals=residuals,
        seconds=clock.seconds,
    )
