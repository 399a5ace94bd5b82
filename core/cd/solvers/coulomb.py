"""Coulomb's law by one method after the other: sweeps, what a factorisation makes of them, proximal points, the path from nothing."""

from __future__ import annotations

from dataclasses import replace

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Residuals, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError, check_feasible
from ninedisk.core.cd.solvers.gauss_seidel import MAX_SWEEPS, GaussSeidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult, Stopwatch
from ninedisk.core.cd.solvers.polish import PATHS, Polish
from ninedisk.core.cd.solvers.proximal import ProximalPoint
from ninedisk.core.errors import SolverNotConvergedError

STAGES = ((200, 20), (5_000, 400))
"""Sweeps after which the forces found are polished; pivots that a path of this may take."""
MANY_STAGES = ((50, 0), (100, 0), (200, 0), (400, 0), (800, 0), (1_600, 2))
"""As `STAGES`, where contacts are many, but for one path of pivots in place of several: sweeps find what each contact does long
before they find its force, and where they did one factorisation, which costs some hundred sweeps, makes the forces exact. What is left
after them proximal points solve sooner than more sweeps do."""
REST_ASKED = 200
"""Sweeps after which many contacts are asked for a solution in which nothing slides: a stage of both."""
LEMKE_CONTACTS = 500
"""Contacts up to which the path from nothing is followed: some 3 pivots for each contact, each of which costs as much as a matrix that
grows with the contacts. Above them contacts are many."""
WARM_FROM = 200
"""Contacts above which they are many from the forces of a step before: below, sweeps to the end cost less than factorisations."""
WARM_POINTS = 1_000
"""Iterations of proximal points on few contacts from the forces of a step before: there are other methods, too."""
SHARE = 0.9
"""Of the time left, for proximal points: what they do not solve sweeps hardly ever do."""
LOOSE = 1e-5
"""Tolerance from which on contacts are not many in a warm step: sweeps reach it, in a flow after some hundred."""


class CoulombSearch:
    """The methods in turn, on one problem, in one time limit.

    Sweeps come first, polished after each stage. Many contacts go on to `ProximalPoint`; few have more sweeps, more pivots and the path
    from nothing before. ``options.max_iterations`` bounds the sweeps: at a bound within the first stage nothing is polished, within the
    last no other method is tried.

    Parameters
    ----------
    problem : ContactProblem
    options : SolverOptions
    start : ndarray, shape (c, 2), optional
        Contact forces of a neighbouring problem.
    """

    def __init__(self, problem: ContactProblem, options: SolverOptions, start: FloatArray | None) -> None:
        self.problem, self.options, self.clock = problem, options, Stopwatch(options.time_limit)
        self.limit = options.max_iterations or MAX_SWEEPS
        self.sweeps = GaussSeidel(problem, options, "coulomb", start)
        self.polish = Polish(problem, options.tolerance, self.clock)
        self.failed: list[SolverNotConvergedError] = []
        self.warm = start is not None and bool(start.any())
        self.few = problem.n_contacts <= LEMKE_CONTACTS
        self.many = options.tolerance < LOOSE and problem.n_contacts > WARM_FROM if self.warm else not self.few

    def solve(self, *, at_rest: bool) -> SolverResult:
        """The first solution found; iterations of all methods count.

        Where bodies rest, equilibrium is asked for first: the solution of the associated rule, if nothing slides in it, solves Coulomb's
        law, too, which may have others in which everything collapses.

        Raises
        ------
        SolverNotConvergedError, InfeasibleContactsError
            As the methods do.
        """
        found = None
        if at_rest:
            found = self.swept(0) or self.equilibrium()
        if self.many:
            found = found or self.polished(MANY_STAGES, 1, at_rest) or self.points(WARM_POINTS if self.few else None)
        if self.few or not self.many:
            found = found or self.polished(STAGES, PATHS, at_rest) or self.from_nothing() or self.points()
        found = found or self.swept(self.limit) or self.given_up()
        # Those of other methods that found it are in the result.
        others = self.polish.count + sum(error.iterations for error in self.failed)
        return replace(found, iterations=found.iterations + self.sweeps.done + others)

    def swept(self, sweeps: int) -> SolverResult | None:
        """The forces after so many sweeps in all, if they solve the problem."""
        found = self.sweeps.solve(min(sweeps, self.limit))
        return found and replace(found, iterations=0)

    def polished(self, stages: tuple[tuple[int, int], ...], paths: int, at_rest: bool) -> SolverResult | None:
        """Forces after sweeps, as they are or made exact; at the last sweep that is allowed, the best ones."""
        for sweeps, pivots in stages:
            if found := self.swept(sweeps):
                return found
            if sweeps >= self.limit or self.clock.over:
                return self.given_up()
            if exact := self.polish.improve(self.sweeps.r, pivots, paths=paths):
                return self.result("polish", exact)
            # Where contacts are many, pivots cost more than the interior point. A step of a flow has no such solution.
            asked = not (self.few or at_rest or (self.many and self.warm))
            if asked and sweeps == REST_ASKED and (found := self.equilibrium()):
                return found
        return None

    def points(self, iterations: int | None = None) -> SolverResult | None:
        """Proximal points in a share of the time left."""
        options = replace(self.options, max_iterations=iterations, time_limit=SHARE * self.clock.remaining)
        try:
            return ProximalPoint(options).solve(self.problem, self.sweeps.r, near=self.warm)
        except SolverNotConvergedError as error:
            self.failed.append(error)
            return None

    def from_nothing(self) -> SolverResult | None:
        """Lemke's path on few contacts, once the problem is known to have forces at all."""
        check_feasible(self.problem, sliding="coulomb", seconds=self.clock.remaining)
        exact = self.polish.from_nothing(self.sweeps.r, STAGES[-1][1]) if self.few else None
        return exact and self.result("lemke", exact)

    def equilibrium(self) -> SolverResult | None:
        """The solution in which nothing slides, if there is one: that of the associated rule, whose velocities are unique."""
        try:
            # No more than half of the time: what flows has no such solution, and is left to the other methods.
            found = InteriorPoint(replace(self.options, time_limit=0.5 * self.clock.remaining)).solve(self.problem)
        except (SolverNotConvergedError, InfeasibleContactsError):
            return None
        exact = self.polish.improve(found.r, 0)
        r = found.r if exact is None else exact[0]
        residuals = measure(self.problem, self.problem.body_velocity(r), r, sliding="coulomb")
        reached = residuals.reached(self.options.tolerance)
        return replace(self.result("interior-point", (r, residuals)), iterations=found.iterations) if reached else None

    def given_up(self) -> SolverResult:
        """The best forces if they may be taken; else `SolverNotConvergedError`."""
        return replace(self.sweeps.give_up(self.failed), iterations=0)

    def result(self, name: str, forces: tuple[FloatArray, Residuals]) -> SolverResult:
        """A result without the iterations that the search counts."""
        return SolverResult(
            solver=name,
            sliding="coulomb",
            v=self.problem.body_velocity(forces[0]),
            r=forces[0],
            iterations=0,
            residuals=forces[1],
            seconds=self.clock.seconds,
        )
