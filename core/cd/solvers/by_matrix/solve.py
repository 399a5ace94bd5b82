"""Solvers of a contact problem that is given by its Delassus matrix alone."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.delassus import DelassusProblem, natural_map, project, rounding_floor
from ninedisk.core.cd.problem import Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.by_matrix import plane_kernels as kernels
from ninedisk.core.cd.solvers.by_matrix.cone import solve_cones
from ninedisk.core.cd.solvers.outcome import MatrixSolution, Stopwatch

FIRST_SWEEPS, MOST_SWEEPS = 50, 2_000_000
NEWTON_STEPS = 60
"""Changes of statuses after a round of sweeps, at most."""
PATIENCE = 8
"""Changes of statuses that come no nearer, after which sweeps do."""
PROXIMAL = 1e-9
"""Part of the diagonal that is added to a system of statuses, whose forces need not be unique; refinement takes it out again."""
REFINEMENTS = 4


def solve_matrix(problem: DelassusProblem, options: SolverOptions, *, sliding: Sliding) -> MatrixSolution:
    """Forces of a problem of either dimension, the best that were found: whether they are a solution is for the caller to judge.

    In 3D see `ninedisk.core.cd.solvers.by_matrix.cone.solve_cones`. In 2D:

    Gauss-Seidel until the statuses of the contacts are those of a solution, whose linear system is then solved.

    In each round the sweeps double, and take no less time than what follows: Newton's method on the nonsmooth equations, which begins
    with the statuses of their forces and is a change of statuses at a time, each with a factorisation. It ends at the tolerance, or at
    the round-off of evaluating u, or at the limits of time and iterations.
    """
    if problem.dimension == 3:
        return solve_cones(problem, options, sliding=sliding)
    clock, coulomb = Stopwatch(options.time_limit), sliding == "coulomb"
    limit = options.max_iterations or MOST_SWEEPS
    w, full = problem.w, problem.blocks
    blocks = np.column_stack([full[:, 0, 0], 0.5 * (full[:, 0, 1] + full[:, 1, 0]), full[:, 1, 1]])
    pointers, columns = w.indptr.astype(np.int32), w.indices.astype(np.int32)
    b, r = problem.b.ravel().copy(), np.zeros(2 * problem.n_contacts)
    best, done, changes, newton = np.zeros((problem.n_contacts, 2)), 0, 0, 0.0
    least = natural_map(problem, best, coulomb=coulomb)
    while least > options.tolerance and done < limit and not clock.over:
        begin, last = clock.seconds, min(2 * done + FIRST_SWEEPS, limit)
        while done < limit and not clock.over and (done < last or clock.seconds - begin < newton):
            count = min(FIRST_SWEEPS, limit - done)
            kernels.sweep_matrix(pointers, columns, w.data, b, problem.mu, blocks, coulomb, count, r)
            done += count
        begin, swept = clock.seconds, r.reshape(-1, 2).copy()
        settled, steps = _newton(problem, swept, coulomb, options.tolerance, clock)
        newton, changes = clock.seconds - begin, changes + steps
        for forces in (swept, settled):
            error = natural_map(problem, forces, coulomb=coulomb)
            if error < least:
                best, least = forces, error
        r[:] = best.ravel()
        if least <= rounding_floor(problem, best):
            break
    return MatrixSolution(best, least, done + changes, clock.seconds)


def _newton(
    problem: DelassusProblem, start: FloatArray, coulomb: bool, tolerance: float, clock: Stopwatch
) -> tuple[FloatArray, int]:
    """The best forces of Newton's method from ``start``, inside the cones, and the number of its steps.

    With the statuses of ``z = r - rho u`` the unknowns are p and q of a contact that sticks, p of one that slips; the equations u = 0,
    or ``u_n = 0`` under Coulomb's law, ``u_n + s mu u_t = 0`` under the associated rule, s the sign of q.
    """
    mu, rho, c = problem.mu, problem.rho, problem.n_contacts
    r, best, least, at, seen = start, start, np.inf, 0, set[bytes]()
    for step in range(NEWTON_STEPS):
        z = r - rho[:, None] * problem.velocity(r)
        status = _statuses(z, mu, coulomb)
        if status.tobytes() in seen or step - at > PATIENCE or clock.over:
            return best, step
        seen.add(status.tobytes())
        closed, stick = np.flatnonzero(status), np.flatnonzero(status == 2)
        m = len(closed)
        slope = np.where(status == 2, 0.0, status * mu)[closed]
        rows = np.concatenate([2 * closed, 2 * closed + 1, 2 * stick + 1])
        columns = np.concatenate([np.arange(m), np.arange(m), m + np.arange(len(stick))])
        shape = (2 * c, m + len(stick))
        d = sp.csc_array((np.concatenate([np.ones(m), slope, np.ones(len(stick))]), (rows, columns)), shape=shape)
        flat = np.concatenate([np.ones(m), np.zeros(m) if coulomb else slope, np.ones(len(stick))])
        t = sp.csr_array(sp.csc_array((flat, (rows, columns)), shape=shape).T)
        matrix, right = sp.csc_array(t @ problem.w @ d), -(t @ problem.b.ravel())
        x = np.concatenate([r[closed, 0], r[stick, 1]])
        shift = PROXIMAL / rho[np.concatenate([closed, stick])]
        try:
            factors = splu(
                sp.csc_matrix(matrix + sp.diags_array(shift)),
                permc_spec="MMD_AT_PLUS_A",
                options={"SymmetricMode": True},
            )
            for _ in range(REFINEMENTS):
                x = x + factors.solve(right - matrix @ x)
        except (RuntimeError, MemoryError):
            return best, step
        if not np.isfinite(x).all():
            return best, step
        r = np.asarray(d @ x).reshape(-1, 2)
        inside = project(r, mu)
        error = natural_map(problem, inside, coulomb=coulomb)
        if error < least:
            best, least, at = inside, error, step
        if least <= tolerance:
            return best, step + 1
    return best, NEWTON_STEPS


def _statuses(z: FloatArray, mu: FloatArray, coulomb: bool) -> NDArray[np.int8]:
    """0 open, 2 sticks, 1 and -1 slip with q = mu p and q = -mu p, shape (c,)."""
    side = np.where(z[:, 1] < 0.0, -1, 1)
    inside = (np.abs(z[:, 1]) <= mu * z[:, 0]) & (mu > 0.0)
    is_open = z[:, 0] <= 0.0 if coulomb else z[:, 0] + mu * np.abs(z[:, 1]) <= 0.0
    return np.where(is_open, 0, np.where(inside, 2, side)).astype(np.int8)
