"""The YADE adapter: what it claims, and that what YADE computes is the scene that was sent.

Runs of the real YADE are held against exact time-discrete solutions, closed forms and the in-house DEM, which shares no
code with it; they are skipped only where YADE is absent.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from ninedisk_tests_comparison import assert_same, worst

from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, SupportLevel
from ninedisk.harness.engines.yade.adapter import NOTE_ARM, NOTE_ROTATION, Yade
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.harness.wire.protocol import Request, encode_request

needs_yade = pytest.mark.skipif(shutil.which("yade") is None, reason="YADE is not installed: apt-get install yade")

KN, RADIUS, DT, SPEED, LOAD = 1.35e9, 50.0, 0.01525, 0.12, 40
MASS = 1000.0 * np.pi * RADIUS**2
MU = float(np.tan(np.radians(15.0)))
CENTRE, WALL_MID, CORNER, UP = (3, 4), (3, 9), (0, 9), (4, 5)

ROUND_OFF = 1e-11
"""Positions reach 300 m (ulp 5.7e-14 m), overlaps 0.04 m: each force is rounded by 1.5e-12 of the peak, and 200 cycles add up."""


def law(**values: object) -> ContactLaw:
    """A contact with YADE's own conventions."""
    return ContactLaw(**{"lever_arm": "overlap", "wall_velocity_at": "mid-overlap", "slip_at": "end", **values})  # type: ignore[arg-type]


def nine_disks(
    *, mu: float = MU, wall_mu: float = MU, xi: float = 3.0, load: int = LOAD, turn: tuple[int, int] | None = None
) -> Scene:
    """The nine-disk box; ``turn`` = (cycles of rest, cycles of rotation of the side walls)."""
    grid = (50.0, 150.0, 250.0)
    walls = []
    sides = (("left", 0, 150, 1, 0), ("right", 300, 150, -1, 0), ("bottom", 150, 0, 0, 1), ("top", 150, 300, 0, -1))
    for name, px, py, nx, ny in sides:
        motion = [WallSegment(duration=load * DT, velocity=(nx * SPEED, ny * SPEED))]
        if turn and nx:
            motion += [WallSegment(duration=turn[0] * DT), WallSegment(duration=turn[1] * DT, angular_velocity=-0.0175)]
        contact = law(kn=KN, ks=KN, mu=wall_mu)
        walls.append(Wall(name=name, point=(px, py), normal=(nx, ny), law=contact, motion=tuple(motion)))
    disks = Disks(x=[(x, y) for y in grid for x in grid], radius=RADIUS, mass=MASS)  # type: ignore[arg-type]
    return Scene(disks=disks, disk_disk=law(kn=KN, ks=KN, mu=mu), walls=tuple(walls), xi=xi)


def both(scene: Scene, numerics: Numerics, watch: list[Pair]) -> tuple[History, History]:
    return Yade().run(scene, numerics, watch).history, simulate(scene, numerics, watch)


@needs_yade
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_rough_compression_is_the_in_house_dem(form: str) -> None:
    numerics = Numerics(dt=DT, n_steps=200, contact_dt=DT / 2, damping_form=form)  # type: ignore[arg-type]
    yade, core = both(nine_disks(), numerics, [WALL_MID, CORNER, CENTRE, UP])
    for name in ("fn", "fs", "wall_force"):
        assert worst(getattr(yade, name), getattr(core, name)) <= 2.0 * ROUND_OFF, name
    assert np.abs(core.fs).max() > 1e6  # the walls do rub


@needs_yade
def test_distortion_differs_only_by_the_first_order_rotation_of_shear() -> None:
    turn = 150
    scene = nine_disks(mu=0.6, wall_mu=0.6, load=400, turn=(100, turn))
    numerics = Numerics(dt=DT, n_steps=500 + turn, contact_dt=DT)
    yade, core = both(scene, numerics, [CENTRE, UP, WALL_MID, CORNER])
    shear = float(np.abs(core.fs).max())
    assert shear > 1e7
    # A shear force grows by theta^2/2 in a step in which its normal turns by theta, at most the walls' angle here.
    growth = turn * 0.5 * (0.0175 * DT) ** 2
    before = slice(0, 500)
    assert worst(yade.fs[before], core.fs[before], shear) <= ROUND_OFF
    assert worst(yade.fs, core.fs, shear) <= growth
    assert worst(yade.fn, core.fn) <= growth


@needs_yade
def test_damped_oblique_collision_with_initial_overlap() -> None:
    """Unequal spinning disks that overlap at time 0, dashpot, friction, gravity, global damping; each pair its own m_eff."""
    disks = Disks(
        x=[(0.0, 0.0), (1.99, 0.1), (-1.6, 0.4)],  # type: ignore[arg-type]
        radius=[1.0, 1.0, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.4],  # type: ignore[arg-type]
        v=[(1.0, 0.0), (0.0, 0.3), (2.0, 0.0)],  # type: ignore[arg-type]
        omega=[1.0, -2.0, 0.7],  # type: ignore[arg-type]
        rotating=[True, True, False],  # type: ignore[arg-type]
    )
    scene = Scene(disks=disks, disk_disk=law(kn=1e4, ks=5e3, mu=0.5, beta=0.2), xi=0.7, gravity=(0.3, -1.0))
    numerics = Numerics(dt=0.01, n_steps=60, contact_dt=1e-4, damping_form="lagged")
    yade, core = both(scene, numerics, [(0, 1), (0, 2)])
    assert np.abs(core.fs[:, 1]).max() > 1.0
    # First-order rotation: the normals turn by about 1e-4 in a step, over some 500 steps of contact.
    assert_same(yade, core, 1e-6)


@needs_yade
def test_oblique_walls_with_every_kind_of_motion() -> None:
    rough = law(kn=1e4, ks=1e4, mu=0.3)
    shaking = WallSegment(duration=0.3, amplitude=(0.2, 0.1), frequency=20.0, phase=0.4)
    turning = WallSegment(duration=0.35, angular_velocity=0.5, pivot=(-1, -2), tan_lever=(0.3, 0), tan_rate=0.8)
    floor = law(kn=2e4, ks=1e4, mu=0.6)
    walls = (
        Wall(name="a", point=(-2, 0), normal=(1, 0.3), law=rough, motion=(shaking, turning)),
        Wall(name="b", point=(0, -2.2), normal=(0, 1), law=floor),
        Wall(name="c", point=(3, 0), normal=(-1, 0), law=floor, motion=(WallSegment(velocity=(-0.3, 0.0)),)),
    )
    disks = Disks(
        x=[(-0.5, 0.0), (1.2, 0.3), (0.4, -1.4)],  # type: ignore[arg-type]
        radius=[1.0, 0.8, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.5],  # type: ignore[arg-type]
        v=[(-1, 0), (1, -3), (0, -2)],  # type: ignore[arg-type]
    )
    scene = Scene(disks=disks, disk_disk=law(kn=2e4, ks=1e4, mu=0.4), walls=walls, gravity=(0.0, -9.81), xi=0.5)
    yade, core = both(scene, Numerics(dt=0.01, n_steps=50, contact_dt=1e-4), [(0, 3), (0, 1), (2, 4)])
    assert (np.abs(core.fs).max(axis=0) > 1.0).all()
    # Collisions amplify the first-order rotation (about 1e-8 in a step) and the free rolling of three disks.
    assert_same(yade, core, 1e-4)


@needs_yade
def test_folder_that_yade_makes_in_tmp_is_removed(tmp_path: Path) -> None:
    """YADE makes it whatever TMPDIR says, and leaves it behind when it is killed; the driver removes it at its start."""
    scene, numerics, engine = nine_disks(), Numerics(dt=DT, n_steps=1), Yade()
    extra = engine.extra(scene, numerics, tmp_path)
    request = Request(scene=scene, numerics=numerics, watch=(), answer_file=str(tmp_path / "answer"), extra=extra)
    done = run_isolated(engine.command(), stdin=encode_request(request), env=engine.environment(tmp_path), cwd=tmp_path)
    folder = done.stdout.partition("removed ")[2].split()[0]
    assert Path(folder).name.startswith("yade-")
    assert not Path(folder).exists()


@needs_yade
def test_preload_without_overlap_is_refused() -> None:
    plane = Wall(name="plane", point=(0, 0), normal=(0, 1), law=law(kn=1e6, ks=1e6, mu=0.3))
    disks = Disks(x=[(0.0, 1.1)], radius=1.0, mass=1.0)  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=law(kn=1e6), walls=(plane,), initial_shear={(0, 1): 2.0})
    with pytest.raises(EngineError, match=r"initial_shear of pair \(0, 1\) is 2 N, but the two bodies do not overlap"):
        Yade().run(scene, Numerics(dt=0.01, n_steps=1), [])


def test_conventions_are_graded_honestly() -> None:
    numerics = Numerics(dt=DT, n_steps=1)
    own = Yade().supports(nine_disks(turn=(1, 1)), numerics)
    assert own.level is SupportLevel.EXACT
    assert NOTE_ARM in own.notes
    assert NOTE_ROTATION in own.notes
    radius = nine_disks().replace(disk_disk=ContactLaw(kn=KN, ks=KN, mu=MU, lever_arm="radius"))
    answer = Yade().supports(radius, numerics)
    assert answer.level is SupportLevel.APPROXIMATE
    assert answer.missing == (Capability.LEVER_ARM_RADIUS,)
    walls = [
        Wall(
            name=w.name,
            point=w.point,
            normal=w.normal,
            motion=w.motion,
            law=law(kn=KN, ks=KN, mu=MU, wall_velocity_at="surface"),
        )
        for w in nine_disks(turn=(1, 1)).walls
    ]
    assert Yade().supports(nine_disks().replace(walls=walls), numerics).level is SupportLevel.APPROXIMATE
    damped = nine_disks().replace(disk_disk=law(kn=KN, beta=0.1))
    assert Yade().supports(damped, numerics).level is SupportLevel.EQUIVALENT
    assert Yade().supports(damped, numerics.replace(damping_form="lagged")).level is SupportLevel.EXACT
    smooth = Yade().supports(nine_disks(mu=0.0, wall_mu=0.0), numerics)
    assert (smooth.level, smooth.notes) == (SupportLevel.EXACT, ())


def test_missing_yade_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    info = Yade().info()
    assert not info.installed
    assert info.install == "apt-get install yade"
    with pytest.raises(EngineNotInstalledError, match=r"no command `yade` on PATH\): apt-get install yade"):
        Yade().run(nine_disks(), Numerics(dt=DT, n_steps=1), [])


@pytest.mark.parametrize(
    ("script", "reason"),
    [("echo Welcome", "answers 'Welcome'"), ("exit 3", "non-zero exit status 3")],
)
def test_broken_yade_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, reason: str
) -> None:
    program = tmp_path / "yade"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin")
    info = Yade().info()
    assert not info.installed
    assert reason in info.not_installed_because


def test_unrelated_yade_that_breaks_off_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "yade"
    program.write_text(
        '#!/bin/sh\ntest "$1" = --version && echo Yade version: 1.0 && exit\necho no display >&2; kill -9 $$\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin")
    with pytest.raises(EngineError, match=r"yade was ended by SIGKILL .*\nno display"):
        Yade().run(nine_disks(), Numerics(dt=DT, n_steps=1), [])
