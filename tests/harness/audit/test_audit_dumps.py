"""Dumps of LAMMPS in every form, by hand; and audits without a TOML: what a file shows is inferred, the rest is asked for by name."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.geometry import Cone, close_pairs, friction_rays
from ninedisk.harness.audit.infer import infer_scene
from ninedisk.harness.audit.read import dimension_of, read_trajectory
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import scene_of_text
from ninedisk.harness.cli.app import app

G = 9.81
EDGES = np.array([[2.0, 0.0, 0.0], [0.5, 1.5, 0.0], [-0.25, 0.125, 1.25]])
ORIGIN = np.array([-0.5, 0.25, 0.125])
ODD = 1.0713715479217  # numbers of few digits show none
SPEED = ODD * np.array([[0.9, -0.4, 0.3], [-0.7, 0.6, -0.2], [0.2, 0.1, 0.5], [0.4, 0.3, 0.1]])
STARTS = ODD * np.array([[0.1, 0.4, 0.3], [0.9, 0.8, 0.7], [1.2, 1.3, 1.0], [0.4, 1.2, 0.5]])
RADII = np.array([0.05, 0.06, 0.07, 0.04])


def flight(k: int, g: float = G, d: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities of four spheres, 0.05 s apart."""
    t, down = 0.05 * k, np.array([0.0, 0.0, -g] if d == 3 else [0.0, -g, 0.0])
    flat = np.ones(3) if d == 3 else np.array([1.0, 1.0, 0.0])
    return (STARTS + SPEED * t) * flat + 0.5 * down * t * t, SPEED * flat + down * t


def dump(
    columns: str, *, head: str = "", timed: bool = False, frames: int = 12, g: float = G, d: int = 3, jump: float = 0.0
) -> str:
    """A dump of the flight in an oblique periodic box, with columns as they are asked for."""
    text = ""
    x_, y_, z_ = EDGES[1, 0], EDGES[2, 0], EDGES[2, 1]
    low = ORIGIN + np.array([min(0, x_, y_, x_ + y_), min(0, z_), 0])
    high = ORIGIN + np.diag(EDGES) + np.array([max(0, x_, y_, x_ + y_), max(0, z_), 0])
    for k in range(frames):
        x, v = flight(k, g, d)
        x[1, 0] += jump * (k > 5)
        share = (x - ORIGIN) @ np.linalg.inv(EDGES)
        home = ORIGIN + (share % 1.0) @ EDGES
        values: dict[str, Any] = {"id": [4, 2, 9, 7], "radius": RADII, "diameter": 2 * RADII, "mass": 4e3 * RADII**3}
        for a, axis in enumerate("xyz"):
            values |= {axis: home[:, a], f"{axis}u": x[:, a], f"{axis}s": (share % 1.0)[:, a], f"{axis}su": share[:, a]}
            values |= {f"v{axis}": v[:, a], f"omega{axis}": SPEED[:, a]}
        names = columns.split()
        rows = np.column_stack([values[name] for name in names])
        rows = rows[np.random.default_rng(k).permutation(4)]
        text += head + (f"ITEM: TIME\n{0.05 * k:.12g}\n" if timed else "")
        text += f"ITEM: TIMESTEP\n{500 * k}\nITEM: NUMBER OF ATOMS\n4\nITEM: BOX BOUNDS xy xz yz pp pp pp\n"
        text += "".join(f"{a:.17g} {b:.17g} {tilt:.17g}\n" for a, b, tilt in zip(low, high, (x_, y_, z_), strict=True))
        text += f"ITEM: ATOMS {columns}\n" + "".join(" ".join(f"{each:.12g}" for each in row) + "\n" for row in rows)
    return text


SCENE = "gravity = [0.0, 0.0, -9.81]\ntime = {dt = 1e-4}\ncontact = {mu = 0.3, kn = 1e6, ks = 1e6}\n"
SPINS = "omegaz omegax omegay"


def judged(file: Path, toml: str = SCENE) -> dict[str, Any]:
    return audit(file, scene_of_text(toml, "scene"), lambda *_: None)


def violated(record: dict[str, Any]) -> set[str]:
    return {check["id"] for check in record["checks"] if check["verdict"] == "violated"}


@pytest.mark.parametrize("places", ["x y z", "xs ys zs", "zsu ysu xsu", "xu yu zu", "x xu y yu z zu"])
@pytest.mark.parametrize("size", ["radius", "diameter"])
def test_places_and_sizes_of_every_kind(tmp_path: Path, places: str, size: str) -> None:
    file = tmp_path / "a.dump"
    file.write_text(dump(f"mass id vz vy vx {places} {SPINS} {size}"))
    record = judged(file)
    assert violated(record) == set(), [check["said"] for check in record["checks"]][:3]
    assert next(check for check in record["checks"] if check["id"] == "free")["judged"] >= 40
    remarks = [remark for remark in record["remarks"] if not remark.startswith("ids go from 2 to 9")]
    assert len(remarks) == len(record["remarks"]) - 1
    assert bool(remarks) == (size == "diameter" or "s" in places)
    frame = next(read_trajectory(file, {}).frames(lambda *_: None))
    order = np.argsort(frame.columns["id"])
    assert frame.columns["radius"][order] == pytest.approx(RADII[[1, 0, 3, 2]], rel=1e-11)
    file.write_text(dump(f"mass id vz vy vx {places} {SPINS} {size}", jump=1e-4))
    assert "motion" in violated(judged(file))


def test_times_packed_and_units(tmp_path: Path) -> None:
    text = dump("id x y z vx vy vz radius mass", head="ITEM: UNITS\nsi\n", timed=True)
    with gzip.open(tmp_path / "a.dump.gz", "wt") as stream:
        stream.write(text)
    assert violated(judged(tmp_path / "a.dump.gz")) == set()
    (tmp_path / "b.dump").write_text(text.replace("si\n", "real\n"))
    with pytest.raises(UsageError, match="units real mix kcal/mol"):
        judged(tmp_path / "b.dump")
    (tmp_path / "c.dump").write_text(text.replace("si\n", "cgs\n"))
    assert "units cgs" in judged(tmp_path / "c.dump")["remarks"][0]


@pytest.mark.parametrize(("lag", "words"), [(0.5, "half a step before"), (-0.5, "half a step after"), (0.0, "")])
def test_velocities_of_half_a_step_are_named(tmp_path: Path, lag: float, words: str) -> None:
    """YADE's are those of half a step before the positions."""
    rows = []
    for k in range(12):
        x, v = flight(k)
        v = v + np.array([0.0, 0.0, G * lag * 1e-4])
        rows += [",".join(f"{each:.12g}" for each in (0.05 * k, i, *x[i], *v[i], 0.05, 1.0)) for i in range(4)]
    (tmp_path / "a.csv").write_text("t,id,x,y,z,vx,vy,vz,radius,mass\n" + "\n".join(rows) + "\n")
    record = judged(tmp_path / "a.csv")
    assert violated(record) == set()
    assert any(words in remark for remark in record["remarks"]) if words else record["remarks"] == []


def test_a_box_that_changes_is_refused(tmp_path: Path) -> None:
    one, two = (dump("id x y z vx vy vz radius mass", frames=n) for n in (2, 3))
    (tmp_path / "a.dump").write_text(one + two[len(one) :].replace("1.375", "1.5"))
    with pytest.raises(UsageError, match=r"frame 3, line .*: the periodic box differs"):
        judged(tmp_path / "a.dump")


def test_a_file_alone_shows_what_it_can(tmp_path: Path) -> None:
    file = tmp_path / "a.dump"
    file.write_text(dump(f"id x y z vx vy vz {SPINS} radius mass", timed=True))
    found = infer_scene(file)
    assert found.lacking == ()
    scene = scene_of_text(found.text, "inferred")
    assert scene.dimension == 3
    assert scene.gravity.tolist() == [0.0, 0.0, -G]
    assert scene.dt == pytest.approx(1e-4)
    assert not scene.walls_known
    done = CliRunner().invoke(app, ["audit", str(file), "--write-scene", str(tmp_path / "a.toml")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "a.toml").read_text() == found.text
    assert "gravity = [0, 0, -9.81]" in done.output


def test_gravity_in_the_plane_and_the_shape_by_the_masses(tmp_path: Path) -> None:
    file = tmp_path / "a.dump"
    file.write_text(dump("id xu yu z vx vy vz omegaz radius mass", timed=True, d=2))
    assert dimension_of(read_trajectory(file, {})) == 2
    found = infer_scene(file)
    assert "gravity = [0, -9.81]" in found.text
    assert 'inertia = "sphere"' in found.text


@pytest.mark.parametrize(
    ("columns", "timed", "asked"),
    [
        ("id x y z vx vy vz radius mass", False, ["time.dt = ", "gravity = "]),
        ("id x y z vx vy vz mass", True, ["[spheres] radius", "gravity = "]),
        ("id x y z vx vy vz radius", True, ["[spheres] mass"]),
        ("id x y z radius mass", True, ["gravity = [0.0, 0.0, -9.81]: the file has no velocities"]),
    ],
)
def test_what_a_file_does_not_show_is_asked_for_by_name(
    tmp_path: Path, columns: str, timed: bool, asked: list[str]
) -> None:
    file = tmp_path / "a.dump"
    file.write_text(dump(columns, timed=timed))
    done = CliRunner().invoke(app, ["audit", str(file)])
    assert done.exit_code == 2, done.output
    for words in asked:
        assert words in done.output
    assert "--write-scene" in done.output


def test_walls_that_nobody_gave_accuse_nothing(tmp_path: Path) -> None:
    """A sphere that bounces off what the file does not show."""
    file = tmp_path / "a.csv"
    t = np.arange(60) * 0.01 + 0.003
    z = np.where(t < 0.4, 1.0 - 2.0 * t, 0.2 + 1.9 * (t - 0.4))
    rows = [f"{a:.9g},1,0.25,0.5,{b:.12g},0,0,{-2.0 if a < 0.4 else 1.9},0.1,1.5" for a, b in zip(t, z, strict=True)]
    file.write_text("t,id,x,y,z,vx,vy,vz,radius,mass\n" + "\n".join(rows) + "\n")
    toml = "gravity = [0.0, 0.0, 0.0]\ntime = {dt = 1e-3}\n"
    record = judged(file, toml + 'walls = "unknown"\n')
    assert violated(record) == set()
    said = next(check["said"] for check in record["checks"] if check["id"] == "free")
    assert "walls are not given, and something pushed sphere 1 at t = 0.403" in said
    assert "free" in violated(judged(file, toml + "walls = []\n"))
    wall = '[[walls]]\nname = "w"\npoint = [0.0, 0.0, 0.1]\nnormal = [0.0, 0.0, 1.0]\n'
    assert violated(judged(file, toml + wall)) == set()


@pytest.mark.parametrize("d", [2, 3])
def test_the_cone_of_a_wall_and_its_rays_agree(d: int) -> None:
    rng = np.random.default_rng(d)
    normal = rng.normal(size=d)
    normal /= np.linalg.norm(normal)
    vectors = rng.normal(size=(300, d))
    for mu in (0.0, 0.3, 2.0, None):
        rays = friction_rays(normal, mu)
        exact, rayed = Cone(rays, (normal, mu)).distance(vectors), Cone(rays).distance(vectors)
        # The rays are around the cone in space: no vector is farther from them, and 0.9 % of its length at most nearer.
        slack = 0.0 if d == 2 or not mu else 0.01
        assert (rayed <= exact + 1e-9).all()
        assert (exact - rayed <= slack * np.linalg.norm(vectors, axis=1) + 1e-9).all()


def test_pairs_across_periodic_edges_are_those_of_images() -> None:
    rng = np.random.default_rng(3)
    x, reach = rng.uniform(-3.0, 3.0, (60, 3)), rng.uniform(0.05, 0.15, 60)
    pairs, shift = close_pairs(x, reach, EDGES)
    found = {(int(i), int(j)) for i, j in pairs}
    apart = np.linalg.norm(x[pairs[:, 1]] + shift - x[pairs[:, 0]], axis=1)
    assert (apart <= reach[pairs].sum(axis=1)).all()
    images = np.array([(a, b, c) for a in range(-6, 7) for b in range(-6, 7) for c in range(-6, 7)]) @ EDGES
    wanted = {
        (i, j)
        for i in range(60)
        for j in range(i + 1, 60)
        if np.linalg.norm(x[j] + images - x[i], axis=1).min() <= reach[i] + reach[j]
    }
    assert found == wanted
