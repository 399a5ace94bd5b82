"""The pymunk adapter: how scenes are expressed, sign conventions, what is refused."""

from __future__ import annotations

import builtins
import math
import sys

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, SupportLevel
from ninedisk.harness.engines.pymunk import adapter as adapter
from ninedisk.harness.engines.pymunk.adapter import ENGINE

G = 10.0


def rigid(mu=0.0, restitution=0.0) -> ContactLaw:
    """Law of a contact whose springs only regularise it."""
    return ContactLaw(kn=1e8, ks=1e8, mu=mu, restitution=restitution, regularised=True)


def on_plane(law, *, degrees=0.0, slope=0.0, sink=0.0, motion=(), rotating=False, v=(0.0, 0.0)) -> Scene:
    """A disk of radius 1/2 and mass 2 that touches a plane; everything turned by ``degrees``, gravity by ``slope`` [rad] more."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    foot = np.array([3.0, 2.0]) if degrees else np.zeros(2)
    return Scene(
        disks=Disks(
            x=[foot + turn @ [0.0, 0.5 - sink]], v=[turn @ np.array(v)], radius=0.5, mass=2.0, rotating=rotating
        ),
        disk_disk=rigid(),
        walls=(Wall(name="plane", point=tuple(foot), normal=tuple(turn @ [0.0, 1.0]), law=law, motion=motion),),
        gravity=tuple(turn @ [G * math.sin(slope), -G * math.cos(slope)]),
    )


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    numerics = Numerics(dt=dt, n_steps=n_steps, options={f"pymunk.{name}": value for name, value in options.items()})
    return ENGINE.run(scene, numerics, watch)


@pytest.mark.parametrize(
    ("form", "missing"),
    [("central", Capability.GLOBAL_DAMPING_CENTRAL), ("lagged", Capability.GLOBAL_DAMPING_LAGGED)],
)
def test_global_damping_is_refused(form, missing):
    scene = on_plane(rigid()).replace(xi=3.0)
    assert ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1, damping_form=form)).missing == (missing,)


def test_preload_of_regularising_springs_is_left_out_and_said():
    scene = on_plane(rigid(mu=0.5), sink=1e-6).replace(initial_shear={(0, 1): -3.0})
    support = ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1))
    assert support.level is SupportLevel.EQUIVALENT
    assert "preload" in support.notes[0]
    history = run(scene, 5).history
    np.testing.assert_array_equal(history.gap[:, 0], 0.0)
    np.testing.assert_array_equal(history.x[:, 0, 1], 0.5)


def test_preload_of_springs_that_matter_is_not():
    law = ContactLaw(kn=1e6, ks=1e6, mu=0.5)
    scene = on_plane(law).replace(initial_shear={(0, 1): -3.0})
    assert Capability.PRELOAD in ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1)).missing


def test_a_scene_without_restitution_is_said():
    scene = on_plane(ContactLaw(kn=1e8, regularised=True))
    support = ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1))
    assert support.level is SupportLevel.EQUIVALENT
    assert "restitution" in support.notes[0]
    assert ENGINE.supports(on_plane(rigid()), Numerics(dt=0.01, n_steps=1)).level is SupportLevel.EXACT


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("iterations", [1, 100])
def test_oblique_impact_of_two_disks(restitution, iterations):
    line = np.array([0.6, 0.8])
    disks = Disks(
        x=[[0.0, 0.0], 2.0 * line + 1e-3], v=[line + np.array([-0.8, 0.6]), [0.0, 0.0]], radius=1.0, mass=[1.0, 3.0]
    )
    history = run(Scene(disks=disks, disk_disk=rigid(restitution=restitution)), 3, iterations=iterations).history
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    apart = history.x[hit, 1] - history.x[hit, 0]
    normal = apart / np.hypot(*apart)
    approach = (disks.v[0] - disks.v[1]) @ normal
    assert (history.v[-1, 1] - history.v[-1, 0]) @ normal == pytest.approx(restitution * approach, abs=1e-12)
    np.testing.assert_allclose(history.v[-1, 0] + 3.0 * history.v[-1, 1], disks.v[0], atol=1e-13)
    impulse = history.fn[hit, 0] * 0.01
    assert impulse == pytest.approx((1.0 + restitution) * approach * 0.75, rel=1e-12)


def test_a_stack_carries_its_weight():
    disks = Disks(x=[[0.0, 0.5], [0.0, 1.5], [0.0, 2.5]], radius=0.5, mass=[1.0, 2.0, 3.0])
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.5))
    scene = Scene(disks=disks, disk_disk=rigid(mu=0.5), walls=(floor,), gravity=(0.0, -G))
    watch = ((0, 3), (0, 1), (1, 2))
    converged = run(scene, 20, watch=watch).history
    np.testing.assert_allclose(converged.fn[-1], [60.0, 50.0, 30.0], rtol=1e-9)
    np.testing.assert_allclose(converged.gap, 0.0, atol=1e-8)  # what 100 iterations leave of the first step's weights
    few = run(scene, 1, watch=watch, iterations=2).history
    assert np.abs(few.fn[1] - [60.0, 50.0, 30.0]).max() > 1.0


def test_a_run_too_long_for_any_wall_is_refused():
    with pytest.raises(EngineError, match="no finite length"):
        run(on_plane(rigid(), v=(1e308, 0.0)), 50, dt=10.0)


def test_without_pymunk_the_adapter_says_how_to_get_it(monkeypatch):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "pymunk":
            raise ImportError("No module named 'pymunk'")
        return real(name, *args, **kwargs)

    monkeypatch.delitem(sys.modules, "ninedisk.harness.engines.pymunk.session", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(EngineNotInstalledError, match="pip install pymunk"):
        run(on_plane(rigid()), 1)

    monkeypatch.setattr(adapter, "package_version", lambda name: (None, f"there is no Python package {name}"))
    assert not ENGINE.info().installed
    assert "pymunk" in ENGINE.info().not_installed_because
