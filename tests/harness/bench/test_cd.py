"""Suite ``cd``: the problems are what they say, solvers are believed by their forces only."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import packings
from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import gauss_seidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.harness.api.engine import EngineNotInstalledError
from ninedisk.harness.bench import cd
from ninedisk.harness.bench.cd import Solver, Task, lattice, resting, solvers, turned_gravity
from ninedisk.harness.bench.measure import NotReachedError, usable_cores
from ninedisk.harness.engines.package import package_version
from ninedisk.harness.engines.siconos.adapter import SYSTEM_PYTHON, installed_siconos
from ninedisk.harness.results.schema import Row

ROWS, COLUMNS = 4, 7


@pytest.fixture(scope="module")
def problem() -> ContactProblem:
    return resting(lattice(ROWS, COLUMNS))


@pytest.fixture(scope="module")
def packed() -> ContactProblem:
    return resting(packings.settled_packing(60))


def by_name(name: str) -> Solver:
    return next(solver for solver in solvers() if solver.name == name)


def task(problem: ContactProblem, folder: Path, solver: Solver, tolerance: float = 1e-8) -> Task:
    file = folder / "problem.npz"
    problem.save(file)
    return Task(problem, file, solver.sliding, tolerance, None)


def available(name: str) -> bool:
    package = {"clarabel": "clarabel", "piqp": "piqp"}.get(name)
    if name.startswith("siconos"):
        return installed_siconos(SYSTEM_PYTHON)[0] is not None
    return package is None or package_version(package)[0] is not None


def test_the_lattice_has_the_contacts_of_a_lattice(problem: ContactProblem) -> None:
    """Within rows, between rows, with the floor, and one with a side wall in every row."""
    m, n = ROWS, COLUMNS
    assert problem.n_contacts == m * (n - 1) + (m - 1) * (2 * n - 1) + n + m
    assert not problem.compliance.any()
    assert (problem.mu == cd.MU).all()
    assert not problem.offset.any()


def test_the_forces_of_the_solution_bear_the_weight(packed: ContactProblem) -> None:
    """The outer contacts bear the weight, but for what falls: disks that nothing holds gain g dt in the step."""
    result = InteriorPoint(SolverOptions(tolerance=1e-10)).solve(packed)
    outer = packed.bodies[:, 1] < 0
    n, r = packed.normal[outer], result.r[outer]
    vertical = -r[:, 0] * n[:, 1] + r[:, 1] * n[:, 0]
    falling = float((packed.mass[:, 1] * result.v[:, 1]).sum())
    weight = -float(packed.force[:, 1].sum())
    assert vertical.sum() == pytest.approx(weight + falling, rel=1e-12)
    assert abs(falling) < 0.02 * weight
    assert np.abs(result.v[:, :2]).max() <= packings.GRAVITY * cd.DT * (1.0 + 1e-9)


def test_gravity_is_turned_and_nothing_else(problem: ContactProblem) -> None:
    turned = turned_gravity(problem, 0.1)
    size, before = np.hypot(*turned.force[:, :2].T), np.hypot(*problem.force[:, :2].T)
    assert size == pytest.approx(before, rel=1e-14)
    angle = np.arctan2(turned.force[:, 1], turned.force[:, 0]) - np.arctan2(problem.force[:, 1], problem.force[:, 0])
    assert angle == pytest.approx(0.1, abs=1e-14)
    assert np.array_equal(turned.normal, problem.normal)


@pytest.mark.parametrize("name", [solver.name for solver in solvers()])
def test_every_solver_reaches_the_target_or_is_not_there(name: str, problem: ContactProblem, tmp_path: Path) -> None:
    solver = by_name(name)
    if not available(name):
        with pytest.raises(EngineNotInstalledError):
            solver.solve(task(problem, tmp_path, solver), 30.0)
        return
    sample = solver.solve(task(problem, tmp_path, solver), 30.0)
    assert sample.facts["reached"]
    assert max(sample.facts["natural_map"], sample.facts["duality_gap"]) <= 1e-8
    assert sample.facts["iterations"] > 0
    if solver.sliding == "associated":
        optimum = InteriorPoint(SolverOptions(tolerance=1e-12)).solve(problem)
        # A relative duality gap of 1e-8 bounds the error of the objective by as much of twice its value.
        best = problem.objective(optimum.r)
        assert abs(sample.facts["objective"] - best) <= 2e-8 * abs(best)


@pytest.mark.parametrize("name", ["clarabel", "piqp", "siconos nsgs, Coulomb"])
def test_external_solvers_solve_the_problem_that_is_timed(name: str, packed: ContactProblem, tmp_path: Path) -> None:
    """A file with another friction coefficient: the answer solves that, and the figures show it."""
    if not available(name):
        pytest.skip(f"{name} is not installed")
    solver = by_name(name)
    slope = turned_gravity(packed, 0.3)
    wrong = replace(slope, mu=0.9 * slope.mu)
    asked = replace(task(wrong, tmp_path, solver, 1e-4), problem=slope)
    with pytest.raises(NotReachedError, match="natural-map residual") as caught:
        solver.solve(asked, 20.0)
    facts = caught.value.facts
    assert max(facts["natural_map"], facts["duality_gap"]) > 1e-3


@pytest.mark.parametrize("name", ["gauss-seidel", "gauss-seidel, Coulomb"])
def test_what_is_not_reached_in_time_is_reported_with_its_figures(
    name: str, packed: ContactProblem, tmp_path: Path
) -> None:
    solver = by_name(name)
    with pytest.raises(NotReachedError) as caught:
        solver.solve(task(packed, tmp_path, solver, 1e-14), 1e-3)
    facts = caught.value.facts
    assert set(facts) == {"iterations", "natural_map", "duality_gap", "seconds"}
    # A busy machine may take the whole millisecond away: no force at all is a natural map of 1.
    assert facts["iterations"] >= 0
    assert 0.0 < facts["natural_map"] <= 1.0


def rows_of(problem: ContactProblem, some: list[Solver]) -> list[Row]:
    found = cd.run_problem("p", lambda: problem, some, repeats=2, time_limit=20.0, notify=lambda _: None)
    return list(chain.from_iterable(found))


def test_rows_cold_and_warm_at_every_tolerance(problem: ContactProblem) -> None:
    some = [by_name(name) for name in ("interior-point", "gauss-seidel", "gauss-seidel, Coulomb")]
    rows = rows_of(problem, some)
    assert len(rows) == 3 * 2 * len(cd.TOLERANCES)
    assert {row["status"] for row in rows} == {"pass"}, [row["reason"] for row in rows]
    assert all(row["check_value"] <= row["check_bound"] for row in rows)
    assert all(row["ratio"] == 1.0 for row in rows if row["engine"] == row["base"])
    assert all(row["rate_unit"] == "ns/contact/sweep" for row in rows if row["engine"].startswith("gauss"))


@pytest.mark.skipif(usable_cores() < 2, reason="needs two cores")
def test_threads_have_rows_where_they_have_work(problem: ContactProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Same sweeps, same figures; a small problem, which one thread sweeps alone, has no such row."""
    some = [by_name("gauss-seidel"), by_name("gauss-seidel, 2 threads")]
    assert {row["threads"] for row in rows_of(problem, some)} == {1}
    monkeypatch.setattr(gauss_seidel, "STRIPED_FROM", 10)
    monkeypatch.setattr(cd, "STRIPED_FROM", 10)
    rows = rows_of(problem, some)
    assert {row["status"] for row in rows} == {"pass"}
    one, two = ([row for row in rows if row["threads"] == threads] for threads in (1, 2))
    for key in ("start", "tolerance", "iterations", "natural_map", "duality_gap"):
        assert [row[key] for row in one] == [row[key] for row in two]


def test_a_solver_that_claims_too_much_is_not_timed(problem: ContactProblem) -> None:
    base = by_name("interior-point")

    def boast(asked: Task, limit: float) -> Any:
        sample = base.solve(asked, limit)
        # Its own word is "solved", but the forces are 1 % off.
        result = InteriorPoint(SolverOptions(tolerance=1e-10)).solve(asked.problem)
        return replace(sample, facts=cd.facts_of(asked, 1.01 * result.r, 3))

    rows = rows_of(problem, [base, replace(base, name="boaster", solve=boast)])
    bad = [row for row in rows if row["engine"] == "boaster"]
    assert {row["status"] for row in bad} == {"fail"}
    assert all(math.isnan(row["median_s"]) and math.isnan(row["ratio"]) for row in bad)


def test_a_solver_that_misses_a_target_is_not_asked_for_more(problem: ContactProblem) -> None:
    asked: list[float] = []

    def weak(one: Task, limit: float) -> Any:  # noqa: ARG001
        asked.append(one.tolerance)
        raise NotReachedError("weak", {"natural_map": 0.1, "duality_gap": 0.2, "iterations": 5, "seconds": 2.0})

    base = by_name("interior-point")
    rows = rows_of(problem, [base, replace(base, name="weak", solve=weak, sweeps=True)])
    assert asked == [1e-4, 1e-4]
    row = next(row for row in rows if row["engine"] == "weak")
    assert (row["status"], row["natural_map"], row["duality_gap"]) == ("not-reached", 0.1, 0.2)
    assert row["rate"] == pytest.approx(1e9 * 2.0 / 5 / problem.n_contacts)


def test_names_and_sizes() -> None:
    assert list(cd.problems([1000, 10_000], large=True)) == [
        "packing-1000",
        "packing-10000",
        "column-1000",
        "lattice-50x200",
        "lattice-50x2000",
    ]
