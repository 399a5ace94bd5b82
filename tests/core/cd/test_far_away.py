"""Bodies far from the scene's origin move as near it; where coordinates are too coarse for the step, the run is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ninedisk.core.cd.origin import FAR, about, origin_near
from ninedisk.core.cd.session import CdSession
from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.history import History
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene, Wall, WallSegment

RIGID = ContactLaw(kn=1e8, ks=1e8, mu=0.5, regularised=True)
SPRINGS = ContactLaw(kn=1e6, ks=5e5, mu=0.5)
RULES = ("associated", "coulomb")


def tower(x: float, y: float, *, law: ContactLaw = RIGID, v: float = 0.0, **wall: Any) -> Scene:
    """Two disks of 1 kg on each other on a floor; coordinates that are whole numbers have no rounding up to 2^53."""
    floor = Wall(name="floor", point=(wall.pop("at", x), y), normal=(0.0, 1.0), law=law, **wall)
    disks = Disks(x=[(x, y + 1.0), (x, y + 3.0)], v=[(v, 0.0)] * 2, radius=1.0, mass=1.0)
    return Scene(disks=disks, disk_disk=law, walls=(floor,), gravity=(0.0, -10.0))


def run(scene: Scene, dt: float, sliding: Any = "coulomb", steps: int = 20) -> History:
    watch = [(0, len(scene.disks)), (0, 1)]
    return CdSession(scene, Numerics(dt=dt, n_steps=steps, sliding=sliding), watch).run()


@pytest.mark.parametrize("sliding", RULES)
@pytest.mark.parametrize(("x", "y"), [(0.0, -1e6), (1e6, 0.0), (-3e7, 2e9)])
def test_disks_at_rest_stay_there_under_their_weight(x: float, y: float, sliding: str) -> None:
    """64 units in the last place of 1e6 m, in a step of 1 us, are 7 mm/s and 3e4 N."""
    scene = tower(x, y)
    history = run(scene, 1e-6, sliding)
    assert history.fn[1:] == pytest.approx(np.tile([20.0, 10.0], (20, 1)), rel=1e-9)
    assert np.abs(history.v).max() < 1e-15
    np.testing.assert_array_equal(history.x, np.tile(scene.disks.x, (21, 1, 1)))
    np.testing.assert_array_equal(history.wall_point[:, 0], np.tile(scene.walls[0].point, (21, 1)))


def test_a_floor_may_have_its_point_anywhere_along_it() -> None:
    scene = tower(1e6, 0.0, at=-5e8)
    history = run(scene, 1e-6)
    assert history.fn[1:] == pytest.approx(np.tile([20.0, 10.0], (20, 1)), rel=1e-9)
    np.testing.assert_array_equal(history.wall_point[:, 0], np.tile([-5e8, 0.0], (21, 1)))


@pytest.mark.parametrize("law", [RIGID, SPRINGS], ids=["rigid", "springs"])
def test_what_slides_and_is_shaken_far_away_does_so_near_by(law: ContactLaw) -> None:
    """The same bits: coordinates about an origin that both scenes have are the same."""
    shake = (WallSegment(amplitude=(0.1, 0.01), frequency=30.0),)
    turn = (WallSegment(angular_velocity=0.3, pivot=(0.0, 0.0)),)
    for motion in (shake, turn):
        near = tower(0.0, 0.0, law=law, v=0.7, motion=motion)
        far = tower(2.0**40, 2.0**41, law=law, v=0.7, motion=motion)
        moved = [
            (s if s.pivot is None else WallSegment(angular_velocity=0.3, pivot=(2.0**40, 2.0**41))) for s in motion
        ]
        far = far.replace(walls=(Wall(**{**vars(far.walls[0]), "motion": tuple(moved)}),))
        local, _ = about(far, origin_near(far))
        centred, _ = about(near, np.array([0.0, 2.0]))  # where the origin near the far tower is
        assert local == centred
        one, other = run(centred, 1e-3, steps=50), run(far, 1e-3, steps=50)
        np.testing.assert_array_equal(one.v, other.v)
        np.testing.assert_array_equal(one.fn, other.fn)
        assert np.abs(other.energy["kinetic"] - one.energy["kinetic"]).max() == 0.0


def test_scenes_about_their_origin_keep_it() -> None:
    scene = tower(0.0, FAR)
    assert not origin_near(scene).any()
    assert about(scene, origin_near(scene))[0] is scene


def test_steps_too_short_for_coordinates_are_refused() -> None:
    two = tower(0.0, 0.0)
    x = np.concatenate([two.disks.x, np.add(two.disks.x, [2e6, 0.0])])
    two = two.replace(disks=Disks(x=x, radius=1.0, mass=1.0))
    words = (
        r"dt = 1e-06 s is not allowed where bodies or walls are 2e\+06 m .*0\.028 m/s .*1e-05 m/s; use dt >= 5.9e-05 s"
    )
    with pytest.raises(InvalidNumericsError, match=words):
        run(two, 1e-6)
    assert run(two, 5.9e-5).fn[1:] == pytest.approx(np.tile([20.0, 10.0], (20, 1)), rel=1e-6)
    # Without a load nothing rests.
    run(two.replace(gravity=(0.0, 0.0)), 1e-6)
    # A disk that flies off, 1 km in a step.
    away = tower(0.0, 0.0, v=0.0)
    away = away.replace(
        disks=Disks(x=np.add(away.disks.x, [0.0, 1.0]), v=[(1e9, 0.0), (0.0, 0.0)], radius=1.0, mass=1.0)
    )
    with pytest.raises(InvalidNumericsError, match="use dt"):
        run(away, 1e-6, steps=1_000)
