"""Contact search against brute force, growth of the lists, shear forces across rebuilds, cost linear in n."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import Oracle
from scenes import KN, difference, imploding, numerics, run

from ninedisk.core import ContactLaw, Disks, History, Scene, Wall
from ninedisk.core.dem import arrays as arrays_module
from ninedisk.core.dem.neighbours import empty_cells, empty_list
from ninedisk.core.dem.plane.neighbour_kernels import build_pairs, build_wall_pairs, sort_into_cells
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import NOT_FINITE, OK, PAIRS_FULL, REBUILDS, WALL_PAIRS_FULL
from ninedisk.core.scene.motion import compile_motion, wall_poses

LAW = ContactLaw(kn=KN, ks=0.5 * KN, mu=0.5, beta=0.05)
FIELDS = ("x", "v", "angle", "omega", "gap", "fn", "fs")
LAYOUTS = ("uniform", "clustered", "outliers", "collinear", "negative", "one-cell", "columns")


def test_the_skin_adapts_to_the_motion() -> None:
    """Fast disks that rarely touch: rebuilds cost more than pairs, and the skin grows from a twentieth of the radius."""
    places = [(2.5 * i, 2.5 * j) for i in range(5) for j in range(5)]
    v = 3.0 * np.random.default_rng(1).normal(size=(25, 2))
    session = DemSession(Scene(disks=Disks(x=places, v=v, radius=1.0, mass=1.0), disk_disk=LAW), numerics(1e-3, 300))
    session.run()
    assert session._progress.clock[REBUILDS] > 5
    assert session._progress.skin[0] > 0.1


def centres(layout: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Centres in one of the arrangements that break cell lists."""
    side = 2.0 * np.sqrt(n)
    x = rng.uniform(0.0, side, (n, 2))
    if layout == "clustered":
        x = rng.normal(0.0, 2.0, (n, 2)) + 5.0 * side * rng.integers(0, 4, (n, 1))
    elif layout == "outliers":
        x[: max(1, n // 50)] *= 1e7
    elif layout == "collinear":
        x[:, 1] = 3.0
    elif layout == "columns":
        x[:, 0] = np.round(x[:, 0])
    elif layout == "negative":
        x -= 1e3
    elif layout == "one-cell":
        x = rng.uniform(0.0, 0.1, (n, 2))
    return x


def neighbours(x: np.ndarray, radius: np.ndarray, skin: float) -> list[list[int]]:
    """Rows of the half list as the kernels build it."""
    n = len(x)
    cells, found = empty_cells(n), empty_list(n, n * n)
    assert sort_into_cells(x, 2.0 * radius.max() + skin, cells)
    assert build_pairs(x, radius, skin, cells, False, np.arange(n, dtype=np.uint32), empty_list(n, 0), found) == OK
    return [sorted(found.other[a:b].tolist()) for a, b in zip(found.start, found.start[1:], strict=False)]


def brute_force(x: np.ndarray, radius: np.ndarray, skin: float) -> list[list[int]]:
    rows = []
    for i in range(len(x)):
        d = x[i + 1 :] - x[i]
        limit = radius[i + 1 :] + (radius[i] + skin)
        rows.append((i + 1 + np.flatnonzero(d[:, 0] ** 2 + d[:, 1] ** 2 < limit**2)).tolist())
    return rows


@settings(max_examples=150, deadline=None)
@given(
    layout=st.sampled_from(LAYOUTS),
    n=st.integers(1, 120),
    seed=st.integers(0, 2**32 - 1),
    spread=st.floats(1.0, 30.0),
    skin=st.floats(1e-9, 3.0),
)
def test_list_equals_brute_force(layout: str, n: int, seed: int, spread: float, skin: float) -> None:
    rng = np.random.default_rng(seed)
    x, radius = centres(layout, n, rng), rng.uniform(1.0 / spread, 1.0, n)
    assert neighbours(x, radius, skin) == brute_force(x, radius, skin)


@pytest.mark.parametrize("layout", [layout for layout in LAYOUTS if layout != "one-cell"])
def test_list_of_3000_disks_equals_brute_force(layout: str) -> None:
    rng = np.random.default_rng(3)
    x, radius = centres(layout, 3000, rng), rng.uniform(0.1, 1.0, 3000)
    assert neighbours(x, radius, 0.2) == brute_force(x, radius, 0.2)


@pytest.mark.parametrize("huge", [1e155, 1.7e308])
def test_coordinates_whose_extent_or_square_overflows_are_survived(huge: float) -> None:
    """A run that blows up passes through such values; a cell number formed from inf/inf would write out of bounds."""
    x = np.array([[-huge, 0.0], [huge, 0.0], [0.0, huge], [0.0, 0.0], [1.0, 0.0]])
    cells, found = empty_cells(5), empty_list(5, 25)
    if sort_into_cells(x, 2.1, cells):
        assert cells.cell.min() >= 0
        assert cells.cell.max() < cells.start.shape[0] - 1
        assert (
            build_pairs(x, np.ones(5), 0.1, cells, False, np.arange(5, dtype=np.uint32), empty_list(5, 0), found) == OK
        )
        assert found.other[found.start[3] : found.start[4]].tolist() == [4]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_coordinate_that_is_no_number_is_reported(bad: float) -> None:
    x = np.array([[0.0, 0.0], [1.0, bad], [2.0, 0.0]])
    assert not sort_into_cells(x, 1.0, empty_cells(3))
    assert len({OK, PAIRS_FULL, WALL_PAIRS_FULL, NOT_FINITE}) == 4


@settings(max_examples=60, deadline=None)
@given(n=st.integers(1, 80), m=st.integers(0, 4), seed=st.integers(0, 2**32 - 1), skin=st.floats(1e-9, 3.0))
def test_wall_lists_equal_brute_force(n: int, m: int, seed: int, skin: float) -> None:
    rng = np.random.default_rng(seed)
    x, radius = rng.uniform(-5.0, 5.0, (n, 2)), rng.uniform(0.1, 1.5, n)
    walls = []
    for k in range(m):
        normal = rng.normal(0.0, 1.0, 2)
        normal /= np.hypot(*normal)
        point = normal * ((x @ normal).min() - rng.uniform(0.01, 2.0))
        walls.append(Wall(name=str(k), point=tuple(point), normal=tuple(normal), law=LAW))
    poses = wall_poses(compile_motion(walls), 0.0)
    found = empty_list(m, n * m)
    assert (
        build_wall_pairs(
            x, radius, skin, poses, np.arange(len(x), dtype=np.uint32), np.zeros(len(x)), empty_list(m, 0), found
        )
        == OK
    )
    for w, pose in enumerate(poses):
        gap = (x[:, 0] - pose[0]) * pose[2] + (x[:, 1] - pose[1]) * pose[3] - radius
        assert found.other[found.start[w] : found.start[w + 1]].tolist() == np.flatnonzero(gap < skin).tolist()


def with_capacity(scene: Scene, steps: int, monkeypatch: pytest.MonkeyPatch) -> History:
    """The same run with lists that never have to grow."""
    n = len(scene.disks)
    monkeypatch.setattr(arrays_module, "empty_list", lambda rows, _, bends=False: empty_list(rows, n * n, bends))
    return run(scene, numerics(5e-4, steps))


def test_full_disk_list_grows_in_the_middle_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = imploding(40)
    session = DemSession(scene, numerics(5e-4, 40), [(0, 1)])
    room = session._lists.pairs.other.shape[0]
    found = session.run()
    assert session._lists.pairs.start[-1] > 1.5 * room
    assert session._lists.pairs.other.shape[0] == session._lists.spare.other.shape[0] > 1.5 * room
    expected = with_capacity(scene, 40, monkeypatch)
    for name in ("x", "v", "omega", "angle"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    twin = Oracle(scene, numerics(5e-4, 40)).run()
    # All fly along the lines of centres: spins of 4e-5 rad/s are what slips leave of speeds of 570 m/s, and feel their rounding.
    assert max(difference(expected, twin, FIELDS).values()) < 1e-10


def test_full_wall_list_grows_in_the_middle_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    soft = ContactLaw(kn=1.0, ks=0.5, mu=0.5)
    walls = tuple(Wall(name=n, point=(0.0, -1.0), normal=(s, 1.0), law=soft) for n, s in (("a", 0.0), ("b", 1e-3)))
    scene = imploding(64, walls)
    session = DemSession(scene, numerics(5e-4, 24))
    room = session._lists.wall_pairs.other.shape[0]
    found = session.run()
    assert session._lists.wall_pairs.start[-1] > 1.5 * room
    assert np.ptp(session._lists.wall_pairs.start[:-1]) > room
    expected = with_capacity(scene, 24, monkeypatch)
    np.testing.assert_array_equal(found.x, expected.x)
    np.testing.assert_array_equal(found.wall_force, expected.wall_force)
    assert np.abs(found.wall_force[-1]).max() > 0.0


def test_lists_that_are_full_at_the_start_grow() -> None:
    """All pairs of 60 concentric-like disks: 1770, ten times the first guess."""
    x = np.random.default_rng(4).uniform(0.0, 0.5, (60, 2))
    scene = Scene(disks=Disks(x=x, radius=1.0, mass=1.0), disk_disk=LAW)
    assert DemSession(scene, numerics(1e-4, 1))._lists.pairs.start[-1] == 60 * 59 // 2


def settled_with_shear() -> Scene:
    """A tumbling packing against two rough walls, with contacts that stick and slip."""
    rng = np.random.default_rng(8)
    x = np.array([[1.9 * (k % 6) + 0.95 * (k // 6 % 2), 1.7 * (k // 6)] for k in range(36)]) + rng.uniform(
        -0.05, 0.05, (36, 2)
    )
    walls = tuple(
        Wall(name=str(w), point=p, normal=n, law=LAW)
        for w, (p, n) in enumerate([((0, -0.95), (0, 1)), ((-0.95, 0), (1, 0))])
    )
    disks = Disks(x=x, omega=rng.normal(0.0, 20.0, 36), v=rng.normal(0.0, 3.0, (36, 2)), radius=1.0, mass=1.0)
    return Scene(disks=disks, disk_disk=LAW, walls=walls, gravity=(3.0, -10.0))


def test_shear_history_survives_rebuilds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rebuild at every step changes the order of summation and nothing else; 1e-11: see the comparison with the twin."""
    scene, how = settled_with_shear(), numerics(1e-3, 80)
    histories, rebuilds = [], []
    for skin in (1e-6, 0.05, 0.4, 3.0):
        for name in ("FIRST_SKIN", "LEAST_SKIN", "MOST_SKIN"):
            monkeypatch.setattr(arrays_module, name, skin)
        session = DemSession(scene, how, [(i, j) for i in range(36) for j in range(i + 1, 38)])
        histories.append(session.run())
        rebuilds.append(int(session._progress.clock[REBUILDS]))
    assert rebuilds[0] == 80
    assert rebuilds[0] > rebuilds[1] > rebuilds[2] > rebuilds[3]
    sticking = (np.abs(histories[0].fs) > 0.0) & (np.abs(histories[0].fs) < 0.499 * histories[0].fn)
    assert sticking[1:].sum() > 1000
    for other in histories[1:]:
        assert max(difference(other, histories[0], FIELDS).values()) < 1e-11


@pytest.mark.parametrize(("columns", "rows"), [(400, 20), (20, 400)])
def test_neighbours_are_near_in_memory_however_long_the_box_is(columns: int, rows: int) -> None:
    """Rows of cells lie along the shorter side: a neighbour is in the same or the next one, each of two lines of 20 disks at most."""
    x = 2.0 * np.array([[k % columns, k // columns] for k in range(columns * rows)], dtype=float)
    x, cells, found = np.random.default_rng(4).permutation(x), empty_cells(len(x)), empty_list(len(x), 4 * len(x))
    assert sort_into_cells(x, 2.2, cells)
    radius, name = np.ones(len(x)), np.arange(len(x), dtype=np.uint32)
    assert build_pairs(x, radius, 0.1, cells, False, name, empty_list(len(x), 0), found) == OK
    pairs = found.start[-1]
    assert pairs == columns * (rows - 1) + (columns - 1) * rows
    place = np.argsort(cells.order)
    apart = place[np.repeat(name, np.diff(found.start))] - place[found.other[:pairs]]
    assert np.abs(apart).max() < 80


def candidates_per_disk(x: np.ndarray) -> float:
    """Distances that a rebuild evaluates, per disk: the occupants of the nine cells around each."""
    cells = empty_cells(len(x))
    assert sort_into_cells(x, 2.2, cells)
    columns, rows = int(cells.grid[3]), int(cells.grid[4])
    count = np.zeros((rows + 2, columns + 2))
    count[1:-1, 1:-1] = np.diff(cells.start[: rows * columns + 1]).reshape(rows, columns)
    around = sum(count[r : r + rows, c : c + columns] for r in range(3) for c in range(3))
    return float((count[1:-1, 1:-1] * around).sum() / len(x))


def test_work_of_a_rebuild_is_linear_in_n() -> None:
    """Nine cells of width 2.2 hold 10 to 11 disks of a square packing, and a half list's borders less, whatever n."""
    work = [
        candidates_per_disk(2.0 * np.array([[k % s, k // s] for k in range(s * s)], dtype=float))
        for s in (32, 100, 320)
    ]
    assert 9.0 < work[0] < work[1] < work[2] < 11.0 * 1.05


def test_run_of_200000_disks() -> None:
    """Falls freely as one block: every disk keeps its place in it, and no contact acts."""
    side = 448
    x = 2.05 * np.array([[k % side, k // side] for k in range(200_000)], dtype=float)
    scene = Scene(disks=Disks(x=x, radius=1.0, mass=1.0), disk_disk=LAW, gravity=(0.0, -10.0))
    history = DemSession(scene, numerics(1e-3, 4, sample_every=4), particles=[0, 199_999]).run()
    fall = 0.5 * 10.0 * (4e-3) ** 2
    # Eight additions at coordinates up to 920 m.
    np.testing.assert_allclose(history.x[-1] - history.x[0], [[0.0, -fall]] * 2, rtol=0, atol=8 * np.spacing(1024.0))
