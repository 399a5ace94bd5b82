"""Contact dynamics by materials, under forces on single disks, and with dashpots."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_nine_disks import DT, box
from test_outlines import outlined

from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.session import CdSession
from ninedisk.core.history import History
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene, Wall, WallSegment
from ninedisk.core.scene.loads import BodyForce
from ninedisk.references.analytic.impact.spring_dashpot import restitution_of_beta
from ninedisk.references.exact_steps.normal_contact import Plane, normal_contact_theta

SOFT = ContactLaw(kn=1e4)


def history_of(scene: Scene, numerics: Numerics, watch: Any = (), *, singly: bool = False) -> History:
    """Run with batches of steps, or each step by itself."""
    session = CdSession(scene, numerics, watch)
    assert session._batches is not None
    if singly:
        session._batches = None
    return session.run()


def same(one: History, other: History) -> bool:
    fields = [(getattr(one, name), getattr(other, name)) for name in ("x", "v", "omega", "fn", "fs", "wall_force")]
    fields += [(one.energy[name], other.energy[name]) for name in one.energy]
    return all(np.array_equal(a, b, equal_nan=True) for a, b in fields)


def test_every_pair_has_the_row_of_its_law() -> None:
    """Random tables of some of the pairs of four materials, bodies without a material included, against `Scene.law`."""
    rng = np.random.default_rng(1)
    names = ("", "a", "b", "c")
    for _ in range(40):
        law = iter(ContactLaw(kn=float(k)) for k in range(1, 100))
        disks = Disks(
            x=[[2.0 * i, 0.0] for i in range(8)], radius=1.0, mass=1.0, material=rng.choice(names, 8).tolist()
        )
        walls = tuple(
            Wall(name=str(k), point=(0.0, -1.0 - k), normal=(0.0, 1.0), law=next(law), material=str(rng.choice(names)))
            for k in range(3)
        )
        there = sorted({*disks.material, *(wall.material for wall in walls)})
        laws = {(a, b): next(law) for a in there for b in there if a <= b and rng.random() < 0.5}
        scene = Scene(disks=disks, disk_disk=next(law), walls=walls, laws=laws)
        table = LawTable(scene, Numerics(dt=1.0, n_steps=1), "auto")
        pairs = np.array([(i, j) for i in range(8) for j in range(i + 1, 11)])
        expected = [scene.law((i, j)).kn for i, j in pairs.tolist()]
        assert table.kn[table.rows(pairs)].tolist() == expected


@pytest.mark.parametrize("outlines", [False, True])
def test_laws_by_materials_are_those_of_the_bodies(outlines: bool) -> None:
    """Nine disks whose laws are named by materials, beside laws nobody uses, move as those that have their own, to the bit."""
    own = box(mu=0.3, wall_mu=0.2, xi=1.0)
    own = outlined(own, 0.5) if outlines else own
    other = ContactLaw(kn=1.0, ks=0.5, mu=0.9)
    named = replace(own, disks=replace(own.disks, material="steel"), disk_disk=other)
    named = named.replace(
        walls=tuple(replace(wall, law=other, material=wall.name) for wall in own.walls),
        laws={
            **{(wall.name, "steel"): wall.law for wall in own.walls},
            ("steel", "steel"): own.disk_disk,
            (own.walls[0].name, own.walls[1].name): other,
        },
    )
    numerics = Numerics(dt=DT, n_steps=80, sliding="coulomb")
    watch = [(0, 1), (0, 9)]
    one, two = (CdSession(scene, numerics, watch).run() for scene in (own, named))
    assert same(one, two)
    assert np.abs(one.fn[-1]).max() > 0.0


@pytest.mark.parametrize("singly", [False, True])
def test_disks_of_three_materials_slide_as_if_each_were_alone(singly: bool) -> None:
    mu, belt = {"ice": 0.0, "wood": 0.1, "rubber": 0.7}, WallSegment(velocity=(1.0, 0.0))
    rigid = ContactLaw(kn=1e6, ks=1e6, restitution=0.0, regularised=True)
    floor = Wall(name="belt", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid, material="belt", motion=(belt,))
    disks = Disks(x=[[4.0 * k, 1.0] for k in range(3)], radius=1.0, mass=2.0, rotating=False, material=[*mu])
    laws = {("belt", name): replace(rigid, mu=value) for name, value in mu.items() if value}
    scene = Scene(disks=disks, disk_disk=rigid, walls=(floor,), laws=laws, gravity=(0.0, -10.0))
    history = history_of(scene, Numerics(dt=0.01, n_steps=60, sliding="coulomb"), singly=singly)
    expected = np.minimum(np.outer(history.t, 10.0 * np.array([*mu.values()])), 1.0)
    assert np.abs(history.v[:, :, 0] - expected).max() <= 1e-11


@pytest.mark.parametrize("singly", [False, True])
@pytest.mark.parametrize("theta", [0.5, 0.8])
def test_impulses_of_forces_are_exact_wherever_they_begin(theta: float, singly: bool) -> None:
    rng = np.random.default_rng(2)
    times = np.sort(rng.uniform(0.0, 0.6, (9, 2)), axis=1)
    times[0], times[1] = (0.1, 0.3), (0.2034, 0.2051)
    given = rng.normal(0.0, 3.0, (9, 3))
    forces = [
        BodyForce(disk=int(rng.integers(2)), force=tuple(f[:2]), torque=f[2], begin=begin, end=end)
        for f, (begin, end) in zip(given, times, strict=True)
    ]
    forces.append(BodyForce(disk=1, force=(1.0, 0.0), begin=0.25))
    disks = Disks(x=[[0.0, 0.0], [9.0, 0.0]], radius=1.0, mass=[2.0, 0.5])
    scene = Scene(disks=disks, disk_disk=SOFT, forces=forces, gravity=(0.0, -1.0))
    history = history_of(scene, Numerics(dt=0.01, n_steps=50, theta=theta), singly=singly)
    impulse = np.zeros((51, 2, 3))
    impulse[:, :, 1] = -np.outer(history.t, disks.mass)
    for force in forces:
        lasted = np.clip(history.t, force.begin, force.end) - force.begin
        impulse[:, force.disk] += np.outer(lasted, (*force.force, force.torque))
    assert np.abs(impulse[:, :, :2] - history.v * disks.mass[:, None]).max() <= 1e-14
    assert np.abs(impulse[:, :, 2] - history.omega * disks.inertia).max() <= 1e-14


def test_a_static_step_has_the_load_of_its_end() -> None:
    """A force from the end of step 2 to that of step 6: static forces are those of steps 3 to 6, whatever the rounding of times."""
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=SOFT)
    for dt in (0.1, 0.07, 1.0 / 3.0):
        force = BodyForce(disk=0, force=(0.0, -30.0), begin=2 * dt, end=6 * dt)
        scene = Scene(
            disks=Disks(x=[[0.0, 1.0]], radius=1.0, mass=2.0, rotating=False),
            disk_disk=SOFT, walls=(floor,), gravity=(0.0, -10.0), forces=[force],
        )  # fmt: skip
        numerics = Numerics(dt=dt, n_steps=8, regime="quasi-static")
        history = CdSession(scene, numerics, [(0, 1)]).run()
        assert history.fn[1:, 0] == pytest.approx([20.0] * 2 + [50.0] * 4 + [20.0] * 2, rel=1e-9)


def struck(beta: float, theta: float, dt: float, seed: int) -> tuple[Scene, Numerics, list[Plane], float]:
    """A disk between a floor that comes and an own, softer ceiling at rest, and the planes of the reference."""
    rng = np.random.default_rng(seed)
    kn, mass = 1e4 * rng.uniform(0.5, 2.0, 2), float(rng.uniform(0.5, 2.0))
    steps, speed, y = 200, 0.3, float(rng.uniform(-1e-3, 2e-3))
    laws = [ContactLaw(kn=float(each), beta=beta) for each in kn]
    walls = (
        Wall(name="floor", point=(0.0, -1.0), normal=(0.0, 1.0), law=laws[0], motion=(WallSegment(velocity=(0.0, speed)),)),
        Wall(name="ceiling", point=(0.0, 1.01), normal=(0.0, -1.0), law=laws[1]),
    )  # fmt: skip
    scene = Scene(
        disks=Disks(x=[[0.0, y]], v=[[0.0, -0.1]], radius=1.0, mass=mass),
        disk_disk=SOFT,
        walls=walls,
        gravity=(0.0, -2.0),
    )
    t = np.arange(steps + 1) * dt
    planes = [
        Plane(1, speed * t, np.full(steps + 1, speed), kn[0], beta),
        Plane(-1, np.full(steps + 1, 0.01), np.zeros(steps + 1), kn[1], beta),
    ]
    return scene, Numerics(dt=dt, n_steps=steps, theta=theta), planes, y


@pytest.mark.long
@pytest.mark.parametrize(
    ("solver", "singly"), [("gauss-seidel", False), ("gauss-seidel", True), ("interior-point", True)]
)
@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_dashpots_take_the_exact_steps_of_the_scheme(theta: float, solver: str, singly: bool) -> None:
    """Both walls, open, bearing alone and together, at the begin with an overlap or none; dashpots that cut the force off at 0."""
    parted = opened = 0
    for seed, beta in enumerate((0.05, 0.3, 0.8, 1.5)):
        scene, numerics, planes, y = struck(beta, theta, 1e-3, seed)
        session = CdSession(scene, numerics.replace(solver=solver), [(0, 1), (0, 2)])
        if singly:
            session._batches = None
        history = session.run()
        mass = float(scene.disks.mass[0])
        steps = normal_contact_theta(planes, mass=mass, g=2.0, y=y, vy=-0.1, dt=1e-3, n_steps=200, theta=theta)
        assert np.abs(history.x[:, 0, 1] - steps.y).max() <= 1e-13
        assert np.abs(history.v[:, 0, 1] - steps.vy).max() <= 1e-11
        assert np.abs(history.fn - steps.fn).max() <= 1e-10 * steps.fn.max()
        kn = np.array([plane.kn for plane in planes])
        elastic = 0.5 * (kn * np.maximum(steps.overlap, 0.0) ** 2).sum(axis=1)
        assert np.abs(history.energy["elastic_normal"] - elastic).max() <= 1e-10 * elastic.max()
        parted += int(((steps.fn == 0.0) & (steps.overlap > 0.0)).sum())
        assert (steps.fn > 0.0).all(axis=1).any()
        opened += int(((steps.fn[:-1] > 0.0) & (steps.fn[1:] == 0.0)).sum())
    assert parted > 0
    assert opened > 0


@pytest.mark.parametrize("held", [False, True])
def test_a_dashpot_sees_the_reduced_mass(held: bool) -> None:
    """Two unequal disks, one of them perhaps held in its course: their distance is that of a disk with the reduced mass from a plane."""
    disks = Disks(
        x=[[0.0, 0.0], [2.0003, 0.0]],
        v=[[1.0, 0.0], [0.0, 0.0]],
        radius=1.0,
        mass=[2.0, 0.7],
        held=[[held] * 2, [False] * 2],
    )
    reduced = 0.7 if held else 2.0 * 0.7 / 2.7
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e4, beta=0.4))
    history = history_of(scene, Numerics(dt=1e-4, n_steps=400, theta=0.6), [(0, 1)])
    rest = np.zeros(401)
    steps = normal_contact_theta(
        [Plane(-1, rest, rest, 1e4, 0.4)], mass=reduced, g=0.0, y=-0.0003, vy=1.0, dt=1e-4, n_steps=400, theta=0.6
    )
    assert np.abs(history.gap[:, 0] + steps.y).max() <= 1e-13
    assert np.abs(history.fn[:, 0] - steps.fn[:, 0]).max() <= 1e-10 * steps.fn.max()
    assert steps.fn[-1, 0] == 0.0


def test_the_static_limit_has_no_rates() -> None:
    floor = Wall(
        name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=ContactLaw(kn=1e4, beta=0.9),
        motion=(WallSegment(velocity=(0.0, 1e-3)),),
    )  # fmt: skip
    held = Disks(x=[[0.0, 0.999]], radius=1.0, mass=1.0, held=True)
    numerics = Numerics(dt=1.0, n_steps=3, regime="quasi-static")
    history = CdSession(Scene(disks=held, disk_disk=SOFT, walls=(floor,)), numerics, [(0, 1)]).run()
    assert history.fn[:, 0] == pytest.approx([10.0, 20.0, 30.0, 40.0], rel=1e-10)
    assert history.energy["elastic_normal"] == pytest.approx(0.5 * history.fn[:, 0] ** 2 / 1e4, rel=1e-10)


def test_restitution_of_a_dashpot_to_first_order() -> None:
    errors = []
    for dt in (8e-5, 2e-5):
        disks = Disks(x=[[0.0, 0.0], [2.0123, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=1.0, mass=[2.0, 0.7])
        scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e4, beta=0.25))
        v = history_of(scene, Numerics(dt=dt, n_steps=round(0.05 / dt), theta=0.5)).v[-1, :, 0]
        errors.append(v[1] - v[0] - restitution_of_beta(0.25))
    assert abs(errors[0]) < 0.02
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.1)
