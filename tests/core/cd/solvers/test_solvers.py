"""What a contact solver promises on small problems: Coulomb's law, refusals, problems that survive being saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import problems
import pytest
import scipy.sparse as sp
from methods import solve_interior_point

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.solvers.gauss_seidel import solve_gauss_seidel
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError

MIXED = problems.BUILDERS.index(problems.mixed)
"""Index of a problem with rough and smooth, rigid and elastic contacts."""


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


def test_the_matrices_are_those_of_the_kernels() -> None:
    """`jacobian` and `delassus`, which other codes are given, against the maps that the solvers use."""
    rng = np.random.default_rng(11)
    for index in range(len(problems.BUILDERS)):
        problem = problems.problem(index)
        v, r = rng.normal(size=problem.mass.shape) * problem.free, rng.normal(size=(problem.n_contacts, 2))
        none = np.zeros_like(r)
        still = problem.contact_velocity(np.zeros_like(v), none)
        moving = problem.contact_velocity(v, none) - still
        assert (problem.jacobian() @ v.ravel()).reshape(-1, 2) == pytest.approx(moving, abs=1e-12)
        u = problem.contact_velocity(problem.body_velocity(r), r)
        size = float(np.abs(problem.delassus()).max())
        assert (problem.delassus() @ r.ravel()).reshape(-1, 2) + problem.b == pytest.approx(u, abs=1e-12 * size + 1e-12)
        value = 0.5 * r.ravel() @ problem.delassus() @ r.ravel() + problem.b.ravel() @ r.ravel()
        assert problem.objective(r) == pytest.approx(value, rel=1e-11)


def test_save_and_load_keep_every_bit(tmp_path: Path) -> None:
    problem = problems.problem(MIXED)
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
    problem = problems.problem(MIXED)
    changed = np.array(getattr(problem, field))
    changed.flat[0] = value
    with pytest.raises(InvalidSceneError, match=word):
        replace(problem, **{field: changed})


@pytest.mark.parametrize("start", [np.zeros((3, 2)), np.nan])
def test_impossible_starts_are_refused(start: object) -> None:
    problem = problems.problem(MIXED)
    start = np.full((problem.n_contacts, 2), start) if np.isscalar(start) else start
    with pytest.raises(InvalidNumericsError, match="starting forces"):
        solve_gauss_seidel(problem, start=start)  # type: ignore[arg-type]
