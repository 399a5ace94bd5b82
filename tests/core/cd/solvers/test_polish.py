"""Coulomb's law where sweeps do not converge: polish and pivots, on problems of settling disks, and pyramids that stay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from problems import law_broken
from scipy.linalg import block_diag
from scipy.optimize import linprog

from ninedisk.core.cd.problem import ContactProblem, measure
from ninedisk.core.cd.session import CdSession
from ninedisk.core.cd.settings import SolverOptions
from ninedisk.core.cd.solvers import polish
from ninedisk.core.cd.solvers.factorise import UnsymmetricMatrix
from ninedisk.core.cd.solvers.feasibility import InfeasibleContactsError
from ninedisk.core.cd.solvers.gauss_seidel import GaussSeidel
from ninedisk.core.cd.solvers.outcome import Stopwatch
from ninedisk.core.cd.solvers.polish import MINUS, OPEN, PLUS, STICK, Polish
from ninedisk.core.cd.solvers.proximal import ProximalPoint
from ninedisk.core.cd.solvers.solver import ContactSolver
from ninedisk.core.errors import SolverNotConvergedError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall

FloatArray = NDArray[np.float64]
TOLERANCE = 1e-12
OPTIONS = SolverOptions(tolerance=TOLERANCE)
DATA = Path(__file__).parent / "data"
SAVED = sorted(DATA.glob("settling-*.npz"))
GRAVITY = 9.81


def swept(problem: ContactProblem, sweeps: int) -> FloatArray:
    """Forces after some sweeps, which do not reach the tolerance."""
    run = GaussSeidel(problem, OPTIONS, "coulomb")
    assert run.solve(sweeps) is None
    return run.r


def polish_of(problem: ContactProblem) -> Polish:
    return Polish(problem, TOLERANCE, Stopwatch(60.0))


def worst(problem: ContactProblem, r: FloatArray) -> float:
    return measure(problem, problem.body_velocity(r), r, sliding="coulomb").worst


@pytest.mark.parametrize("path", SAVED, ids=lambda path: path.stem)
def test_polish_of_problems_that_sweeps_do_not_solve(path: Path) -> None:
    problem = ContactProblem.load(path)
    rough = swept(problem, 5_000)
    found = polish_of(problem).improve(rough, 200)
    assert found is not None
    r, residuals = found
    assert residuals.worst == worst(problem, r) <= TOLERANCE
    assert law_broken(problem, r) < 1e-6
    # The solution next to the forces found, not just any: these are within 1e-4 of one, and it changes hardly more than hyperstatic forces.
    before, after = problem.body_velocity(rough), problem.body_velocity(r)
    assert np.abs(after - before).max() < 1e-3 * np.abs(before).max()


def test_a_polish_strides_along_forces_that_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ContactProblem.load(DATA / "drifting.npz")
    rough = swept(problem, 5_000)
    found = polish_of(problem).improve(rough, 200)
    assert found is not None
    assert found[1].reached(TOLERANCE)
    assert law_broken(problem, found[0]) < 1e-6
    monkeypatch.setattr(polish, "_is_steady", lambda *_: False)
    assert polish_of(problem).improve(rough, 200) is None


def test_a_polish_leaves_paths_that_close(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ContactProblem.load(DATA / "loops.npz")
    rough = swept(problem, 5_000)
    found = polish_of(problem).improve(rough, 400)
    assert found is not None
    assert found[1].reached(TOLERANCE)
    assert law_broken(problem, found[0]) < 1e-6
    monkeypatch.setattr(polish, "FIRST_JITTER", 0.0)
    assert polish_of(problem).improve(rough, 400) is None


def test_sign_of_the_determinant() -> None:
    problem = ContactProblem.load(SAVED[0])
    rng, signs = np.random.default_rng(5), []
    matrix, h = UnsymmetricMatrix(problem), problem.jacobian().toarray()
    for _ in range(40):
        d = rng.normal(size=(problem.n_contacts, 2, 2)) * problem.rho[:, None, None]
        assert matrix.factorise(d)
        mass = np.where(problem.free > 0.0, problem.mass, 1.0).ravel()
        full = np.diag(mass) + h.T @ block_diag(*d) @ h
        signs.append(float(np.linalg.slogdet(full)[0]))
        assert matrix.sign() == signs[-1]
    assert set(signs) == {-1.0, 1.0}


def test_the_matrix_grows_with_the_contacts_that_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(polish, "ALL_SEEN", 0)
    problem = ContactProblem.load(SAVED[0])
    law, h, rng = polish_of(problem), problem.jacobian().toarray(), np.random.default_rng(6)
    for closed, soft in ((0.1, 1e-2), (0.3, 1e-2), (0.0, 1e-2), (0.2, 1e-2), (0.9, 3e-2), (0.9, 1e-2), (0.5, 3e-2)):
        law.soft = np.full(problem.n_contacts, soft)
        status = np.where(
            rng.random(problem.n_contacts) < closed, rng.integers(STICK, MINUS + 1, problem.n_contacts), OPEN
        )
        u = rng.normal(size=(problem.n_contacts, 2))
        assert law.factorise(status)
        dr = law.change(u)
        left = u - (h @ (problem.inverse_mass.ravel() * (h.T @ dr.ravel()))).reshape(-1, 2)
        left -= (problem.compliance + (law.soft / problem.rho)[:, None]) * dr
        # The matrix has entries of up to 1/soft = 100 times those of W, and a sum of up to 6 contacts in each.
        assert np.abs(left[status != OPEN, 0]).max(initial=0.0) < 1e-12
        assert np.abs(left[status == STICK, 1]).max(initial=0.0) < 1e-12
        assert not dr[status == OPEN].any()
        for side, sign in ((PLUS, 1.0), (MINUS, -1.0)):
            slips = status == side
            assert dr[slips, 1] == pytest.approx(sign * problem.mu[slips] * dr[slips, 0], rel=1e-12)


@pytest.mark.parametrize("path", SAVED, ids=lambda path: path.stem)
def test_the_path_from_nothing_on_saved_problems(path: Path) -> None:
    problem = ContactProblem.load(path)
    way = polish_of(problem)
    found = way.from_nothing(np.zeros((problem.n_contacts, 2)), 200)
    assert found is not None
    assert worst(problem, found[0]) <= TOLERANCE
    assert law_broken(problem, found[0]) < 1e-6
    assert way.count < 12 * problem.n_contacts


def test_proximal_points_find_one_of_the_solutions_that_exist() -> None:
    found = slid = 0
    for seed in range(100):
        problem = tiny(seed)
        solutions = enumerated(problem)
        try:
            r = ProximalPoint(replace(OPTIONS, max_iterations=3_000)).solve(problem).r
        except (SolverNotConvergedError, InfeasibleContactsError):
            # Where no motion satisfies the contacts.
            assert not solutions
            continue
        assert law_broken(problem, r) < 1e-6
        nearest = min((float(np.abs(r - other).max()) for other in solutions), default=np.inf)
        found += nearest < 1e-6
        slid += bool(
            (np.abs(np.abs(r[:, 1]) - problem.mu * r[:, 0])[(problem.mu > 0.0) & (r[:, 0] > 0.0)] < 1e-12).any()
        )
    assert found > 80
    assert slid > 15


@pytest.mark.parametrize("path", SAVED, ids=lambda path: path.stem)
def test_the_solver_counts_all_its_iterations(path: Path) -> None:
    problem = ContactProblem.load(path)
    found = ContactSolver("auto", OPTIONS, "coulomb").solve(problem)
    assert found.residuals.worst <= TOLERANCE
    assert found.solver in ("polish", "lemke")
    assert found.iterations > 200


def test_polish_refuses_what_is_not_exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted defects: a status flipped, the slip's sign turned, the cone multiplied. Nothing of it is accepted."""
    # One without contacts whose status is round-off: those read off the exact forces are the solution's.
    problem = ContactProblem.load(SAVED[1])
    exact = polish_of(problem).improve(swept(problem, 5_000), 200)
    assert exact is not None
    r = exact[0]
    assert polish_of(problem).improve(r, 0) is not None
    original = polish.statuses
    loaded = int(np.argmax(r[:, 0]))
    with monkeypatch.context() as patch:

        def flipped(problem: ContactProblem, z: FloatArray) -> NDArray[np.int64]:
            status = original(problem, z)
            status[loaded] = PLUS if status[loaded] != PLUS else MINUS
            return status

        patch.setattr(polish, "statuses", flipped)
        assert polish_of(problem).improve(r, 0) is None
    with monkeypatch.context() as patch:
        patch.setattr(polish, "SIDE", -polish.SIDE)
        assert polish_of(problem).improve(r, 0) is None
    wider = Polish(replace(problem, mu=1.1 * problem.mu), TOLERANCE, Stopwatch(60.0)).improve(r, 200)
    assert wider is None or worst(problem, wider[0]) > TOLERANCE


def tiny(seed: int) -> ContactProblem:
    """One to three contacts among up to three bodies and a wall, with masses, normals and loads at random; some smooth, some elastic."""
    rng = np.random.default_rng([51, seed])
    c, b = int(rng.integers(1, 4)), int(rng.integers(1, 4))
    pairs = [
        sorted(rng.choice(b, 2, replace=False)) if b > 1 and rng.random() < 0.6 else [int(rng.integers(b)), -1]
        for _ in range(c)
    ]
    angle = rng.uniform(0.0, 2.0 * np.pi, c)
    return ContactProblem(
        mass=rng.uniform(0.3, 3.0, (b, 3)),
        force=rng.normal(size=(b, 3)),
        bodies=pairs,
        normal=np.column_stack([np.cos(angle), np.sin(angle)]),
        arms=np.column_stack([np.zeros((c, 2)), np.ones(c), [float(j >= 0) for _, j in pairs]]),
        offset=rng.normal(size=(c, 2)) * [0.3, 0.3],
        mu=rng.choice([0.0, 0.3, 0.8], c),
        compliance=rng.uniform(0.0, 0.5, (c, 2)) * (rng.random((c, 2)) < 0.3),
    )


ROUNDED = {"rtol": 0.0, "atol": 1e-13}
"""Of sums of up to some twenty products, each below 20: 20 x 20 x 1.1e-16, and as much for another order; a norm as much, relatively."""


def test_the_law_at_a_point_is_that_of_the_dense_matrix() -> None:
    rng, met = np.random.default_rng(3), set[int]()
    for seed in range(40):
        problem = tiny(seed)
        law, mu = polish_of(problem), problem.mu
        law.soft = rng.uniform(0.0, 1.0, problem.n_contacts)
        soft = law.soft[:, None]
        z, held, dr = rng.normal(size=(3, problem.n_contacts, 2))
        p = np.maximum(z[:, 0], 0.0)
        r = np.column_stack([p, np.clip(z[:, 1], -mu * p, mu * p)])
        rho, w = problem.rho[:, None], problem.delassus()
        u = (w @ r.ravel()).reshape(-1, 2) + problem.b + soft / rho * (r - held)
        at = law.at(z, held)
        np.testing.assert_allclose(at.r, r, **ROUNDED)
        np.testing.assert_allclose(at.u, u, **ROUNDED)
        np.testing.assert_allclose(at.error, u + (z - r) / rho, **ROUNDED)
        assert at.size == pytest.approx(np.linalg.norm(rho * (u + (z - r) / rho)), rel=1e-13)
        expected = u - (w @ dr.ravel()).reshape(-1, 2) - soft / rho * dr
        np.testing.assert_allclose(law.remaining(at.u, dr), expected, **ROUNDED)
        met |= set(at.status.tolist())
    assert met == {OPEN, STICK, PLUS, MINUS}


def enumerated(problem: ContactProblem) -> list[FloatArray]:
    """All isolated solutions: every combination of statuses, its linear system by a dense solver, kept if no inequality is broken."""
    c, w, b = problem.n_contacts, problem.delassus().toarray(), problem.b.ravel()
    solutions = []
    for status in product(range(4), repeat=c):
        a, right = np.eye(2 * c), np.zeros(2 * c)
        for k, s in enumerate(status):
            n, t = 2 * k, 2 * k + 1
            if s == 0:
                continue
            a[n], right[n] = w[n], -b[n]
            if s == STICK:
                a[t], right[t] = w[t], -b[t]
            else:
                a[t, n] = -problem.mu[k] if s == PLUS else problem.mu[k]
        if abs(np.linalg.det(a)) < 1e-12:
            continue
        r = np.linalg.solve(a, right).reshape(-1, 2)
        if law_broken(problem, r) < 1e-9:
            solutions.append(r)
    return solutions


@pytest.mark.long
def test_the_path_from_nothing_finds_one_of_the_solutions_that_exist(part: Callable[[int], int]) -> None:
    found = slid = 0
    for seed in range(part(300)):
        problem = tiny(seed)
        solutions = enumerated(problem)
        ended = polish_of(problem).from_nothing(np.zeros((problem.n_contacts, 2)), 50)
        if ended is None:
            # Where no motion satisfies the contacts.
            assert not solutions
            continue
        r = ended[0]
        assert law_broken(problem, r) < 1e-9
        nearest = min((float(np.abs(r - other).max()) for other in solutions), default=np.inf)
        found += nearest < 1e-9
        slid += bool(
            (np.abs(np.abs(r[:, 1]) - problem.mu * r[:, 0])[(problem.mu > 0.0) & (r[:, 0] > 0.0)] < 1e-12).any()
        )
    assert found > part(250)
    assert slid > part(50)


def test_the_path_from_nothing_ends_without_a_solution() -> None:
    """Two walls that come nearer than the body between them allows."""
    closing = ContactProblem(
        mass=[[1.0, 1.0, 1.0]],
        force=[[0.0, 0.0, 0.0]],
        bodies=[[0, -1], [0, -1]],
        normal=[[0.0, 1.0], [0.0, -1.0]],
        arms=np.zeros((2, 4)),
        offset=[[-1.0, 0.0], [-1.0, 0.0]],
        mu=[0.0, 0.0],
    )
    assert polish_of(closing).from_nothing(np.zeros((2, 2)), 50) is None


def rigid(mu: float) -> ContactLaw:
    return ContactLaw(kn=1e8, ks=1e8, mu=mu, restitution=0.0, regularised=True)


def settling(seed: int, mu: float, n: int = 40, width: int = 6) -> Scene:
    """Disks of radius 1 on a lattice with gaps, jittered, that fall into a box."""
    rng = np.random.default_rng(seed)
    i = np.arange(n)
    x = np.column_stack([(i % width + 0.5) * 2.05, (i // width + 0.5) * 2.05]) + rng.uniform(-0.02, 0.02, (n, 2))
    law = rigid(mu)
    walls = (
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(2.05 * width, 0.0), normal=(-1.0, 0.0), law=law),
        Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
    )
    return Scene(disks=Disks(x=x, radius=1.0, mass=1.0), disk_disk=law, walls=walls, gravity=(0.0, -GRAVITY))


def check_settling(scene: Scene, dt: float, steps: int) -> CdSession:
    """Every step to the tolerance or the floor of round-off, and no step gains energy."""
    session = CdSession(scene, Numerics(dt=dt, n_steps=steps, sliding="coulomb"))
    history = session.run()
    kinetic = 0.5 * (history.v**2).sum((1, 2)) + 0.5 * (scene.disks.inertia * history.omega**2).sum(1)
    energy = kinetic + GRAVITY * history.x[:, :, 1].sum(1)
    assert (np.diff(energy) <= 1e-10 * kinetic.max()).all()
    assert max(session.worst) < 1e-11
    return session


@pytest.mark.long
@pytest.mark.parametrize(("seed", "mu"), [(5, 0.3), (3, 0.6)])
def test_settling_disks(seed: int, mu: float) -> None:
    session = check_settling(settling(seed, mu), 0.01, 240)
    assert session.solves["polish"] > 10


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.3, 0.6])
@pytest.mark.parametrize("seed", range(8))
def test_more_settling_disks(seed: int, mu: float) -> None:
    check_settling(settling(seed, mu), 0.01, 400)


def pyramid(layers: int, mu: float) -> Scene:
    """Rows of touching disks of radius 1, one fewer in each, on a floor."""
    x = [(2.0 * i + j, 1.0 + j * np.sqrt(3.0)) for j in range(layers) for i in range(layers - j)]
    law = rigid(mu)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    return Scene(
        disks=Disks(x=np.array(x), radius=1.0, mass=1.0), disk_disk=law, walls=(floor,), gravity=(0.0, -GRAVITY)
    )


def least_friction(layers: int) -> float:
    """Least coefficient with which statics has forces for the pyramid, by bisection over linear programs written out here."""
    x = pyramid(layers, 1.0).disks.x
    n = len(x)
    contacts = [(i, -1, 0.0, -1.0) for i in range(n) if x[i, 1] < 1.01]
    contacts += [
        (i, j, *((x[j] - x[i]) / 2.0)) for i in range(n) for j in range(i + 1, n) if np.hypot(*(x[j] - x[i])) < 2.01
    ]
    balance, c = np.zeros((3 * n, 2 * len(contacts))), len(contacts)
    for k, (i, j, nx, ny) in enumerate(contacts):
        for body, sign in ((i, 1.0), (j, -1.0)):
            if body >= 0:
                balance[3 * body : 3 * body + 2, 2 * k] = -sign * nx, -sign * ny
                balance[3 * body : 3 * body + 2, 2 * k + 1] = -sign * ny, sign * nx
                balance[3 * body + 2, 2 * k + 1] = 1.0
    weight = np.tile([0.0, 1.0, 0.0], n)

    def law_holds(mu: float) -> bool:
        cone = np.kron(np.eye(c), [[-mu, 1.0], [-mu, -1.0]])
        bounds = [(0.0, None), (None, None)] * c
        return bool(linprog(np.zeros(2 * c), cone, np.zeros(2 * c), balance, weight, bounds).status == 0)  # type: ignore[call-overload]

    low, high = 0.0, 2.0
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if law_holds(middle) else (middle, high)
    return high


def largest_acceleration(scene: Scene, dt: float, steps: int) -> float:
    """Over that of gravity."""
    history = CdSession(scene, Numerics(dt=dt, n_steps=steps, sliding="coulomb")).run()
    return float(np.abs(np.diff(history.v, axis=0)).max()) / dt / GRAVITY


@pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("layers", [3, 4, 6])
def test_a_pyramid_stays_or_collapses(layers: int, dt: float) -> None:
    least = least_friction(layers)
    assert largest_acceleration(pyramid(layers, 1.2 * least), dt, 100) < 1e-10
    assert largest_acceleration(pyramid(layers, 1.0), dt, 100) < 1e-10
    assert largest_acceleration(pyramid(layers, 0.8 * least), dt, 2) > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("dt", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("layers", [3, 6, 9])
def test_a_pyramid_stays_long(layers: int, dt: float) -> None:
    least = least_friction(layers)
    assert largest_acceleration(pyramid(layers, 1.2 * least), dt, 1_000) < 1e-10
    assert largest_acceleration(pyramid(layers, 0.8 * least), dt, 1) > 0.01
