"""XML files of VTK, `.vtp` and `.vtu`, and the indices of their pieces, `.pvtp` and `.pvtu`."""

from __future__ import annotations

import base64
import struct
import xml.etree.ElementTree as ElementTree
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.errors import UsageError


def split_parts(name: str, array: NDArray[Any], parts: int) -> dict[str, NDArray[Any]]:
    """An array by components."""
    if parts == 1:
        return {name: array}
    return {f"{name}:{k}": array[k::parts] for k in range(parts)}


VTK_TYPES = {
    "Float64": "f8", "Float32": "f4", "Int64": "i8", "Int32": "i4", "UInt64": "u8", "UInt32": "u4", "Int16": "i2", "UInt16": "u2",
    "Int8": "i1", "UInt8": "u1",
}  # fmt: skip


INDICES = (".pvtp", ".pvtu")
GHOSTS = ("vtkGhostType", "vtkGhostLevels")
"""Arrays that mark points which another piece has."""


@dataclass(frozen=True)
class VtkFrame:
    """Points and point data of one instant, the first printed numbers of each, and of how many pieces they are made."""

    data: dict[str, NDArray[Any]]
    printed: dict[str, list[str]]
    pieces: int = 1


def read_vtk_xml(path: Path) -> VtkFrame:
    """Read a file, text or base 64, packed by zlib or not, inline or appended; or all files that an index of pieces names.

    Raises
    ------
    UsageError
        Naming the file, of pieces the one that is wrong.
    """
    files = _listed(path) if path.suffix in INDICES else [path]
    found = [(file, *piece) for file in files for piece in _pieces(file)]
    full = [each for each in found if each[3]] or found[:1]
    if not full:
        raise UsageError(f"{path} has no pieces: a frame needs one or more <Piece>")
    data: dict[str, NDArray[Any]] = {}
    names = list(full[0][1])
    for file, values, _, _ in full[1:]:
        if odd := sorted(set(names) ^ set(values)):
            raise UsageError(
                f"{file}: of the array {odd[0]!r} some pieces of {path.name} have numbers and some have none"
            )
    for name in names:
        data[name] = np.concatenate([values[name] for _, values, _, _ in full])
    printed = {name: [word for _, _, words, _ in full for word in words.get(name, ())][:1000] for name in names}
    return VtkFrame(without_ghosts(data, path), {name: words for name, words in printed.items() if words}, len(full))


def without_ghosts(data: dict[str, NDArray[Any]], path: Path) -> dict[str, NDArray[Any]]:
    """The same without points that belong to another piece."""
    for name in GHOSTS:
        if (marks := data.pop(name, None)) is not None and marks.any():
            if any(len(values) != len(marks) for values in data.values()):
                raise UsageError(f"{path}: {name} has {len(marks)} marks, and other arrays have another length")
            data = {each: values[marks == 0] for each, values in data.items()}
    return data


def _listed(path: Path) -> list[Path]:
    """Files of the pieces that an index names."""
    try:
        rows = ElementTree.parse(path).getroot().iter("Piece")
        files = [path.parent / row.attrib["Source"] for row in rows]
    except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
        raise UsageError(f'{path} is no index of pieces ({error}): expected <Piece Source="..."/>') from error
    if missing := [file for file in files if not file.is_file()]:
        raise UsageError(f"{path} names the piece {missing[0].name!r}, which is not there")
    if twice := [file for file in files if files.count(file) > 1]:
        raise UsageError(f"{path} names the piece {twice[0].name!r} twice")
    return files


def _pieces(path: Path) -> list[tuple[dict[str, NDArray[Any]], dict[str, list[str]], int]]:
    """Arrays, printed numbers and count of points of each piece of one file."""
    try:
        text = path.read_bytes()
        raw = b""
        if b'<AppendedData encoding="raw"' in text:
            begin = text.index(b"_", text.index(b"<AppendedData")) + 1
            raw, text = text[begin:], text[:begin] + b"</AppendedData></VTKFile>"
        root = ElementTree.fromstring(text)
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise UsageError(f"{path} is no XML file of VTK ({error})") from error
    appended = root.find("AppendedData")
    tail = "" if appended is None or raw else (appended.text or "").strip()[1:]
    packed = root.attrib.get("compressor", "")
    if packed not in ("", "vtkZLibDataCompressor"):
        raise UsageError(f"{path}: packed by {packed}: write it with zlib, unpacked or as ASCII")
    order = "<" if root.attrib.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
    width = 8 if root.attrib.get("header_type") == "UInt64" else 4

    def values_of(array: ElementTree.Element, kind: np.dtype[Any]) -> tuple[NDArray[Any], list[str]]:
        if array.attrib.get("format") == "ascii":
            words = (array.text or "").split()
            return np.array(words, dtype=float).astype(kind), words
        offset = int(array.attrib.get("offset", "0"))
        there = array.attrib.get("format") == "appended"
        source = raw[offset:] if there and raw else (tail[offset:] if there else (array.text or "").strip())
        return np.frombuffer(_decode(source, width, order, bool(packed)), dtype=kind), []

    found = []
    try:
        for piece in root.iter("Piece"):
            data: dict[str, NDArray[Any]] = {}
            printed: dict[str, list[str]] = {}
            count = int(piece.attrib["NumberOfPoints"])
            for parent in ("Points", "PointData"):
                for array in piece.iterfind(f"{parent}/DataArray"):
                    parts = int(array.attrib.get("NumberOfComponents", "1"))
                    name = "Points" if parent == "Points" else array.attrib["Name"]
                    kind = np.dtype(order + VTK_TYPES[array.attrib["type"]])
                    values, words = values_of(array, kind)
                    if len(values) != parts * count:
                        raise UsageError(f"{path}, array {name}: {len(values)} numbers, expected {parts * count}")
                    named = split_parts(name, values, parts)
                    data.update(named)
                    if words and kind.kind == "f":
                        printed.update({each: words[k::parts][:1000] for k, each in enumerate(named)})
            found.append((data, printed, count))
    except (ValueError, KeyError, struct.error, zlib.error) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(
            f"{path}: an array cannot be read ({type(error).__name__}: {error}); write the series as ASCII"
        ) from error
    return found


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
