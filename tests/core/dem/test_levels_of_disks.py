"""Lists of disks of many sizes (`ninedisk.core.dem.levels`): brute force, springs across rebuilds, bits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ninedisk.core import Cell, ContactLaw, Disks, History, Numerics, Rolling, Scene, Wall
from ninedisk.core.dem import session as sessions
from ninedisk.core.dem.arrays import team_arrays
from ninedisk.core.dem.levels import levels_of
from ninedisk.core.dem.neighbours import empty_cells, empty_list
from ninedisk.core.dem.plane.image_kernels import sort_into_images
from ninedisk.core.dem.plane.images import first_images
from ninedisk.core.dem.plane.level_kernels import (
    build_image_level_pairs,
    build_level_pairs,
    fit_stripes,
    sort_for_memory,
    sort_into_image_levels,
    sort_into_levels,
)
from ninedisk.core.dem.plane.neighbour_kernels import divide
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import OK

LAYOUTS = ("uniform", "clustered", "outliers", "collinear", "negative", "one-point", "cell-borders")
LAW = ContactLaw(kn=1e5, ks=6e4, mu=0.5, beta=0.05, rolling=Rolling(model="elastic-plastic", mu=0.1, kr=40.0, beta=0.3))
SMOOTH = ContactLaw(kn=1e5, ks=6e4, mu=0.5, beta=0.05)
THROWN = Numerics(dt=1e-3, n_steps=40, contact_dt=5e-5, sample_every=40, allow_unstable=True)


@pytest.fixture(autouse=True)
def few_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Levels, and disks in order, for a few bodies, too."""
    monkeypatch.setattr("ninedisk.core.dem.levels.LEVELS_FROM", 2)
    monkeypatch.setattr("ninedisk.core.dem.levels.WORTH", 1.0)
    monkeypatch.setattr(sessions, "SORT_FROM", 1)


def sizes(n: int, ratio: float, rng: np.random.Generator) -> np.ndarray:
    """Radii over a ratio, as many of each power of two, the largest and the smallest among them."""
    radius = ratio ** -rng.uniform(0.0, 1.0, n)
    radius[0], radius[-1] = 1.0, 1.0 / ratio
    return radius


def centres(layout: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Centres in one of the arrangements that break cell lists."""
    side = 2.0 * np.sqrt(n)
    x = rng.uniform(0.0, side, (n, 2))
    if layout == "clustered":
        x = rng.normal(0.0, 0.5, (n, 2)) + 5.0 * side * rng.integers(0, 4, (n, 1))
    elif layout == "outliers":
        x[: max(1, n // 50)] *= 1e7
    elif layout == "collinear":
        x[:, 1] = 3.0
    elif layout == "negative":
        x -= 1e3
    elif layout == "one-point":
        x[:] = x[0]
    elif layout == "cell-borders":
        x = np.round(x)
    return x


def check_list(x: np.ndarray, radius: np.ndarray, skin: float) -> None:
    """The list is that of brute force; rows ascend; no pair jumps a stripe; borders are what the stripe before touches."""
    n = len(x)
    levels, cells, team = levels_of(radius, 2), empty_cells(n), team_arrays(16, 1, None, 1)
    assert levels is not None
    assert sort_for_memory(x, radius, skin, cells, levels)
    order = cells.order.copy()
    x, radius = x[order], radius[order]
    assert sort_for_memory(x, radius, skin, cells, levels)
    np.testing.assert_array_equal(cells.order, np.arange(n))
    divide(n, cells, team)
    sort_into_levels(x, radius, levels)
    found = empty_list(n, n * n)
    assert build_level_pairs(x, radius, skin, levels, np.arange(n, dtype=np.uint32), empty_list(n, 0), found) == OK
    fit_stripes(found, team)
    row, used = np.repeat(np.arange(n), np.diff(found.start)), int(found.start[-1])
    other = found.other[:used].astype(np.int64)
    apart = ((x[:, None] - x[None]) ** 2).sum(axis=2)
    close = np.triu(apart < (radius[:, None] + radius + skin) ** 2, 1)
    listed = np.zeros((n, n), dtype=np.int64)
    np.add.at(listed, (row, other), 1)
    np.testing.assert_array_equal(listed, close)
    place = np.searchsorted(team.stripe, np.arange(n), side="right") - 1
    assert team.stripe[-1] == n
    assert (place[other] - place[row] <= 1).all()
    across = place[other] > place[row]
    assert (other[across] < team.border[place[other[across]]]).all()


@settings(max_examples=200, deadline=None)
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
def test_list_of_2000_disks_equals_brute_force(layout: str) -> None:
    """Enough for several stripes."""
    rng = np.random.default_rng(3)
    check_list(centres(layout, 2000, rng), sizes(2000, 100.0, rng) ** 3, 0.02)


@settings(max_examples=100, deadline=None)
@given(
    layout=st.sampled_from(["uniform", "negative", "collinear", "one-point", "cell-borders"]),
    n=st.integers(2, 40),
    seed=st.integers(0, 2**32 - 1),
    ratio=st.floats(2.1, 100.0),
    skin=st.floats(1e-9, 0.5),
    shear=st.floats(-1.5, 1.5),
)
def test_list_of_images_equals_brute_force(
    layout: str, n: int, seed: int, ratio: float, skin: float, shear: float
) -> None:
    rng = np.random.default_rng(seed)
    x, radius = centres(layout, n, rng), sizes(n, ratio, rng)
    size = 2.0 * np.sqrt(n) * np.array([1.0, 0.8])
    edges = np.array([[size[0], shear * size[0]], [0.0, size[1]]])
    room = 40 * n * n + 99
    images = first_images(Cell(size=tuple(size)), n, room, 1)
    images.now[1] = edges[0, 1]
    levels, cells, found = levels_of(radius, 2), empty_cells(n), empty_list(n, room)
    assert levels is not None
    assert sort_into_images(x, 2.0 * levels.widest[0] + skin, images, cells)
    sort_into_image_levels(x, radius, skin, images, cells.grid[0], levels)
    rows = np.arange(n, dtype=np.uint32)
    assert build_image_level_pairs(x, radius, skin, images, cells.grid[0], levels, rows, empty_list(n, 0), found) == OK
    used = int(found.start[-1])
    shifts = images.spare[: 2 * used].reshape(-1, 2).astype(int)
    listed = []
    row = np.repeat(np.arange(n), np.diff(found.start)).tolist()
    for i, j, s in zip(row, found.other[:used].tolist(), shifts, strict=True):
        turned = i > j or (i == j and tuple(s[::-1]) < (0, 0))
        listed.append((j, i, *(-s).tolist()) if turned else (i, j, *s.tolist()))
    exact = set()
    for shift in np.stack(np.meshgrid(np.arange(-9, 10), np.arange(-3, 4), indexing="ij"), axis=-1).reshape(-1, 2):
        apart = ((x[None] + edges @ shift - x[:, None]) ** 2).sum(axis=2)
        for i, j in zip(*np.nonzero(apart < (radius[:, None] + radius + skin) ** 2), strict=True):
            if i < j or (i == j and tuple(shift[::-1]) > (0, 0)):
                exact.add((int(i), int(j), *shift.tolist()))
    assert len(set(listed)) == used
    assert set(listed) == exact


def bed(rows: int, law: ContactLaw) -> Scene:
    """Disks on a lattice over a floor and a wall, thrown about, with two large ones among them, the first and the last."""
    rng = np.random.default_rng(2)
    x = 0.09 * np.stack(np.meshgrid(np.arange(14), np.arange(rows), indexing="ij"), axis=-1).reshape(-1, 2) + 0.05
    radius = rng.uniform(0.04, 0.044, len(x))
    large, large_radius = np.array([[0.6, 0.45], [0.5, 1.6]]), 0.4
    clear = np.all([np.hypot(*(x - p).T) > large_radius + 0.044 for p in large], axis=0)
    x = np.concatenate([large[:1], x[clear], large[1:]])
    radius = np.concatenate([[large_radius], radius[clear], [large_radius]])
    walls = tuple(
        Wall(name=name, point=(0.0, 0.0), normal=normal, law=law)
        for name, normal in (("floor", (0.0, 1.0)), ("left", (1.0, 0.0)))
    )
    disks = Disks(x=x, v=rng.normal(0.0, 1.0, x.shape), radius=radius, mass=0.3 * (radius / 0.042) ** 2)
    return Scene(disks=disks, disk_disk=law, walls=walls, gravity=(0.3, -9.81))


def watched(scene: Scene) -> Sequence[tuple[int, int]]:
    last = len(scene.disks) - 1
    return [pair for k in range(1, last) for pair in ((0, k), (k, last))]


def same_run(found: History, exact: History) -> None:
    """Equal to round-off, which some collisions have grown."""
    for name, atol in (("x", 1e-12), ("v", 1e-9), ("omega", 1e-8), ("gap", 1e-12), ("fn", 1e-6), ("fs", 1e-6)):
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=0.0, atol=atol, err_msg=name)
    for name, values in exact.energy.items():
        np.testing.assert_allclose(found.energy[name], values, rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("periodic", [False, True])
def test_the_run_is_that_with_one_grid(periodic: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Springs, rolling ones included, and energies survive rebuilds; the order of sums differs."""
    scene = bed(25, SMOOTH if periodic else LAW)
    if periodic:
        cell = Cell(size=(1.35, 2.4), rate=((0.0, 3.0), (0.0, -1.0)))
        scene = scene.replace(walls=(), gravity=(0.0, 0.0), cell=cell)
    numerics = replace(THROWN, n_steps=15, sample_every=1)
    session = DemSession(scene, numerics, watched(scene))
    levels = session.run()
    assert session.counts.rebuilds > 3
    assert len(session._lists.levels.widest) > 1
    monkeypatch.setattr("ninedisk.core.dem.levels.LEVELS_FROM", 10**9)
    session = DemSession(scene, numerics, watched(scene))
    assert len(session._lists.levels.widest) == 0
    one = session.run()
    assert np.count_nonzero(one.fs) > 10
    same_run(levels, one)


@pytest.mark.long
def test_bits_do_not_depend_on_threads_and_on_how_the_run_is_cut(tmp_path: Path) -> None:
    scene = bed(200, LAW)
    numerics = replace(THROWN, energy_budget=True)
    whole = DemSession(scene, numerics)
    assert len(whole._lists.levels.widest) > 1
    assert np.count_nonzero(np.diff(whole._team.stripe)) >= 4
    exact = whole.run()
    assert whole.counts.rebuilds > 3
    for threads in (2, 3, 4):
        session = DemSession(scene, numerics, threads=threads)
        for steps in (1, 7, 2, 10):
            session.advance(steps)
        session.save(tmp_path / "half.npz")
        for found in (session.run(), DemSession.load(tmp_path / "half.npz", threads=5 - threads).run()):
            for name in ("x", "v", "omega", "angle", "wall_force"):
                np.testing.assert_array_equal(getattr(found, name), getattr(exact, name))
            for name, values in exact.energy.items():
                assert found.energy[name][-1] == values[-1], name
