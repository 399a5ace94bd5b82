"""How a run is cut into calls, repeated or run beside others is not a part of its result; it allocates nothing on the way."""

from __future__ import annotations

import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scenes import KN, all_pairs, numerics

from ninedisk.core import ContactLaw, Disks, History, Scene, Wall, WallSegment
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import REBUILDS

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
    assert not any(value.flags.writeable for value in vars(scene.disks).values())


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
