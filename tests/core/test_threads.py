"""Threads, the order of the disks in memory, checkpoints: none of them changes a bit of the result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracle import Oracle
from scenes import KN, all_pairs, difference, numerics

from ninedisk.core import (
    ContactLaw,
    Disks,
    History,
    InvalidNumericsError,
    InvalidSceneError,
    Scene,
    Wall,
    WallSegment,
    simulate,
)
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.arrays import LINE
from ninedisk.core.dem.plane.step_kernels import BLOCK
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import REBUILDS

LAW = ContactLaw(kn=KN, ks=0.5 * KN, mu=0.5, beta=0.05)
FIELDS = ("x", "v", "angle", "omega", "gap", "fn", "fs")


def pouring(side: int, rows: int = 0) -> Scene:
    """Shuffled disks that fall on a shaking floor: rebuilds, sorting, sliding; numbered without regard to their places."""
    rng = np.random.default_rng(2)
    x = np.array([[1.95 * i + 0.9 * (j % 2), 1.75 * j] for i in range(side) for j in range(rows or side)])
    x = rng.permutation(x + rng.uniform(-0.05, 0.05, x.shape))
    shake = (WallSegment(amplitude=(0.05, 0.1), frequency=60.0),)
    walls = [
        Wall(name="floor", point=(0.0, -1.0), normal=(0.05, 1.0), law=LAW, motion=shake),
        Wall(name="left", point=(-1.5, 0.0), normal=(1.0, 0.0), law=LAW),
        Wall(name="right", point=(2.0 * side + 1.0, 0.0), normal=(-1.0, 0.0), law=LAW),
    ]
    disks = Disks(
        x=x,
        v=rng.normal(0.0, 3.0, x.shape),
        omega=rng.normal(0.0, 20.0, len(x)),
        radius=rng.uniform(0.7, 1.0, len(x)),
        mass=rng.uniform(0.5, 2.0, len(x)),
        rotating=rng.random(len(x)) < 0.9,
    )
    return Scene(disks=disks, disk_disk=LAW, walls=walls, gravity=(-3.0, -10.0), xi=0.3)


def pairs_of(scene: Scene) -> list[tuple[int, int]]:
    """Some pairs that touch sooner or later, and disks near each wall."""
    x, n = scene.disks.x, len(scene.disks)
    apart = np.hypot(*(x[:, None] - x[None]).transpose(2, 0, 1)) + 10.0 * np.eye(n)
    first = np.argsort(apart.min(axis=1))[:20]
    found = {(min(int(i), int(j)), max(int(i), int(j))) for i in first for j in (np.argmin(apart[i]),)}
    return [*sorted(found), *((int(np.argmin(x[:, 1])), n), (int(np.argmin(x[:, 0])), n + 1))]


def assert_same_bits(one: History, two: History) -> None:
    for name, value in vars(one).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(getattr(two, name), value, err_msg=name)
    for name, value in one.energy.items():
        np.testing.assert_array_equal(two.energy[name], value, err_msg=name)


@pytest.mark.long
def test_sorted_and_striped_disks_follow_the_twin(monkeypatch: pytest.MonkeyPatch) -> None:
    """64 disks kept in the order of the cells, in stripes: only the order of sums differs from the plain-Python twin."""
    monkeypatch.setattr(session_module, "SORT_FROM", 1)
    scene = pouring(4, 16)
    how = numerics(5e-4, 200)
    session = DemSession(scene, how, all_pairs(scene))
    found = session.run()
    assert session._progress.clock[REBUILDS] > 5
    assert len(set(session._team.stripe.tolist())) > 3, "an even stripe with a border"
    assert not np.array_equal(session._disks.name, np.arange(64))
    twin = Oracle(scene, how).run()
    assert max(difference(found, twin, FIELDS).values()) < 1e-9
    assert np.abs(found.fs).max() > 1.0


@pytest.mark.parametrize(("sort_from", "side", "rows"), [(1, 7, 21), (10**9, 7, 21), (10**9, 48, 48)])
def test_where_a_run_pauses_or_samples_does_not_matter(
    sort_from: int, side: int, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between samples disks move on block by block, at samples in their own pass: the same bits.

    A single stripe of 48 x 48 disks is more than a block.
    """
    monkeypatch.setattr(session_module, "SORT_FROM", sort_from)
    scene, how = pouring(side, rows), numerics(5e-4, 100)
    assert (len(scene.disks) > BLOCK) == (side == 48)
    whole = DemSession(scene, how.replace(sample_every=100))
    paused = DemSession(scene, how.replace(sample_every=7))
    whole.run()
    for steps in (1, 2, 30, 67):
        paused.advance(steps)
    assert whole._progress.clock[REBUILDS] > 2
    for name in ("x", "v", "angle", "omega", "wall_force"):
        np.testing.assert_array_equal(
            getattr(paused.history(), name)[-1], getattr(whole.history(), name)[-1], err_msg=name
        )


@pytest.mark.parametrize("threads", [2, 4])
def test_the_threads_have_equally_many_disks(threads: int) -> None:
    """Among the even stripes and among the odd ones; a stripe ends with a row of cells, one of 46 or so."""
    session = DemSession(pouring(46), numerics(2e-4, 1), threads=threads)
    disks = np.diff(session._team.stripe)
    assert disks.sum() == 46 * 46
    for parity in (0, 1):
        shares = [disks[parity + 2 * me :: 2 * threads].sum() for me in range(threads)]
        assert max(shares) < 1.15 * np.mean(shares)


@pytest.mark.long
@pytest.mark.parametrize("threads", [2, 3, 4, 7])
def test_any_number_of_threads_gives_the_same_bits(threads: int) -> None:
    scene = pouring(46)
    how, watch = numerics(2e-4, 300, sample_every=50), [(0, 1), (5, 2116)]
    one = DemSession(scene, how, watch).run()
    many = DemSession(scene, how, watch, threads=threads)
    assert many._threads == threads
    assert_same_bits(one, many.run())
    assert many._progress.clock[REBUILDS] > 3


def test_arrays_begin_with_a_line_of_the_caches() -> None:
    """Eight bytes off, every vector of 64 bytes would lie across two lines."""
    disks = DemSession(pouring(46), numerics(2e-4, 1))._disks
    assert {array.ctypes.data % LINE for array in disks if array.size} == {0}


def test_disks_are_named_as_in_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chosen particles, preloaded contacts and error messages speak of the scene's numbers."""
    monkeypatch.setattr(session_module, "SORT_FROM", 1)
    scene = pouring(8)
    how = numerics(5e-4, 200, sample_every=20)
    every = DemSession(scene, how).run()
    some = DemSession(scene, how, particles=[40, 3]).run()
    np.testing.assert_array_equal(some.x, every.x[:, [40, 3]])
    np.testing.assert_array_equal(some.omega, every.omega[:, [40, 3]])
    x = np.array([[5.0, 0.0], [1.95, 0.0], [0.0, 0.0], [50.0, 0.0]])
    preload = Scene(disks=Disks(x=x, radius=1.0, mass=1.0), disk_disk=LAW, initial_shear={(1, 2): 0.25})
    history = simulate(preload, numerics(1e-4, 1), [(1, 2)])
    assert history.fs[0, 0] == 0.25


@pytest.mark.parametrize("side", [8, 46])
def test_a_checkpoint_goes_on_bit_for_bit(side: int, tmp_path: Path) -> None:
    scene = pouring(side)
    how, watch = numerics(4e-4, 120, sample_every=7), pairs_of(scene) if side < 20 else [(0, 1)]
    whole = DemSession(scene, how, watch).run()
    part = DemSession(scene, how, watch)
    part.advance(53)
    part.save(tmp_path / "run.npz")
    again = DemSession.load(tmp_path / "run.npz", threads=2)
    assert_same_bits(whole, again.run())
    # A longer run from the same checkpoint agrees as far as the first one went.
    longer = DemSession.load(tmp_path / "run.npz", n_steps=150).run()
    regular = whole.step[:-1]
    np.testing.assert_array_equal(longer.x[: len(regular)], whole.x[: len(regular)])
    assert longer.step[-1] == 150


def test_a_finished_run_can_be_prolonged(tmp_path: Path) -> None:
    scene = pouring(8)
    how = numerics(4e-4, 50, sample_every=7)
    session = DemSession(scene, how)
    session.run()
    session.save(tmp_path / "run.npz")
    longer = DemSession.load(tmp_path / "run.npz", n_steps=100).run()
    assert_same_bits(DemSession(scene, how.replace(n_steps=100)).run(), longer)


def test_what_a_checkpoint_refuses(tmp_path: Path) -> None:
    session = DemSession(pouring(4), numerics(4e-4, 50))
    session.advance(20)
    session.save(tmp_path / "run.npz")
    with pytest.raises(InvalidNumericsError, match=r"n_steps = 10 .*has done 20 steps"):
        DemSession.load(tmp_path / "run.npz", n_steps=10)
    (tmp_path / "noise.npz").write_bytes(b"no archive at all")
    with pytest.raises(InvalidSceneError, match=r"noise\.npz is no checkpoint"):
        DemSession.load(tmp_path / "noise.npz")
    with pytest.raises(InvalidSceneError, match=r"missing\.npz is no checkpoint"):
        DemSession.load(tmp_path / "missing.npz")
    assert {path.name for path in tmp_path.iterdir()} == {"run.npz", "noise.npz"}
    for threads in (0, 65, True, 1.5):
        with pytest.raises(InvalidNumericsError, match="threads = "):
            DemSession(pouring(2), numerics(4e-4, 5), threads=threads)  # type: ignore[arg-type]
