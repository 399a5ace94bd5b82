"""Grains in the DEM against an independent twin, and as disks against the DEM of disks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from grain_oracle import GrainOracle
from nurbs_shapes_of_tests import peanut
from scenes import all_pairs, difference, numerics, random_scene, run

from ninedisk.core import ContactLaw, Disks, History, Scene, Wall, simulate
from ninedisk.core.dem.critical import critical_time_step
from ninedisk.core.dem.session import DemSession
from ninedisk.core.dem.state import FS, SIDE
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import disk, ellipse
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.nine_disk.compression import Compression
from ninedisk.harness.cases.nine_disk.distortion import Distortion

DT, STEPS = 1e-3, 400

CLOSE = 1e-9
"""Round-off of some hundred steps; what the planted defects do is a millionfold."""


def tumble(seed: int, lever_arm: str, slip_at: str = "middle") -> Scene:
    """Peanuts and an ellipse thrown onto a floor and each other, rocking on both lobes, sliding and sticking."""
    rng = np.random.default_rng(seed)
    law = ContactLaw(kn=4e4, ks=2e4, mu=0.4, beta=0.1, lever_arm=lever_arm, slip_at=slip_at)
    kinds = [uniform_grain(peanut(), 1.0), uniform_grain(ellipse(1.2, 0.8), 1.0)]
    number = np.array([0, 0, 1])
    grain = [kinds[k] for k in number]
    disks = Disks(
        x=[(0.0, 0.75), (0.3, 2.3), (2.8, 0.85)],
        v=rng.normal([(0.4, 0.0), (0.3, -0.5), (-0.8, 0.0)], 0.1),
        omega=rng.normal([0.5, -0.5, 0.5], 0.1),
        radius=[g.radius for g in grain],
        mass=[g.mass for g in grain],
        inertia=[g.inertia for g in grain],
        outline=number,
        angle=rng.normal(0.0, 0.05, 3),
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    return Scene(
        disks=disks, disk_disk=law, walls=(floor,), gravity=(0.0, -9.81), outlines=tuple(k.outline for k in kinds)
    )


def farthest_apart(session: DemSession, oracle: GrainOracle, steps: int = STEPS) -> tuple[float, int]:
    """Largest difference of positions, angles and summed shear forces (over 10 N) on the way; most contacts of a pair. Advances both."""
    worst, most = 0.0, 0
    for _ in range(steps):
        session.advance(1)
        oracle.advance()
        _, now = session.snapshot()
        worst = max(worst, float(np.abs(now["x"] - oracle.x).max()))
        worst = max(worst, float(np.abs(now["angle"] + session.scene.disks.angle - oracle.angle).max()))
        sums: dict[tuple[int, int], float] = {}
        for contact in oracle.contacts:
            sums[contact.pair] = sums.get(contact.pair, 0.0) + contact.fs
            most = max(most, sum(other.pair == contact.pair for other in oracle.contacts))
        mine = session.shear_forces()
        for pair in {*sums, *mine}:
            worst = max(worst, abs(sums.get(pair, 0.0) - mine.get(pair, 0.0)) / 10.0)
    return worst, most


@pytest.mark.parametrize("lever_arm", ["radius", "overlap", "torque-overlap"])
@pytest.mark.parametrize("slip_at", ["middle", "end"])
def test_the_same_motion(lever_arm: str, slip_at: str) -> None:
    scene = tumble(1, lever_arm, slip_at)
    worst, most = farthest_apart(DemSession(scene, numerics(DT, STEPS)), GrainOracle(scene, DT))
    assert worst <= CLOSE
    assert most == 2


def test_a_lost_torque_of_normal_forces_is_seen() -> None:
    scene = tumble(1, "overlap")
    wrong = GrainOracle(scene, DT, normal_torque=False)
    assert farthest_apart(DemSession(scene, numerics(DT, STEPS)), wrong)[0] > 1e-3


@pytest.mark.parametrize("defect", ["lost", "swapped"])
def test_a_shear_history_that_follows_the_wrong_contact_is_seen(defect: str) -> None:
    """As if a rebuild lost the history, or the two contacts of a pair changed theirs, once."""
    scene = tumble(1, "overlap")
    session, oracle = DemSession(scene, numerics(DT, STEPS)), GrainOracle(scene, DT)
    assert farthest_apart(session, oracle, 100)[0] <= CLOSE
    assert session._outlines is not None
    memory = session._outlines.memory
    side = int(memory.mark[SIDE])
    rows = [k for k in range(int(memory.mark[1 + side])) if tuple(memory.body[side, k, :2]) == (0, 3)]
    assert len(rows) == 2
    assert abs(np.diff(memory.contact[side, rows, FS])[0]) > 1e-3
    if defect == "lost":
        memory.head[side] = -1
    else:
        memory.contact[side, rows, FS] = memory.contact[side, rows[::-1], FS]
    assert farthest_apart(session, oracle, 50)[0] > 1e3 * CLOSE


FIELDS = (
    "x",
    "v",
    "angle",
    "omega",
    "gap",
    "fn",
    "fs",
    "wall_force",
    "elastic_normal",
    "elastic_shear",
    "kinetic",
    "wall_work",
)


def outlined(scene: Scene, share: float = 1.0) -> Scene:
    """The scene with a share of its disks given as outlines, turned at random."""
    rng = np.random.default_rng(5)
    disks = scene.disks
    radii, number = np.unique(disks.radius, return_inverse=True)
    chosen = np.where(rng.random(len(disks)) < share, number, -1)
    angle = rng.uniform(-3.0, 3.0, len(disks))
    return scene.replace(
        disks=replace(disks, outline=chosen, angle=angle), outlines=tuple(disk(float(radius)) for radius in radii)
    )


def apart(scene: Scene) -> bool:
    """No disk inside another one, which has no chord."""
    x, radius = scene.disks.x, scene.disks.radius
    d = np.hypot(*(x[:, None] - x[None]).T) + 9.0 * np.eye(len(x))
    return bool(np.all(d > 1.2 * np.abs(radius[:, None] - radius[None]) + 0.2))


def assert_close(one: History, two: History) -> None:
    """Each field relative to its largest value; rotations, which symmetry can make nothing but round-off, to the disks' motion."""
    found = difference(one, two, FIELDS)
    for name, motion in (("angle", two.x - two.x[0]), ("omega", two.v)):
        scale = max(float(np.abs(getattr(two, name)).max()), float(np.abs(motion).max()))
        found[name] = float(np.abs(getattr(one, name) - getattr(two, name)).max()) / scale
    assert {name: value for name, value in found.items() if not value <= CLOSE} == {}


@pytest.mark.parametrize(("seed", "share"), [(seed, (1.0, 0.5)[seed % 2]) for seed in range(6)])
def test_random_scenes(seed: int, share: float) -> None:
    """Walls that move, dashpots, friction, preload, all lever arms, global damping; disks alone, or disks among outlines."""
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, 1e-3, 150)
    while not apart(scene):
        scene = random_scene(rng, 1e-3, 150)
    how = numerics(1e-3, 150, damping_form="lagged" if seed % 3 == 2 else "central")
    other = outlined(scene, share)
    assert_close(run(other, how), run(scene, how))
    assert critical_time_step(other) == pytest.approx(critical_time_step(scene), rel=1e-3)


@pytest.mark.parametrize("case", [Compression(), Distortion()], ids=["compression", "distortion"])
@pytest.mark.parametrize("lever_arm", ["radius", "overlap"])
def test_nine_disks(case: Compression | Distortion, lever_arm: str) -> None:
    setup = case.build(resolve(case, {"wall_mu": "mu"}).params)
    law = replace(setup.scene.disk_disk, lever_arm=lever_arm)
    walls = tuple(replace(wall, law=replace(wall.law, lever_arm=lever_arm)) for wall in setup.scene.walls)
    scene = setup.scene.replace(disk_disk=law, walls=walls)
    how = setup.numerics
    watch = [pair for pair in all_pairs(scene) if pair[1] < 9][:12] + [(i, 9 + i % len(walls)) for i in range(9)]
    assert_close(simulate(outlined(scene), how, watch), simulate(scene, how, watch))


def test_the_comparison_sees_other_arms() -> None:
    """Planted: the other lever arm, and radii off by 1e-8, are both seen."""
    setup = Distortion().build(resolve(Distortion(), {}).params)
    how = setup.numerics
    plain = simulate(setup.scene, how)
    arm = "overlap" if setup.scene.disk_disk.lever_arm == "radius" else "radius"
    other = outlined(setup.scene.replace(disk_disk=replace(setup.scene.disk_disk, lever_arm=arm)))
    with pytest.raises(AssertionError):
        assert_close(simulate(other, how), plain)
    scene = outlined(setup.scene)
    smaller = tuple(disk(float(curve.points[0, 0]) * (1.0 - 1e-8)) for curve in scene.outlines)
    with pytest.raises(AssertionError):
        assert_close(simulate(scene.replace(outlines=smaller), how), plain)
