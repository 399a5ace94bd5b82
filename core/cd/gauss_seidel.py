"""Projected (nonsmooth) Gauss-Seidel, optionally over-relaxed: the field's baseline, and the Coulomb solver."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.feasibility import PROOF_AFTER, check_feasible
from ninedisk.core.cd.gauss_seidel_kernels import next_batch, sweep
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.residuals import Sliding, measure
from ninedisk.core.cd.result import SolverOptions, SolverResult, Stopwatch, not_converged
from ninedisk.core.cd.start import starting_forces
from ninedisk.core.cd.stripes import Stripes

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
    clock = Stopwatch(options.time_limit)
    limit = options.max_iterations or MAX_SWEEPS
    r = starting_forces(problem, start)
    advance = _sweeps(problem, options, sliding == "coulomb", r)
    done = 0
    best, proof_sought = None, False
    while True:
        v = problem.body_velocity(r)
        residuals = measure(problem, v, r, sliding=sliding)
        if best is None or residuals.worst < best.worst:
            best = residuals
        if residuals.reached(options.tolerance):
            return SolverResult(
                solver="gauss-seidel",
                sliding=sliding,
                v=v,
                r=r,
                iterations=done,
                residuals=residuals,
                seconds=clock.seconds,
            )
        if done >= PROOF_AFTER and not proof_sought:
            check_feasible(problem, sliding=sliding, seconds=options.time_limit)
            proof_sought = True
        if done >= limit or clock.over:
            break
        batch = min(next_batch(done), limit - done, max(1, 20_000_000 // (problem.n_contacts + 1)))
        advance(batch, v, r)
        done += batch
    not_converged(
        "gauss-seidel",
        options,
        done,
        best,
        clock,
        "Use the interior-point solver, loosen the tolerance, or raise max_iterations or time_limit."
        if sliding == "associated"
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
