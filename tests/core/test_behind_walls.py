"""Centres stay in front of walls during the whole run, or the run ends at the step where one does not, in either method."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scenes import KN, numerics

from ninedisk.core import BehindWallError, ContactLaw, Disks, Numerics, Scene, Wall, WallSegment, simulate
from ninedisk.core.dem.session import DemSession
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse

LAW = ContactLaw(kn=KN)
FLOOR = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=LAW)


def thrown(v: float, **changes: object) -> Scene:
    disks = Disks(x=[[0.0, 1.0], [5.0, 30.0]], v=[[0.0, v], [0.0, 0.0]], radius=0.5, mass=1.0)
    return Scene(**{"disks": disks, "disk_disk": LAW, "walls": (FLOOR,), **changes})


def squeezing(gap: float, speed: float, *, x: float = 0.0) -> Scene:
    """Two facing walls that close in on a disk, and would pass through each other."""
    walls = (
        FLOOR,
        Wall(
            name="lid",
            point=(0.0, gap),
            normal=(0.0, -1.0),
            law=LAW,
            motion=(WallSegment(velocity=(0.0, -speed)),),
        ),
    )
    return Scene(disks=Disks(x=[[x, 0.5 * gap]], radius=0.5, mass=1.0), disk_disk=LAW, walls=walls)


def test_a_disk_that_flies_through_the_floor_in_one_step() -> None:
    """It is at y = 1 - 10 m after the first step, farther than any list of neighbours would have had it."""
    message = (
        r"centre of disk 0 is 9 m behind wall 'floor' at contact step 1 \(t = 0\.001 s\).*reduce contact_dt = 0\.001 s"
    )
    with pytest.raises(BehindWallError, match=message):
        simulate(thrown(-1e4), numerics(1e-3, 50))
    session = DemSession(thrown(-1e4), numerics(1e-3, 50))
    for _ in range(2):  # it does not go on either
        with pytest.raises(BehindWallError, match=message):
            session.run()


def test_a_disk_that_sinks_into_a_soft_floor() -> None:
    """Its overlap reaches its radius: v/omega = 0.6 m is more than 0.5 m. y = 0.5 - 0.6 sin(omega t) is 0 at sin = 5/6."""
    omega = np.sqrt(KN)
    disks = Disks(x=[[0.0, 0.5]], v=[[0.0, -0.6 * omega]], radius=0.5, mass=1.0)
    with pytest.raises(BehindWallError) as caught:
        simulate(Scene(disks=disks, disk_disk=LAW, walls=(FLOOR,)), numerics(1e-5, 5000))
    step = int(re.search(r"contact step (\d+)", str(caught.value)).group(1))
    assert step * 1e-5 == pytest.approx(np.arcsin(5.0 / 6.0) / omega, abs=1.1e-5)
    held = Disks(x=[[0.0, 0.5]], v=[[0.0, -0.4 * omega]], radius=0.5, mass=1.0)
    simulate(Scene(disks=held, disk_disk=LAW, walls=(FLOOR,)), numerics(1e-5, 5000))


@pytest.mark.parametrize("x", [0.0, 1e6])
@pytest.mark.parametrize("method", ["dem", "cd"])
def test_walls_that_cross(method: str, x: float) -> None:
    """The lid is at y = 0 after 1 s; a disk is behind one of the two no later than then, wherever it is."""
    scene = squeezing(2.0, 2.0, x=x)
    steps = {"contact_dt": 1e-3} if method == "dem" else {}
    with pytest.raises(BehindWallError) as caught:
        simulate(scene, Numerics(dt=1e-3, n_steps=2000, **steps), method=method)
    time = float(re.search(r"t = ([0-9.e+-]+) s", str(caught.value)).group(1))
    assert 0.75 < time <= 1.0  # from the touch on


def test_walls_that_turn_past_each_other_leave_room_or_say_so() -> None:
    """Half-planes cross at every corner of a box; a wall that turns is no mistake until it sweeps over a centre."""
    turning = Wall(
        name="door",
        point=(2.0, 0.0),
        normal=(-1.0, 0.0),
        law=LAW,
        motion=(WallSegment(angular_velocity=1.0, pivot=(2.0, 0.0)),),
    )
    disks = Disks(x=[[0.0, 0.5]], radius=0.5, mass=1.0, held=True, rotating=False)
    free = Disks(x=[[0.0, 0.5]], radius=0.5, mass=1.0)
    how = numerics(1e-3, 1500)
    simulate(Scene(disks=disks, disk_disk=LAW, walls=(FLOOR, turning)), how)  # fixed disks have no contacts with walls
    simulate(Scene(disks=free, disk_disk=LAW, walls=(FLOOR, turning)), how.replace(n_steps=500))


@pytest.mark.parametrize("contact_dt", [None, 1e-3])
def test_contact_dynamics_of_soft_contacts(contact_dt: float | None) -> None:
    """Elastic contacts of an impulse engine can be overrun as well; steps taken together and one by one say the same."""
    found = []
    for options in ({}, {"solver": "interior-point"}):
        how = Numerics(dt=1e-3, n_steps=100, contact_dt=contact_dt, **options)
        with pytest.raises(
            BehindWallError, match=r"disk 0 is .* m behind wall 'floor' at step \d+ .*reduce dt"
        ) as caught:
            simulate(thrown(-200.0), how, method="cd")
        found.append(re.search(r"at step (\d+)", str(caught.value)).group(1))
    assert found[0] == found[1]


def test_grains_with_outlines() -> None:
    grain = uniform_grain(ellipse(1.2, 0.8), 1.0)
    disks = Disks(x=[[0.0, 2.0]], v=[[0.0, -1e4]], radius=1.2, mass=grain.mass, inertia=grain.inertia, outline=0)
    scene = Scene(disks=disks, disk_disk=LAW, walls=(FLOOR,), outlines=(grain.outline,))
    with pytest.raises(BehindWallError, match=r"disk 0 is 8 m behind wall 'floor' at contact step 1"):
        simulate(scene, numerics(1e-3, 5))


def test_the_same_disk_is_named_whatever_the_number_of_threads() -> None:
    side = 50
    x = np.stack(np.meshgrid(np.arange(side) * 2.0 + 1.0, np.arange(side) * 2.0 + 1.0), axis=-1).reshape(-1, 2)
    v = np.zeros_like(x)
    v[[77, 1303, 2400]] = [[0.0, -1e6], [-1e6, 0.0], [0.0, -1e6]]
    walls = (FLOOR, Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=LAW))
    scene = Scene(disks=Disks(x=x, v=v, radius=0.9, mass=1.0), disk_disk=LAW, walls=walls)
    said = set()
    for threads in (1, 2, 3):
        with pytest.raises(BehindWallError, match=r"centre of disk (77|1303|2400) is 9\d\d m behind wall") as caught:
            DemSession(scene, numerics(1e-3, 3), threads=threads).run()
        said.add(str(caught.value))
    assert len(said) == 1
