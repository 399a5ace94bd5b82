"""Series of files with a frame each: NumPy frames, and VTK, legacy and XML."""

from __future__ import annotations

import base64
import re
import struct
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


def read_series(path: Path, columns: Mapping[str, str]) -> Trajectory:
    """A folder of files with a frame each."""
    files, times = _series_files(path)
    kind = files[0].suffix

    def raw(file: Path) -> dict[str, NDArray[Any]]:
        if kind == ".npz":
            data = archive(file)
            if "x" not in data or data["x"].ndim != 2 or data["x"].shape[1] not in (2, 3):
                raise UsageError(
                    f"{file}: expected an array x of shape (n, 2) or (n, 3), found {', '.join(data) or 'none'}"
                )
            return data
        return _legacy(file)[0] if kind == ".vtk" else _xml(file)[0]

    chosen = sorted({round(k * (len(files) - 1) / 4) for k in range(5)})
    tokens: dict[str, Tokens] = {}
    if kind == ".npz":
        rounding = vector_roundings(raw(files[0]))
    else:
        names = list(raw(files[0]))
        found = column_names(names, columns, files[0])
        require(found, names, files[0])
        rounding = {}
        for k in chosen:
            values, printed = (_legacy if kind == ".vtk" else _xml)(files[k])
            for name, here in found.items():
                if name not in values:
                    raise UsageError(f"{files[k]}: there is no array {name!r}, which the first frame has")
                tokens.setdefault(here, Tokens()).seen.update(printed.get(name, ())[:1000])
                rounding[here] = Rounding(bits=24 if values[name].dtype == np.float32 else 53)
        for here, rule in roundings_of({name: each for name, each in tokens.items() if each.seen}).items():
            # A single-precision array printed in full is single precision still.
            full = rule.significant is not None and rule.significant >= 9 and rounding[here].bits == 24
            rounding[here] = rounding[here] if full else rule

    def frames(progress: Progress) -> Iterator[Frame]:
        for k, file in enumerate(files):
            progress(k, len(files), file.name)
            data = raw(file)
            if kind == ".npz":
                part, t = vector_columns(data), float(data["t"]) if "t" in data else np.nan
            else:
                if missing := [name for name in found if name not in data]:
                    raise UsageError(f"{file}: there is no array {missing[0]!r}, which the first frame has")
                part, t = halved({here: data[name].astype(float) for name, here in found.items()}), times[k]
            lengths = {len(column) for column in part.values()}
            if len(lengths) > 1:
                raise UsageError(
                    f"{file}: its arrays have different lengths: {', '.join(f'{n} {len(c)}' for n, c in part.items())}"
                )
            number = re.findall(r"\d+", file.stem)
            yield Frame(int(number[-1]) if number else k, t, part, file.name)

    timed = kind == ".npz" and "t" in raw(files[0])
    form = {".npz": "NumPy frames", ".vtk": "legacy VTK series"}.get(kind, "XML VTK series")
    return Trajectory(
        path, form, frames, halved_rounding(rounding), "t" if timed or np.isfinite(times).all() else "index"
    )


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
        if listed:
            return [file for _, file in listed], [t for t, _ in listed]
    kinds = (
        {kind: sorted(path.glob(f"*{kind}"), key=_numbered) for kind in (".npz", ".vtp", ".vtu", ".vtk")}
        if path.is_dir()
        else {}
    )
    kinds = {kind: files for kind, files in kinds.items() if files}
    if len(kinds) != 1:
        raise UsageError(
            f"{path} holds {'several kinds of frames: ' + ', '.join(kinds) if kinds else 'no frames'}: give {FORMS}"
        )
    files = next(iter(kinds.values()))
    return files, [np.nan] * len(files)


def _numbered(file: Path) -> tuple[tuple[int, str], ...]:
    return tuple((int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.stem))


def _split(name: str, array: NDArray[Any], parts: int) -> dict[str, NDArray[Any]]:
    if parts == 1:
        return {name: array}
    return {f"{name}:{k}": array[k::parts] for k in range(parts)}


def _legacy(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, list[str]]]:
    """Points and point data of a legacy file in text, and the first printed numbers of each."""
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
        named = {f"Points:{k}": array[k::3] for k in range(3)} if name == "Points" else _split(name, array, parts)
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
    return data, printed


VTK_TYPES = {
    "Float64": "f8", "Float32": "f4", "Int64": "i8", "Int32": "i4", "UInt64": "u8", "UInt32": "u4", "Int16": "i2", "UInt16": "u2",
    "Int8": "i1", "UInt8": "u1",
}  # fmt: skip


def _xml(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, list[str]]]:
    """Points and point data of an XML file, text or base 64, packed by zlib or not, inline or appended."""
    try:
        text = path.read_bytes()
        raw = b""
        if b'<AppendedData encoding="raw"' in text:
            begin = text.index(b"_", text.index(b"<AppendedData")) + 1
            raw, text = text[begin:], text[:begin] + b"</AppendedData></VTKFile>"
        root = ElementTree.fromstring(text)
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise UsageError(f"{path} is no XML file of VTK ({error})") from error
    pieces = list(root.iter("Piece"))
    if len(pieces) != 1:
        raise UsageError(f"{path}: {len(pieces)} pieces, expected 1: write the series from one process")
    appended = root.find("AppendedData")
    tail = "" if appended is None or raw else (appended.text or "").strip()[1:]
    data: dict[str, NDArray[Any]] = {}
    printed: dict[str, list[str]] = {}
    try:
        count = int(pieces[0].attrib["NumberOfPoints"])
        order = "<" if root.attrib.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
        width = 8 if root.attrib.get("header_type") == "UInt64" else 4
        for parent in ("Points", "PointData"):
            for array in pieces[0].iterfind(f"{parent}/DataArray"):
                parts = int(array.attrib.get("NumberOfComponents", "1"))
                name = "Points" if parent == "Points" else array.attrib["Name"]
                kind = np.dtype(order + VTK_TYPES[array.attrib["type"]])
                words: list[str] = []
                if array.attrib.get("format") == "ascii":
                    words = (array.text or "").split()
                    values: NDArray[Any] = np.array(words, dtype=float).astype(kind)
                else:
                    packed = "compressor" in root.attrib
                    if packed and root.attrib["compressor"] != "vtkZLibDataCompressor":
                        raise UsageError(
                            f"{path}: packed by {root.attrib['compressor']}: write it with zlib, unpacked or as ASCII"
                        )
                    offset = int(array.attrib.get("offset", "0"))
                    there = array.attrib.get("format") == "appended"
                    source = raw[offset:] if there and raw else (tail[offset:] if there else (array.text or "").strip())
                    values = np.frombuffer(_decode(source, width, order, packed), dtype=kind)
                if len(values) != parts * count:
                    raise UsageError(f"{path}, array {name}: {len(values)} numbers, expected {parts * count}")
                named = _split(name, values, parts)
                data.update(named)
                printed.update(
                    {each: words[k::parts][:1000] for k, each in enumerate(named)} if words and kind.kind == "f" else {}
                )
    except (ValueError, KeyError, struct.error, zlib.error) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(
            f"{path}: an array cannot be read ({type(error).__name__}: {error}); write the series as ASCII"
        ) from error
    return data, printed


def _decode(source: str | bytes, width: int, order: str, packed: bool) -> bytes:
    """Bytes of a binary array: after its length, or, packed, after the number and sizes of blocks."""
    form = order + ("Q" if width == 8 else "I")

    def part(begin: int, size: int) -> bytes:
        """``size`` bytes of what begins at the character ``begin``."""
        if isinstance(source, bytes):
            return source[begin : begin + size]
        return base64.b64decode(source[begin : begin + (size + 2) // 3 * 4])[:size]

    if not packed:
        size = struct.unpack(form, part(0, width))[0]
        return part(0, width + size)[width:] if not isinstance(source, bytes) else part(width, size)
    blocks = struct.unpack(form, part(0, width))[0]
    head = (3 + blocks) * width
    sizes = struct.unpack(order + ("Q" if width == 8 else "I") * blocks, part(0, head)[3 * width :])
    begin = head if isinstance(source, bytes) else (head + 2) // 3 * 4
    body = part(begin, sum(sizes))
    made, at = [], 0
    for size in sizes:
        made.append(zlib.decompress(body[at : at + size]))
        at += size
    return b"".join(made)
