"""The solvers of the convex program against an independent conic solver, and against each other."""

from __future__ import annotations

from pathlib import Path

import clarabel
import numpy as np
import pytest
import scipy.sparse as sp

from ninedisk.core.cd.gauss_seidel import solve_gauss_seidel
from ninedisk.core.cd.interior_point import InteriorPoint
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.projected_gradient import solve_projected_gradient
from ninedisk.core.cd.residuals import measure
from ninedisk.core.cd.result import SolverOptions, SolverResult
from ninedisk.core.errors import InvalidSceneError, SolverNotConvergedError

SEEDS = range(60)


def random_problem(seed: int) -> ContactProblem:
    """A feasible problem: no gap is negative, so that standing still satisfies every contact."""
    rng = np.random.default_rng(seed)
    side = int(rng.integers(1, 9))
    radius = rng.uniform(0.4, 0.6, side * side)
    x = np.array([(i, j) for i in range(side) for j in range(side)], dtype=float) + rng.uniform(
        -0.1, 0.1, (side * side, 2)
    )
    bodies, normal, arms, gap = [], [], [], []
    for i in range(len(x)):
        for j in range(i + 1, len(x)):
            d = x[j] - x[i]
            length = float(np.hypot(*d))
            if length - radius[i] - radius[j] < 0.25:
                bodies.append((i, j))
                normal.append(d / length)
                arms.append((0.0, 0.0, radius[i], radius[j]))
                gap.append(max(length - radius[i] - radius[j], 0.0) if rng.random() < 0.5 else 0.0)
        if x[i, 1] < 0.5:
            bodies.append((i, -1))
            normal.append(np.array([0.0, -1.0]))
            arms.append((0.0, 0.0, radius[i], 0.0))
            gap.append(0.0)
    c = len(bodies)
    mass = np.pi * radius**2
    diagonal = np.column_stack([mass, mass, 0.5 * mass * radius**2])
    force = rng.normal(0.0, 1.0, (len(x), 3)) * [1.0, 1.0, 0.2] + np.column_stack([0 * mass, -3.0 * mass, 0 * mass])
    kind = rng.integers(4)
    mu = np.full(c, [0.0, 0.3, 2.0, 0.0][kind]) if kind < 3 else rng.choice([0.0, 0.2, 0.8], c)
    soft = rng.random() < 0.5
    return ContactProblem(
        mass=diagonal,
        force=force,
        bodies=np.array(bodies).reshape(c, 2),
        normal=np.array(normal).reshape(c, 2),
        arms=np.array(arms).reshape(c, 4),
        offset=np.column_stack([gap, np.zeros(c)]),
        mu=mu,
        compliance=rng.uniform(0.01, 0.3, (c, 2)) if soft else np.zeros((c, 2)),
        shear_0=rng.normal(0.0, 0.2, c) if soft else np.zeros(c),
    )


def solve_interior_point(problem: ContactProblem, options: SolverOptions | None = None) -> SolverResult:
    """One cold solve."""
    return InteriorPoint(options).solve(problem)


def clarabel_forces(problem: ContactProblem) -> np.ndarray:
    """Minimiser of ``1/2 r' W r + b' r`` under ``|q| <= mu p``, ``p >= 0`` as a quadratic program, shape (c, 2)."""
    c = problem.n_contacts
    smooth = np.flatnonzero(problem.mu == 0.0)
    rows = [np.eye(2 * c)[2 * k + 1] for k in smooth]
    for k in range(c):
        row = np.zeros(2 * c)
        row[2 * k] = -1.0
        rows.append(row)
        for sign in (1.0, -1.0) if problem.mu[k] > 0.0 else ():
            row = np.zeros(2 * c)
            row[2 * k], row[2 * k + 1] = -problem.mu[k], sign
            rows.append(row)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    cones = [clarabel.ZeroConeT(len(smooth)), clarabel.NonnegativeConeT(len(rows) - len(smooth))]
    solver = clarabel.DefaultSolver(
        sp.csc_matrix(sp.triu(problem.delassus())),
        problem.b.ravel(),
        sp.csc_matrix(np.array(rows)),
        np.zeros(len(rows)),
        cones if len(smooth) else cones[1:],
        settings,
    )
    solution = solver.solve()
    assert str(solution.status) == "Solved"
    return np.array(solution.x).reshape(c, 2)


@pytest.mark.parametrize("seed", SEEDS)
def test_interior_point_agrees_with_clarabel(seed: int) -> None:
    """Objective to 1e-9 of its size; velocities, which are unique where forces are not, as close as the objectives allow.

    With r* the optimum, ``obj(r) - obj(r*) >= 1/2 (r - r*)' W (r - r*) >= 1/2 |v - v*|_M^2``: what Clarabel leaves in the
    objective bounds its velocities; 1e-6 is what the interior point's own tolerance 1e-13 leaves.
    """
    problem = random_problem(seed)
    expected = clarabel_forces(problem)
    found = solve_interior_point(problem, SolverOptions(tolerance=1e-13))
    objective = problem.objective(expected)
    assert problem.objective(found.r) - objective <= 1e-9 * max(abs(objective), 1e-3)
    v = problem.body_velocity(expected)
    left = max(objective - problem.objective(found.r), 0.0)
    kinetic = float((problem.mass * (found.v - v) ** 2).sum())
    assert np.sqrt(kinetic) <= np.sqrt(2.0 * left) + 1e-6 * np.sqrt(max(abs(objective), 1.0))
    assert (np.abs(found.r[:, 1]) <= problem.mu * found.r[:, 0] * (1 + 1e-12)).all()


@pytest.mark.parametrize("solve", [solve_projected_gradient, solve_gauss_seidel])
def test_first_order_solvers_reach_the_same_velocities_or_say_so(solve) -> None:  # type: ignore[no-untyped-def]
    """A solver may stop short, but never silently; on these small problems most have to be solved."""
    options = SolverOptions(tolerance=1e-8, time_limit=5.0, max_iterations=20000)
    solved = 0
    for seed in SEEDS:
        problem = random_problem(seed)
        try:
            found = solve(problem, options)
        except SolverNotConvergedError:
            continue
        solved += 1
        expected = solve_interior_point(problem).v
        assert np.abs(found.v - expected).max() <= 1e-3 * max(np.abs(expected).max(), 1.0)
        assert problem.objective(found.r) - problem.objective(solve_interior_point(problem).r) <= 1e-6
    assert solved >= 0.9 * len(SEEDS)


def test_coulomb_solution_does_not_dilate() -> None:
    """One body pushed along a floor: the associated rule lifts it by mu times the slip, Coulomb's does not."""
    problem = ContactProblem(
        mass=[[1.0, 1.0, np.inf]],
        force=[[1.0, -1.0, 0.0]],
        bodies=[[0, -1]],
        normal=[[0.0, -1.0]],
        arms=[[0.0, 0.0, 1.0, 0.0]],
        offset=[[0.0, 0.0]],
        mu=[0.5],
    )
    coulomb = solve_gauss_seidel(problem, sliding="coulomb")
    associated = solve_interior_point(problem)
    assert coulomb.v[0] == pytest.approx([0.5, 0.0, 0.0], abs=1e-9)
    # min 1/2 |v|^2 - f.v with v_y >= mu v_x: p (1 + mu^2) = 1 + mu f_x - ... gives v = (f_x - mu p, p - 1), v_y = mu v_x.
    p = (1.0 + 0.5 * 1.0) / (1.0 + 0.25)
    assert associated.v[0] == pytest.approx([1.0 - 0.5 * p, p - 1.0, 0.0], abs=1e-9)
    assert associated.v[0, 1] == pytest.approx(0.5 * associated.v[0, 0], abs=1e-9)


def test_residuals_see_a_wrong_solution() -> None:
    problem = random_problem(7)
    found = solve_interior_point(problem)
    wrong = found.r * 1.01
    assert measure(problem, problem.body_velocity(wrong), wrong).worst > 1e-4


def test_save_and_load_keep_every_bit(tmp_path: Path) -> None:
    problem = random_problem(5)
    problem.save(tmp_path / "step.npz")
    again = ContactProblem.load(tmp_path / "step.npz")
    assert np.array_equal(solve_interior_point(again).r, solve_interior_point(problem).r)
    with np.load(tmp_path / "step.npz") as data:
        w = sp.csr_array((data["W_data"], data["W_indices"], data["W_indptr"]))
        assert np.array_equal(w.toarray(), problem.delassus().toarray())


@pytest.mark.parametrize(
    ("field", "value", "word"), [("mass", 0.0, "mass"), ("mu", -0.1, "mu"), ("compliance", -1.0, "compliance")]
)
def test_impossible_problems_are_refused(field: str, value: float, word: str) -> None:
    problem = random_problem(4)
    changed = np.array(getattr(problem, field))
    changed.flat[0] = value
    fields = {
        name: getattr(problem, name)
        for name in ("mass", "force", "bodies", "normal", "arms", "offset", "mu", "compliance")
    }
    with pytest.raises(InvalidSceneError, match=word):
        ContactProblem(**{**fields, field: changed})


def test_iteration_limit_is_an_error_with_figures() -> None:
    with pytest.raises(SolverNotConvergedError, match=r"interior-point stopped .* after 2 iterations"):
        solve_interior_point(random_problem(8), SolverOptions(max_iterations=2))
