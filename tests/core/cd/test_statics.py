"""The static limit: equilibria, mechanisms, loads beyond the limit, modes without energy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ninedisk.core.cd.session import CdSession
from ninedisk.core.errors import InvalidSceneError, NoEquilibriumError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate

RIGID = ContactLaw(kn=1e8, ks=1e8, mu=0.4, restitution=0.0, regularised=True)
SOFT = ContactLaw(kn=1e6, ks=0.5e6, mu=0.4)


def floor(law: ContactLaw, **motion: Any) -> Wall:
    return Wall(
        name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=(WallSegment(**motion),) if motion else ()
    )


def statics(scene: Scene, watch: Any = (), **numerics: Any) -> Any:
    return simulate(
        scene, Numerics(**{"dt": 1.0, "n_steps": 1, "regime": "quasi-static", **numerics}), watch, method="cd"
    )


@pytest.mark.parametrize("law", [RIGID, SOFT])
@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
def test_pyramid_at_rest(law: ContactLaw, sliding: str) -> None:
    """Three equal disks: floor forces 3/2 weights in all each side; the upper contacts' vertical part is half a weight."""
    disks = Disks(x=[[0.0, 1.0], [2.0, 1.0], [1.0, 1.0 + math.sqrt(3.0)]], radius=1.0, mass=2.0)
    scene = Scene(disks=disks, disk_disk=law, walls=(floor(law),), gravity=(0.0, -10.0))
    history = statics(scene, [(0, 3), (1, 3), (0, 2), (1, 2)], sliding=sliding)
    p, q = history.fn[-1], history.fs[-1]
    assert p[:2] == pytest.approx([30.0, 30.0], rel=1e-9)
    # n from 0 to 2 is (1/2, sqrt(3)/2): the pair's vertical force on the upper disk is p sqrt(3)/2 - q/2 (side 0).
    assert p[2] * math.sqrt(3.0) / 2.0 - q[2] / 2.0 == pytest.approx(10.0, rel=1e-9)
    assert (np.abs(q) <= 0.4 * p * (1 + 1e-9)).all()


def test_slope_within_and_beyond_friction() -> None:
    """tan(angle) below mu rests; above, nothing holds the disk that cannot turn."""
    for angle, holds in ((0.99 * math.atan(0.4), True), (1.01 * math.atan(0.4), False)):
        disks = Disks(x=[[0.0, 1.0]], radius=1.0, mass=2.0, rotating=False)
        gravity = (10.0 * math.sin(angle), -10.0 * math.cos(angle))
        scene = Scene(disks=disks, disk_disk=RIGID, walls=(floor(RIGID),), gravity=gravity)
        for sliding in ("associated", "coulomb"):
            if holds:
                history = statics(scene, [(0, 1)], sliding=sliding)
                assert history.fs[-1, 0] == pytest.approx(-20.0 * math.sin(angle), rel=1e-9)
                assert np.abs(history.x[-1] - scene.disks.x).max() < 1e-12
            else:
                with pytest.raises(NoEquilibriumError, match=r"step 1 .*disk\(s\) 0 "):
                    statics(scene, sliding=sliding)


@pytest.mark.parametrize("law", [RIGID, SOFT])
def test_a_driven_mechanism_is_named(law: ContactLaw) -> None:
    """Disk 1 rolls off under a tilted load although disk 0 is held in a corner; only disk 1 is blamed."""
    walls = (floor(law), Wall(name="left", point=(-1.0, 0.0), normal=(1.0, 0.0), law=law))
    disks = Disks(x=[[0.0, 1.0], [10.0, 1.0]], radius=1.0, mass=2.0)
    scene = Scene(disks=disks, disk_disk=law, walls=walls, gravity=(1.0, -10.0))
    tilted = scene.replace(gravity=(-1.0, -10.0))
    with pytest.raises(NoEquilibriumError, match=r"disk\(s\) (1|0, 1|1, 0) by more than a radius"):
        statics(scene)
    # The other way disk 0 is supported, and disk 1 still rolls.
    with pytest.raises(NoEquilibriumError, match=r"disk\(s\) 1 by more"):
        statics(tilted)


def test_rattler_keeps_its_place_and_is_reported() -> None:
    """A disk that nothing touches, without weight, is no mechanism that a load drives."""
    disks = Disks(x=[[0.0, 1.0], [10.0, 5.0]], radius=1.0, mass=[2.0, 2.0])
    walls = (floor(SOFT, velocity=(0.0, 1e-3)), Wall(name="top", point=(0.0, 2.0), normal=(0.0, -1.0), law=SOFT))
    scene = Scene(disks=Disks(x=disks.x[:1], radius=1.0, mass=2.0), disk_disk=SOFT, walls=walls)
    history = statics(scene, [(0, 1)], n_steps=3)
    assert history.fn[-1, 0] == pytest.approx(1e6 * 3e-3 / 2.0, rel=1e-9)
    free = Scene(disks=disks, disk_disk=SOFT, walls=(floor(SOFT, velocity=(0.0, 1e-3)),))
    session = CdSession(free, Numerics(dt=1.0, n_steps=2, regime="quasi-static"))
    history = session.run()
    assert np.array_equal(history.x[-1, 1], disks.x[1])
    assert history.x[-1, 0, 1] == pytest.approx(1.0 + 2e-3, abs=1e-12)
    assert "without energy" in session.remarks[0]


def test_wall_pushes_a_column() -> None:
    """Series of springs between two walls: the displacement is shared, the force is kn/4 w for three disks, four contacts."""
    disks = Disks(x=[[0.0, 1.0], [0.0, 3.0], [0.0, 5.0]], radius=1.0, mass=2.0)
    walls = (
        floor(SOFT, velocity=(0.0, 1e-4)),
        Wall(name="top", point=(0.0, 6.0), normal=(0.0, -1.0), law=SOFT),
    )
    scene = Scene(disks=disks, disk_disk=SOFT, walls=walls)
    history = statics(scene, [(0, 3), (0, 1), (1, 2), (2, 4)], n_steps=10)
    expected = 1e6 / 4.0 * 1e-4 * history.step
    assert np.abs(history.fn - expected[:, None]).max() <= 1e-9 * expected[-1]
    assert history.energy["elastic"][-1] == pytest.approx(4 * expected[-1] ** 2 / 2e6, rel=1e-9)


def test_contradictory_prescribed_motion_is_an_error() -> None:
    """A held disk that is driven into a rigid floor, and a rigid disk that two walls squeeze."""
    held = Disks(x=[[0.0, 1.0]], v=[[0.0, -0.01]], radius=1.0, mass=2.0, rotating=False, held=[[True, True]])
    scene = Scene(disks=held, disk_disk=RIGID, walls=(floor(RIGID),))
    with pytest.raises(InvalidSceneError, match="prescribed"):
        statics(scene)
    with pytest.raises(InvalidSceneError, match="prescribed"):
        simulate(scene, Numerics(dt=1.0, n_steps=1), method="cd")
    walls = (floor(RIGID, velocity=(0.0, 0.1)), Wall(name="top", point=(0.0, 2.0), normal=(0.0, -1.0), law=RIGID))
    squeezed = Scene(disks=Disks(x=[[0.0, 1.0]], radius=1.0, mass=2.0), disk_disk=RIGID, walls=walls)
    for numerics in ({"regime": "quasi-static"}, {"regime": "dynamic"}, {"regime": "dynamic", "sliding": "coulomb"}):
        with pytest.raises(InvalidSceneError, match=r"step 1 .*no motion satisfies the rigid contacts"):
            statics(squeezed, **numerics)


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
@pytest.mark.parametrize("heavier", [1e3, 1e6])
def test_light_disks_bear_heavy_ones(heavier: float, sliding: str) -> None:
    """The velocity of a light disk is a sum of velocities that heavy loads would give it: known to round-off of these alone.

    What no rounding excuses: walls bear the whole weight, nothing moves by more than a part in 1e6 of a fall in a step.
    """
    n, radius, gravity, dt = 6, 0.5, 9.81, 1e-3
    x = np.array(
        [
            [radius * (1.0 + 2.0 * k + row % 2), radius * (1.0 + math.sqrt(3.0) * row)]
            for row in range(n)
            for k in range(n - row % 2)
        ]
    )
    mass = np.where(x[:, 1] > np.median(x[:, 1]), heavier, 1.0)
    sides = (((0.0, 0.0), (1.0, 0.0)), ((2.0 * radius * n, 0.0), (-1.0, 0.0)))
    walls = [Wall(name=f"side {k}", point=point, normal=normal, law=RIGID) for k, (point, normal) in enumerate(sides)]
    scene = Scene(
        disks=Disks(x=x, radius=radius, mass=mass),
        disk_disk=RIGID,
        walls=(floor(RIGID), *walls),
        gravity=(0.0, -gravity),
    )
    history = simulate(scene, Numerics(dt=dt, n_steps=3, sliding=sliding), method="cd")  # type: ignore[arg-type]
    weight = gravity * float(mass.sum())
    assert abs(float(history.wall_force[-1, :, 1].sum())) == pytest.approx(weight, rel=1e-8)
    assert float(np.abs(history.v[-1]).max()) < 1e-6 * gravity * dt
