"""Proximal points for Coulomb's law: rigid packings that flow, solved as a sequence of problems that are a little elastic.

With compliance the law is easy: Newton's method on its statuses, or a path of few pivots, solves it. So each point solves

    F_k(z) = W P(z) + b + s/rho (P(z) - r_k) - (P(z) - z)/rho = 0,      r_{k+1} = P(z),

whose compliances ``s``, one for each contact, act on the change of the forces alone: where they stop changing they solve the rigid law. An
error along an eigenvalue ``lambda`` of the law shrinks by ``s/(s + lambda)``. For a convex program all eigenvalues are positive and it
never grows [Rockafellar 1976, Monotone operators and the proximal point algorithm, SIAM J. Control Optim. 14]. Sliding without dilation
makes some negative: along them errors grow if ``-2 s < lambda < 0``. So ``s`` is lowered as long as points are found, and raised where one
is not. The forces wander past solutions until `Polish` gets hold of one.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Residuals, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError, check_feasible
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult, Stopwatch, not_converged
from ninedisk.core.cd.solvers.polish import SOFT, LawPoint, Polish, norm, statuses
from ninedisk.core.cd.solvers.polish_kernels import keep_alike
from ninedisk.core.errors import SolverNotConvergedError

MAX_ITERATIONS, EACH = 50_000, 50
"""Factorisations and pivots, and those for each contact where that is more: one pyramid of 1,000 disks took 54,000."""
FIRST_SOFT, MOST_SOFT = 1e-2, 1.0
"""Compliance over ``1/rho``: at the first every packing tried is solved by some five steps of Newton's method."""
LOWER, RAISE, LEAST_RAISED = 0.8, 10.0, 1e-3
"""Of the compliances once a point is found, and of those that were in its path, with what they get at least: see `_PointSequence`."""
ALIKE, ALL_ALIKE = 0.85, 1.0
"""Least ratio of the compliances of two contacts of one body, in the walk from the forces given and in that from the associated rule's."""
RAISES = 8
"""Times that compliances are raised for one point."""
NEWTON = 12
"""Steps of Newton's method before the path is followed."""
WRONG, HOPELESS = 8, 12
"""Statuses that a step of Newton's method changes: up to so many, and they cycle in a few places while all others are right, the path
begins there and not where the error is least; of more than so many, one path in four found its end, after 23 pivots."""
SHORTEST = 1e-3
"""Part of a step of Newton's method below which it is given up."""
PIVOTS = 30
"""Of a path whose end is a point: more cost more than to try again with more compliance."""
SOLVED = 1e-13
"""Error of a point, over the first forces."""
NEARER = 0.1
"""Natural map over that at the last polish from which on the next one is worth its pivots."""
SLICE, SLICE_NEAR = (2_000, 2.0), (1_000, 0.2)
"""Iterations from one start before the other has its turn, the first time, and those for each contact where that is more; which of the two
converges cannot be foreseen. And those from forces near a solution: most steps of a flow are solved in some hundred, so that a walk which
takes more has gone astray, and begins anew at each turn."""
ASSOCIATED = 1e-8
"""Tolerance of the associated rule's forces, at most."""
POLISH_PIVOTS, POLISH_AGAIN = 30, 100
"""Of a polish; points after which the next one is not held against those before."""


class ProximalPoint:
    """Solver of Coulomb's law.

    Parameters
    ----------
    options : SolverOptions, optional
    """

    def __init__(self, options: SolverOptions | None = None) -> None:
        self.options = options or SolverOptions()

    def solve(self, problem: ContactProblem, start: FloatArray | None = None, *, near: bool = False) -> SolverResult:
        """Solve the problem, from ``start``, and where that takes long from the forces of the associated rule in turns with it.

        Where nothing slides, the solution of the associated rule is the one. Factorisations, pivots and iterations of the associated
        rule count as iterations.

        Parameters
        ----------
        problem : ContactProblem
        start : ndarray, shape (c, 2), optional
            Forces inside the cones to begin from; None: those of the associated rule alone.
        near : bool
            Whether these are near a solution, as those of a step before.

        Returns
        -------
        SolverResult

        Raises
        ------
        SolverNotConvergedError
            At the iteration or time limit, with the figures reached.
        InfeasibleContactsError
            If no motion satisfies the contacts.
        """
        search = _Search(problem, self.options)
        none = np.zeros((problem.n_contacts, 2))
        # Where no contact force is needed, every other one would be infinitely far off relative to the solution 0.
        if not search.judge(none) and not search.over:
            walks = [] if start is None else [_PointSequence(search, start, ALIKE)]
            least, each = SLICE_NEAR if near else SLICE
            slices = max(least, round(each * problem.n_contacts))
            for walk in walks:
                walk.advance(search.iterations + slices)
            # The associated rule costs as much as some hundred factorisations, which a start near a solution may not need.
            other = None if search.over else search.associated()
            if not search.over and not (walks and other is None):
                walks.insert(0, _PointSequence(search, none if other is None else other, ALL_ALIKE))
            while not search.over:
                for walk in walks:
                    if near:
                        walk.initialise()
                    walk.advance(search.iterations + slices)
                slices *= 2
        return search.result()


class _Search:
    """The best forces found, and the way on from any."""

    def __init__(self, problem: ContactProblem, options: SolverOptions) -> None:
        self.problem, self.options, self.clock = problem, options, Stopwatch(options.time_limit)
        self.solver, self.others = "proximal-point", 0
        self.law = Polish(problem, options.tolerance, self.clock)
        self.least = self.law.soft
        self.best: tuple[FloatArray, Residuals] | None = None
        self.most = options.max_iterations or max(MAX_ITERATIONS, EACH * problem.n_contacts)

    @property
    def found(self) -> bool:
        """Whether the best forces reach the tolerance."""
        return self.best is not None and self.best[1].reached(self.options.tolerance)

    @property
    def iterations(self) -> int:
        """All factorisations, pivots and points so far."""
        return self.others + self.law.count

    @property
    def over(self) -> bool:
        """Whether the forces are found or a limit is reached."""
        return self.found or self.clock.over or self.iterations >= self.most

    def judge(self, r: FloatArray) -> bool:
        """Take note of forces; whether they reach the tolerance."""
        now = measure(self.problem, self.problem.body_velocity(r), r, sliding="coulomb")
        if self.best is None or now.worst < self.best[1].worst or now.reached(self.options.tolerance):
            self.best = (r, now)
        self.natural_map = now.natural_map
        return self.found

    def associated(self) -> FloatArray | None:
        """Forces of the associated rule: Coulomb's law where nothing slides; where something does, its statuses are often the law's."""
        # However loose the law's own tolerance: a walk from forces found to 1e-3 did not converge, from those found to 1e-8 soon.
        options = replace(
            self.options, tolerance=min(self.options.tolerance, ASSOCIATED), time_limit=self.clock.remaining
        )
        try:
            found = InteriorPoint(options).solve(self.problem)
        except (SolverNotConvergedError, InfeasibleContactsError):
            return None
        self.others += found.iterations
        if self.judge(found.r) or self.polish(found.r, 0):
            self.solver = "interior-point"
        return found.r

    def polish(self, r: FloatArray, pivots: int) -> bool:
        """Whether the forces can be made exact."""
        self.law.soft = self.least
        if not self.over and (exact := self.law.improve(r, pivots, paths=1)):
            self.best = exact
        elif self.best and self.law.best and self.law.best[1].worst < self.best[1].worst:
            self.best = self.law.best
        return self.found

    def result(self) -> SolverResult:
        """The result, or the error that says how far it got."""
        assert self.best is not None
        if not self.found:
            check_feasible(self.problem, sliding="coulomb", seconds=self.options.time_limit)
            not_converged(
                self.solver,
                self.options,
                self.iterations,
                self.best,
                self.clock,
                "Coulomb's law need not have a solution that it finds: use gauss-seidel, loosen the tolerance, or raise "
                "max_iterations or time_limit.",
            )
        r, residuals = self.best
        return SolverResult(
            solver=self.solver,
            sliding="coulomb",
            v=self.problem.body_velocity(r),
            r=r,
            iterations=self.iterations,
            residuals=residuals,
            seconds=self.clock.seconds,
        )


class _Newton(NamedTuple):
    """How Newton's method ended.

    Attributes
    ----------
    point : LawPoint
        The solution, or where a path may begin.
    wrong : int
        Statuses that are wrong at the point with fewest.
    changing : ndarray of bool, shape (c,)
        Contacts whose status the last two steps changed; all, before there were two.
    """

    point: LawPoint
    wrong: int
    changing: NDArray[np.bool_]


class _PointSequence:
    """Proximal points from some forces on, until the search is over; near solutions with a polish.

    Where a point is not found, Newton's method cycles over few statuses. The compliance is raised there until it is found, so that all
    other places go on, and less and less around: no contact has less than ``alike`` times that of another one at the same body. Compliances
    scale the rows of the law, and a matrix whose eigenvalues all have positive real parts need not keep that under a scaling (it is stable,
    but not D-stable). Regular piles with more forces than balances are not solved where compliances differ much from one contact to the
    next, the hardest of them only with one compliance for all.
    """

    def __init__(self, search: _Search, r: FloatArray, alike: float) -> None:
        self.search, self.law, self.problem, self.alike = search, search.law, search.problem, alike
        rho = self.problem.rho[:, None]
        self.z = r - rho * self.law.velocity(r)
        self.size = max(norm(r), norm(rho * self.problem.b) * 1e-3)
        self.points = 0
        self.initialise()

    def initialise(self) -> None:
        """Take the first compliance, at the forces as they are."""
        self.soft, self.nearest = np.full(self.problem.n_contacts, FIRST_SOFT), np.inf

    def advance(self, limit: int) -> None:
        """Point by point until the search is over or has taken ``limit`` iterations."""
        search = self.search
        while not search.over and search.iterations < limit:
            r = self.law.inside(self.z, statuses(self.problem, self.z))
            if search.judge(r):
                return
            if search.natural_map < NEARER * self.nearest:
                # The first forces are those of another method, which has polished them.
                self.nearest = search.natural_map
                if self.points and search.polish(r, POLISH_PIVOTS):
                    return
            self._next(r)
            self.points += 1
            search.others += 1  # a point that costs no factorisation ends a search that goes nowhere, too
            if self.points % POLISH_AGAIN == 0:
                self.nearest = np.inf

    def _next(self, held: FloatArray) -> None:
        """To the next proximal point of the forces ``held``, with more compliance where it is not found."""
        for _ in range(RAISES):
            self.law.soft = self.soft
            z, changing = self._point(held)
            if z is not None:
                self.z, self.soft = z, np.maximum(LOWER * self.soft, SOFT)
                return
            if self.search.over:
                return
            self._raise_compliance(changing)

    def _point(self, held: FloatArray) -> tuple[FloatArray | None, NDArray[np.bool_]]:
        """The proximal point, shape (c, 2), or None and the contacts at which it is missed."""
        law = self.law
        newton = self._newton(law.at(self.z, held), held)
        point = newton.point
        if point.size < SOLVED * self.size:
            return point.z, newton.changing
        ended = law.path(point.z, point.error, PIVOTS) if newton.wrong <= HOPELESS else None
        if ended is None:
            return None, newton.changing
        r = ended[0]
        return r - self.problem.rho[:, None] * law.velocity(r) - self.soft[:, None] * (r - held), newton.changing

    def _raise_compliance(self, changing: NDArray[np.bool_]) -> None:
        """More compliance at the contacts that are ``changing`` and, less and less, at those around them."""
        there = np.clip(RAISE * self.soft, LEAST_RAISED, MOST_SOFT)
        self.soft = np.where(changing, there, self.soft)
        keep_alike(self.problem.bodies, self.alike, self.soft, np.zeros(self.problem.n_bodies))

    def _newton(self, point: LawPoint, held: FloatArray) -> _Newton:
        """Newton's method on the statuses.

        Wrong are those that the step to a point has changed: with all others its linear equations are solved. Where these are few the
        path begins at the last point that has fewest, else where the error is least.

        The first step is taken whole: it changes many statuses at once, and the error that it raises the next steps take away. Halved
        until it lessened the error, proximal points took up to twice the factorisations and pivots. A later step is halved as long as the
        error would be above the largest of the first two.
        """
        law, rho, least, most = self.law, self.problem.rho[:, None], point, point.size
        fewest, wrong = point, len(point.status)
        changing = before = np.ones(len(point.status), dtype=bool)
        for step in range(NEWTON):
            if least.size < SOLVED * self.size or self.search.over or not law.factorise(point.status):
                break
            dr = law.change(point.u)
            full = point.r - dr - rho * law.remaining(point.u, dr) - point.z
            part, tried = 1.0, law.at(point.z + full, held)
            before, changing = changing, tried.status != point.status
            changed = int(changing.sum())
            if step == 0:
                most = max(most, tried.size)
            elif changed <= wrong and isfinite(tried.size):
                fewest, wrong = tried, changed
            while not tried.size <= most and part >= SHORTEST:  # nor where it is no number
                part *= 0.5
                tried = law.at(point.z + part * full, held)
            if part < SHORTEST:
                break
            point = tried
            if point.size < least.size:
                least = point
        begin = fewest if wrong <= WRONG and least.size >= SOLVED * self.size else least
        return _Newton(begin, wrong, changing | before)
