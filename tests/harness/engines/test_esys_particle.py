"""The ESyS-Particle adapter: what it claims, and that what ESyS-Particle computes is the scene that was sent.

Runs of the real ESyS-Particle are held against exact time-discrete solutions and the in-house DEM, which shares no code with it;
they are skipped only where ESyS-Particle is absent.
"""

from __future__ import annotations

import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from ninedisk_tests_comparison import variant, worst

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.core.simulate import simulate
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, EngineTimeoutError, SupportLevel
from ninedisk.harness.engines.esys_particle import adapter as adapter
from ninedisk.harness.engines.esys_particle.adapter import EsysParticle

needs_esys = pytest.mark.skipif(
    not EsysParticle().info().installed, reason="ESyS-Particle is not installed: apt-get install esys-particle"
)


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
def test_forces_on_spheres_that_its_contacts_cannot_make_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The check of every sample in 3D, seen failing: the driver takes no shear force off."""
    folder, own = tmp_path / "esys_particle", adapter.DRIVER.parent
    shutil.copytree(own, folder)
    shutil.copytree(own.parent / "drivers", tmp_path / "drivers")
    text = adapter.DRIVER.read_text()
    altered = text.replace("rest[body] -= sign", "rest[body] -= 0.0 * sign")
    assert altered != text
    (folder / "driver.py").write_text(altered)
    monkeypatch.setattr(EsysParticle, "driver", folder / "driver.py")
    setup = variant("spheres/turned", kind="passed")
    with pytest.raises(EngineError, match=r"at step 1 ESyS-Particle pushes spheres otherwise .* N are left"):
        EsysParticle().run(setup.scene, setup.numerics, setup.watch)


@needs_esys
def test_run_stopped_halfway_is_a_timeout_and_leaves_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """mpirun puts its processes into their own groups: they must end when it is killed."""
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
    deadline = time.monotonic() + 30.0
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
