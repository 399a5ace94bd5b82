"""Disks given as outlines move as disks do, to round-off, whatever the law: this fixes what lever arms mean on outlines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import all_pairs, difference, numerics, random_scene, run

from ninedisk.core import History, Scene, simulate
from ninedisk.core.dem.critical import critical_time_step
from ninedisk.core.nurbs.shapes import disk
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.nine_disk.compression import Compression
from ninedisk.harness.cases.nine_disk.distortion import Distortion

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

CLOSE = 1e-9
"""Round-off, 1e-16 a step, that some hundred steps with sliding and separating contacts amplify; a wrong arm is 1e-3 and more."""


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


@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize("seed", range(6))
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
