"""The contact solver of a run: one of the three methods, or a choice by problem and outcome."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.coulomb_interior_point import CoulombInteriorPoint
from ninedisk.core.cd.feasibility import PROOF_AFTER
from ninedisk.core.cd.gauss_seidel import solve_gauss_seidel
from ninedisk.core.cd.interior_point import InteriorPoint
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.projected_gradient import solve_projected_gradient
from ninedisk.core.cd.residuals import Sliding
from ninedisk.core.cd.result import SolverOptions, SolverResult, Stopwatch
from ninedisk.core.errors import InvalidNumericsError, SolverNotConvergedError

FloatArray = NDArray[np.float64]

SOLVERS = ("auto", "interior-point", "projected-gradient", "gauss-seidel")
TRIAL_SWEEPS = 60
"""Sweeps of Gauss-Seidel that "auto" tries before the interior point: together they cost about as much as one of its solves."""
COULOMB_SWEEPS = 5_000
"""Sweeps for Coulomb's law that "auto" tries before the interior point: forces that they have not found they approach ever more slowly."""
LONGEST_WITHOUT_TRIAL = 15
"""Problems without a trial of Gauss-Seidel, at most, after trials in vain."""
MANY = 2**62
"""No limit."""
LOOSE, LOOSE_SWEEPS = 1e-5, 3_000
"""Tolerance from which on "auto" gives Gauss-Seidel more sweeps, on any number of contacts: a warm step of a flow takes some
hundred."""
TRIAL_CONTACTS = 5_000
"""Above this number of contacts information needs more than the trial's sweeps to cross a packing."""


class ContactSolver:
    """Solves the problems of successive steps; keeps what can be reused.

    ``"auto"`` takes Gauss-Seidel for Coulomb friction, and the interior point where `COULOMB_SWEEPS` do not reach the tolerance.
    For the associated rule it gives Gauss-Seidel, started from the last step's forces, `TRIAL_SWEEPS` sweeps: enough where few
    contacts touch each body, or where their compliance dominates. Where they do not reach the tolerance the interior point takes
    over, whose number of iterations hardly depends on the problem.

    Parameters
    ----------
    name : str
        "auto", "interior-point", "projected-gradient" or "gauss-seidel".
    options : SolverOptions
    sliding : {"associated", "coulomb"}

    Attributes
    ----------
    problem : ContactProblem or None
        The problem given last.

    Raises
    ------
    InvalidNumericsError
        If the name is unknown, or the method cannot solve Coulomb's law.
    """

    def __init__(self, name: str, options: SolverOptions, sliding: Sliding) -> None:
        if name not in SOLVERS:
            raise InvalidNumericsError(f"solver = {name!r} is unknown: use one of {', '.join(SOLVERS)}")
        if sliding == "coulomb" and name == "projected-gradient":
            raise InvalidNumericsError(
                f"solver = {name!r} solves the associated rule only: with sliding = 'coulomb' use gauss-seidel, interior-point or auto"
            )
        self.name, self.options, self.sliding = name, options, sliding
        self.problem: ContactProblem | None = None
        self._interior = InteriorPoint(options)
        self._without_trial = self._waited = 0
        sweeps = LOOSE_SWEEPS if options.tolerance >= LOOSE else TRIAL_SWEEPS
        self._trial = replace(options, max_iterations=min(sweeps, options.max_iterations or sweeps))

    @property
    def sweeps(self) -> int:
        """Sweeps of Gauss-Seidel that it begins with, before a proof of feasibility is due; 0 where it begins with another method."""
        if self.name == "gauss-seidel" or (self.sliding == "coulomb" and self.name == "auto"):
            return min(self.options.max_iterations or PROOF_AFTER, PROOF_AFTER)
        return self._trial.max_iterations or 0 if self.name == "auto" else 0

    @property
    def most_contacts(self) -> int:
        """Contacts above which it does not begin with Gauss-Seidel."""
        trial = self.sliding == "associated" and self.name == "auto" and self.options.tolerance < LOOSE
        return TRIAL_CONTACTS if trial else MANY

    def solve(self, problem: ContactProblem, start: FloatArray | None = None) -> SolverResult:
        """Solve one problem.

        Parameters
        ----------
        problem : ContactProblem
        start : ndarray, shape (c, 2), optional
            Contact forces of a neighbouring problem.

        Raises
        ------
        SolverNotConvergedError, InfeasibleContactsError
            As the methods do.
        """
        self.problem = problem
        if self.sliding == "coulomb" and self.name == "interior-point":
            return CoulombInteriorPoint(self.options).solve(problem)
        if self.sliding == "coulomb" and self.name == "auto":
            return self._coulomb(problem, start)
        if self.name == "gauss-seidel":
            return solve_gauss_seidel(problem, self.options, sliding=self.sliding, start=start)
        if self.name == "projected-gradient":
            return solve_projected_gradient(problem, self.options, start=start)
        if self.name == "auto" and problem.n_contacts <= self.most_contacts and self._trial_is_due():
            try:
                result = solve_gauss_seidel(problem, self._trial, start=start)
            except SolverNotConvergedError:
                self._without_trial, self._waited = min(2 * self._without_trial + 1, LONGEST_WITHOUT_TRIAL), 0
            else:
                self._without_trial = 0
                return result
        return self._interior.solve(problem)

    def _coulomb(self, problem: ContactProblem, start: FloatArray | None) -> SolverResult:
        """Sweeps, then the interior point, then as many sweeps as are allowed, all within the time limit."""
        clock = Stopwatch(self.options.time_limit)
        if (self.options.max_iterations or COULOMB_SWEEPS + 1) > COULOMB_SWEEPS:
            trial = replace(self.options, max_iterations=COULOMB_SWEEPS)
            try:
                return solve_gauss_seidel(problem, trial, sliding="coulomb", start=start)
            except SolverNotConvergedError:
                if clock.over:
                    raise
            left = replace(self.options, max_iterations=None, time_limit=clock.left / 2.0)
            try:
                return CoulombInteriorPoint(left).solve(problem)
            except SolverNotConvergedError:
                if clock.over:
                    raise
        left = replace(self.options, time_limit=clock.left)
        return solve_gauss_seidel(problem, left, sliding="coulomb", start=start)

    def _trial_is_due(self) -> bool:
        """After trials in vain, 1, 3, 7, .. problems go without one: their like follow each other."""
        self._waited += 1
        return self._waited > self._without_trial
