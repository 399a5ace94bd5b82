"""The pymunk adapter: how scenes are expressed, sign conventions, what is refused."""

from __future__ import annotations

import builtins
import sys

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, SupportLevel
from ninedisk.harness.engines.pymunk import adapter as adapter
from ninedisk.harness.engines.pymunk.adapter import ENGINE


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    numerics = Numerics(dt=dt, n_steps=n_steps, options={f"pymunk.{name}": value for name, value in options.items()})
    return ENGINE.run(scene, numerics, watch)


@pytest.mark.parametrize(
    ("form", "missing"),
    [("central", Capability.GLOBAL_DAMPING_CENTRAL), ("lagged", Capability.GLOBAL_DAMPING_LAGGED)],
)
def test_global_damping_is_refused(form, missing, rigid, on_plane):
    scene = on_plane(rigid()).replace(xi=3.0)
    assert ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1, damping_form=form)).missing == (missing,)


def test_preload_of_regularising_springs_is_left_out_and_said(rigid, on_plane):
    scene = on_plane(rigid(mu=0.5), height=-1e-6).replace(initial_shear={(0, 1): -3.0})
    support = ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1))
    assert support.level is SupportLevel.EQUIVALENT
    assert "preload" in support.notes[0]
    history = run(scene, 5).history
    np.testing.assert_array_equal(history.gap[:, 0], 0.0)
    np.testing.assert_array_equal(history.x[:, 0, 1], 0.5)


def test_preload_of_springs_that_matter_is_not(on_plane):
    law = ContactLaw(kn=1e6, ks=1e6, mu=0.5)
    scene = on_plane(law).replace(initial_shear={(0, 1): -3.0})
    assert Capability.PRELOAD in ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1)).missing


def test_a_scene_without_restitution_is_said(rigid, on_plane):
    scene = on_plane(ContactLaw(kn=1e8, regularised=True))
    support = ENGINE.supports(scene, Numerics(dt=0.01, n_steps=1))
    assert support.level is SupportLevel.EQUIVALENT
    assert "restitution" in support.notes[0]
    assert ENGINE.supports(on_plane(rigid()), Numerics(dt=0.01, n_steps=1)).level is SupportLevel.EXACT


def test_a_run_too_long_for_any_wall_is_refused(rigid, on_plane):
    with pytest.raises(EngineError, match="no finite length"):
        run(on_plane(rigid(), v=(1e308, 0.0)), 50, dt=10.0)


def test_without_pymunk_the_adapter_says_how_to_get_it(rigid, on_plane, monkeypatch):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "pymunk":
            raise ImportError("No module named 'pymunk'")
        return real(name, *args, **kwargs)

    monkeypatch.delitem(sys.modules, "ninedisk.harness.engines.pymunk.session", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(EngineNotInstalledError, match="pip install pymunk"):
        run(on_plane(rigid()), 1)
