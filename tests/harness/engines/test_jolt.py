"""The Jolt adapter: inertia, coefficients by pair, moving walls, what it cannot observe, and the settings that its own would spoil."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel, run_session
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.engines.javascript import node
from ninedisk.harness.engines.jolt.adapter import ENGINE, JoltSession

INFO = ENGINE.info()
needs_jolt = pytest.mark.skipif(not INFO.installed, reason=f"Jolt: {INFO.not_installed_because}")


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"jolt.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    return run_session(JoltSession, scene, numerics(n_steps, dt, **options), watch)


def test_what_is_refused_is_named(rigid, on_plane):
    stiff = ContactLaw(kn=1e6, ks=1e6, mu=0.3, beta=0.1)
    missing = ENGINE.supports(on_plane(stiff), numerics(1)).missing
    assert {Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(missing)
    spinning = ENGINE.supports(on_plane(rigid(), omega=1.0), numerics(1))
    assert spinning.level is SupportLevel.NO
    assert "spins at a prescribed rate" in spinning.notes[0]


def test_where_it_is_not_installed_its_cells_say_how(monkeypatch, tmp_path):
    monkeypatch.setattr(node, "FOLDER", tmp_path)
    node.npm_version.cache_clear()
    try:
        result = run_case("binary-collision", engine="jolt")
    finally:
        node.npm_version.cache_clear()
    assert result.status == "not-installed"
    assert "python -m ninedisk.harness.engines.javascript.node" in result.reason


@needs_jolt
def test_contact_forces_are_not_observed_and_no_failure():
    result = run_case("incline-block", engine="jolt", params={"mu": 0.36, "dt": 0.005})
    status = result.measurements.set_index(["quantity", "truth"]).status
    assert status["fn", "analytic"] == "not-observed"
    assert status["x", "exact-step"] == "pass"
    assert result.status == "pass"


@needs_jolt
@pytest.mark.parametrize(
    ("case", "params"),
    [
        ("binary-collision", {"kind": "elastic"}),
        ("binary-collision", {"kind": "plastic"}),
        ("slip-to-roll", {"mu": 0.3, "dt": 0.01}),
        ("contact/belt", {}),
    ],
)
def test_it_passes(case, params):
    assert run_case(case, engine="jolt", params=params).status in ("pass", "known-gap")


@needs_jolt
def test_the_inertia_of_small_bodies_is_their_own(rigid):
    """With Jolt's own, a disk of 5 g and 1 cm would turn as one of 1 m."""
    law = rigid(mu=0.5)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    disk = Disks(x=[[0.0, 0.005]], v=[[0.1, 0.0]], radius=0.005, mass=5e-3)
    scene = Scene(disks=disk, disk_disk=law, walls=(floor,), gravity=(0.0, -9.81))
    history = run(scene, 200, dt=1e-3).history
    assert history.v[-1, 0, 0] == pytest.approx(0.1 * 2.0 / 3.0, rel=1e-4)
    assert history.omega[-1, 0] == pytest.approx(-0.1 * 2.0 / 3.0 / 0.005, rel=1e-4)


@needs_jolt
def test_each_pair_has_its_own_restitution(rigid):
    disks = Disks(x=[[0.0, 0.0], [1.05, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=0.5, mass=2.0)
    back = Wall(name="back", point=(2.2, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=1.0))
    v = run(Scene(disks=disks, disk_disk=rigid(), walls=(back,)), 200).history.v
    assert v[10, :, 0] == pytest.approx([0.5, 0.5], abs=1e-5)
    assert v[-1, :, 0].sum() == pytest.approx(-1.0, abs=1e-4)


@needs_jolt
def test_its_own_settings_differ(rigid, on_plane):
    scene = on_plane(rigid(), height=2.0, g=0.0, v=(1.0, 0.0), rotating=True)
    assert run(scene).history.v[-1, 0, 0] == 1.0
    stock = run(scene, profile="stock")
    assert stock.history.v[-1, 0, 0] < 0.96  # damped by 0.05/s
    assert stock.settings["jolt.mLinearDamping"] == pytest.approx(0.05)
    assert get_engine("jolt-stock").info().profile == "stock"


@needs_jolt
def test_a_script_that_fails_is_an_engine_error(rigid, on_plane, monkeypatch):
    from ninedisk.harness.api.engine import EngineError

    monkeypatch.setattr(JoltSession, "module", "no-such-engine.mjs")
    with pytest.raises(EngineError, match=r"Jolt: .*no-such-engine"):
        run(on_plane(rigid()))


@needs_jolt
def test_time_of_the_processor_is_that_of_its_own_process(rigid, on_plane):
    timings = run(on_plane(rigid()), 2000).timings
    assert timings.cpu is not None
    assert timings.cpu > 0.2 * timings.advance
    assert np.isfinite(timings.cpu)
