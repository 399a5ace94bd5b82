"""The ESyS-Particle adapter: what it claims, and that what ESyS-Particle computes is the scene that was sent.

Runs of the real ESyS-Particle are held against exact time-discrete solutions and the in-house DEM, which shares no code with it;
they are skipped only where ESyS-Particle is absent.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ninedisk.core.errors import UnstableTimeStepError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.cases.nine_disk.scene import LOAD_CASES, MASS
from ninedisk.harness.engines.esys_particle import adapter as adapter
from ninedisk.harness.engines.esys_particle.adapter import EsysParticle
from ninedisk.references.exact_steps.compression import smooth_row

needs_esys = pytest.mark.skipif(
    not EsysParticle().info().installed, reason="ESyS-Particle is not installed: apt-get install esys-particle"
)

ROUND_OFF = 1e-10
"""Of the largest force: it is kn times a difference of positions near 300 m (ulp 5.7e-14 m) over overlaps of some 0.04 m,
1.5e-12 in each evaluation; some hundred cycles add up to less than a hundred of them."""


def variant(case_id: str, **params: object) -> Setup:
    case = get_case(case_id)
    return case.build(resolve(case, params).params)


def worst(one: np.ndarray, two: np.ndarray) -> float:
    """Largest difference over the history, relative to the largest value."""
    return float(np.abs(one - two).max() / np.abs(two).max())


def processes(folder: Path) -> list[str]:
    """Names of running processes whose environment, hence temporary folder, is within ``folder``."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if f"TMPDIR={folder}".encode() in (place / "environ").read_bytes():
                found.append((place / "comm").read_text().strip())
        except OSError:
            continue
    return sorted(found)


@needs_esys
@pytest.mark.parametrize("load_case", LOAD_CASES)
@pytest.mark.parametrize(("xi", "form"), [(3.0, "central"), (3.0, "lagged"), (0.0, "central")])
def test_smooth_compression_is_the_exact_recurrence(load_case: str, xi: float, form: str) -> None:
    setup = variant("nine-disk/compression", load_case=load_case, xi=xi, damping_form=form, settle_cycles=0)
    history = EsysParticle().run(setup.scene, setup.numerics, setup.watch).history
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
    core = simulate(setup.scene, setup.numerics, setup.watch)
    for name in ("x", "v", "gap", "wall_force", "wall_point", "wall_angle"):
        assert worst(getattr(history, name), getattr(core, name)) <= ROUND_OFF, name
    for name in ("kinetic", "elastic"):
        assert worst(history.energy[name], core.energy[name]) <= 4.0 * ROUND_OFF, name


@needs_esys
@pytest.mark.parametrize("form", ["central", "lagged"])
def test_smooth_collisions_under_gravity_between_walls_that_shake(form: str) -> None:
    """Unequal disks that overlap at first, walls that are oblique or shake, initial velocities, damping."""
    shaking = WallSegment(amplitude=(0.0, 0.1), frequency=20.0, phase=0.4)
    walls = (
        Wall(name="floor", point=(0, 0), normal=(0, 1), law=ContactLaw(kn=1e4), motion=(shaking,)),
        Wall(name="side", point=(-1.1, 0), normal=(1, 0.2), law=ContactLaw(kn=3e4)),
    )
    disks = Disks(
        x=[(0.0, 0.98), (1.7, 0.8), (0.9, 2.4)],  # type: ignore[arg-type]
        radius=[1.0, 0.8, 0.6],  # type: ignore[arg-type]
        mass=[1.0, 2.0, 0.5],  # type: ignore[arg-type]
        v=[(-2.0, 0.0), (-1.0, 0.0), (0.3, -3.0)],  # type: ignore[arg-type]
    )
    scene = Scene(disks=disks, disk_disk=ContactLaw(kn=2e4), walls=walls, gravity=(0.5, -9.81), xi=0.5)
    numerics = Numerics(dt=0.01, n_steps=60, contact_dt=1e-3, damping_form=form, sample_every=7)  # type: ignore[arg-type]
    watch = [(0, 1), (0, 2), (0, 3), (1, 3), (0, 4)]
    assert EsysParticle().supports(scene, numerics).level is SupportLevel.EXACT
    engine, core = EsysParticle().run(scene, numerics, watch).history, simulate(scene, numerics, watch)
    assert engine.step.tolist() == [*range(0, 60, 7), 60]
    # Scattering of three disks multiplies round-off by some thousand.
    for name in ("x", "v", "fn", "wall_force", "gap"):
        assert worst(getattr(engine, name), getattr(core, name)) <= 1e-9, name
    assert worst(engine.energy["gravity"], core.energy["gravity"]) <= 1e-9


@needs_esys
def test_collision_is_the_in_house_dem() -> None:
    setup = variant("binary-collision")
    engine = EsysParticle().run(setup.scene, setup.numerics, setup.watch).history
    core = simulate(setup.scene, setup.numerics, setup.watch)
    assert np.abs(engine.v - core.v).max() <= 1e-12
    assert np.abs(engine.x - core.x).max() <= 1e-12


@needs_esys
def test_contact_forces_that_its_momenta_contradict_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The check of every sample, seen failing: the driver believes in another stiffness than ESyS-Particle got."""
    text = adapter.DRIVER.read_text()
    altered = text.replace("float(self.kn * overlap[k])", "float(1.000001 * self.kn * overlap[k])")
    assert altered != text
    (tmp_path / "drivers").mkdir()
    (tmp_path / "planted").mkdir()
    parts = adapter.DRIVER.parents[1] / "drivers" / "driver_parts.py"
    (tmp_path / "drivers" / parts.name).write_text(parts.read_text())
    (tmp_path / "planted" / "driver.py").write_text(altered)
    monkeypatch.setattr(EsysParticle, "driver", tmp_path / "planted" / "driver.py")
    setup = variant("nine-disk/compression", settle_cycles=0)
    with pytest.raises(EngineError, match=r"at step \d+ the contact forces .* differ by .* N"):
        EsysParticle().run(setup.scene, setup.numerics, setup.watch)


@needs_esys
def test_two_runs_at_once_do_not_disturb_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setup = variant("nine-disk/compression", settle_cycles=0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with ThreadPoolExecutor(2) as pool:
        one, two = pool.map(lambda _: EsysParticle().run(setup.scene, setup.numerics, setup.watch).history, range(2))
    np.testing.assert_array_equal(one.fn, two.fn)
    assert one.fn.max() > 0.0
    assert list(tmp_path.iterdir()) == []


@needs_esys
def test_run_stopped_half_way_is_a_timeout_and_leaves_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """mpirun puts its processes into groups of their own: they must end when it is killed."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    setup, engine = variant("nine-disk/compression"), EsysParticle()
    engine.time_limit = 3.0
    numerics = setup.numerics.replace(n_steps=200_000, sample_every=200_000)
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(engine.run, setup.scene, numerics, [])
        while "esysparticle" not in (seen := processes(tmp_path)) and not running.done():
            time.sleep(0.05)
        assert {"mpirun", "esysparticle"} <= set(seen)
        with pytest.raises(EngineTimeoutError, match=r"was stopped at its time limit of 3 s"):
            running.result()
    deadline = time.monotonic() + 10.0
    while mine := processes(tmp_path):
        assert time.monotonic() < deadline, mine
        time.sleep(0.1)


@needs_esys
def test_crash_inside_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "crash.py").write_text("import os\nos.kill(os.getpid(), 11)\n")
    monkeypatch.setattr(EsysParticle, "driver", tmp_path / "crash.py")
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineError, match=r"mpirun ended with status 1.*(\n.*)*signal 11"):
        EsysParticle().run(setup.scene, setup.numerics, [])


@needs_esys
def test_step_beyond_the_critical_one_is_the_users_mistake() -> None:
    scene = variant("nine-disk/compression").scene
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        EsysParticle().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_esys
def test_scene_without_disks_is_an_error() -> None:
    scene = Scene(disks=Disks(x=np.empty((0, 2)), radius=1.0, mass=1.0), disk_disk=ContactLaw(kn=1.0))  # type: ignore[arg-type]
    with pytest.raises(EngineError, match="there is no disk"):
        EsysParticle().run(scene, Numerics(dt=1.0, n_steps=1, contact_dt=1.0), [])


@needs_esys
def test_info_and_settings_of_the_real_one() -> None:
    info = EsysParticle().info()
    assert info.licence == "Apache-2.0"
    setup = variant("nine-disk/compression")
    settings = EsysParticle().run(setup.scene, Numerics(dt=0.01, n_steps=1), setup.watch).settings
    assert settings["engine_version"] == info.version
    assert settings["grid spacing [m]"] == 125.0
    assert settings["contact_dt"] * settings["contact_steps_per_dt"] == pytest.approx(0.01)


def test_smooth_scenes_only() -> None:
    setup = variant("nine-disk/compression")
    answer = EsysParticle().supports(setup.scene, setup.numerics)
    assert (answer.level, answer.notes) == (SupportLevel.EXACT, (adapter.NOTE_SLIP, adapter.NOTE_FORCES))
    rough = variant("nine-disk/compression", wall_mu="mu")
    answer = EsysParticle().supports(rough.scene, rough.numerics)
    assert answer.level is SupportLevel.NO
    assert {Capability.FRICTION, Capability.SHEAR_SPRING} <= set(answer.missing)
    pushed = setup.scene.replace(gravity=(0.0, -1.0))
    assert Capability.FRICTION in EsysParticle().supports(pushed, setup.numerics).missing
    plastic = variant("binary-collision", kind="plastic")
    answer = EsysParticle().supports(plastic.scene, plastic.numerics)
    assert (answer.missing, answer.notes) == ((Capability.CONTACT_DAMPING,), (adapter.NOTE_DASHPOT,))
    spun = Scene(disks=Disks(x=[(0.0, 0.0)], radius=1.0, mass=1.0, omega=2.0), disk_disk=ContactLaw(kn=1.0))  # type: ignore[arg-type]
    answer = EsysParticle().supports(spun, Numerics(dt=1.0, n_steps=1))
    assert (answer.missing, answer.notes) == ((Capability.DISK_INERTIA,), (adapter.NOTE_SPIN,))
    turning = variant("nine-disk/distortion", wall_mu=0.0, phi_deg=0.0)
    assert EsysParticle().supports(turning.scene, turning.numerics).missing == (Capability.ROTATING_WALLS,)


def test_missing_program_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    info = EsysParticle().info()
    assert not info.installed
    setup = variant("nine-disk/compression")
    with pytest.raises(EngineNotInstalledError, match=r"no command `esysparticle` on PATH\): apt-get install esys"):
        EsysParticle().run(setup.scene, setup.numerics, [])


@pytest.mark.parametrize(
    ("code", "reason"),
    [("raise ImportError('gone')", "cannot import it: ImportError: gone"), ("pass", "prints no version")],
)
def test_broken_package_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, reason: str
) -> None:
    for name in adapter.PROGRAMS:
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(adapter, "VERSION", code)
    info = EsysParticle().info()
    assert not info.installed
    assert reason in info.not_installed_because
