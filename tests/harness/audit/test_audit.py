"""Audits: an honest file passes in every format, each planted error is found by the check that owns it, bad files name their place."""

from __future__ import annotations

import base64
import json
import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from ninedisk.core.dem.files import FrameWriter
from ninedisk.harness.audit.example import write_example
from ninedisk.harness.audit.readers.rounding import Rounding, Tokens
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.statuses import VERDICTS

Edit = Callable[[pd.DataFrame], pd.DataFrame]
G = 9.81
VX = 0.3137154792  # exact numbers like 0.3 show no digits


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sample")
    write_example(folder)
    return folder


@pytest.fixture
def start_files(sample: Path, tmp_path: Path) -> Path:
    """The sample's first 0.17 s, in which disks fly, meet and slide on the floor: an audit takes as long as a file is."""
    folder = shutil.copytree(sample, tmp_path / "there")
    table = pd.read_csv(folder / "trajectory.csv")
    write(table[table.t < 0.17], folder / "trajectory.csv")
    return folder


def audited(file: Path, *more: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """Exit code and checks by id."""
    out = file.parent / "found.json"
    done = ninedisk("audit", str(file), "--json", str(out), *more)
    assert done.exit_code in (0, 1), done.output
    return done.exit_code, {check["id"]: check for check in json.loads(out.read_text())["checks"]}


def violated(checks: dict[str, dict[str, Any]]) -> set[str]:
    return {name for name, check in checks.items() if check["verdict"] == "violated"}


def write(table: pd.DataFrame, path: Path) -> Path:
    table.to_csv(path, index=False, float_format="%.9g")
    return path


def moved(disk: int, column: str, by: float, begin: float, end: float = 9.0) -> Edit:
    def edit(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[(table.id == disk) & (table.t >= begin - 1e-9) & (table.t < end), column] += by
        return table

    return edit


def bounce(e: float, *, depth: float = 0.0) -> pd.DataFrame:
    """A rigid disk of radius 0.1 thrown down from 1.1 m, which hits the floor once; ``depth`` puts its bounce below the floor."""
    v0, fall = -1.0, 1.0 + depth
    hit = (v0 + np.sqrt(v0 * v0 + 2.0 * G * fall)) / G
    up = e * (np.sqrt(v0 * v0 + 2.0 * G * fall))
    t = np.arange(0, 60) * 0.01
    after = t > hit
    y = np.where(after, 0.1 - depth + up * (t - hit) - 0.5 * G * (t - hit) ** 2, 1.1 + v0 * t - 0.5 * G * t * t)
    vy = np.where(after, up - G * (t - hit), v0 - G * t)
    return pd.DataFrame({"t": t, "id": 7, "x": VX * t, "y": y, "vx": VX, "vy": vy, "omega": 2.0})


RIGID = """gravity = [0.0, -9.81]
time = {{dt = 1e-4}}
disks = {{radius = 0.1, mass = 2.0}}
contact = {{mu = 0.0, restitution = {e}, rigid = true}}
walls = [{{name = "floor", point = [0.0, 0.0], normal = [0.0, 1.0]}}]
"""


def test_an_honest_file_passes(sample: Path, start_files: Path) -> None:
    code, checks = audited(sample / "trajectory.csv")
    assert code == 0
    assert {name for name, check in checks.items() if check["verdict"] != "holds"} == {"kept", "reversal", "torque"}
    # Allowances are of the size of the digits, not of the physics: nine digits of numbers near 1.
    assert checks["free"]["worst"]["allowance"] < 3e-8
    assert checks["momentum"]["worst"]["allowance"] < 1e-5
    assert audited(start_files / "trajectory.csv")[0] == 0


PLANTED: dict[str, tuple[str, Edit]] = {
    "momentum: a hundred thousandth of a velocity when two meet": ("momentum", moved(0, "vx", 1e-5, 0.139)),
    "spin: a disk turns faster in flight": ("spin", moved(1, "omega", 1e-6, 0.16)),
    "spin: a contact turns one disk of two": ("spin", moved(1, "omega", 1e-3, 0.138)),
    "jump: a position, once": ("motion", moved(0, "x", 1e-6, 0.05, 0.0505)),
    "jump: a velocity without a contact": ("free", moved(3, "vy", 1e-6, 0.05, 0.0505)),
    "jump: an angle": ("turning", moved(3, "angle", 1e-6, 0.05)),
    "lost": ("particles", lambda table: table[~((table.id == 3) & (table.t > 0.15))]),
    "doubled": ("particles", lambda table: pd.concat([table, table[-1:]])),
    "no number": ("finite", lambda table: table.assign(omega=table.omega.where(table.t != 0.1))),
    "wrong times": ("motion", lambda table: table.assign(t=table.t * 1.01)),
    "time stands": ("time", lambda table: pd.concat([table, table[table.t < 0.01]])),
    "overlap: through the floor": ("overlap", moved(2, "y", -0.2, 0.1, 0.15)),
}  # fmt: skip


@pytest.mark.parametrize("planted", PLANTED)
def test_planted_errors_are_found(start_files: Path, planted: str) -> None:
    check, edit = PLANTED[planted]
    file = start_files / "trajectory.csv"
    code, checks = audited(write(edit(pd.read_csv(file)), file))
    assert code == 1
    assert check in violated(checks), {name: checks[name]["said"] for name in checks}


@pytest.mark.parametrize(
    ("old", "new", "check"),
    [
        (
            "density = 1000.0",
            "mass = [31.4159, 31.4473, 70.6858, 45.2389]",
            "momentum",
        ),  # 0.1 % of one of the two that meet
        ("gravity = [0.0, -9.81]", "gravity = [0.0, -9.8101]", "free"),
        ('inertia = "disk"', 'inertia = "sphere"', "spin"),
        ("kn = 1e6", "kn = 4e6", "energy"),
        ("mu = 0.3", "mu = 0.2995", "cone"),
        ("normal = [0.0, 1.0]", "normal = [0.05, 1.0]", "momentum"),
    ],
)
def test_what_is_reported_wrongly_is_found(start_files: Path, old: str, new: str, check: str) -> None:
    reported = (start_files / "trajectory.toml").read_text()
    assert old in reported
    (start_files / "trajectory.toml").write_text(reported.replace(old, new))
    code, checks = audited(start_files / "trajectory.csv")
    assert code == 1
    assert check in violated(checks), {name: checks[name]["said"] for name in checks}


@pytest.mark.parametrize(
    ("e", "reported", "back", "found"),
    [
        (1.0, 1.0, 1.0, set()),
        (0.8, 0.8, None, set()),
        (1.001, 1.0, None, {"energy"}),
        (0.999, 1.0, None, {"kept"}),
        (1.0, 1.0, 0.99, {"reversal"}),
    ],
)
def test_a_bounce_in_closed_form(
    tmp_path: Path, e: float, reported: float, back: float | None, found: set[str]
) -> None:
    file = write(bounce(e), tmp_path / "a.csv")
    (tmp_path / "a.toml").write_text(('reverse = "back.csv"\n' if back else "") + RIGID.format(e=reported))
    if back is not None:
        there = bounce(e)
        again = there[::-1].assign(t=there.t.to_numpy(), vx=-there.vx[::-1], vy=-there.vy[::-1], omega=-2.0)
        again.loc[again.t > 0.5, "y"] += 1.0 - back
        write(again, tmp_path / "back.csv")
    code, checks = audited(file)
    assert violated(checks) == found, {name: checks[name]["said"] for name in checks}
    assert code == (1 if found else 0)
    if back is not None:
        assert checks["reversal"]["verdict"] != "not decidable"


def test_an_overlap_of_rigid_disks_is_one(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(RIGID.format(e=0.9))
    _, checks = audited(write(bounce(0.9, depth=0.02), tmp_path / "a.csv"))
    assert "overlap" in violated(checks)
    (tmp_path / "a.toml").write_text(RIGID.format(e=0.9).replace("rigid = true", "rigid = true, slop = 0.03"))
    assert "overlap" not in violated(audited(tmp_path / "a.csv")[1])


def test_without_velocities_free_flight_is_judged_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(RIGID.format(e=0.9))
    table = bounce(0.9).drop(columns=["vx", "vy"])
    assert audited(write(table, tmp_path / "a.csv"))[0] == 0
    table.loc[table.t == 0.2, "x"] += 1e-5
    assert "free" in violated(audited(write(table, tmp_path / "a.csv"))[1])


def test_a_moving_wall_gives_what_it_works_and_no_more(tmp_path: Path) -> None:
    """A floor that rises at 0.5 m/s throws a disk back: e = 1 in its frame."""
    reported = RIGID.format(e=1.0).replace(
        "normal = [0.0, 1.0]", "normal = [0.0, 1.0], motion = [{velocity = [0.0, 0.5]}]"
    )
    (tmp_path / "a.toml").write_text(reported)
    t = np.arange(40) * 0.01
    hit = 1.0 / 2.5
    for gain, found in ((0.0, False), (0.01, True)):
        t = np.arange(60) * 0.01 + 0.003
        after = t > hit
        y = np.where(after, 1.1 - 2.0 * hit + (3.0 + gain) * (t - hit), 1.1 - 2.0 * t)
        table = pd.DataFrame(
            {"t": t, "id": 1, "x": 0.0, "y": y, "vx": 0.0, "vy": np.where(after, 3.0 + gain, -2.0), "omega": 0.0}
        )
        (tmp_path / "a.toml").write_text(reported.replace("[0.0, -9.81]", "[0.0, 0.0]").replace("1e-4", "1e-3"))
        _, checks = audited(write(table, tmp_path / "a.csv"))
        assert ("energy" in violated(checks)) is found, checks["energy"]["said"]


def lammps(table: pd.DataFrame, folder: Path) -> Path:
    lines = []
    for step, (_, rows) in enumerate(table.groupby("t")):
        lines += [
            f"ITEM: TIMESTEP\n{100 * step}\nITEM: NUMBER OF ATOMS\n{len(rows)}\nITEM: BOX BOUNDS ff ff pp\n0 1\n0 1\n0 1\n"
        ]
        lines += ["ITEM: ATOMS id x y vx vy omegaz\n"]
        lines += [
            f"{r.id:.0f} {r.x:g} {r.y:g} {r.vx:g} {r.vy:g} {r.omega:g}\n"
            for r in rows.sample(frac=1, random_state=step).itertuples()
        ]
    (folder / "a.dump").write_text("".join(lines))
    return folder / "a.dump"


def frames(form: Any) -> Callable[[pd.DataFrame, Path], Path]:
    def made(table: pd.DataFrame, folder: Path) -> Path:
        writer = FrameWriter(folder / "frames", form)
        for t, rows in table.groupby("t"):
            state = {
                "x": rows[["x", "y"]],
                "v": rows[["vx", "vy"]],
                "angle": rows.angle,
                "omega": rows.omega,
                "radius": rows.x * 0 + 1,
            }
            writer.write(float(t), {name: np.array(value) for name, value in state.items()})
        return folder / "frames"

    return made


def vtk(table: pd.DataFrame, folder: Path) -> Path:
    """Legacy files as YADE's exporter writes them, in text."""
    (folder / "vtk").mkdir()
    for k, (_, rows) in enumerate(table.groupby("t")):
        text = f"# vtk DataFile Version 3.0.\nmade by hand\nASCII\n\nDATASET POLYDATA\nPOINTS {len(rows)} double\n"
        text += "".join(f"{r.x:.8g} {r.y:.8g} 0\n" for r in rows.itertuples()) + f"\nPOINT_DATA {len(rows)}\n"
        text += "SCALARS omega double 1\nLOOKUP_TABLE default\n" + "".join(f"{w:.8g}\n" for w in rows.omega)
        text += "VECTORS velocity double\n" + "".join(f"{r.vx:.8g} {r.vy:.8g} 0\n" for r in rows.itertuples())
        (folder / "vtk" / f"s-{k}.vtk").write_text(text)
    return folder / "vtk"


def vtu(table: pd.DataFrame, folder: Path) -> Path:
    """XML files as VTK's own writer makes them: appended, packed, in base 64."""
    (folder / "vtu").mkdir()
    for k, (_, rows) in enumerate(table.groupby("t")):
        tail, heads, offset = "", [], 0
        flat = np.zeros(len(rows))
        for name, columns in (("Points", ("x", "y")), ("linVel", ("vx", "vy")), ("omega", ("omega",))):
            values = np.column_stack([*(rows[c] for c in columns), *([flat] if len(columns) == 2 else [])])
            packed = zlib.compress(values.tobytes())
            head = struct.pack("<IIII", 1, values.nbytes, values.nbytes, len(packed))
            text = base64.b64encode(head).decode() + base64.b64encode(packed).decode()
            heads.append(
                f'<DataArray type="Float64" Name="{name}" NumberOfComponents="{values.shape[1]}" format="appended" offset="{offset}"/>'
            )
            tail, offset = tail + text, offset + len(text)
        (folder / "vtu" / f"s-{k}.vtu").write_text(
            '<VTKFile type="UnstructuredGrid" byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">'
            f'<UnstructuredGrid><Piece NumberOfPoints="{len(rows)}"><PointData>{heads[1]}{heads[2]}</PointData><Points>{heads[0]}</Points>'
            f'</Piece></UnstructuredGrid><AppendedData encoding="base64">_{tail}</AppendedData></VTKFile>'
        )
    return folder / "vtu"


def parquet(table: pd.DataFrame, folder: Path) -> Path:
    table.to_parquet(folder / "a.parquet")
    return folder / "a.parquet"


def arrays(table: pd.DataFrame, folder: Path) -> Path:
    shape = (table.t.nunique(), -1)
    stacked = {
        name: np.stack([table[c].to_numpy().reshape(shape) for c in pair], axis=2)
        for name, pair in (("x", ["x", "y"]), ("v", ["vx", "vy"]))
    }
    np.savez(folder / "a.npz", t=table.t.unique(), omega=table.omega.to_numpy().reshape(shape), **stacked)
    return folder / "a.npz"


FORMS = {
    "lammps": lammps,
    "npz frames": frames("npz"),
    "vtp": frames("vtk"),
    "vtk": vtk,
    "vtu": vtu,
    "parquet": parquet,
    "npz": arrays,
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("wrong", [False, True])
def test_every_format(tmp_path: Path, form: str, wrong: bool) -> None:
    """Two disks in flight, one of which jumps."""
    t = np.repeat(np.arange(12) * 0.01, 2)
    disk = np.tile([0, 1], 12)
    table = pd.DataFrame({"t": t, "id": disk, "x": disk + 0.25 * t, "y": 2.0 + 0.5 * t - 0.5 * G * t * t})
    table = table.assign(vx=0.25, vy=0.5 - G * t, omega=1.0 + disk, angle=(1.0 + disk) * t)
    if wrong:
        table.loc[(table.id == 1) & (table.t > 0.055), "x"] += 1e-3
    file = FORMS[form](table, tmp_path)
    reported = "gravity = [0.0, -9.81]\ntime = {dt = 1e-4, interval = 0.01}\ndisks = {radius = 0.1, mass = 1.0}\n"
    scene = tmp_path / "told.toml"
    scene.write_text(reported)
    _, checks = audited(file, "--scene", str(scene))
    assert violated(checks) == ({"motion"} if wrong else set()), {name: checks[name]["said"] for name in checks}
    assert checks["free"]["judged"] == 22


@pytest.mark.parametrize(
    ("tokens", "rule"),
    [
        ([f"{value:g}" for value in np.linspace(0.001, 90.0, 99) ** 1.3], Rounding(significant=6)),
        ([f"{value:.4f}" for value in np.linspace(0.001, 90.0, 99)], Rounding(decimals=4)),
        ([str(round(value, 3)) for value in np.geomspace(0.011, 90.0, 99)], Rounding(decimals=3)),
        ([f"{value:.5e}" for value in np.geomspace(1e-7, 90.0, 99)], Rounding(significant=6)),
        ([repr(float(np.float32(value))) for value in np.geomspace(1e-3, 90.0, 99)], Rounding(bits=24)),
        (["0.5", "0"], Rounding(significant=12)),  # exact numbers show no digits: the file's most
    ],
)
def test_digits_are_read_off(tokens: list[str], rule: Rounding) -> None:
    assert Tokens(set(tokens)).rounding(12) == rule


TABLE = "t,id,x,y,vx,vy\n0,1,0,1,0,0\n0.1,1,0,1,0,0\n"
STATED = "time = {dt = 1e-3}\ndisks = {radius = 0.1, mass = 1.0}\n"
DUMP = (
    "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS ff ff pp\n0 1\n0 1\n0 1\nITEM: ATOMS id x y\n1 0 0\n"
)


@pytest.mark.parametrize(
    ("text", "reported", "said"),
    [
        (TABLE.replace("0.1,1,0", "0.1,1,zero"), STATED, ["a.csv, line 3, column 3 (x)", "'zero' is no number"]),
        (TABLE + "0.2,1,0\n", STATED, ["a.csv, line 4: 3 columns, expected 6"]),
        (TABLE.replace("t,id", "when,id"), STATED, ["line 1", "neither a column t nor step", "[columns]"]),
        (TABLE.replace(",x,", ",pos,"), STATED, ["no column x", "[columns] x"]),
        (TABLE[:25], STATED, ["too few frames", "two or more"]),
        ("1,2,3\n4,5,6\n", STATED, ["line 1", "column names"]),
        (TABLE, STATED.replace("1e-3", "0"), ["a.toml, line 1, column 9", "time.dt = 0", "> 0"]),
        (TABLE, STATED + "grvity = [0, 1]\n", ["a.toml, line 3, column 1", "'gravity'"]),
        (TABLE, STATED.replace("mass = 1.0", "density = 1, mass = 1"), ["give one of mass and density"]),
        (TABLE, STATED.replace(", mass = 1.0", ""), ["no column mass", "[disks] mass"]),
        (TABLE, STATED.replace("0.1,", "[0.1, 0.2],"), ["disks.radius has 2 numbers", "1 disks"]),
        (TABLE, STATED + "walls = [{name = 'w', point = [0, 0]}]\n", ["wall 'w' lacks normal"]),
        (TABLE, STATED + "walls = [{point = [0, 0], normal = [0, 1], motion = {speed = 1}}]\n", ["motion", "velocity"]),
        (TABLE, "x = \n", ["a.toml", "line 1"]),
        (DUMP, STATED, ["ends after 1 of 2 lines", "cut the file before line 9"]),
        (DUMP.replace("x y", "a b"), STATED, ["no column x and no y", "[columns] x"]),
        (DUMP + "2 0 0\nrubbish\n", STATED, ["line 12", "'ITEM: ...' should stand"]),
        ("\x00\xff", STATED, ["a.csv"]),
        (TABLE, STATED.replace("mass = 1.0", "mass = 1.0, inertia = [2]"), ["disks.inertia", "> 0 and <= 1"]),
        (
            "t,id,x,y,z\n0,1,0,1,0\n0.1,1,0,1,0.5\n",
            "gravity = [0, -9.81]\n" + STATED,
            ["a.csv", "z goes from 0 to 0.5", "dimension = 3"],
        ),
        (TABLE, "gravity = [0, 0, -9.81]\n" + STATED, ["a.csv has no column z", "dimension = 2"]),
        (TABLE.replace(",vx,vy", ",u,w"), STATED, ["three or more where it has no vx, vy"]),
    ],
)
def test_bad_files_name_the_place_and_the_remedy(tmp_path: Path, text: str, reported: str, said: list[str]) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="latin-1")
    (tmp_path / "a.toml").write_text(reported)
    done = ninedisk("audit", str(tmp_path / "a.csv"))
    assert done.exit_code == 2, done.output
    for words in said:
        assert words in done.output
    assert "Traceback" not in done.output


def test_the_page_holds_verdicts_and_the_place(start_files: Path, tmp_path: Path) -> None:
    edit, lost = PLANTED["jump: a position, once"][1], PLANTED["lost"][1]
    file = start_files / "trajectory.csv"
    write(lost(edit(pd.read_csv(file))), file)
    assert ninedisk("audit", str(file), "--out", str(tmp_path / "page")).exit_code == 1
    page = (tmp_path / "page" / "index.html").read_text()
    assert all(f"<dt>{word}</dt><dd>{meaning}" in page for word, meaning in VERDICTS["audit"].items())
    record = json.loads((tmp_path / "page" / "audit.json").read_text())
    assert page.index('id="motion"') < page.index('id="verdicts"')
    assert 'class="marked"' in page
    for check in record["checks"]:
        assert check["title"] in page
    assert "http" not in page.replace("http://www.w3.org", "").partition("<body>")[2]
