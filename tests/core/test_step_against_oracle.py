"""The kernels against a slow twin of the step, on random scenes with every option."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from oracle import Oracle
from scenes import KN, difference, numerics, random_law, random_scene, run

from ninedisk.core import BehindWallError, Disks, History, Scene, Wall, WallSegment
from ninedisk.core.dem.session import DemSession

FIELDS = ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force")
ENERGIES = ("kinetic", "elastic", "gravity", "wall_work")

STEP, STEPS = 1e-3, 60
"""omega dt = 0.1 to 0.2 for kn = 1e4 N/m and masses of 0.25 to 7 kg."""

TOLERANCE = 4e-12
"""Round-off of a position, 2e-16, is 2e-14 of an overlap of a hundredth of a radius, hence of a force. Encounters multiply it
by some tens within the run: the largest difference over 3000 scenes is 4e-13. A changed term shows at 1e-6 or more."""


def steps_behind_walls(scene: Scene, history: History) -> np.ndarray:
    """Steps at which the centre of a disk is behind a wall."""
    height = [
        history.gap[:, c] + scene.disks.radius[i] for c, (i, j) in enumerate(history.pairs) if j >= len(scene.disks)
    ]
    return np.flatnonzero((np.array(height) <= 0.0).any(axis=0)) if height else np.empty(0, dtype=int)


def assert_twins(scene: Scene, steps: int = STEPS, **how: object) -> Counter[str]:
    """Compare a run with its twin; gives back what the contacts went through.

    A run that takes a centre behind a wall ends at that very step; it is compared up to there.
    """
    settings = numerics(STEP, steps, **how)
    twin = Oracle(scene, settings)
    expected = twin.run()
    lost = steps_behind_walls(scene, expected)
    if len(lost):
        with pytest.raises(BehindWallError, match=f"contact step {lost[0]} "):
            run(scene, settings)
        return Counter() if lost[0] < 2 else assert_twins(scene, int(lost[0]) - 1, **how)
    found = run(scene, settings)
    far = {
        name: value for name, value in difference(found, expected, FIELDS + ENERGIES).items() if not value < TOLERANCE
    }
    assert not far
    return twin.events


@pytest.mark.parametrize("form", ["central", "lagged"])
def test_random_scenes(form: str) -> None:
    events: Counter[str] = Counter()
    for seed in range(60):
        rng = np.random.default_rng(seed)
        events += assert_twins(random_scene(rng, STEP, STEPS), damping_form=form)
    # The scenes reach every branch of the contact law, many times over.
    assert min(events[name] for name in ("close", "open", "stick", "slip", "no-tension")) >= 20, events


@pytest.mark.parametrize("arm", ["radius", "overlap", "torque-overlap"])
@pytest.mark.parametrize("at", ["surface", "mid-overlap"])
@pytest.mark.parametrize("slip_at", ["middle", "end"])
def test_each_convention_on_a_turning_wall(arm: str, at: str, slip_at: str) -> None:
    rng = np.random.default_rng(5)
    law = random_law(rng, mu=0.7, ks=0.5 * KN, beta=0.2, lever_arm=arm, wall_velocity_at=at, slip_at=slip_at)
    disks = Disks(x=[[0.0, 0.9], [1.9, 0.95]], omega=[3.0, -20.0], radius=1.0, mass=[1.0, 2.0])
    motion = (
        WallSegment(duration=20 * STEP, angular_velocity=4.0, pivot=(-3.0, 0.4)),
        WallSegment(angular_velocity=-3.0),
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=motion)
    assert_twins(Scene(disks=disks, disk_disk=law, walls=(floor,), gravity=(1.0, -9.0)))


def test_dense_cluster_whose_lists_are_rebuilt_often() -> None:
    rng = np.random.default_rng(11)
    scene = random_scene(rng, STEP, STEPS)
    n = 25
    law = random_law(rng, mu=0.5, ks=0.5 * KN, beta=0.1)
    x = rng.uniform(-3.0, 3.0, (n, 2))
    disks = Disks(x=x, v=-20.0 * x, omega=rng.normal(0.0, 10.0, n), radius=rng.uniform(0.2, 0.9, n), mass=1.0)
    scene = scene.replace(disks=disks, disk_disk=law, walls=(), initial_shear={})
    session = DemSession(scene, numerics(STEP, STEPS))
    session.run()
    assert session._progress.clock[3] > 10
    assert_twins(scene, steps=30)


def test_spin_of_a_disk_that_does_not_rotate_is_kept() -> None:
    law = random_law(np.random.default_rng(1), mu=1.0, ks=KN, beta=0.0)
    disks = Disks(x=[[0.0, 0.0], [1.9, 0.3]], omega=[5.0, 0.0], radius=1.0, mass=1.0, rotating=[False, True])
    scene = Scene(disks=disks, disk_disk=law, xi=3.0)
    assert_twins(scene)
    history = run(scene, numerics(STEP, 40))
    np.testing.assert_array_equal(history.omega[:, 0], 5.0)
    assert abs(history.omega[-1, 1]) > 0.1
