"""The Bullet adapter: exact steps, pair coefficients, signs, and what its own settings would spoil."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness import run_case
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel, run_session
from ninedisk.harness.engines import lengths
from ninedisk.harness.engines.bullet import adapter as adapter
from ninedisk.harness.engines.bullet.adapter import ENGINE
from ninedisk.harness.engines.package import product_factors

G = 10.0
INFO = ENGINE.info()
needs_bullet = pytest.mark.skipif(not INFO.installed, reason=f"Bullet: {INFO.not_installed_because}")


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"bullet.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    """Run in this process: what is tested is the session; the process around it has its own tests."""
    from ninedisk.harness.engines.bullet.session import BulletSession

    return run_session(BulletSession, scene, numerics(n_steps, dt, **options), watch)


def test_what_is_refused_is_named(rigid, on_plane):
    stiff = ContactLaw(kn=1e6, ks=1e6, mu=0.3, beta=0.1)
    missing = ENGINE.supports(on_plane(stiff), numerics(1)).missing
    assert {Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(missing)
    damped = on_plane(rigid()).replace(xi=3.0)
    assert ENGINE.supports(damped, numerics(1)).missing == (Capability.GLOBAL_DAMPING_CENTRAL,)
    rough = ENGINE.supports(on_plane(rigid(mu=11.0)), numerics(1))
    assert rough.level is SupportLevel.NO
    assert "caps the friction of a pair at 10, the scene has 11" in rough.notes[0]
    assert ENGINE.supports(on_plane(rigid(mu=10.0)), numerics(1)).level is SupportLevel.EXACT
    assert ENGINE.supports(on_plane(rigid(restitution=None)), numerics(1)).level is SupportLevel.EQUIVALENT


def test_factors_multiply_to_the_pairs_coefficients():
    disk, walls = product_factors(0.36, [0.5, 0.0])
    np.testing.assert_allclose([disk * disk, disk * walls[0], disk * walls[1]], [0.36, 0.5, 0.0], rtol=1e-15)
    assert product_factors(None, [0.3]) == (1.0, [0.3])
    assert product_factors(0.0, [0.0]) == (0.0, [0.0])
    disk, walls = product_factors(0.0, [0.5])
    assert disk * disk <= 1.1e-16
    assert disk * walls[0] == pytest.approx(0.5, rel=1e-15)


@needs_bullet
def test_bullet_s_own_settings_would_change_the_restitution(rigid, on_plane, monkeypatch):
    scene = on_plane(rigid(restitution=1.0), v=(0.0, -1.0), height=0.0525, g=0.0)
    assert run(scene, 12, contact_erp=0.2).history.v[-1, 0, 1] > 1.05
    # Contacts from about 0.01 m on, as with Bullet's own 0.02 m.
    monkeypatch.setattr(lengths, "TOUCH_ULPS", 1e14)
    assert run(scene, 12).history.v[-1, 0, 1] < 0.9


@needs_bullet
def test_fast_bodies_are_not_slowed_down_and_angles_are_not_wrapped(rigid, on_plane):
    scene = on_plane(rigid(), v=(300.0, 0.0), height=1.0, g=0.0, rotating=True, omega=40.0)
    history = run(scene).history
    np.testing.assert_allclose(history.x[-1, 0, 0], 300.0, rtol=1e-12)
    np.testing.assert_allclose(history.angle[-1, 0], 40.0, rtol=1e-12)


@needs_bullet
@pytest.mark.parametrize("params", [{"kind": "elastic"}, {"kind": "plastic"}, {"kind": "elastic", "gap": 0.5025}])
def test_collisions_are_exact(params):
    assert run_case("binary-collision", engine="bullet", params=params).status == "pass"


@needs_bullet
@pytest.mark.parametrize("mu", [0.36, 0.4])
def test_the_incline_meets_the_exact_steps(mu):
    result = run_case("incline-block", engine="bullet", params={"mu": mu, "dt": 0.005})
    assert set(result.measurements.status) <= {"pass", "known-gap"}
    exact = result.measurements[result.measurements.truth == "exact-step"]
    assert len(exact)
    assert exact.abs_error.max() < 1e-12


@needs_bullet
def test_plastic_disks_bounce_off_an_elastic_wall(rigid):
    disks = Disks(x=[[0.0, 0.0], [1.05, 0.0]], v=[[1.0, 0.0], [0.0, 0.0]], radius=0.5, mass=2.0)
    back = Wall(name="back", point=(1.6, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=1.0))
    v = run(Scene(disks=disks, disk_disk=rigid(), walls=(back,)), 30).history.v
    assert v[10, :, 0] == pytest.approx([0.5, 0.5], abs=1e-12)
    # Newton's law at both contacts at once: the wall turns the outer disk round, the inner one must not lag behind it.
    assert v[-1, :, 0] == pytest.approx([-0.5, -0.5], abs=1e-10)
