"""The critical step against known frequencies and dense eigenvalues; the limit is sharp on both sides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import KN, all_pairs, floor_scene, numerics, pair_scene, run

from ninedisk.core import (
    ContactLaw,
    Disks,
    History,
    InvalidSceneError,
    Numerics,
    Rolling,
    Scene,
    UnstableTimeStepError,
    Wall,
)
from ninedisk.core.dem.arrays import SAFETY, contact_step
from ninedisk.core.dem.critical import _network_rate, critical_time_step, packed_time_step
from ninedisk.references.analytic.contact.critical_step import row_frequencies

SMOOTH = ContactLaw(kn=KN)
LOW = 1.1e-4
"""The estimate adds the residual of the eigenvector, at most 1e-4 of 1/dt, so that the step errs to the safe side."""


def row(law: ContactLaw, n: int, *, overlap: float = 0.02, **changes: object) -> Scene:
    """``n`` disks in a row pressed between two walls; with disturbances that excite every mode."""
    length = (2.0 - overlap) * n
    x = np.zeros((n, 2))
    x[:, 0] = (np.arange(n) + 0.5) * (2.0 - overlap) + 1e-5 * overlap * np.cos(np.arange(n) ** 2)
    walls = (
        Wall(name="left", point=(0.5 * overlap, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(length - 0.5 * overlap, 0.0), normal=(-1.0, 0.0), law=law),
    )
    # All contacts carry kn overlap; a wall stands half an overlap further in than the lattice.
    return Scene(**{"disks": Disks(x=x, radius=1.0, mass=1.0), "disk_disk": law, "walls": walls, **changes})


def polynomial(dt: float, omega: float, *, zeta: float = 0.0, xi: float = 0.0, form: str = "central") -> list[float]:
    """Characteristic polynomial of the scheme on one mode, ``x_n = z^n``, highest power first.

    Central: ``(1 + a)(x_3 - x_2) - (1 - a)(x_2 - x_1) + k x_2 + c (3 (x_2 - x_1) - (x_1 - x_0))/2 = 0``, ``a = xi dt/2``,
    ``k = (omega dt)^2``, ``c = 2 zeta omega dt``; lagged: ``x_2 - 2 x_1 + x_0 + k x_1 + (c + 2 a)(x_1 - x_0) = 0``.
    """
    a, k, c = 0.5 * xi * dt, (omega * dt) ** 2, 2.0 * zeta * omega * dt
    if form == "lagged":
        return [1.0, k + c + 2.0 * a - 2.0, 1.0 - c - 2.0 * a]
    return [1.0 + a, k + 1.5 * c - 2.0, 1.0 - a - 2.0 * c, 0.5 * c]


def largest_root(dt: float, omega: float, **damping: object) -> complex:
    roots = np.roots(polynomial(dt, omega, **damping))
    return complex(roots[np.argmax(np.abs(roots))])


def swing(scene: Scene, dt: float, steps: int, mode: list[list[float]], form: str) -> np.ndarray:
    """Displacement of a mode (weights of x, y, angle for each disk) in every step; all contacts stay closed and carry load.

    As long as they do, the scene is linear; beyond, an open contact softens it and the amplitude stops growing.
    """
    history: History = run(scene, numerics(dt, steps, damping_form=form), touching(scene))
    assert history.gap.max() < 0.0
    assert history.fn.min() > 0.0
    weights = np.array(mode)
    return (
        np.diff(history.x, axis=0).reshape(steps, -1) @ weights[:, :2].ravel()
        + np.diff(history.angle, axis=0) @ weights[:, 2]
    )


def touching(scene: Scene) -> list[tuple[int, int]]:
    watch = all_pairs(scene)
    gap = run(scene, numerics(1e-9, 1), watch).gap[0]
    return [pair for pair, value in zip(watch, gap, strict=True) if value < 0.0]


def assert_sharp(
    scene: Scene, mode: list[list[float]], omega: float, *, form: str = "central", zeta: float = 0.0, xi: float = 0.0
) -> None:
    """The limit is where the scheme's largest root leaves the unit circle, and the run does what the roots say.

    At the limit the root is -1, alone or (undamped) double; at a double root `numpy.roots` is good to 1e-8 only.
    """
    damping = {"zeta": zeta, "xi": xi, "form": form}
    critical = critical_time_step(scene, damping_form=form)
    for fraction in np.linspace(0.01, 0.999, 200):
        assert abs(largest_root(fraction * critical, omega, **damping)) <= 1.0 + 1e-12
    assert abs(largest_root((1.0 + 2.0 * LOW) * critical, omega, **damping)) > 1.0 + 1e-6

    below = np.abs(swing(scene, 0.99 * critical, 400, mode, form))
    # The swing is a beat, sampled 11 times or more in each of its lobes: its tops are hit to 1 - cos(pi/22) = 1 %.
    assert below[200:].max() <= 1.02 * below[:200].max()

    for factor in (1.01, 1.05):
        root = largest_root(factor * critical, omega, **damping)
        # From 2e-7 m to 2e-5 m, a thousandth of the overlap: dashpots at their limit make that a third of the force.
        steps = int(np.log(100.0) / np.log(abs(root))) + 3
        grown = swing(scene, factor * critical, steps, mode, form)
        assert root.imag == 0.0
        # The differences of successive swings are free of what still creeps back.
        assert (np.diff(np.abs(np.diff(grown[-6:]))) > 0.0).all()
        # A position of 1 m rounds to 2e-16 m; the first swings are 1e-9 m in the smallest of the steps.
        expected = continued(grown[:3], steps, factor * critical, omega, **damping)
        np.testing.assert_allclose(grown, expected, rtol=1e-6, atol=1e-15)


def continued(first: np.ndarray, steps: int, dt: float, omega: float, **damping: object) -> np.ndarray:
    """The sequence that the scheme makes of the first three displacements of a mode."""
    coefficients = np.array(polynomial(dt, omega, **damping))
    sequence = list(first)
    while len(sequence) < steps:
        sequence.append(-(coefficients[1:] @ sequence[: -len(coefficients) : -1]) / coefficients[0])
    return np.array(sequence)


def test_known_frequencies() -> None:
    rough = ContactLaw(kn=KN, ks=KN, mu=0.5)
    known = {
        "pair": (pair_scene(SMOOTH, overlap=0.01, closing=0.0, mass=2.0), np.sqrt(2.0 * KN / 2.0)),
        "one disk between walls": (row(SMOOTH, 1), np.sqrt(2.0 * KN)),
        "row of three": (row(SMOOTH, 3), np.sqrt((2.0 + np.sqrt(2.0)) * KN)),
        "rolling on a wall": (floor_scene(rough, height=0.999, mass=2.0), np.sqrt(3.0 * KN / 2.0)),
        "pair with shear": (pair_scene(rough, overlap=0.01, closing=0.0), np.sqrt(6.0 * KN)),
        "shear spring without friction": (floor_scene(ContactLaw(kn=KN, ks=9 * KN), height=0.999), np.sqrt(KN)),
        "touching within a thousandth": (pair_scene(SMOOTH, overlap=-9e-4, closing=0.0), np.sqrt(2.0 * KN)),
        "free flight, a wall somewhere": (floor_scene(SMOOTH, height=50.0), np.sqrt(KN)),
    }
    for name, (scene, omega) in known.items():
        ratio = critical_time_step(scene) * omega / 2.0
        assert 1.0 - LOW <= ratio <= 1.0 + 1e-9, (name, ratio)
    assert known["row of three"][1] == pytest.approx(row_frequencies(kn=KN, mass=1.0)[-1], rel=1e-14)


def test_nothing_to_touch() -> None:
    scene = Scene(disks=Disks(x=[[0.0, 0.0]], radius=1.0, mass=1.0), disk_disk=SMOOTH, xi=4.0)
    assert critical_time_step(scene) == np.inf
    # v+ = (1 - xi dt) v- grows beyond xi dt = 2.
    assert critical_time_step(scene, damping_form="lagged") == 0.5
    assert contact_step(scene, Numerics(dt=0.1, n_steps=1)) == (0.1, np.inf)


def dense(scene: Scene, only: tuple[int, int] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and dashpots over the masses, from the strain of every contact up to a gap of 1e-3 radii as a row: ``B^T diag(k) B``.

    With ``only`` given, of this contact alone, closed or not.
    """
    disks = scene.disks
    n = len(disks)
    inverse = np.where(disks.fixed, 0.0, 1.0 / disks.mass)
    rows, stiffness, dashpot = [], [], []
    for i in range(n):
        for j in range(i + 1, scene.n_bodies):
            law = scene.law((i, j))
            if j < n:
                d = disks.x[j] - disks.x[i]
                gap = np.hypot(*d) - disks.radius[i] - disks.radius[j]
                normal, other = d / np.hypot(*d), inverse[j]
            else:
                wall = scene.walls[j - n]
                gap = (disks.x[i] - wall.point) @ wall.normal - disks.radius[i]
                normal, other = -np.array(wall.normal), 0.0
            if (gap > 1e-3 * disks.radius.min() if only is None else (i, j) != only) or inverse[i] + other == 0.0:
                continue
            closing, slip = np.zeros((n, 3)), np.zeros((n, 3))
            tangent = np.array([-normal[1], normal[0]])
            closing[i, :2], slip[i] = normal, [*tangent, disks.radius[i]]
            if j < n:
                closing[j, :2], slip[j] = -normal, [*(-tangent), disks.radius[j]]
            rows += [closing.ravel(), slip.ravel()]
            stiffness += [law.kn - law.cohesion, law.ks if law.mu > 0.0 else 0.0]
            dashpot += [2.0 * law.beta * np.sqrt(law.kn / (inverse[i] + other)), 0.0]
            if law.rolling is not None:
                turn = np.zeros((n, 3))
                turn[i, 2] = 1.0
                about = [i]
                if j < n:
                    turn[j, 2] = -1.0
                    about.append(j)
                rows.append(turn.ravel())
                moments = disks.inertia + disks.mass * disks.radius**2
                free = sum(1.0 / moments[k] for k in about if disks.rotating[k] and inverse[k] > 0.0)
                stiffness.append(law.rolling.kr)
                dashpot.append(2.0 * law.rolling.beta * np.sqrt(law.rolling.kr / free) if free > 0.0 else 0.0)
    turning = np.where(disks.rotating, 1.0 / disks.inertia, 0.0)
    b = np.array(rows).reshape(-1, 3 * n) * np.sqrt(np.column_stack([inverse, inverse, turning]).ravel())
    return b.T @ (np.array(stiffness)[:, None] * b), b.T @ (np.array(dashpot)[:, None] * b)


def packing(seed: int, n: int, **law: float) -> Scene:
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.5, 1.0, n)
    disks = Disks(x=rng.uniform(0.0, 1.42 * np.sqrt(n), (n, 2)), radius=radius, mass=3.0 * radius**2)
    return Scene(disks=disks, disk_disk=ContactLaw(kn=KN, ks=0.8 * KN, mu=0.3, **law))


@pytest.mark.parametrize("seed", range(5))
def test_random_packing_against_dense_eigenvalues(seed: int) -> None:
    scene = packing(seed, 40)
    ratio = critical_time_step(scene) * np.sqrt(np.linalg.eigvalsh(dense(scene)[0])[-1]) / 2.0
    assert 1.0 - LOW <= ratio <= 1.0 + 1e-9


def spectral_radius(stiffness: np.ndarray, dashpot: np.ndarray, xi: float, dt: float, form: str) -> float:
    """Of the step of all sticking contacts, ``(x_n, u_n, u_{n-1})`` to the next, with ``u_n = x_n - x_{n-1}``."""
    one, zero = np.eye(len(stiffness)), np.zeros_like(stiffness)
    k, c, a = dt * dt * stiffness, dt * dashpot, 0.5 * xi * dt
    if form == "central":
        u = np.hstack([-k, (1.0 - a) * one - 1.5 * c, 0.5 * c]) / (1.0 + a)
    else:
        u = np.hstack([-k, (1.0 - 2.0 * a) * one - c, zero])
    step = np.vstack([u + np.hstack([one, zero, zero]), u, np.hstack([zero, one, zero])])
    return float(np.abs(np.linalg.eigvals(step)).max())


STILL_STABLE = 1.0 + 1e-6
"""Rigid motions are double roots at 1, which the eigenvalue solver splits by the root of round-off."""


def limit_by_bisection(stiffness: np.ndarray, dashpot: np.ndarray, xi: float, form: str) -> float:
    """Largest stable step by bisection on the spectral radius, from where no step below it is unstable.

    Of coordinates that no contact moves, all alike, one is kept.
    """
    idle = ~(stiffness.any(axis=0) | dashpot.any(axis=0))
    kept = np.flatnonzero(~idle | (np.cumsum(idle) == 1))
    stiffness, dashpot = (matrix[np.ix_(kept, kept)] for matrix in (stiffness, dashpot))
    high = 4.0 / max(np.sqrt(np.linalg.eigvalsh(stiffness)[-1]), np.linalg.eigvalsh(dashpot)[-1])
    tried = high * np.geomspace(1e-3, 1.0, 60)
    bad = int(np.argmax([spectral_radius(stiffness, dashpot, xi, dt, form) > STILL_STABLE for dt in tried]))
    assert bad > 0
    low, high = tried[bad - 1], tried[bad]
    while high - low > 1e-4 * high:
        middle = 0.5 * (low + high)
        unstable = spectral_radius(stiffness, dashpot, xi, middle, form) > STILL_STABLE
        low, high = (low, middle) if unstable else (middle, high)
    return low


def damped_scene(seed: int) -> Scene:
    """Disks with overlaps, masses over four decades and radii that have nothing to do with them; walls of other laws, fixed disks."""
    rng = np.random.default_rng([seed, 15])
    n = int(rng.integers(2, 13))
    radius = rng.uniform(0.5, 1.0, n)
    mass = 10.0 ** rng.uniform(0.0, rng.choice([0.0, 1.0, 2.0, 4.0]), n)
    x = rng.uniform(0.0, 1.3 * np.sqrt(n), (n, 2))
    fixed = rng.random(n) < 0.15
    fixed[0] = False
    rotating = (rng.random(n) < 0.8) & ~fixed

    def law() -> ContactLaw:
        kn = KN * 10.0 ** rng.uniform(-1.0, 1.0)
        return ContactLaw(kn=kn, ks=kn * rng.choice([0.0, 0.5, 1.0]), mu=0.5, beta=10.0 ** rng.uniform(-2.0, 0.5))

    walls = []
    for k, normal in enumerate([(0.0, 1.0), (1.0, 0.0), (-0.6, 0.8)][: rng.integers(0, 4)]):
        lowest = float((x @ np.array(normal)).min())
        walls.append(Wall(name=f"w{k}", point=tuple((lowest - 0.4) * np.array(normal)), normal=normal, law=law()))
    disks = Disks(x=x, radius=radius, mass=mass, held=np.column_stack([fixed, fixed]), rotating=rotating)
    xi = float(rng.choice([0.0, 1.0])) * np.sqrt(KN)
    return Scene(disks=disks, disk_disk=law(), walls=tuple(walls), xi=xi)


@pytest.mark.parametrize(("form", "seeds"), [("central", range(0, 100, 2)), ("lagged", range(1, 100, 2))])
def test_limit_of_random_damped_scenes(form: str, seeds: range, part: Callable[[int], int]) -> None:
    """Present contacts together, and each possible contact by itself: the smallest limit of all, by bisection."""
    found, decided, packed = [], 0, []
    for seed in seeds[: part(len(seeds))]:
        scene = damped_scene(seed)
        disks, n = scene.disks, len(scene.disks)
        inverse = np.where(disks.fixed, 0.0, 1.0 / disks.mass)
        at_surface = inverse + np.where(disks.rotating, disks.radius**2 / disks.inertia, 0.0)
        alone = [(int(i), n + w) for i in np.flatnonzero(~disks.fixed) for w in range(len(scene.walls))]
        # The pairs of the highest frequency along the normal and along the tangent.
        alone += [
            tuple(sorted(np.argsort(-mobility, kind="stable")[:2].tolist())) for mobility in (inverse, at_surface)
        ]
        networks = [dense(scene)] * bool(dense(scene)[0].any()) + [dense(scene, pair) for pair in alone]
        limits = [limit_by_bisection(*network, scene.xi, form) for network in networks]
        critical = critical_time_step(scene, damping_form=form)
        found.append(critical / min(limits))
        decided += limits[0] == min(limits)
        packed.append(packed_time_step(scene, damping_form=form) / min(limits))
    assert 0.999 <= min(found) <= max(found) <= 1.001  # bisection to 1e-4, the residual another 1e-4
    assert decided > part(25)  # the network of present contacts, rather than one contact alone
    assert max(packed) <= 1.0


def optional_law(rng: np.random.Generator) -> ContactLaw:
    kn = KN * 10.0 ** rng.uniform(-1.0, 1.0)
    rolling = Rolling(
        model="elastic-plastic", mu=0.1, kr=kn * 10.0 ** rng.uniform(-1.0, 1.0), beta=rng.choice([0.0, 0.3, 2.0])
    )
    law = ContactLaw(kn=kn, ks=kn * rng.uniform(0.2, 1.0), mu=0.5, beta=rng.choice([0.0, 0.2]), cohesion=0.5 * kn)
    return law if rng.random() < 0.3 else replace(law, rolling=rolling)


@pytest.mark.parametrize("form", ["central", "lagged"])
def test_limit_of_networks_with_materials_cohesion_and_rolling_springs(form: str, part: Callable[[int], int]) -> None:
    """Of present contacts, by bisection to 1e-4 and the residual; whatever contacts come, the other limits are bounds."""
    for seed in range(part(40)):
        rng = np.random.default_rng([seed, 18])
        scene = damped_scene(seed)
        names = rng.choice(["ash", "oak", ""], len(scene.disks)).tolist()
        used = sorted(set(names))
        scene = scene.replace(
            disks=replace(scene.disks, material=names),
            disk_disk=optional_law(rng),
            walls=tuple(replace(wall, law=optional_law(rng), material=used[0]) for wall in scene.walls),
            laws={(a, b): optional_law(rng) for k, a in enumerate(used) for b in used[k:] if rng.random() < 0.7},
        )
        network = dense(scene)
        if not network[0].any():
            continue
        limit = limit_by_bisection(*network, scene.xi, form)
        assert 1.0 / _network_rate(scene, form) == pytest.approx(limit, rel=1e-3), seed
        assert critical_time_step(scene, damping_form=form) <= 1.001 * limit
        assert packed_time_step(scene, damping_form=form) <= limit


@pytest.mark.parametrize("wall", [True, False])
def test_limit_of_one_contact_with_a_rolling_spring(wall: bool) -> None:
    """Exact at a wall, where shear and rolling spring turn the same disk, and for equal disks, where they do not see each other."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        law = replace(
            optional_law(rng), rolling=Rolling(model="elastic-plastic", mu=0.1, kr=KN * 10.0 ** rng.uniform(-1.5, 1.5))
        )
        if wall:
            scene = floor_scene(law, height=5.0, mass=rng.uniform(0.5, 2.0))
        else:
            scene = pair_scene(law, overlap=-3.0, closing=0.0, mass=rng.uniform(0.5, 2.0))
        limit = limit_by_bisection(*dense(scene, (0, 1)), 0.0, "central")
        assert critical_time_step(scene) == pytest.approx(limit, rel=3e-4)


ROW = {1: [[1.0, 0.0, 0.0]], 3: [[1.0, 0.0, 0.0], [-np.sqrt(2.0), 0.0, 0.0], [1.0, 0.0, 0.0]]}
"""Highest modes of the rows of one and of three disks."""


@pytest.mark.parametrize("n", [1, 3])
def test_limit_of_a_pressed_row_is_sharp(n: int) -> None:
    assert_sharp(row(SMOOTH, n), ROW[n], np.sqrt({1: 2.0, 3: 2.0 + np.sqrt(2.0)}[n] * KN))


def test_limit_of_a_disk_that_rolls_on_a_shear_spring_is_sharp() -> None:
    law = ContactLaw(kn=KN, ks=KN, mu=1e3)
    scene = floor_scene(law, height=0.99, v=(1e-5, 0.0), gravity=(0.0, -0.01 * KN))
    assert_sharp(scene, [[1.0, 0.0, 1.0]], np.sqrt(3.0 * KN))


@pytest.mark.parametrize("form", ["central", "lagged"])
@pytest.mark.parametrize("beta", [0.05, 0.3, 1.0, 3.0])
def test_limit_with_dashpots_is_sharp(form: str, beta: float) -> None:
    """One disk between two walls, two springs and two dashpots: zeta = 2 (2 beta sqrt(m kn))/(2 m omega) = sqrt(2) beta."""
    scene = row(ContactLaw(kn=KN, beta=beta), 1)
    assert_sharp(scene, ROW[1], np.sqrt(2.0 * KN), form=form, zeta=np.sqrt(2.0) * beta)


def test_each_dashpot_has_the_mass_of_its_own_contact() -> None:
    """A heavy disk that touches nothing leaves the limit of the others as it is."""
    law = ContactLaw(kn=KN, beta=0.5)
    disks = Disks(x=[[0.9900002, 0.0], [0.99, 5.0]], radius=[1.0, 0.5], mass=[1.0, 1e4])
    scene = row(law, 1, disks=disks, disk_disk=ContactLaw(kn=1e-3 * KN))
    assert_sharp(scene, [[1.0, 0.0, 0.0], [0.0] * 3], np.sqrt(2.0 * KN), zeta=np.sqrt(2.0) * 0.5)


@pytest.mark.parametrize("form", ["central", "lagged"])
@pytest.mark.parametrize("seed", range(4))
def test_limit_of_a_row_of_unequal_masses_is_that_of_the_run(seed: int, form: str) -> None:
    """Four disks of masses over four decades: a disturbance dies out or stays 0.5 % below the limit, and grows 0.5 % above it."""
    rng = np.random.default_rng(seed)
    mass = 10.0 ** rng.uniform(0.0, 4.0, 4)
    scene = row(ContactLaw(kn=KN, beta=float(10.0 ** rng.uniform(-1.5, 0.0))), 4)
    scene = scene.replace(disks=Disks(x=scene.disks.x, radius=1.0, mass=mass))
    critical = critical_time_step(scene, damping_form=form)
    matrices, swings = dense(scene), {}
    for factor in (0.995, 1.005):
        root = spectral_radius(*matrices, scene.xi, factor * critical, form)
        steps = 400 if factor < 1.0 else int(np.log(300.0) / np.log(root)) + 30
        history = run(scene, numerics(factor * critical, steps, damping_form=form), touching(scene))
        assert history.gap.max() < 0.0
        swings[factor] = np.abs(np.diff(history.x[:, :, 0], axis=0)).max(axis=1)
    assert swings[0.995][200:].max() <= 1.02 * swings[0.995][:200].max()
    # The fastest growing mode has taken over: it grows at the rate of the largest root.
    assert root > 1.0 + 1e-4
    assert swings[1.005][-1] / swings[1.005][-21] == pytest.approx(root**20, rel=0.02)


def test_held_bodies_do_not_count_with_their_mass() -> None:
    """A fixed disk is a wall: with any mass of its own the limit is that of the other one alone, dashpot included."""
    law = ContactLaw(kn=KN, ks=KN, mu=0.5, beta=0.4)
    for mass in (1e-6, 1.0, 1e6):
        disks = Disks(
            x=[[0.0, 0.0], [1.9, 0.0]],
            radius=1.0,
            mass=[mass, 2.0],
            held=[[True, True], [False, False]],
            rotating=[False, True],
        )
        scene = Scene(disks=disks, disk_disk=law)
        for form in ("central", "lagged"):
            limit = limit_by_bisection(*dense(scene), 0.0, form)
            assert critical_time_step(scene, damping_form=form) == pytest.approx(limit, rel=3e-4)


def test_the_limit_is_found_anew_to_the_last_bit() -> None:
    scene = packing(0, 300, beta=0.3)
    assert critical_time_step(scene) == critical_time_step(scene)


def test_a_default_step_is_stable_for_contacts_that_form_later() -> None:
    """A light disk alone among heavy small ones that will surround it: a tenth of one contact's limit is not enough."""
    ring = 40
    angle = np.arange(ring) * 2.0 * np.pi / ring
    reach = 1.0 / np.sin(np.pi / ring) - 1.0
    law = ContactLaw(kn=KN, ks=KN, mu=0.5, beta=1.0)

    def around(distance: float) -> Scene:
        x = np.vstack([[0.0, 0.0], distance * np.column_stack([np.cos(angle), np.sin(angle)])])
        return Scene(disks=Disks(x=x, radius=[reach] + [1.0] * ring, mass=[1.0] + [1e4] * ring), disk_disk=law)

    step, critical = contact_step(around(1.2 * (reach + 1.0)), Numerics(dt=1.0, n_steps=1))
    matrices = dense(around((reach + 1.0) * (1.0 - 1e-6)))
    assert spectral_radius(*matrices, 0.0, step, "central") <= STILL_STABLE
    assert spectral_radius(*matrices, 0.0, SAFETY * critical, "central") > 1.01


@pytest.mark.parametrize(("form", "xi"), [("lagged", 30.0), ("lagged", 600.0), ("central", 30.0), ("central", 600.0)])
@pytest.mark.parametrize("beta", [0.0, 0.3])
def test_limit_with_global_damping_is_sharp(form: str, xi: float, beta: float) -> None:
    scene = row(ContactLaw(kn=KN, beta=beta), 1, xi=xi)
    assert_sharp(scene, ROW[1], np.sqrt(2.0 * KN), form=form, zeta=np.sqrt(2.0) * beta, xi=xi)
    free = critical_time_step(scene.replace(xi=0.0), damping_form=form)
    critical = critical_time_step(scene, damping_form=form)
    assert (critical == free) if form == "central" else (critical < 0.95 * free)


def test_unstable_step_is_refused_unless_allowed() -> None:
    scene = row(SMOOTH, 3)
    critical = critical_time_step(scene)
    settings = Numerics(dt=1.05 * critical, contact_dt=1.05 * critical, n_steps=2)
    with pytest.raises(UnstableTimeStepError) as caught:
        run(scene, settings, [])
    for part in (f"{1.05 * critical:g}", f"{critical:g}", f"{0.1 * critical:g}", "allow_unstable=True"):
        assert part in str(caught.value)
    run(scene, settings.replace(allow_unstable=True), [])
    run(scene, settings.replace(dt=0.99 * critical, contact_dt=0.99 * critical), [])


def test_chosen_step_is_a_tenth_of_the_critical_one_and_divides_dt() -> None:
    scene = row(SMOOTH, 3)
    for dt in (1e-5, 1e-3, 0.0123, 1.0):
        step, critical = contact_step(scene, Numerics(dt=dt, n_steps=1))
        assert step <= SAFETY * critical * (1.0 + 1e-12)
        assert dt / step == pytest.approx(round(dt / step), rel=1e-12)
        assert step > 0.5 * min(dt, SAFETY * critical)


def test_coincident_centres_are_named() -> None:
    scene = Scene(disks=Disks(x=[[5.0, 0.0], [1.0, 2.0], [1.0, 2.0]], radius=1.0, mass=1.0), disk_disk=SMOOTH)
    for contact_dt in (None, 1e-3):
        with pytest.raises(InvalidSceneError, match=r"disks 1 and 2 coincide at \(1, 2\).*move one"):
            run(scene, Numerics(dt=1e-3, contact_dt=contact_dt, n_steps=1))
