"""A session: calls of any length, copies, counts, repetitions to the last bit."""

from __future__ import annotations

import copy
import pickle
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import KN, all_pairs, numerics

from ninedisk.core import (
    ContactLaw,
    Disks,
    History,
    InterruptedRunError,
    Numerics,
    Scene,
    SolverNotConvergedError,
    Wall,
    WallSegment,
)
from ninedisk.core.cd import session as cd_session
from ninedisk.core.cd.session import CdSession
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.counts import Counts
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import REBUILDS
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse

LAW = ContactLaw(kn=KN, ks=KN / 2, mu=0.4, beta=0.1)


def tumbling(seed: int = 0) -> Scene:
    """Disks that fall into a corner with an oscillating floor: rebuilds, sticking, slipping, growing lists."""
    rng = np.random.default_rng(seed)
    x = np.array([[1.9 * (k % 5), 1.9 * (k // 5)] for k in range(25)]) + rng.uniform(-0.1, 0.1, (25, 2))
    shake = (WallSegment(duration=0.05, amplitude=(0.0, 0.1), frequency=90.0), WallSegment(velocity=(0.0, 0.5)))
    walls = [
        Wall(name="floor", point=(0.0, -0.9), normal=(0.1, 1.0), law=LAW, motion=shake),
        Wall(name="side", point=(-0.9, 0.0), normal=(1.0, 0.0), law=LAW),
    ]
    v, omega = rng.normal(0.0, 5.0, (25, 2)) - x, rng.normal(0.0, 20.0, 25)
    disks = Disks(x=x, v=v, omega=omega, radius=rng.uniform(0.7, 1.0, 25), mass=1.0)
    return Scene(disks=disks, disk_disk=LAW, walls=walls, gravity=(-3.0, -10.0), xi=0.5)


def assert_same_bits(one: History, two: History) -> None:
    for name, value in vars(one).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(getattr(two, name), value, err_msg=name)
    assert one.energy.keys() == two.energy.keys()
    for name, value in one.energy.items():
        np.testing.assert_array_equal(two.energy[name], value, err_msg=name)


@pytest.fixture(scope="module")
def whole() -> History:
    """The run in a single call of the kernel."""
    scene = tumbling()
    session = DemSession(scene, numerics(1e-3, 150), all_pairs(scene))
    history = session.run()
    assert session._progress.clock[REBUILDS] > 5
    assert np.abs(history.fs).max() > 10.0
    return history


@pytest.mark.parametrize("stride", [1, 7, 149, 151])
def test_length_of_a_call_changes_no_bit(stride: int, whole: History, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, calls = tumbling(), []
    monkeypatch.setattr(session_module, "STEPS_TIMES_DISKS", stride * 25)
    session = DemSession(scene, numerics(1e-3, 150), all_pairs(scene))
    found = session.run(lambda done, total: calls.append((done, total)))
    assert calls == [(min(k * stride, 150), 150) for k in range(1, -(-150 // stride) + 1)]
    assert_same_bits(whole, found)


def test_progress_counts_steps_of_the_numerics_and_may_stop_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupted run goes on where it was, to the same end."""
    monkeypatch.setattr(session_module, "STEPS_TIMES_DISKS", 30 * 25)
    scene, how = tumbling(), numerics(1e-3, 40).replace(contact_dt=1e-3 / 4)
    seen: list[int] = []

    def stop(done: int, total: int) -> None:
        seen.append(done)
        assert total == 40
        if len(seen) == 3:
            raise KeyboardInterrupt

    session = DemSession(scene, how)
    with pytest.raises(KeyboardInterrupt):
        session.run(stop)
    assert seen == [7, 15, 22]
    assert_same_bits(DemSession(scene, how).run(), session.run())


def test_repetition_changes_no_bit(whole: History) -> None:
    scene = tumbling()
    session = DemSession(scene, numerics(1e-3, 150), all_pairs(scene))
    session.warm_up()
    first = session.run()
    assert_same_bits(whole, first)
    # A finished run has nothing left to do.
    assert_same_bits(whole, session.run())


def test_runs_beside_each_other_change_no_bit(whole: History) -> None:
    """Two threads, kernels without the lock of the interpreter, and another scene in between: no state is shared."""
    scene, other = tumbling(), tumbling(seed=1)

    def one(which: Scene) -> History:
        return DemSession(which, numerics(1e-3, 150), all_pairs(which)).run()

    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(one, [scene, other] * 4))
    for k in range(4):
        assert_same_bits(whole, found[2 * k])
        assert_same_bits(found[1], found[2 * k + 1])
    assert np.abs(found[1].x - whole.x).max() > 1.0


def test_a_run_leaves_its_scene_alone(whole: History) -> None:
    scene = tumbling()
    DemSession(scene, numerics(1e-3, 20)).run()
    np.testing.assert_array_equal(scene.disks.x, whole.x[0])
    assert not any(value.flags.writeable for value in vars(scene.disks).values() if isinstance(value, np.ndarray))


def buffers(session: DemSession) -> list[int]:
    """Addresses of all arrays that the kernels work on."""
    groups = (session._disks, session._walls, *session._lists, session._team, session._samples)
    return [array.__array_interface__["data"][0] for group in groups for array in group]


def test_steps_allocate_nothing() -> None:
    """A thousand steps with rebuilds in the arrays of the start; the check for finite numbers makes 25 truth values or so."""
    session = DemSession(tumbling(), numerics(1e-3, 1200, sample_every=1200))
    session._advance(200)
    before, rebuilds = buffers(session), int(session._progress.clock[REBUILDS])
    tracemalloc.start()
    try:
        session._advance(1200)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert session._progress.clock[REBUILDS] > rebuilds + 10
    assert buffers(session) == before
    # Objects of a call: arguments as they are unpacked, two masks of 50 bytes with their 100 bytes of head.
    assert peak < 16 * 1024


COPIES: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
    "pickle": lambda session: pickle.loads(pickle.dumps(session)),
}
DT, STEPS = 1e-3, 60


def bits(history: History) -> bytes:
    arrays = {**vars(history), **history.energy}
    return b"".join(array.tobytes() for array in arrays.values() if isinstance(array, np.ndarray))


def packed(n: int, beta: float = 0.1) -> Scene:
    """Disks that fall on each other, enough of them to be kept in the order of the cells."""
    side = int(np.ceil(np.sqrt(n)))
    rng = np.random.default_rng(n)
    x = np.array([(1.0 + 2.0 * (k % side), 1.0 + 2.0 * (k // side)) for k in range(n)]) + rng.uniform(
        -0.05, 0.05, (n, 2)
    )
    law = ContactLaw(kn=KN, ks=KN, mu=0.5, beta=beta)
    walls = (Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),)
    return Scene(disks=Disks(x=x, v=rng.normal(0.0, 1.0, (n, 2)), radius=1.0, mass=1.0), disk_disk=law, walls=walls)


@pytest.mark.parametrize("form", ["central", "lagged"])
@pytest.mark.parametrize("n", [12, 2500])
@pytest.mark.parametrize("method", COPIES)
def test_a_copy_of_a_dem_run_goes_on_to_the_same_bits(method: str, n: int, form: str) -> None:
    session = DemSession(packed(n), numerics(DT, STEPS, sample_every=10, damping_form=form))
    session.advance(STEPS // 2)
    other = COPIES[method](session)
    before = other.snapshot()[1]["x"]
    mine, its = session.run(), other.run()
    assert bits(mine) == bits(its)
    assert np.abs(other.snapshot()[1]["x"] - before).max() > 0.0  # it moves, and
    assert bits(session.history()) == bits(mine)  # it is not the original that it moves


def test_a_copy_of_a_run_with_outlines_goes_on_to_the_same_bits() -> None:
    grain = uniform_grain(ellipse(1.2, 0.8), 1.0)
    disks = Disks(
        x=[[0.0, 0.78], [0.3, 2.3]],
        v=[[0.0, 0.0], [0.0, -3.0]],
        radius=1.2,
        mass=grain.mass,
        inertia=grain.inertia,
        outline=0,
    )
    law = ContactLaw(kn=KN, ks=KN, mu=0.5)
    walls = (Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),)
    scene = Scene(disks=disks, disk_disk=law, walls=walls, outlines=(grain.outline,))
    session = DemSession(scene, numerics(DT, STEPS))
    session.advance(STEPS // 2)
    other = copy.deepcopy(session)
    assert bits(other.run()) == bits(session.run())


class StopError(Exception):
    pass


def stop_at(step: int) -> Callable[[int, int], None]:
    def reported(done: int, _: int) -> None:
        if done >= step:
            raise StopError

    return reported


def cd_run(**changes: Any) -> CdSession:
    how = Numerics(**{"dt": 5e-3, "n_steps": 40, "sample_every": 5, "sliding": "coulomb", **changes})
    return CdSession(packed(12, beta=0.0).replace(gravity=(0.0, -10.0)), how, [(0, 1), (0, 12)])


@pytest.mark.parametrize("changes", [{}, {"solver": "interior-point", "sliding": "associated"}, {"contact_dt": 2.5e-3}])
def test_contact_dynamics_goes_on_after_an_exception_in_the_callback(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any]
) -> None:
    whole = cd_run(**changes)
    expected = bits(whole.run())
    assert bits(whole.run()) == expected  # again: the same, not a run from its end
    monkeypatch.setattr(cd_session, "PROGRESS_EVERY", 0.0)
    for method in COPIES.values():
        session = cd_run(**changes)
        with pytest.raises(StopError):
            session.run(stop_at(15))
        other = method(session)
        assert bits(session.run()) == expected
        assert bits(other.run()) == expected


def test_a_run_of_contact_dynamics_that_failed_says_the_same_again() -> None:
    session = cd_run(options={"cd.max_iterations": 1}, solver="gauss-seidel")
    said = set()
    for _ in range(2):
        with pytest.raises(SolverNotConvergedError) as caught:
            session.run()
        said.add(str(caught.value))
    assert len(said) == 1


def test_a_run_that_was_stopped_inside_a_step_does_not_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    session = cd_run()
    with monkeypatch.context() as patched:
        patched.setattr(session, "_advance_to", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            session.run()
    with pytest.raises(InterruptedRunError, match=r"stopped inside a step after step 0.*begin a new session"):
        session.run()


ROUGH = ContactLaw(kn=1e4, ks=5e3, mu=0.5, beta=0.05)


def falling(side: int) -> Scene:
    """Shuffled disks that fall into a corner, some of them overlapping at once."""
    rng = np.random.default_rng(4)
    x = rng.permutation(np.array([[1.75 * i + 0.9 * (j % 2), 1.6 * j] for i in range(side) for j in range(side)]))
    walls = [
        Wall(name="floor", point=(0.0, -0.9), normal=(0.1, 1.0), law=ROUGH),
        Wall(name="left", point=(-0.9, 0.0), normal=(1.0, 0.0), law=ROUGH),
    ]
    disks = Disks(x=x, v=rng.normal(0.0, 3.0, x.shape), radius=rng.uniform(0.7, 1.0, len(x)), mass=1.0)
    return Scene(disks=disks, disk_disk=ROUGH, walls=walls, gravity=(-3.0, -10.0))


def counted_one_by_one(scene: Scene, x: np.ndarray, below: float) -> tuple[int, int]:
    """Pairs of disks, and of disks and walls, with a gap below ``below`` [m]."""
    radius = scene.disks.radius
    first, second = np.triu_indices(len(x), 1)
    gap = np.hypot(*(x[first] - x[second]).T) - radius[first] - radius[second]
    heights = [(x - np.array(wall.point)) @ np.array(wall.normal) - radius for wall in scene.walls]
    return int(np.count_nonzero(gap < below)), int(np.count_nonzero(np.array(heights) < below))


@pytest.mark.parametrize("sort_from", [1, 10**9])
def test_counts_are_those_of_all_pairs(sort_from: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "SORT_FROM", sort_from)
    scene = falling(12)
    session = DemSession(scene, numerics(2e-4, 400))
    begun = session.counts
    assert begun.rebuilds == 0
    assert (begun.pairs, begun.wall_pairs) == counted_one_by_one(scene, scene.disks.x, float(session._progress.skin[0]))
    seen = {begun}
    for _ in range(4):
        session.advance(100)
        counts = session.counts
        x = session.snapshot()[1]["x"]
        assert (counts.contacts, counts.wall_contacts) == counted_one_by_one(scene, x, 0.0)
        assert 0 < counts.contacts < counts.pairs
        assert 0 < counts.wall_contacts < counts.wall_pairs
        seen.add(counts)
    assert len(seen) == 5
    assert session.counts.rebuilds > 3


def test_a_disk_that_touches_nothing_costs_nothing() -> None:
    """And disks at rest keep the lists that the session began with."""
    alone = Scene(disks=Disks(x=[(0.0, 0.0), (5.0, 0.0)], radius=1.0, mass=1.0), disk_disk=ROUGH)
    session = DemSession(alone, numerics(1e-3, 3))
    session.run()
    assert session.counts == Counts(rebuilds=0, pairs=0, wall_pairs=0, contacts=0, wall_contacts=0)


@pytest.mark.long
def test_neither_threads_nor_checkpoints_change_a_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "SORT_FROM", 1)
    scene, how = falling(12), numerics(2e-4, 300)
    one = DemSession(scene, how)
    one.advance(170)
    halfway = one.counts
    one.save(tmp_path / "run.npz")
    again = DemSession.load(tmp_path / "run.npz", threads=2)
    assert again.counts == halfway
    for session in (one, again, many := DemSession(scene, how, threads=3)):
        session.run()
    assert one.counts == again.counts == many.counts
    assert one.counts.rebuilds > halfway.rebuilds > 0
