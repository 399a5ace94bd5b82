"""Bodies with outlines in contact dynamics: as disks, at rest, sliding, rocking, toppling, and as the DEM's limit."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from test_nine_disks import box, run

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import UniformGrain, uniform_grain
from ninedisk.core.nurbs.shapes import disk, ellipse, fitted
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate

G = 10.0
RIGID = ContactLaw(kn=1.0, mu=0.5, regularised=True)
CLOSE = 1e-9
"""Round-off of some 1e-16 a step, through two hundred implicit steps; a wrong arm or point is 1e-3 and more."""


def outlined(scene: Scene, share: float = 1.0) -> Scene:
    """The scene with a share of its disks given as outlines, turned at random."""
    rng, disks = np.random.default_rng(5), scene.disks
    radii, number = np.unique(disks.radius, return_inverse=True)
    chosen = np.where(rng.random(len(disks)) < share, number, -1)
    turned = replace(disks, outline=chosen, angle=rng.uniform(-3.0, 3.0, len(disks)))
    return scene.replace(disks=turned, outlines=tuple(disk(float(radius)) for radius in radii))


def block(width: float, height: float) -> UniformGrain:
    """A rectangle with sharp corners, 1000 kg/m^2."""
    corners = 0.5 * np.array([[width, height], [-width, height], [-width, -height], [width, -height], [width, height]])
    return uniform_grain(NurbsCurve(degree=1, knots=np.arange(-1, 6), points=corners, weights=np.ones(5)), 1000.0)


def floor(slope: float = 0.0, mu: float = 0.5) -> Wall:
    return Wall(name="floor", point=(0.0, 0.0), normal=(-math.sin(slope), math.cos(slope)), law=replace(RIGID, mu=mu))


def grains(kinds: list[UniformGrain], x: Any, walls: tuple[Wall, ...], law: ContactLaw = RIGID, **state: Any) -> Scene:
    """Body k of the kind k, or of the only kind."""
    each = kinds if len(kinds) > 1 else kinds * len(x)
    given = {name: [getattr(kind, name) for kind in each] for name in ("radius", "mass", "inertia")}
    number = range(len(x)) if len(kinds) > 1 else [0] * len(x)
    disks = Disks(x=x, outline=list(number), **given, **state)
    return Scene(disks=disks, outlines=tuple(k.outline for k in kinds), disk_disk=law, walls=walls, gravity=(0.0, -G))


def steps(scene: Scene, n: int, dt: float, watch: Any = (), **more: Any) -> History:
    given = {"theta": 1.0, "sliding": "coulomb", **more}
    return simulate(scene, Numerics(dt=dt, n_steps=n, **given), watch, method="cd")


def difference(one: History, two: History) -> dict[str, float]:
    """Largest differences over the largest value of each field; rotations over the motion where they are round-off."""
    fields = {name: (getattr(one, name), getattr(two, name)) for name in ("x", "v", "gap", "fn", "fs", "wall_force")}
    fields |= {name: (one.energy[name], two.energy[name]) for name in ("kinetic", "elastic", "wall_work")}
    # Forces of rigid contacts are means over a step: there are none at time 0.
    found = {name: float(np.abs(a - b)[1:].max() / (np.abs(b[1:]).max() or 1.0)) for name, (a, b) in fields.items()}
    spin = max(float(np.abs(two.omega).max()), float(np.abs(two.v).max()))
    return found | {"omega": float(np.abs(one.omega - two.omega).max()) / spin}


@pytest.mark.parametrize(("share", "lever_arm"), [(1.0, "radius"), (0.5, "overlap")])
def test_disks_as_outlines(share: float, lever_arm: str) -> None:
    """The nine disks, compressed, then sheared by walls that turn, with friction and damping."""
    scene = box(mu=0.3, wall_mu=0.3, xi=3.0, turn=0.05, rest=0.3)
    law = replace(scene.disk_disk, lever_arm=lever_arm)
    walls = tuple(replace(wall, law=replace(wall.law, lever_arm=lever_arm)) for wall in scene.walls)
    scene = scene.replace(disk_disk=law, walls=walls)
    found = difference(run(outlined(scene, share)), run(scene))
    assert {name: value for name, value in found.items() if not value <= CLOSE} == {}


def test_the_comparison_sees_other_arms() -> None:
    """Planted: the other lever arm."""
    scene = box(mu=0.3, wall_mu=0.3, xi=3.0, turn=0.05, rest=0.3)
    other = scene.replace(disk_disk=replace(scene.disk_disk, lever_arm="overlap"))
    assert max(difference(run(outlined(other)), run(scene)).values()) > 1e3 * CLOSE


@pytest.mark.parametrize("impact", ["theta", "newton"])
def test_rigid_disks_as_outlines(impact: str) -> None:
    """A pile of six falls, rolls and comes to rest between walls."""
    law = replace(RIGID, mu=0.4, restitution=0.3 if impact == "newton" else 0.0)
    walls = tuple(
        Wall(name=name, point=point, normal=normal, law=law)
        for name, point, normal in (("floor", (0, 0), (0, 1)), ("left", (0, 0), (1, 0)), ("right", (3.3, 0), (-1, 0)))
    )
    x = [[0.6, 0.7], [1.7, 0.65], [2.75, 0.8], [1.1, 1.75], [2.3, 1.8], [1.6, 2.9]]
    scene = Scene(disks=Disks(x=x, radius=0.5, mass=800.0), disk_disk=law, walls=walls, gravity=(0.0, -G))
    how: dict[str, Any] = {"impact": impact, "sliding": "associated"}
    plain, other = (steps(each, 300, 2e-3, [(0, 1), (0, 6)], **how) for each in (scene, outlined(scene)))
    found = difference(other, plain)
    assert {name: value for name, value in found.items() if not value <= CLOSE} == {}


def test_blocks_at_rest() -> None:
    """Three blocks on each other, offset: they stay where they are, and bear what lies on them, to round-off."""
    kind = block(1.0, 1.0)
    scene = grains([kind], [[0.0, 0.5], [0.2, 1.5], [0.1, 2.5]], (floor(),))
    history = steps(scene, 100, 1e-3, [(0, 1), (1, 2), (0, 3)])
    weight = kind.mass * G
    assert history.x == pytest.approx(np.broadcast_to(history.x[0], history.x.shape), abs=1e-14)
    assert np.abs(history.angle).max() <= 1e-14
    assert history.fn[-1] == pytest.approx(np.array([2.0, 1.0, 3.0]) * weight, rel=1e-10)
    assert np.abs(history.gap).max() <= 1e-14


@pytest.mark.parametrize(("slope", "moves"), [(0.45, False), (0.5, True)])
def test_a_block_slides_beyond_the_angle_of_friction(slope: float, moves: bool) -> None:
    """tan 0.45 < 0.5 < tan 0.5. After n implicit steps of a constant acceleration a the way is ``a dt^2 n (n + 1)/2``."""
    s, c = math.sin(slope), math.cos(slope)
    scene = grains([block(1.0, 0.5)], [[-0.25 * s, 0.25 * c]], (floor(slope),), angle=[slope])
    history = steps(scene, 150, 1e-3)
    way = float(np.hypot(*(history.x[-1, 0] - history.x[0, 0])))
    expected = G * (s - 0.5 * c) * 1e-6 * 150 * 151 / 2 if moves else 0.0
    assert way == pytest.approx(expected, abs=1e-13)
    assert abs(history.angle[-1, 0]) <= 1e-13


@pytest.mark.parametrize(("ratio", "topples"), [(0.98, False), (1.02, True)])
def test_a_tall_block_topples_over_its_edge(ratio: float, topples: bool) -> None:
    """Width over height is the tangent of the slope at which the weight points through the edge."""
    slope = math.atan(ratio * 0.4)
    s, c = math.sin(slope), math.cos(slope)
    scene = grains([block(0.4, 1.0)], [[-0.5 * s, 0.5 * c]], (floor(slope, 2.0),), angle=[slope])
    turned = float(steps(scene, 300, 1e-3).angle[-1, 0])
    # Just beyond the edge it begins with the angular acceleration of the weight's arm 0.02 * 0.2 m about the edge.
    assert abs(turned) <= 1e-12 if not topples else turned > 1e-3


def test_an_ellipse_rocks_at_its_frequency() -> None:
    """Rolling without slip about the stable rest: ``omega^2 = g (rho - b)/(I/m + b^2)``, rho = a^2/b; the step's error is of order 1."""
    a, b, start = 1.0, 0.6, 0.005
    kind = uniform_grain(ellipse(a, b), 1000.0)
    quarter = 0.5 * math.pi / math.sqrt(G * (a * a / b - b) / (kind.inertia / kind.mass + b * b))
    height = math.hypot(a * math.sin(start), b * math.cos(start))
    errors = []
    for dt in (4e-3, 2e-3, 1e-3):
        scene = grains([kind], [[0.0, height]], (floor(0.0, 5.0),), angle=[start])
        angle = start + steps(scene, int(0.5 / dt), dt).angle[:, 0]
        k = int(np.argmax(angle < 0.0))
        errors.append((k - 1 + angle[k - 1] / (angle[k - 1] - angle[k])) * dt - quarter)
    assert (errors[0] - errors[1]) / (errors[1] - errors[2]) == pytest.approx(2.0, abs=0.2)
    # Extrapolated: what is left is of the second order in the step and in the amplitude.
    assert 2.0 * errors[2] - errors[1] == pytest.approx(0.0, abs=2e-4 * quarter)


def peanut() -> UniformGrain:
    angle = 2.0 * np.pi * np.arange(400) / 400
    radius = 1.0 + 0.3 * np.cos(2.0 * angle)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return uniform_grain(fitted(points, 20).curve, 1000.0)


def test_a_dented_grain_comes_to_rest_on_both_lobes() -> None:
    """It falls askew, rocks and stays: level, with all its weight on the floor and no energy left but that of its place."""
    kind = peanut()
    scene = grains([kind], [[0.0, 1.5]], (floor(),), angle=[0.3])
    history = steps(scene, 1600, 2e-3, [(0, 1)])
    assert history.angle[-1, 0] + 0.3 == pytest.approx(0.0, abs=1e-9)
    assert history.fn[-1] == pytest.approx([kind.mass * G], rel=1e-8)
    assert history.energy["kinetic"][-1] <= 1e-16 * kind.mass * G
    # Overlap is what a turn of the body by a in a step leaves, rho a^2/2: below 1e-5 of a radius at this speed.
    assert history.gap.min() >= -2e-5


def ellipses(speed: float) -> Scene:
    kind = uniform_grain(ellipse(1.0, 0.6), 1000.0)
    law = ContactLaw(kn=1e7, ks=8e6, mu=0.3)
    scene = grains([kind], [[0.0, 0.0], [1.6, 0.28]], (), law, angle=[0.4, 1.3], v=[[speed, 0.0], [0.0, 0.0]])
    return scene.replace(gravity=(0.0, 0.0))


def test_an_elastic_collision_tends_to_that_of_the_dem() -> None:
    """Ellipses, friction, spin after an oblique impact: first order in the step, as on disks."""
    scene, duration = ellipses(0.5), 0.2
    exact = simulate(scene, Numerics(dt=duration, n_steps=1, contact_dt=1e-5), method="dem")
    errors = []
    for n in (200, 400):
        found = steps(scene, n, duration / n)
        errors.append(
            max(
                float(np.abs(found.v[-1] - exact.v[-1]).max()) / 0.5,
                float(np.abs(found.omega[-1] - exact.omega[-1]).max()) / float(np.abs(exact.omega[-1]).max()),
            )
        )
    assert np.abs(exact.omega[-1]).min() > 0.03
    assert 1.6 < errors[0] / errors[1] < 2.6
    assert abs(2.0 * errors[1] - errors[0]) < 0.02  # extrapolated to no step: what is left is of second order


def test_momentum_of_a_free_pair() -> None:
    """Linear momentum to round-off; angular momentum to the first order in the step, as forces act where the bodies were at its start."""
    scene = ellipses(0.5)
    scene = scene.replace(disk_disk=replace(scene.disk_disk, lever_arm="overlap"))  # both arms end at one point
    mass, inertia = scene.disks.mass[:, None], scene.disks.inertia
    lost = []
    for n in (200, 400):
        history = steps(scene, n, 0.2 / n)
        x, p = history.x, mass * history.v
        linear = p.sum(axis=1)
        turning = (x[..., 0] * p[..., 1] - x[..., 1] * p[..., 0] + inertia * history.omega).sum(axis=1)
        assert linear == pytest.approx(np.broadcast_to(linear[0], linear.shape), abs=1e-12 * float(linear[0, 0]))
        lost.append(float(np.abs(turning - turning[0]).max()))
    # Of the impulse times the way that the centres pass in a step, what does not cancel between approach and rebound.
    assert lost[0] < 1e-3 * float(linear[0, 0])
    assert lost[1] < 0.6 * lost[0]


def test_a_shear_spring_stays_with_its_contact() -> None:
    """An ellipse held in a motion along elastic ground: its contact carries ``ks`` times the way, although it lies elsewhere each step."""
    law = ContactLaw(kn=1e7, ks=5e6, mu=5.0)
    speed, time = 1e-4, 0.2
    ground = Wall(name="ground", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    kind = uniform_grain(ellipse(1.0, 0.6), 1000.0)
    depth = kind.mass * G / law.kn
    disks = Disks(
        x=[[0.0, 0.6 - depth]],
        v=[[speed, 0.0]],
        radius=kind.radius,
        mass=kind.mass,
        inertia=kind.inertia,
        outline=[0],
        held=True,
        rotating=False,
    )
    scene = Scene(disks=disks, outlines=(kind.outline,), disk_disk=law, walls=(ground,), gravity=(0.0, -G))
    history = steps(scene, 200, time / 200, [(0, 1)])
    assert history.fs[-1] == pytest.approx([-law.ks * speed * time], rel=1e-9)
    assert history.fn[-1] == pytest.approx([law.kn * depth], rel=1e-9)


def test_quasi_static_squeeze() -> None:
    """An elastic ellipse between two walls that approach by 2 s: each spring gives way by s."""
    law = ContactLaw(kn=1e7, mu=0.0, ks=0.0)
    kind, rate = uniform_grain(ellipse(1.0, 0.6), 1000.0), 1e-4
    walls = tuple(
        Wall(
            name=name,
            point=(0.0, -sign * 0.6),
            normal=(0.0, sign),
            law=law,
            motion=(WallSegment(duration=1.0, velocity=(0.0, sign * rate)),),
        )
        for name, sign in (("low", 1.0), ("high", -1.0))
    )
    scene = grains([kind], [[0.0, 0.0]], walls, law).replace(gravity=(0.0, 0.0))
    history = steps(scene, 10, 0.1, [(0, 1), (0, 2)], regime="quasi-static", sliding="associated")
    assert history.fn[-1] == pytest.approx([law.kn * rate] * 2, rel=1e-6)


def test_rigid_grains_must_not_overlap() -> None:
    scene = grains([block(1.0, 1.0)], [[0.0, 0.5], [0.2, 1.499]], (floor(),))
    with pytest.raises(InvalidSceneError, match=r"overlap by 0\.001 m and their contact is rigid"):
        steps(scene, 1, 1e-3)


def test_moment_of_the_ellipse() -> None:
    """The mass and inertia that the frequency rests on, by an integral of the ellipse's equation."""
    kind = uniform_grain(ellipse(1.0, 0.6), 1000.0)
    moment = 4.0 * quad(lambda x: x**2 * 0.6 * math.sqrt(1 - x**2) + (0.6 * math.sqrt(1 - x**2)) ** 3 / 3.0, 0, 1)[0]
    assert kind.inertia == pytest.approx(1000.0 * moment, rel=1e-9)
