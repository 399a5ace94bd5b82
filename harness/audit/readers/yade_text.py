"""Text exports of YADE, `export.text` and `export.textExt`: a folder with a file for each frame."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.binary import found_columns, unread
from ninedisk.harness.audit.readers.columns import Frame, Progress, Trajectory, numbers_of, open_file
from ninedisk.harness.audit.readers.rounding import Tokens, roundings_of

FORMATS = {"x_y_z_r": ("x", "y", "z", "r"), "x_y_z_r_matId": ("x", "y", "z", "r", "matId"), "id_x_y_z_r_matId": (
    "id", "x", "y", "z", "r", "matId",
)}  # fmt: skip
"""Formats and their columns; those of x_y_z_r_attrs are in the comment."""
HEAD = "#format"
SUFFIXES = (".txt", ".dat", ".spheres", ".xyz", "")


def yade_files(folder: Path) -> list[Path]:
    """Files of a folder that begin as YADE's exports do, in the order of the numbers in their names.

    Raises
    ------
    UsageError
        If a file beside them, of the same ending, begins otherwise: a frame would be missing without a word.
    """
    found: list[Path] = []
    others: list[Path] = []
    for file in sorted(
        folder.iterdir(), key=lambda file: [int(part) for part in re.findall(r"\d+", file.stem)] or [-1]
    ):
        if file.suffix in SUFFIXES and file.is_file():
            with open_file(file) as stream:
                (found if stream.read(len(HEAD)) == HEAD else others).append(file)
    if found and (odd := [file for file in others if file.suffix in {each.suffix for each in found}]):
        raise UsageError(
            f"{odd[0]}, line 1: it lacks the first words '{HEAD} ...' of {found[0].name}: correct it, or move it to another folder"
        )
    return found


@dataclass(frozen=True)
class _Export:
    """Lines of one file: names of columns, rows, number of the first row's line."""

    names: list[str]
    rows: list[str]
    first: int


def _export(file: Path) -> _Export:
    with open_file(file) as stream:
        lines = stream.readlines()
    kind = lines[0].removeprefix(HEAD).strip() if lines else ""
    comments = [line for line in lines if line.startswith("#")]
    if kind == "x_y_z_r_attrs":
        names = comments[-1].lstrip("#").split() if len(comments) > 1 else []
        if names[:4] != ["x", "y", "z", "r"] or len(names) < 5:
            raise UsageError(
                f"{file}, line 2: columns of {kind} have no names: write comment='vx vy vz ...' with a word for each number "
                "(export.textExt)"
            )
    elif kind in FORMATS:
        names = list(FORMATS[kind])
    else:
        raise UsageError(
            f"{file}, line 1: the format {kind[:40]!r} of YADE is not read: write {', '.join(FORMATS)} or x_y_z_r_attrs (export.textExt)"
        )
    head = len(comments)
    if any(line.startswith("#") for line in lines[head:]):
        raise UsageError(f"{file}, line {head + 1}: a row among the comments: the file is damaged")
    rows = lines[head:]
    if rows and not rows[-1].endswith("\n"):
        raise UsageError(
            f"{file}, line {len(lines)}: the last line has no end: cut off; write the file anew or leave it out"
        )
    return _Export(names, rows, head + 1)


def read_yade_text(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """Open a folder.

    Raises
    ------
    UsageError
        Naming file, line and the way out; while frames are read, too.
    """
    files = yade_files(path)
    first = _export(files[0])
    aliases = {"type": "matId"} if "matId" in first.names and "type" not in columns else {}
    if len(set(first.names)) < len(first.names):
        raise UsageError(f"{files[0]}, line 2: a name appears twice among {' '.join(first.names)}")
    found = found_columns(first.names, {**aliases, **columns}, path, needed)
    tokens = {here: Tokens() for here in found.values()}
    for k in sorted({round(part * (len(files) - 1) / 4) for part in range(5)}):
        export = _export(files[k])
        for row in export.rows[:1000]:
            words = row.split()
            if len(words) == len(export.names):
                for name, word in zip(export.names, words, strict=True):
                    if name in found and re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", word):
                        tokens[found[name]].seen.add(word)

    def frames(progress: Progress) -> Iterator[Frame]:
        for k, file in enumerate(files):
            progress(k, len(files), file.name)
            export = _export(file)
            if export.names != first.names:
                raise UsageError(f"{file}: columns {' '.join(export.names)}, expected {' '.join(first.names)}")
            values = (
                numbers_of(export.rows, export.names, None, file, export.first)
                if export.rows
                else {name: np.empty(0) for name in export.names}
            )
            number = re.findall(r"\d+", file.stem)
            part = {here: values[name] for name, here in found.items()}
            yield Frame(int(number[-1]) if number else k, np.nan, part, file.name)

    remarks = [] if "id" in found.values() else ["there are no ids: row k of each file is taken as the same body"]
    remarks += unread(first.names, found)
    return Trajectory(
        path, "YADE text series", frames, roundings_of(tokens), "index", frozenset(found.values()), tuple(remarks)
    )
