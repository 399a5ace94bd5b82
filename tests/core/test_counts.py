"""Counts of a session: against counting every pair, for any number of threads, over checkpoints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import numerics

from ninedisk.core import ContactLaw, Disks, Scene, Wall
from ninedisk.core.dem import session as session_module
from ninedisk.core.dem.session import Counts, DemSession

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
