"""Laws of the chord and of the common area: the area, forces as its gradient, collisions, energy."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from nurbs_shapes_of_tests import peanut
from scenes import numerics, orders, run

from ninedisk.core import ContactLaw, Disks, History, Scene, Wall
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


GRAIN = uniform_grain(ellipse(1.0, 0.6), 1.0)


def collision(law: ContactLaw, *, omega: tuple[float, float] = (0.3, -0.2), offset: float = 0.25) -> Scene:
    """Two ellipses, turned, that hit each other off centre at 1 m/s; closest at about t = 0.5 s."""
    disks = Disks(
        x=[(-1.2, 0.0), (1.2, offset)],
        v=[(0.5, 0.1), (-0.5, 0.1)],
        omega=omega,
        radius=GRAIN.radius,
        mass=GRAIN.mass,
        inertia=GRAIN.inertia,
        outline=0,
        angle=[0.5, -0.9],
    )
    return Scene(disks=disks, disk_disk=law, outlines=(GRAIN.outline,))


def total(history: History) -> np.ndarray:
    return np.asarray(history.energy["kinetic"] + history.energy["elastic"])


def lost(law: ContactLaw, dt: float) -> tuple[float, float]:
    """Relative change of the kinetic energy by the collision, and the largest overlap over the ellipse's mean size."""
    history = run(collision(law), numerics(dt, round(2.0 / dt), sample_every=4), [(0, 1)])
    assert history.gap[0, 0] > 0.0
    assert history.gap[-1, 0] > 0.0
    kinetic = history.energy["kinetic"]
    assert history.gap.min() < 0.0
    return float(kinetic[-1] / kinetic[0] - 1.0), float(-history.gap.min() / 0.8)


@pytest.mark.parametrize("contact", ["chord", "area"])
@pytest.mark.parametrize("rough", [False, True])
def test_momentum_and_angular_momentum(contact: str, rough: bool) -> None:
    """To round-off: forces are opposite, and act in one point (with lever_arm "overlap" the shear forces, too)."""
    law = ContactLaw(kn=2e3, ks=1e3 * rough, mu=0.5 * rough, beta=0.1 * rough, lever_arm="overlap", contact=contact)
    scene = collision(law)
    history = run(scene, numerics(1e-3, 2000), [(0, 1)])
    assert history.fn.max() > 10.0
    m, inertia = GRAIN.mass, GRAIN.inertia
    momentum = m * history.v.sum(axis=1)
    spin = m * (history.x[..., 0] * history.v[..., 1] - history.x[..., 1] * history.v[..., 0]) + inertia * history.omega
    assert np.abs(momentum - momentum[0]).max() <= 1e-10 * m
    assert np.abs(spin.sum(axis=1) - spin.sum(axis=1)[0]).max() <= 1e-10 * m


def test_the_chord_law_changes_the_energy_whatever_the_step() -> None:
    law = ContactLaw(kn=2e3)
    coarse, fine = (lost(law, dt)[0] for dt in (5e-4, 1.25e-4))
    assert abs(coarse) > 5e-3
    # The step's own share, 5e-5 of the energy at the coarser one (see the area law below), vanishes; the law's is what remains.
    assert abs(coarse - fine) <= 0.01 * abs(fine)


def test_the_change_is_proportional_to_the_overlap() -> None:
    found = [lost(ContactLaw(kn=kn), 2e-4 * np.sqrt(2e3 / kn)) for kn in (2e3, 8e3, 3.2e4)]
    change, overlap = np.abs(np.array(found)).T
    order = np.log(change[:-1] / change[1:]) / np.log(overlap[:-1] / overlap[1:])
    assert np.all(np.abs(order - 1.0) <= 0.2)


def test_the_area_law_keeps_the_energy_with_the_step() -> None:
    """Second order, like the scheme, on the whole: where between two steps the contact begins moves single values by a factor of 2. The
    chord's force loses far more at the same step."""
    law = ContactLaw(kn=2e3, contact="area")
    drift = []
    for dt in (4e-3, 2e-3, 1e-3, 5e-4):
        history = run(collision(law), numerics(dt, round(2.0 / dt)), [(0, 1)])
        energy = total(history)
        drift.append(float(np.abs(energy / energy[0] - 1.0).max()))
    assert abs(orders([drift[0], drift[-1]], 8.0)[0] - 2.0) <= 0.33
    assert drift[-1] <= 1e-4
    assert abs(lost(ContactLaw(kn=2e3), 5e-4)[0]) > 10.0 * drift[-1]


def test_kn_is_the_stiffness_of_disks_under_the_area_law() -> None:
    """``fn = kn overlap (1 + O(overlap/R))`` on disks of any radii, given as disks or as outlines, and the same for a wall."""
    law = ContactLaw(kn=3e3, contact="area")
    ratio = []
    for overlap in (1e-2, 1e-3, 1e-4):
        disks = Disks(x=[(0.0, 0.0), (1.5 - overlap, 0.0)], radius=[1.0, 0.5], mass=1.0)
        history = run(Scene(disks=disks, disk_disk=law), numerics(1e-9, 1), [(0, 1)])
        ratio.append(float(history.fn[0, 0] / (law.kn * overlap)) - 1.0)
        energy = float(history.energy["elastic_normal"][0]) / (0.5 * law.kn * overlap**2)
        assert abs(energy - 1.0) <= overlap
    assert np.all(np.abs(orders(ratio, 10.0) - 1.0) <= 0.05)
    assert abs(ratio[-1]) <= 1e-4


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="300,000 steps of a grain")
def test_a_box_of_elastic_ellipses() -> None:
    """30 smooth elastic ellipses between four walls: the area law's energy stays, 1e-3 at this step; the chord's wanders off."""
    drift = {}
    for contact in ("area", "chord"):
        law = ContactLaw(kn=1e4, contact=contact)
        rng = np.random.default_rng(4)
        x = np.array([(2.2 * i, 2.2 * j) for i in range(6) for j in range(5)])
        n = len(x)
        disks = Disks(
            x=x,
            v=rng.normal(0.0, 0.7, (n, 2)),
            omega=rng.normal(0.0, 0.7, n),
            radius=GRAIN.radius,
            mass=GRAIN.mass,
            inertia=GRAIN.inertia,
            outline=0,
            angle=rng.uniform(-3.0, 3.0, n),
        )
        sides = (
            ("left", (-1.2, 0), (1, 0)),
            ("right", (12.2, 0), (-1, 0)),
            ("low", (0, -1.2), (0, 1)),
            ("high", (0, 10), (0, -1)),
        )
        walls = [Wall(name=name, point=point, normal=normal, law=law) for name, point, normal in sides]
        scene = Scene(disks=disks, disk_disk=law, walls=walls, outlines=(GRAIN.outline,))
        history = run(scene, numerics(5e-4, 10_000, sample_every=100), [])
        energy = total(history)
        drift[contact] = float(np.abs(energy / energy[0] - 1.0).max())
    assert drift["area"] <= 1e-3
    assert drift["chord"] > 10.0 * drift["area"]
