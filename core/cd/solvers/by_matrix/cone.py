"""Contact problems in space that are given by their Delassus matrix: sweeps, an interior point for circular cones, and Newton's method.

The interior point follows the path of ``r o u~ = nu e`` to nu = 0; ``o`` is Jordan's product of the second-order cone and
``u~ = u + (mu |u_t|, 0)`` De Saxce's velocity (under the associated rule ``u~ = u``), with the scaling of Nesterov and Todd (1997) and
Mehrotra's corrector, as Acary, Armand, Nguyen and Shpakovych (2023) have it. Newton's method on the statuses of the contacts, Alart and
Curnier's (1991), begins from its forces and reaches what rounding allows. Where the path turns back, the last way is a walk through
problems with less and less compliance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.delassus import DelassusProblem, project
from ninedisk.core.cd.problem import TINY, Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.by_matrix import cone_kernels as kernels
from ninedisk.core.cd.solvers.outcome import MatrixSolution, Stopwatch

FIRST_SWEEPS, MOST_SWEEPS = 4, 252
"""Sweeps of the first round, and of all; each round has twice as many as the one before."""
CONVEX_ROUNDS = 80
"""Problems of the associated rule that approach Coulomb's law, at most."""
WORTHWHILE = 0.3
"""Share of the error that may be left after a round of sweeps that another one follows."""
NEWTON_BEGINS = 1e-3
"""Largest error of forces from which Newton's method on statuses is tried."""
NEWTON_STEPS, NEWTON_PATIENCE = 40, 5
INTERIOR_STEPS, INTERIOR_PATIENCE = 100, 12
INTERIOR_ENDS = 1e-7
"""Error below which the interior point leaves the rest to Newton's method."""
BACK = 0.99
"""Part of the way to the boundary of the cones that a step goes."""
SHORT = 0.1
"""Length of a step below which the next one turns back to the path."""
SHORTEST = 1e-8
MOST_CENTRING = 0.9
"""Share of the product of forces and velocities that a step keeps at most."""
FIRST_COMPLIANCE, LAST_COMPLIANCE, LESS_COMPLIANCE = 0.1, 1e-10, 0.6
"""Compliances of a walk, of W's mean diagonal entry, and the ratio of one to the one before."""
PROXIMAL = 1e-10
"""Part of the diagonal that is added where forces need not be unique; refinement takes it out again."""
REFINEMENTS = 3


class _Pattern(NamedTuple):
    """Places of W's entries and of all diagonal blocks in one matrix of compressed columns.

    ``at``, shape (c, 3, 3), are the places of the blocks' entries in ``values``, W's entries.
    """

    indices: NDArray[np.int32]
    pointers: NDArray[np.int32]
    columns: NDArray[np.int32]
    at: NDArray[np.int64]
    values: FloatArray

    def matrix(self, values: FloatArray, blocks: FloatArray) -> sp.csc_matrix:
        """``values`` plus ``blocks``, shape (c, 3, 3), on the diagonal."""
        data = values.copy()
        data[self.at.ravel()] += blocks.ravel()
        n = len(self.pointers) - 1
        return sp.csc_matrix((data, self.indices, self.pointers), shape=(n, n))


def _pattern(w: sp.csr_array) -> _Pattern:
    n = w.shape[0]
    entries = sp.coo_array(w)
    row, column = np.divmod(np.arange(3 * n), 3)
    column += 3 * (row // 3)
    rows, columns = np.concatenate([entries.coords[0], row]), np.concatenate([entries.coords[1], column])
    whole = sp.csc_array((np.concatenate([entries.data, np.zeros(3 * n)]), (rows, columns)), shape=(n, n))
    whole.sum_duplicates()  # keeps entries that are 0
    of_entry = np.repeat(np.arange(n, dtype=np.int32), np.diff(whole.indptr))
    inside = np.flatnonzero(whole.indices // 3 == of_entry // 3)
    at = np.empty((n // 3, 3, 3), dtype=np.int64)
    at[whole.indices[inside] // 3, whole.indices[inside] % 3, of_entry[inside] % 3] = inside
    return _Pattern(whole.indices.astype(np.int32), whole.indptr.astype(np.int32), of_entry, at, whole.data)


class _Best:
    """The best forces so far, none at first, their error and the tolerance."""

    def __init__(self, problem: DelassusProblem, tolerance: float, clock: Stopwatch, *, coulomb: bool) -> None:
        self.problem, self.tolerance, self.clock, self.coulomb = problem, tolerance, clock, coulomb
        self.arrays = delassus_arrays(problem)
        self.forces = np.zeros((problem.n_contacts, 3))
        self.error, self.iterations = np.inf, 0

    def offer(self, r: FloatArray) -> float:
        """Error of the forces inside the cones that are nearest to ``r``."""
        inside = project(r, self.problem.mu)
        error = kernels.largest_error(self.arrays, self.coulomb, inside.ravel())
        if error < self.error:
            self.forces, self.error = inside, error
        return error

    @property
    def done(self) -> bool:
        return self.error <= self.tolerance or self.clock.over


def delassus_arrays(problem: DelassusProblem) -> kernels.Delassus:
    """The problem as the kernels read it."""
    w = problem.w
    pointers, columns = w.indptr.astype(np.int32, copy=False), w.indices.astype(np.int32, copy=False)
    return kernels.Delassus(pointers, columns, w.data, problem.b.reshape(-1), problem.mu, problem.rho, problem.blocks)


def largest_error(problem: DelassusProblem, r: FloatArray, *, coulomb: bool) -> float:
    """Largest relative error of forces ``r``, shape (c, 3), inside the cones, as `cone_kernels.largest_error` beside this file has it."""
    return kernels.largest_error(delassus_arrays(problem), coulomb, np.ascontiguousarray(r, dtype=np.float64).ravel())


def solve_cones(
    problem: DelassusProblem, options: SolverOptions, *, sliding: Sliding, start: FloatArray | None = None
) -> MatrixSolution:
    """Sweeps while they are worth it, else the interior point, else a walk; Newton's method on statuses from the forces of each.

    It ends at the tolerance, at the limits of time and iterations, or where none of these gets on, with the best forces that were
    found. ``start``, shape (c, 3), is a guess of the forces: sweeps begin from it, after Newton's method if it is near enough.
    """
    clock = Stopwatch(options.time_limit)
    best = _Best(problem, options.tolerance, clock, coulomb=sliding == "coulomb")
    limit = options.max_iterations or 2**31
    if start is not None and start.any() and best.offer(start) < NEWTON_BEGINS:
        _newton(best)
    _sweep(best, min(limit, MOST_SWEEPS))
    if best.done or best.iterations >= limit:
        return MatrixSolution(best.forces, best.error, best.iterations, clock.seconds)
    pattern = _pattern(problem.w)
    if best.error < NEWTON_BEGINS:
        _newton(best)
    if not best.done and best.iterations < limit:
        for ends in (INTERIOR_ENDS, 0.0):
            reached = _interior_point(
                best, pattern, max(ends, best.tolerance), min(limit - best.iterations, INTERIOR_STEPS)
            )
            if not best.done and reached < NEWTON_BEGINS:
                _newton(best)
            if best.done:
                break
    if not best.done and best.iterations < limit:
        _walk(best)
    return MatrixSolution(best.forces, best.error, best.iterations, clock.seconds)


def solve_by_convex_problems(problem: DelassusProblem, options: SolverOptions, *, start: FloatArray) -> MatrixSolution:
    """Coulomb's law by problems of the associated rule, from forces ``start``, shape (c, 3), for a problem that nothing else solves.

    Each problem is convex: ``mu |u_t|`` of the solution before is added to b_n, De Saxce's correction, as Acary, Cadoux, Lemarechal and
    Malick (2011) have it. Errors fall by a steady factor, so that the limit of many rounds is that of time.
    """
    best = _Best(problem, options.tolerance, Stopwatch(options.time_limit), coulomb=True)
    best.offer(start)
    r = start
    for _ in range(CONVEX_ROUNDS):
        if best.done:
            break
        u, b = problem.velocity(r), problem.b.copy()
        b[:, 0] += problem.mu * np.hypot(u[:, 1], u[:, 2])
        convex = DelassusProblem(w=problem.w, b=b, mu=problem.mu)
        inner = _Best(convex, 0.01 * options.tolerance, best.clock, coulomb=False)
        with np.errstate(invalid="ignore"):  # a step without a length ends it
            _interior_point(inner, _pattern(convex.w), 0.01 * options.tolerance, INTERIOR_STEPS)
        best.iterations += inner.iterations
        r = inner.forces
        best.offer(r)
    return MatrixSolution(best.forces, best.error, best.iterations, best.clock.seconds)


def load_kernels() -> None:
    """Compile or load the kernels, so that no time limit counts it."""
    w = sp.csr_array(np.eye(6) + 0.1)
    problem = DelassusProblem(w=w, b=np.array([[-1.0, 2.0, 0.0], [-1.0, 0.0, 0.1]]), mu=np.array([0.3, 0.5]))
    best = _Best(problem, 0.0, Stopwatch(60.0), coulomb=True)
    _sweep(best, 1)
    _newton(best)
    _interior_point(best, _pattern(w), 0.0, 2)


def _sweep(best: _Best, limit: int) -> None:
    """Gauss-Seidel, as long as each round, twice as long as the one before, is worth it."""
    if limit <= 0 or best.done:
        return
    r, found = best.forces.ravel().copy(), np.empty(best.forces.size)
    error, sweeps = kernels.sweep_cones(
        best.arrays, best.coulomb, best.tolerance, FIRST_SWEEPS, limit, WORTHWHILE, r, found
    )
    best.iterations += sweeps
    if error < best.error:
        best.forces, best.error = found.reshape(-1, 3), error


def _newton(best: _Best) -> None:
    """Newton's method on the statuses of the contacts, from the best forces."""
    problem, coulomb = best.problem, best.coulomb
    c, mu, rho = problem.n_contacts, problem.mu, problem.rho
    of_u, of_r = np.empty((c, 3, 3)), np.empty((c, 3, 3))
    error, fixed = np.empty((c, 3)), np.empty((c, 3))
    r, least, stale = best.forces.copy(), np.inf, 0
    ends = np.arange(c + 1)
    for _ in range(NEWTON_STEPS):
        kernels.statuses_system(r, problem.velocity(r), mu, rho, coulomb, of_u, of_r, error, fixed)
        left = sp.bsr_array((of_u, ends[:-1], ends), shape=(3 * c, 3 * c)) @ problem.w
        matrix = sp.csc_matrix(left + sp.bsr_array((of_r, ends[:-1], ends), shape=(3 * c, 3 * c)))
        try:
            factors = splu(sp.csc_matrix(matrix + sp.diags_array(PROXIMAL * fixed.ravel())))
        except (RuntimeError, MemoryError):
            return
        step = factors.solve(-error.ravel())
        for _ in range(REFINEMENTS):
            step += factors.solve(-error.ravel() - matrix @ step)
        if not np.isfinite(step).all():
            return
        r = r + step.reshape(c, 3)
        best.iterations += 1
        found = best.offer(r)
        least, stale = (found, 0) if found < least else (least, stale + 1)
        if best.done or stale > NEWTON_PATIENCE:
            return


def _walk(best: _Best) -> None:
    """Newton's method on the problem with a compliance in each contact, from a large one to none, each time from the forces before."""
    problem = best.problem
    n, r = problem.b.size, np.zeros_like(best.forces)
    mean = float(problem.w.diagonal().sum()) / n
    compliance = FIRST_COMPLIANCE
    while compliance > LAST_COMPLIANCE and not best.clock.over:
        w = sp.csr_array(problem.w + compliance * mean * sp.eye_array(n))
        soft = _Best(DelassusProblem(w=w, b=problem.b, mu=problem.mu), best.tolerance, best.clock, coulomb=best.coulomb)
        soft.offer(r)
        _newton(soft)
        if soft.error > NEWTON_BEGINS:
            _sweep(soft, MOST_SWEEPS)
            _newton(soft)
        best.iterations += soft.iterations
        if soft.error > NEWTON_BEGINS:
            return
        r = soft.forces
        if best.offer(r) == best.error and best.error < NEWTON_BEGINS:
            _newton(best)
            if best.done:
                return
        compliance *= LESS_COMPLIANCE


class _Path(NamedTuple):
    """``u = W r + q`` in coordinates in which all cones are ``|r_t| <= r_n``, and forces and velocities are of size 1.

    ``values`` are W's entries by `_Pattern`; ``w`` is W, ``scale`` times r the forces of the problem. Contacts without friction have
    tangential unknowns that nothing moves.
    """

    w: sp.csr_array
    values: FloatArray
    q: FloatArray
    scale: FloatArray


def _path(problem: DelassusProblem, pattern: _Pattern) -> _Path:
    smooth = problem.mu == 0.0
    scale = np.ones((problem.n_contacts, 3))
    scale[:, 0] = 1.0 / np.where(smooth, 1.0, problem.mu)
    scale[smooth, 1:] = 0.0
    flat = scale.ravel()
    values = pattern.values * flat[pattern.indices] * flat[pattern.columns]
    diagonal = values[pattern.at[:, range(3), range(3)]]
    stiff, q = float(diagonal.sum() / np.count_nonzero(diagonal)), scale * problem.b
    size = float(np.abs(q).max()) or 1.0
    values /= stiff
    values[pattern.at[smooth, 1, 1]] = values[pattern.at[smooth, 2, 2]] = 1.0
    w = sp.csr_array(pattern.matrix(values, np.zeros_like(pattern.at, dtype=np.float64)))
    return _Path(w, values, q / size, scale * (size / stiff))


class _Point:
    """A point (r, u) near the path, shapes (c, 3), and what its steps share: scalings, residual and factors."""

    def __init__(self, path: _Path, pattern: _Pattern, *, coulomb: bool) -> None:
        c = len(path.q)
        self.path, self.pattern, self.coulomb = path, pattern, coulomb
        self.r, self.u = np.zeros((c, 3)), np.zeros((c, 3))
        self.r[:, 0], self.u[:, 0] = max(1.0, float(np.abs(path.q).max())), 1.0
        self._direct, self._inverse, self._turn = (np.empty((c, 3, 3)) for _ in range(3))
        self._point, self._target, self.none = np.empty((c, 3)), np.empty((c, 3)), np.zeros((c, 3))
        self._rest = self.none
        self._factors: SuperLU

    def product(self, reach: float, dr: FloatArray, du: FloatArray) -> float:
        """Mean of r . u after a part of a step."""
        return max(float(((self.r + reach * dr) * (self.u + reach * du)).sum()) / len(self.r), 0.0)

    def prepare(self) -> bool:
        """Scalings and factors at the point; False if there are none."""
        r, u = self.r, self.u
        self._rest = u - (self.path.w @ r.ravel()).reshape(-1, 3) - self.path.q
        if self.coulomb:
            self._rest[:, 0] -= np.hypot(u[:, 1], u[:, 2])
        kernels.scale_cones(r, u, self.coulomb, self._direct, self._inverse, self._turn, self._point)
        matrix = self.pattern.matrix(self.path.values, self._turn @ self._inverse @ self._inverse)
        try:
            self._factors = splu(
                matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options={"SymmetricMode": True}
            )
        except (RuntimeError, MemoryError):
            return False
        return True

    def step(self, nu: float, dr: FloatArray, du: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """A step towards ``r o u~ = nu e``, corrected by another one, and how far it may go."""
        kernels.complementarity_target(self._point, nu, self._direct, self._inverse, dr, du, self._target)
        towards = _times(self._inverse, self._target)
        right = self._rest + _times(self._turn, towards)
        r_step = self._factors.solve(right.ravel()).reshape(-1, 3)
        u_step = towards - _times(self._inverse, _times(self._inverse, r_step))
        return r_step, u_step, min(kernels.longest_step(self.r, r_step), kernels.longest_step(self.u, u_step))


def _interior_point(best: _Best, pattern: _Pattern, ends: float, limit: int) -> float:
    """Follow the path until the error of its forces is at most ``ends``; the least error that they had."""
    path = _path(best.problem, pattern)
    at = _Point(path, pattern, coulomb=best.coulomb)
    least, stale = np.inf, 0
    for _ in range(limit):
        error, product = best.offer(path.scale * at.r), at.product(0.0, at.none, at.none)
        least, stale = (error, 0) if error < least else (least, stale + 1)
        if least <= ends or stale > INTERIOR_PATIENCE or best.clock.over or not product > TINY or not at.prepare():
            break
        dr, du, reach = at.step(0.0, at.none, at.none)
        left = at.product(min(1.0, reach), dr, du) / product
        centring = min(left**3, MOST_CENTRING) if reach > SHORT else MOST_CENTRING
        dr, du, reach = at.step(centring * product, dr, du)
        if not BACK * reach > SHORT:
            dr, du, reach = at.step(centring * product, at.none, at.none)
        reach = min(1.0, BACK * reach)
        if not reach > SHORTEST:
            break
        at.r, at.u = at.r + reach * dr, at.u + reach * du
        best.iterations += 1
    return least


def _times(blocks: FloatArray, x: FloatArray) -> FloatArray:
    """``blocks[k] x[k]``."""
    return np.asarray(np.einsum("kij,kj->ki", blocks, x))
