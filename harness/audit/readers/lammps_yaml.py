"""Dumps of LAMMPS in YAML, `dump yaml`: a document for each frame, read line by line, one frame in memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.columns import (
    Frame,
    Progress,
    Trajectory,
    halved,
    numbers_of,
    open_file,
    sample_roundings,
)
from ninedisk.harness.audit.readers.lammps import HEAD, Box, DumpColumns, lengths_of_shares, opened_dump
from ninedisk.harness.audit.readers.rounding import Rounding

MARKS = " -[],\n\r"
"""What stands around the numbers of a row."""
KEYS = ("creator", "timestep", "units", "time", "natoms", "boundary", "thermo", "box", "keywords", "data")


class _YamlColumns(DumpColumns):
    """What the first document shows."""

    def read_head(self) -> None:
        with open_file(self.path) as stream:
            for line in islice(stream, HEAD):
                key, _, rest = line.partition(":")
                if key == "units":
                    self.units = rest.strip()
                elif key == "time":
                    self.timed = True
                elif key == "keywords":
                    self.names = _listed(rest)
                    break
        if not self.names:
            raise UsageError(
                f"{self.path}: no line 'keywords: [...]' among the first {HEAD}: this is no YAML of LAMMPS (`dump yaml`), or its first "
                "frame is cut off"
            )

    def sample(self, wanted: Mapping[str, str]) -> dict[str, Rounding]:
        return sample_roundings(self.path, self.names, ",", wanted, MARKS)


def _listed(text: str) -> list[str]:
    """Words of a list in brackets."""
    return [word.strip() for word in text.strip().strip("[]").split(",") if word.strip()]


def read_yaml_dump(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a dump in YAML.

    Raises
    ------
    UsageError
        Naming file, line, frame and the way out; while frames are read, too.
    """
    return opened_dump(_YamlColumns(path, columns, needed), _frames, "LAMMPS dump in YAML")


class _Document:
    """Lines of a file with their numbers, and what one document has shown so far."""

    def __init__(self, path: Path, lines: Iterator[str], names: Sequence[str]) -> None:
        self.path, self.lines, self.names = path, lines, names
        self.line = self.done = self.number = 0

    def next(self) -> str:
        """The next line; empty at the end of the file."""
        text = next(self.lines, "")
        self.line += bool(text)
        self.done += len(text)
        return text

    def where(self) -> str:
        return f"{self.path}, line {self.line}, frame {self.number + 1}"

    def cut(self) -> UsageError:
        return UsageError(
            f"{self.path}, line {self.line}: the file ends within frame {self.number + 1}, before its '...': cut off; cut the file before "
            "that frame"
        )

    def rows(self, count: int) -> list[str]:
        """Contents of so many rows in brackets."""
        found: list[str] = []
        for text in islice(self.lines, count):
            self.line += 1
            self.done += len(text)
            row = text.strip()
            if not (row.startswith("- [") and row.endswith("]")):
                raise UsageError(
                    f"{self.where()}: {row[:40]!r} where row {len(found) + 1} of {count} should stand, '- [ ... ]': cut off or damaged; "
                    "cut the file before that frame"
                )
            found.append(row[3:-1].rstrip(" ,") + "\n")
        if len(found) < count:
            raise self.cut()
        return found

    def number_of(self, key: str, text: str, *, whole: bool) -> float:
        """The number that a key has."""
        try:
            value = float(text)
            if np.isfinite(value) and not (whole and (value != int(value) or value < 0.0)):
                return value
        except ValueError:
            pass
        kind = "whole number >= 0" if whole else "number"
        raise UsageError(f"{self.where()}: {key} is {text.strip()[:40]!r}; it must be a {kind}")


def _frames(dump: DumpColumns, progress: Progress, boxes: bool) -> Iterator[Frame]:
    """Frames one after the other; ``boxes``: all edges instead of the periodic ones."""
    path, names = dump.path, dump.names
    size = path.stat().st_size
    with open_file(path) as stream:
        document = _Document(path, iter(stream), names)
        while text := document.next():
            if not text.strip():
                continue
            if text.strip() != "---":
                raise UsageError(
                    f"{document.where()}: {text.strip()[:60]!r} where '---' should stand, the beginning of a frame: the frame before has "
                    "more rows than its natoms says, or the file is damaged there"
                )
            frame = _document_frame(document, dump, boxes)
            progress(document.done >> 10, size >> 10, f"kB read, step {frame.step}")
            document.number += 1
            yield frame


def _document_frame(document: _Document, dump: DumpColumns, boxes: bool) -> Frame:
    """The frame of one document, up to its ``...``."""
    step = count = None
    t = np.nan
    bounds: list[list[str]] = []
    boundary = place = ""
    while text := document.next():
        key, _, rest = text.rstrip().partition(":")
        if bounds and key.startswith("  - [") and len(tilts := _listed(key.strip(" -"))) == 3:
            bounds = [[*bound, tilt] for bound, tilt in zip(bounds, tilts, strict=True)]
            continue
        if key not in KEYS:
            raise UsageError(
                f"{document.where()}: {text.strip()[:60]!r} is no key of `dump yaml`: known are {', '.join(KEYS)}"
            )
        if key == "timestep":
            step = int(document.number_of(key, rest, whole=True))
        elif key == "natoms":
            count = int(document.number_of(key, rest, whole=True))
        elif key == "time":
            t = document.number_of(key, rest, whole=False)
        elif key == "boundary":
            words = _listed(rest)
            boundary = "ITEM: BOX BOUNDS " + " ".join(words[k] + words[k + 1] for k in range(0, len(words) - 1, 2))
        elif key == "thermo":
            document.next(), document.next()
        elif key == "box":
            place = document.where()
            bounds = [row.split(",") for row in document.rows(3)]
        elif key == "keywords":
            if _listed(rest) != dump.names:
                raise UsageError(f"{document.where()}: columns {rest.strip()[:200]}, expected {' '.join(dump.names)}")
        elif key == "data":
            break
    if not text:
        raise document.cut()
    if step is None or count is None:
        raise UsageError(f"{document.where()}: data without {'timestep' if step is None else 'natoms'} before it")
    box = Box(boundary or "ITEM: BOX BOUNDS", [" ".join(bound) for bound in bounds], place) if bounds else None
    begin = document.line + 1
    lines = document.rows(count)
    end = document.next()
    if end.rstrip("\r\n") != "...":
        if not end:
            raise document.cut()
        raise UsageError(
            f"{document.where()}: {end.strip()[:40]!r} where '...' should stand after {count} rows (natoms): more rows, or the "
            "file is damaged there"
        )
    values = (
        numbers_of(lines, dump.names, ",", document.path, begin)
        if lines
        else {name: np.empty(0) for name in dump.names}
    )
    found = {own: values[name] for name, own in dump.found.items()}
    here = f"frame {document.number + 1}, line {begin}"
    if dump.scaled:
        if box is None:
            raise UsageError(f"{document.path}, {here}: fractions of a box, and no box before them")
        found |= lengths_of_shares(dump, values, box)
    cell = None if box is None else box.edges if boxes else box.cell()
    return Frame(step, t, halved(found), here, cell)
