"""Malformed files, a hundred of a seeded generator: no traceback and no pass; the message names the file and the line or frame."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ninedisk.harness.cli.app import app

G = 9.81
SCENE = """gravity = [0.0, 0.0, -9.81]
time = {dt = 1e-4}
spheres = {radius = 0.1, mass = 1.5}
contact = {mu = 0.3, kn = 1e6, ks = 1e6}
"""
BODIES, FRAMES = 4, 6
NAMES = "id x y z vx vy vz omegax omegay omegaz"


def rows() -> list[list[list[float]]]:
    """Spheres in free flight: frames of rows in the order of `NAMES`."""
    rng = np.random.default_rng(5)
    x0, v0, w = rng.uniform(0, 1, (BODIES, 3)), rng.uniform(-1, 1, (BODIES, 3)), rng.uniform(-3, 3, (BODIES, 3))
    x0[:, 0] += np.arange(BODIES)
    found = []
    for k in range(FRAMES):
        t = 0.01 * k
        fall = np.array([0.0, 0.0, -G])
        x, v = x0 + v0 * t + 0.5 * fall * t * t, v0 + fall * t
        found.append([[i + 1, *x[i], *v[i], *w[i]] for i in range(BODIES)])
    return found


def dump() -> list[list[str]]:
    """Frames of lines of a LAMMPS dump, ids unsorted."""
    order = random.Random(1)
    made = []
    for k, frame in enumerate(rows()):
        lines = ["ITEM: TIMESTEP", str(100 * k), "ITEM: NUMBER OF ATOMS", str(BODIES), "ITEM: BOX BOUNDS ff ff ff"]
        lines += ["-9 9"] * 3 + [f"ITEM: ATOMS {NAMES}"]
        body = [" ".join(f"{each:.12g}" for each in row) for row in frame]
        order.shuffle(body)
        made.append(lines + body)
    return made


def table() -> list[list[str]]:
    """The same as a table, its head a separate frame."""
    made = [["t," + NAMES.replace(" ", ",")]]
    for k, frame in enumerate(rows()):
        made.append([f"{0.01 * k:g}," + ",".join(f"{each:.12g}" for each in row) for row in frame])
    return made


Frames = list[list[str]]
HEAD = {"dump": 9, "csv": 0}
"""Lines of a frame before its rows."""


def cut(frames: Frames, rng: random.Random, kind: str) -> str:
    """Within the rows of a frame, not at the end of a line."""
    text = "\n".join("\n".join(frame) for frame in frames) + "\n"
    lines = text.splitlines(keepends=True)
    at = rng.randrange(len(lines) // 2, len(lines))
    whole = lines[at].rstrip("\n")
    sep = "," if kind == "csv" else " "
    # A table's last number may lack digits and still be one: cut whole columns off it.
    return "".join(lines[:at]) + (sep.join(whole.split(sep)[: rng.randrange(1, max(2, whole.count(sep)))]))


def joined(frames: Frames) -> str:
    return "\n".join("\n".join(frame) for frame in frames) + "\n"


def pick(frames: Frames, rng: random.Random, kind: str) -> tuple[list[str], int]:
    """A frame but the first, and the number of one of its rows."""
    frame = frames[rng.randrange(2, len(frames))]
    return frame, rng.randrange(HEAD[kind], len(frame))


def token(frames: Frames, rng: random.Random, kind: str, word: str) -> str:
    frame, at = pick(frames, rng, kind)
    sep = "," if kind == "csv" else " "
    words = frame[at].split(sep)
    words[rng.randrange(2, len(words))] = word
    frame[at] = sep.join(words)
    return joined(frames)


def drop_row(frames: Frames, rng: random.Random, kind: str) -> str:
    frame, at = pick(frames, rng, kind)
    del frame[at]
    return joined(frames)


def double_row(frames: Frames, rng: random.Random, kind: str) -> str:
    frame, at = pick(frames, rng, kind)
    frame.insert(at, frame[at])
    return joined(frames)


def drop_head(frames: Frames, rng: random.Random, kind: str) -> str:
    frame, _ = pick(frames, rng, kind)
    del frame[rng.choice([0, 1, 2, 3, 5, 8]) if kind == "dump" else 0]
    return joined(frames)


def count(frames: Frames, rng: random.Random, kind: str) -> str:
    frame, at = pick(frames, rng, kind)
    if kind == "csv":
        frame[at] += ",1" * rng.choice([1, 3])
    else:
        frame[3] = rng.choice(["3", "5", "-1", "1e9", "four", "", "0"])
    return joined(frames)


def empty(frames: Frames, rng: random.Random, kind: str) -> str:
    frame, _ = pick(frames, rng, kind)
    if kind == "csv":
        del frames[1:]
    else:
        frame[3] = "0"
        del frame[9:]
    return joined(frames)


def frames_back(frames: Frames, rng: random.Random, _: str) -> str:
    a, b = rng.sample(range(1, len(frames)), 2)
    frames[a], frames[b] = frames[b], frames[a]
    return joined(frames)


def rows_across(frames: Frames, rng: random.Random, kind: str) -> str:
    a, b = rng.sample(range(1, len(frames)), 2)
    at = rng.randrange(HEAD[kind], len(frames[a]))
    to = rng.randrange(HEAD[kind], len(frames[b]))
    frames[a][at], frames[b][to] = frames[b][to], frames[a][at]
    return joined(frames)


def noise(frames: Frames, rng: random.Random, kind: str) -> str:
    frame, at = pick(frames, rng, kind)
    frame[at] = "".join(chr(rng.randrange(33, 900)) for _ in range(40))
    return joined(frames)


def head(frames: Frames, rng: random.Random, kind: str) -> str:
    at = 8 if kind == "dump" else 0
    words = re.split("[ ,]", frames[0][at])
    sep = "," if kind == "csv" else " "
    k = rng.randrange(3, 6)
    words[k] = rng.choice(["q", words[k - 1]])
    frames[0][at] = sep.join(words)
    return joined(frames)


def bounds(frames: Frames, rng: random.Random, kind: str) -> str:
    if kind == "csv":
        return token(frames, rng, kind, "--5")
    frames[rng.randrange(len(frames))][rng.randrange(5, 8)] = rng.choice(["a b", "1", "nan 2", "", "1 2 3 4 5"])
    return joined(frames)


DAMAGES: dict[str, Callable[[Frames, random.Random, str], str]] = {
    "cut": cut,
    "word": lambda frames, rng, kind: token(frames, rng, kind, "word"),
    "nan": lambda frames, rng, kind: token(frames, rng, kind, "nan"),
    "inf": lambda frames, rng, kind: token(frames, rng, kind, "-inf"),
    "huge": lambda frames, rng, kind: token(frames, rng, kind, "1e300"),
    "two points": lambda frames, rng, kind: token(frames, rng, kind, "1.2.3"),
    "drop row": drop_row,
    "double row": double_row,
    "drop head": drop_head,
    "count": count,
    "empty": empty,
    "frames back": frames_back,
    "rows across": rows_across,
    "noise": noise,
    "head": head,
    "bounds": bounds,
}
CASES = [(kind, name, seed) for kind in ("dump", "csv") for name in DAMAGES for seed in range(3)]


def audited(folder: Path, kind: str, text: str) -> tuple[int, str]:
    file = folder / f"a.{kind}"
    file.write_text(text, encoding="utf-8")
    (folder / "a.toml").write_text(SCENE)
    done = CliRunner().invoke(app, ["audit", str(file)])
    return done.exit_code, done.output


@pytest.mark.parametrize("kind", ["dump", "csv"])
def test_the_whole_file_passes(tmp_path: Path, kind: str) -> None:
    frames = dump() if kind == "dump" else table()
    code, said = audited(tmp_path, kind, joined(frames))
    assert code == 0, said
    code, said = audited(tmp_path, kind, joined(frames[:-1]))
    assert code == 0, said


@pytest.mark.parametrize(("kind", "name", "seed"), CASES)
def test_a_damaged_file_is_named_and_never_passes(tmp_path: Path, kind: str, name: str, seed: int) -> None:
    frames = dump() if kind == "dump" else table()
    code, said = audited(tmp_path, kind, DAMAGES[name](frames, random.Random(f"{name} {seed}"), kind))
    assert code in (1, 2), said
    assert "Traceback" not in said
    assert "internal error" not in said
    assert f"a.{kind}" in said
    assert re.search(r"line \d|frame|frames|rows|columns?", said), said
