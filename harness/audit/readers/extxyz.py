"""Extended XYZ, as `dump extxyz` of LAMMPS and ASE write it: one frame in memory."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.binary import found_columns, unread, vector_names
from ninedisk.harness.audit.readers.columns import (
    SAMPLED,
    Frame,
    Progress,
    Trajectory,
    halved,
    halved_rounding,
    numbers_of,
    open_file,
    sample_roundings,
)
from ninedisk.harness.audit.readers.rounding import Tokens

PAIR = re.compile(r"""([A-Za-z_][\w-]*)=(?:"([^"]*)"|\{([^}]*)\}|(\S+))""")
TIMES, STEPS = ("Time", "time"), ("Timestep", "step", "Step")
WORDS = ("S", "L")
"""Kinds of columns that are no numbers."""


def is_extended_xyz(first: str, second: str) -> bool:
    """Whether the first two lines of a text are those of a frame."""
    return first.strip().isdigit() and "Properties=" in second


def _head(text: str, where: str) -> dict[str, str]:
    """Keys and values of the second line of a frame."""
    found = {match[1]: next(each for each in match.groups()[1:] if each is not None) for match in PAIR.finditer(text)}
    if "Properties" not in found:
        raise UsageError(
            f"{where}: the second line of a frame has no Properties=...: of XYZ, the extended form is read (LAMMPS: `dump extxyz`)"
        )
    return found


class _Columns:
    """Columns by the ``Properties`` of the first frame."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self.text = path, text
        parts = text.split(":")
        if len(parts) % 3 or not all(size.isdigit() and 0 < int(size) < 1000 for size in parts[2::3]):
            raise UsageError(f"{path}, line 2: Properties={text} should be name:kind:number, repeated")
        self.names: list[str] = []
        self.numbers: list[int] = []
        for name, kind, size in zip(parts[::3], parts[1::3], map(int, parts[2::3]), strict=True):
            if kind not in ("R", "I", *WORDS):
                raise UsageError(f"{path}, line 2: the kind of {name} is {kind!r}; it must be R, I, S or L")
            if kind not in WORDS:
                self.numbers += range(len(self.names), len(self.names) + size)
            self.names += vector_names(name, 0 if size == 1 else size)
        if len(set(self.names)) < len(self.names):
            raise UsageError(f"{path}, line 2: a name appears twice in Properties={text}")

    @property
    def numeric(self) -> list[str]:
        return [self.names[k] for k in self.numbers]


def read_extended_xyz(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a file.

    Raises
    ------
    UsageError
        Naming file, line, frame and the way out; while frames are read, too.
    """
    with open_file(path) as stream:
        stream.readline()
        head = _head(stream.readline(), f"{path}, line 2")
    layout = _Columns(path, head["Properties"])
    found = found_columns(layout.numeric, columns, path, needed)
    clock = "step" if any(key in head for key in STEPS) else "t" if any(key in head for key in TIMES) else "index"
    rounding = halved_rounding(sample_roundings(path, layout.names, None, found))
    if clock == "t":
        rounding["t"] = _time_tokens(path).rounding(1)

    def frames(progress: Progress) -> Iterator[Frame]:
        yield from _frames(path, layout, found, progress)

    remarks = []
    if clock == "step" and any(key in head for key in TIMES):
        remarks.append("t is the step times time.dt: LAMMPS prints Time with six decimals")
    if "Lattice" in head and "pbc" not in head:
        remarks.append("Lattice without pbc: taken as periodic in all directions, as the format says")
    if "diameter" in found.values():
        remarks.append("radius is half of the column diameter")
    remarks += unread(layout.names, found)
    kept = frozenset({"radius" if name == "diameter" else name for name in found.values()})
    return Trajectory(path, "extended XYZ", frames, rounding, clock, kept, tuple(remarks))


def _time_tokens(path: Path) -> Tokens:
    """Printed times near both ends."""
    with open_file(path) as stream:
        text = stream.read(SAMPLED)
    if path.suffix not in (".gz", ".zst"):
        with path.open("rb") as raw:
            raw.seek(max(0, path.stat().st_size - SAMPLED))
            text += raw.read().decode("utf-8", "replace")
    return Tokens(set(re.findall(r"\b[Tt]ime=\"?([-+]?[0-9.]+(?:[eE][-+]?\d+)?)", text)))


def _number(head: Mapping[str, str], keys: Sequence[str], where: str) -> float:
    text = next((head[key] for key in keys if key in head), None)
    if text is None:
        return np.nan
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(f"{where}: {keys[0]}={text[:40]} is no number") from error


def _cell(head: Mapping[str, str], where: str) -> FloatArray | None:
    """Edges of the box (rows), NaN where nothing repeats."""
    if "Lattice" not in head:
        return None
    flags = head.get("pbc", "T T T").replace(",", " ").split()
    try:
        edges = np.array([float(word) for word in head["Lattice"].split()])
    except ValueError as error:
        raise UsageError(f"{where}: Lattice={head['Lattice'][:60]!r} should be nine numbers ({error})") from error
    if edges.shape != (9,) or not np.isfinite(edges).all() or len(flags) != 3 or not set(flags) <= {"T", "F", "1", "0"}:
        raise UsageError(f"{where}: expected nine numbers as Lattice and three of T and F as pbc")
    return np.asarray(np.where(np.array([flag in ("T", "1") for flag in flags])[:, None], edges.reshape(3, 3), np.nan))


def _frames(path: Path, layout: _Columns, found: Mapping[str, str], progress: Progress) -> Iterator[Frame]:
    size = path.stat().st_size
    line = done = number = 0
    with open_file(path) as stream:
        while text := stream.readline():
            line += 1
            done += len(text)
            if not text.strip():
                continue
            where = f"{path}, line {line}, frame {number + 1}"
            if not text.strip().isdigit():
                raise UsageError(
                    f"{where}: {text.strip()[:40]!r} where the number of rows should stand: the frame before has more, or "
                    "the file is damaged there"
                )
            count = int(text)
            text = stream.readline()
            line += 1
            done += len(text)
            if not text.endswith("\n"):
                raise UsageError(
                    f"{where}: the file ends within the head of the frame: cut off; cut the file before it"
                )
            head = _head(text, f"{path}, line {line}, frame {number + 1}")
            where = f"{path}, line {line}, frame {number + 1}"
            if head["Properties"] != layout.text:
                raise UsageError(f"{where}: Properties={head['Properties'][:200]}, expected {layout.text[:200]}")
            begin = line + 1
            lines = list(islice(stream, count))
            if len(lines) < count or (lines and not lines[-1].endswith("\n")):
                raise UsageError(
                    f"{path}, line {line + len(lines)}: frame {number + 1} ends after {len(lines)} of {count} lines or within one: cut "
                    f"off; cut the file before line {begin - 2}"
                )
            line += count
            done += sum(map(len, lines))
            values = _values(lines, layout, path, begin)
            step, t = _number(head, STEPS, where), _number(head, TIMES, where)
            progress(done >> 10, size >> 10, "kB read")
            number += 1
            part = {here: values[name] for name, here in found.items()}
            whole = int(step) if np.isfinite(step) else number - 1
            yield Frame(whole, t, halved(part), f"frame {number}, line {begin}", _cell(head, where))


def _values(lines: list[str], layout: _Columns, path: Path, begin: int) -> dict[str, FloatArray]:
    """Columns of numbers; words between them are left out."""
    if len(layout.numbers) < len(layout.names):
        rows = []
        for k, text in enumerate(lines):
            words = text.split()
            if len(words) != len(layout.names):
                raise UsageError(
                    f"{path}, line {begin + k}: {len(words)} columns, expected {len(layout.names)} ({' '.join(layout.names)}): cut off or "
                    "damaged"
                )
            rows.append(" ".join([words[at] for at in layout.numbers]) + "\n")
        lines = rows
    if not lines:
        return {name: np.empty(0) for name in layout.numeric}
    return numbers_of(lines, layout.numeric, None, path, begin)
