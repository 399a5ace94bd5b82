"""The contact solver of a run: one of the methods, or a choice by problem and outcome."""

from __future__ import annotations

from dataclasses import replace

from ninedisk.core.array_types import FloatArray
from ninedisk.core.cd.problem import ContactProblem, Sliding
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.coulomb import LOOSE, MANY_STAGES, CoulombSearch
from ninedisk.core.cd.solvers.feasibility import PROOF_AFTER
from ninedisk.core.cd.solvers.gauss_seidel import solve_gauss_seidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult
from ninedisk.core.cd.solvers.proximal import ProximalPoint
from ninedisk.core.errors import InvalidNumericsError, SolverNotConvergedError

SOLVERS = ("auto", "interior-point", "gauss-seidel")
TRIAL_SWEEPS = 60
"""Sweeps of Gauss-Seidel that "auto" tries before the interior point: together they cost about as much as one of its solves."""
LONGEST_WITHOUT_TRIAL = 15
"""Problems without a trial of Gauss-Seidel, at most, after trials in vain."""
NO_LIMIT = 2**62
"""More contacts than a problem can have."""
LOOSE_SWEEPS = 3_000
"""Sweeps of a trial from the tolerance `LOOSE` on, on any number of contacts."""
TRIAL_CONTACTS = 5_000
"""Above this number of contacts information needs more than the trial's sweeps to cross a packing."""


class ContactSolver:
    """Solves the problems of successive steps; keeps what can be reused.

    For Coulomb friction ``"auto"`` is `CoulombSearch`. For the associated rule it gives Gauss-Seidel, started from the last step's
    forces, `TRIAL_SWEEPS` sweeps: enough where few contacts touch each body, or where their compliance dominates. Where they do not
    reach the tolerance the interior point takes over, whose number of iterations hardly depends on the problem.

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
        return min(self.sweeps, MANY_STAGES[0][0]) if polishes else self.sweeps

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
            return CoulombSearch(problem, self.options, start).solve(at_rest=at_rest)
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

    def _trial_is_due(self) -> bool:
        """After trials in vain, 1, 3, 7, .. problems go without one: their like follow each other."""
        self._waited += 1
        return self._waited > self._without_trial
