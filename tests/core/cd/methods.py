"""The contact solvers of the associated rule under one signature, for tests that hold for each of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.gauss_seidel import solve_gauss_seidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult

Solve = Callable[..., SolverResult]


def solve_interior_point(
    problem: ContactProblem, options: SolverOptions | None = None, start: NDArray[np.float64] | None = None
) -> SolverResult:
    """One solve, cold unless a start is given."""
    return InteriorPoint(options).solve(problem, start=start)


each_solver = pytest.mark.parametrize("solve", [solve_interior_point, solve_gauss_seidel])
