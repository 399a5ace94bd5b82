"""The LIGGGHTS adapter: what it claims, and that what LIGGGHTS computes is the scene that was sent.

Runs of the real LIGGGHTS are held against exact time-discrete solutions, closed forms and the in-house DEM, which shares no code
with it; they are skipped only where LIGGGHTS is absent.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.errors import UnstableTimeStepError
from ninedisk.core.history import History
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES, MASS
from ninedisk.harness.engines.liggghts import adapter as adapter
from ninedisk.harness.engines.liggghts.adapter import Liggghts
from ninedisk.harness.engines.plane import no_disk_can_turn
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.references.exact_steps.compression import smooth_row

needs_liggghts = pytest.mark.skipif(
    not Liggghts().info().installed, reason="LIGGGHTS is not installed: apt-get install liggghts"
)

ROUND_OFF = 1e-10
"""Of the largest force: it is kn times a difference of positions near 300 m (ulp 5.7e-14 m) over overlaps of some 0.04 m,
1.5e-12 in each evaluation; some hundred cycles add up to less than a hundred of them."""


def variant(case_id: str, **params: object) -> Setup:
    """A variant with LIGGGHTS' own place of the slip in the step, where the case has a word for it."""
    case = get_case(case_id)
    if any(parameter.name == "slip_at" for parameter in case.parameters):
        params = {"slip_at": "end", **params}
    return case.build(resolve(case, params).params)


def worst(one: np.ndarray, two: np.ndarray, scale: float | None = None) -> float:
    """Largest difference over the history, relative to the largest value."""
    return float(np.abs(one - two).max() / (np.abs(two).max() if scale is None else scale))


def assert_same(engine: History, core: History, tolerance: float) -> None:
    """All observed quantities agree, each relative to the largest value of its kind in the history."""
    force = float(np.abs(core.fn).max())
    scales = {"gap": float(np.abs(core.gap).max()), "fn": force, "fs": force, "wall_force": force}
    for name in ("x", "v", "gap", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        one, two = getattr(engine, name), getattr(core, name)
        assert one.shape == two.shape
        if two.size and np.abs(two).max() > 0.0:
            assert worst(one, two, scales.get(name)) <= tolerance, name
    total = max(float(np.abs(core.energy[key]).max()) for key in ("kinetic", "elastic", "gravity"))
    for name in ("kinetic", "elastic", "gravity"):
        assert worst(engine.energy[name], core.energy[name], total) <= 4.0 * tolerance, name


@needs_liggghts
@pytest.mark.parametrize("load_case", LOAD_CASES)
@pytest.mark.parametrize(("xi", "form"), [(3.0, "central"), (3.0, "lagged"), (0.0, "central")])
def test_smooth_compression_is_the_exact_recurrence(load_case: str, xi: float, form: str) -> None:
    setup = variant("nine-disk/compression", load_case=load_case, xi=xi, damping_form=form, settle_cycles=0)
    history = Liggghts().run(setup.scene, setup.numerics, setup.watch).history
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


@needs_liggghts
@pytest.mark.parametrize("load_case", LOAD_CASES)
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_rough_compression_is_the_in_house_dem(load_case: str, form: str) -> None:
    setup = variant("nine-disk/compression", load_case=load_case, wall_mu="mu", damping_form=form, settle_cycles=0)
    run = Liggghts().run(setup.scene, setup.numerics, setup.watch)
    core = simulate(setup.scene, setup.numerics, setup.watch)
    assert_same(run.history, core, ROUND_OFF)
    assert np.abs(core.fs).max() > 1e6  # the walls do rub
    # Forces of 1e7 N are rounded by 1e-9 N; times R/I and 200 steps of 0.015 s that turns a disk of 1e10 kg m^2 by 1e-15.
    assert np.abs(run.history.omega).max() <= 1e-12


@needs_liggghts
@pytest.mark.parametrize("tilted", [False, True])
@pytest.mark.parametrize("mu", [0.36, 0.4])
def test_preloaded_block_is_the_closed_form(mu: float, tilted: bool) -> None:
    mass, g, angle, kn = 7.854, 10.0, np.radians(20.0), 1e7
    down, up = np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    gravity = (0.0, -g)
    if not tilted:
        gravity = (g * np.sin(angle), -g * np.cos(angle))
        down, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    weight, pull = mass * g * np.cos(angle), mass * g * np.sin(angle)
    held = min(mu * weight, pull)
    plane = Wall(name="plane", point=(0, 0), normal=tuple(up), law=ContactLaw(kn=kn, ks=kn, mu=mu))
    disks = Disks(x=[up * (0.5 - weight / kn)], radius=0.5, mass=mass, rotating=False)  # type: ignore[arg-type]
    scene = Scene(
        disks=disks, disk_disk=ContactLaw(kn=kn), walls=(plane,), gravity=gravity, initial_shear={(0, 1): -held}
    )
    history = Liggghts().run(scene, Numerics(dt=0.01, n_steps=100), [(0, 1)]).history
    slope = (pull - held) / mass
    # The plane's triangle has corners 33 m away (ulp 7.1e-15 m): four such units times kn are 4e-9 of fn. Friction of that error in
    # 30 000 steps of 3e-5 s, at random, changes the velocity of 8 kg by 1e-10 m/s.
    assert np.abs(history.x[:, 0] @ down - 0.5 * slope * history.t**2).max() <= 1e-10
    assert np.abs(history.v[:, 0] @ down - slope * history.t).max() <= 1e-10
    assert worst(history.fn[:, 0], np.full(101, weight)) <= 4e-9
    assert worst(history.fs[:, 0], np.full(101, -held)) <= 4e-9


@needs_liggghts
def test_preload_that_cannot_be_is_refused() -> None:
    setup = variant("incline-block", mu=0.36)
    scene = setup.scene.replace(initial_shear={(0, 1): -60.0})
    with pytest.raises(EngineError, match=r"initial_shear of pair \(0, 1\) should be -60 N, but LIGGGHTS holds -26.5"):
        Liggghts().run(scene, setup.numerics, [])


@needs_liggghts
def test_dashpots_of_unequal_blocked_disks_between_moving_walls() -> None:
    """Every pair has its own reduced mass; a floor moves sideways, stops and comes back; lagged, as LIGGGHTS' dashpots are."""
    law = ContactLaw(kn=1e5, ks=8e4, mu=0.4, beta=0.15, slip_at="end")
    there = (WallSegment(duration=0.1, velocity=(0.5, 0.1)), WallSegment(duration=0.1), WallSegment(velocity=(-0.4, 0)))
    floor = Wall(name="floor", point=(0, 0), normal=(0, 1), law=ContactLaw(kn=1e5, ks=1e5, mu=0.3), motion=there)
    side = Wall(name="side", point=(-1.2, 0), normal=(1, 0.2), law=ContactLaw(kn=5e4, ks=2e4, mu=0.2, beta=0.1))
    disks = Disks(
        x=[(0.0, 1.0), (1.805, 0.8), (0.95, 2.31)],  # type: ignore[arg-type]
        radius=[1.0, 0.8, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.5],  # type: ignore[arg-type]
        v=[(-2.0, 0.0), (-4.0, 0.0), (-0.5, -3.0)],  # type: ignore[arg-type]
        rotating=False,  # type: ignore[arg-type]
    )
    scene = Scene(disks=disks, disk_disk=law, walls=(floor, side), gravity=(0.0, -9.81), xi=0.5)
    numerics = Numerics(dt=0.002, n_steps=200, contact_dt=1e-4, damping_form="lagged")
    watch = [(0, 1), (0, 2), (0, 3), (0, 4), (1, 3)]
    assert Liggghts().supports(scene, numerics).level is SupportLevel.EXACT
    engine = Liggghts().run(scene, numerics, watch).history
    core = simulate(scene, numerics, watch)
    assert (np.abs(core.fs).max(axis=0) > 1.0).all()
    # Shear of disks is projected on the new tangent, which takes half the square of its rotation: at 4 m/s over 1.6 m some 2.5e-4 in a
    # step of 1e-4 s, 3e-8 of it, over the hundred steps of a contact.
    assert_same(engine, core, 3e-6)


@needs_liggghts
@pytest.mark.parametrize("kind", ["elastic", "plastic"])
def test_collision_is_the_in_house_dem(kind: str) -> None:
    setup = variant("binary-collision", kind=kind)
    numerics = setup.numerics.replace(damping_form="lagged", sample_from=49)
    engine = Liggghts().run(setup.scene, numerics, setup.watch).history
    core = simulate(setup.scene, numerics, setup.watch)
    assert np.abs(engine.v - core.v).max() <= 1e-12
    assert np.abs(engine.x - core.x).max() <= 1e-12


@needs_liggghts
def test_central_damping_starts_from_the_velocity_of_time_0() -> None:
    disks = Disks(x=[(0.0, 0.0)], radius=1.0, mass=2.0, v=[(3.0, -1.0)])  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0), gravity=(0.5, -9.0), xi=2.0)
    numerics = Numerics(dt=0.05, n_steps=40, contact_dt=0.05)
    engine, core = Liggghts().run(scene, numerics, []).history, simulate(scene, numerics, [])
    for name in ("x", "v"):
        assert worst(getattr(engine, name), getattr(core, name)) <= 1e-14, name


@needs_liggghts
def test_run_stopped_half_way_is_a_timeout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    setup, engine = variant("nine-disk/compression"), Liggghts()
    engine.time_limit = 2.5
    numerics = setup.numerics.replace(n_steps=20_000_000, sample_every=20_000_000)
    with pytest.raises(EngineTimeoutError, match=r"was stopped at its time limit of 2.5 s"):
        engine.run(setup.scene.replace(xi=0.0), numerics, [])
    assert list(tmp_path.iterdir()) == []


@needs_liggghts
def test_errors_of_liggghts_are_shown(tmp_path: Path) -> None:
    """Its own error aborts the process; its words are among the last lines all the same."""
    engine, folder = Liggghts(), str(adapter.DRIVER.parent)
    code = f"import sys; sys.path.insert(0, {folder!r}); import driver; driver.Liggghts({adapter._library()[0]!r}).do('nonsense')"
    with pytest.raises(EngineError, match=r"ended with status 1 (.*\n)*.*ERROR: Unknown command: nonsense"):
        run_isolated([sys.executable, "-c", code], env=engine.environment(tmp_path), cwd=tmp_path)


@needs_liggghts
def test_disks_that_liggghts_does_not_take_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter, "wall_reach", lambda *_: 1e-3)  # its box is too small then
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineError, match="LIGGGHTS took 1 of 9 disks"):
        Liggghts().run(setup.scene, setup.numerics, [])


@needs_liggghts
def test_far_apart_disks_need_no_more_memory() -> None:
    disks = Disks(x=[(0.0, 0.0), (1e6, 1e6)], radius=1.0, mass=1.0, v=[(1.0, 0.0), (0.0, 0.0)])  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=1.0))
    history = Liggghts().run(scene, Numerics(dt=0.1, n_steps=2, contact_dt=0.1), [(0, 1)]).history
    assert history.x[-1].tolist() == pytest.approx(np.array([[0.2, 0.0], [1e6, 1e6]]))


@needs_liggghts
def test_disk_driven_through_a_wall_is_an_error() -> None:
    scene = variant("nine-disk/compression").scene
    numerics = Numerics(dt=1.0, n_steps=2000, contact_dt=1.0, allow_unstable=True)
    with pytest.raises(EngineError, match=r"disk \d is .* m behind wall '\w+'|ended"):
        Liggghts().run(scene, numerics, [])


@needs_liggghts
def test_step_beyond_the_critical_one_is_the_users_mistake() -> None:
    scene = variant("nine-disk/compression").scene
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        Liggghts().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_liggghts
def test_scene_without_disks_is_an_error() -> None:
    scene = Scene(disks=Disks(x=np.empty((0, 2)), radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1.0))  # type: ignore[arg-type]
    with pytest.raises(EngineError, match="there is no disk"):
        Liggghts().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_liggghts
def test_info_and_settings_of_the_real_one() -> None:
    info = Liggghts().info()
    assert info.version is not None
    assert info.version.startswith("3.")
    assert info.licence == "GPL-2.0-or-later"
    setup = variant("incline-block")
    settings = Liggghts().run(setup.scene, setup.numerics.replace(n_steps=1), setup.watch).settings
    assert settings["engine_version"] == info.version
    assert settings["contact model"] == "model hooke/stiffness tangential history limitForce on"
    assert settings["contact_dt"] * settings["contact_steps_per_dt"] == pytest.approx(setup.numerics.dt)


@pytest.mark.parametrize("wall_mu", [0.0, "mu"])
def test_spheres_stand_for_disks_only_where_symmetry_forbids_turning(wall_mu: float | str) -> None:
    setup = variant("nine-disk/compression", wall_mu=wall_mu)
    answer = Liggghts().supports(setup.scene, setup.numerics)
    assert (answer.level, answer.notes) == (SupportLevel.EXACT, (adapter.NOTE_SYMMETRY,))
    pushed = setup.scene.replace(gravity=(1.0, 0.3))
    other = Liggghts().supports(pushed, setup.numerics)
    assert other.level is SupportLevel.NO
    assert Capability.DISK_INERTIA in other.missing
    assert adapter.NOTE_SPHERE in other.notes
    for case in ("nine-disk/distortion", "slip-to-roll"):
        other = Liggghts().supports(variant(case).scene, variant(case).numerics)
        assert Capability.DISK_INERTIA in other.missing


def broken(scene: Scene) -> list[Scene]:
    """Scenes in which some disk of a symmetric one may turn."""
    disks, walls, left = scene.disks, scene.walls, scene.walls[0]
    moved, spun, heavy = np.array(disks.x), np.zeros(9), np.array(disks.mass)
    moved[1, 0] += 1e-6
    spun[4] = 1e-3
    heavy[5] *= 1.001

    def changed(**values: object) -> Scene:
        return scene.replace(walls=(Wall(**{**vars(left), **values}), *walls[1:]))  # type: ignore[arg-type]

    return [
        scene.replace(disks=Disks(x=moved, radius=disks.radius, mass=disks.mass)),
        scene.replace(disks=Disks(x=disks.x, radius=disks.radius, mass=disks.mass, omega=spun)),
        scene.replace(disks=Disks(x=disks.x, radius=disks.radius, mass=heavy)),
        scene.replace(gravity=(0.0, -1.0)),
        scene.replace(initial_shear={(0, 1): 1.0}),
        scene.replace(walls=walls[:3]),
        changed(motion=(WallSegment(duration=0.61, velocity=(0.12, 0.1)),)),
        changed(motion=(WallSegment(duration=0.61, velocity=(0.12, 0.0), angular_velocity=0.1),)),
        changed(motion=()),
        changed(point=(-1.0, 0.0)),
        changed(law=ContactLaw(kn=1.0)),
    ]


def test_symmetry_is_seen_and_its_breaking_too() -> None:
    scene = variant("nine-disk/compression", wall_mu="mu").scene
    assert no_disk_can_turn(scene)
    turned = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    walls = [
        Wall(
            name=wall.name,
            point=tuple(turned @ wall.point),
            normal=tuple(turned @ wall.normal),
            law=wall.law,
            motion=[WallSegment(duration=s.duration, velocity=tuple(turned @ s.velocity)) for s in wall.motion],  # type: ignore[arg-type]
        )
        for wall in scene.walls
    ]
    disks = Disks(x=scene.disks.x @ turned.T, radius=scene.disks.radius, mass=scene.disks.mass)
    assert no_disk_can_turn(scene.replace(disks=disks, walls=walls))
    for k, other in enumerate(broken(scene)):
        assert not no_disk_can_turn(other), k


def test_what_it_lacks_is_graded_honestly() -> None:
    setup = variant("incline-block")
    assert Liggghts().supports(setup.scene, setup.numerics).level is SupportLevel.EQUIVALENT  # central form, dashpot
    lagged = setup.numerics.replace(damping_form="lagged")
    assert Liggghts().supports(setup.scene, lagged).level is SupportLevel.EXACT
    disks = Disks(x=[(0.0, 0.4999), (0.99995, 0.4999)], radius=0.5, mass=1.0, rotating=False)  # type: ignore[arg-type]
    pressed = setup.scene.replace(disks=disks, initial_shear={(0, 2): -1.0})
    assert Liggghts().supports(pressed, lagged).missing == (Capability.PRELOAD,)
    scene = Scene(disks=Disks(x=[(0.0, 0.0)], radius=1.0, mass=1.0, omega=2.0), disk_disk=ContactLaw(kn=1.0), xi=1.0)  # type: ignore[arg-type]
    free = Numerics(dt=1e-3, n_steps=1)
    assert Liggghts().supports(scene, free).missing == (Capability.GLOBAL_DAMPING_CENTRAL,)
    assert Liggghts().supports(scene.replace(xi=0.0), free).level is SupportLevel.EXACT
    compression = variant("nine-disk/compression")
    late = 0.7 * compression.numerics.dt
    odd = [
        Wall(
            name=w.name,
            point=w.point,
            normal=w.normal,
            law=w.law,
            motion=(WallSegment(duration=late, velocity=s.velocity),),
        )
        for w in compression.scene.walls
        for s in w.motion
    ]
    answer = Liggghts().supports(compression.scene.replace(walls=odd), compression.numerics)
    assert (answer.level, answer.missing) == (SupportLevel.NO, (Capability.MOVING_WALLS,))


def test_missing_library_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter, "LIBRARY", "libnowhere.so.3")
    adapter._library.cache_clear()
    info = Liggghts().info()
    adapter._library.cache_clear()
    assert not info.installed
    monkeypatch.setattr(adapter, "_library", lambda: ("", "there is no library libliggghts.so.3"))
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineNotInstalledError, match=r"no library libliggghts.so.3\): apt-get install liggghts"):
        Liggghts().run(setup.scene, setup.numerics, [])


def test_library_that_does_not_load_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = tmp_path / "libliggghts.so.3.8.0"
    library.write_text("no library")
    monkeypatch.setattr(adapter, "_library", lambda: (str(library), ""))
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineError, match=r"gave up: OSError: .*libliggghts"):
        Liggghts().run(setup.scene, setup.numerics, [])
