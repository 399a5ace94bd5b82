"""The Box2D adapter: units, pair coefficients, sign conventions, and single precision's round-off against exact steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import ContactLaw, Disks, Scene, Wall
from ninedisk.harness import run_case
from ninedisk.harness.api.engine import EngineError, run_session
from ninedisk.harness.engines.box2d.adapter import ENGINE, Box2DEngine

G = 10.0
EPS = float(np.finfo(np.float32).eps)

needs_box2d = pytest.mark.skipif(not ENGINE.info().installed, reason=f"Box2D: {ENGINE.info().not_installed_because}")


def rigid(mu=0.0, restitution=0.0) -> ContactLaw:
    return ContactLaw(kn=1e8, ks=1e8, mu=mu, restitution=restitution, regularised=True)


def on_plane(law, *, degrees=0.0, slope=0.0, scale=1.0, g=G, motion=(), rotating=False, v=(0.0, 0.0), omega=0.0):
    """A disk of radius ``scale``/2 and mass 2 that touches a plane; all turned by ``degrees``, gravity by ``slope`` more."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    foot = np.array([3.0, 2.0]) * scale if degrees else np.zeros(2)
    return Scene(
        disks=Disks(
            x=[foot + turn @ [0.0, 0.5 * scale]],
            v=[turn @ np.array(v)],
            omega=omega,
            radius=0.5 * scale,
            mass=2.0,
            rotating=rotating,
        ),
        disk_disk=rigid(),
        walls=(Wall(name="plane", point=tuple(foot), normal=tuple(turn @ [0.0, 1.0]), law=law, motion=motion),),
        gravity=tuple(turn @ [g * math.sin(slope), -g * math.cos(slope)]),
    )


def numerics(n_steps, dt=0.01, **options) -> Numerics:
    return Numerics(dt=dt, n_steps=n_steps, options={f"box2d.{name}": value for name, value in options.items()})


def run(scene, n_steps=100, *, dt=0.01, watch=((0, 1),), **options):
    """Run in this process: what is tested is the session; the process around it has its own tests."""
    from ninedisk.harness.engines.box2d.session import Box2DSession

    return run_session(Box2DSession, scene, numerics(n_steps, dt, **options), watch)


def errors(case, variant, truth):
    """Largest error of each quantity against one kind of truth, relative to the quantity's largest value."""
    result = run_case(case, engine="box2d", params=variant)
    assert result.status in {"pass", "fail", "known-gap"}, result.reason
    rows = result.measurements[(result.measurements.truth == truth) & (result.measurements.norm == "max")]
    assert len(rows)
    return {row.quantity: (row.abs_error, row.scale) for row in rows.itertuples()}


@needs_box2d
@pytest.mark.parametrize("dt", [0.01, 0.0025])
@pytest.mark.parametrize("mu", [0.36, 0.4])
def test_incline_is_semi_implicit_euler_to_single_precision(mu, dt):
    found = errors("incline-block", {"mu": mu, "dt": dt}, "exact-step")
    steps, weight = 1.0 / dt, 7.854 * 10.0
    pull = 10.0 * math.sin(math.radians(20.0))
    # In each step the velocity is a sum of terms of the size of pull dt, each rounded; positions are sums of velocities.
    speed = steps * EPS * (pull * dt + (0.038 if mu == 0.36 else 0.0)) + 4.0 * EPS
    assert found["vx"][0] < speed
    assert found["x"][0] < speed + steps * EPS * 0.02
    assert max(found["fn"][0], found["fs"][0]) < 4.0 * EPS * weight
    assert found["gap"][0] < 4.0 * EPS


@needs_box2d
@pytest.mark.parametrize("dt", [0.01, 0.0025])
def test_rolling_is_semi_implicit_euler_to_single_precision(dt):
    found = errors("slip-to-roll", {"mu": 0.3, "dt": dt}, "exact-step")
    steps = 1.0 / dt
    for quantity in ("x", "vx", "spin"):
        error, scale = found[quantity]
        assert error < 0.5 * steps * EPS * max(scale, 1.0)  # half a unit in the last place a step


@needs_box2d
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_collision_at_a_speed_that_box2d_would_take_as_plastic(restitution):
    # b2_velocityThreshold is 1: the case's impact of 1 m/s has its restitution only in the adapter's own units.
    found = errors("binary-collision", {"kind": "elastic", "restitution": restitution}, "analytic")
    assert max(found[name][0] for name in ("vx_1", "vx_2", "energy", "momentum_x")) < 4.0 * EPS


@needs_box2d
def test_without_own_units_the_impact_is_plastic(monkeypatch):
    from ninedisk.harness.engines.box2d import session as box2d_session

    monkeypatch.setattr(box2d_session, "units_of", lambda *_: box2d_session.Units(length=1.0, time=1.0, mass=1.0))
    scene = on_plane(rigid(restitution=1.0), v=(0.0, -0.9), g=0.0)
    assert abs(run(scene, 5).history.v[-1, 0, 1]) < 1e-6
    monkeypatch.undo()
    assert run(scene, 5).history.v[-1, 0, 1] == pytest.approx(0.9, rel=4.0 * EPS)


@needs_box2d
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_units_fit_scenes_of_any_size(scale):
    scene = on_plane(rigid(mu=0.3), slope=0.5, scale=scale, g=G * scale)
    finished = run(scene)
    down = G * scale * (math.sin(0.5) - 0.3 * math.cos(0.5))
    assert finished.history.v[-1, 0, 0] == pytest.approx(down, rel=100 * EPS)
    for name in ("length", "time", "mass"):
        assert math.frexp(finished.settings[f"box2d.unit_of_{name}"])[0] == 0.5  # a power of two: nothing is rounded
    assert finished.settings["box2d.velocity_threshold"] < 1e-5 * down
    assert finished.settings["box2d.touch"] < finished.settings["box2d.linear_slop"]


@needs_box2d
def test_a_speed_that_box2d_would_cut_off_is_an_error():
    # A light disk between a heavy one and a wall: the impact throws it faster than anything was at the start.
    disks = Disks(x=[[0.0, 0.0], [0.6, 0.0]], v=[[10.0, 0.0], [0.0, 0.0]], radius=[0.3, 0.25], mass=[1e3, 1e-3])
    wall = Wall(name="wall", point=(1.5, 0.0), normal=(-1.0, 0.0), law=rigid(restitution=1.0))
    scene = Scene(disks=disks, disk_disk=rigid(restitution=1.0), walls=(wall,))
    with pytest.raises(EngineError, match="cuts velocities off"):
        run(scene, 60, watch=())
    with pytest.raises(EngineError, match="cuts spins off"):
        run(on_plane(rigid(), rotating=True, omega=200.0), 1)


@needs_box2d
def test_a_crash_is_an_error_and_not_the_end(monkeypatch, tmp_path):
    (tmp_path / "crashing.py").write_text("import os\ndef session(*_): os.abort()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(Box2DEngine, "session", "crashing:session")
    with pytest.raises(EngineError, match=r"SIGABRT|signal"):
        ENGINE.run(on_plane(rigid()), numerics(1), [])
