"""What makes the interior point fast and exact: a start that knows the depth, bold goals, forces that balance momentum."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import interior_point as interior_point_run
from ninedisk.core.cd.solvers.factorise import BodyGraph, BodyMatrix
from ninedisk.core.cd.solvers.interior_point import InteriorPoint, Run
from ninedisk.harness.bench.cd import lattice, resting

DEPTHS = (10, 40, 160)
FEW = 7
"""Iterations to 1e-8 on a rough lattice of any depth: 5 or 6 were found; a start that ignores the depth needs 9 from 40 rows on."""


@pytest.fixture(scope="module")
def piles() -> list[ContactProblem]:
    return [resting(lattice(rows, 6)) for rows in DEPTHS]


def iterations(problem: ContactProblem) -> int:
    return InteriorPoint(SolverOptions(tolerance=1e-8)).solve(problem).iterations


def test_iterations_do_not_grow_with_the_depth(piles: list[ContactProblem]) -> None:
    assert max(iterations(pile) for pile in piles) <= FEW


def test_a_start_that_ignores_the_depth_is_seen(piles: list[ContactProblem], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interior_point_run, "STIFFNESS", 1.0)
    assert iterations(piles[-1]) > FEW


def imbalance(problem: ContactProblem, run: Run) -> float:
    """Largest error of a body's balance of momentum, relative to the largest contact force."""
    point = run.point
    pull = (problem.jacobian().T @ point.r.ravel()).reshape(-1, 3) * problem.free
    error = problem.free * (problem.mass * point.v - problem.force) - pull
    return float(np.abs(error).max() / np.abs(point.r).max())


def test_refined_forces_balance_momentum_to_round_off(piles: list[ContactProblem]) -> None:
    """Half way to the solution, where large changes of the forces have left errors that the next iteration would see."""
    problem = piles[-1]
    run = Run(problem, BodyMatrix(problem, BodyGraph(problem.n_bodies, problem.bodies)), None)
    for _ in range(4):
        assert run.iterate()
    before = imbalance(problem, run)
    run.refine()
    # A body has at most six contacts, each with a force and a moment: a dozen roundings of the largest force.
    assert imbalance(problem, run) < 12 * np.finfo(float).eps < 1e-6 * before


@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_velocities_follow_from_the_forces(piles: list[ContactProblem], tolerance: float) -> None:
    problem = piles[-1]
    found = InteriorPoint(SolverOptions(tolerance=tolerance)).solve(problem)
    assert np.array_equal(found.v, problem.body_velocity(found.r))
    assert found.residuals.worst < tolerance
