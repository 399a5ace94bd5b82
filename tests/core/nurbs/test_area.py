"""The law of the common area: the area itself, and that force and torque are the gradient of its energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from nurbs_shapes_of_tests import peanut
from scenes import numerics

from ninedisk.core import ContactLaw, Disks, Scene, Wall
from ninedisk.core.dem.session import DemSession
from ninedisk.core.nurbs.mass import uniform_grain
from ninedisk.core.nurbs.shapes import disk, ellipse

LAW = ContactLaw(kn=1e3, contact="area")


def at_rest(scene: Scene) -> tuple[float, np.ndarray, np.ndarray]:
    """Elastic energy, forces and torques at time 0."""
    session = DemSession(scene, numerics(1e-9, 1))
    session.advance(0)
    return (
        float(session.history().energy["elastic_normal"][0]),
        session._disks.force.copy(),
        session._disks.torque.copy(),
    )


def lens(a: float, b: float, d: float) -> float:
    """Common area of two circles of radii a, b whose centres are d apart."""
    one, two = (np.arccos((d * d + p * p - q * q) / (2.0 * d * p)) for p, q in ((a, b), (b, a)))
    return float(a * a * (one - 0.5 * np.sin(2.0 * one)) + b * b * (two - 0.5 * np.sin(2.0 * two)))


@pytest.mark.parametrize("as_outlines", [False, True])
@pytest.mark.parametrize(("a", "b", "d"), [(1.0, 1.0, 1.9), (1.0, 0.3, 1.2), (0.7, 2.0, 1.6), (1.0, 1.0, 0.4)])
def test_the_area_of_circles(a: float, b: float, d: float, as_outlines: bool) -> None:
    disks = Disks(x=[(0.0, 0.0), (0.6 * d, 0.8 * d)], radius=[a, b], mass=1.0, inertia=1.0)
    scene = Scene(disks=disks, disk_disk=LAW)
    if as_outlines:
        scene = scene.replace(disks=replace(disks, outline=[0, 1], angle=[0.3, -2.0]), outlines=(disk(a), disk(b)))
    energy, force, _ = at_rest(scene)
    area = lens(a, b, d)
    curvature = 1.0 / a + 1.0 / b
    expected = 0.5 * LAW.kn * (9.0 * area**2 * curvature / 32.0) ** (2.0 / 3.0)
    # The cosines of the closed form lose digits as the overlap gets small; none here is below a twentieth of the radius.
    assert energy == pytest.approx(expected, rel=1e-13)
    half = (d * d + a * a - b * b) / (2.0 * d)
    pull = 4.0 / 3.0 * expected / area * 2.0 * np.sqrt(a * a - half * half)
    np.testing.assert_allclose(force, pull * np.array([(-0.6, -0.8), (0.6, 0.8)]), rtol=1e-12)


def touching() -> Scene:
    """A dented grain with two contacts with a floor and one with an ellipse."""
    kinds = [uniform_grain(peanut(), 1.0), uniform_grain(ellipse(1.2, 0.5), 1.0)]
    disks = Disks(
        x=[(0.0, 0.73), (0.9, 1.87)],
        radius=[kind.radius for kind in kinds],
        mass=1.0,
        inertia=1.0,
        outline=[0, 1],
        angle=[0.004, 0.2],
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=LAW)
    return Scene(disks=disks, disk_disk=LAW, walls=(floor,), outlines=tuple(kind.outline for kind in kinds))


def energy_moved(scene: Scene, body: int, coordinate: int, by: float) -> float:
    x, angle = scene.disks.x.copy(), scene.disks.angle.copy()
    if coordinate < 2:
        x[body, coordinate] += by
    else:
        angle[body] += by
    return at_rest(scene.replace(disks=replace(scene.disks, x=x, angle=angle)))[0]


@pytest.mark.parametrize("contact", ["area", "chord"])
def test_force_and_torque_are_the_gradient_of_the_energy(contact: str) -> None:
    """Differences of fourth order, whose error is 1e-9 here. The chord's force, with kn overlap^2/2 for an energy, is none."""
    law = replace(LAW, contact=contact)
    scene = touching()
    scene = scene.replace(disk_disk=law, walls=tuple(replace(wall, law=law) for wall in scene.walls))
    session = DemSession(scene, numerics(1e-9, 1))
    session.advance(0)
    assert session._outlines is not None
    mark = session._outlines.memory.mark
    assert mark[1 + mark[0]] == 3
    _, force, torque = at_rest(scene)
    h, worst = 2e-5, 0.0
    for body in range(2):
        for coordinate in range(3):
            near, far = (
                energy_moved(scene, body, coordinate, step) - energy_moved(scene, body, coordinate, -step)
                for step in (h, 2.0 * h)
            )
            slope = (8.0 * near - far) / (12.0 * h)
            exact = force[body, coordinate] if coordinate < 2 else torque[body]
            worst = max(worst, abs(slope + exact))
    size = float(np.abs(force).max())
    if contact == "area":
        assert worst <= 1e-7 * size
    else:
        assert worst > 1e-2 * size
