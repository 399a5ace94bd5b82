"""Sweeps over stripes: any number of threads gives the same bits, and a sweep is a sweep of the ordinary kind in another order."""

from __future__ import annotations

import numpy as np
import problems
import pytest
from methods import solve_interior_point
from numpy.typing import NDArray
from problems import FLOOR, LEFT, RIGHT

from ninedisk.core.cd.problem import ContactProblem, Sliding
from ninedisk.core.cd.problem_kernels import Contacts
from ninedisk.core.cd.session import CdSession
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import gauss_seidel
from ninedisk.core.cd.solvers.gauss_seidel import MOST_STRIPES, STRIPED_FROM, Stripes, solve_gauss_seidel
from ninedisk.core.cd.solvers.gauss_seidel_kernels import sweep
from ninedisk.core.errors import InvalidNumericsError, SolverNotConvergedError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.core.simulate import simulate

FloatArray = NDArray[np.float64]


def piled(contacts: int, compliance: float = 0.1) -> ContactProblem:
    """Two heaps side by side, in random numbering, one contact double; some disks held, some contacts smooth, some elastic."""
    rng = np.random.default_rng(7)
    one = problems.tile(rng, contacts // 2, (FLOOR, LEFT, RIGHT))
    c, b = len(one.bodies), len(one.x)
    bodies = np.concatenate([one.bodies, np.where(one.bodies >= 0, one.bodies + b, -1)])
    shuffled = rng.permutation(2 * b)
    bodies = np.where(bodies >= 0, shuffled[bodies], -1)
    order = np.append(rng.permutation(2 * c), 0)
    mass = np.tile(one.mass, (2, 1))
    mass[rng.integers(0, 2 * b, 3)] = np.inf
    normal, arms = np.tile(one.normal, (2, 1))[order], np.tile(one.arms, (2, 1))[order]
    held = np.isinf(mass).all(axis=1)
    moves = ((bodies >= 0) & ~held[bodies]).any(axis=1)[order]
    kept = order[moves]
    m = len(kept)
    return ContactProblem(
        mass=mass,
        force=rng.normal(0.0, 1.0, mass.shape) - [0.0, 3.0, 0.0],
        bodies=bodies[kept],
        normal=normal[moves],
        arms=arms[moves],
        offset=np.zeros((m, 2)),
        mu=np.where(rng.random(m) < 0.2, 0.0, 0.4),
        compliance=compliance * rng.random((m, 2)) * (rng.random(m) < 0.5)[:, None],
        shear_0=rng.normal(0.0, 0.1, m),
    )


def clashes(stripes: Stripes) -> int:
    """Bodies that two stripes of one parity have in common."""
    count = 0
    for parity in range(2):
        seen: set[int] = set()
        for s in range(parity, len(stripes.bounds) - 1, 2):
            mine = set(stripes.pairs[stripes.bounds[s] : stripes.bounds[s + 1]].ravel().tolist()) - {-1}
            count += len(seen & mine)
            seen |= mine
    return count


def nothing(problem: ContactProblem) -> FloatArray:
    return np.zeros((problem.n_contacts, 2))


@pytest.mark.parametrize("contacts", [60, 1500])
def test_stripes_of_one_parity_share_no_body(contacts: int) -> None:
    problem = piled(contacts)
    stripes = Stripes(problem, nothing(problem), 1)
    assert 6 <= len(stripes.bounds) - 1 <= MOST_STRIPES
    assert stripes.bounds[0] == 0
    assert stripes.bounds[-1] == problem.n_contacts
    assert (np.diff(stripes.bounds) > 0).all()
    assert clashes(stripes) == 0
    stripes.pairs[stripes.bounds[2], 1] = stripes.pairs[stripes.bounds[4], 0]
    assert clashes(stripes) > 0


def test_one_body_in_all_contacts_leaves_nothing_to_share() -> None:
    """A large body with disks all around it: two stripes, one after the other."""
    n = 40
    angle = 2.0 * np.pi * np.arange(n) / n
    problem = ContactProblem(
        mass=np.ones((n + 1, 3)),
        force=np.vstack([[[0.0, 0.0, 0.0]], np.column_stack([-np.cos(angle), -np.sin(angle), 0.3 + 0.0 * angle])]),
        bodies=np.column_stack([np.zeros(n), np.arange(1, n + 1)]),
        normal=np.column_stack([np.cos(angle), np.sin(angle)]),
        arms=np.tile([0.0, 0.0, 5.0, 0.5], (n, 1)),
        offset=np.zeros((n, 2)),
        mu=np.full(n, 0.3),
    )
    stripes = Stripes(problem, nothing(problem), 4)
    assert len(stripes.bounds) - 1 <= 2
    assert clashes(stripes) == 0


@pytest.mark.sampled(1)
@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize("relaxation", [1.0, 1.5])
def test_a_sweep_is_that_of_the_reordered_contacts(sliding: Sliding, relaxation: float) -> None:
    problem = piled(300)
    r = 0.1 * np.abs(np.random.default_rng(1).normal(size=(problem.n_contacts, 2))) * [1.0, 0.2]
    r[:, 1] = np.minimum(r[:, 1], problem.mu * r[:, 0])
    stripes = Stripes(problem, r, 1)
    parity = np.repeat(np.arange(len(stripes.bounds) - 1) % 2, np.diff(stripes.bounds))
    order = stripes.order[np.argsort(parity, kind="stable")]
    assert np.array_equal(np.sort(order), np.arange(problem.n_contacts))
    reordered = Contacts(*(column[order] for column in problem.contacts))
    offset, shear_0, blocks = problem.offset[order], problem.shear_0[order], problem.blocks[order]
    v, given = problem.body_velocity(r), r[order]
    sweep(reordered, problem.inverse_mass, offset, shear_0, blocks, relaxation, sliding == "coulomb", 3, v, given)
    found = np.empty_like(r)
    stripes.sweep(3, relaxation, sliding == "coulomb", problem.body_velocity(r), found)
    # Three sweeps of sums of a dozen terms; the terms are added in another order.
    assert found[order] == pytest.approx(given, abs=1e-12 * float(np.abs(given).max()))


@pytest.mark.long
@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize("relaxation", [1.0, 1.5])
def test_threads_do_not_change_a_bit(sliding: Sliding, relaxation: float) -> None:
    problem = piled(2 * STRIPED_FROM)
    assert problem.n_contacts > STRIPED_FROM
    found = []
    for threads in (1, 2, 3, 4):
        options = SolverOptions(tolerance=1e-3, relaxation=relaxation, threads=threads)
        found.append(solve_gauss_seidel(problem, options, sliding=sliding))
    for other in found[1:]:
        assert np.array_equal(found[0].r, other.r)
        assert np.array_equal(found[0].v, other.v)
        assert (found[0].iterations, found[0].residuals) == (other.iterations, other.residuals)


def test_the_solution_is_the_optimum() -> None:
    """With compliance everywhere the forces are unique."""
    problem = piled(STRIPED_FROM + 300, compliance=0.3)
    assert problem.n_contacts >= STRIPED_FROM
    swept = solve_gauss_seidel(problem, SolverOptions(tolerance=1e-9, threads=2))
    best = problem.objective(solve_interior_point(problem, SolverOptions(tolerance=1e-12)).r)
    # A relative duality gap of 1e-9 bounds the error of the objective by as much of twice its value.
    assert abs(problem.objective(swept.r) - best) <= 2e-9 * abs(best)


def test_the_iteration_limit_holds_for_stripes() -> None:
    options = SolverOptions(tolerance=1e-14, max_iterations=7, threads=2)
    with pytest.raises(SolverNotConvergedError, match="after 7 iterations"):
        solve_gauss_seidel(piled(2 * STRIPED_FROM), options)


@pytest.mark.parametrize("threads", [0, 65, 1.5, True, "two"])
def test_impossible_numbers_of_threads_are_refused(threads: object) -> None:
    with pytest.raises(InvalidNumericsError, match=r"threads = .* whole number in \[1, 64\]"):
        SolverOptions(threads=threads)  # type: ignore[arg-type]


def test_a_run_has_the_same_bits_with_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gauss_seidel, "STRIPED_FROM", 10)
    law = ContactLaw(kn=1e6, ks=1e6, mu=0.3)
    x = problems.lattice(6, 5) * [1.001, 0.999] + [0.5, 0.5]
    disks = Disks(x=x, radius=np.full(30, 0.5), mass=np.ones(30))
    scene = Scene(
        disks=disks,
        disk_disk=law,
        walls=[Wall(name="floor", point=(0.0, 0.0), normal=(0.1, 1.0), law=law)],
        gravity=(1.0, -10.0),
    )
    numerics = Numerics(dt=2e-3, n_steps=20, solver="gauss-seidel", regime="dynamic", options={"cd.tolerance": 1e-6})
    monkeypatch.setattr(CdSession, "_batches_if_dynamic", lambda _: None)  # batches of steps are swept by one thread
    histories = [simulate(scene, numerics, method="cd", threads=threads) for threads in (1, 3)]
    assert np.array_equal(histories[0].x, histories[1].x)
    assert np.array_equal(histories[0].v, histories[1].v)
