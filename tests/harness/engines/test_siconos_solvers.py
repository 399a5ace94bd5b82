"""The core's Coulomb solver and its residuals against Siconos, which shares no code with them; skipped where it is absent."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from ninedisk.core.cd.problem import ContactProblem, measure
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.gauss_seidel import solve_gauss_seidel
from ninedisk.core.cd.solvers.interior_point import InteriorPoint
from ninedisk.core.cd.solvers.outcome import SolverResult
from ninedisk.core.errors import SolverNotConvergedError
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError
from ninedisk.harness.engines import process
from ninedisk.harness.engines.siconos import adapter as siconos
from ninedisk.harness.engines.siconos import solvers as siconos_solvers
from ninedisk.harness.engines.siconos.solvers import Solution, evaluate_saved, judge, solve_saved

VERSION, REASON = siconos.installed_siconos(process.SYSTEM_PYTHON)
pytestmark = pytest.mark.slow
needs_siconos = pytest.mark.skipif(VERSION is None, reason=f"Siconos is not installed ({REASON}): {siconos.INSTALL}")

N_PROBLEMS = 130
TOLERANCE = 1e-12
SWEEPS = 40_000
SOLVED = 1e-10
"""Residual of a solution: a hundred times the solvers' tolerance, whose norms differ; failures lie above 1e-4."""


def random_problem(seed: int) -> ContactProblem:
    """Disks on a shaken lattice, at most 64, so that Siconos' dense matrices stay small; standing still satisfies every contact."""
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


class Compared(NamedTuple):
    """Random problems with Siconos' answers and our own, None where ours did not converge."""

    problems: list[ContactProblem]
    files: list[Path]
    nsgs: list[Solution]
    lemke: list[Solution]
    ours: list[SolverResult | None]


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Compared:
    folder = tmp_path_factory.mktemp("problems")
    problems = [random_problem(seed) for seed in range(N_PROBLEMS)]
    files = [folder / f"{k}.npz" for k in range(N_PROBLEMS)]
    for problem, file in zip(problems, files, strict=True):
        problem.save(file)
    nsgs = solve_saved(files, "nsgs", tolerance=TOLERANCE, max_iterations=SWEEPS)
    lemke = solve_saved(files, "lemke")
    return Compared(problems, files, nsgs, lemke, [_ours(problem) for problem in problems])


def _ours(problem: ContactProblem) -> SolverResult | None:
    options = SolverOptions(tolerance=TOLERANCE, max_iterations=SWEEPS)
    try:
        return solve_gauss_seidel(problem, options, sliding="coulomb")
    except SolverNotConvergedError:
        return None


def contact_velocity(problem: ContactProblem, r: FloatArray) -> FloatArray:
    return problem.contact_velocity(problem.body_velocity(r), r)


def speed(problem: ContactProblem) -> float:
    """Largest contact velocity without contact forces."""
    return float(np.abs(problem.b).max())


@needs_siconos
def test_both_gauss_seidels_find_the_same_velocities(compared: Compared) -> None:
    """At least a hundred problems; tolerance by linear convergence.

    An iteration that needs N sweeps for a residual of 1e-12 contracts by 1e-12^(1/N) a sweep; what is left when it stops
    is the residual times ``1/(1 - contraction)``, about ``N/ln(1e12)``. Each side leaves that much of the velocities.
    """
    found = 0
    for problem, theirs, ours in zip(compared.problems, compared.nsgs, compared.ours, strict=True):
        if ours is None or theirs.status != 0:
            # Gauss-Seidel need not converge under Coulomb's law; neither side claims that it did.
            assert ours is None
            assert judge(problem, theirs).worst > SOLVED
            continue
        found += 1
        assert judge(problem, theirs).worst <= SOLVED
        left = 2.0 * TOLERANCE * (1.0 + theirs.iterations / np.log(1.0 / TOLERANCE))
        difference = np.abs(contact_velocity(problem, theirs.r) - contact_velocity(problem, ours.r)).max()
        assert difference <= left * speed(problem)
    assert found >= 100


@needs_siconos
def test_lemke_is_a_direct_method_but_its_word_is_not_enough(compared: Compared) -> None:
    """It always reports success. Where friction is absent velocities are unique, and the same as ours."""
    assert {answer.status for answer in compared.lemke} == {0}
    solved = [judge(problem, answer).worst <= SOLVED for problem, answer in zip(*compared[0:4:3], strict=True)]
    assert 0.8 * N_PROBLEMS <= sum(solved) < N_PROBLEMS
    smooth = 0
    for problem, theirs, ours, good in zip(*compared[0:5:3], compared.ours, solved, strict=False):
        if ours is not None and good and not problem.mu.any():
            smooth += 1
            left = 2.0 * TOLERANCE * (1.0 + ours.iterations / np.log(1.0 / TOLERANCE))
            difference = np.abs(contact_velocity(problem, theirs.r) - contact_velocity(problem, ours.r)).max()
            assert difference <= left * speed(problem)
    assert smooth >= 20


@needs_siconos
def test_large_friction_has_several_solutions(compared: Compared) -> None:
    """With mu = 2 pivoting and Gauss-Seidel end in different velocities, both with the residual of a solution."""
    apart = []
    for problem, lemke, nsgs in zip(compared.problems, compared.lemke, compared.nsgs, strict=True):
        if max(judge(problem, lemke).worst, judge(problem, nsgs).worst) <= SOLVED:
            difference = np.abs(contact_velocity(problem, lemke.r) - contact_velocity(problem, nsgs.r)).max()
            if difference > 1e-3 * speed(problem):
                apart.append(float(problem.mu.max()))
    assert len(apart) >= 3
    assert min(apart) == 2.0


@needs_siconos
def test_residual_is_siconos_own_error_function(compared: Compared) -> None:
    """On rows multiplied by rho, Siconos' natural map is the numerator of ours; both are of any forces, solved or not."""
    rng = np.random.default_rng(3)
    forces = []
    for problem, ours in zip(compared.problems, compared.ours, strict=True):
        p = rng.exponential(1.0, problem.n_contacts) if ours is None else 1.1 * ours.r[:, 0]
        forces.append(np.column_stack([p, problem.mu * p * rng.uniform(-1.0, 1.0, len(p))]))
    for problem, r, theirs in zip(compared.problems, forces, evaluate_saved(compared.files, forces), strict=True):
        ours = measure(problem, problem.body_velocity(r), r, sliding="coulomb")
        free = problem.rho[:, None] * problem.b * np.column_stack([np.ones_like(problem.mu), problem.mu > 0.0])
        scale = max(np.linalg.norm(r), np.linalg.norm(_on_cones(-free, problem.mu)))
        if scale == 0.0:
            assert theirs.scaled_error == 0.0  # nothing pushes and nothing approaches
            continue
        assert ours.natural_map * scale == pytest.approx(theirs.scaled_error, rel=1e-12, abs=ours.floor_map * scale)
        assert theirs.u == pytest.approx(contact_velocity(problem, r), rel=0, abs=1e-12 * (speed(problem) + 1.0))
        # |r - P(r - rho u)| grows with rho, and divided by rho it falls (Gafni and Bertsekas), contact by contact.
        low, high = min(1.0, float(problem.rho.min())), max(1.0, float(problem.rho.max()))
        plain = theirs.error * max(np.linalg.norm(r), np.linalg.norm(theirs.u))
        slack = 1e-12 * (plain + theirs.scaled_error)
        assert low * plain - slack <= theirs.scaled_error <= high * plain + slack
    assert max(theirs.scaled_error for theirs in evaluate_saved(compared.files, forces)) > 1e-3


def _on_cones(r: FloatArray, mu: FloatArray) -> FloatArray:
    """Projection of each contact's pair on the cone ``|q| <= mu p``, on its two edges and its inside, whichever is nearest."""
    best = np.zeros_like(r)
    for edge in (-1.0, 1.0):
        along = np.column_stack([np.ones_like(mu), edge * mu]) / np.hypot(1.0, mu)[:, None]
        foot = np.maximum((r * along).sum(axis=1), 0.0)[:, None] * along
        nearer = np.linalg.norm(foot - r, axis=1) < np.linalg.norm(best - r, axis=1)
        best[nearer] = foot[nearer]
    inside = (r[:, 0] >= 0.0) & (np.abs(r[:, 1]) <= mu * r[:, 0])
    best[inside] = r[inside]
    return best


@needs_siconos
def test_residual_sees_a_wrong_solution(compared: Compared) -> None:
    seen = 0
    for problem, answer in zip(compared.problems, compared.nsgs, strict=True):
        if answer.r.any():
            wrong = siconos_solvers.Evaluation(r=1.001 * answer.r, u=answer.u, error=0.0, scaled_error=0.0)
            seen += judge(problem, wrong).worst > 1e-5
    assert seen >= 100


@needs_siconos
def test_associated_rule_is_another_law_where_contacts_slide(compared: Compared) -> None:
    """Its velocities satisfy ``u_n >= mu |u_t|``; Coulomb's do not where they slide, and are at least that far away."""
    sliding, far = 0, 0.0
    for problem, ours, theirs in zip(compared.problems, compared.ours, compared.nsgs, strict=True):
        if ours is None:
            continue
        u = contact_velocity(problem, theirs.r)
        dual = np.maximum(problem.mu * np.abs(u[:, 1]) - u[:, 0], 0.0) / np.hypot(1.0, problem.mu)
        associated = InteriorPoint(SolverOptions(tolerance=TOLERANCE)).solve(problem)
        apart = np.linalg.norm(contact_velocity(problem, associated.r) - u, axis=1)
        assert apart.max() >= dual.max() - 1e-6 * speed(problem)
        if dual.max() > 1e-3 * speed(problem):
            sliding += 1
            far = max(far, float(apart.max()) / speed(problem))
        elif dual.max() <= 1e-9 * speed(problem):
            # No contact slides: Coulomb's solution is the associated one. A gap of 1e-12 leaves its root of velocities.
            assert apart.max() <= 1e-5 * speed(problem)
    assert sliding >= 50
    assert far > 0.1


@needs_siconos
def test_units_do_not_matter(compared: Compared, tmp_path: Path) -> None:
    """Masses and forces of 2^40 kg: W is 2^-40 times as large, below what Siconos takes for 0."""
    problem = compared.problems[12]
    unit = 2.0**40
    heavy = ContactProblem(
        mass=problem.mass * unit,
        force=problem.force * unit,
        bodies=problem.bodies,
        normal=problem.normal,
        arms=problem.arms,
        offset=problem.offset,
        mu=problem.mu,
        compliance=problem.compliance / unit,
        shear_0=problem.shear_0 * unit,
    )
    heavy.save(tmp_path / "heavy.npz")
    for solver, plain in (("nsgs", compared.nsgs[12]), ("lemke", compared.lemke[12])):
        (answer,) = solve_saved([tmp_path / "heavy.npz"], solver)  # type: ignore[arg-type]
        assert np.array_equal(answer.r, plain.r * unit)
        assert answer.iterations == plain.iterations


@needs_siconos
def test_what_is_no_problem_is_an_error(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(EngineError, match=r"Siconos gave up: KeyError: .*W_indptr|Siconos gave up: KeyError"):
        solve_saved([tmp_path / "other.npz"])


def test_missing_siconos_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(siconos_solvers, "SYSTEM_PYTHON", "no/such/python")
    with pytest.raises(EngineNotInstalledError, match="apt-get install python3-siconos"):
        solve_saved([])
