"""Series of files with a frame each: NumPy frames, legacy VTK in text, XML of VTK."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.readers.columns import (
    FORMS,
    Frame,
    Progress,
    Trajectory,
    column_names,
    halved,
    halved_rounding,
    require,
)
from ninedisk.harness.audit.readers.rounding import Rounding, Tokens, roundings_of
from ninedisk.harness.audit.readers.tables import archive, vector_columns, vector_roundings
from ninedisk.harness.audit.readers.vtk_xml import INDICES, VtkFrame, read_vtk_xml, split_parts

NO_IDS = (
    "bodies go from one process to another, and the order of pieces does not show who is who: write ids, or name their array, "
    '[columns] id = "NAME"'
)
WHOLE_TIMES = (
    "the times of {} are whole numbers and taken as numbers of steps: MercuryDPM's converter writes such; if they are seconds, give "
    "time.interval"
)
"""Remark on times that may number frames."""


def whole_numbers(times: FloatArray) -> bool:
    """Whether times are whole numbers only, of which nobody knows whether they are seconds."""
    return len(times) > 1 and bool(
        np.isfinite(times).all() and (np.abs(times) < 1e15).all() and (times == np.round(times)).all()
    )


def number_clock(times: FloatArray) -> str:
    """What gives the time of frames with whole numbers: the interval of even ones, which it must be of 0, 1, 2 and so on, else the step."""
    even = np.ptp(np.diff(times)) == 0.0
    return "step" if not even else "record" if times[1] - times[0] == 1.0 else "index"


def read_series(path: Path, columns: Mapping[str, str]) -> Trajectory:
    """A folder of files with a frame each, or the index of one.

    Raises
    ------
    UsageError
        Naming the file and the way out; while frames are read, too.
    """
    files, times = _series_files(path)
    return _numpy_series(path, files) if files[0].suffix == ".npz" else _vtk_series(path, files, times, columns)


def _numpy_series(path: Path, files: list[Path]) -> Trajectory:
    def raw(file: Path) -> dict[str, NDArray[Any]]:
        data = archive(file)
        if "x" not in data or data["x"].ndim != 2 or data["x"].shape[1] not in (2, 3):
            raise UsageError(
                f"{file}: expected an array x of shape (n, 2) or (n, 3), found {', '.join(data) or 'none'}"
            )
        return data

    def frames(progress: Progress) -> Iterator[Frame]:
        for k, file in enumerate(files):
            progress(k, len(files), file.name)
            data = raw(file)
            yield _frame(file, k, float(data["t"]) if "t" in data else np.nan, vector_columns(data))

    first = raw(files[0])
    clock = "t" if "t" in first else "index"
    return Trajectory(path, "NumPy frames", frames, halved_rounding(vector_roundings(first)), clock)


def _vtk_series(path: Path, files: list[Path], times: list[float], columns: Mapping[str, str]) -> Trajectory:
    def raw(file: Path) -> VtkFrame:
        return _legacy(file) if file.suffix == ".vtk" else read_vtk_xml(file)

    names = list(raw(files[0]).data)
    found = column_names(names, columns, files[0])
    require(found, names, files[0])
    tokens: dict[str, Tokens] = {}
    rounding: dict[str, Rounding] = {}
    for k in sorted({round(k * (len(files) - 1) / 4) for k in range(5)}):
        frame = raw(files[k])
        for name, here in found.items():
            if name not in frame.data:
                raise UsageError(f"{files[k]}: there is no array {name!r}, which the first frame has")
            tokens.setdefault(here, Tokens()).seen.update(frame.printed.get(name, ())[:1000])
            rounding[here] = Rounding(bits=24 if frame.data[name].dtype == np.float32 else 53)
    for here, rule in roundings_of({name: each for name, each in tokens.items() if each.seen}).items():
        # A single-precision array printed in full is single precision still.
        full = rule.significant is not None and rule.significant >= 9 and rounding[here].bits == 24
        rounding[here] = rounding[here] if full else rule
    numbered = whole_numbers(np.array(times))

    def frames(progress: Progress) -> Iterator[Frame]:
        for k, file in enumerate(files):
            progress(k, len(files), file.name)
            frame = raw(file)
            if missing := [name for name in found if name not in frame.data]:
                raise UsageError(f"{file}: there is no array {missing[0]!r}, which the first frame has")
            if frame.pieces > 1 and "id" not in found.values():
                raise UsageError(f"{file}: {frame.pieces} pieces and no ids: {NO_IDS}")
            part = halved({here: frame.data[name].astype(float) for name, here in found.items()})
            made = _frame(file, k, times[k], part)
            yield replace(made, step=int(times[k]), t=np.nan) if numbered else made

    form = "legacy VTK series" if files[0].suffix == ".vtk" else "XML VTK series"
    remarks = [WHOLE_TIMES.format(path.name)] if numbered else []
    if "id" not in found.values():
        remarks.append("there are no ids: point k of each file is taken as the same body")
    clock = number_clock(np.array(times)) if numbered else "t" if np.isfinite(times).all() else "index"
    return Trajectory(path, form, frames, halved_rounding(rounding), clock, frozenset(), tuple(remarks))


def _frame(file: Path, k: int, t: float, part: dict[str, FloatArray]) -> Frame:
    lengths = {len(column) for column in part.values()}
    if len(lengths) > 1:
        raise UsageError(
            f"{file}: its arrays have different lengths: {', '.join(f'{n} {len(c)}' for n, c in part.items())}"
        )
    number = re.findall(r"\d+", file.stem)
    return Frame(int(number[-1]) if number else k, t, part, file.name)


def _series_files(path: Path) -> tuple[list[Path], list[float]]:
    """Files of a series in the order of time, and the times if an index gives them."""
    index = path if path.suffix == ".pvd" else path / "frames.pvd"
    if path.suffix == ".pvd" or (index.exists() and any(path.glob("*.vtp"))):
        try:
            rows = ElementTree.parse(index).getroot().iter("DataSet")
            listed = [(float(row.attrib["timestep"]), index.parent / row.attrib["file"]) for row in rows]
        except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
            raise UsageError(
                f'{index} is no index of a series ({error}): expected <DataSet timestep="..." file="..."/>'
            ) from error
        if missing := [file for _, file in listed if not file.is_file()]:
            raise UsageError(f"{index} names {missing[0].name!r}, which is not there")
        times = [t for t, _ in listed]
        if twice := [file for k, (t, file) in enumerate(listed) if t in times[:k]]:
            raise UsageError(
                f"{index} names {twice[0].name!r} for a timestep that another file has: write the parts of a frame as pieces (.pvtp, .pvtu)"
            )
        if odd := {file.suffix for _, file in listed} - {".vtp", ".vtu", ".vtk", *INDICES}:
            raise UsageError(f"{index} names files {', '.join(sorted(odd))}: expected .vtp, .vtu, .pvtp, .pvtu or .vtk")
        if listed:
            return [file for _, file in listed], times
    kinds: dict[str, list[Path]] = {}
    if path.is_dir():
        for kind in (*INDICES, ".npz", ".vtp", ".vtu", ".vtk"):
            files = sorted(path.glob(f"*{kind}"), key=_numbered)
            if files and not (kind in (".vtp", ".vtu") and any(each in kinds for each in INDICES)):
                kinds[kind] = files
    if len(kinds) != 1:
        raise UsageError(
            f"{path} holds {'several kinds of frames: ' + ', '.join(kinds) if kinds else 'no frames'}: give {FORMS}"
        )
    files = next(iter(kinds.values()))
    series = dict.fromkeys(re.sub(r"\d+", "#", file.name) for file in files)
    if len(series) > 1:
        raise UsageError(
            f"{path} holds several series: {', '.join(list(series)[:6])} (# a number; Kratos writes bodies, contacts and walls into one "
            "folder): copy that of the bodies into a folder, or write a .pvd of its files"
        )
    return files, [np.nan] * len(files)


def _numbered(file: Path) -> tuple[tuple[int, str], ...]:
    return tuple((int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.stem))


def _legacy(path: Path) -> VtkFrame:
    """A legacy file in text."""
    try:
        words = path.read_text(encoding="ascii").split("\n", 2)[2].split()
    except (OSError, UnicodeDecodeError, IndexError) as error:
        raise UsageError(f"{path} is no legacy VTK file in text ({error}): write it as ASCII") from error
    if words[:1] != ["ASCII"]:
        raise UsageError(
            f"{path}, line 3: {words[0] if words else ''!r} should be ASCII: write the series as text, or as XML (.vtp, .vtu)"
        )
    data: dict[str, NDArray[Any]] = {}
    printed: dict[str, list[str]] = {}
    at, count, inside = 1, 0, False

    def take(name: str, kind: str, size: int, parts: int, begin: int) -> int:
        block = words[begin : begin + size]
        try:
            array = np.array(block, dtype=float)
        except ValueError as error:
            raise UsageError(f"{path}, array {name}: {error}") from error
        if len(array) < size:
            raise UsageError(f"{path}, array {name}: {len(array)} numbers, expected {size}: the file is cut off")
        if kind == "float":
            array = array.astype(np.float32) if np.isfinite(array).all() else array
        named = {f"Points:{k}": array[k::3] for k in range(3)} if name == "Points" else split_parts(name, array, parts)
        data.update(named)
        printed.update({each: block[k :: len(named)][:1000] for k, each in enumerate(named)})
        return begin + size

    try:
        while at < len(words):
            word = words[at].upper()
            if word == "POINTS":
                count = int(words[at + 1])
                at = take("Points", words[at + 2], 3 * count, 3, at + 3)
            elif word in ("CELLS", "VERTICES", "LINES", "POLYGONS"):
                at += 3 + int(words[at + 2])
            elif word == "CELL_TYPES":
                at += 2 + int(words[at + 1])
            elif word in ("POINT_DATA", "CELL_DATA"):
                inside, rows = word == "POINT_DATA", int(words[at + 1])
                inside = inside and rows == count
                at += 2
            elif word == "SCALARS":
                parts = int(words[at + 3]) if words[at + 3].isdigit() else 1
                begin = at + 3 + words[at + 3].isdigit()
                begin += 2 if words[begin].upper() == "LOOKUP_TABLE" else 0
                at = take(words[at + 1], words[at + 2], parts * count, parts, begin)
            elif word in ("VECTORS", "NORMALS"):
                at = take(words[at + 1], words[at + 2], 3 * count, 3, at + 3)
            elif word == "TENSORS":
                at = take(words[at + 1], words[at + 2], 9 * count, 9, at + 3)
            elif word == "FIELD":
                at += 3
                while at + 3 < len(words) and words[at + 1].isdigit() and words[at + 2].isdigit():
                    parts, rows = int(words[at + 1]), int(words[at + 2])
                    if rows == count:
                        at = take(words[at], words[at + 3], parts * rows, parts, at + 4)
                    else:
                        at += 4 + parts * rows
            else:
                at += 1
    except (ValueError, IndexError) as error:
        raise UsageError(
            f"{path}: the header after {' '.join(words[max(0, at - 2) : at + 3])[:60]!r} is cut off or another"
        ) from error
    return VtkFrame(data, printed)
