"""The pymunk adapter: how scenes are expressed, sign conventions, what is refused."""

from __future__ import annotations

import builtins
import math
import sys

import numpy as np
import pytest

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall, WallSegment
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import Engine, EngineError, EngineNotInstalledError, SupportLevel
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


def test_facts():
    info = ENGINE.info()
    assert isinstance(ENGINE, Engine)
    assert info.installed
    assert (info.scheme, info.contact, info.licence) == ("position-first-euler", "impulse", "MIT")
    assert Capability.LINEAR_CONTACT not in info.capabilities


def test_a_stiffness_that_matters_is_refused_by_name():
    stiff = ContactLaw(kn=1e6, ks=1e6, mu=0.3, beta=0.1)
    support = ENGINE.supports(on_plane(stiff), Numerics(dt=0.01, n_steps=1))
    assert support.level is SupportLevel.NO
    assert {Capability.LINEAR_CONTACT, Capability.SHEAR_SPRING, Capability.CONTACT_DAMPING} <= set(support.missing)


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


@pytest.mark.parametrize("degrees", [*range(0, 360, 15), 7.3, 111.1])
def test_a_touching_disk_is_in_contact_from_the_first_step(degrees):
    slope, mu = 0.5, 0.3
    history = run(on_plane(rigid(mu=mu), degrees=degrees, slope=slope)).history
    down = G * (math.sin(slope) - mu * math.cos(slope))
    normal = 2.0 * G * math.cos(slope)
    np.testing.assert_allclose(history.fn[1:, 0], normal, rtol=1e-12)
    np.testing.assert_allclose(history.fs[1:, 0], -mu * normal, rtol=1e-12)
    np.testing.assert_allclose(history.gap[:, 0], 0.0, atol=1e-13)
    np.testing.assert_allclose(np.hypot(*history.v[-1, 0]), down * 1.0, rtol=1e-12)


def test_forces_follow_the_scene_s_signs_and_are_step_means():
    history = run(on_plane(rigid(mu=0.4), v=(-1.0, 0.0)), 3).history
    assert history.force_meaning == "step-mean"
    assert np.isnan(history.fn[0, 0])
    assert np.isnan(history.fs[0, 0])
    # n points from the disk down into the wall, t = +x; the disk slides to the left, friction pushes it to the right.
    assert history.fn[1, 0] == pytest.approx(20.0, rel=1e-13)
    assert history.fs[1, 0] == pytest.approx(8.0, rel=1e-13)
    np.testing.assert_allclose(history.wall_force[1, 0], [-8.0, -20.0], rtol=1e-13)
    np.testing.assert_allclose(history.v[1, 0], [-1.0 + 0.4 * G * 0.01, 0.0], atol=1e-14)


def test_each_pair_has_its_own_friction_and_restitution():
    # Two disks in a row between walls that all differ: no product of one coefficient a body could give these.
    disks = Disks(x=[[0.0, 0.5], [3.0, 0.5]], v=[[4.0, 0.0], [0.0, 0.0]], radius=0.5, mass=[2.0, 3.0], rotating=False)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.25))
    back = Wall(name="back", point=(3.7, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=0.8))
    scene = Scene(disks=disks, disk_disk=rigid(restitution=0.3), walls=(floor, back), gravity=(0.0, -G))
    history = run(scene, 400, dt=0.0025, watch=((0, 1), (0, 2), (1, 2), (1, 3))).history
    speed = history.v[:, :, 0]
    hit = int(np.flatnonzero(history.fn[:, 0] > 0)[0])
    before, after = speed[hit - 1], speed[hit]
    fall = 0.25 * G * 0.0025
    assert before[0] - speed[0, 0] == pytest.approx(-(hit - 1) * fall, rel=1e-9)
    assert (after[1] - after[0]) / (before[0] - before[1]) == pytest.approx(0.3, abs=0.02)
    turn = int(np.flatnonzero(history.fn[:, 3] > 0)[0])
    assert -speed[turn, 1] / speed[turn - 1, 1] == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_restitution_of_a_wall(restitution):
    scene = on_plane(rigid(restitution=restitution), v=(0.0, -2.0)).replace(gravity=(0.0, 0.0))
    assert run(scene, 5).history.v[-1, 0, 1] == pytest.approx(2.0 * restitution, abs=1e-12)


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


def test_moving_walls_reach_their_exact_pose():
    motion = (
        WallSegment(duration=0.25, velocity=(0.3, 0.2)),
        WallSegment(duration=0.25, amplitude=(0.0, 0.05), frequency=3.0),
    )
    history = run(on_plane(rigid(mu=2.0), motion=motion), 60).history
    np.testing.assert_allclose(history.wall_point[25, 0], [0.075, 0.05], atol=1e-14)
    np.testing.assert_allclose(history.wall_point[-1, 0], [0.075, 0.05 + 0.05 * math.sin(0.75)], atol=1e-14)
    # The first step sinks the wall's v dt into the disk; from the second on the disk rides on it.
    np.testing.assert_allclose(history.v[5:25, 0], [[0.3, 0.2]] * 20, atol=1e-12)
    np.testing.assert_allclose(history.gap[2:25, 0], 0.0, atol=1e-12)


def test_a_turning_wall_reaches_its_exact_pose():
    motion = (WallSegment(angular_velocity=0.5, pivot=(-1.0, 0.0)),)
    history = run(on_plane(rigid(mu=2.0), motion=motion), 40).history
    np.testing.assert_allclose(history.wall_angle[:, 0], math.pi / 2 + 0.5 * history.t, atol=1e-14)
    np.testing.assert_allclose(history.wall_point[-1, 0], [-1.0 + math.cos(0.2), math.sin(0.2)], atol=1e-14)
    assert np.abs(history.gap[2:, 0]).max() < 0.5 * 0.01 * 0.5 * 1.5 * 0.01


def test_disks_that_cannot_turn_keep_their_spin():
    disks = Disks(
        x=[[0.0, 0.5], [5.0, 0.5]], v=[[1.0, 0.0]] * 2, omega=[0.0, 0.7], radius=0.5, mass=1.0, rotating=[True, False]
    )
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=rigid(mu=0.3))
    omega = run(Scene(disks=disks, disk_disk=rigid(), walls=(floor,), gravity=(0.0, -G)), watch=()).history.omega
    np.testing.assert_array_equal(omega[:, 1], 0.7)
    assert omega[-1, 0] == pytest.approx(-2.0 / 3.0 / 0.5, rel=1e-12)


def test_settings_are_recorded_and_runs_repeat_to_the_bit():
    one, two = (
        run(on_plane(rigid(mu=0.3), slope=0.5, degrees=33.0), 50, iterations=7, collision_bias=0.5) for _ in range(2)
    )
    assert one.settings["pymunk.iterations"] == 7
    assert one.settings["pymunk.collision_bias"] == 0.5
    assert 0.0 < one.settings["pymunk.collision_slop"] < 1e-11
    np.testing.assert_array_equal(one.history.x, two.history.x)
    assert one.timings.advance > 0.0


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"iterations": 0}, "pymunk.iterations = 0"),
        ({"iterations": 2.5}, "pymunk.iterations = 2.5"),
        ({"collision_bias": 2.0}, r"a number in \[0, 1\]"),
        ({"slop": 1.0}, "'pymunk.slop' is unknown"),
    ],
)
def test_bad_settings_are_refused(option, words):
    with pytest.raises(InvalidNumericsError, match=words):
        run(on_plane(rigid()), 1, **option)


def test_settings_of_other_engines_are_left_alone():
    numerics = Numerics(dt=0.01, n_steps=1, options={"yade.threads": 2})
    assert ENGINE.run(on_plane(rigid()), numerics, []).history.x.shape == (2, 1, 2)


def test_a_state_that_is_no_longer_finite_is_an_error(monkeypatch):
    from ninedisk.harness.engines.pymunk.session import PymunkSession

    def explode(self, _n_steps):
        self.disks[0].velocity = (math.inf, 0.0)

    monkeypatch.setattr(PymunkSession, "advance", explode)
    with pytest.raises(EngineError, match="no longer finite"):
        run(on_plane(rigid()), 2)


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
