"""Limits, warm starts, units and defects: what a contact solver must do besides converging."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
import problems
import pytest
import scipy.sparse as sp
from methods import Solve, each_solver, solve_interior_point
from numpy.typing import NDArray
from problems import FLOOR, LEFT, RIGHT, of_kind
from scipy.sparse.linalg import splu

from ninedisk.core.cd.problem import ContactProblem, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import factorise
from ninedisk.core.cd.solvers.factorise import SupernodalCholesky
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.errors import SolverNotConvergedError

FloatArray = NDArray[np.float64]


def without_contact(problem: ContactProblem, k: int) -> ContactProblem:
    """The problem without its contact ``k``."""
    rows = ("bodies", "normal", "arms", "offset", "mu", "compliance", "shear_0")
    return replace(problem, **{name: np.delete(getattr(problem, name), k, axis=0) for name in rows})


@each_solver
@pytest.mark.parametrize("iterations", [1, 8])
def test_the_iteration_limit_is_kept(solve: Solve, iterations: int) -> None:
    problem = of_kind(problems.static, 50)
    options = SolverOptions(tolerance=1e-15, max_iterations=iterations)
    with pytest.raises(SolverNotConvergedError, match=r"natural-map residual .* duality gap") as error:
        solve(problem, options)
    reported = int(str(error.value).split(" iterations")[0].split()[-1])
    assert reported <= iterations


@pytest.mark.timing
@each_solver
def test_the_time_limit_is_kept_to_within_a_factor_of_two(solve: Solve) -> None:
    """A lattice of 20,000 elastic contacts: the interior point needs 18 iterations, Gauss-Seidel thousands.

    The limit is twice what the first iteration takes with all that comes before it, so that one more, which may have begun when the time
    is over, stays within the factor on a machine of any speed.
    """
    x = problems.lattice(100, 100)
    packing = problems.pack(x, np.full(len(x), 0.5), 0.01, (FLOOR, LEFT, RIGHT))
    c = len(packing.bodies)
    problem = ContactProblem(
        mass=packing.mass,
        force=np.random.default_rng(2).normal(0.0, 1.0, packing.mass.shape),
        bodies=packing.bodies,
        normal=packing.normal,
        arms=packing.arms,
        offset=np.zeros((c, 2)),
        mu=np.full(c, 0.5),
        compliance=np.full((c, 2), 1e-3),
    )
    options = SolverOptions(tolerance=1e-16)
    first = 0.0
    for _ in range(2):  # the first run compiles
        begin = perf_counter()
        with pytest.raises(SolverNotConvergedError):
            solve(problem, replace(options, max_iterations=1))
        first = perf_counter() - begin
    limit = max(2.0 * first, 0.2)
    begin = perf_counter()
    with pytest.raises(SolverNotConvergedError, match="time limit"):
        solve(problem, replace(options, time_limit=limit))
    assert limit <= perf_counter() - begin <= 5.0 * limit


@each_solver
def test_the_solution_itself_is_a_good_start(solve: Solve) -> None:
    """Gauss-Seidel has nothing left to do.

    The interior point is moved off the boundary of the cones and has to come back: one step where the problem is regular.
    """
    options = SolverOptions(tolerance=1e-10)
    iterations = []
    for index in range(0, problems.COUNT, 4):
        problem = problems.problem(index)
        found = InteriorPoint(SolverOptions(tolerance=1e-12)).solve(problem)
        again = solve(problem, options, start=found.r)
        iterations.append(again.iterations)
        assert again.residuals.reached(1e-10)
    if solve is solve_interior_point:
        assert np.median(iterations) <= 2
        assert np.mean(np.array(iterations) <= 4) >= 0.85
    else:
        # Where the mass is next to none, velocities that follow from the forces are less accurate than the interior point's.
        assert np.mean(np.array(iterations) == 0) >= 0.9


def test_the_symbolic_factorisation_lasts_as_long_as_the_contact_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    """Analyses are counted where they happen: at each backend's creation."""
    made: list[int] = []
    original = SupernodalCholesky.__init__

    def count(self: Any, indptr: Any, indices: Any) -> None:
        made.append(len(indices))
        original(self, indptr, indices)

    monkeypatch.setattr(SupernodalCholesky, "__init__", count)
    problem = of_kind(problems.loose, 100)
    solver = InteriorPoint(SolverOptions())
    solver.solve(problem)
    graph = solver._graph
    assert graph is not None
    for factor in (0.5, 2.0, -1.0):
        solver.solve(replace(problem, force=factor * problem.force, mu=1.5 * problem.mu))
        assert solver._graph is graph
    assert len(made) == 1
    fewer = without_contact(problem, 3)
    found = solver.solve(fewer)
    assert solver._graph is not graph
    assert len(made) == 2
    assert np.array_equal(found.r, InteriorPoint(SolverOptions()).solve(fewer).r)


def in_units(
    problem: ContactProblem, length: float, mass: float, time: float
) -> tuple[ContactProblem, float, FloatArray]:
    """The same problem with other units; the factors by which its forces (momenta) and body velocities differ."""
    spin = np.array([1.0, 1.0, length])
    speed, momentum = length / time, mass * length / time
    changed = replace(
        problem,
        mass=problem.mass * mass * spin**2,
        force=problem.force * momentum * spin,
        arms=problem.arms * length,
        offset=problem.offset * speed,
        compliance=problem.compliance / mass,
        shear_0=problem.shear_0 * momentum,
    )
    return changed, momentum, speed / spin


UNITS = [(1e-3, 1e6, 1e3), (1e3, 1e-6, 1e-3), (1e-9, 1e-12, 1e6)]


@pytest.mark.parametrize("units", UNITS)
def test_residuals_do_not_depend_on_the_units(units: tuple[float, float, float]) -> None:
    """The figures of a rough solution, which is no root of them, agree to the round-off of its conversion."""
    for index in range(0, problems.COUNT, 7):
        problem = problems.problem(index)
        changed, momentum, speed = in_units(problem, *units)
        r = np.array(solve_interior_point(problem, SolverOptions(tolerance=1e-10)).r) * 1.01
        v = problem.body_velocity(r)
        one, other = measure(problem, v, r), measure(changed, v * speed, r * momentum)
        for name in ("natural_map", "complementarity", "duality_gap"):
            assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-8, abs=1e-13), (index, name)
        assert other.floor_map == pytest.approx(one.floor_map, rel=1e-8)


@each_solver
@pytest.mark.parametrize("units", UNITS)
def test_solutions_do_not_depend_on_the_units(solve: Solve, units: tuple[float, float, float]) -> None:
    """To the tolerance: round-off of the conversion takes the iterations elsewhere."""
    problem = of_kind(problems.ratios, 60)
    changed, momentum, speed = in_units(problem, *units)
    options = SolverOptions(tolerance=1e-11)
    one, other = solve(problem, options), solve(changed, options)
    assert np.abs(other.v / speed - one.v).max() <= 1e-7 * np.abs(one.v).max()
    value = problem.objective(one.r) * momentum * units[0] / units[2]
    assert changed.objective(other.r) == pytest.approx(value, rel=1e-9)


@each_solver
def test_units_that_are_powers_of_four_change_no_bit(solve: Solve) -> None:
    """Then no conversion rounds, roots included: any constant of a solver that had a unit would show."""
    for builder in (problems.ratios, problems.blocked, problems.mixed, problems.driven):
        problem = of_kind(builder, 60)
        changed, momentum, speed = in_units(problem, 4.0**-5, 4.0**10, 4.0**6)
        options = SolverOptions(tolerance=1e-9)
        one, other = solve(problem, options), solve(changed, options)
        assert other.iterations == one.iterations
        assert np.array_equal(other.r, one.r * momentum)
        assert np.array_equal(other.v, one.v * speed)
        assert other.residuals == one.residuals


@pytest.mark.parametrize("defect", ["friction", "compliance", "contact"])
def test_the_figures_see_a_defect(defect: str) -> None:
    """Forces of the wrong sign of friction, of contacts without their compliance, of a contact left out."""
    problem = of_kind(problems.mixed, 100)
    found = solve_interior_point(problem, SolverOptions(tolerance=1e-12))
    assert measure(problem, problem.body_velocity(found.r), found.r).worst <= 1e-10
    if defect == "friction":
        r = found.r * [1.0, -1.0]
    elif defect == "compliance":
        r = solve_interior_point(replace(problem, compliance=np.zeros_like(problem.compliance))).r
    else:
        k = int(np.argmax(found.r[:, 0]))
        r = np.insert(solve_interior_point(without_contact(problem, k)).r, k, 0.0, axis=0)
    figures = measure(problem, problem.body_velocity(r), r)
    assert figures.natural_map > 1e-3
    assert figures.duality_gap > 1e-3
    assert not figures.reached(1e-3)


def test_velocities_that_do_not_follow_from_the_forces_are_seen() -> None:
    """The two figures together also judge a pair: velocities of one problem with the forces of another."""
    problem = of_kind(problems.loose, 100)
    found = solve_interior_point(problem)
    assert measure(problem, 1.001 * found.v, found.r).duality_gap > 1e-7
    assert measure(problem, found.v, found.r).stationarity <= 1e-14


@each_solver
def test_nothing_to_do_takes_no_iterations(solve: Solve) -> None:
    """No contacts, and contacts that nothing presses together."""
    problem = of_kind(problems.hyperstatic, 20)
    unloaded = solve(replace(problem, force=np.zeros_like(problem.force), shear_0=np.zeros_like(problem.shear_0)))
    assert unloaded.iterations == 0
    assert not unloaded.v.any()
    none = np.zeros(problem.n_contacts, dtype=bool)
    rows = ("bodies", "normal", "arms", "offset", "mu", "compliance", "shear_0")
    alone = solve(replace(problem, **{name: getattr(problem, name)[none] for name in rows}))
    assert np.array_equal(alone.v, problem.inverse_mass * problem.force)


class Lu:
    """SuperLU in the place of our own factorisation."""

    def __init__(self, indptr: NDArray[np.int64], indices: NDArray[np.int64]) -> None:
        self._indptr, self._indices = indptr, indices

    def update(self, data: FloatArray) -> bool:
        upper = sp.csc_matrix((data, self._indices, self._indptr))
        self._lu = splu(sp.csc_matrix(upper + sp.triu(upper, 1).T))
        return True

    def solve(self, right: FloatArray) -> FloatArray:
        solution: FloatArray = self._lu.solve(right)
        return solution


@pytest.mark.parametrize("builder", problems.BUILDERS, ids=lambda builder: builder.__name__)
def test_the_solution_does_not_depend_on_the_factorisation(builder: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Either solves to the same tolerance: what it leaves, 1e-12 of the energy, is sqrt(2e-12) of the velocities."""
    problem = of_kind(builder, 100)
    options = SolverOptions(tolerance=1e-12)
    solver = InteriorPoint(options)
    found = solver.solve(problem)
    assert solver._graph is not None
    assert isinstance(solver._graph.factorisation, SupernodalCholesky)
    monkeypatch.setattr(factorise, "factorisation", Lu)
    other = solve_interior_point(problem, options)
    mass = np.where(problem.free > 0.0, problem.mass, 0.0)
    kinetic = float((mass * (found.v - other.v) ** 2).sum())
    energy = 2.0 * abs(problem.objective(other.r))
    assert np.sqrt(kinetic / energy) <= 1.5e-6
    assert problem.objective(found.r) == pytest.approx(problem.objective(other.r), rel=1e-11)
