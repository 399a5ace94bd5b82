"""Lists of spheres of many sizes (`ninedisk.core.dem.levels`): brute force, memory across rebuilds, bits, thousands of neighbours."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ninedisk.core import Numerics, PlaneWall, Spheres, SphereScene
from ninedisk.core.dem.levels import level_limits, levels_of
from ninedisk.core.dem.space import session as sessions
from ninedisk.core.dem.space import state as columns
from ninedisk.core.dem.space.arrays import empty_list, image_arrays, law_row, vector_rows, xyz_rows
from ninedisk.core.dem.space.level_kernels import (
    begin_level_lists,
    list_image_levels,
    list_level_pairs,
    sort_into_image_levels,
)
from ninedisk.core.dem.space.neighbour_kernels import Materials
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.dem.space.state import Contacts, State
from ninedisk.core.dem.state import Cells
from ninedisk.core.history import History
from ninedisk.core.law import SphereLaw
from ninedisk.core.scene.cell import Cell

LAYOUTS = ("uniform", "clustered", "outliers", "collinear", "flat", "negative", "one-point", "cell-borders")
STRIPES = 16
LAWS = np.array([law_row(SphereLaw(kn=1e5, ks=5e4, mu=0.5, beta=0.1))])


@pytest.fixture(autouse=True)
def few_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Levels for a few bodies, too."""
    monkeypatch.setattr("ninedisk.core.dem.levels.LEVELS_FROM", 2)
    monkeypatch.setattr("ninedisk.core.dem.levels.WORTH", 1.0)


def sizes(n: int, ratio: float, rng: np.random.Generator) -> np.ndarray:
    """Radii over a ratio, as many of each power of two, the largest and the smallest among them."""
    radius = ratio ** -rng.uniform(0.0, 1.0, n)
    radius[0], radius[-1] = 1.0, 1.0 / ratio
    return radius


def centres(layout: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Centres in one of the arrangements that break cell lists."""
    side = 2.0 * np.cbrt(n)
    x = rng.uniform(0.0, side, (n, 3))
    if layout == "clustered":
        x = rng.normal(0.0, 0.5, (n, 3)) + 5.0 * side * rng.integers(0, 4, (n, 1))
    elif layout == "outliers":
        x[: max(1, n // 50)] *= 1e7
    elif layout == "collinear":
        x[:, 1:] = 3.0
    elif layout == "flat":
        x[:, 2] = -1.0
    elif layout == "negative":
        x -= 1e3
    elif layout == "one-point":
        x[:] = x[0]
    elif layout == "cell-borders":
        x = np.round(x)
    return x


def state_of(x: np.ndarray, radius: np.ndarray) -> State:
    """Spheres of mass 1 at rest."""
    n = len(x)
    fields: dict[str, Any] = {name: np.zeros(4 * n) for name in ("v", "omega", "angle", "force", "torque", "mobility")}
    fields |= {name: np.ones(n) for name in ("mass", "inv_mass", "inv_inertia")}
    fields |= {"v_now": np.zeros(0), "omega_now": np.zeros(0), "now": np.zeros((0, columns.POSE_WIDTH))}
    fields |= {"load": np.zeros((0, 3)), "share": np.zeros((STRIPES, 0, 3)), "braked": np.zeros(0)}
    fields |= {"behind": np.zeros((STRIPES, 2), dtype=np.int64), "name": np.arange(n)}
    return State(x=vector_rows(x), built=vector_rows(x), radius=radius.copy(), **fields)


def one_material(n: int) -> Materials:
    """Free spheres of one material, no planes."""
    none = np.zeros(0, dtype=np.int64)
    return Materials(np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros((1, 1), np.int64), none.reshape(0, 1), none)


def listed_pairs(x: np.ndarray, radius: np.ndarray, skin: float) -> tuple[Contacts, State, np.ndarray]:
    """List of the pairs, spheres in their order, stripes."""
    n = len(x)
    levels, state = levels_of(radius, 3), state_of(x, radius)
    assert levels is not None
    cells = Cells(np.zeros(n + 65, np.int32), np.zeros(n, np.uint32), np.zeros(n, np.int32), np.zeros(6))
    listed, stripe = np.arange(n), np.zeros(STRIPES + 1, dtype=np.int64)
    sizes = radius.mean(), radius.max(), skin, skin
    assert begin_level_lists(state, listed, cells, levels, stripe, skin, 0, sizes) == skin
    old, new = (empty_list(n, room, columns.NOTES_WIDTH, columns.MEMORY_WIDTH) for room in (0, n * n))
    assert list_level_pairs(state, listed, levels, one_material(n), LAWS, skin, stripe, old, new)
    return new, state, stripe


def brute_force(x: np.ndarray, radius: np.ndarray, skin: float) -> set[tuple[int, int]]:
    apart = ((x[:, None] - x[None]) ** 2).sum(axis=2)
    first, second = np.nonzero(np.triu(apart < (radius[:, None] + radius + skin) ** 2, 1))
    return set(zip(first.tolist(), second.tolist(), strict=True))


def check_list(x: np.ndarray, radius: np.ndarray, skin: float) -> None:
    """The list is that of brute force, rows ascend, no pair jumps a stripe."""
    found, state, stripe = listed_pairs(x, radius, skin)
    used = int(found.start[-1])
    row, other = found.row[:used].astype(np.int64), found.other[:used].astype(np.int64)
    np.testing.assert_array_equal(np.repeat(np.arange(len(x)), np.diff(found.start)), row)
    assert (other > row).all()
    np.testing.assert_array_equal(xyz_rows(state.x), x[state.name])
    pairs = np.sort(np.stack([state.name[row], state.name[other]], axis=1), axis=1)
    assert len(np.unique(pairs, axis=0)) == used
    assert set(map(tuple, pairs.tolist())) == brute_force(x, radius, skin)
    assert stripe[0] == 0
    assert stripe[-1] == len(x)
    assert (np.diff(stripe) >= 0).all()
    place = np.searchsorted(stripe, np.arange(len(x)), side="right") - 1
    assert (place[other] - place[row] <= 1).all()


@settings(max_examples=300, deadline=None)
@given(
    layout=st.sampled_from(LAYOUTS),
    n=st.integers(2, 90),
    seed=st.integers(0, 2**32 - 1),
    ratio=st.floats(2.1, 100.0),
    skin=st.floats(1e-9, 3.0),
)
def test_list_equals_brute_force(layout: str, n: int, seed: int, ratio: float, skin: float) -> None:
    rng = np.random.default_rng(seed)
    check_list(centres(layout, n, rng), sizes(n, ratio, rng), skin)


@pytest.mark.parametrize("layout", [layout for layout in LAYOUTS if layout != "one-point"])
@pytest.mark.parametrize("ratio", [5.0, 100.0])
def test_list_of_2000_spheres_equals_brute_force(layout: str, ratio: float) -> None:
    """Enough for several stripes."""
    rng = np.random.default_rng(3)
    check_list(centres(layout, 2000, rng), sizes(2000, ratio, rng) ** 3, 0.02)


def images_of_pairs(x: np.ndarray, radius: np.ndarray, skin: float, edges: np.ndarray) -> set[tuple[int, ...]]:
    """Pairs ``i <= j`` and the edges between them, by brute force over three layers of images; of a sphere and itself one of two."""
    found = set()
    for shift in np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3):
        apart = ((x[None] + edges @ shift - x[:, None]) ** 2).sum(axis=2)
        for i, j in zip(*np.nonzero(apart < (radius[:, None] + radius + skin) ** 2), strict=True):
            if i < j or (i == j and tuple(shift) > (0, 0, 0)):
                found.add((int(i), int(j), *shift.tolist()))
    return found


@settings(max_examples=100, deadline=None)
@given(
    layout=st.sampled_from(["uniform", "negative", "collinear", "one-point", "cell-borders"]),
    n=st.integers(2, 40),
    seed=st.integers(0, 2**32 - 1),
    ratio=st.floats(2.1, 100.0),
    skin=st.floats(1e-9, 0.5),
    shear=st.floats(-0.5, 0.5),
)
def test_list_of_images_equals_brute_force(
    layout: str, n: int, seed: int, ratio: float, skin: float, shear: float
) -> None:
    rng = np.random.default_rng(seed)
    x, radius = centres(layout, n, rng), sizes(n, ratio, rng)
    size = 2.0 * np.cbrt(n) * np.array([1.0, 1.3, 0.8])
    levels, state = levels_of(radius, 3), state_of(x, radius)
    assert levels is not None
    images = image_arrays(Cell(size=tuple(size)), n, 1.0)
    images.now[0, 1] = shear * size[0]
    old, new = (empty_list(n, room, columns.NOTES_WIDTH_IMAGES, columns.MEMORY_WIDTH) for room in (0, 30 * n * n + 99))
    assert sort_into_image_levels(state, images, skin, levels)
    assert list_image_levels(state, images, levels, one_material(n), LAWS, skin, old, new)
    used = int(new.start[-1])
    shifts = new.notes[:used, columns.IMAGE : columns.IMAGE + 3].astype(int)
    found = []
    for i, j, shift in zip(new.row[:used].tolist(), new.other[:used].tolist(), shifts, strict=True):
        found.append((i, j, *shift.tolist()) if i <= j else (j, i, *(-shift).tolist()))
    assert len(set(found)) == used
    assert set(found) == images_of_pairs(x, radius, skin, images.now)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1.7e308])
def test_a_coordinate_or_an_extent_that_is_not_finite_is_reported(bad: float) -> None:
    x = np.array([[0.0, 0.0, 0.0], [1.0, bad, 0.0], [2.0, -bad, 0.0]])
    radius = np.array([0.1, 1.0, 1.0])
    levels = levels_of(radius, 3)
    assert levels is not None
    cells = Cells(np.zeros(68, np.int32), np.zeros(3, np.uint32), np.zeros(3, np.int32), np.zeros(6))
    stripe = np.zeros(STRIPES + 1, dtype=np.int64)
    sizes = 0.5, 1.0, 0.1, 0.1
    assert begin_level_lists(state_of(x, radius), np.arange(3), cells, levels, stripe, 0.1, 0, sizes) == -1.0


def test_limits_hold_all_sizes() -> None:
    rng = np.random.default_rng(1)
    for ratio in (1.0, 3.0, 100.0):
        radius = sizes(500, ratio, rng)
        limits = level_limits(radius, 3)
        assert limits[-1] == radius.max()
        assert (np.diff(limits) > 0.0).all()


HERTZ = SphereLaw(e_star=2e7, g_star=7e6, mu=0.4, beta=0.1)
THROWN = Numerics(dt=4e-4, n_steps=40, contact_dt=2e-5, sample_every=40, allow_unstable=True, energy_budget=True)


def bed(ratio: float = 8.0, *, at: tuple[int, int, int] = (6, 6, 40)) -> SphereScene:
    """Spheres on a lattice in a corner of three walls, thrown about, with two large ones among them and one of middle size."""
    rng = np.random.default_rng(2)
    pitch, small = 0.09, 0.044
    x = pitch * np.array(list(product(*map(range, at)))) + 0.05
    radius = rng.uniform(0.04, 0.044, len(x))
    large = np.array([[0.4, 0.4, 0.4], [0.3, 0.1, 2.0], [0.4, 0.4, 1.15]])
    large_radius = small * np.array([ratio, 0.4 * ratio, ratio])
    large[:, :2] = np.maximum(large[:, :2], large_radius[:, None] + 0.01)
    large[:, 2] = np.maximum(large[:, 2], large_radius + 0.01)
    clear = np.all(
        [np.linalg.norm(x - p, axis=1) > r + small for p, r in zip(large, large_radius, strict=True)], axis=0
    )
    x = np.concatenate([large[:1], x[clear], large[1:]])
    radius = np.concatenate([large_radius[:1], radius[clear], large_radius[1:]])
    mass = 0.3 * (radius / small) ** 3
    v = rng.normal(0.0, 1.0, x.shape)
    normals = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    walls = tuple(PlaneWall(name=str(k), point=(0.0,) * 3, normal=each, law=HERTZ) for k, each in enumerate(normals))
    spheres = Spheres(x=x, v=v, radius=radius, mass=mass)
    return SphereScene(spheres=spheres, sphere_sphere=HERTZ, walls=walls, gravity=(0.3, 0.0, -9.81))


def same_bits(found: History, exact: History) -> None:
    for name in ("x", "v", "omega", "angle", "wall_force"):
        np.testing.assert_array_equal(getattr(found, name), getattr(exact, name))
    for name, values in exact.energy.items():
        assert found.energy[name][-1] == values[-1], name


def same_run(found: History, exact: History) -> None:
    """Equal to round-off, which some collisions have grown."""
    for name, atol in (("x", 1e-12), ("v", 1e-9), ("omega", 1e-8), ("gap", 1e-12), ("fn", 1e-7), ("fs", 1e-6)):
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=0.0, atol=atol, err_msg=name)
    for name, values in exact.energy.items():
        np.testing.assert_allclose(found.energy[name], values, rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.long
def test_bits_do_not_depend_on_threads_and_on_how_the_run_is_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sessions, "SORT_FROM", 1)
    scene = bed()
    whole = SphereSession(scene, THROWN)
    assert whole._levels is not None
    assert np.count_nonzero(np.diff(whole._batch.stripe)) >= 2
    exact = whole.run()
    assert whole.counts.rebuilds > 3
    assert whole.counts.contacts > 100
    for threads in (2, 3, 4):
        session = SphereSession(scene, THROWN, threads=threads)
        for steps in (1, 7, 2, 10):
            session.advance(steps)
        session.save(tmp_path / "half.npz")
        same_bits(session.run(), exact)
        same_bits(SphereSession.load(tmp_path / "half.npz", threads=5 - threads).run(), exact)


@pytest.mark.parametrize("in_order", [True, False])
def test_the_run_is_that_with_one_grid(in_order: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Springs and energies survive rebuilds; the order of sums differs, and rounding grows by some collisions."""
    scene = bed(at=(6, 6, 8))
    monkeypatch.setattr(sessions, "SORT_FROM", 1)
    numerics = replace(THROWN, n_steps=15, sample_every=5)
    last = len(scene.spheres) - 1
    watch = [pair for k in range(1, last) for pair in ((0, k), (k, last))]
    session = SphereSession(scene, numerics, watch)
    levels = session.run()
    assert session.counts.rebuilds > 3
    assert session._levels is not None
    monkeypatch.setattr("ninedisk.core.dem.levels.LEVELS_FROM", 10**9)
    monkeypatch.setattr(sessions, "SORT_FROM", 1 if in_order else 10**9)
    session = SphereSession(scene, numerics, watch)
    assert session._levels is None
    one = session.run()
    assert np.count_nonzero(one.fs) > 10
    same_run(levels, one)


def test_a_periodic_run_is_that_with_one_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a sheared cell, in which spheres stay in the scene's order: the largest one is the first."""
    scene = bed(at=(6, 6, 8))
    keep = np.all(scene.spheres.x + scene.spheres.radius[:, None] < [1.6, 1.6, 1.2], axis=1)
    spheres = Spheres(**{name: getattr(scene.spheres, name)[keep] for name in ("x", "v", "radius", "mass")})
    cell = Cell(size=(0.9, 0.9, 0.9), rate=((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
    scene = scene.replace(spheres=spheres, walls=(), cell=cell, gravity=(0.0, 0.0, 0.0))
    numerics = replace(THROWN, n_steps=15, sample_every=5, energy_budget=False)
    session = SphereSession(scene, numerics)
    levels = session.run()
    assert session.counts.rebuilds > 3
    assert session._levels is not None
    monkeypatch.setattr("ninedisk.core.dem.levels.LEVELS_FROM", 10**9)
    one = SphereSession(scene, numerics).run()
    assert one.stress is not None
    assert levels.stress is not None
    np.testing.assert_allclose(levels.stress, one.stress, rtol=1e-9, atol=1e-6)
    same_run(levels, one)


@pytest.mark.long
def test_a_large_sphere_that_touches_thousands(monkeypatch: pytest.MonkeyPatch) -> None:
    """No number of neighbours is too many; loads add up to the momentum that the small ones lose, with any number of threads."""
    monkeypatch.setattr(sessions, "SORT_FROM", 1)
    n, small, ratio = 6000, 0.01, 60.0
    k = np.arange(n) + 0.5
    polar, turn = np.arccos(1.0 - 2.0 * k / n), np.pi * (1.0 + 5.0**0.5) * k
    way = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1)
    x = np.concatenate([[[0.0, 0.0, 0.0]], way * (ratio * small + 0.999 * small)])
    radius = np.full(n + 1, small)
    radius[0] = ratio * small
    mass = 1e-3 * (radius / small) ** 3
    v = np.zeros_like(x)
    v[0] = 0.3, 0.2, 0.1
    scene = SphereScene(spheres=Spheres(x=x, v=v, radius=radius, mass=mass), sphere_sphere=HERTZ, gravity=(0.0,) * 3)
    numerics = Numerics(dt=1e-6, n_steps=60, contact_dt=1e-6, sample_every=60, allow_unstable=True)
    one = SphereSession(scene, numerics)
    assert one._levels is not None
    assert one.counts.contacts >= n
    exact = one.run()
    same_bits(SphereSession(scene, numerics, threads=3).run(), exact)
    assert not np.allclose(exact.v[-1, 1:], 0.0)
    np.testing.assert_allclose(mass @ exact.v[-1], mass @ v, rtol=1e-9)
    monkeypatch.setattr("ninedisk.core.dem.levels.LEVELS_FROM", 10**9)
    same_run(exact, SphereSession(scene, numerics).run())
