"""The LIGGGHTS adapter: what it claims, and that what LIGGGHTS computes is the scene that was sent.

Runs of the real LIGGGHTS are held against exact time-discrete solutions, closed forms and the in-house DEM, which shares no code
with it; they are skipped only where LIGGGHTS is absent.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from ninedisk_tests_comparison import assert_same, variant

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, SupportLevel
from ninedisk.harness.engines.liggghts import adapter as adapter
from ninedisk.harness.engines.liggghts.adapter import Liggghts
from ninedisk.harness.engines.symmetry import no_disk_can_turn
from ninedisk.harness.run.isolation import run_isolated

needs_liggghts = pytest.mark.skipif(
    not Liggghts().info().installed, reason="LIGGGHTS is not installed: apt-get install liggghts"
)


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
    run = Liggghts().run(scene, numerics, watch)
    assert run.settings["contact model"].endswith(" limitForce on")
    engine, core = run.history, simulate(scene, numerics, watch)
    assert (np.abs(core.fs).max(axis=0) > 1.0).all()
    # Shear of disks is projected on the new tangent, which takes half the square of its rotation: at 4 m/s over 1.6 m some 2.5e-4 in a
    # step of 1e-4 s, 3e-8 of it, over the hundred steps of a contact.
    assert_same(engine, core, 3e-6)


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


@pytest.mark.parametrize("wall_mu", [0.0, "mu"])
def test_spheres_represent_disks_only_where_symmetry_forbids_turning(wall_mu: float | str) -> None:
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
