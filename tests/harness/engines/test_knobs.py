"""Knobs of engines at their own settings: declared values are the engines' own, and act as a script or a formula says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from ninedisk.core import ContactLaw, Disks, InvalidNumericsError, Numerics, Scene
from ninedisk.core.scene import Wall
from ninedisk.harness.api.registry import STOCK_ENGINES, get_engine

MASS, RADIUS, G, STEP = 3.0, 0.5, 9.81, 0.02


def disk(
    height: float, *, speed: float = 0.0, mu: float = 0.0, e: float = 0.5, slope: float = 0.0, g: float = G
) -> Scene:
    """A disk that cannot turn, ``height`` above a plane under tilted gravity."""
    law = ContactLaw(kn=1e7, mu=mu, restitution=e, regularised=True)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    body = Disks(x=[[0.0, RADIUS + height]], v=[[speed, 0.0]], radius=RADIUS, mass=MASS, rotating=False)
    return Scene(disks=body, disk_disk=law, walls=(floor,), gravity=(g * math.sin(slope), -g * math.cos(slope)))


def run(engine_id: str, scene: Scene, n_steps: int = 50, dt: float = STEP, **knobs: Any) -> Any:
    """History at the engine's own settings but for these knobs."""
    engine: Any = get_engine(engine_id)
    if not engine.info().installed:
        pytest.skip(f"{engine_id} is not installed")
    options = {f"{engine_id}.{name}": value for name, value in knobs.items()}
    return engine.run(scene, Numerics(dt=dt, n_steps=n_steps, options=options), ()).history


@pytest.mark.parametrize("engine_id", STOCK_ENGINES)
def test_ladders_lead_from_the_engines_own_value_through_allowed_ones(engine_id: str) -> None:
    engine: Any = get_engine(engine_id)
    assert engine.knobs
    assert list(engine.info().options) == ["step", *engine.knobs]
    for name, knob in engine.knobs.items():
        assert [knob.checked(name, value) for value in knob.values] == list(knob.values)
        assert len(set(knob.values)) == len(knob.values) > 1
        if not knob.choices:
            away = np.diff(knob.values)
            assert (away > 0.0).all() or (away < 0.0).all(), f"{name} turns back"
            assert (away > 0.0).all() or not knob.dear, f"{name} costs less with each value"


@pytest.mark.parametrize("engine_id", STOCK_ENGINES)
def test_values_declared_as_the_engines_own_are(engine_id: str) -> None:
    engine: Any = get_engine(engine_id)
    scene = disk(2.0, speed=1.0, mu=0.3)  # meets the floor at 6 m/s: a step ends in an overlap of 0.12 m
    plain = run(engine_id, scene)
    given = run(engine_id, scene, **{name: knob.default for name, knob in engine.knobs.items()})
    other = run(engine_id, scene, **{name: knob.ladder[0] for name, knob in engine.knobs.items()})
    # Bullet keeps its damping as 0.04f, 9e-10 above 0.04: at 6 m/s that takes 4e-8 m/s each second, and the time of the impact with it.
    assert np.abs(given.x - plain.x).max() < (1e-6 if engine_id == "bullet-stock" else 1e-12)
    assert np.abs(other.x - plain.x).max() > 1e-6


def test_values_that_are_not_allowed_are_refused() -> None:
    with pytest.raises(InvalidNumericsError, match=r"pymunk-stock\.iterations = 0 is not allowed"):
        run("pymunk-stock", disk(0.2), iterations=0)
    with pytest.raises(InvalidNumericsError, match=r"pymunk-stock\.sweeps' is unknown: use one of pymunk-stock\.step"):
        run("pymunk-stock", disk(0.2), sweeps=3)
    with pytest.raises(InvalidNumericsError, match=r"pymunk-stock\.step = 0"):
        run("pymunk-stock", disk(0.2), step=0.0)


@pytest.mark.parametrize(("slop", "bias"), [(0.1, 0.9**60), (1e-3, 1e-6)])
def test_pymunk_does_what_its_own_script_does(slop: float, bias: float) -> None:
    pymunk = pytest.importorskip("pymunk")
    space = pymunk.Space()
    space.gravity, space.collision_slop, space.collision_bias = (0.0, -G), slop, bias
    space.iterations, space.collision_persistence = 30, 1
    body = pymunk.Body(MASS, float("inf"))
    body.position = (0.0, RADIUS + 0.2)
    circle = pymunk.Circle(body, RADIUS)
    ground = pymunk.Poly(space.static_body, [(-99, -99), (99, -99), (99, 0), (-99, 0)])
    circle.elasticity, ground.elasticity = 1.0, 0.5
    space.add(body, circle, ground)
    for _ in range(200):
        space.step(0.005)
    knobs = {"collision_slop": slop, "collision_bias": bias, "iterations": 30, "collision_persistence": 1}
    history = run("pymunk-stock", disk(0.2), step=0.005, **knobs)
    assert history.x[-1, 0, 1] == pytest.approx(body.position.y, abs=1e-12)


@pytest.mark.parametrize(
    "knobs", [{}, {"impedance": 0.9999, "step": 5e-4}, {"cone": "elliptic", "impratio": 100.0, "solref_time": 0.01}]
)
def test_mujoco_does_what_its_own_script_does(knobs: Mapping[str, Any]) -> None:
    mujoco = pytest.importorskip("mujoco")
    slope, mu = math.radians(20.0), 0.36
    least, step = knobs.get("impedance", 0.9), knobs.get("step", 2e-3)
    time = knobs.get("solref_time", 0.02)
    text = f"""<mujoco><option timestep="{step}" cone="{knobs.get("cone", "pyramidal")}" impratio="{knobs.get("impratio", 1)}"
      gravity="{G * math.sin(slope)} {-G * math.cos(slope)} 0"/>
      <default><geom friction="{mu} 0.005 0.0001" solref="{time} 1" solimp="{least} {max(least, 0.95)}"/></default>
      <worldbody><geom type="plane" size="0 0 1" xyaxes="0 0 1 1 0 0"/>
      <body pos="0 {RADIUS} 0"><inertial pos="0 0 0" mass="{MASS}" diaginertia="1 1 1"/>
        <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
        <geom type="sphere" size="{RADIUS}"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(1.0 / step))
    history = run("mujoco-stock", disk(0.0, mu=mu, e=0.0, slope=slope), **knobs)
    # A block that hops amplifies round-off: the solver's tolerance of 1e-8 of the weight's acceleration, over a second.
    assert history.x[-1, 0, 0] == pytest.approx(float(data.qpos[0]), abs=1e-7)
    exact = 0.5 * G * (math.sin(slope) - mu * math.cos(slope))
    error = abs(history.x[-1, 0, 0] / exact - 1.0)
    assert error < 0.01 if "impedance" in knobs else error > (0.05 if not knobs else 0.0)


@pytest.mark.parametrize("damping", [0.04, 0.0])
def test_bullets_damping_grows_with_the_speed(damping: float) -> None:
    # Its multi-bodies have dv/dt = -c (1 + v) v: v/(1 + v) falls by exp(-c t). A step of 4 ms leaves (2 c)^2 h/2 of it.
    history = run("bullet-stock", disk(50.0, speed=1.0, g=0.0), linear_damping=damping)
    left = 0.5 * math.exp(-damping)
    assert history.v[-1, 0, 0] == pytest.approx(left / (1.0 - left), abs=2e-5)


@pytest.mark.parametrize("damping", [0.05, 0.0])
def test_jolts_damping_takes_that_part_of_a_velocity_in_each_step(damping: float) -> None:
    history = run("jolt-stock", disk(50.0, speed=1.0), damping=damping, step=0.01)
    assert history.v[-1, 0, 0] == pytest.approx((1.0 - damping * 0.01) ** 100, abs=1e-5)


def test_box2d_is_plastic_below_one_of_its_units_per_second() -> None:
    scene, options = (
        disk(0.01),
        {"n_steps": 5, "dt": 0.01, "step": 1e-4},
    )  # meets the floor at 0.44 m/s, within 5 samples
    speed = {unit: run("box2d-stock", scene, **options, length_unit=unit).v[-1, 0, 1] for unit in (1.0, 0.1)}
    assert speed[1.0] == pytest.approx(0.0, abs=2e-3)
    # It meets the polygon's skin, 0.01 units thick; then it rises until the last sample.
    height = 0.01 - 0.01 * 0.1
    assert speed[0.1] == pytest.approx(
        0.5 * math.sqrt(2.0 * G * height) - G * (0.05 - math.sqrt(2.0 * height / G)), abs=3e-3
    )


@pytest.mark.parametrize("step", [1e-3, 2.5e-4])
def test_dart_falls_as_semi_implicit_euler_does(step: float) -> None:
    history = run("dart-stock", disk(50.0), step=step)
    assert history.x[-1, 0, 1] == pytest.approx(50.5 - 0.5 * G * (1.0 + step), abs=1e-9)


@pytest.mark.parametrize("engine_id", ["drake-sap-stock", "drake-lagged-stock"])
@pytest.mark.parametrize("stiffness", [1e6, 1e7])
def test_drakes_overlap_at_rest_is_that_of_two_springs_in_series(engine_id: str, stiffness: float) -> None:
    others = {"near_rigid_threshold": 0.0} if engine_id == "drake-sap-stock" else {}
    history = run(engine_id, disk(0.0, e=0.0), n_steps=100, step=2e-4, stiffness=stiffness, **others)
    assert RADIUS - history.x[-1, 0, 1] == pytest.approx(2.0 * MASS * G / stiffness, rel=1e-3)


def test_drakes_creep_is_as_its_stiction_tolerance() -> None:
    scene = disk(0.0, mu=0.5, e=0.0, slope=math.radians(20.0))
    creep = [run("drake-lagged-stock", scene, stiction_tolerance=each).v[-1, 0, 0] for each in (1e-4, 1e-5)]
    assert creep[0] / creep[1] == pytest.approx(10.0, rel=0.05)
