"""Interior-point method for Coulomb's law: its complementarity conditions in two dimensions, followed along their central path.

Without dilation the conditions of a contact are linear but for products of two numbers that are not negative::

    u_n = y_0,   u_t = y_1 - y_2,        x = (p, mu p + q, mu p - q) >= 0,   y >= 0,   x y = 0

(y_1 and y_2 are the slip either way). They are no program: nothing is minimised, and no theory promises convergence. Newton's method
on ``x y = tau`` with tau falling to 0 converges all the same, given three safeguards (see `_Run.iterate`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.coulomb_shift import ShiftedPath
from ninedisk.core.cd.solvers.factorise import UnsymmetricMatrix, times
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError, check_feasible
from ninedisk.core.cd.solvers.gauss_seidel import starting_forces
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult, Stopwatch, not_converged
from ninedisk.core.cd.solvers.polish import Polish
from ninedisk.core.errors import SolverNotConvergedError

MAX_ITERATIONS = 5_000
"""Factorisations."""
STALL = 40
"""Iterations without progress after which a path is left."""
PATHS_SHARE = 0.25
"""Of the time left, for `ShiftedPath`: it arrives soon or not at all, and then the law's own path, though slower, gets closer."""
FIRST_FORCE = 10.0
"""Forces at the start, over those that would stop the fastest approach of two bodies."""
PIVOTS = 400
"""Pivots that the polish of a path's end may take."""
CENTRAL = 1e-3
"""No product falls below this fraction of their mean."""
BACK = 0.8
"""Factor by which a step that leaves the neighbourhood of the path is shortened."""
LAG = 0.1
"""Relative error of the contact velocities over relative mean product from which on the path is not followed further down."""
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e-13, 1e2
"""Compliance that holds the forces near those of the last iterate, over ``1/rho``."""
SHORT, LONG = 0.1, 0.5
"""Steps shorter than the first call for more damping, steps longer than the second for less."""
WORTH_CORRECTING = 0.3
"""Predicted steps from this length on are corrected to second order."""
MORE, LESS = 10.0, 0.2
"""Factors of the damping then."""
ATTEMPTS = 4
"""Factorisations tried, with ever more damping."""


class CoulombInteriorPoint:
    """Solver of Coulomb's law.

    Parameters
    ----------
    options : SolverOptions, optional
    """

    def __init__(self, options: SolverOptions | None = None) -> None:
        self.options = options or SolverOptions()

    def solve(self, problem: ContactProblem) -> SolverResult:
        """Solve the problem, from nothing.

        Where nothing slides, the solution of the associated rule is the one. Else `ShiftedPath` is followed and, where that stalls,
        the law's own path; the end of each is polished. All factorisations count as iterations.

        Returns
        -------
        SolverResult

        Raises
        ------
        SolverNotConvergedError
            At the iteration or time limit or where no more progress is made, with the figures reached.
        InfeasibleContactsError
            If no motion satisfies the contacts.
        """
        search = _Search(problem, self.options)
        # Where no contact force is needed, every iterate would be infinitely far off relative to the solution 0.
        none = np.zeros((problem.n_contacts, 2))
        search.judge(problem.body_velocity(none), none)
        if not search.over(STALL):
            search.try_associated()
        if not search.over(STALL):
            matrix = UnsymmetricMatrix(problem)
            search.follow(ShiftedPath(problem, matrix), share=PATHS_SHARE)
            search.polish()
            search.follow(_Run(problem, matrix), share=1.0)
            search.polish()
        return search.result()


class _Search:
    """The best point found, and whether to go on."""

    def __init__(self, problem: ContactProblem, options: SolverOptions) -> None:
        self.problem, self.options, self.clock = problem, options, Stopwatch(options.time_limit)
        self.limit = options.max_iterations or MAX_ITERATIONS
        self.iterations, self.since = 0, 0
        self._lowest = np.array([np.inf, np.inf])

    def judge(self, v: FloatArray, r: FloatArray) -> None:
        """Take note of a point."""
        now = measure(self.problem, v, r, sliding="coulomb")
        figures = np.array([now.natural_map, now.duality_gap])
        if not self.iterations:
            self.best, self.v, self.r = now, v, r
            return
        # Either figure counts as progress, but not that of no forces at all, whose gap is none.
        self.since = 0 if (figures < 0.9 * self._lowest).any() else self.since + 1
        self._lowest = np.minimum(self._lowest, figures)
        if now.worst < self.best.worst or now.reached(self.options.tolerance):
            self.best, self.v, self.r = now, v, r

    def try_associated(self) -> None:
        """Where nothing slides, the solution of the associated rule is one of Coulomb's law, and far cheaper to find."""
        try:
            found = InteriorPoint(replace(self.options, time_limit=self.clock.left)).solve(self.problem)
        except (SolverNotConvergedError, InfeasibleContactsError):
            return
        now = measure(self.problem, found.v, found.r, sliding="coulomb")
        if now.reached(self.options.tolerance):
            self.best, self.v, self.r, self.iterations = now, found.v, found.r, found.iterations

    def follow(self, run: ShiftedPath | _Run, *, share: float) -> None:
        """Iterate for a share of the time left, until the search is over or ``run`` makes no more progress; the next one starts afresh."""
        self.since, self._lowest = 0, np.array([np.inf, np.inf])
        for_others = (1.0 - share) * self.clock.left
        while not self.over(STALL) and self.clock.left >= for_others and run.iterate():
            self.iterations += 1
            self.judge(run.v.reshape(-1, 3), starting_forces(self.problem, run.r))

    def polish(self) -> None:
        """Make the best forces exact, if that is possible."""
        if self.over(self.limit):
            return
        polish = Polish(self.problem, self.options.tolerance, self.clock)
        exact = polish.improve(self.r, PIVOTS)
        self.iterations += polish.count
        if exact is not None:
            self.best, self.r = exact[1], exact[0]
            self.v = self.problem.body_velocity(self.r)

    def over(self, stall: int) -> bool:
        """Whether the tolerance or a limit is reached, or ``stall`` points brought no progress."""
        done = self.best.reached(self.options.tolerance)
        return done or self.iterations >= self.limit or self.since >= stall or self.clock.over

    def result(self) -> SolverResult:
        """The result, or the error that says how far it got."""
        if not self.best.reached(self.options.tolerance):
            check_feasible(self.problem, sliding="coulomb", seconds=self.options.time_limit)
            not_converged(
                "interior-point",
                self.options,
                self.iterations,
                self.best,
                self.clock,
                "Coulomb's law need not have a solution that it finds: use gauss-seidel, loosen the tolerance, or raise "
                "max_iterations or time_limit.",
            )
        # As in the convex case: the velocities that follow from the forces, unless they lose the accuracy (static limit).
        v = self.problem.body_velocity(self.r)
        balanced = measure(self.problem, v, self.r, sliding="coulomb")
        exact = balanced.reached(self.options.tolerance)
        return SolverResult(
            solver="interior-point",
            sliding="coulomb",
            v=v if exact else self.v,
            r=self.r,
            iterations=self.iterations,
            residuals=balanced if exact else self.best,
            seconds=self.clock.seconds,
        )


class _Run:
    """One solve: velocities ``v``, forces ``r``, and the pairs ``x``, ``y`` of every contact; smooth contacts have the first one only."""

    def __init__(self, problem: ContactProblem, matrix: UnsymmetricMatrix) -> None:
        self.problem, self.matrix = problem, matrix
        rough = problem.mu > 0.0
        self.live = np.column_stack([np.ones_like(rough), rough, rough])
        self.count = int(self.live.sum())
        self.speed = float(np.abs(problem.b[:, 0]).max())
        self._mass = np.where(problem.free > 0.0, problem.mass, 0.0).ravel()
        self._load = (problem.force * problem.free).ravel()
        self.v = np.zeros(3 * problem.n_bodies)
        p = FIRST_FORCE * self.speed * problem.rho
        self.r = np.column_stack([p, np.zeros_like(p)])
        self.x = np.where(self.live, self._margins(self.r), 1.0)
        self.y = np.where(self.live, self.speed, 1.0)
        self.first = self._mean(self.x, self.y)
        self.damping = FIRST_DAMPING

    def iterate(self) -> bool:
        """One predictor-corrector step; False if the matrix could not be factorised.

        Three safeguards make up for the missing monotony. Where the contact velocities lag behind the products, these are held:
        a path that is left at large errors ends at the boundary. A compliance that acts on the change of the forces only, so
        that the solution does not know it, shortens the steps; it grows while steps are cut. And no product falls far below
        the others.
        """
        x, y = self.x, self.y
        ratio = np.where(self.live, y / x, 0.0)
        d = self._factorise(ratio)
        if d is None:
            return False
        error_u = self._error_u()
        error_v = self._load + self.matrix.h.T @ self.r.ravel() - self._mass * self.v

        def direction(target: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
            k = np.where(self.live, target / x - y, 0.0)
            b = error_u + _velocities(k)
            dv = self.matrix.solve(error_v + self.matrix.h.T @ times(d, b).ravel())
            dr = times(d, b - (self.matrix.h @ dv).reshape(-1, 2))
            dx = np.where(self.live, self._margins(dr), 0.0)
            return dv, dr, dx, k - ratio * dx

        mean = self._mean(x, y)
        _, _, dx, dy = direction(np.zeros_like(x))
        step = self._reach(dx, dy)
        sigma = max((max(self._mean(x + step * dx, y + step * dy), 0.0) / mean) ** 3, 1e-4)
        if step < SHORT:
            sigma = max(sigma, 0.8)
        lag = float(np.sqrt((error_u * error_u).sum() / len(error_u))) / self.speed
        if lag > LAG * mean / self.first:
            sigma = 1.0
        # The corrector assumes the full step; after a short one it would be wrong by more than it mends.
        second = dx * dy if step >= WORTH_CORRECTING else np.zeros_like(x)
        dv, dr, dx, dy = direction(sigma * mean - second)
        step = max(0.9, 1.0 - mean / self.first) * self._reach(dx, dy)
        for _ in range(12):
            products = (x + step * dx) * (y + step * dy)
            if products[self.live].min() >= CENTRAL * products[self.live].mean():
                break
            step *= BACK
        self.v, self.r = self.v + step * dv, self.r + step * dr
        self.x, self.y = x + step * dx, y + step * dy
        if step < SHORT:
            self.damping = min(self.damping * MORE, MOST_DAMPING)
        elif step > LONG:
            self.damping = max(self.damping * LESS, LEAST_DAMPING)
        return bool(np.isfinite(self.x).all() and np.isfinite(self.y).all())

    def _factorise(self, ratio: FloatArray) -> FloatArray | None:
        """Factorise with ``D``, shape (c, 2, 2), the change of the forces per change of the contact velocities; None if impossible."""
        problem, rough = self.problem, self.live[:, 1]
        across = ratio[:, 1] + ratio[:, 2]
        for _ in range(ATTEMPTS):
            compliance = problem.compliance + (self.damping / problem.rho)[:, None]
            d = np.zeros((problem.n_contacts, 2, 2))
            d[:, 0, 0] = 1.0 / (ratio[:, 0] + compliance[:, 0])
            d[:, 1, 1] = np.where(rough, 1.0 / np.where(rough, across + compliance[:, 1], 1.0), 0.0)
            d[:, 1, 0] = -problem.mu * (ratio[:, 1] - ratio[:, 2]) * d[:, 0, 0] * d[:, 1, 1]
            if self.matrix.factorise(d):
                return d
            self.damping *= 100.0
        return None

    def _margins(self, r: FloatArray) -> FloatArray:
        p, q, mu = r[:, 0], r[:, 1], self.problem.mu
        return np.column_stack([p, mu * p + q, mu * p - q])

    def _error_u(self) -> FloatArray:
        """What the slacks have beyond the contact velocities."""
        u = self.problem.contact_velocity(self.v.reshape(-1, 3), self.r)
        return np.where(self.live[:, :2], _velocities(np.where(self.live, self.y, 0.0)) - u, 0.0)

    def _mean(self, x: FloatArray, y: FloatArray) -> float:
        return float((x * y)[self.live].sum()) / self.count

    def _reach(self, dx: FloatArray, dy: FloatArray) -> float:
        """Largest step up to 1 that keeps both factors of every product."""
        falling = [-z[dz < 0.0] / dz[dz < 0.0] for z, dz in ((self.x, dx), (self.y, dy))]
        return min(1.0, *(float(each.min()) for each in falling if each.size), 1.0)


def _velocities(y: FloatArray) -> FloatArray:
    """Contact velocities of slacks, shape (c, 3): ``(y_0, y_1 - y_2)``."""
    return np.column_stack([y[:, 0], y[:, 1] - y[:, 2]])
