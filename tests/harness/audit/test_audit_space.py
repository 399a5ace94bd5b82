"""Audits in space: right runs of our own core pass, each fault in an engine's input or in what is said of it is named by its check."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from ninedisk.core import ContactLaw, Numerics, PlaneSegment, PlaneWall, Spheres, SphereScene, simulate
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import read_scene
from ninedisk.harness.cli.app import app

Edit = Callable[[pd.DataFrame], pd.DataFrame]
SPINS = ["omegax", "omegay", "omegaz"]
WALLS = [
    ("floor", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ("left", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ("right", (0.4, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    ("front", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ("back", (0.0, 0.4, 0.0), (0.0, -1.0, 0.0)),
]
BASE = """gravity = [0.0, 0.0, {g}]
time = {{dt = 2e-5}}
contact = {{mu = {mu}, kn = 1e5, ks = 8e4}}
"""


def scene_toml(*, g: float = -9.81, mu: float = 0.3, walls: int = 5, motion: str = "") -> str:
    """The TOML of a run, with the first so many walls."""
    tables = [
        f'[[walls]]\nname = "{name}"\npoint = {list(point)}\nnormal = {list(normal)}\n'
        for name, point, normal in WALLS[:walls]
    ]
    if motion:
        tables[0] += f"motion = [{motion}]\n"
    return BASE.format(g=g, mu=mu) + "".join(tables)


def box(
    *, seed: int = 1, arm: Any = "overlap", mu: float = 0.3, walls: bool = True, g: float = -9.81, motion: Any = ()
) -> SphereScene:
    """Fourteen spheres of all sizes that fly, spin and meet, in a box or without walls and weight."""
    rng = np.random.default_rng(seed)
    law = ContactLaw(kn=1e5, ks=8e4, mu=mu, beta=0.1, lever_arm=arm)
    n = 14
    grid = np.array([(i, j, k) for k in range(4) for i in range(2) for j in range(2)][:n], dtype=float)
    radius = rng.uniform(0.04, 0.07, n)
    planes = [PlaneWall(name=name, point=point, normal=normal, law=law) for name, point, normal in WALLS]
    if motion:
        planes[0] = PlaneWall(name="floor", point=WALLS[0][1], normal=WALLS[0][2], law=law, motion=motion)
    return SphereScene(
        spheres=Spheres(
            x=np.array([0.1, 0.1, 0.12]) + grid * np.array([0.17, 0.17, 0.16]) + rng.uniform(-0.01, 0.01, (n, 3)),
            v=rng.uniform(-1.0, 1.0, (n, 3)),
            omega=rng.uniform(-20.0, 20.0, (n, 3)),
            radius=radius,
            mass=2000.0 * 4.0 / 3.0 * np.pi * radius**3,
        ),
        walls=tuple(planes) if walls else (),
        sphere_sphere=law,
        gravity=(0.0, 0.0, g),
    )


@cache
def run(key: str) -> pd.DataFrame:
    """One of the runs, as a table."""
    scene = RUNS[key]()
    history = simulate(scene, Numerics(dt=1e-3, n_steps=130, contact_dt=2e-5))
    s, n, _ = history.x.shape
    table = pd.DataFrame({"t": np.repeat(history.t, n), "id": np.tile(np.arange(1, n + 1), s)})
    for names, values in ((list("xyz"), history.x), (["vx", "vy", "vz"], history.v), (SPINS, history.omega)):
        table[names] = values.reshape(s * n, 3)
    return table.assign(radius=np.tile(scene.spheres.radius, s), mass=np.tile(scene.spheres.mass, s))


SHAKEN = PlaneSegment(amplitude=(0.0, 0.0, 0.003), frequency=100.0)
TURNED = PlaneSegment(angular_velocity=(0.5, 0.0, 4.0), pivot=(0.2, 0.2, 0.0))
RUNS: dict[str, Callable[[], SphereScene]] = {
    "box": box,
    "arms of R": lambda: box(arm="radius", seed=22),
    "free": lambda: box(walls=False, g=0.0, seed=7),
    "free, arms of R": lambda: box(walls=False, g=0.0, seed=7, arm="radius"),
    "smooth": lambda: box(mu=0.0, seed=8),
    "rough": lambda: box(mu=0.5, seed=11),
    "shaken": lambda: box(motion=(SHAKEN,)),
    "turned": lambda: box(motion=(TURNED,)),
}
FREE = scene_toml(g=0.0, walls=0)


def judged(folder: Path, table: pd.DataFrame, toml: str, digits: str = "%.9g") -> dict[str, dict[str, Any]]:
    """Checks by id."""
    file = folder / "a.csv"
    table.to_csv(file, index=False, float_format=digits)
    (folder / "a.toml").write_text(toml)
    record = audit(file, read_scene(folder / "a.toml"), lambda *_: None)
    assert record["dimension"] == 3
    return {check["id"]: check for check in record["checks"]}


def violated(checks: dict[str, dict[str, Any]]) -> set[str]:
    return {name for name, check in checks.items() if check["verdict"] == "violated"}


@pytest.mark.parametrize(
    ("key", "toml", "digits"),
    [
        ("box", scene_toml(), "%.9g"),
        ("box", scene_toml(), "%.17g"),
        ("box", scene_toml(), "%.6g"),
        ("arms of R", scene_toml(), "%.9g"),
        ("free", FREE, "%.9g"),
        ("free, arms of R", FREE, "%.9g"),
        ("smooth", scene_toml(mu=0.0), "%.9g"),
        ("rough", scene_toml(mu=0.5), "%.9g"),
        ("shaken", scene_toml(motion="{amplitude = [0.0, 0.0, 0.003], frequency = 100.0}"), "%.9g"),
        ("turned", scene_toml(motion="{angular_velocity = [0.5, 0.0, 4.0], pivot = [0.2, 0.2, 0.0]}"), "%.9g"),
        ("box", "gravity = [0.0, 0.0, -9.81]\n" + scene_toml()[scene_toml().index("[[walls]]") :], "%.9g"),
    ],
)
def test_a_right_run_is_not_accused(tmp_path: Path, key: str, toml: str, digits: str) -> None:
    checks = judged(tmp_path, run(key), toml, digits)
    assert violated(checks) == set(), {name: checks[name]["said"] for name in violated(checks)}
    assert {"free", "motion", "momentum", "spin"} <= {n for n, c in checks.items() if c["verdict"] == "holds"}


def test_a_right_run_is_not_accused_when_frames_are_rare(tmp_path: Path) -> None:
    table = run("box")
    assert violated(judged(tmp_path, table[table.t.mul(1e3).round() % 13 == 0], scene_toml())) == set()


def frozen(*bodies: int) -> Edit:
    """Spins stay as they were."""

    def edit(table: pd.DataFrame) -> pd.DataFrame:
        for body in bodies or table.id.unique():
            mine = table.id == body
            table.loc[mine, SPINS] = table[mine].iloc[0][SPINS].to_numpy(dtype=float)
        return table

    return edit


def moved(body: int, column: str, by: float, begin: float, end: float = 9.0) -> Edit:
    def edit(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[(table.id == body) & (table.t > begin) & (table.t < end), column] += by
        return table

    return edit


PLANTED: dict[str, tuple[str, str, str, Edit, str]] = {
    "gravity is 9.80 for 9.81": ("box", scene_toml(g=-9.8), "free", lambda table: table, ""),
    "gravity points elsewhere": ("box", scene_toml().replace("[0.0, 0.0, -9.81]", "[0.0, -9.81, 0.0]"), "free", lambda t: t, ""),
    "a wall is missing": ("box", scene_toml(walls=4), "free", lambda table: table, ""),
    "a wall stands elsewhere": ("box", scene_toml().replace("[0.4, 0.0, 0.0]", "[0.5, 0.0, 0.0]"), "free", lambda t: t, ""),
    "a floor that moves is taken as resting": ("shaken", scene_toml(), "energy", lambda table: table, ""),
    "friction beyond the cone": ("rough", scene_toml(mu=0.3), "momentum", lambda table: table, ""),
    "friction of smooth contacts": ("box", scene_toml(mu=0.0), "spin", lambda table: table, ""),
    "one body does not turn": ("free", FREE, "spin", frozen(12), "sphere 12 by an arm of 0 R"),
    "no body turns": ("free", FREE, "spin", frozen(), "by an arm of 0 R"),
    "no body turns, in a box": ("box", scene_toml(), "spin", frozen(), ""),
    "a spin with the wrong sign": ("free", FREE, "spin", lambda table: table.assign(omegay=-table.omegay), ""),
    "inertia of disks": ("free", FREE + "spheres = {inertia = 0.5}\n", "spin", lambda table: table, ""),
    "diameter for radius": ("box", scene_toml(), "overlap", lambda table: table.assign(radius=2.0 * table.radius), "diameters"),
    "half of the radius": ("box", scene_toml(), "free", lambda table: table.assign(radius=0.5 * table.radius), "halves"),
    "one mass is wrong": (
        "free", FREE, "momentum", lambda table: table.assign(mass=table.mass * np.where(table.id == 12, 1.001, 1.0)), "",
    ),
    "times are off by 1 %": ("box", scene_toml(), "motion", lambda table: table.assign(t=1.01234567 * table.t), "is time.dt"),
    "a place jumps": ("box", scene_toml(), "motion", moved(3, "z", 1e-6, 0.0095, 0.0105), "sphere 3"),
    "a velocity jumps": ("box", scene_toml(), "free", moved(3, "vy", 1e-7, 0.0095), "sphere 3"),
    "springs are four times as stiff": ("box", scene_toml().replace("kn = 1e5", "kn = 4e5"), "energy", lambda table: table, ""),
    "arms are R and stated otherwise": (
        "free, arms of R", FREE.replace("ks", 'lever_arm = "overlap", ks'), "spin", lambda t: t, 'is it lever_arm = "radius"',
    ),
    "arms are shorter and stated as R": (
        "free", FREE.replace("ks", 'lever_arm = "radius", ks'), "spin", lambda table: table, 'is it lever_arm = "overlap"',
    ),
    "a sphere is lost": ("box", scene_toml(), "particles", lambda t: t[~((t.id == 3) & (t.t > 0.05))], "lost: 3"),
}  # fmt: skip


@pytest.mark.parametrize("planted", PLANTED)
def test_planted_faults_are_named(tmp_path: Path, planted: str) -> None:
    key, toml, check, edit, words = PLANTED[planted]
    checks = judged(tmp_path, edit(run(key).copy()), toml)
    assert check in violated(checks), {name: each["said"] for name, each in checks.items()}
    assert words in checks[check]["said"]


def test_arms_are_named_where_nothing_states_them(tmp_path: Path) -> None:
    said = judged(tmp_path, run("free, arms of R"), FREE)["spin"]["said"]
    assert said.startswith("holds")
    assert "arms of shear forces are the radii" in said
    assert "arms of shear forces" not in judged(tmp_path, run("free"), FREE)["spin"]["said"]


@pytest.mark.parametrize(
    ("columns", "force", "bad"),
    [
        ("fn,fs", lambda fn, ft: [fn, ft], False),
        ("fn,fsx,fsy,fsz", lambda fn, ft: [fn, ft * 0.6, 0.0, ft * 0.8], False),
        ("fx,fy,fz,nx,ny,nz", lambda fn, ft: [0.0, ft, fn, 0.0, 0.0, 2.0], False),
        ("fn,fx,fy,fz", lambda fn, ft: [fn, 0.0, ft, fn], False),
        ("fnx,fny,fnz,fsx,fsy,fsz", lambda fn, ft: [0.0, 0.0, fn, ft, 0.0, 0.0], False),
        ("fx,fy,fz", lambda fn, ft: [0.0, ft, fn], True),
    ],
)
def test_contact_forces_in_every_form(
    tmp_path: Path, columns: str, force: Callable[[float, float], list[float]], bad: bool
) -> None:
    toml = FREE + '[contacts]\nfile = "c.csv"\n'
    for ratio, found in ((0.29, set()), (0.31, {"cone"})):
        rows = [[t, 1, 2, *force(7.0 + t, ratio * (7.0 + t))] for t in np.arange(30) * 0.0011]
        text = "".join(",".join(f"{each:.10g}" for each in row) + "\n" for row in rows)
        (tmp_path / "c.csv").write_text(f"t,i,j,{columns}\n{text}")
        if bad:
            with pytest.raises(Exception, match="a contact needs fn and fs"):
                judged(tmp_path, run("free"), toml)
        else:
            assert violated(judged(tmp_path, run("free"), toml)) == found


def test_the_page_of_spheres(tmp_path: Path) -> None:
    frozen(12)(run("free").copy()).to_csv(tmp_path / "a.csv", index=False, float_format="%.9g")
    (tmp_path / "a.toml").write_text(FREE)
    done = CliRunner().invoke(app, ["audit", str(tmp_path / "a.csv"), "--out", str(tmp_path / "page")])
    assert done.exit_code == 1, done.output
    assert "14 spheres" in done.output
    record = json.loads((tmp_path / "page" / "audit.json").read_text())
    assert record["dimension"] == 3
    assert 'class="marked"' in (tmp_path / "page" / "index.html").read_text()
