"""The contact solver of a run: one of the methods, or a choice by problem and outcome."""

from __future__ import annotations

from dataclasses import replace

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Residuals, Sliding, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.feasibility import PROOF_AFTER, InfeasibleContactsError, check_feasible
from ninedisk.core.cd.solvers.gauss_seidel import MAX_SWEEPS, GaussSeidel, solve_gauss_seidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult, Stopwatch
from ninedisk.core.cd.solvers.polish import Polish
from ninedisk.core.cd.solvers.proximal import ProximalPoint
from ninedisk.core.errors import InvalidNumericsError, SolverNotConvergedError

SOLVERS = ("auto", "interior-point", "gauss-seidel")
TRIAL_SWEEPS = 60
"""Sweeps of Gauss-Seidel that "auto" tries before the interior point: together they cost about as much as one of its solves."""
STAGES = ((200, 20), (5_000, 400))
"""Sweeps for Coulomb's law after which "auto" polishes the forces found; pivots that a path of this may take."""
WARM_FROM = 200
"""Contacts above which "auto" takes a step with Coulomb's law to a tight tolerance by `WARM_STAGES`: below, sweeps to the end cost less
than factorisations."""
WARM_STAGES = ((50, 0), (100, 0), (200, 0), (400, 0), (800, 0), (1_600, 2))
"""As `STAGES`, from the forces of a step before, but for one path of pivots in place of several: sweeps find what each contact does long
before they find its force, and where they did one factorisation, which costs some hundred sweeps, makes the forces exact. What is left
after them proximal points solve sooner than more sweeps do."""
WARM_POINTS = 1_000
"""Iterations of proximal points after these stages on up to `LEMKE_CONTACTS` contacts, where there are other methods, too."""
LEMKE_CONTACTS = 500
"""Contacts up to which "auto" follows the path from nothing: some 3 pivots for each contact, each of which costs as much as a matrix
that grows with the contacts."""
SHARE = 0.9
"""Of the time left, for proximal points: what they do not solve sweeps hardly ever do."""
LONGEST_WITHOUT_TRIAL = 15
"""Problems without a trial of Gauss-Seidel, at most, after trials in vain."""
NO_LIMIT = 2**62
"""More contacts than a problem can have."""
LOOSE, LOOSE_SWEEPS = 1e-5, 3_000
"""Tolerance from which on "auto" gives Gauss-Seidel more sweeps, on any number of contacts: a warm step of a flow takes some
hundred."""
TRIAL_CONTACTS = 5_000
"""Above this number of contacts information needs more than the trial's sweeps to cross a packing."""


class ContactSolver:
    """Solves the problems of successive steps; keeps what can be reused.

    For Coulomb friction ``"auto"`` takes Gauss-Seidel, started from the last step's forces, and on more than `WARM_FROM` contacts tries
    after each of `WARM_STAGES` what one factorisation makes of them, and then `ProximalPoint`. Where the sweeps do not reach the
    tolerance after the first of `STAGES`, `Polish` makes the forces found exact; if it cannot, a solution in which nothing slides
    is asked for where contacts are many, more sweeps follow, then Lemke's method on up to `LEMKE_CONTACTS` contacts,
    `ProximalPoint`, and more sweeps. ``options.max_iterations`` bounds the sweeps: at a bound within the first stage nothing is
    polished, within the second no other method is tried. Where bodies rest it first asks whether they can stay: the solution of the
    associated rule, if nothing slides in it, solves Coulomb's law, too, which may have others in which everything collapses.
    For the associated rule it gives Gauss-Seidel, started from the last step's forces, `TRIAL_SWEEPS` sweeps: enough where few
    contacts touch each body, or where their compliance dominates. Where they do not reach the tolerance the interior point takes
    over, whose number of iterations hardly depends on the problem.

    Parameters
    ----------
    name : str
        "auto", "interior-point" or "gauss-seidel".
    options : SolverOptions
    sliding : {"associated", "coulomb"}

    Attributes
    ----------
    problem : ContactProblem or None
        The problem given last.

    Raises
    ------
    InvalidNumericsError
        If the name is unknown.
    """

    def __init__(self, name: str, options: SolverOptions, sliding: Sliding) -> None:
        if name not in SOLVERS:
            raise InvalidNumericsError(f"solver = {name!r} is unknown: use one of {', '.join(SOLVERS)}")
        self.name, self.options, self.sliding = name, options, sliding
        self.problem: ContactProblem | None = None
        self._interior = InteriorPoint(options)
        self._without_trial = self._waited = 0
        sweeps = LOOSE_SWEEPS if options.tolerance >= LOOSE else TRIAL_SWEEPS
        self._trial = replace(options, max_iterations=min(sweeps, options.max_iterations or sweeps), accept=None)
        self._tight = options.tolerance < LOOSE

    @property
    def sweeps(self) -> int:
        """Sweeps of Gauss-Seidel that it begins with, before a proof of feasibility is due; 0 where it begins with another method."""
        if self.name == "gauss-seidel" or (self.sliding == "coulomb" and self.name == "auto"):
            return min(self.options.max_iterations or PROOF_AFTER, PROOF_AFTER)
        return self._trial.max_iterations or 0 if self.name == "auto" else 0

    @property
    def holds_rest(self) -> bool:
        """Whether it asks for equilibrium where bodies rest."""
        return self.sliding == "coulomb" and self.name == "auto"

    @property
    def most_contacts(self) -> int:
        """Contacts above which it does not begin with Gauss-Seidel."""
        return TRIAL_CONTACTS if self.sliding == "associated" and self.name == "auto" and self._tight else NO_LIMIT

    @property
    def many_sweeps(self) -> int:
        """As `sweeps`, from the forces of a step before with more than `WARM_FROM` contacts."""
        polishes = self.sliding == "coulomb" and self.name == "auto" and self._tight
        return min(self.sweeps, WARM_STAGES[0][0]) if polishes else self.sweeps

    def solve(self, problem: ContactProblem, start: FloatArray | None = None, *, at_rest: bool = False) -> SolverResult:
        """Solve one problem.

        Parameters
        ----------
        problem : ContactProblem
        start : ndarray, shape (c, 2), optional
            Contact forces of a neighbouring problem.
        at_rest : bool
            Whether bodies rest, so that equilibrium is to be taken where it exists.

        Raises
        ------
        SolverNotConvergedError, InfeasibleContactsError
            As the methods do.
        """
        self.problem = problem
        if self.sliding == "coulomb" and self.name == "interior-point":
            return ProximalPoint(self.options).solve(problem, start)
        if self.sliding == "coulomb" and self.name == "auto":
            return self._coulomb(problem, start, at_rest)
        if self.name == "gauss-seidel":
            return solve_gauss_seidel(problem, self.options, sliding=self.sliding, start=start)
        if self.name == "auto" and problem.n_contacts <= self.most_contacts and self._trial_is_due():
            try:
                result = solve_gauss_seidel(problem, self._trial, start=start)
            except SolverNotConvergedError:
                self._without_trial, self._waited = min(2 * self._without_trial + 1, LONGEST_WITHOUT_TRIAL), 0
            else:
                self._without_trial = 0
                return result
        return self._interior.solve(problem)

    def _coulomb(self, problem: ContactProblem, start: FloatArray | None, at_rest: bool) -> SolverResult:
        """Sweeps, their forces polished; then pivots from nothing, proximal points; then sweeps to the limit; all in the time limit."""
        options, clock, limit = (
            self.options,
            Stopwatch(self.options.time_limit),
            self.options.max_iterations or MAX_SWEEPS,
        )
        polish = Polish(problem, options.tolerance, clock)
        sweeps, failed = GaussSeidel(problem, options, "coulomb", start), list[SolverNotConvergedError]()

        def spent() -> int:
            """Factorisations and pivots, and what methods that gave up have taken."""
            return polish.count + sum(each.iterations for each in failed)

        def result(name: str, forces: tuple[FloatArray, Residuals]) -> SolverResult:
            return SolverResult(
                solver=name,
                sliding="coulomb",
                v=problem.body_velocity(forces[0]),
                r=forces[0],
                iterations=sweeps.done + spent(),
                residuals=forces[1],
                seconds=clock.seconds,
            )

        if at_rest:
            found = sweeps.solve(0) or self._equilibrium(problem, polish, clock)
            if found:
                return found
        if self._tight and problem.n_contacts > WARM_FROM and start is not None and start.any():
            for stage, pivots in WARM_STAGES:
                if found := sweeps.solve(min(stage, limit)):
                    return replace(found, iterations=found.iterations + spent())
                if stage >= limit or clock.over:
                    return sweeps.give_up()
                if polished := polish.improve(sweeps.r, pivots, paths=1):
                    return result("polish", polished)
            points = WARM_POINTS if problem.n_contacts <= LEMKE_CONTACTS else None
            try:
                found = self._points(problem, sweeps.r, clock, points)
                return replace(found, iterations=found.iterations + sweeps.done + spent())
            except SolverNotConvergedError as error:
                failed.append(error)
        for stage, pivots in STAGES:
            if found := sweeps.solve(min(stage, limit)):
                return replace(found, iterations=found.iterations + spent())
            if stage >= limit or clock.over:
                return sweeps.give_up(failed)
            if polished := polish.improve(sweeps.r, pivots):
                return result("polish", polished)
            # Where many contacts are in play, pivots cost more than the interior point.
            many = stage == STAGES[0][0] and problem.n_contacts > LEMKE_CONTACTS and not at_rest
            if many and (found := self._equilibrium(problem, polish, clock)):
                return replace(found, iterations=found.iterations + sweeps.done + spent())
        check_feasible(problem, sliding="coulomb", seconds=clock.left)
        if problem.n_contacts <= LEMKE_CONTACTS and (polished := polish.from_nothing(sweeps.r, STAGES[-1][1])):
            return result("lemke", polished)
        try:
            found = self._points(problem, sweeps.r, clock)
            return replace(found, iterations=found.iterations + sweeps.done + spent())
        except SolverNotConvergedError as error:
            failed.append(error)
        found = sweeps.solve(limit) or sweeps.give_up(failed)
        return replace(found, iterations=found.iterations + spent())

    def _points(
        self, problem: ContactProblem, r: FloatArray, clock: Stopwatch, iterations: int | None = None
    ) -> SolverResult:
        """Proximal points from ``r`` in a share of the time left; raises `SolverNotConvergedError`."""
        options = replace(self.options, max_iterations=iterations, time_limit=SHARE * clock.left)
        return ProximalPoint(options).solve(problem, r)

    def _equilibrium(self, problem: ContactProblem, polish: Polish, clock: Stopwatch) -> SolverResult | None:
        """The solution in which nothing slides, if there is one: that of the associated rule, whose velocities are unique."""
        try:
            # No more than half of the time: what flows has no such solution, and is left to the sweeps.
            found = InteriorPoint(replace(self.options, time_limit=0.5 * clock.left)).solve(problem)
        except (SolverNotConvergedError, InfeasibleContactsError):
            return None
        exact = polish.improve(found.r, 0)
        r = found.r if exact is None else exact[0]
        v = problem.body_velocity(r)
        residuals = measure(problem, v, r, sliding="coulomb")
        if not residuals.reached(self.options.tolerance):
            return None
        return replace(
            found, sliding="coulomb", v=v, r=r, residuals=residuals, iterations=found.iterations + polish.count
        )

    def _trial_is_due(self) -> bool:
        """After trials in vain, 1, 3, 7, .. problems go without one: their like follow each other."""
        self._waited += 1
        return self._waited > self._without_trial
