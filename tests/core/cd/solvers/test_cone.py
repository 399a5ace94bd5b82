"""Circular cones: exact single contacts, problems whose solution is built first, the plane as a special case, honest failures."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from ninedisk.core.cd.delassus import DelassusProblem, natural_map, project
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers.by_matrix import cone
from ninedisk.core.cd.solvers.by_matrix import cone_kernels as kernels
from ninedisk.core.cd.solvers.by_matrix.cone import largest_error
from ninedisk.core.cd.solvers.by_matrix.solve import solve_matrix
from ninedisk.references.contact_law import errors_of_forces

RULES = ["coulomb", "associated"]


def built(c, seed, sliding, *, rank=1.0, mu=(0.0, 0.1, 0.7, 2.0), unsymmetric=0.0):
    """A problem around a solution of all statuses: W of random bodies, then b from forces and velocities that obey the law."""
    rng = np.random.default_rng(seed)
    m = max(3, int(rank * 3 * c))
    h = rng.normal(size=(3 * c, m)) * (rng.random((3 * c, m)) < max(0.1, 4.0 / m))
    w = h @ h.T + np.diag(np.repeat(rng.uniform(0.5, 2.0, c), 3)) * (1e-3 if rank >= 1.0 else 0.0)
    for k in range(3 * c):  # no contact that nothing moves
        if w[k, k] == 0.0:
            w[k, k] = 1.0
    w *= 1.0 + unsymmetric * rng.uniform(-1.0, 1.0, w.shape)
    friction = rng.choice(mu, c)
    r, u = np.zeros((c, 3)), np.zeros((c, 3))
    for k in range(c):
        angle, size = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.5, 2.0)
        direction = np.array([np.cos(angle), np.sin(angle)])
        status = k % 3
        if status == 0:
            u[k] = [size, *(0.3 * size * direction)]
            if sliding == "associated":
                u[k, 0] += friction[k] * size
        else:
            r[k, 0] = size
            if status == 1 or friction[k] == 0.0:
                r[k, 1:] = 0.6 * friction[k] * size * direction
            else:
                slip = rng.uniform(0.1, 1.0)
                r[k, 1:], u[k, 1:] = friction[k] * size * direction, -slip * direction
                if sliding == "associated":
                    u[k, 0] = friction[k] * slip
    return DelassusProblem(w=w, b=u - (w @ r.ravel()).reshape(c, 3), mu=friction), r


def judged(problem, r, sliding):
    return errors_of_forces(problem.w, problem.b, problem.mu, r, associated=sliding == "associated")


@pytest.mark.parametrize("sliding", RULES)
def test_a_contact_alone_is_exact(sliding):
    """1,000 contacts; the tolerance is that of the direction, two roundings, over blocks of condition up to 1e4."""
    rng = np.random.default_rng(0)
    statuses = set()
    for _ in range(1000):
        g = rng.normal(size=(3, rng.integers(3, 6)))
        a, mu = (g @ g.T)[None], rng.choice([0.0, 1e-3, 0.1, 0.5, 1.0, 3.0])
        b = rng.normal(size=3) - [1.0, 0.0, 0.0]
        if np.linalg.cond(a[0]) > 1e4:
            continue
        r = np.array(kernels.solve_cone_contact(a, 0, *b, mu, sliding == "coulomb", *rng.normal(size=2)))
        assert errors_of_forces(a[0], b, [mu], r, associated=sliding == "associated").worst < 1e-10
        friction = np.hypot(r[1], r[2])
        statuses.add((r[0] > 0.0, bool(0.0 < friction < 0.999 * mu * r[0]), friction == 0.0))
    assert len(statuses) == 4  # opens, presses without friction, sticks, slips


@pytest.mark.parametrize("sliding", RULES)
@pytest.mark.parametrize(("c", "rank"), [(1, 1.0), (5, 1.0), (40, 1.0), (40, 0.6), (150, 0.6)])
def test_problems_around_a_solution_are_solved(c, rank, sliding):
    problem, _ = built(c, 7 * c, sliding, rank=rank)
    found = solve_matrix(problem, SolverOptions(tolerance=1e-10), sliding=sliding)
    errors = judged(problem, found.r, sliding)
    assert errors.solved(1e-9), errors
    own = largest_error(problem, found.r, coulomb=sliding == "coulomb")
    assert own <= 1e-10
    # What the solvers call their error is what the law calls it, but for the bound on the program's value. The rounding of u, some
    # 1e-14 of its terms, is not the same in both.
    np.testing.assert_allclose(own, max(errors[:5]), rtol=1e-3, atol=1e-13)


def test_forces_that_are_unique_are_found():
    """W is regular, so that under the associated rule the program is strictly convex."""
    problem, r = built(30, 3, "associated", mu=(0.1, 0.7))
    found = solve_matrix(problem, SolverOptions(tolerance=1e-12), sliding="associated").r
    np.testing.assert_allclose(found, r, atol=1e-7 * np.abs(r).max())


def test_a_matrix_that_is_not_symmetric_is_solved_as_it_is():
    problem, _ = built(60, 5, "coulomb", rank=0.6, unsymmetric=1e-4)
    found = solve_matrix(problem, SolverOptions(tolerance=1e-10), sliding="coulomb")
    assert judged(problem, found.r, "coulomb").solved(1e-9)
    symmetric = DelassusProblem(w=0.5 * (problem.w + problem.w.T), b=problem.b, mu=problem.mu)
    assert largest_error(symmetric, found.r, coulomb=True) > 1e-7


@pytest.mark.parametrize("sliding", RULES)
@pytest.mark.parametrize("stage", ["_sweep", "_newton", "_interior_point"])
def test_each_stage_is_right_alone(stage, sliding, monkeypatch):
    """Sweeps are stopped early for the other two; Newton's method then begins from the interior point's forces or theirs."""
    problem, _ = built(20, 12, sliding, mu=(0.1, 0.7))
    monkeypatch.setattr(cone, "_walk", lambda *_: None)
    if stage != "_sweep":
        monkeypatch.setattr(cone, "_sweep", lambda *_: None)
    if stage != "_newton":
        monkeypatch.setattr(cone, "_newton", lambda *_: None)
    if stage == "_sweep":
        monkeypatch.setattr(cone, "_interior_point", lambda *_: np.inf)
        monkeypatch.setattr(cone, "WORTHWHILE", 1.0)
        monkeypatch.setattr(cone, "MOST_SWEEPS", 100_000)
    if stage == "_newton":
        monkeypatch.setattr(cone, "INTERIOR_ENDS", 1e-4)
    tolerance = 1e-8 if stage == "_interior_point" else 1e-11
    found = solve_matrix(problem, SolverOptions(tolerance=tolerance), sliding=sliding)
    assert judged(problem, found.r, sliding).solved(10.0 * tolerance)


def test_a_walk_goes_where_the_path_turns_back(monkeypatch):
    problem, _ = built(20, 11, "coulomb", rank=0.6)
    found = solve_matrix(problem, SolverOptions(tolerance=1e-10), sliding="coulomb")
    assert judged(problem, found.r, "coulomb").solved(1e-9)
    monkeypatch.setattr(cone, "_walk", lambda *_: None)
    without = solve_matrix(problem, SolverOptions(tolerance=1e-10), sliding="coulomb")
    assert not judged(problem, without.r, "coulomb").solved(1e-4)


@pytest.mark.parametrize("sliding", RULES)
def test_with_one_tangent_that_nothing_moves_it_is_the_problem_of_the_plane(sliding):
    rng = np.random.default_rng(4)
    c = 12
    h = rng.normal(size=(2 * c, 2 * c))
    w = h @ h.T / c + np.eye(2 * c)
    b, mu = rng.normal(size=(c, 2)) - [0.5, 0.0], rng.uniform(0.1, 0.9, c)
    flat = DelassusProblem(w=w, b=b, mu=mu)
    angle = 0.7  # the plane's tangent in the plane of both tangents
    turn = np.zeros((3, 2))
    turn[0, 0], turn[1:, 1] = 1.0, [np.cos(angle), np.sin(angle)]
    across = np.outer([0.0, -np.sin(angle), np.cos(angle)], [0.0, -np.sin(angle), np.cos(angle)])
    lift = np.kron(np.eye(c), turn)
    space = DelassusProblem(w=lift @ w @ lift.T + np.kron(np.eye(c), across), b=b @ turn.T, mu=mu)
    options = SolverOptions(tolerance=1e-13)
    of_plane, of_space = (solve_matrix(each, options, sliding=sliding).r for each in (flat, space))
    np.testing.assert_allclose(of_space, of_plane @ turn.T, atol=1e-10)
    assert np.abs(of_plane[:, 1]).max() > 0.1


def test_tangents_have_no_preferred_direction():
    problem, _ = built(15, 8, "coulomb", mu=(0.3, 0.7))
    rng = np.random.default_rng(1)
    turns = []
    for angle in rng.uniform(0.0, 2.0 * np.pi, 15):
        cos, sin = np.cos(angle), np.sin(angle)
        turns.append([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    t = sp.block_diag(turns).tocsr()
    turned = DelassusProblem(w=t @ problem.w @ t.T, b=(t @ problem.b.ravel()).reshape(-1, 3), mu=problem.mu)
    found = solve_matrix(turned, SolverOptions(tolerance=1e-12), sliding="coulomb").r
    back = (t.T @ found.ravel()).reshape(-1, 3)
    assert judged(problem, back, "coulomb").solved(1e-11)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_units_do_not_matter(scale):
    problem, _ = built(20, 2, "coulomb", rank=0.6)
    found = solve_matrix(problem, SolverOptions(tolerance=1e-9), sliding="coulomb")
    scaled = DelassusProblem(w=problem.w * scale, b=problem.b / scale, mu=problem.mu)
    again = solve_matrix(scaled, SolverOptions(tolerance=1e-9), sliding="coulomb")
    assert again.iterations == found.iterations
    assert largest_error(scaled, again.r, coulomb=True) <= 1e-9


def test_contacts_that_open_have_no_forces():
    problem = DelassusProblem(w=np.eye(6), b=[[1.0, 2.0, 0.0], [0.0, -1.0, 3.0]], mu=[0.5, 0.0])
    found = solve_matrix(problem, SolverOptions(), sliding="coulomb")
    assert (found.r == 0.0).all()
    assert found.error == 0.0


def test_what_has_no_solution_is_never_called_solved():
    """Two contacts push one unknown towards each other at both ends: no force keeps both shut."""
    w = np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.diag([1.0, 0.0, 0.0])) + np.diag([0.0, 1.0, 1.0] * 2)
    problem = DelassusProblem(w=w, b=[[-1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], mu=[0.3, 0.3])
    for sliding in RULES:
        found = solve_matrix(problem, SolverOptions(time_limit=5.0), sliding=sliding)
        assert not judged(problem, found.r, sliding).solved(1e-3)
        assert largest_error(problem, found.r, coulomb=sliding == "coulomb") > 1e-3


def test_limits_are_kept():
    problem, _ = built(150, 9, "coulomb", rank=0.6)
    few = solve_matrix(problem, SolverOptions(tolerance=1e-12, max_iterations=3), sliding="coulomb")
    assert few.iterations <= 3
    assert few.error > 1e-12
    late = solve_matrix(problem, SolverOptions(tolerance=1e-12, time_limit=1e-9), sliding="coulomb")
    assert natural_map(problem, late.r, coulomb=True) > 1e-12


def test_scaling_point_and_longest_step():
    """T u = T^-1 r, T of the cone's group; the longest step ends on the boundary of the first cone that it meets."""
    rng = np.random.default_rng(6)
    r, u = rng.normal(size=(2, 50, 3))
    r[:, 0], u[:, 0] = (np.hypot(x[:, 1], x[:, 2]) + rng.uniform(0.01, 1.0, 50) for x in (r, u))
    direct, inverse, turn = (np.empty((50, 3, 3)) for _ in range(3))
    point = np.empty((50, 3))
    kernels.scale_cones(r, u, True, direct, inverse, turn, point)
    np.testing.assert_allclose(direct @ inverse, np.broadcast_to(np.eye(3), (50, 3, 3)), atol=1e-10)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", direct, u), point, rtol=1e-12)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", inverse, r), point, rtol=1e-9, atol=1e-9)
    step = 1e-7
    for axis in range(3):
        moved = u.copy()
        moved[:, axis] += step
        slope = (moved - u - np.eye(3)[0] * (np.hypot(*moved[:, 1:].T) - np.hypot(*u[:, 1:].T))[:, None]) / step
        np.testing.assert_allclose(turn[:, :, axis], slope, atol=1e-5)
    d = rng.normal(size=(50, 3))
    reach = kernels.longest_step(r, d)
    end = r + reach * d
    room = end[:, 0] - np.hypot(end[:, 1], end[:, 2])
    assert abs(room.min()) < 1e-12 * np.abs(end).max()
    assert kernels.longest_step(r, r) == np.inf
    assert kernels.longest_step(r, -r) == pytest.approx(1.0)


@pytest.mark.parametrize("sliding", RULES)
def test_slopes_of_the_statuses_are_those_of_their_equations(sliding):
    """Central differences of smooth equations: their error is (1e-6)^2 of third derivatives, below 1e-7 here."""
    rng = np.random.default_rng(3)
    c = 60
    r, u = rng.normal(size=(2, c, 3))
    r[:, 0] = np.abs(r[:, 0])
    mu, rho = np.tile([0.0, 0.3, 1.5], c // 3), rng.uniform(0.5, 2.0, c)

    def system(forces, velocities):
        of_u, of_r = np.empty((c, 3, 3)), np.empty((c, 3, 3))
        error, fixed = np.empty((c, 3)), np.empty((c, 3))
        kernels.statuses_system(forces, velocities, mu, rho, sliding == "coulomb", of_u, of_r, error, fixed)
        return error, of_u, of_r

    _, of_u, of_r = system(r, u)
    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        np.testing.assert_allclose(
            (system(r + shift, u)[0] - system(r - shift, u)[0]) / (2 * step), of_r[:, :, axis], atol=1e-7
        )
        np.testing.assert_allclose(
            (system(r, u + shift)[0] - system(r, u - shift)[0]) / (2 * step), of_u[:, :, axis], atol=1e-7
        )


def test_projection_is_the_nearest_point():
    rng = np.random.default_rng(5)
    z, mu = rng.normal(size=(200, 3)), rng.choice([0.0, 0.4, 2.0], 200)
    near = project(z, mu)
    assert (np.hypot(near[:, 1], near[:, 2]) <= mu * near[:, 0] * (1.0 + 1e-14) + 1e-300).all()
    for _ in range(200):
        other = rng.normal(size=(200, 3))
        other[:, 0] = np.abs(other[:, 0])
        size = np.maximum(np.hypot(other[:, 1], other[:, 2]), 1e-300)
        other[:, 1:] *= np.minimum(1.0, mu * other[:, 0] / size)[:, None]
        # z - P z is normal to the cone: no step from P z into the cone goes towards z.
        assert (((z - near) * (other - near)).sum(axis=1) <= 1e-12).all()
