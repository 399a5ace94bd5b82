"""Primal-dual interior-point method for the associated rule (Mehrotra's predictor-corrector, body-space matrix)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd import interior_point_kernels as kernels
from ninedisk.core.cd.body_matrix import BodyGraph, BodyMatrix
from ninedisk.core.cd.contact_kernels import contact_forces_on_bodies, contact_velocities
from ninedisk.core.cd.feasibility import check_feasible
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.residuals import Residuals, measure
from ninedisk.core.cd.result import SolverOptions, SolverResult, Stopwatch, not_converged
from ninedisk.core.cd.start import starting_forces

FloatArray = NDArray[np.float64]

MAX_ITERATIONS = 200
CLOSEST = 1.0 - 1e-7
"""Largest fraction of the way to the boundary, so that rays and slacks stay positive."""
CORRECTORS = 3
"""Centrality correctors of an iteration: a solve each, a tenth or so of a factorisation; a fourth no longer pays."""
ENOUGH = 0.95
"""Step length that needs no corrector."""
SPREAD = 0.1
"""Products between this fraction of the goal and its inverse count as central."""
WORTH = 1.02
"""Factor by which a corrector has to lengthen the step."""
STALL = 20
"""Iterations without progress after which the method gives up."""
SMALLEST_RATIO = 1e-13
"""Bound from below on ``rho s/a``: beyond it the factorisation sees only round-off of the inertia."""


@dataclass
class _Iterate:
    """Velocities ``v``, rays ``a`` and slacks ``s`` (both > 0), with the contact forces ``r = G a``."""

    v: FloatArray
    a: FloatArray
    s: FloatArray
    r: FloatArray


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
        run = _Run(problem, BodyMatrix(problem, self._graph), start)
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
            v = problem.body_velocity(best_point.r)
            balanced = measure(problem, v, best_point.r)
            if balanced.reached(self.options.tolerance):
                return self._result(v, best_point.r, iterations, balanced, clock)
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


class _Run:
    """One solve: the iterate and the work arrays."""

    def __init__(self, problem: ContactProblem, matrix: BodyMatrix, start: FloatArray | None) -> None:
        self.problem, self.matrix = problem, matrix
        self.rays = np.column_stack([np.ones(problem.n_contacts, dtype=bool), problem.mu > 0.0])
        self.count = int(self.rays.sum())
        self.smallest = SMALLEST_RATIO / problem.rho[:, None]
        shape = (problem.n_contacts, 2)
        self._d, self._u = np.empty((problem.n_contacts, 3)), np.empty(shape)
        self._mass = np.where(problem.free > 0.0, problem.mass, 0.0)
        self._load = problem.force * problem.free
        self.point = self._cold() if start is None else self._warm(starting_forces(problem, start))

    def residuals(self) -> Residuals:
        """Figures of the current iterate."""
        return measure(self.problem, self.point.v, self.point.r)

    def iterate(self) -> bool:
        """One predictor-corrector step; False if the matrix could not be factorised."""
        problem, old = self.problem, self.point
        a, s = old.a, old.s
        centre = float((a * s)[self.rays].sum()) / self.count
        ratio = s / a
        e = np.maximum(ratio, self.smallest)
        if not self._factorise(e):
            return False
        error_u = s - self._slacks(old.v, old.r)
        error_v = self._load + self._force(old.r) - self._mass * old.v

        def direction(
            target: FloatArray, error_u: FloatArray, error_v: FloatArray
        ) -> tuple[FloatArray, FloatArray, FloatArray]:
            z = error_u + target / a
            dv = self.matrix.solve(error_v + self._force(self._condense(e, z)))
            da = np.empty_like(a)
            contact_velocities(problem.bodies, problem.normal, problem.arms, dv, self._u)
            kernels.expand(problem.mu, problem.compliance, e, z, self._u, da)
            return dv, da, np.where(self.rays, target / a - ratio * da, 0.0)

        def reach(da: FloatArray, ds: FloatArray) -> float:
            return float(min(kernels.longest_step(problem.mu, a, s, da, ds)))

        product = a * s
        _, da, ds = direction(-product, error_u, error_v)
        step = reach(da, ds)
        ahead = float(((a + step * da) * (s + step * ds))[self.rays].sum()) / self.count
        sigma = max((max(ahead, 0.0) / centre) ** 3, 0.1 * (1.0 - step) ** 2)
        # The corrector assumes the full step. Where the predictor gets only a part of the way, its second-order term counts by
        # the square of that part; in full it makes the products cycle (Colombo & Gondzio 2008).
        dv, da, ds = direction(sigma * centre - product - step**2 * da * ds, error_u, error_v)
        step, goal = reach(da, ds), sigma * centre
        no_u, no_v = np.zeros_like(error_u), np.zeros_like(error_v)
        for _ in range(CORRECTORS):
            if step > ENOUGH:
                break
            # Products that a longer step would leave far from the goal are pulled towards it (Gondzio 1996).
            ahead_by = min(1.0, 1.5 * step + 0.1)
            wrong = (a + ahead_by * da) * (s + ahead_by * ds)
            target = np.maximum(np.clip(wrong, SPREAD * goal, goal / SPREAD) - wrong, -goal / SPREAD)
            extra = direction(np.where(self.rays, target, 0.0), no_u, no_v)
            longer = reach(da + extra[1], ds + extra[2])
            if longer <= WORTH * step:
                break
            step, dv, da, ds = longer, dv + extra[0], da + extra[1], ds + extra[2]
        # Close to the solution the full step is safe: the fraction to the boundary tends to 1 with the centring.
        step = min(1.0, min(max(0.995, 1.0 - sigma), CLOSEST) * step)
        new_a, new_s = a + step * da, s + step * ds
        self.point = _Iterate(old.v + step * dv, new_a, new_s, self._forces(new_a))
        return bool(np.isfinite(new_a).all() and np.isfinite(new_s).all())

    def _factorise(self, e: FloatArray) -> bool:
        problem = self.problem
        for _ in range(4):
            kernels.stiffness_blocks(problem.mu, problem.compliance, e, self._d)
            if self.matrix.factorise(self._d):
                return True
            self.smallest = 100.0 * self.smallest
            np.maximum(e, self.smallest, out=e)
        return False

    def _cold(self) -> _Iterate:
        """Least-squares estimate with ``s/a = W``, shifted into the interior (Mehrotra's start)."""
        problem = self.problem
        scale = problem.rho[:, None]
        e = np.repeat(1.0 / scale, 2, axis=1)
        self._factorise(e)
        zero = np.zeros((problem.n_contacts, 2))
        z = -self._slacks(np.zeros_like(problem.force), zero)
        v = self.matrix.solve(self._load + self._force(self._condense(e, z)))
        contact_velocities(problem.bodies, problem.normal, problem.arms, v, self._u)
        a = np.empty_like(z)
        kernels.expand(problem.mu, problem.compliance, e, z, self._u, a)
        s = self._slacks(v, self._forces(a))
        # In units of sqrt(energy) all contacts compare: a / sqrt(rho) and s sqrt(rho).
        a, s = a / np.sqrt(scale), s * np.sqrt(scale)
        a += max(0.0, -1.5 * float(a[self.rays].min()))
        s += max(0.0, -1.5 * float(s[self.rays].min()))
        product = float((a * s)[self.rays].sum())
        size = max(float(np.abs(a[self.rays]).max()), float(np.abs(s[self.rays]).max())) or 1.0
        a += 0.5 * product / max(float(s[self.rays].sum()), 1e-300) + 1e-3 * size
        s += 0.5 * product / max(float(a[self.rays].sum()), 1e-300) + 1e-3 * size
        return self._inside(v, a * np.sqrt(scale), s / np.sqrt(scale))

    def _warm(self, r: FloatArray) -> _Iterate:
        """Forces of a neighbouring problem, with rays and slacks lifted to a common small product."""
        problem = self.problem
        scale = np.sqrt(problem.rho)[:, None]
        v = problem.body_velocity(r)
        mu = np.where(problem.mu > 0.0, problem.mu, 1.0)
        a = 0.5 * np.column_stack([r[:, 0] + r[:, 1] / mu, r[:, 0] - r[:, 1] / mu])
        a[:, 0] = np.where(problem.mu > 0.0, a[:, 0], r[:, 0])
        s = self._slacks(v, r)
        a, s = a / scale, s * scale
        wrong = np.minimum(a, s)[self.rays]
        lift = max(float(np.sqrt((wrong * wrong).mean())), 1e-6 * float(np.abs(a[self.rays]).max()), 1e-300)
        return self._inside(v, np.maximum(a, lift) * scale, np.maximum(s, lift) / scale)

    def _inside(self, v: FloatArray, a: FloatArray, s: FloatArray) -> _Iterate:
        a, s = np.where(self.rays, a, 1.0), np.where(self.rays, s, 1.0)
        return _Iterate(v, a, s, self._forces(a))

    def _slacks(self, v: FloatArray, r: FloatArray) -> FloatArray:
        s = np.empty_like(r)
        kernels.ray_slacks(self.problem.mu, self.problem.contact_velocity(v, r), s)
        return s

    def _forces(self, a: FloatArray) -> FloatArray:
        r = np.empty_like(a)
        kernels.forces_of_rays(self.problem.mu, a, r)
        return r

    def _condense(self, e: FloatArray, z: FloatArray) -> FloatArray:
        r = np.empty_like(z)
        kernels.condense(self.problem.mu, self.problem.compliance, e, z, r)
        return r

    def _force(self, r: FloatArray) -> FloatArray:
        problem = self.problem
        out = np.empty_like(problem.force)
        contact_forces_on_bodies(problem.bodies, problem.normal, problem.arms, problem.free, r, out)
        return out
