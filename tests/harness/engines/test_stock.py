"""Engines at their own settings: what a script of the engine alone shows, measured by headlines and never ranked with the others."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import ContactLaw, Disks, History, InvalidNumericsError, Numerics, Scene, Spheres, SphereScene
from ninedisk.core.options import read_options
from ninedisk.core.scene import PlaneWall, Wall
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineRun, SupportLevel, Timings
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.registry import STOCK_ENGINES, engine_table, get_engine
from ninedisk.harness.engines.stock import MOST_STEPS
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.runner import run_cell
from ninedisk.harness.wire.command import engines_given

SLOPE, MU, MASS = math.radians(20.0), 0.36, 3.0


def ball_on_slope(restitution: float = 0.0) -> SphereScene:
    """A ball that cannot turn, on a plane whose normal is z, pulled down the slope by gravity."""
    law = ContactLaw(kn=1e7, mu=MU, restitution=restitution, regularised=True)
    floor = PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law)
    ball = Spheres(x=[[0.0, 0.0, 0.5]], radius=0.5, mass=MASS, rotating=False)
    g = (9.81 * math.sin(SLOPE), 0.0, -9.81 * math.cos(SLOPE))
    return SphereScene(spheres=ball, sphere_sphere=law, walls=(floor,), gravity=g)


def bouncing_disk() -> Scene:
    law = ContactLaw(kn=1e7, mu=0.0, restitution=0.5, regularised=True)
    floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    return Scene(
        disks=Disks(x=[[0.0, 1.2]], radius=0.5, mass=MASS), disk_disk=law, walls=(floor,), gravity=(0.0, -9.81)
    )


@pytest.mark.parametrize("engine_id", STOCK_ENGINES)
def test_each_is_its_engine_under_another_profile(engine_id: str) -> None:
    engine = get_engine(engine_id)
    info, tuned = engine.info(), get_engine(engine_id.removesuffix("-stock")).info()
    assert (info.id, info.profile, tuned.profile) == (engine_id, "stock", "tuned")
    assert info.name == f"{tuned.name} (stock)"
    assert tuned.options["profile"].choices == ("tuned", "stock")
    assert engine_id not in engine_table()


def test_the_step_is_the_engines_own_and_samples_stay_where_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    engine: Any = get_engine("mujoco-stock")
    asked: list[Numerics] = []

    class Recording:
        def run(self, scene: Scene, numerics: Numerics, watch: Any) -> EngineRun:  # noqa: ARG002
            asked.append(numerics)
            steps = numerics.sampled_steps()
            history = History.empty(steps, steps * numerics.dt, n_disks=1, n_walls=0, pairs=())
            return EngineRun(history=history, timings=Timings(setup=0.0, warm_up=0.0, advance=0.0), settings={})

    monkeypatch.setitem(vars(engine), "tuned", Recording())
    tuned = {"mujoco.substeps": 7, "cd.threads": 2}
    numerics = Numerics(dt=0.01, n_steps=30, sample_every=4, sample_from=3, sample_until=21, options=tuned)
    run = engine.run(bouncing_disk(), numerics, ())
    assert (asked[0].dt, asked[0].n_steps) == (0.002, 150)
    assert asked[0].options == {"mujoco.profile": "stock", "cd.threads": 2}
    assert run.history.step.tolist() == numerics.sampled_steps().tolist()
    assert run.settings["own step [s]"] == 0.002
    # 3 steps of the engine in one of 5 ms: none longer than its own.
    engine.run(bouncing_disk(), numerics.replace(dt=0.005), ())
    assert asked[1].dt == pytest.approx(0.005 / 3)


def test_samples_closer_than_the_own_step_are_noted() -> None:
    scene, numerics = bouncing_disk(), Numerics(dt=0.05, n_steps=10)
    stock: Any = get_engine("pymunk-stock")
    wide, close = stock.supports(scene, numerics), stock.supports(scene, numerics.replace(dt=0.005))
    assert wide.level is close.level is SupportLevel.APPROXIMATE
    assert (
        wide.notes[0]
        == "every setting is the engine's own, its step of 0.02 s included (the example in pymunk's documentation)"
    )
    assert close.notes[0].endswith("samples each 0.005 s ask for shorter steps")


def test_what_a_plain_script_cannot_say_is_unsupported() -> None:
    stock: Any = get_engine("mujoco-stock")
    numerics = Numerics(dt=0.01, n_steps=10)
    support = stock.supports(ball_on_slope(restitution=0.5), numerics)
    assert (support.level, support.missing) == (SupportLevel.NO, (Capability.RESTITUTION,))
    assert stock.supports(ball_on_slope(), numerics).level is SupportLevel.APPROXIMATE


def test_a_scene_in_units_far_from_seconds_is_refused_at_once() -> None:
    stock: Any = get_engine("mujoco-stock")
    support = stock.supports(ball_on_slope(), Numerics(dt=1e4, n_steps=10))
    assert support.level is SupportLevel.NO
    assert f"at most {MOST_STEPS:g} are run" in support.notes[0]


def test_no_setting_is_ignored_in_silence() -> None:
    options = {"pymunk.profile": "stock", "pymunk.iterations": 20}
    with pytest.raises(InvalidNumericsError, match=r"pymunk\.iterations.*profile = stock.*drop one"):
        read_options("pymunk", get_engine("pymunk").info().options, Numerics(dt=0.1, n_steps=1, options=options))


def test_pymunk_does_what_its_own_script_does() -> None:
    pymunk = pytest.importorskip("pymunk")
    scene, numerics = bouncing_disk(), Numerics(dt=0.02, n_steps=100)
    history = get_engine("pymunk-stock").run(scene, numerics, ()).history
    space = pymunk.Space()
    space.gravity = (0.0, -9.81)
    body = pymunk.Body(MASS, float(scene.disks.inertia[0]))
    body.position = (0.0, 1.2)
    circle = pymunk.Circle(body, 0.5)
    ground = pymunk.Poly(space.static_body, [(-99, -99), (99, -99), (99, 0), (-99, 0)])
    circle.elasticity, ground.elasticity = 1.0, 0.5
    space.add(body, circle, ground)
    heights = [1.2]
    for _ in range(100):
        space.step(0.02)
        heights.append(body.position.y)
    assert history.x[:, 0, 1] == pytest.approx(heights, abs=1e-12)
    tuned = get_engine("pymunk").run(scene, numerics, ()).history
    assert np.abs(tuned.x[:, 0, 1] - heights).max() > 1e-3


def test_mujoco_does_what_its_own_script_does() -> None:
    mujoco = pytest.importorskip("mujoco")
    text = f"""<mujoco><option gravity="{9.81 * math.sin(SLOPE)} 0 {-9.81 * math.cos(SLOPE)}"/><worldbody>
      <geom type="plane" size="0 0 1" friction="{MU} 0.005 0.0001"/>
      <body pos="0 0 0.5"><inertial pos="0 0 0" mass="{MASS}" diaginertia="1 1 1"/>
        <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
        <geom type="sphere" size="0.5" friction="{MU} 0.005 0.0001"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    assert model.opt.timestep == 0.002
    data = mujoco.MjData(model)
    places = [0.0]
    for _ in range(50):
        mujoco.mj_step(model, data, nstep=5)
        places.append(float(data.qpos[0]))
    history = get_engine("mujoco-stock").run(ball_on_slope(), Numerics(dt=0.01, n_steps=50), ()).history
    assert history.x[:, 0, 0] == pytest.approx(places, abs=1e-9)
    # g (sin - mu cos) t^2/2 is what physics says; at its own settings MuJoCo is off by more than a tenth.
    truth = 0.5 * 9.81 * (math.sin(SLOPE) - MU * math.cos(SLOPE)) * 0.5**2
    assert abs(places[-1] / truth - 1.0) > 0.1


def test_bullet_does_what_its_own_script_does() -> None:
    pytest.importorskip("pybullet")
    from pybullet_utils.bullet_client import BulletClient

    world: Any = BulletClient()
    world.setGravity(9.81 * math.sin(SLOPE), 0, -9.81 * math.cos(SLOPE))
    ball = world.createMultiBody(MASS, world.createCollisionShape(2, radius=0.5), basePosition=[0, 0, 0.5])
    ground = world.createMultiBody(0, world.createCollisionShape(6, planeNormal=[0, 0, 1]))
    world.changeDynamics(ball, -1, lateralFriction=1.0, restitution=0.0, localInertiaDiagonal=[0, 0, 0])
    world.changeDynamics(ground, -1, lateralFriction=MU, restitution=0.0)
    places = [0.0]
    for k in range(240):
        world.stepSimulation()
        if k % 12 == 11:
            places.append(world.getBasePositionAndOrientation(ball)[0][0])
    history = get_engine("bullet-stock").run(ball_on_slope(), Numerics(dt=0.05, n_steps=20), ()).history
    assert history.x[:, 0, 0] == pytest.approx(places, abs=1e-9)


def test_a_cell_is_measured_by_headlines_and_passes_no_check() -> None:
    pytest.importorskip("pymunk")
    cell = plan_matrix(["incline-block"], ["pymunk-stock"], {"mu": "0.36"})[0]
    result = run_cell(cell)
    assert (result.status, [row["status"] for row in result.rows]) == ("no-truth", ["no-truth"])
    assert {row["engine"] for row in result.headlines} == {"pymunk-stock"}
    assert all(math.isfinite(row["rel_error"]) for row in result.headlines)


def test_a_profile_chooses_the_engines() -> None:
    assert engines_given(["mujoco", "dem"], [], profile="both") == ["mujoco", "dem", "mujoco-stock"]
    assert engines_given(["mujoco"], [], profile="stock") == ["mujoco-stock"]
    assert engines_given(["mujoco-stock"], []) == ["mujoco-stock"]
    assert engines_given([], [], profile="stock") == list(STOCK_ENGINES)
    assert set(engines_given([], [], profile="both")) == {*engine_table(), *STOCK_ENGINES}
    with pytest.raises(UsageError, match=r"lammps has no stock settings here; engines that have: .*mujoco"):
        engines_given(["mujoco", "lammps"], [], profile="stock")


def test_pages_keep_the_profiles_apart(tmp_path: Path) -> None:
    pytest.importorskip("pymunk")
    store, out = tmp_path / "store", tmp_path / "report"
    words = ["incline-block", "-e", "pymunk", "--profile", "both", "--set", "mu=0.36", "--store", str(store)]
    for command in (["run", *words], ["report", "--store", str(store), "--out", str(out)]):
        subprocess.run([sys.executable, "-m", "ninedisk", *command], check=True, capture_output=True)
    index, stock = ((out / name).read_text(encoding="utf-8") for name in ("index.html", "stock.html"))
    assert 'href="stock.html"' in index
    assert "pymunk (stock)" not in index
    assert "pymunk (stock)" in stock
    assert "tuned" in stock
    assert "own step [s]: " in stock
    assert not list((out / "engine").glob("*stock*"))
