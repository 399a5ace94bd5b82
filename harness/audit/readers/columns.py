"""Frames of columns, names of columns that other programs use, and numbers out of lines of text."""

from __future__ import annotations

import gzip
import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.api.text import one_line
from ninedisk.harness.audit.readers.rounding import Rounding, Tokens, roundings_of

Progress = Callable[[int, int, str], None]
PLACE = ("Points", "unwrapped_coordinates", "coordinates", "pos", "position")
VELOCITY = ("velocity", "Velocity", "linVel", "linVelVec", "v", "velocities", "vel", "velo", "VELOCITY")
SPIN = (
    "angVel",
    "angVelVec",
    "omega",
    "angularVelocity",
    "AngularVelocity",
    "angular_velocity",
    "angular velocity",
    "ANGULAR_VELOCITY",
)
"""Names of vectors."""


def _parts(names: Sequence[str], k: int) -> tuple[str, ...]:
    """Names of component ``k``."""
    return tuple(f"{name}:{k}" for name in names)


ALIASES = {
    "t": ("time", "Time"),
    "step": ("timestep", "frame", "iter"),
    "id": ("particle", "ID", "Id", "GlobalIds"),
    "x": ("xu", "X", "pos_x", *_parts(PLACE, 0)),
    "y": ("yu", "Y", "pos_y", *_parts(PLACE, 1)),
    "vx": ("v_x", "vel_x", *_parts(VELOCITY, 0)),
    "vy": ("v_y", "vel_y", *_parts(VELOCITY, 1)),
    "vz": ("v_z", "vel_z", *_parts(VELOCITY, 2)),
    "omega": ("omegaz", "wz", "angular_velocity", *_parts(SPIN, 2)),
    "omegax": ("wx", *_parts(SPIN, 0)),
    "omegay": ("wy", *_parts(SPIN, 1)),
    "fx": ("force:0", "f:0", "f_x", "forces:0"),
    "fy": ("force:1", "f:1", "f_y", "forces:1"),
    "fz": ("force:2", "f:2", "f_z", "forces:2"),
    "torque": ("tqz", "tz", "torque:2", "torquez"),
    "tqx": ("tx", "torque:0", "torquex"),
    "tqy": ("ty", "torque:1", "torquey"),
    "diameter": ("d", "Diameter"),
    "angle": ("theta", "rotation"),
    "radius": ("r", "radii", "Radius", "RADIUS"),
    "mass": ("m", "Mass", "particleMass"),
    "type": ("mol",),
    "z": ("zu", "Z", "pos_z", *_parts(PLACE, 2)),
}
"""Other names of a column that are understood by themselves; ``[columns]`` of the TOML names any other."""
FORMS = (
    "a LAMMPS dump in text, YAML or netCDF, extended XYZ, .data of MercuryDPM, GSD, H5MD, VTKHDF, a CSV or Parquet table with a row a disk "
    "and frame, an .npz of whole arrays, a .pvd index, a folder of frame-*.npz, *.vtk, *.vtp, *.vtu, *.pvtp, *.pvtu or YADE's text exports"
)
VECTORS = tuple(f"{name}{axis}" for name in ("fs", "fn", "n") for axis in "xyz")
"""Vectors of a contact: shear force, normal force, normal."""
NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")
SAMPLED_LINES = 600
"""Lines of each of these places that are looked at."""
SAMPLED = 1 << 18
"""Bytes of text at each of five places whose tokens show how numbers are printed."""


@dataclass(frozen=True)
class Frame:
    """Columns of one instant; ``t`` is NaN where the file has none, ``place`` is where it stands.

    ``cell`` has the edges of a box, shape (3, 3), those along which nothing repeats NaN; None: the file has no box.
    ``domain`` has the edges of a box of which the file does not say whether they repeat.
    """

    step: int
    t: float
    columns: dict[str, FloatArray]
    place: str
    cell: FloatArray | None = None
    domain: FloatArray | None = None


@dataclass(frozen=True)
class Trajectory:
    """A file that can be read, once or more often.

    Attributes
    ----------
    frames : function of a progress callback
        Iterates over the frames.
    rounding : mapping
        How each column was rounded.
    form : str
        The format in words.
    clock : {"t", "step", "index", "record"}
        What gives the time of a frame: of an index the interval or the step, of a record the interval alone.
    names : frozenset of str
        Columns that it has, by their names here; empty where only its frames show them.
    remarks : tuple of str
        What was understood of the file that its user may have meant otherwise.
    """

    path: Path
    form: str
    frames: Callable[[Progress], Iterator[Frame]]
    rounding: Mapping[str, Rounding]
    clock: str
    names: frozenset[str] = frozenset()
    remarks: tuple[str, ...] = ()


def open_file(path: Path) -> IO[str]:
    """A text, packed or not."""
    try:
        if path.suffix == ".gz":
            return gzip.open(path, "rt", encoding="utf-8-sig", errors="replace")
        if path.suffix == ".zst":
            return _open_zst(path)
        return open(path, encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise UsageError(f"{str(path)!r} cannot be read ({error.strerror or error})") from error


def _open_zst(path: Path) -> IO[str]:
    """A text packed by zstd; what breaks off or is none raises OSError while it is read."""
    try:
        import zstandard
    except ImportError as error:
        raise UsageError(
            f"{str(path)!r} is packed by zstd, and the package zstandard is missing: install ninedisk[zst], or unpack it (zstd -d)"
        ) from error

    class Reader(io.RawIOBase):
        def __init__(self) -> None:
            self.packed = open(path, "rb")  # noqa: SIM115
            self.part: Any = None
            self.rest = self.ready = b""

        def readable(self) -> bool:
            return True

        def readinto(self, buffer: Any) -> int:
            while not self.ready:
                raw = self.rest or self.packed.read(1 << 18)
                self.rest = b""
                if not raw:
                    if self.part is not None:
                        raise EOFError("it ends within a frame of zstd")
                    return 0
                self.part = self.part or zstandard.ZstdDecompressor().decompressobj()
                try:
                    self.ready = self.part.decompress(raw)
                except zstandard.ZstdError as error:
                    raise OSError(str(error)) from error
                if self.part.eof:
                    self.rest, self.part = self.part.unused_data, None
            size = min(len(buffer), len(self.ready))
            buffer[:size], self.ready = self.ready[:size], self.ready[size:]
            return size

        def close(self) -> None:
            self.packed.close()
            super().close()

    return io.TextIOWrapper(io.BufferedReader(Reader(), 1 << 20), encoding="utf-8-sig", errors="replace")


def column_names(names: Sequence[str], columns: Mapping[str, str], path: Path) -> dict[str, str]:
    """Name in the file -> name here."""
    found = {}
    for name, other in columns.items():
        if other not in names:
            raise UsageError(
                f"{path} has no column {other!r}, which [columns] calls {name}: it has {', '.join(names)}.{close_matches(other, names)}"
            )
        found[other] = name
    taken = set(found.values())
    for name, others in (dict.fromkeys(("x", "y", "vx", "vy", "i", "j", "fn", "fs", *VECTORS), ()) | ALIASES).items():
        if name not in taken and (
            hit := next((other for other in (name, *others) if other in names and other not in found), None)
        ):
            found[hit] = name
    return found


def halved(
    columns: dict[str, FloatArray],
) -> dict[str, FloatArray]:
    """The same columns with the radius out of a diameter, where that alone is there."""
    diameter = columns.pop("diameter", None)
    if diameter is not None and "radius" not in columns:
        columns["radius"] = 0.5 * diameter
    return columns


def halved_rounding(rounding: dict[str, Rounding]) -> dict[str, Rounding]:
    """The same of roundings."""
    rule = rounding.pop("diameter", None)
    if rule is not None and "radius" not in rounding:
        rounding["radius"] = replace(rule, factor=0.5)
    return rounding


def require(found: Mapping[str, str], names: Sequence[str], path: Path, needed: Sequence[str] = ("x", "y")) -> None:
    """Refuse a file without a needed column, by name."""
    if lacking := [name for name in needed if name not in found.values()]:
        raise UsageError(
            f"{path}, line 1: there is no column {' and no '.join(lacking)} among {one_line(', '.join(names))[:300]}: "
            f'name it in the TOML, [columns] {lacking[0]} = "NAME"'
        )


def numbers_of(
    lines: Sequence[str], names: Sequence[str], sep: str | None, path: Path, first: int
) -> dict[str, FloatArray]:
    """Columns of numbers; words are let through as NaN only if they say so."""
    fast = _blank_separated(lines, len(names)) if sep is None else _separated(lines, names, sep)
    if fast is not None:
        return {name: fast[:, k].copy() for k, name in enumerate(names)}
    rows = np.empty((len(lines), len(names)))
    for number, line in enumerate(lines):
        words = line.split(sep)
        if len(words) != len(names):
            raise UsageError(
                f"{path}, line {first + number}: {len(words)} columns, expected {len(names)} ({' '.join(names)}): the line is cut off or "
                "has another form; mend it or cut the file before it"
            )
        for place, word in enumerate(words):
            try:
                rows[number, place] = float(word)
            except ValueError as error:
                if word.strip().lower() in ("", "-nan", "nan(ind)", "-nan(ind)", "na"):
                    rows[number, place] = np.nan
                    continue
                raise UsageError(
                    f"{path}, line {first + number}, column {place + 1} ({names[place]}): {word.strip()[:40]!r} is no number; nan, inf "
                    "and nothing are read as such"
                ) from error
    return {name: rows[:, k].copy() for k, name in enumerate(names)}


def _blank_separated(lines: Sequence[str], columns: int) -> FloatArray | None:
    """Numbers of lines with so many columns each; None: something else is in them."""
    text = "".join(lines)
    if not text.isascii():
        return None
    raw = np.frombuffer(text.encode("ascii"), dtype=np.uint8)
    blank = raw <= 32
    starts = ~blank & np.concatenate([[True], blank[:-1]])
    ends = np.flatnonzero(raw == 10)
    counts = np.diff(np.concatenate([[0], np.searchsorted(np.flatnonzero(starts), ends)]))
    if len(ends) != len(lines) or (counts != columns).any():
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(text, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    if len(values) != len(lines) * columns or not np.isfinite(values).all():
        return None
    return np.asarray(values.reshape(len(lines), columns))


def _separated(lines: Sequence[str], names: Sequence[str], sep: str) -> FloatArray | None:
    """The same of lines with a mark between columns."""
    import pandas as pd

    if any(line.count(sep) != len(names) - 1 for line in lines):
        return None
    try:
        table = pd.read_csv(
            io.StringIO("".join(lines)), sep=sep, header=None, names=list(names), engine="c", index_col=False,
            skip_blank_lines=False, usecols=range(len(names)),
        )  # fmt: skip
    except (ValueError, pd.errors.ParserError):
        return None
    if len(table) != len(lines) or any(kind.kind not in "if" for kind in table.dtypes):
        return None
    values = table.to_numpy(dtype=float)
    return values if np.isfinite(values).all() else None


def sample_roundings(
    path: Path, names: Sequence[str], sep: str | None, wanted: Mapping[str, str], around: str = ""
) -> dict[str, Rounding]:
    """Roundings by the tokens of `sample_tokens`."""
    return roundings_of(sample_tokens(path, names, sep, wanted, around))


def sample_tokens(
    path: Path, names: Sequence[str], sep: str | None, wanted: Mapping[str, str], around: str = ""
) -> dict[str, Tokens]:
    """Printed numbers at five places of a text; marks ``around`` the numbers of a line are left out."""
    tokens = {name: Tokens() for name in wanted.values()}
    if path.suffix in (".gz", ".zst"):
        with open_file(path) as stream:
            texts = [stream.read(5 * SAMPLED)]
    else:
        size = path.stat().st_size
        texts = []
        with open(path, "rb") as raw:
            for part in range(5):
                raw.seek(max(0, part * (size - SAMPLED) // 4))
                texts.append(raw.read(SAMPLED).decode("utf-8", "replace"))
    for text in texts:
        for line in text.split("\n")[1:-1][:SAMPLED_LINES]:
            words = line.strip(around).split(sep) if around else line.split(sep)
            if len(words) != len(names) or words[0].startswith("ITEM"):
                continue
            for name, word in zip(names, words, strict=True):
                here = wanted.get(name)
                if (
                    here is not None
                    and word not in (seen := tokens[here].seen)
                    and len(seen) < 5000
                    and NUMBER.fullmatch(word)
                ):
                    seen.add(word.strip())
    return tokens
