"""Motion of walls, exact in time, and disks that get behind one."""

from __future__ import annotations

import re

import numpy as np
import pytest
from oracle import wall_at
from scenes import KN, numerics, random_motion, run

from ninedisk.core import BehindWallError, ContactLaw, Disks, Numerics, Scene, Wall, WallSegment, simulate
from ninedisk.core.dem.session import DemSession
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import ellipse
from ninedisk.core.scene.motion import compile_motion, wall_poses
from ninedisk.core.scene.motion_kernels import place_walls

LAW = ContactLaw(kn=KN)


def wall(
    *motion: WallSegment, point: tuple[float, float] = (0.3, -1.0), normal: tuple[float, float] = (0.6, 0.8)
) -> Wall:
    return Wall(name="w", point=point, normal=normal, law=LAW, motion=motion)


def pose(one: Wall, t: float) -> np.ndarray:
    return wall_poses(compile_motion([one]), t)[0]


def test_random_motions_against_the_twin() -> None:
    for seed in range(200):
        rng = np.random.default_rng(seed)
        one = wall(*random_motion(rng, 0.01, 60))
        for t in rng.uniform(0.0, 0.9, 5):
            expected, found = wall_at(one, t), pose(one, t)
            # Amplitudes and levers of some metres; velocities up to ten times that.
            np.testing.assert_allclose(found[0:2], expected.point, rtol=0, atol=1e-14 * 10)
            np.testing.assert_allclose(found[2:4], expected.normal, rtol=0, atol=1e-15 * 4)
            np.testing.assert_allclose(found[4:6], expected.pivot, rtol=0, atol=1e-14 * 10)
            np.testing.assert_allclose(found[6:8], expected.pivot_velocity, rtol=0, atol=1e-13 * 10)
            assert found[8] == expected.spin
            np.testing.assert_array_equal(found[9:11], found[6:8])


@pytest.mark.parametrize(
    "segment",
    [
        WallSegment(velocity=(0.5, -2.0)),
        WallSegment(amplitude=(0.2, -0.1), frequency=7.0, phase=0.8),
        WallSegment(tan_lever=(0.4, 3.0), tan_rate=0.3, duration=3.0),
        WallSegment(angular_velocity=1.3, pivot=(0.0, 0.0)),
        WallSegment(angular_velocity=-0.7, pivot=(4.0, 2.0), velocity=(1.0, 0.0), amplitude=(0.0, 0.5), frequency=2.0),
    ],
)
def test_velocity_is_the_derivative_of_the_surface_point(segment: WallSegment) -> None:
    one, t, h = wall(segment), 0.6, 1e-5
    now = pose(one, t)
    slope = (pose(one, t + h)[0:2] - pose(one, t - h)[0:2]) / (2 * h)
    arm = now[0:2] - now[4:6]
    velocity = now[6:8] + now[8] * np.array([-arm[1], arm[0]])
    # Central difference: third derivatives of some tens times h^2/6, and eps/h.
    np.testing.assert_allclose(velocity, slope, rtol=0, atol=2e-8)
    assert np.hypot(*velocity) > 0.1


def test_half_turn_about_a_pivot() -> None:
    one = wall(
        WallSegment(duration=2.0, angular_velocity=np.pi / 2, pivot=(1.0, 0.0)), point=(3.0, 0.0), normal=(0.0, 1.0)
    )
    for t in (2.0, 5.0):
        np.testing.assert_allclose(pose(one, t)[:4], [-1.0, 0.0, 0.0, -1.0], rtol=0, atol=1e-15)


def test_tangent_ramp_follows_a_side_that_turns() -> None:
    """A cap at height h on a side wall turning by ``rate t`` moves by ``h tan(rate t)``: the side passes through its corner."""
    height, rate, t = 2.5, 0.1, 4.0
    side = wall(WallSegment(angular_velocity=-rate), point=(0.0, 0.0), normal=(1.0, 0.0))
    cap = wall(
        WallSegment(tan_lever=(height, 0.0), tan_rate=rate, duration=10.0), point=(0.0, height), normal=(0.0, -1.0)
    )
    corner = pose(cap, t)[0:2]
    assert corner == pytest.approx([height * np.tan(0.4), height], rel=1e-15)
    assert (corner - pose(side, t)[0:2]) @ pose(side, t)[2:4] == pytest.approx(0.0, abs=1e-15)


def test_wall_rests_after_its_last_segment_and_keeps_its_bits_without_rotation() -> None:
    one = wall(WallSegment(duration=0.3, velocity=(1.0, 0.0)), WallSegment(duration=0.3, velocity=(0.0, 1.0)))
    rest = pose(one, 0.6)
    np.testing.assert_array_equal(rest[2:4], [0.6, 0.8])
    np.testing.assert_array_equal(pose(one, 1e9)[:6], rest[:6])
    np.testing.assert_array_equal(pose(one, 1.0)[6:], 0.0)
    np.testing.assert_allclose(rest[:2], [0.6, -0.7], rtol=0, atol=1e-15)


def test_step_that_ends_a_segment_belongs_to_it() -> None:
    """Velocities are those of the middle of the step, for dashpots of its end, both in the segment of the step."""
    one = wall(WallSegment(duration=1.0, velocity=(2.0, 0.0)), WallSegment(duration=1.0, velocity=(0.0, 5.0)))
    table = np.empty((1, 11))
    place_walls(compile_motion([one]), 1.0, 0.95, 1.0, table)
    np.testing.assert_array_equal(table[0, 6:11], [2.0, 0.0, 0.0, 2.0, 0.0])
    place_walls(compile_motion([one]), 1.1, 1.05, 1.1, table)
    np.testing.assert_array_equal(table[0, 6:11], [0.0, 5.0, 0.0, 0.0, 5.0])


def test_dashpots_see_the_velocity_at_the_end_of_the_step() -> None:
    one = wall(WallSegment(amplitude=(0.0, 0.1), frequency=10.0))
    table = np.empty((1, 11))
    place_walls(compile_motion([one]), 0.2, 0.15, 0.2, table)
    assert table[0, 7] == pytest.approx(np.cos(1.5), rel=1e-14)
    assert table[0, 10] == pytest.approx(np.cos(2.0), rel=1e-14)


@pytest.mark.parametrize("end", [0.0107, 0.0102, 0.0105, 0.01])
def test_segment_that_ends_between_two_steps_ends_there(end: float) -> None:
    motion = (WallSegment(duration=end, velocity=(0.0, 1.0)), WallSegment(duration=0.0003, velocity=(0.0, 2.0)))
    floor = Wall(name="floor", point=(0.0, -5.0), normal=(0.0, 1.0), law=LAW, motion=motion)
    scene = Scene(disks=Disks(x=[[0.0, 0.0]], radius=1.0, mass=1.0), disk_disk=LAW, walls=(floor,))
    history = run(scene, numerics(1e-3, 15))
    expected = [wall_at(floor, t).point[1] for t in history.t]
    np.testing.assert_allclose(history.wall_point[:, 0, 1], expected, rtol=0, atol=1e-15)
    assert history.wall_point[-1, 0, 1] == pytest.approx(-5.0 + end + 0.0006, abs=1e-15)


def test_lists_of_a_turning_wall_are_rebuilt_in_time() -> None:
    """A wall that sweeps over disks far from its pivot: none is missed, however fast its surface there."""
    floor = Wall(
        name="floor",
        point=(0.0, 0.0),
        normal=(0.0, 1.0),
        law=LAW,
        motion=(WallSegment(angular_velocity=2.0, pivot=(0.0, 0.0)),),
    )
    for x in (5.0, 20.0, 80.0):
        disks = Disks(x=[[x, 3.0], [0.0, 30.0]], radius=1.0, mass=1e9)
        # Until its centre is a tenth of a radius above the wall.
        end = 0.5 * (np.arctan2(3.0, x) - np.arcsin(0.1 / np.hypot(3.0, x)))
        history = run(Scene(disks=disks, disk_disk=LAW, walls=(floor,)), numerics(1e-3, int(end / 1e-3)))
        height = 3.0 * np.cos(2.0 * history.t) - x * np.sin(2.0 * history.t)
        expected = KN * np.maximum(1.0 - height, 0.0)
        assert expected.max() > 0.6 * KN
        # The disks weigh so much that they stay: 1e4 N on 1e9 kg for 0.3 s move them by 5e-7 m.
        np.testing.assert_allclose(history.fn[:, history.contact((0, 2))], expected, rtol=1e-3, atol=KN * 1e-4)
    assert (history.wall_force[-1] != 0.0).any()


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


def test_walls_that_turn_past_each_other_leave_space_or_say_so() -> None:
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
    v[[7, 1300, 41]] = [[0.0, -850.0], [-850.0, 0.0], [0.0, -850.0]]  # two steps to a wall and behind it
    walls = (FLOOR, Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=LAW))
    scene = Scene(disks=Disks(x=x, v=v, radius=0.9, mass=1.0), disk_disk=LAW, walls=walls)
    said = set()
    for threads in (1, 2, 3):
        with pytest.raises(BehindWallError, match=r"centre of disk (7|1300|41) is .* m behind wall") as caught:
            DemSession(scene, numerics(1e-3, 3), threads=threads).run()
        said.add(str(caught.value))
    assert len(said) == 1
