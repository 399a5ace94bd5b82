"""Damaged files of every format, by fixed seeds: no traceback, no pass of what is damaged, messages that name file and place.

A damage that leaves every number as it was, in padding for instance, may pass.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninedisk_tests_written import DENSE, FORMATS, PLAIN, TOML, Run, gsd, make_run, netcdf, npz, vtk_inline, vtk_raw
from typer.testing import CliRunner

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.read import read_trajectory
from ninedisk.harness.cli.app import app

TEXT = ("dump", "yaml", "csv", "extxyz", "yade", "vtk-text", "vtk-pieces", "mercury")
FOLDERS = ("yade", "vtk-raw", "vtk-inline", "vtk-text", "vtk-pieces")
TIMED = tuple(name for name in FORMATS if name not in FOLDERS)
COLUMNS = ("x", "y", "z", "vx", "vy", "vz", "omegax", "omegay", "omega")


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run(frames=8)


def audited(path: Path) -> tuple[int, str]:
    path.with_name("audit.toml").write_text(TOML + (DENSE if path.suffix == ".data" else PLAIN))
    done = CliRunner().invoke(app, ["audit", str(path)])
    return done.exit_code, done.output


def is_unharmed(path: Path, run: Run) -> bool:
    """Whether the file has the numbers of the run still, to the digits that it prints."""
    try:
        frames = list(read_trajectory(path, {}).frames(lambda *_: None))
    except UsageError:
        return False
    if len(frames) != len(run.t):
        return False
    for k, frame in enumerate(frames):
        for c, name in enumerate(COLUMNS):
            if name not in frame.columns or len(frame.columns[name]) != run.rows.shape[1]:
                return False
            order = np.argsort(frame.columns["id"]) if "id" in frame.columns else slice(None)
            if not np.allclose(frame.columns[name][order], run.rows[k, :, c], rtol=1e-5, atol=1e-6):
                return False
    return True


def judge(path: Path, run: Run) -> None:
    """No traceback; named, or unharmed."""
    code, said = audited(path)
    assert "Traceback" not in said
    assert "internal error" not in said, said
    assert code in (0, 1, 2), said
    if code == 0:
        assert is_unharmed(path, run), said
        return
    assert path.name in said, said
    assert re.search(
        r"line \d|frame|rows|column|bytes|header|array|cut off|damaged|step \d|cannot be read|no name|no index", said
    ), said


@dataclass
class Numbers:
    """A run whose numbers may be spoilt before it is written."""

    run: Run
    rng: random.Random

    def one(self, value: float) -> Run:
        rows = self.run.rows.copy()
        rows[self.rng.randrange(1, len(rows)), self.rng.randrange(rows.shape[1]), self.rng.randrange(9)] = value
        return Run(self.run.step, self.run.t, rows)

    def jump(self) -> Run:
        rows = self.run.rows.copy()
        rows[self.rng.randrange(1, len(rows)) :, self.rng.randrange(rows.shape[1]), self.rng.randrange(3)] += 0.3
        return Run(self.run.step, self.run.t, rows)

    def swapped(self) -> Run:
        """Two frames in each other's place, with their times."""
        order = list(range(len(self.run.t)))
        a, b = self.rng.sample(order[1:], 2)
        order[a], order[b] = b, a
        return Run([self.run.step[k] for k in order], [self.run.t[k] for k in order], self.run.rows[order])

    def shuffled(self) -> Run:
        """Numbers of two frames in each other's place, times as they were."""
        order = list(range(len(self.run.t)))
        a, b = self.rng.sample(order[1:], 2)
        order[a], order[b] = b, a
        return Run(self.run.step, self.run.t, self.run.rows[order])


SPOILT: dict[str, Callable[[Numbers], Run]] = {
    "nan": lambda numbers: numbers.one(np.nan),
    "inf": lambda numbers: numbers.one(-np.inf),
    "huge": lambda numbers: numbers.one(1e36),
    "jump": Numbers.jump,
    "frames back": Numbers.swapped,
    "frames shuffled": Numbers.shuffled,
}


@pytest.mark.sampled(12)
@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("damage", SPOILT)
def test_spoilt_numbers_never_pass(name: str, damage: str, run: Run, tmp_path: Path) -> None:
    if damage == "frames back" and name in FOLDERS:
        pytest.skip("files are read in the order of their numbers")
    file, write = FORMATS[name]
    write(tmp_path / file, SPOILT[damage](Numbers(run, random.Random(f"{name} {damage}"))))
    code, said = audited(tmp_path / file)
    assert code in (1, 2), said
    assert "internal error" not in said
    assert file in said


def part_of(path: Path, rng: random.Random) -> Path:
    """The file itself, or one of the folder's."""
    return path if path.is_file() else rng.choice(sorted(path.iterdir())[1:])


def cut(raw: bytes, rng: random.Random) -> bytes:
    """Cut within a line or a number: the end of a frame looks like that of a file."""
    at = rng.randrange(len(raw) // 8, len(raw) - 1)
    while raw[at - 1 : at] in (b"\n", b".") or raw[:at].endswith(b"\n..."):
        at -= 1
    return raw[:at]


def noise(raw: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(raw))
    return raw[:at] + rng.randbytes(min(64, len(raw) - at)) + raw[at + 64 :]


def zeros(raw: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(raw))
    return raw[:at] + bytes(min(200, len(raw) - at)) + raw[at + 200 :]


def less(raw: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(raw) - 40)
    return raw[:at] + raw[at + rng.randrange(3, 40) :]


def twice(raw: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(raw) - 60)
    return raw[: at + 60] + raw[at:]


BYTES = {"cut": cut, "noise": noise, "zeros": zeros, "less": less, "twice": twice, "empty": lambda raw, _: raw[:0]}


@pytest.mark.sampled(40)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("damage", BYTES)
def test_damaged_bytes_are_named(name: str, damage: str, seed: int, run: Run, tmp_path: Path) -> None:
    rng = random.Random(f"{name} {damage} {seed}")
    file, write = FORMATS[name]
    write(tmp_path / file, run)
    part = part_of(tmp_path / file, rng)
    part.write_bytes(BYTES[damage](part.read_bytes(), rng))
    judge(tmp_path / file, run)


def swap_lines(lines: list[str], rng: random.Random) -> list[str]:
    a, b = rng.sample(range(len(lines)), 2)
    lines[a], lines[b] = lines[b], lines[a]
    return lines


def shuffle_lines(lines: list[str], rng: random.Random) -> list[str]:
    at = rng.randrange(len(lines) // 2)
    part = lines[at : at + 12]
    rng.shuffle(part)
    return [*lines[:at], *part, *lines[at + 12 :]]


def drop_line(lines: list[str], rng: random.Random) -> list[str]:
    del lines[rng.randrange(len(lines))]
    return lines


def double_line(lines: list[str], rng: random.Random) -> list[str]:
    at = rng.randrange(len(lines))
    return [*lines[:at], lines[at], *lines[at:]]


def other_count(lines: list[str], rng: random.Random) -> list[str]:
    """A whole number of a short line becomes another."""
    short = [k for k, line in enumerate(lines) if re.search(r"\b\d+\b", line) and len(line) < 40] or [len(lines) - 1]
    at = rng.choice(short)
    lines[at] = re.sub(r"\b\d+\b", rng.choice(["0", "3", "5", "-1", "1e9", "four", ""]), lines[at], count=1)
    return lines


def word(lines: list[str], rng: random.Random) -> list[str]:
    at = rng.randrange(len(lines) // 4, len(lines))
    numbers = list(re.finditer(r"-?\d+\.\d+", lines[at])) or list(re.finditer(r"\S+", lines[at]))
    if numbers:
        chosen = rng.choice(numbers)
        lines[at] = (
            lines[at][: chosen.start()]
            + rng.choice(["nan", "word", "1.2.3", "--5", "1e400"])
            + lines[at][chosen.end() :]
        )
    return lines


LINES = {
    "swap": swap_lines,
    "shuffle": shuffle_lines,
    "drop": drop_line,
    "double": double_line,
    "count": other_count,
    "word": word,
}


@pytest.mark.sampled(24)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", TEXT)
@pytest.mark.parametrize("damage", LINES)
def test_damaged_lines_are_named(name: str, damage: str, seed: int, run: Run, tmp_path: Path) -> None:
    rng = random.Random(f"{name} {damage} {seed}")
    file, write = FORMATS[name]
    write(tmp_path / file, run)
    part = part_of(tmp_path / file, rng)
    lines = LINES[damage](part.read_text().splitlines(), rng)
    part.write_text("\n".join(lines) + "\n")
    judge(tmp_path / file, run)


def wrong_order(path: Path, kind: str, run: Run) -> None:
    """Numbers whose bytes stand in the other order than the file says."""
    if kind in ("vtk-raw", "vtk-inline"):
        (vtk_raw if kind == "vtk-raw" else vtk_inline)(path, run)
        for file in path.iterdir():
            file.write_bytes(file.read_bytes().replace(b"LittleEndian", b"BigEndian"))
        return
    swapped = Run(run.step, run.t, run.rows.byteswap())
    (netcdf if kind == "netcdf" else npz)(path, swapped)


@pytest.mark.parametrize(
    ("kind", "file"), [("vtk-raw", "frames"), ("vtk-inline", "frames"), ("netcdf", "run.nc"), ("npz", "run.npz")]
)
def test_numbers_in_the_other_byte_order_never_pass(kind: str, file: str, run: Run, tmp_path: Path) -> None:
    wrong_order(tmp_path / file, kind, run)
    code, said = audited(tmp_path / file)
    assert code in (1, 2), said
    assert "internal error" not in said
    assert file in said


@pytest.mark.parametrize("write", [vtk_raw, vtk_inline])
def test_a_declared_byte_order_is_read(write: Callable[..., None], run: Run, tmp_path: Path) -> None:
    write(tmp_path / "frames", run, "f8", ">")
    code, said = audited(tmp_path / "frames")
    assert code == 0, said
    assert is_unharmed(tmp_path / "frames", run)


def test_big_endian_arrays_of_hdf5_and_numpy_are_read(run: Run, tmp_path: Path) -> None:
    for name in ("h5md", "npz"):
        file, write = FORMATS[name]
        write(tmp_path / file, run, ">f8")
        code, said = audited(tmp_path / file)
        assert code == 0, said
        assert is_unharmed(tmp_path / file, run)


@pytest.mark.parametrize("name", FORMATS)
def test_the_whole_file_passes(name: str, run: Run, tmp_path: Path) -> None:
    """So that no damage is named for another reason."""
    file, write = FORMATS[name]
    write(tmp_path / file, run)
    code, said = audited(tmp_path / file)
    assert code == 0, said
    assert is_unharmed(tmp_path / file, run)


@pytest.mark.parametrize("name", FOLDERS)
def test_a_file_that_is_missing_within_a_series_never_passes(name: str, run: Run, tmp_path: Path) -> None:
    file, write = FORMATS[name]
    write(tmp_path / file, run)
    sorted((tmp_path / file).iterdir())[4].unlink()
    code, said = audited(tmp_path / file)
    assert code in (1, 2), said


def empty_frame(path: Path, name: str, run: Run) -> None:
    if name == "gsd":

        def change(frame: Any, k: int) -> None:
            if k == 4:
                frame.particles.N = 0
                for each in (
                    "position",
                    "velocity",
                    "mass",
                    "diameter",
                    "orientation",
                    "moment_inertia",
                    "angmom",
                    "typeid",
                ):
                    setattr(frame.particles, each, np.zeros((0, *np.shape(getattr(frame.particles, each))[1:])))

        gsd(path, run, change=change)
        return
    FORMATS[name][1](path, run)
    if path.is_dir():
        part = sorted(path.iterdir())[4]
        part.write_text("".join(part.read_text().splitlines(keepends=True)[:2]))
        return
    text = path.read_text()
    if name == "yaml":
        frames = text.split("---\n")
        head = frames[4].partition("data:\n")[0].replace("natoms: 4", "natoms: 0")
        frames[4] = head + "data:\n...\n"
        path.write_text("---\n".join(frames))
    else:
        lines = text.splitlines()
        lines[4 * 6 : 5 * 6] = ["0", lines[4 * 6 + 1]]
        path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("name", ["yaml", "extxyz", "yade", "gsd"])
def test_an_empty_frame_is_named(name: str, run: Run, tmp_path: Path) -> None:
    file = FORMATS[name][0]
    empty_frame(tmp_path / file, name, run)
    code, said = audited(tmp_path / file)
    assert code == 2, said
    assert file in said
    assert "without spheres" in said


@pytest.mark.parametrize("k", [0, 4, 7])
def test_times_that_are_no_numbers_are_shown_on_screen_and_page(k: int, run: Run, tmp_path: Path) -> None:
    t = list(run.t)
    t[k] = float("nan")
    FORMATS["npz"][1](tmp_path / "run.npz", Run(run.step, t, run.rows))
    (tmp_path / "audit.toml").write_text(TOML + PLAIN)
    words = ["audit", str(tmp_path / "run.npz"), "--out", str(tmp_path / "page"), "--json", str(tmp_path / "a.json")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1, done.output
    assert "t = nan" in done.output
    assert (tmp_path / "page" / "index.html").exists()
