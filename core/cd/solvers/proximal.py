"""Proximal points for Coulomb's law: rigid packings that flow, solved as a sequence of problems that are a little elastic.

With compliance the law is easy: Newton's method on its statuses, or a path of few pivots, solves it. So each step solves

    F_k(z) = W P(z) + b + s/rho (P(z) - r_k) - (P(z) - z)/rho = 0,      r_{k+1} = P(z),

whose compliances ``s``, one for each contact, act on the change of the forces alone: where they stop changing they solve the rigid law. An
error along an eigenvalue ``lambda`` of the law shrinks by ``s/(s + lambda)``. For a convex program all eigenvalues are positive and it
never grows [Rockafellar 1976, Monotone operators and the proximal point algorithm, SIAM J. Control Optim. 14]. Sliding without dilation
makes some negative: along them errors grow if ``-2 s < lambda < 0``. So ``s`` is lowered as long as steps are solved, and raised where they
are not: where contacts are many, mostly at those among which Newton's method goes round, so that all others keep what they have found.
The forces wander past solutions until `Polish` gets hold of one.
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
from ninedisk.core.errors import SolverNotConvergedError

MAX_ITERATIONS, EACH = 50_000, 50
"""Factorisations and pivots, and those for each contact where that is more: one pyramid of 1,000 disks took 54,000."""
FIRST_SOFT, MOST_SOFT = 1e-2, 1.0
"""Compliance over ``1/rho``: at the first every packing tried is solved by some five steps of Newton's method."""
FACTORS, FACTORS_OF_OWN = (0.7, 3.0), (0.8, 1.1)
"""Of all compliances after a step that was solved soon, and after one that was not solved."""
OWN_ABOVE = 4_000
"""Contacts above which each has a compliance of its own: a step is missed at a few places at a time, and if all compliances were raised as
much as those, places far from there would lose what they have found. With fewer contacts places are few, and three pyramids of 1,000
disks, solved with one compliance, were not with one for each."""
RAISE_THERE, LEAST_THERE = 3.0, 1e-4
"""Factor of those of the contacts that were still changing then, and what they get at least."""
NEWTON, SOON = 12, 6
"""Steps of Newton's method before the path is followed; up to so many count as soon."""
WRONG, HOPELESS = 8, 12
"""Statuses that a step of Newton's method changes: up to so many, and they go round in a few places while all others are right, the path
begins there and not where the error is least; of more than so many, one path in four found its end, after 23 pivots."""
SHORTEST = 1e-3
"""Part of a step of Newton's method below which it is given up."""
PIVOTS = 30
"""Of a path whose end is a step: more cost more than a smaller step."""
SOLVED = 1e-13
"""Error of a step, over the first forces."""
NEARER = 0.1
"""Natural map over that at the last polish from which on the next one is worth its pivots."""
FEW, NEAR = 25, 0.9
"""Pivots of a path up to which the compliance is lowered; error over the first from which on a step that was not solved is kept."""
SLICE = 2_000
"""Iterations from one start before the other has its turn, the first time, or two for each contact above `OWN_ABOVE`; which of the two
arrives cannot be told before."""
POLISH_PIVOTS, POLISH_AGAIN = 30, 100
"""Of a polish; steps after which the next one is not held against those before."""


class ProximalPoint:
    """Solver of Coulomb's law.

    Parameters
    ----------
    options : SolverOptions, optional
    """

    def __init__(self, options: SolverOptions | None = None) -> None:
        self.options = options or SolverOptions()

    def solve(self, problem: ContactProblem, start: FloatArray | None = None) -> SolverResult:
        """Solve the problem, from ``start``, and where that takes long from the forces of the associated rule in turns with it.

        Where nothing slides, the solution of the associated rule is the one. Factorisations, pivots and iterations of the associated
        rule count as iterations.

        Parameters
        ----------
        problem : ContactProblem
        start : ndarray, shape (c, 2), optional
            Forces inside the cones to begin from; None: those of the associated rule alone.

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
            walks = [] if start is None else [_Walk(search, start)]
            slices = 2 * problem.n_contacts if problem.n_contacts > OWN_ABOVE else SLICE
            for walk in walks:
                walk.go(search.iterations + slices)
            # The associated rule costs as much as some hundred steps, which a start near a solution may not need.
            other = None if search.over else search.associated()
            if not search.over and not (walks and other is None):
                walks.insert(0, _Walk(search, none if other is None else other))
            while not search.over:
                for walk in walks:
                    walk.go(search.iterations + slices)
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
        """All factorisations, pivots and steps so far."""
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
        options = replace(self.options, time_limit=self.clock.left)
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
    steps : int
        Steps taken.
    wrong : int
        Statuses that are wrong at the point with fewest.
    changing : ndarray of bool, shape (c,)
        Contacts whose status the last two steps changed; all, before there were two.
    """

    point: LawPoint
    steps: int
    wrong: int
    changing: NDArray[np.bool_]


class _Walk:
    """Proximal points from some forces on, until the search is over; near solutions with a polish."""

    def __init__(self, search: _Search, r: FloatArray) -> None:
        self.search, self.law, self.problem = search, search.law, search.problem
        rho = self.problem.rho[:, None]
        self.z = r - rho * self.law.velocity(r)
        self.size = max(norm(r), norm(rho * self.problem.b) * 1e-3)
        self.soft, self.nearest, self.steps = np.full(self.problem.n_contacts, FIRST_SOFT), np.inf, 0
        self.own = self.problem.n_contacts > OWN_ABOVE
        self.lower, self.more = FACTORS_OF_OWN if self.own else FACTORS

    def go(self, limit: int) -> None:
        """Step by step until the search is over or has taken ``limit`` iterations."""
        search = self.search
        while not search.over and search.iterations < limit:
            r = self.law.inside(self.z, statuses(self.problem, self.z))
            if search.judge(r):
                return
            if search.natural_map < NEARER * self.nearest:
                # The first forces are those of another method, which has polished them.
                self.nearest = search.natural_map
                if self.steps and search.polish(r, POLISH_PIVOTS):
                    return
            self._step(r)
            self.steps += 1
            search.others += 1  # a step that costs no factorisation ends a search that goes nowhere, too
            if self.steps % POLISH_AGAIN == 0:
                self.nearest = np.inf

    def _step(self, held: FloatArray) -> None:
        """To the next proximal point of the forces ``held``, or nearer to it."""
        law = self.law
        law.soft = self.soft
        begin = law.at(self.z, held)
        newton = self._newton(begin, held)
        point = newton.point
        if point.size < SOLVED * self.size:
            self.z = point.z
            if newton.steps <= SOON:
                self._lower()
            return
        if newton.wrong <= HOPELESS:
            count = law.count
            ended = law.path(point.z, point.error, PIVOTS)
            if ended is not None:
                r = ended[0]
                self.z = r - self.problem.rho[:, None] * law.velocity(r) - self.soft[:, None] * (r - held)
                if law.count - count <= FEW:
                    self._lower()
                return
            part, reached = law.reached
            if part * point.size < NEAR * begin.size:
                self.z = reached
        soft = self.more * self.soft
        if self.own:
            soft = np.where(newton.changing, np.maximum(RAISE_THERE * self.soft, LEAST_THERE), soft)
        self.soft = np.minimum(soft, MOST_SOFT)

    def _lower(self) -> None:
        self.soft = np.maximum(self.lower * self.soft, SOFT)

    def _newton(self, point: LawPoint, held: FloatArray) -> _Newton:
        """Newton's method on the statuses.

        Wrong are those that the step to a point has changed: with all others its linear equations are solved. Where these are few the
        path begins at the last point that has fewest, else where the error is least.

        The first step is taken whole: it changes many statuses at once, and the error that it raises the next steps take away. Halved
        until it lessened the error, proximal points took up to twice the factorisations and pivots. A later step is halved as long as the
        error would be above the largest of the first two.
        """
        law, rho, least, most = self.law, self.problem.rho[:, None], point, point.size
        fewest, wrong, step = point, len(point.status), 0
        changing = before = np.ones(len(point.status), dtype=bool)
        for step in range(NEWTON):
            if least.size < SOLVED * self.size or self.search.over or not law.factorise(point.status):
                break
            dr = law.change(point.u)
            full = point.r - dr - rho * law.left(point.u, dr) - point.z
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
        else:
            step = NEWTON
        begin = fewest if wrong <= WRONG and least.size >= SOLVED * self.size else least
        return _Newton(begin, step, wrong, changing | before)
