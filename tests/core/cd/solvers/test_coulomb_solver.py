"""Proximal points for Coulomb's law, against closed forms, all solutions of tiny problems, Gauss-Seidel and the law itself."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np
import problems
import pytest
from numpy.typing import NDArray
from problems import FLOOR, law_broken
from scipy.linalg import block_diag
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ninedisk.core.cd.problem import ContactProblem, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import coulomb, proximal
from ninedisk.core.cd.solvers.factorise import UnsymmetricMatrix
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError
from ninedisk.core.cd.solvers.gauss_seidel import solve_gauss_seidel
from ninedisk.core.cd.solvers.outcome import SolverResult
from ninedisk.core.cd.solvers.proximal import ProximalPoint
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.errors import SolverNotConvergedError

FloatArray = NDArray[np.float64]
TIGHT = SolverOptions(tolerance=1e-10)


def solve(problem: ContactProblem, options: SolverOptions = TIGHT) -> SolverResult:
    return ProximalPoint(options).solve(problem)


def on_floor(push: float, mu: float, load: float = -1.0) -> ContactProblem:
    """One body of mass 1 that does not turn, on a floor."""
    return ContactProblem(
        mass=[[1.0, 1.0, np.inf]],
        force=[[push, load, 0.0]],
        bodies=[[0, -1]],
        normal=[[0.0, -1.0]],
        arms=[[0.0, 0.0, 1.0, 0.0]],
        offset=[[0.0, 0.0]],
        mu=[mu],
    )


def heap(contacts: int) -> ContactProblem:
    """A lattice under gravity in a box without lid, some contacts missing: more forces than equations of balance."""
    rng = np.random.default_rng(3)
    packing = problems.tile(rng, contacts, (FLOOR, problems.LEFT, problems.RIGHT), hexagonal=True)
    packing = packing.keep(rng.random(len(packing.bodies)) < 0.9)
    c = len(packing.bodies)
    return ContactProblem(
        mass=packing.mass,
        force=np.column_stack([np.zeros(len(packing.x)), -packing.mass[:, 0], np.zeros(len(packing.x))]),
        bodies=packing.bodies,
        normal=packing.normal,
        arms=packing.arms,
        offset=np.zeros((c, 2)),
        mu=np.full(c, 0.3),
    )


@pytest.mark.parametrize(
    ("push", "mu", "v"),
    [(1.0, 0.5, (0.5, 0.0)), (-1.0, 0.5, (-0.5, 0.0)), (0.4, 0.5, (0.0, 0.0)), (1.0, 0.0, (1.0, 0.0))],
    ids=["slips", "slips back", "sticks", "smooth"],
)
def test_one_body_on_a_floor(push: float, mu: float, v: tuple[float, float]) -> None:
    """It slips with push - mu, or sticks, and never lifts off."""
    found = solve(on_floor(push, mu))
    assert found.v[0, :2] == pytest.approx(v, abs=1e-10)
    assert found.r[0, 0] == pytest.approx(1.0, abs=1e-10)
    assert (found.solver, found.sliding) == ("interior-point", "coulomb")


def test_a_body_that_leaves_needs_no_iteration() -> None:
    found = solve(on_floor(1.0, 0.5, load=1.0))
    assert (found.iterations, found.r.tolist()) == (0, [[0.0, 0.0]])


@pytest.mark.parametrize("index", [problems.BUILDERS.index(builder) for builder in problems.BUILDERS])
def test_every_kind_of_problem_is_solved(index: int) -> None:
    """The law itself, to the square root of the tolerance at worst: a product of two numbers is what the tolerance bounds."""
    problem = problems.problem(index)
    found = solve(problem)
    judged = measure(problem, found.v, found.r, sliding="coulomb")
    assert judged.reached(1e-10)
    assert law_broken(problem, found.r) < 1e-5
    assert law_broken(problem, 1.01 * found.r) > 1e-5 or not found.r.any()


def test_forces_are_those_of_gauss_seidel_where_they_are_unique() -> None:
    problem = replace(heap(80), compliance=np.full((heap(80).n_contacts, 2), 0.3))
    swept = solve_gauss_seidel(problem, TIGHT, sliding="coulomb")
    # Residuals of 1e-10 and compliances of a tenth of the largest ones: an error of some 1e-9.
    assert solve(problem).r == pytest.approx(swept.r, abs=1e-8 * float(swept.r.max()))


def test_a_heap_at_rest_is_solved_where_sweeps_crawl() -> None:
    problem = heap(600)
    found = solve(problem)
    assert found.residuals.reached(1e-10)
    assert found.iterations < 100
    with pytest.raises(SolverNotConvergedError):
        solve_gauss_seidel(problem, replace(TIGHT, max_iterations=2000), sliding="coulomb")


def test_the_result_does_not_depend_on_the_units() -> None:
    problem = heap(100)
    length, mass = 1e-3, 1e4
    scaled = replace(
        problem,
        mass=problem.mass * mass * [1.0, 1.0, length**2],
        arms=problem.arms * length,
        force=problem.force * mass * length * [1.0, 1.0, length],
    )
    one, other = solve(problem), solve(scaled)
    assert one.iterations == other.iterations
    assert other.r / (mass * length) == pytest.approx(one.r, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("problem", [problems.of_kind(problems.blocked, 10), heap(300)], ids=["blocked", "heap"])
def test_the_matrix_is_that_of_the_dense_product(problem: ContactProblem) -> None:
    rng = np.random.default_rng(5)
    d = rng.normal(0.0, 0.1, (problem.n_contacts, 2, 2)) + np.eye(2)
    matrix = UnsymmetricMatrix(problem)
    assert matrix.factorise(d)
    h, mass = problem.jacobian().toarray(), np.where(problem.free > 0.0, problem.mass, 1.0)
    right = rng.normal(size=mass.shape) * problem.free

    def check() -> None:
        dense = np.diag(mass.ravel()) + h.T @ block_diag(*d) @ h
        expected = np.linalg.solve(dense, right.ravel()).reshape(-1, 3)
        assert matrix.solve(right) == pytest.approx(expected, rel=1e-8, abs=1e-8)
        assert matrix.sign() == np.linalg.slogdet(dense)[0]

    check()
    # Blocks changed one by one, some of them twice, some so stiff that the others are round-off beside them.
    for k in (0, 3, 1, 3, 5, 0):
        d[k] = rng.normal(0.0, 10.0 ** rng.uniform(0.0, 6.0) if k != 3 else 1.0, (2, 2))
        assert matrix.factorise(d, np.array([k]))
        check()
    d[0, 0, 0] = np.nan
    assert not matrix.factorise(d, np.array([0]))
    d[0] = np.eye(2)
    # After one in vain all is made anew.
    assert matrix.factorise(d, np.array([5]))
    check()
    check()


def test_auto_takes_what_reaches_the_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps where they do, else their polish, else what nothing slides in or proximal points, else sweeps to the limit; all count."""
    solver = ContactSolver("auto", TIGHT, "coulomb")
    assert solver.solve(on_floor(1.0, 0.5)).solver == "gauss-seidel"
    problem = heap(600)
    monkeypatch.setattr(coulomb.Polish, "improve", lambda *_, **__: None)
    monkeypatch.setattr(coulomb, "MANY_STAGES", ((500, 20),))
    found = solver.solve(problem)
    assert found.solver == "proximal-point"
    assert found.iterations > 500
    limited = ContactSolver("auto", replace(TIGHT, max_iterations=700), "coulomb")
    monkeypatch.setattr(coulomb.CoulombSearch, "equilibrium", lambda *_: None)
    monkeypatch.setattr(proximal, "MAX_ITERATIONS", 40)
    monkeypatch.setattr(proximal, "EACH", 0)
    with pytest.raises(SolverNotConvergedError, match=r"gauss-seidel stopped .* after 700 iterations") as caught:
        limited.solve(problem)
    # The best forces of all methods.
    forces, figures = caught.value.forces, caught.value.residuals
    assert forces is not None
    assert figures is not None
    assert measure(problem, problem.body_velocity(forces), forces, sliding="coulomb") == figures
    with pytest.raises(SolverNotConvergedError) as alone:
        solve_gauss_seidel(problem, limited.options, sliding="coulomb")
    assert alone.value.residuals is not None
    assert figures.worst < 0.5 * alone.value.residuals.worst


def test_limits_are_kept_and_contradictions_found() -> None:
    with pytest.raises(SolverNotConvergedError, match=r"proximal-point stopped .* use gauss-seidel"):
        solve(heap(100), SolverOptions(max_iterations=3))
    walls = on_floor(0.0, 0.5)
    squeezed = replace(
        walls,
        bodies=[[0, -1], [0, -1]],
        normal=[[0.0, -1.0], [0.0, 1.0]],
        arms=np.tile(walls.arms, (2, 1)),
        offset=[[-1e-3, 0.0], [-1e-3, 0.0]],
        mu=[0.5, 0.5],
        compliance=np.zeros((2, 2)),
        shear_0=np.zeros(2),
    )
    with pytest.raises(InfeasibleContactsError):
        solve(squeezed, SolverOptions(max_iterations=60))


def test_where_nothing_slides_the_associated_rule_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """A lattice at rest on a floor between walls: no unsymmetric factorisation is needed."""
    rng = np.random.default_rng(1)
    packing = problems.tile(rng, 2_000, (FLOOR, problems.LEFT, problems.RIGHT))
    c = len(packing.bodies)
    problem = ContactProblem(
        mass=packing.mass,
        force=np.column_stack([np.zeros(len(packing.x)), -packing.mass[:, 0], np.zeros(len(packing.x))]),
        bodies=packing.bodies,
        normal=packing.normal,
        arms=packing.arms,
        offset=np.zeros((c, 2)),
        mu=np.full(c, 0.3),
    )
    monkeypatch.setattr(proximal, "_PointSequence", None)
    found = solve(problem)
    assert found.sliding == "coulomb"
    assert found.iterations < 30
    assert law_broken(problem, found.r) < 1e-5


def test_many_contacts_are_asked_for_equilibrium() -> None:
    """Of the solutions of a heap with friction 2, those in which it collapses among them, the one in which it stays."""
    problem = replace(heap(3_000), mu=np.full(heap(3_000).n_contacts, 2.0))
    found = ContactSolver("auto", TIGHT, "coulomb").solve(problem)
    assert (found.solver, found.sliding) == ("interior-point", "coulomb")
    assert np.abs(found.v).max() < 1e-10, "the tolerance, of velocities near 1 where it falls; 6e-14"


@pytest.fixture(scope="module")
def collapse() -> ContactProblem:
    """A thousand disks, a third of their contacts missing, pushed off the only wall: it slides, in many contacts."""
    packing = problems.tile(np.random.default_rng(3), 3_000, (FLOOR, problems.LEFT), hexagonal=True)
    rng = np.random.default_rng(4)
    packing = packing.keep(rng.random(len(packing.bodies)) < 0.7)
    c = len(packing.bodies)
    return ContactProblem(
        mass=packing.mass,
        force=np.column_stack([0.3 * packing.mass[:, 0], -packing.mass[:, 0], np.zeros(len(packing.x))]),
        bodies=packing.bodies,
        normal=packing.normal,
        arms=packing.arms,
        offset=np.zeros((c, 2)),
        mu=rng.uniform(0.1, 0.5, c),
    )


def test_a_thousand_sliding_disks(collapse: ContactProblem) -> None:
    found = solve(collapse)
    u = collapse.contact_velocity(found.v, found.r)
    loaded = found.r[:, 0] > 1e-6 * found.r[:, 0].max()
    assert (loaded & (np.abs(u[:, 1]) > 1e-3 * np.abs(u).max())).sum() > 100
    assert (np.abs(found.r[:, 1]) <= collapse.mu * found.r[:, 0] * (1.0 + 1e-12)).all()
    assert measure(collapse, found.v, found.r, sliding="coulomb").worst < 1e-10
    assert law_broken(collapse, found.r) < 1e-6
    swept = ContactSolver("auto", TIGHT, "coulomb").solve(collapse)
    assert measure(collapse, swept.v, swept.r, sliding="coulomb").worst < 1e-10
    assert swept.iterations < 2_000, "1,649; 5,160 where many contacts are swept and followed as few are"
    loose = ContactSolver("auto", replace(TIGHT, tolerance=1e-5), "coulomb").solve(collapse)
    assert loose.iterations <= swept.iterations, "4,684 where what is asked for loosely is swept as few contacts are"


def test_forces_of_the_associated_rule_are_tight_where_the_law_is_asked_for_loosely(collapse: ContactProblem) -> None:
    """What a walk begins at: at the law's own tolerance they would have an error of 2e-4."""
    r = proximal._Search(collapse, replace(TIGHT, tolerance=1e-3)).associated()
    assert r is not None
    assert measure(collapse, collapse.body_velocity(r), r, sliding="associated").worst < 1e-8


def test_compliance_is_raised_until_a_point_is_found(collapse: ContactProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tenfold at contacts in its path, to 1e-3 at least and 1 at most; once it is found all are lowered to 0.8 of what they are then."""
    there = np.zeros(collapse.n_contacts, dtype=bool)
    there[collapse.n_contacts // 2] = True
    walk = proximal._PointSequence(proximal._Search(collapse, TIGHT), np.zeros((collapse.n_contacts, 2)), alike=0.1)
    for soft, tried in ((1e-2, (1e-2, 1e-1, 1.0)), (1e-7, (1e-7, 1e-3, 1e-2)), (0.5, (0.5, 1.0, 1.0))):
        seen = []

        def point(held: FloatArray, seen: list[FloatArray] = seen) -> tuple[FloatArray | None, NDArray[np.bool_]]:
            assert walk.law.soft is walk.soft
            seen.append(walk.soft)
            return (held if len(seen) == 3 else None), there

        monkeypatch.setattr(walk, "_point", point)
        walk.soft = np.full(collapse.n_contacts, soft)
        walk._next(np.zeros_like(walk.z))
        assert [of[there].item() for of in seen] == pytest.approx(tried)
        assert seen[-1].min() == soft, "far from there nothing is raised"
        assert walk.soft == pytest.approx(0.8 * seen[-1], rel=1e-15)


@pytest.mark.parametrize("alike", [proximal.ALIKE, proximal.ALL_ALIKE])
def test_compliance_falls_off_from_contact_to_contact(collapse: ContactProblem, alike: float) -> None:
    """By no more than the ratio from one contact to the next at a body: against the number of contacts between, found by SciPy."""
    c = collapse.n_contacts
    raised = [3, c // 2]
    walk = proximal._PointSequence(proximal._Search(collapse, TIGHT), np.zeros((c, 2)), alike)
    walk.soft = np.full(c, 1e-6)
    walk._raise_compliance(np.isin(np.arange(c), raised))
    pair, body = np.nonzero(collapse.bodies >= 0)
    at = coo_array((np.ones(len(pair)), (pair, collapse.bodies[pair, body]))).tocsr()
    away = dijkstra(at @ at.T, unweighted=True, indices=raised).min(axis=0)
    assert away[np.isfinite(away)].max() > 20
    # Some forty products, each rounded.
    assert walk.soft == pytest.approx(np.maximum(1e-3 * alike**away, 1e-6), rel=1e-14, abs=0.0)


@pytest.mark.parametrize("near", [False, True])
def test_a_walk_near_a_solution_begins_anew_at_each_turn(
    collapse: ContactProblem, monkeypatch: pytest.MonkeyPatch, near: bool
) -> None:
    """With the first compliance; else each of the two walks has it once."""
    monkeypatch.setattr(proximal, "SLICE", (40, 0.0))
    monkeypatch.setattr(proximal, "SLICE_NEAR", (40, 0.0))
    monkeypatch.setattr(proximal.Polish, "improve", lambda *_, **__: None)
    begun = []
    step = proximal._PointSequence._next

    def watched(walk: proximal._PointSequence, r: FloatArray) -> None:
        if (walk.soft == proximal.FIRST_SOFT).all():
            begun.append(walk.alike)
        step(walk, r)

    monkeypatch.setattr(proximal._PointSequence, "_next", watched)
    start = solve_gauss_seidel(collapse, replace(TIGHT, tolerance=1e-2), sliding="coulomb").r
    with pytest.raises(SolverNotConvergedError):  # no forces are that exact, so that turns go on
        ProximalPoint(replace(TIGHT, tolerance=1e-30, max_iterations=600)).solve(collapse, start, near=near)
    turns = [proximal.ALIKE, proximal.ALL_ALIKE]
    assert begun[:2] == turns
    assert len(begun) > 3 if near else begun == turns


def beside(one: ContactProblem, other: ContactProblem) -> ContactProblem:
    """Both as one problem, in which neither feels the other."""
    arrays = ("mass", "force", "normal", "arms", "offset", "mu", "compliance")
    both = {name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in arrays}
    bodies = np.where(other.bodies < 0, -1, other.bodies + one.n_bodies)
    return ContactProblem(bodies=np.concatenate([one.bodies, bodies]), **both)


@pytest.mark.parametrize("builder", ["hyperstatic", "blocked"])
def test_where_newtons_method_circles_is_distinguished_from_where_it_ends(builder: str) -> None:
    """It cycles in a small problem beside single bodies: the contacts that change are of that, and a path begins with all others
    solved."""
    index = {"hyperstatic": 1, "blocked": 127}[builder]
    small = problems.problem(index)
    assert problems.builder_of(index) == builder
    singles = [on_floor(push, mu) for push in np.linspace(-3.0, 3.0, 7) for mu in (0.0, 0.3, 1.0)]
    both = reduce(beside, singles, small)
    none = np.zeros((both.n_contacts, 2))
    walk = proximal._PointSequence(proximal._Search(both, TIGHT), none, proximal.ALIKE)
    walk.law.soft = np.full(both.n_contacts, 1e-4)
    begin = walk.law.at(walk.z, none)
    # Single bodies are off by the compliance at first, which goes with the first step, but for round-off.
    assert np.abs(begin.error[small.n_contacts :]).max() > 1e-5
    ended = walk._newton(begin, none)
    assert 0 < ended.wrong <= proximal.WRONG
    assert ended.changing.any()
    assert not ended.changing[small.n_contacts :].any()
    assert np.abs(ended.point.error[: small.n_contacts]).max() > 0.1
    assert np.abs(ended.point.error[small.n_contacts :]).max() < 1e-12
    assert walk.law.path(ended.point.z, ended.point.error, proximal.PIVOTS) is not None


def test_points_that_stay_near_the_first_do_not_converge(
    collapse: ContactProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The planted defect: the compliance acts on the difference from the first forces, not from the last ones; nothing is polished."""
    step = proximal._PointSequence._next
    held: list[FloatArray] = []

    def stays(walk: proximal._PointSequence, r: FloatArray) -> None:
        held.append(r)
        step(walk, held[0])

    monkeypatch.setattr(proximal.Polish, "improve", lambda *_, **__: None)
    # It takes 190; with the defect 6,000 leave a gap of 0.1.
    options = replace(TIGHT, tolerance=1e-6, max_iterations=600)
    assert measure(collapse, (found := solve(collapse, options)).v, found.r, sliding="coulomb").worst < 1e-6
    monkeypatch.setattr(proximal._PointSequence, "_next", stays)
    with pytest.raises(SolverNotConvergedError):
        solve(collapse, options)
