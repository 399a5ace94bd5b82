"""Bodies that come, leave or are not in the file; forces in several files; the bodies among several series; steps that are too long."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ninedisk.core import ContactLaw, Numerics, Spheres, SphereScene, simulate
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import read_scene

LAW = ContactLaw(kn=1e5, ks=8e4, mu=0.5, beta=0.1, lever_arm="overlap")
TOML = """gravity = [0.0, 0.0, 0.0]
time = {dt = 1e-5}
spheres = {inertia = "sphere"}
contact = {mu = 0.5, kn = 1e5, ks = 8e4}
"""
HEAD = ["t", "id", "x", "y", "z", "vx", "vy", "vz", "omegax", "omegay", "omegaz", "radius", "mass"]
PAIRS = [(0, 1), (1, 2)]


def table(folder: Path, *, keep: Any = lambda *_: True) -> Path:
    """Three spheres in a row, the first of which hits the second, and that the third; rows of which ``keep`` says so."""
    scene = SphereScene(
        spheres=Spheres(
            x=[(0.0, 0.0, 0.0), (0.21, 0.01, 0.0), (0.42, 0.0, 0.0)], radius=0.1, mass=(4.0, 3.0, 5.0),
            v=[(1, 0, 0), (0, 0, 0), (-1, 0, 0.1)],
        ),
        sphere_sphere=LAW,
        gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    history = simulate(scene, Numerics(dt=5e-4, n_steps=80, contact_dt=1e-5), watch=PAIRS)
    with (folder / "run.csv").open("w", newline="") as stream:
        out = csv.writer(stream)
        out.writerow(HEAD)
        for k, t in enumerate(history.t):
            for i, mass in enumerate((4.0, 3.0, 5.0)):
                if keep(k, i):
                    parts = (*history.x[k, i], *history.v[k, i], *history.omega[k, i])
                    out.writerow([f"{t:.12g}", i + 1, *(f"{each:.15g}" for each in parts), 0.1, mass])
    for column, (i, j) in enumerate(PAIRS):
        with (folder / f"pair{column}.csv").open("w", newline="") as stream:
            out = csv.writer(stream)
            out.writerow(["t", "i", "j", "fn", "fsx", "fsy", "fsz"])
            for k, t in enumerate(history.t):
                if history.fn[k, column] > 0.0:
                    numbers = (history.fn[k, column], *history.fs[k, column])
                    out.writerow([f"{t:.12g}", i + 1, j + 1, *(f"{each:.12g}" for each in numbers)])
    return folder / "run.csv"


def judged(file: Path, toml: str) -> dict[str, Any]:
    file.with_name("a.toml").write_text(toml)
    return audit(file, read_scene(file.with_name("a.toml")), lambda *_: None)


def violated(record: dict[str, Any]) -> set[str]:
    return {check["id"] for check in record["checks"] if check["verdict"] == "violated"}


def late(k: int, i: int) -> bool:
    """The first sphere is put in while it touches the second, the third is taken out in flight."""
    return not (i == 0 and k < 21) and not (i == 2 and k > 66)


def test_bodies_that_come_and_leave(tmp_path: Path) -> None:
    file = table(tmp_path, keep=late)
    record = judged(file, "open = true\n" + TOML)
    assert violated(record) == set(), [check["said"] for check in record["checks"]][:3]
    checks = {check["id"]: check for check in record["checks"]}
    assert checks["momentum"]["judged"] > 40
    assert "come or leave" in str(checks["momentum"]["why_not"])
    assert record["disks"] == 3
    closed = judged(file, TOML)
    assert {"particles", "momentum"} <= violated(closed)
    assert "open = true" in next(check["said"] for check in closed["checks"] if check["id"] == "particles")
    assert "momentum" in violated(judged(file, "open = true\n" + TOML.replace("0.0, 0.0, 0.0]", "0.0, 0.0, -0.1]")))


def test_a_box_that_starts_empty(tmp_path: Path) -> None:
    """A frame of LAMMPS without atoms, before the first is put in."""
    head = "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n{}\nITEM: BOX BOUNDS ff ff ff\n-9 9\n-9 9\n-9 9\nITEM: ATOMS id x y z vx vy vz\n"
    rows = ["", "", *(f"7 {0.01 * k} 0 0 1 0 0\n8 0 {1 - 0.02 * k} 0 0 -2 0\n" for k in range(5))]
    (tmp_path / "run.dump").write_text(
        "".join(head.format(1000 * k, row.count("\n")) + row for k, row in enumerate(rows))
    )
    toml = "dimension = 3\n" + TOML.replace('"sphere"', '"sphere", radius = 0.1, mass = 1.0')
    record = judged(tmp_path / "run.dump", "open = true\n" + toml)
    assert violated(record) == set()
    assert record["disks"] == 2
    with pytest.raises(UsageError, match=r"frame 1, line 10: a frame without spheres.*open = true"):
        judged(tmp_path / "run.dump", toml)


def test_a_part_of_the_bodies(tmp_path: Path) -> None:
    file = table(tmp_path, keep=lambda _, i: i != 1)
    record = judged(file, TOML)
    assert "free" in violated(record)
    assert "ids go from 1 to 3, and 1 of them are not there" in record["remarks"][0]
    record = judged(file, "partial = true\n" + TOML)
    assert violated(record) == set()
    assert "bodies are missing (partial = true), and something pushed sphere 1" in str(record["checks"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('inertia = "sphere"', 'inertia = "sphere", radius = 0.05', "radius of the TOML replaces radius of the file, which it makes 0.5"),
        ('inertia = "sphere"', 'inertia = "sphere", mass = 4.0', "mass of the TOML replaces mass of the file, which it makes 1.33333"),
        ('inertia = "sphere"', 'inertia = "sphere", density = 955.0', "density of the TOML replaces mass of the file"),
        ("open", "open", ""),
    ],
)  # fmt: skip
def test_numbers_of_the_toml_that_differ_from_the_file_are_reported(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    remarks = judged(table(tmp_path), TOML.replace(old, new))["remarks"]
    assert [said in remark for remark in remarks] == ([True] if said else [])


def test_forces_in_several_files(tmp_path: Path) -> None:
    file = table(tmp_path)
    both = TOML + '[[contacts]]\nfile = "pair0.csv"\n[[contacts]]\nfile = "pair1.csv"\n'
    checks = {check["id"]: check for check in judged(file, both)["checks"]}
    single = {check["id"]: check for check in judged(file, TOML + '[contacts]\nfile = "pair0.csv"\n')["checks"]}
    assert checks["cone"]["verdict"] == checks["history"]["verdict"] == "holds"
    assert checks["cone"]["judged"] > single["cone"]["judged"] > 5
    times = [row[0] for row in checks["cone"]["series"]]
    assert times == sorted(times)
    # Friction of both files is too large: the first violation is the earliest, whichever file has it.
    low = {check["id"]: check for check in judged(file, both.replace("mu = 0.5", "mu = 0.01"))["checks"]}
    swapped = both.replace("pair0", "pair9").replace("pair1", "pair0").replace("pair9", "pair1")
    other = {check["id"]: check for check in judged(file, swapped.replace("mu = 0.5", "mu = 0.01"))["checks"]}
    assert low["cone"]["first"]["t"] == other["cone"]["first"]["t"]
    assert low["cone"]["beyond"] == other["cone"]["beyond"]


FLOOR = '[[walls]]\nname = "floor"\npoint = [0.0, 0.0, -9.0]\nnormal = [0.0, 0.0, 1.0]\n'


def test_forces_at_a_wall_without_partners(tmp_path: Path) -> None:
    """As LIGGGHTS' wall/gran/local lists them."""
    file = table(tmp_path)
    lines = (tmp_path / "pair0.csv").read_text().splitlines()
    lines = [",".join(word for k, word in enumerate(line.split(",")) if k != 2) for line in lines]
    (tmp_path / "floor.csv").write_text("\n".join(lines) + "\n")
    toml = TOML.replace("mu = 0.5", "mu = 0.01") + FLOOR + '[contacts]\nfile = "floor.csv"\nwall = "{}"\n'
    cone = next(check for check in judged(file, toml.replace("{}", "floor"))["checks"] if check["id"] == "cone")
    assert "with wall 'floor'" in cone["said"]
    with pytest.raises(UsageError, match=r"line \d+, column 1: contacts.wall = 'roof' is not allowed.*floor"):
        judged(file, toml.replace("{}", "roof"))
    with pytest.raises(UsageError, match=r"\[contacts\] lacks file"):
        judged(file, TOML + FLOOR + '[[contacts]]\nwall = "floor"\n')
    with pytest.raises(UsageError, match=r"contacts = 3 is not allowed"):
        judged(file, "contacts = 3\n" + TOML)


POLYDATA = """# vtk DataFile Version 2.0
written
ASCII
DATASET POLYDATA
POINTS 2 double
{} 0 0 {} 1 0
POINT_DATA 2
VECTORS v double
1 0 0 1 0 0
"""


def test_the_bodies_of_a_folder_with_several_series(tmp_path: Path) -> None:
    """LIGGGHTS writes the box beside the bodies, YADE boxes and contacts."""
    folder = tmp_path / "post"
    folder.mkdir()
    for k in range(4):
        text = POLYDATA.format(0.1 * k, 0.1 * k)
        (folder / f"d{k}.vtk").write_text(text)
        (folder / f"dboundingBox_{k}.vtk").write_text(text[: text.index("POINT_DATA")])
    toml = "dimension = 3\n" + TOML.replace('"sphere"', '"sphere", radius = 0.1, mass = 1.0').replace(
        "dt = 1e-5", "interval = 0.1"
    )
    record = judged(folder, toml)
    assert violated(record) == set()
    assert "d#.vtk (# a number) are the bodies" in record["remarks"][0]
    for k in range(4):
        (folder / f"other{k}.vtk").write_text(POLYDATA.format(k, k))
    with pytest.raises(UsageError, match=r"holds several series.* 2 of them have velocities or radii"):
        judged(folder, toml)


@pytest.mark.parametrize(("dt", "verdict"), [(5e-4, "holds"), (4e-3, "violated"), (None, "not decidable")])
def test_a_step_as_long_as_a_contact_is_named(dt: float | None, verdict: str, tmp_path: Path) -> None:
    """Two spheres of 3 and 5 kg with 1e5 N/m touch for pi sqrt(m/kn) = 13.6 ms: 27 steps, then 3.4."""
    toml = TOML.replace("time = {dt = 1e-5}\n", "" if dt is None else f"time = {{dt = {dt}}}\n")
    check = next(each for each in judged(table(tmp_path), toml)["checks"] if each["id"] == "step")
    assert check["verdict"] == verdict, check["said"]
    if dt == 4e-3:
        reduced = 4.0 * 3.0 / 7.0
        assert check["worst"]["value"] == pytest.approx(0.25 * dt**2 * 1e5 / reduced)
        assert f"lasts {np.pi * np.sqrt(reduced / 1e5) / dt:.2g} steps" in check["said"]
