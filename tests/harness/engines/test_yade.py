"""The YADE adapter: what it claims, and that what YADE computes is the scene that was sent.

Runs of the real YADE are held against exact time-discrete solutions, closed forms and the in-house DEM, which shares no
code with it; they are skipped only where YADE is absent.
"""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.errors import UnstableTimeStepError
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
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


def row_recurrence(xi: float, cycles: int, *, central: bool) -> tuple[np.ndarray, np.ndarray]:
    """Exact time-discrete forces of a row: ``m x'' + xi m x' + 2 kn x = kn w``, x the side disk, w the wall; (wall, middle)."""
    x, v, a = 0.0, 0.0, 0.5 * xi * DT
    wall, middle = np.empty(cycles + 1), np.empty(cycles + 1)
    for n in range(cycles + 1):
        w = SPEED * DT * min(n, LOAD)
        wall[n], middle[n] = KN * (w - x), KN * x
        rate = (wall[n] - middle[n]) / MASS
        if n == 0:  # noqa: SIM108
            v = 0.5 * DT * rate
        else:
            v = ((1.0 - a) * v + DT * rate) / (1.0 + a) if central else v + DT * (rate - xi * v)
        x += DT * v
    return wall, middle


def worst(one: np.ndarray, two: np.ndarray, scale: float | None = None) -> float:
    """Largest difference over the history, relative to the largest value."""
    return float(np.abs(one - two).max() / (np.abs(two).max() if scale is None else scale))


def both(scene: Scene, numerics: Numerics, watch: list[Pair]) -> tuple[History, History]:
    return Yade().run(scene, numerics, watch).history, simulate(scene, numerics, watch)


def assert_same(yade: History, core: History, tolerance: float) -> None:
    """All observed quantities agree, each relative to the largest value of its kind in the history."""
    force = float(np.abs(core.fn).max())
    scales = {"gap": force / KN, "fn": force, "fs": force, "wall_force": force}
    for name in ("x", "v", "angle", "omega", "fn", "fs", "wall_point", "wall_angle", "wall_force"):
        one, two = getattr(yade, name), getattr(core, name)
        if two.size and np.abs(two).max() > 0.0:
            assert worst(one, two, scales.get(name)) <= tolerance, name
    for name in ("kinetic", "elastic", "gravity"):
        total = max(float(np.abs(core.energy[key]).max()) for key in ("kinetic", "elastic"))
        assert worst(yade.energy[name], core.energy[name], total) <= 4.0 * tolerance, name


@needs_yade
@pytest.mark.parametrize(("xi", "form"), [(3.0, "central"), (3.0, "lagged"), (0.0, "central")])
def test_smooth_compression_is_the_exact_recurrence(xi: float, form: str) -> None:
    numerics = Numerics(dt=DT, n_steps=200, contact_dt=DT, damping_form=form)  # type: ignore[arg-type]
    history = Yade().run(nine_disks(wall_mu=0.0, xi=xi), numerics, [WALL_MID, CORNER, CENTRE]).history
    wall, middle = row_recurrence(xi, 200, central=form == "central")
    assert worst(history.fn[:, 0], wall) <= ROUND_OFF
    assert worst(history.fn[:, 1], wall) <= ROUND_OFF
    assert worst(history.fn[:, 2], middle) <= ROUND_OFF
    assert history.fn[1, 0] == pytest.approx(KN * SPEED * DT, rel=1e-10)  # step 1 already has the wall's first move
    if form == "central" and xi:
        assert history.fn[:, 2].max() == pytest.approx(5.31963e7, rel=1e-6)
        assert int(history.fn[:, 2].argmax()) == 44


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
@pytest.mark.parametrize("tilted", [False, True])
def test_preloaded_block_slides_as_the_closed_form(tilted: bool) -> None:
    mass, g, angle, mu, kn = 7.854, 10.0, np.radians(20.0), 0.36, 1e7
    down, up = np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    gravity = (0.0, -g) if tilted else (g * np.sin(angle), -g * np.cos(angle))
    if not tilted:
        down, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    weight = mass * g * np.cos(angle)
    plane = Wall(name="plane", point=(0, 0), normal=tuple(up), law=law(kn=kn, ks=kn, mu=mu))
    disks = Disks(x=[up * (0.5 - weight / kn)], radius=0.5, mass=mass, rotating=False)  # type: ignore[arg-type]
    shear = {(0, 1): -mu * weight}
    scene = Scene(disks=disks, disk_disk=law(kn=kn), walls=(plane,), gravity=gravity, initial_shear=shear)
    history = Yade().run(scene, Numerics(dt=0.01, n_steps=100), [(0, 1)]).history
    slope = g * (np.sin(angle) - mu * np.cos(angle))
    # Normal forces carry the round-off of the position: ulp(0.5 m) kn = 1e-9 N of 74 N.
    assert worst(history.x[:, 0] @ down, 0.5 * slope * history.t**2) <= 1e-10
    assert worst(history.v[:, 0] @ down, slope * history.t) <= 1e-10
    assert worst(history.fn[:, 0], np.full(101, weight)) <= 1e-9
    assert worst(history.fs[:, 0], np.full(101, -mu * weight)) <= 1e-9
    assert np.abs(history.angle).max() == 0.0


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
def test_slip_to_roll_with_spin_beyond_a_turn() -> None:
    plane = Wall(name="plane", point=(0, 0), normal=(0, 1), law=law(kn=1e6, ks=1e6, mu=0.3))
    disks = Disks(x=[(0.0, 1.0 - 1e-5)], radius=1.0, mass=1.0, v=[(60.0, 0.0)], omega=-90.0)  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=law(kn=1e6), walls=(plane,), gravity=(0.0, -10.0))
    yade, core = both(scene, Numerics(dt=0.01, n_steps=500, sample_every=15), [(0, 1)])
    assert yade.step.tolist() == [*range(0, 500, 15), 500]
    assert abs(core.angle[-1, 0]) > 20 * np.pi
    assert_same(yade, core, 1e-8)  # forces carry the round-off of a position that has gone 300 m


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
def test_two_runs_at_once_do_not_disturb_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    numerics = Numerics(dt=DT, n_steps=50, contact_dt=DT)
    Yade().extra(nine_disks(), numerics, tmp_path)  # the core's kernels find their cache in the true home
    (tmp_path / "wall_path.npy").unlink()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    with ThreadPoolExecutor(2) as pool:
        one, two = pool.map(lambda _: Yade().run(nine_disks(), numerics, [CENTRE]).history, range(2))
    np.testing.assert_array_equal(one.fn, two.fn)
    assert one.fn.max() > 0.0
    assert list(tmp_path.iterdir()) == []  # neither a temporary file nor a home


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
def test_run_stopped_half_way_is_a_timeout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    engine = Yade()
    engine.time_limit = 2.5
    numerics = Numerics(dt=DT, n_steps=10_000_000, contact_dt=DT, sample_every=10_000_000)
    scene = nine_disks().replace(walls=())  # no path of the walls to prepare: the time goes into YADE
    with pytest.raises(EngineTimeoutError, match=r"yade was stopped at its time limit of 2.5 s"):
        engine.run(scene, numerics, [])
    assert list(tmp_path.iterdir()) == []


@needs_yade
def test_preload_without_overlap_is_refused() -> None:
    plane = Wall(name="plane", point=(0, 0), normal=(0, 1), law=law(kn=1e6, ks=1e6, mu=0.3))
    disks = Disks(x=[(0.0, 1.1)], radius=1.0, mass=1.0)  # type: ignore[arg-type]
    scene = Scene(disks=disks, disk_disk=law(kn=1e6), walls=(plane,), initial_shear={(0, 1): 2.0})
    with pytest.raises(EngineError, match=r"initial_shear of pair \(0, 1\) is 2 N, but the two bodies do not overlap"):
        Yade().run(scene, Numerics(dt=0.01, n_steps=1), [])


@needs_yade
def test_step_beyond_the_critical_one_is_the_users_mistake() -> None:
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        Yade().run(nine_disks(), Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_yade
def test_state_that_explodes_is_an_error() -> None:
    """Far beyond the critical step positions overflow; the adapter must not hand that on."""
    numerics = Numerics(dt=1.0, n_steps=2000, contact_dt=1.0, allow_unstable=True)
    pushed = nine_disks(xi=-0.0).replace(gravity=(1e300, 0.0))
    with pytest.raises(EngineError, match=r"stopped being finite|gave up|ended"):
        Yade().run(pushed, numerics, [])


@needs_yade
def test_info_and_settings_of_the_real_one() -> None:
    info = Yade().info()
    assert info.installed
    assert info.version
    assert info.version[:2] == "20"
    assert info.licence == "GPL-2.0-or-later"
    settings = Yade().run(nine_disks(), Numerics(dt=DT, n_steps=1), [CENTRE]).settings
    assert settings["engine_version"] == info.version
    assert settings["contact_law"] == "Law2_ScGeom_FrictPhys_CundallStrack"
    assert settings["contact_dt"] * settings["contact_steps_per_dt"] == pytest.approx(DT)


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
