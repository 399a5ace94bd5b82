"""MercuryDPM's .data and .fstat, after its documentation, by runs of our own DEM: right ones pass, faults are named, traps refused."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninedisk_tests_written import DENSE, TOML, Run, make_run, mercury, table
from typer.testing import CliRunner

from ninedisk.core import ContactLaw, Disks, History, Numerics, Scene, Wall, simulate
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.audit.run import audit
from ninedisk.harness.audit.scene_file import scene_of_text
from ninedisk.harness.cli.app import app

R = np.array([0.1, 0.08, 0.12])
WALLS = (("left", (0.0, 0.0), (1.0, 0.0)), ("floor", (0.0, 0.0), (0.0, 1.0)))
PAIRS = [(i, j) for i in range(3) for j in range(i + 1, 5)]
PLANE = """gravity = [-2.0, -9.81]
time = {dt = 1e-5}
disks = {density = 1000.0}
contact = {mu = 0.3, kn = 1e5, ks = 8e4, lever_arm = "overlap"}
"""
LISTED = '[contacts]\nfile = "run.fstat"\n'


def walls(*names: str) -> str:
    given = {name: (list(point), list(normal)) for name, point, normal in WALLS}
    return "".join(
        f'[[walls]]\nname = "{name}"\npoint = {given[name][0]}\nnormal = {given[name][1]}\n' for name in names
    )


@dataclass(frozen=True)
class Files:
    """Lines of both files, which a test may change."""

    data: list[str]
    fstat: list[str]

    def write(self, folder: Path) -> Path:
        (folder / "run.data").write_text("\n".join(self.data) + "\n")
        (folder / "run.fstat").write_text("\n".join(self.fstat) + "\n")
        return folder / "run.data"


@pytest.fixture(scope="module")
def history() -> History:
    """Two disks in a corner and one beside them on the floor, spinning."""
    law = ContactLaw(kn=1e5, ks=8e4, mu=0.3, lever_arm="overlap")
    scene = Scene(
        disks=Disks(
            x=[(0.1, 0.1005), (0.279, 0.081), (0.6, 0.1205)], radius=R, mass=1000.0 * np.pi * R**2,
            v=[(0.0, 0.0), (-0.3, 0.0), (0.1, -0.5)], omega=[2.0, -3.0, 5.0],
        ),
        walls=tuple(Wall(name=name, point=point, normal=normal, law=law) for name, point, normal in WALLS),
        disk_disk=law,
        gravity=(-2.0, -9.81),
    )  # fmt: skip
    return simulate(scene, Numerics(dt=2e-4, n_steps=100, contact_dt=1e-5), watch=PAIRS)


@pytest.fixture
def files(history: History) -> Files:
    data, fstat = [], []
    for k, t in enumerate(history.t):
        data.append(f"3 {t:.10g} 0 0 1 1 ")
        x, v = history.x[k], history.v[k]
        for i in range(3):
            # The angle as it is, the spin with the other sign.
            rest = (*v[i], R[i], history.angle[k, i], -history.omega[k, i])
            data.append(" ".join([f"{each:.15g}" for each in x[i]] + [f"{each:.10g}" for each in rest] + ["0"]))
        fstat += [f"# {t:.10g} 1", "# 0 0 0 1 1 0", f"# {R.min()} {R.max()} 0 0 0 0"]
        for c, (i, j) in enumerate(PAIRS):
            if history.fn[k, c] == 0.0:
                continue
            apart = x[i] - x[min(j, 2)]
            n = np.array(WALLS[j - 3][2]) if j > 2 else apart / np.sqrt(apart @ apart)
            side = np.array([-n[1], n[0]]) * np.sign(history.fs[k, c])
            forces = f"0 0 0 {-history.gap[k, c]:.10g} 0 {history.fn[k, c]:.10g} {abs(history.fs[k, c]):.10g}"

            def row(
                a: int, b: int, sign: float, t: float = t, n: Any = n, side: Any = side, forces: str = forces
            ) -> str:
                ends = " ".join(f"{sign * each:.10g}" for each in (*n, 0.0, *side, 0.0))
                return f"{t:.10g} {a} {b} {forces} {ends}"

            fstat += [row(i, 2 - j, -1.0)] if j > 2 else [row(i, j, 1.0), row(j, i, -1.0)]
    return Files(data, fstat)


def record(file: Path, toml: str) -> dict[str, Any]:
    return audit(file, scene_of_text(toml, str(file.with_name("run.toml"))), lambda *_: None)


def check(found: dict[str, Any], name: str) -> dict[str, Any]:
    return next(each for each in found["checks"] if each["id"] == name)


def violated(found: dict[str, Any]) -> list[str]:
    return [check["id"] for check in found["checks"] if check["verdict"] == "violated"]


RIGHT = PLANE + LISTED + walls("left", "floor")


def test_a_right_run_in_the_plane_passes_with_its_contacts(files: Files, tmp_path: Path) -> None:
    found = record(files.write(tmp_path), RIGHT)
    assert violated(found) == [], found["checks"][0]["said"]
    holds = {each["id"] for each in found["checks"] if each["verdict"] == "holds"}
    assert {"free", "momentum", "spin", "motion", "energy", "overlap", "cone", "history"} <= holds
    assert found["form"] == "MercuryDPM data"
    assert any("spins in the plane with the other sign" in each for each in found["remarks"])


def test_each_contact_counts_once(files: Files, history: History, tmp_path: Path) -> None:
    files.write(tmp_path)
    read = list(read_trajectory(tmp_path / "run.fstat", {}, ()).frames(lambda *_: None))
    assert len(read) == len(history.t)
    assert [len(frame.columns["fn"]) for frame in read] == (history.fn > 0.0).sum(axis=1).tolist()
    one = next(frame for frame in read if (frame.columns["j"] == -2).any())
    at = int(np.flatnonzero(one.columns["j"] == -2)[0])
    assert [one.columns[f"n{axis}"][at] for axis in "xyz"] == [0.0, 1.0, 0.0]


def test_friction_beyond_the_cone_is_named(files: Files, tmp_path: Path) -> None:
    assert "cone" in violated(record(files.write(tmp_path), RIGHT.replace("mu = 0.3", "mu = 0.25")))


def test_another_gravity_is_named(files: Files, tmp_path: Path) -> None:
    assert "free" in violated(record(files.write(tmp_path), RIGHT.replace("-9.81", "-9.80")))


def test_spins_with_their_own_sign_are_named(files: Files, tmp_path: Path) -> None:
    """What a reader would get that takes the column for the spin."""
    rows = [line.split() for line in files.data]
    lines = [" ".join([*w[:6], str(-float(w[6])), w[7]]) if len(w) == 8 else " ".join(w) for w in rows]
    assert "spin" in violated(record(Files(lines, files.fstat).write(tmp_path), RIGHT))


@pytest.mark.parametrize(("toml", "match"), [
    (PLANE + LISTED + walls("floor", "left"), r"touches wall -\d along .* wall \d, '(floor|left)', has the normal"),
    (PLANE + LISTED + walls("left"), "touches wall -2, and the TOML has 1 walls"),
    (PLANE + walls("left", "floor") + 'periodic = ["z"]', r"periodic = \['z'\] is not allowed"),
])  # fmt: skip
def test_tomls_that_do_not_fit_are_refused(toml: str, match: str, files: Files, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=match):
        record(
            files.write(tmp_path), "\n".join(sorted(toml.split("\n"), key=lambda line: not line.startswith("periodic")))
        )


def test_unknown_walls_are_not_compared(files: Files, tmp_path: Path) -> None:
    found = record(files.write(tmp_path), 'walls = "unknown"\n' + PLANE + LISTED)
    assert check(found, "cone")["verdict"] != "violated"


def edit(lines: list[str], start: str, new: Callable[[list[str]], list[str]], after: int = 0) -> None:
    at = next(k for k, line in enumerate(lines) if line.startswith(start)) + after
    lines[at] = " ".join(new(lines[at].split()))


def replaced(place: int, word: str) -> Callable[[list[str]], list[str]]:
    return lambda words: [*words[:place], word, *words[place + 1 :]]


@pytest.mark.parametrize(("change", "match"), [
    (lambda f: edit(f.data, "3 0.002 ", replaced(0, "2")), r"line 41, frame 11: 2 bodies, and 3 in the first"),
    (lambda f: edit(f.data, "3 0.002 ", replaced(4, "0.09"), 2), r"frame 11: row 1 has the radius 0\.09, and 0\.08"),
    (lambda f: edit(f.data, "3 0.002 ", replaced(4, "0"), 2), r"frame 11: the radius of row 1 is 0.*clumps"),
    (lambda f: f.data.__delitem__(42), r"run\.data, line 44: 6 columns, expected 8"),
    (lambda f: f.data.insert(44, f.data[43]), r"line 45, frame 12: .* is no header, 6 numbers"),
    (lambda f: f.data.pop(), r"frame 101 ends after 2 of 3 lines: cut off"),
    (lambda f: edit(f.fstat, "0.002 ", replaced(0, "0.0022")), r"a contact of t = 0\.0022 behind the header of t = 0\.002"),
    (lambda f: edit(f.fstat, "0.002 1 0 ", replaced(8, "7")), r"the contact of 1 and 0 is listed twice, with fn .* and 7"),
    (lambda f: edit(f.fstat, "0.002 ", lambda words: words[:9]), r"run\.fstat, line \d+: 9 columns, expected 16"),
    (lambda f: edit(f.fstat, "# 0.002 ", lambda words: words[:2]), r"run\.fstat, line \d+: '# 0\.002' is not line 1"),
    (lambda f: f.fstat.pop(1), r"line 3: .* is not line 3 of a frame's head"),
])  # fmt: skip
def test_traps_and_damage_are_refused(change: Callable[[Files], Any], match: str, files: Files, tmp_path: Path) -> None:
    changed = Files(list(files.data), list(files.fstat))
    change(changed)
    with pytest.raises(UsageError, match=match):
        record(changed.write(tmp_path), RIGHT)


def test_a_file_of_contacts_whose_last_line_has_no_end_is_cut_off(files: Files, tmp_path: Path) -> None:
    file = files.write(tmp_path)
    contacts = tmp_path / "run.fstat"
    contacts.write_text(contacts.read_text()[:-3])
    with pytest.raises(UsageError, match=r"run\.fstat, line \d+: the last line has no end"):
        record(file, RIGHT)


def spoilt(raw: bytes, damage: str, rng: random.Random) -> bytes:
    at = rng.randrange(200, len(raw) - 200)
    many = rng.randrange(3, 60)
    return {
        "cut": raw[:at], "less": raw[:at] + raw[at + many :], "twice": raw[: at + many] + raw[at:],
        "noise": raw[:at] + rng.randbytes(many) + raw[at + many :], "zeros": raw[:at] + bytes(many) + raw[at + many :],
    }[damage]  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("damage", ["cut", "less", "twice", "noise", "zeros"])
def test_damaged_contacts_are_named_or_are_numbers_still(damage: str, seed: int, files: Files, tmp_path: Path) -> None:
    """A force of which digits are lost is a force: only its place is right."""
    file = files.write(tmp_path)
    contacts = tmp_path / "run.fstat"
    contacts.write_bytes(spoilt(contacts.read_bytes(), damage, random.Random(f"{damage} {seed}")))
    (tmp_path / "run.toml").write_text(RIGHT)
    done = CliRunner().invoke(app, ["audit", str(file), "--scene", str(tmp_path / "run.toml")])
    assert "internal error" not in done.output
    assert done.exit_code in (0, 1, 2)
    if done.exit_code == 2:
        assert re.search(r"run\.fstat(, line \d+)?", done.output), done.output
    if done.exit_code == 0:
        read = read_trajectory(contacts, {}, ()).frames(lambda *_: None)
        assert all(np.isfinite(frame.columns["fn"]).all() for frame in read)


def test_times_before_anything_is_inserted_are_left_out(files: Files, tmp_path: Path) -> None:
    lines = ["0 -0.0002 0 0 1 1 ", *files.data]
    empty = ["# -0.0002 1", "# 0 0 0 1 1 0", "# nan nan 0 0 0 0", *files.fstat]
    found = record(Files(lines, empty).write(tmp_path), RIGHT)
    assert violated(found) == []
    assert found["frames"] == 101


def test_info_that_is_no_species_is_no_type(files: Files, tmp_path: Path) -> None:
    lines = [line[:-1] + "0.25" if len(line.split()) == 8 else line for line in files.data]
    files.write(tmp_path)
    assert "type" in read_trajectory(tmp_path / "run.data", {}).names
    Files(lines, files.fstat).write(tmp_path)
    read = read_trajectory(tmp_path / "run.data", {})
    assert "type" not in read.names
    assert any("no number of a species" in each for each in read.remarks)


def test_times_have_the_digits_of_velocities(files: Files, tmp_path: Path) -> None:
    """Times such as 0.0002 show one digit and have ten."""
    rules = read_trajectory(files.write(tmp_path), {}).rounding
    assert (rules["t"].significant, rules["vx"].significant, rules["x"].significant) == (10, 10, 15)


def wrapped(folder: Path) -> Path:
    """Spheres in flight through a domain that repeats along x."""
    run = make_run(frames=60)
    rows = run.rows.copy()
    rows[:, :, 0] = (rows[:, :, 0] - 0.02) % 3.0
    file = folder / "run.data"
    mercury(file, Run(run.step, run.t, rows))
    file.write_text(file.read_text().replace(" -9 -9 -9 9 9 9 ", " 0 -9 -9 3 9 9 "))
    return file


def test_a_leap_by_the_length_of_the_domain_asks_whether_it_repeats(tmp_path: Path) -> None:
    file = wrapped(tmp_path)
    with pytest.raises(
        UsageError, match=r'sphere 0 leaps along x by the length of the domain, 3: .*periodic = \["x"\]'
    ):
        record(file, TOML + DENSE)


def test_a_domain_that_repeats_is_followed_across_its_edge(tmp_path: Path) -> None:
    file = wrapped(tmp_path)
    assert violated(record(file, 'periodic = ["x"]\n' + TOML + DENSE)) == []


def test_periodic_is_refused_of_files_that_have_no_domain(tmp_path: Path) -> None:
    table(tmp_path / "run.csv", make_run(frames=4))
    with pytest.raises(UsageError, match=r"run\.csv \(table\) has no domain"):
        record(tmp_path / "run.csv", 'periodic = ["x"]\n' + TOML + DENSE)


def test_one_frame_of_many_files_and_contacts_alone_are_no_trajectory(files: Files, tmp_path: Path) -> None:
    files.write(tmp_path)
    (tmp_path / "run.data.17").write_text("\n".join(files.data[:4]) + "\n")
    with pytest.raises(
        UsageError, match=r"run\.data\.17 is one frame of MercuryDPM: join all, `cat \$\(ls -v run\.data\.\*\)"
    ):
        read_trajectory(tmp_path / "run.data.17", {})
    with pytest.raises(
        UsageError, match=r'run\.fstat holds contacts of MercuryDPM: give its \.data.*file = "run\.fstat"'
    ):
        read_trajectory(tmp_path / "run.fstat", {})
