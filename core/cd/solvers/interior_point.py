"""Primal-dual interior-point method for the associated rule (Mehrotra's predictor-corrector, body-space matrix)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Residuals, measure
from ninedisk.core.cd.problem_kernels import contact_forces_on_bodies
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import interior_point_kernels as kernels
from ninedisk.core.cd.solvers.factorise import BodyGraph, BodyMatrix
from ninedisk.core.cd.solvers.feasibility import check_feasible
from ninedisk.core.cd.solvers.gauss_seidel import starting_forces
from ninedisk.core.cd.solvers.outcome import SolverResult, Stopwatch, not_converged

MAX_ITERATIONS = 200
STALL = 20
"""Iterations without progress after which the method gives up."""
REFINEMENTS = 3
"""Corrections of the forces, at most, after which momentum is balanced as well as round-off allows."""


CLOSEST = 1.0 - 1e-7
"""Largest fraction of the way to the boundary, so that rays and slacks stay positive."""
STIFFNESS = 100.0
"""Of the springs, over the inverse of a contact's own compliance, whose forces the method starts from. Springs about as soft as
the bodies spread a load over a few layers only, and forces that have to grow with the depth of a packing cost an iteration a
layer; much stiffer ones find forces of both signs that are larger than the solution's."""
BOLDNESS = 0.2
"""Products to go for, in units of Mehrotra's cube rule: correctors make up for a goal that a single step would miss."""
CORRECTORS = 8
"""Centrality correctors of an iteration, at most: a solve each, a small part of a factorisation."""
WEIGHTS = (0.0, 0.1, 0.3, 1.0)
"""Of the second-order corrector: the one with the longest step is taken. In full it assumes the full step, and makes products
cycle where the predictor gets only a part of the way (Colombo & Gondzio 2008)."""
ENOUGH = 0.95
"""Step length that needs no corrector."""
SPREAD = 0.1
"""Products between this fraction of the goal and its inverse count as central."""
WORTH = 1.02
"""Factor by which a corrector has to lengthen the step."""
SMALLEST_RATIO = 1e-13
"""Bound from below on ``rho s/a``: beyond it the factorisation sees only round-off of the inertia."""


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
        if self._graph is None or not self._graph.fits(problem):
            self._graph = BodyGraph(problem.n_bodies, problem.bodies)
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
            (best_point.r, best),
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


@dataclass
class Iterate:
    """Velocities ``v``, rays ``a`` and slacks ``s`` (both > 0), with the contact forces ``r = G a``."""

    v: FloatArray
    a: FloatArray
    s: FloatArray
    r: FloatArray


class _Direction:
    """Changes of velocities, rays and slacks."""

    def __init__(self, bodies: int, contacts: int) -> None:
        self.v, self.a, self.s = np.zeros((bodies, 3)), np.zeros((contacts, 2)), np.zeros((contacts, 2))

    def add(self, other: _Direction, weight: float = 1.0) -> None:
        self.v += weight * other.v
        self.a += weight * other.a
        self.s += weight * other.s


class Run:
    """One solve: the iterate and the work arrays.

    Parameters
    ----------
    problem : ContactProblem
    matrix : BodyMatrix
    start : ndarray, shape (c, 2), optional
        Contact forces of a neighbouring problem.
    """

    def __init__(self, problem: ContactProblem, matrix: BodyMatrix, start: FloatArray | None) -> None:
        self.problem, self.matrix = problem, matrix
        bodies, contacts = problem.n_bodies, problem.n_contacts
        self.rays = np.column_stack([np.ones(contacts, dtype=bool), problem.mu > 0.0])
        self.smallest = SMALLEST_RATIO / problem.rho[:, None]
        self._mass = np.where(problem.free > 0.0, problem.mass, 0.0)
        self._given = problem.force * problem.free
        self._d, self._z, self._target = np.empty((contacts, 3)), np.empty((contacts, 2)), np.empty((contacts, 2))
        self._load = np.empty((bodies, 3))
        self._step, self._second, self._extra = (_Direction(bodies, contacts) for _ in range(3))
        self._none = _Direction(bodies, contacts)
        self._e = np.ones((contacts, 2))
        self.point = self._cold() if start is None else self._warm(starting_forces(problem, start))

    def residuals(self) -> Residuals:
        """Figures of the current iterate."""
        return measure(self.problem, self.point.v, self.point.r)

    def iterate(self) -> bool:
        """One step with a predictor and correctors; False if the matrix could not be factorised.

        The goal for the products is bolder than Mehrotra's: the steps that the correctors find are long all the same.
        """
        mu, old, none = self.problem.mu, self.point, self._none
        a, s, step, second, extra = old.a, old.s, self._step, self._second, self._extra
        ratio = s / a
        if not self._factorise(np.maximum(ratio, self.smallest)):
            return False
        error_u, error_v = s - self._slacks(old.v, old.r), self._error_v(old)
        self._solve(step, -a * s, a, ratio, error_u, error_v)
        predicted = kernels.longest_step(mu, a, s, step.a, step.s, none.a, none.s, 0.0)
        centre = kernels.mean_product(mu, a, s, step.a, step.s, 0.0)
        ahead = kernels.mean_product(mu, a, s, step.a, step.s, predicted)
        sigma = BOLDNESS * max((max(ahead, 0.0) / centre) ** 3, 0.1 * (1.0 - predicted) ** 2)
        goal = sigma * centre
        self._solve(second, -step.a * step.s, a, ratio, none.a, none.v)
        self._solve(extra, np.full_like(a, goal), a, ratio, none.a, none.v)
        step.add(extra)
        length, weight = max(
            (kernels.longest_step(mu, a, s, step.a, step.s, second.a, second.s, weight), weight) for weight in WEIGHTS
        )
        step.add(second, weight)
        for _ in range(CORRECTORS):
            if length > ENOUGH:
                break
            # Products that a longer step would leave far from the goal are pulled towards it (Gondzio 1996).
            further = min(1.0, 1.5 * length + 0.1)
            kernels.pull_to_centre(mu, a, s, step.a, step.s, further, goal, SPREAD, self._target)
            self._solve(extra, self._target, a, ratio, none.a, none.v)
            longer = kernels.longest_step(mu, a, s, step.a, step.s, extra.a, extra.s, 1.0)
            if longer <= WORTH * length:
                break
            length = longer
            step.add(extra)
        # Close to the solution the full step is safe: the fraction to the boundary tends to 1 with the centring.
        length = min(1.0, min(max(0.995, 1.0 - sigma), CLOSEST) * length)
        new_a, new_s = a + length * step.a, s + length * step.s
        self.point = Iterate(old.v + length * step.v, new_a, new_s, self._forces(new_a))
        return bool(np.isfinite(new_a).all() and np.isfinite(new_s).all())

    def refine(self) -> None:
        """Balance momentum to round-off with the last factorisation.

        Large changes of the forces are differences of like numbers, ``da = E^-1 (z - G' du)`` with ``E`` tending to 0: what
        they leave of the balance is as small as the changes were, but not round-off of the forces. Its own correction is small
        and thus accurate.
        """
        old, change = self.point, self._extra
        none = self._none.a
        self._solve(change, none, old.a, none, none, self._error_v(old))
        a = np.maximum(old.a + change.a, 0.5 * old.a)
        self.point = Iterate(old.v + change.v, a, old.s, self._forces(a))

    def _solve(
        self,
        out: _Direction,
        target: FloatArray,
        a: FloatArray,
        ratio: FloatArray,
        error_u: FloatArray,
        error_v: FloatArray,
    ) -> None:
        """Newton step to the products ``a s + target`` that mends the errors given, with the last factorisation."""
        contacts, free = self.problem.contacts, self.problem.free
        kernels.load_of_target(contacts, free, self._e, a, error_u, error_v, target, self._z, self._load)
        out.v = self.matrix.solve(self._load)
        kernels.changes_of_rays(contacts, self._e, a, ratio, self._z, target, out.v, out.a, out.s)

    def _factorise(self, e: FloatArray) -> bool:
        problem = self.problem
        for _ in range(4):
            kernels.stiffness_blocks(problem.mu, problem.compliance, e, self._d)
            if self.matrix.factorise(self._d):
                self._e = e
                return True
            self.smallest = 100.0 * self.smallest
            e = np.maximum(e, self.smallest)
        return False

    def _cold(self) -> Iterate:
        """Least-squares estimate with springs, shifted into the interior (Mehrotra's start)."""
        problem = self.problem
        scale = problem.rho[:, None]
        self._factorise(np.repeat(1.0 / (STIFFNESS * scale), 2, axis=1))
        rest = np.zeros((problem.n_bodies, 3))
        zero = np.zeros((problem.n_contacts, 2))
        guess = self._step
        self._solve(guess, zero, np.ones_like(zero), zero, -self._slacks(rest, zero), self._given)
        v, a = guess.v, guess.a
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

    def _warm(self, r: FloatArray) -> Iterate:
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

    def _inside(self, v: FloatArray, a: FloatArray, s: FloatArray) -> Iterate:
        a, s = np.where(self.rays, a, 1.0), np.where(self.rays, s, 1.0)
        return Iterate(v, a, s, self._forces(a))

    def _slacks(self, v: FloatArray, r: FloatArray) -> FloatArray:
        s = np.empty_like(r)
        kernels.ray_slacks(self.problem.mu, self.problem.contact_velocity(v, r), s)
        return s

    def _forces(self, a: FloatArray) -> FloatArray:
        r = np.empty_like(a)
        kernels.forces_of_rays(self.problem.mu, a, r)
        return r

    def _error_v(self, point: Iterate) -> FloatArray:
        """Error of the balance of momentum, ``f + H' r - M v``."""
        problem = self.problem
        out = np.empty_like(problem.force)
        contact_forces_on_bodies(problem.bodies, problem.normal, problem.arms, problem.free, point.r, out)
        out += self._given - self._mass * point.v
        return out
