"""Spheres in engines with springs: what they compute is a plain DEM with their own conventions, and the in-house engine's where they agree.

Runs of real engines; a row is skipped only where its engine is absent.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from ninedisk_tests_comparison import variant
from ninedisk_tests_plain_spheres import HERTZ, LINEAR, RUN, pile, plain_dem

from ninedisk.core.history import History
from ninedisk.core.law import Rolling, SphereLaw, damping_ratio
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import PlaneSegment, PlaneWall, Spheres, SphereScene
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.engines.esys_particle.adapter import EsysParticle
from ninedisk.harness.engines.kratos.adapter import Kratos
from ninedisk.harness.engines.lammps.adapter import Lammps
from ninedisk.harness.engines.liggghts.adapter import Liggghts
from ninedisk.harness.engines.spring import SpringEngine
from ninedisk.harness.engines.yade.adapter import Yade
from ninedisk.references.analytic.contact.turned_shear import kept_shear
from ninedisk.references.analytic.impact.jkr import neck, stable_contact

OVERLAP = {"torque": "overlap", "slip": "overlap", "wall": "overlap"}
GRANULAR = {"torque": "overlap", "slip": "radius", "wall": "radius"}
ROUND_OFF = 1e-11
"""Of the largest value: forces are stiffness times differences of positions, 1e-16 over overlaps of 1e-5 of them, over 150 steps of
moving spheres. A settled box gathers less, 7e-13 over 1,000 steps; there another shear turn, arm or dashpot leaves 3e-6 or more."""


def run(engine: type[SpringEngine], scene: SphereScene, numerics: Numerics, watch: Any = ()) -> History:
    if not engine().info().installed:
        pytest.skip(f"{engine().info().name} is not installed")
    return engine().run(scene, numerics, watch).history


def off(one: np.ndarray, two: np.ndarray) -> float:
    """Largest difference, relative to the largest value."""
    return float(np.abs(one - two).max() / max(np.abs(two).max(), 1e-300))


@pytest.mark.parametrize(
    ("engine", "law", "arms", "turn", "pulls", "moving"),
    [
        (Lammps, LINEAR, GRANULAR, "project", True, True),
        (Lammps, replace(HERTZ, unloading="none"), GRANULAR, "project", True, False),
        (Lammps, replace(HERTZ, unloading="force"), GRANULAR, "project", True, True),
        (Lammps, replace(HERTZ, unloading="rescale"), GRANULAR, "project", True, False),
        (Yade, LINEAR, OVERLAP, "rotate", False, False),
        (Yade, replace(HERTZ, unloading="force"), OVERLAP, "rotate", False, True),
        (Liggghts, replace(HERTZ, unloading="none"), OVERLAP, "shrink", True, False),
    ],
)
def test_an_engine_is_a_plain_dem_with_its_own_conventions(
    engine: type[SpringEngine], law: SphereLaw, arms: dict[str, str], turn: str, pulls: bool, moving: bool
) -> None:
    """Dashpots, caps, arms, turned shear, walls at an angle and turning ones: each row is off by 1e-7 or more with another's."""
    scene = pile(law, moving=moving)
    found = run(engine, scene, RUN)
    x, v, omega = (
        np.array(rows) for rows in zip(*plain_dem(scene, RUN, arms=arms, turn=turn, pulls=pulls), strict=True)
    )
    assert off(found.x, x) <= ROUND_OFF
    assert off(found.v, v) <= ROUND_OFF
    assert off(found.omega, omega) <= ROUND_OFF
    assert np.abs(found.omega[-1] - found.omega[0]).max() > 1.0  # friction did something


def own(law: SphereLaw, scene: SphereScene, at_walls: str) -> SphereScene:
    """The scene with this lever arm at its walls."""
    return scene.replace(
        walls=tuple(replace(w, law=replace(law, lever_arm=at_walls, mu=w.law.mu)) for w in scene.walls)
    )


def assert_core(engine: type[SpringEngine], scene: SphereScene, tolerance: float, numerics: Numerics = RUN) -> None:
    """The in-house engine's run, force by force."""
    n = len(scene.spheres)
    core = simulate(scene, numerics, watch := [(i, j) for i in range(n) for j in range(i + 1, scene.n_bodies)])
    found = run(engine, scene, numerics, watch)
    assert (core.fn > 0.0).any()
    least = {"fs": 1e-15 * float(core.fn.max())}  # round-off of a sphere that only turns about the normal
    for name in ("x", "v", "omega", "angle", "fn", "fs", "wall_force", "wall_point", "wall_angle"):
        if np.abs(getattr(core, name)).max() > least.get(name, 0.0):
            assert off(getattr(found, name), getattr(core, name)) <= tolerance, name
    for name in ("kinetic", "gravity"):
        assert off(found.energy[name], core.energy[name]) <= tolerance, name


SAME = {"lever_arm": "torque-overlap", "slip_at": "end", "beta": 0.0}
"""What LAMMPS has and the in-house engine too; with a dashpot friction is another where it pulls."""


@pytest.mark.parametrize(
    "law", [replace(LINEAR, **SAME), *(replace(HERTZ, unloading=rule, **SAME) for rule in ("none", "force", "rescale"))]
)
def test_lammps_is_the_core_step_by_step(law: SphereLaw) -> None:
    assert Lammps().supports(own(law, pile(law), "radius"), RUN).level is SupportLevel.EXACT
    assert_core(Lammps, own(law, pile(law), "radius"), ROUND_OFF)


def test_dashpots_of_lammps_are_those_of_the_core() -> None:
    law = replace(HERTZ, mu=0.0, beta=damping_ratio(0.4), slip_at="end")
    scene = pile(law)
    assert_core(Lammps, scene.replace(walls=tuple(replace(w, law=law) for w in scene.walls)), ROUND_OFF)


def smooth_walls(scene: SphereScene, law: SphereLaw) -> SphereScene:
    return scene.replace(walls=tuple(replace(w, law=replace(law, mu=0.0, beta=0.0)) for w in scene.walls))


def turning_over(scene: SphereScene) -> SphereScene:
    """The floor moves, and turns about an axis that is neither its normal nor across it."""
    motion = PlaneSegment(velocity=(0.1, 0.0, 0.05), angular_velocity=(2.0, -3.0, 0.5), pivot=(0.01, 0.02, 0.0))
    return scene.replace(walls=(replace(scene.walls[0], motion=(motion,)), *scene.walls[1:]))


@pytest.mark.parametrize("law", [LINEAR, HERTZ])
def test_kratos_without_friction_is_the_core_step_by_step(law: SphereLaw) -> None:
    """Moduli of materials that give each contact its E*; two walls at once on a sphere, one of which moves and turns over."""
    smooth = replace(law, mu=0.0, beta=0.0)
    scene = turning_over(smooth_walls(pile(smooth), smooth))
    assert Kratos().supports(scene, RUN).level is SupportLevel.EXACT
    assert_core(Kratos, scene, ROUND_OFF)


def test_esys_particle_without_friction_is_the_core_step_by_step() -> None:
    """Planes' stiffnesses by radius, on a plane that also turns over; three contacts and more on a sphere."""
    smooth = replace(LINEAR, mu=0.0, beta=0.0)
    scene = turning_over(smooth_walls(pile(smooth), smooth))
    assert EsysParticle().supports(scene, RUN).level is SupportLevel.EXACT
    assert_core(EsysParticle, scene, ROUND_OFF)


def test_dashpots_of_esys_particle_are_those_of_the_law() -> None:
    """Beside Hertz' law, with 3.1415926 for pi: a damping ratio off by 1.7e-8."""
    law = replace(HERTZ, mu=0.0, beta=damping_ratio(0.4))
    scene = pile(law).replace(walls=())
    assert EsysParticle().supports(scene, RUN).level is SupportLevel.EXACT
    watch = [(i, j) for i in range(8) for j in range(i + 1, 8)]
    core, found = simulate(scene, RUN, watch), run(EsysParticle, scene, RUN, watch)
    assert (core.fn > 0.0).any()
    for name in ("x", "v", "omega", "angle", "fn"):
        assert off(getattr(found, name), getattr(core, name)) <= 1e-7, name


def test_esys_particle_with_friction_is_a_plain_dem_that_keeps_directions() -> None:
    """Two materials, a fixed sphere and one that does not turn; another rule of turning is off by 1e-5 or more."""
    law = replace(LINEAR, beta=0.0, lever_arm="overlap", slip_at="end")
    held, rotating, still = np.zeros((8, 3), dtype=bool), np.ones(8, dtype=bool), [2, 5]
    held[2], rotating[still] = True, False
    scene = smooth_walls(pile(law, material=["a", "b"] * 4, held=held, rotating=rotating), law)
    v, omega = np.array(scene.spheres.v), np.array(scene.spheres.omega)
    v[2], omega[still] = 0.0, 0.0
    spheres = replace(
        scene.spheres, v=v, omega=omega, radius=np.full(8, 0.0103), inertia=0.4 * scene.spheres.mass * 0.0103**2
    )
    scene = scene.replace(
        spheres=spheres, laws={("a", "b"): replace(law, mu=0.1), ("b", "b"): replace(law, kn=1.2e4, ks=8e3, mu=0.05)}
    )
    told = EsysParticle().supports(scene, RUN)
    assert (told.level, told.missing) == (SupportLevel.APPROXIMATE, ())
    watch = [(i, j) for i in range(8) for j in range(i + 1, scene.n_bodies)]
    found = run(EsysParticle, scene, RUN, watch)
    for turn, same in (("keep", True), ("project", False)):
        plain = zip(*plain_dem(scene, RUN, arms=OVERLAP, turn=turn), strict=True)
        for name, rows in zip(("x", "v", "omega"), plain, strict=True):
            assert (off(getattr(found, name), np.array(rows)) <= ROUND_OFF) is same or name == "x", (name, turn)
    assert np.abs(found.omega[-1] - found.omega[0]).max() > 1.0  # friction did something
    pairs = [(c, i, j) for c, (i, j) in enumerate(watch) if j < 8]
    columns, ones, others = (list(each) for each in zip(*pairs, strict=True))
    apart, shear = found.x[:, others] - found.x[:, ones], found.fs[:, columns]
    assert shear.any()
    beside = np.einsum("scj,scj->sc", shear, apart / np.linalg.norm(apart, axis=2, keepdims=True))
    assert np.abs(beside).max() <= 1e-15 * np.abs(shear).max()


@pytest.mark.parametrize("kind", ["spun", "passed"])
def test_shear_of_esys_particle_keeps_its_direction(kind: str) -> None:
    """Its own truth, first order in the step: slip of half steps with the normal of the step's end."""
    setup = variant("spheres/turned", kind=kind)
    (one, two), spheres = setup.scene.bodies.x, setup.scene.spheres
    found = run(EsysParticle, setup.scene, setup.numerics, setup.watch)
    kept = kept_shear(apart=two - one, v=spheres.v[1] - spheres.v[0], roll=spheres.radius @ spheres.omega, t=found.t)
    assert off(found.fs[:, 0], setup.scene.sphere_sphere.ks * kept) <= 1e-3


def test_forces_that_esys_particle_does_not_report_are_not_observed() -> None:
    """Six spheres about a small one, 18 contacts in 15 directions of motion: the motion is the core's, normal forces are NaN. A sphere
    between two planes is distinguished by these."""
    law = SphereLaw(kn=1e4)
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    spheres = Spheres(x=np.concatenate([0.01 * corners, np.zeros((1, 3))]), radius=[*[0.0072] * 6, 0.003], mass=0.01)
    scene, numerics = SphereScene(spheres=spheres, sphere_sphere=law), Numerics(dt=1e-5, n_steps=30, contact_dt=1e-5)
    watch = [(0, 1), (0, 6)]
    core, found = simulate(scene, numerics, watch), run(EsysParticle, scene, numerics, watch)
    assert off(found.v, core.v) <= ROUND_OFF
    assert core.fn[0].min() > 0.0
    assert np.isnan(found.fn[0]).all()
    planes = [
        PlaneWall(name=name, point=(0, 0, z), normal=(0, 0, -z), law=law) for name, z in (("up", 9e-3), ("down", -8e-3))
    ]
    squeezed = SphereScene(spheres=Spheres(x=[(0, 0, 0)], radius=0.01, mass=0.01), sphere_sphere=law, walls=planes)
    assert_core(EsysParticle, squeezed, ROUND_OFF, numerics)


def test_planes_of_esys_particle_meet_spheres_that_did_not_move() -> None:
    """A plane comes from afar: it would look for spheres only where one of them has moved."""
    law = SphereLaw(kn=1e6)
    motion = (PlaneSegment(velocity=(0.0, 0.0, 10.0)),)
    floor = PlaneWall(name="floor", point=(0, 0, -0.1), normal=(0, 0, 1), law=law, motion=motion)
    scene = SphereScene(spheres=Spheres(x=[(0, 0, 0)], radius=0.01, mass=0.01), sphere_sphere=law, walls=(floor,))
    assert_core(EsysParticle, scene, ROUND_OFF, Numerics(dt=1e-5, n_steps=915, contact_dt=1e-5, sample_every=305))


@pytest.mark.parametrize(("count", "moves"), [(1, False), (1, True), (2, False)])
def test_friction_of_kratos_is_that_of_the_core(count: int, moves: bool) -> None:
    """On a stiff plane, where arms hardly differ, also on one that moves; between spheres; slip by rotation is that of a step's both ends,
    first order."""
    law = replace(LINEAR, beta=0.0, slip_at="end", lever_arm="overlap")
    places, spins = [(0, 0, 0.01), (0.003, 0.001, 0.0296)], [(30.0, 300.0, 0.0), (-100.0, 20.0, 0.0)]
    moving = [(0.1, 0.0, -0.01), (0.0, 0.0, 0.0)]
    spheres = Spheres(x=places[:count], radius=0.01, mass=0.01, v=moving[:count], omega=spins[:count])
    # Of two spheres it is out of reach.
    floor = PlaneWall(
        name="floor",
        point=(0, 0, 1e-8 if count == 1 else -1.0),
        normal=(0, 0, 1),
        law=replace(law, kn=1e8, mu=0.3),
        motion=(PlaneSegment(velocity=(-0.3, 0.5, 0.0)),) if moves else (),
    )
    scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,))
    assert_core(Kratos, scene, 1e-3, Numerics(dt=1e-6, n_steps=100, contact_dt=1e-6))


@pytest.mark.parametrize("law", [LINEAR, HERTZ])
def test_dashpots_of_kratos_are_those_of_the_law(law: SphereLaw) -> None:
    """Two smooth spheres that meet, until the dashpot would pull."""
    smooth = replace(law, mu=0.0, beta=0.2)
    spheres = Spheres(x=[(0, 0, 0), (0, 0, 0.0199999)], radius=0.01, mass=0.01, v=[(0, 0, 0.1), (0, 0, -0.1)])
    numerics = Numerics(dt=1e-6, n_steps=300, contact_dt=1e-6, damping_form="lagged")
    core, found = (
        each(SphereScene(spheres=spheres, sphere_sphere=smooth), numerics, [(0, 1)])
        for each in (simulate, lambda *asked: run(Kratos, *asked))
    )
    assert core.fn[-1, 0] > 0.0
    assert off(found.v, core.v) <= ROUND_OFF


@pytest.mark.parametrize("law", [LINEAR, HERTZ])
def test_dashpots_of_kratos_at_planes_are_those_of_the_law(law: SphereLaw) -> None:
    """A sphere between a plane at rest and one that comes, until a dashpot would pull; forces of both are distinguished."""
    smooth = replace(law, mu=0.0, beta=0.2)
    walls = (
        PlaneWall(name="floor", point=(0, 0, 0), normal=(0, 0, 1), law=smooth),
        PlaneWall(
            name="side",
            point=(0, 0, 0),
            normal=(1, 1, 0),
            law=replace(smooth, beta=0.1),
            motion=(PlaneSegment(velocity=(0.02, 0.03, 0)),),
        ),
    )
    spheres = Spheres(x=[(0.015, -0.000858, 0.00999999)], radius=0.01, mass=0.01, v=[(-0.05, -0.02, -0.1)])
    scene = SphereScene(spheres=spheres, sphere_sphere=smooth, walls=walls)
    assert Kratos().supports(scene, RUN).level is SupportLevel.APPROXIMATE
    assert_core(Kratos, scene, ROUND_OFF, Numerics(dt=1e-6, n_steps=300, contact_dt=1e-6, damping_form="lagged"))


def test_rolling_of_lammps_is_that_of_the_core() -> None:
    """LAMMPS turns the way and not the torque, which differs by the square of the turn in a step: (20 rad/s dt)^2 over 100 steps."""
    law = replace(LINEAR, rolling=Rolling(model="elastic-plastic", mu=0.1, kr=0.3), **SAME)
    assert_core(Lammps, own(law, pile(law, moving=False), "radius"), 1e-5)


def test_twisting_of_lammps_is_that_of_the_core_below_its_cap() -> None:
    law = replace(LINEAR, twisting=Rolling(model="elastic-plastic", mu=1.0, kr=0.2), **{**SAME, "lever_arm": "radius"})
    weight = Spheres(x=[(0, 0, 0.01)], radius=0.01, mass=0.01, v=[(0, 0, -0.01)], omega=[(0, 0, 1.0)])
    floor = PlaneWall(name="floor", point=(0, 0, 1e-5), normal=(0, 0, 1), law=law)
    assert_core(
        Lammps, SphereScene(spheres=weight, sphere_sphere=law, walls=(floor,), gravity=(0, 0, -9.81)), ROUND_OFF
    )


@pytest.mark.parametrize(("surface", "most"), [("dmt", 4.0), ("jkr", 3.0)])
def test_surface_energy_pulls_two_spheres_in_lammps_as_in_the_law(surface: str, most: float) -> None:
    """Slowly apart: 4 pi g R at most and to the gap 0 (Derjaguin), 3 pi g R and beyond it (Johnson)."""
    energy, radius = 0.05, 0.01
    law = SphereLaw(e_star=1e7, surface_energy=energy, surface=surface)  # type: ignore[arg-type]
    places = [(0, 0, 0), (0, 0, 2.0 * radius * (1.0 - 2e-4))]
    spheres = Spheres(x=places, radius=radius, mass=0.01, v=[(0, 0, 0), (0, 0, 0.04)], held=True)
    scene = SphereScene(spheres=spheres, sphere_sphere=law)
    found = run(Lammps, scene, Numerics(dt=1e-6, n_steps=400, contact_dt=1e-6), [(0, 1)])
    assert abs(found.fn.min() / (-most * np.pi * energy * 0.5 * radius) - 1.0) <= 1e-3  # forces are seen each 4e-8 m
    assert bool(found.gap[found.fn[:, 0] != 0.0].max() > 1e-7) is (surface == "jkr")
    if surface == "jkr":
        holds = found.fn[:, 0] != 0.0
        one: dict[str, float] = {"e_star": 1e7, "surface_energy": energy, "radius": 0.5 * radius}
        exact = stable_contact(-found.gap[holds, 0], **one)[1]
        assert np.abs(found.fn[holds, 0] - exact).max() <= 1e-13 * np.abs(exact).max()  # round-off
        # It releases at the largest pull, s^3 = 3, and not at the break, s = 1: -(s^4 - 4 s) instead of 3, seen each 4e-8 m.
        largest_pull = (4.0 * 3.0 ** (1.0 / 3.0) - 3.0 ** (4.0 / 3.0)) * -neck(**one).breaking_overlap / 3.0
        assert 0.0 <= largest_pull - found.gap[holds, 0].max() <= 4e-8


@pytest.mark.parametrize("surface", ["dmt", "jkr"])
@pytest.mark.parametrize(
    ("engine", "share", "arm", "tolerance"), [(Lammps, 2.0, "torque-overlap", ROUND_OFF), (Yade, 1.0, "overlap", 1e-4)]
)
def test_friction_of_spheres_that_pull_each_other_is_that_of_the_core(
    engine: type[SpringEngine], share: float, arm: Any, tolerance: float, surface: Any
) -> None:
    """Two spheres that slide and turn on each other; the other share of the pull-off changes spins by 2e-3. YADE turns the shear force
    by the normal's own turn alone: first order in the step."""
    law = SphereLaw(
        e_star=1e7,
        g_star=4e6,
        mu=0.05,
        lever_arm=arm,
        slip_at="end",
        surface_energy=0.05,
        surface=surface,
        friction_pull=share,
    )
    spheres = Spheres(
        x=[(0, 0, 0), (0.006, 0, 0.0079)], radius=[0.004, 0.006], mass=[0.001, 0.003], v=[(0.03, 0.05, 0.04), (0, 0, 0)],
        omega=[(3, 2, 1), (0, -4, 5)],
    )  # fmt: skip
    scene, numerics = SphereScene(spheres=spheres, sphere_sphere=law), Numerics(dt=1e-6, n_steps=400, contact_dt=1e-6)
    told = engine().supports(scene, numerics)
    if surface == "jkr" and engine is Yade:
        assert Capability.SURFACE_JKR in told.missing
        return
    assert told.level is SupportLevel.EXACT
    core, found = simulate(scene, numerics, [(0, 1)]), run(engine, scene, numerics, [(0, 1)])
    for name in ("x", "v", "omega", "fn", "fs"):
        assert off(getattr(found, name), getattr(core, name)) <= tolerance, name
    other = replace(scene, sphere_sphere=replace(law, friction_pull=3.0 - share))
    assert engine().supports(other, numerics).level is SupportLevel.APPROXIMATE
    assert off(found.omega, simulate(other, numerics).omega) > 1e-3


def test_materials_and_held_spheres() -> None:
    """Three laws by material, one sphere fixed, one held along x and unable to turn: LAMMPS beside the core."""
    one, two = (replace(LINEAR, kn=kn, **SAME) for kn in (3e4, 1.2e4))
    held, rotating = np.zeros((8, 3), dtype=bool), np.ones(8, dtype=bool)
    held[3, 0] = True
    rotating[3] = False
    scene = pile(one, moving=False, material=["a", "b"] * 4, held=held, rotating=rotating)
    scene = own(one, scene, "radius").replace(laws={("a", "b"): two, ("b", "b"): replace(two, mu=0.1)})
    assert_core(Lammps, scene, ROUND_OFF)


@pytest.mark.parametrize(
    ("engine", "change", "missing"),
    [
        (Yade, {"unloading": "none"}, Capability.UNLOADING_NONE),
        (Liggghts, {"unloading": "force"}, Capability.UNLOADING_FORCE),
        (Liggghts, {"unloading": "none", "g_star": 1e7}, Capability.HERTZ_MINDLIN),
        (Kratos, {"beta": 0.0}, Capability.SHEAR_SPRING),
        (Kratos, {"beta": 0.0}, Capability.UNLOADING_FORCE),
        (Kratos, {"mu": 0.0}, Capability.CONTACT_DAMPING),
        (EsysParticle, {"beta": 0.0}, Capability.SHEAR_SPRING),
        (EsysParticle, {"mu": 0.0}, Capability.CONTACT_DAMPING),
        (EsysParticle, {"mu": 0.0, "beta": 0.0}, Capability.HERTZ_MINDLIN),
        (Lammps, {"beta": 1.0}, Capability.CONTACT_DAMPING),
        (Lammps, {"surface_energy": 0.1}, Capability.CONTACT_DAMPING),
        (Lammps, {"twisting": Rolling(model="constant", mu=0.1)}, Capability.TWISTING_CONSTANT),
    ],
)
def test_what_an_engine_cannot_express_is_said(
    engine: type[SpringEngine], change: dict[str, Any], missing: Capability
) -> None:
    support = engine().supports(pile(replace(HERTZ, **change), moving=False), RUN)
    assert support.level is SupportLevel.NO
    assert missing in support.missing


@pytest.mark.parametrize(
    ("engine", "arms", "turn", "keeps"), [(Liggghts, OVERLAP, "shrink", True), (Lammps, GRANULAR, "project", False)]
)
def test_spheres_that_touch_again_begin_without_shear(
    engine: type[SpringEngine], arms: dict[str, str], turn: str, keeps: bool
) -> None:
    """A sphere bounces on another with a sideways velocity; LIGGGHTS goes on from the shear of the first contact."""
    law = replace(LINEAR, beta=0.0)
    spheres = Spheres(
        x=[(0, 0, 0), (0, 0, 0.02001)], radius=0.01, mass=[1.0, 0.01], v=[(0, 0, 0), (0.003, 0.001, -0.02)]
    )
    floor = PlaneWall(name="floor", point=(0, 0, -0.01), normal=(0, 0, 1), law=law)
    scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=(floor,), gravity=(0.0, 0.0, -9.81))
    numerics = Numerics(dt=1e-5, n_steps=1500, contact_dt=1e-5, sample_every=50, damping_form="lagged")
    found = run(engine, scene, numerics, [(0, 1)])
    touching = found.fn[:, 0] > 0.0
    assert (np.diff(touching.astype(int)) == 1).sum() == 2
    right, other = (
        np.array([omega for _, _, omega in plain_dem(scene, numerics, arms=arms, turn=turn, keeps=each)])
        for each in (keeps, not keeps)
    )
    assert off(found.omega, right) <= ROUND_OFF
    assert off(found.omega, other) > 1e-3


def test_rough_planes_that_turn_are_not_kratos() -> None:
    law = replace(LINEAR, beta=0.0)
    scene = pile(law)
    scene = scene.replace(walls=tuple(replace(w, law=law) for w in scene.walls))
    assert Capability.ROTATING_WALLS in Kratos().supports(scene, RUN).missing
    slid = replace(scene.walls[0], motion=(PlaneSegment(velocity=(0.1, 0.2, 0.0)),))
    assert Kratos().supports(scene.replace(walls=(slid,)), RUN).level is SupportLevel.APPROXIMATE  # arms


def test_planes_that_turn_about_two_axes_are_not_lammps() -> None:
    scene = pile(LINEAR)
    motion = [PlaneSegment(duration=1.0, angular_velocity=spin) for spin in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
    scene = scene.replace(walls=(replace(scene.walls[0], motion=motion),))
    assert Capability.ROTATING_WALLS in Lammps().supports(scene, RUN).missing


def test_planes_of_lammps_are_where_the_scene_has_them() -> None:
    """Segments with pivots of their own and a wave: a sphere held against the plane feels its gap and its velocity."""
    law = replace(LINEAR, kn=1e5, lever_arm="radius", slip_at="end", beta=0.0)
    motion = [
        PlaneSegment(duration=4e-4, velocity=(0.1, 0.2, 0.0), angular_velocity=(0.0, 2.0, 0.0)),
        PlaneSegment(duration=3e-4, angular_velocity=(0.0, -3.0, 0.0), pivot=(0.02, 0.0, 0.01)),
        PlaneSegment(amplitude=(0.0, 0.0, 1e-4), frequency=2e3, phase=0.3),
    ]
    wall = PlaneWall(name="w", point=(0.01, 0.0, 0.0), normal=(0.1, 0.0, 1.0), law=law, motion=motion)
    spheres = Spheres(x=[(0.0, 0.0, 0.0105)], radius=0.01, mass=0.01, held=True)
    scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=(wall,))
    numerics = Numerics(dt=1e-5, n_steps=100, contact_dt=1e-5, damping_form="lagged")
    found, core = run(Lammps, scene, numerics, [(0, 1)]), simulate(scene, numerics, [(0, 1)])
    assert core.fn.min() > 0.0
    assert off(found.fn, core.fn) <= 1e-9
    # LAMMPS takes differences of places for velocities: a chord of a turn is off by spin dt/2, a wave by (frequency dt)^2/24.
    assert off(found.fs[:41], core.fs[:41]) <= ROUND_OFF
    assert off(found.fs, core.fs) <= 2e-5


@pytest.fixture(scope="module")
def settled() -> tuple[SphereScene, History]:
    """Two hundred spheres of three sizes that have fallen into a box and come to lie on each other, and their last state."""
    rng = np.random.default_rng(11)
    grid = np.stack(np.meshgrid(*[np.arange(5)] * 2, np.arange(8), indexing="ij"), axis=-1).reshape(-1, 3)
    radius, pitch = np.resize([0.01, 0.011, 0.0095], len(grid)), 0.0225
    spheres = Spheres(
        x=(grid + 0.5) * pitch + rng.uniform(-2e-4, 2e-4, grid.shape),
        radius=radius,
        mass=2500.0 * 4.0 / 3.0 * np.pi * radius**3,
    )
    law, far = replace(LINEAR, beta=0.3), (5.0 * pitch,) * 3
    faces = [((0.0,) * 3, (0.0, 0.0, 1.0))]
    faces += [(at, n) for k in (0, 1) for at, n in (((0.0,) * 3, np.eye(3)[k]), (far, -np.eye(3)[k]))]
    walls = [PlaneWall(name=f"face {k}", point=at, normal=tuple(n), law=law) for k, (at, n) in enumerate(faces)]
    scene = SphereScene(spheres=spheres, sphere_sphere=law, walls=walls, gravity=(0.0, 0.0, -9.81))
    return scene, simulate(scene, Numerics(dt=1e-3, n_steps=300, contact_dt=2e-5, sample_every=300), [])


def in_the_box(settled: tuple[SphereScene, History], law: SphereLaw) -> SphereScene:
    scene, history = settled
    state = {"x": history.x[-1], "v": history.v[-1], "omega": history.omega[-1]}
    walls = tuple(replace(wall, law=law) for wall in scene.walls)
    return scene.replace(spheres=replace(scene.spheres, **state), sphere_sphere=law, walls=walls)


@pytest.mark.parametrize("law", [LINEAR, HERTZ], ids=["linear", "hertz"])
def test_a_settled_box_of_200_spheres_in_lammps_is_the_cores_over_a_thousand_steps(
    settled: tuple[SphereScene, History], law: SphereLaw
) -> None:
    law = replace(law, **SAME)
    scene = own(law, in_the_box(settled, law), "radius")
    numerics = Numerics(dt=1e-5, n_steps=1000, contact_dt=1e-5, sample_every=100, damping_form="lagged")
    core, found = simulate(scene, numerics, []), run(Lammps, scene, numerics)
    for name in ("x", "v", "omega", "wall_force"):
        assert off(getattr(found, name), getattr(core, name)) <= ROUND_OFF, name
    # The pile weighs on the floor; its spheres are held by friction, not all at rest.
    weight = 9.81 * float(scene.spheres.mass.sum())
    assert core.wall_force[-1, 0, 2] == pytest.approx(-weight, rel=0.1)
    assert np.abs(core.wall_force[-1, 0, :2]).max() > 1e-4 * weight


@pytest.mark.sampled(1)
@pytest.mark.parametrize("law", [LINEAR, replace(HERTZ, unloading="force")], ids=["linear", "hertz"])
def test_a_settled_box_of_200_spheres_in_yade_is_a_plain_dem(
    settled: tuple[SphereScene, History], law: SphereLaw
) -> None:
    """In YADE's own conventions, which the core has not: it turns shear to first order, with the mean spin, and lets no dashpot pull."""
    scene = in_the_box(settled, law)
    numerics = Numerics(dt=1e-5, n_steps=1000, contact_dt=1e-5, sample_every=100, damping_form="lagged")
    found = run(Yade, scene, numerics)
    x, v, omega = (
        np.array(rows)
        for rows in zip(*plain_dem(scene, numerics, arms=OVERLAP, turn="rotate", pulls=False), strict=True)
    )
    assert off(found.x, x) <= ROUND_OFF
    assert off(found.v, v) <= ROUND_OFF
    assert off(found.omega, omega) <= ROUND_OFF


@pytest.mark.parametrize(("engine", "leaves"), [(Yade, True), (Lammps, False)])
def test_shear_forces_of_yade_leave_the_tangent_plane_by_the_first_order_of_the_step(
    engine: type[SpringEngine], leaves: bool
) -> None:
    """A sphere sticks to a fixed one and spins about the normal and across: two turns to first order, one after the other."""
    n, t = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
    spheres = Spheres(
        x=[np.zeros(3), 0.199 * n], v=[np.zeros(3), 0.5 * t], omega=[np.zeros(3), 3.0 * n + 20.0 * np.cross(n, t)], radius=0.1,
        mass=1.0, held=[[True] * 3, [False] * 3], rotating=[False, True],
    )  # fmt: skip
    law = SphereLaw(kn=1e5, ks=8e4, mu=5.0, slip_at="end")
    scene = SphereScene(spheres=spheres, sphere_sphere=law, gravity=tuple(-100.0 * n))
    out = []
    for contact_dt in (2e-5, 5e-6):
        found = run(engine, scene, Numerics(dt=1e-4, n_steps=100, contact_dt=contact_dt), [(0, 1)])
        d, fs = found.x[:, 1] - found.x[:, 0], found.fs[:, 0]
        shear = np.linalg.norm(fs, axis=1)
        sticks = shear > 1e-3
        assert sticks.sum() > 90
        out.append(np.max(np.abs((fs * d).sum(axis=1)) / np.linalg.norm(d, axis=1) / np.maximum(shear, 1e-3)))
    assert (out[0] / out[1] == pytest.approx(4.0, rel=0.05) and out[0] > 1e-8) if leaves else max(out) < 1e-14
