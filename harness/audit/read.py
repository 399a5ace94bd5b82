"""Trajectories of many formats as frames of columns, one at a time, and how far each printed number may be from the one meant."""

from __future__ import annotations

import base64
import gzip
import io
import re
import struct
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.api.text import one_line

Progress = Callable[[int, int, str], None]
ALIASES = {
    "t": ("time", "Time"),
    "step": ("timestep", "frame", "iter"),
    "id": ("particle", "ID"),
    "x": ("xu", "X", "Points:0", "pos_x"),
    "y": ("yu", "Y", "Points:1", "pos_y"),
    "vx": ("velocity:0", "linVel:0", "v:0", "v_x", "vel_x"),
    "vy": ("velocity:1", "linVel:1", "v:1", "v_y", "vel_y"),
    "omega": ("omegaz", "wz", "angVel:2", "omega:2", "angularVelocity:2", "angular_velocity"),
    "angle": ("theta", "rotation"),
    "radius": ("r", "radii", "Radius"),
    "mass": ("m", "Mass"),
    "type": ("mol",),
    "z": ("zu", "Z", "Points:2", "pos_z"),
}
"""Other names of a column that are understood by themselves; ``[columns]`` of the TOML names any other."""
FORMS = (
    "a LAMMPS dump in text, a CSV or Parquet table with a row a disk and frame, an .npz of whole arrays, a .pvd index, or a "
    "folder of frame-*.npz, *.vtk, *.vtp or *.vtu"
)
ROWS = 200_000
"""Rows of a table that are read at once."""
SAMPLED = 1 << 18
"""Bytes of text at each of five places whose tokens show how numbers are printed."""
FLAT = 1e-6
"""Spread of z over that of x and y which is round-off of a motion in the plane; single precision has 6e-8 a step."""
IN_SPACE = (
    "this is motion in space, and `ninedisk audit` judges motion in the plane alone: spheres are judged by the cases "
    "`ninedisk run 'spheres/*'` through an adapter or --engine-cmd (docs/tutorials/your-own-engine.md)"
)
VARIED = 20
"""Distinct numbers that a column must show for its own digits to count, else the file's most; exact numbers like 0.5 show none."""


@dataclass(frozen=True)
class Rounding:
    """How a column was rounded: to ``decimals``, to ``significant`` digits, or to ``bits`` of a mantissa."""

    decimals: int | None = None
    significant: int | None = None
    bits: int = 53

    def error(self, values: FloatArray) -> FloatArray:
        """Most by which the number meant differs from the one read: half a unit of the last place."""
        size = np.abs(values)
        found = np.ldexp(size, -self.bits)
        if self.decimals is not None:
            return np.maximum(found, 0.5 * 10.0**-self.decimals)
        if self.significant is not None:
            decade = np.floor(np.log10(np.where(size > 0.0, size, 1.0)))
            found = np.maximum(found, np.where(size > 0.0, 0.5 * 10.0 ** (decade + 1 - self.significant), 0.0))
        return found

    def description(self) -> str:
        """In words."""
        if self.decimals is not None:
            return f"{self.decimals} decimals"
        if self.significant is not None and self.significant < 16:
            return f"{self.significant} significant digits"
        return "single precision" if self.bits == 24 else "double precision"


@dataclass(frozen=True)
class Frame:
    """Columns of one instant; ``t`` is NaN where the file has none, ``place`` is where it stands."""

    step: int
    t: float
    columns: dict[str, FloatArray]
    place: str


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
    clock : {"t", "step", "index"}
        What gives the time of a frame.
    """

    path: Path
    form: str
    frames: Callable[[Progress], Iterator[Frame]]
    rounding: Mapping[str, Rounding]
    clock: str


@dataclass
class _Tokens:
    """Printed numbers of one column."""

    seen: set[str] = field(default_factory=set)

    def rounding(self, most: int) -> Rounding:
        """Rule that the tokens follow; ``most`` significant digits where they are too few to decide."""
        values = [token for token in self.seen if float(token) != 0.0]
        finite = np.array([float(token) for token in values])
        finite = finite[np.isfinite(finite)]
        if len(finite) >= VARIED and (finite == finite.astype(np.float32)).all():
            return Rounding(bits=24)
        plain = {_decimals(token) for token in self.seen} if not any("e" in t.lower() for t in self.seen) else set()
        if len(plain) == 1 and (decimals := plain.pop()) > 0 and any(token.endswith("0") for token in self.seen):
            return Rounding(decimals=decimals)
        if plain and len(values) >= VARIED:
            by_decade: dict[int, int] = {}
            for token in values:
                decade = int(np.floor(np.log10(abs(float(token)))))
                by_decade[decade] = max(by_decade.get(decade, 0), _decimals(token))
            low, high = min(by_decade), max(by_decade)
            if high > low and by_decade[low] == by_decade[high] > 0:
                return Rounding(decimals=by_decade[low])
        own = max((_significant(token) for token in values), default=0)
        return Rounding(significant=max(own, 1) if len(values) >= VARIED else max(own, most, 1))


def _significant(token: str) -> int:
    digits = re.sub(r"[^0-9]", "", token.lower().partition("e")[0]).lstrip("0")
    return len(digits) if "." in token or "e" in token.lower() else len(digits.rstrip("0"))


def _decimals(token: str) -> int:
    return len(token.partition(".")[2])


def _roundings(tokens: Mapping[str, _Tokens]) -> dict[str, Rounding]:
    most = max((_significant(token) for each in tokens.values() for token in each.seen), default=1)
    return {name: each.rounding(most) for name, each in tokens.items()}


def read_trajectory(path: Path, columns: Mapping[str, str], needed: Sequence[str] = ("x", "y")) -> Trajectory:
    """Open a trajectory.

    Parameters
    ----------
    path : Path
    columns : mapping
        Name here -> name in the file.
    needed : sequence of str
        Columns that it must have.

    Raises
    ------
    UsageError
        Naming file, line, column, what is allowed and the way out; while frames are read, too.
    """
    found = _read(path, columns, needed)

    def frames(progress: Progress) -> Iterator[Frame]:
        low, high = np.inf, -np.inf
        for frame in found.frames(progress):
            z = frame.columns.pop("z", np.empty(0))
            low, high = (float(end(z[np.isfinite(z)], initial=now)) for end, now in ((np.min, low), (np.max, high)))
            sizes = [float(np.ptp(frame.columns[name])) for name in "xy" if len(frame.columns.get(name, ()))]
            if high - low > FLAT * max(*sizes, abs(low), 0.0):
                raise UsageError(f"{path}, {frame.place}: z goes from {low:g} to {high:g}: {IN_SPACE}")
            yield frame

    return replace(found, frames=frames)


def _read(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    if not path.exists():
        raise UsageError(f"there is no {str(path)!r}: give {FORMS}")
    if path.is_dir() or path.suffix == ".pvd":
        return _series(path, columns)
    if path.suffix in (".parquet", ".pq"):
        return _parquet(path, columns, needed)
    if path.suffix == ".npz":
        return _stacked(path)
    if path.suffix in (".vtk", ".vtp", ".vtu"):
        raise UsageError(f"{str(path)!r} is a single frame: give the folder of the series, or its .pvd")
    with _open_file(path) as stream:
        try:
            head = stream.readline(1 << 16)
        except (OSError, EOFError, zlib.error) as error:
            raise UsageError(f"{path} is no text that can be read ({error}): give {FORMS}") from error
    return _lammps(path, columns, needed) if head.startswith("ITEM:") else _csv(path, columns, needed)


def _open_file(path: Path) -> IO[str]:
    try:
        if path.suffix == ".gz":
            return gzip.open(path, "rt", encoding="utf-8", errors="replace")
        return open(path, encoding="utf-8", errors="replace")
    except OSError as error:
        raise UsageError(f"{str(path)!r} cannot be read ({error.strerror or error})") from error


def _column_name(names: Sequence[str], columns: Mapping[str, str], path: Path) -> dict[str, str]:
    """Name in the file -> name here."""
    found = {}
    for name, other in columns.items():
        if other not in names:
            raise UsageError(
                f"{path} has no column {other!r}, which [columns] calls {name}: it has {', '.join(names)}.{close_matches(other, names)}"
            )
        found[other] = name
    taken = set(found.values())
    for name, others in (
        {"x": (), "y": (), "vx": (), "vy": (), "i": (), "j": (), "fn": (), "fs": ()} | ALIASES
    ).items():
        if name not in taken and (
            hit := next((other for other in (name, *others) if other in names and other not in found), None)
        ):
            found[hit] = name
    return found


def _require(found: Mapping[str, str], names: Sequence[str], path: Path, needed: Sequence[str] = ("x", "y")) -> None:
    if lacking := [name for name in needed if name not in found.values()]:
        scaled = " (xs and ys are fractions of the box: dump x y or xu yu)" if "xs" in names else ""
        raise UsageError(
            f"{path}, line 1: there is no column {' and no '.join(lacking)} among {one_line(', '.join(names))[:300]}{scaled}: "
            f'name it in the TOML, [columns] {lacking[0]} = "NAME"'
        )


def _numbers(
    lines: Sequence[str], names: Sequence[str], sep: str | None, path: Path, first: int
) -> dict[str, FloatArray]:
    """Columns of numbers; words are let through as NaN only if they say so."""
    import pandas as pd

    try:
        table = pd.read_csv(
            io.StringIO("".join(lines)), sep=sep or r"\s+", header=None, names=list(names), engine="c", index_col=False,
            skip_blank_lines=False, usecols=range(len(names)),
        )  # fmt: skip
        if len(table) == len(lines) and all(kind.kind in "if" for kind in table.dtypes):
            values = {name: table[name].to_numpy(dtype=float) for name in names}
            if all(np.isfinite(column).all() for column in values.values()):
                return values
    except (ValueError, pd.errors.ParserError):
        pass
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


def _sample_roundings(
    path: Path, names: Sequence[str], sep: str | None, wanted: Mapping[str, str]
) -> dict[str, Rounding]:
    """Roundings by tokens of five places of a text."""
    tokens = {name: _Tokens() for name in wanted.values()}
    if path.suffix == ".gz":
        with _open_file(path) as stream:
            texts = [stream.read(5 * SAMPLED)]
    else:
        size = path.stat().st_size
        texts = []
        with open(path, "rb") as raw:
            for part in range(5):
                raw.seek(max(0, part * (size - SAMPLED) // 4))
                texts.append(raw.read(SAMPLED).decode("utf-8", "replace"))
    for text in texts:
        for line in text.split("\n")[1:-1]:
            words = line.split(sep)
            if len(words) != len(names) or words[0].startswith("ITEM"):
                continue
            for name, word in zip(names, words, strict=True):
                here = wanted.get(name)
                if (
                    here is not None
                    and len(tokens[here].seen) < 5000
                    and re.fullmatch(r"\s*[-+]?[0-9.]+([eE][-+]?\d+)?\s*", word)
                ):
                    tokens[here].seen.add(word.strip())
    return _roundings(tokens)


def _lammps(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    with _open_file(path) as stream:
        head = next((line for line in islice(stream, 200) if line.startswith(("ITEM: ATOMS", "ITEM: ENTRIES"))), None)
    if head is None:
        raise UsageError(
            f"{path}: no line 'ITEM: ATOMS ...' among the first 200: this is no text dump of LAMMPS (`dump custom`)"
        )
    names = head.split()[2:]
    found = _column_name(names, columns, path)
    _require(found, names, path, needed)
    timed = False
    with _open_file(path) as stream:
        timed = any(line.startswith("ITEM: TIME\n") for line in islice(stream, 12))

    def frames(progress: Progress) -> Iterator[Frame]:
        size = path.stat().st_size
        with _open_file(path) as stream:
            line, done = 0, 0
            step, count, t = -1, -1, np.nan
            while text := stream.readline():
                line += 1
                done += len(text)
                try:
                    if text.startswith("ITEM: TIMESTEP"):
                        step, t = int(stream.readline()), np.nan
                        line += 1
                    elif text.startswith("ITEM: TIME"):
                        t = float(stream.readline())
                        line += 1
                    elif text.startswith("ITEM: NUMBER OF"):
                        count = int(stream.readline())
                        line += 1
                    elif text.startswith(("ITEM: BOX BOUNDS", "ITEM: UNITS")):
                        for _ in range(3 if "BOX" in text else 1):
                            stream.readline()
                            line += 1
                    elif text.startswith(("ITEM: ATOMS", "ITEM: ENTRIES")):
                        if text.split()[2:] != names or count < 0:
                            raise UsageError(
                                f"{path}, line {line}: columns {' '.join(text.split()[2:])}, expected {' '.join(names)}"
                            )
                        begin = line + 1
                        lines = list(islice(stream, count))
                        line += len(lines)
                        done += sum(map(len, lines))
                        if len(lines) < count or (lines and not lines[-1].endswith("\n")):
                            raise UsageError(
                                f"{path}, line {line}: the frame of step {step} ends after {len(lines)} of {count} lines: cut off; "
                                f"cut the file before line {begin - 1}"
                            )
                        values = (
                            _numbers(lines, names, None, path, begin)
                            if lines
                            else {name: np.empty(0) for name in names}
                        )
                        progress(done >> 10, size >> 10, f"kB read, step {step}")
                        yield Frame(step, t, {here: values[name] for name, here in found.items()}, f"line {begin}")
                    elif text.strip():
                        raise UsageError(
                            f"{path}, line {line}: {text.strip()[:60]!r} where 'ITEM: ...' should stand: cut the file there"
                        )
                except ValueError as error:
                    if isinstance(error, UsageError):
                        raise
                    raise UsageError(f"{path}, line {line + 1}: a number should stand there ({error})") from error

    return Trajectory(
        path, "LAMMPS dump", frames, _sample_roundings(path, names, None, found), "t" if timed else "step"
    )


def _csv(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    with _open_file(path) as stream:
        head = stream.readline()
    sep = next((mark for mark in (",", ";", "\t") if mark in head), None)
    names = [word.strip().strip('"') for word in head.lstrip("#").split(sep)]
    if not names or all(re.fullmatch(r"[-+0-9.eE]+", name) for name in names if name):
        raise UsageError(
            f"{path}, line 1: {head.strip()[:60]!r} is no line of column names: a table begins with one, e.g. t,id,x,y,vx,vy,omega"
        )
    found = _column_name(names, columns, path)
    _require(found, names, path, needed)
    if not {"t", "step"} & set(found.values()):
        raise UsageError(
            f'{path}, line 1: neither a column t nor step among {", ".join(names)}: name it in the TOML, [columns] t = "NAME"'
        )

    def blocks(progress: Progress) -> Iterator[tuple[dict[str, FloatArray], int]]:
        size, done, line = path.stat().st_size, 0, 2
        with _open_file(path) as stream:
            stream.readline()
            while lines := list(islice(stream, ROWS)):
                while lines and not lines[-1].strip():
                    lines.pop()
                values = _numbers(lines, names, sep, path, line)
                done += sum(map(len, lines))
                progress(done >> 10, size >> 10, "kB read")
                yield {here: values[name] for name, here in found.items()}, line
                line += len(lines)

    clock = "t" if "t" in found.values() else "step"
    return Trajectory(path, "table", _by_frame(blocks, clock, path), _sample_roundings(path, names, sep, found), clock)


def _parquet(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path.open("rb"))  # Arrow takes no path that is not UTF-8; read later, frame by frame
    except (OSError, pa.ArrowInvalid) as error:
        raise UsageError(f"{path} is no Parquet file that can be read ({error}): give {FORMS}") from error
    names = list(file.schema_arrow.names)
    found = _column_name(names, columns, path)
    _require(found, names, path, needed)
    clock = "t" if "t" in found.values() else "step"
    if clock not in found.values():
        raise UsageError(f"{path}: neither a column t nor step among {', '.join(names)}")
    for name in found:
        kind = file.schema_arrow.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            raise UsageError(f"{path}, column {name}: {kind} are no numbers")
    single = {here for name, here in found.items() if str(file.schema_arrow.field(name).type) in ("float", "float32")}

    def blocks(progress: Progress) -> Iterator[tuple[dict[str, FloatArray], int]]:
        done = 0
        for batch in file.iter_batches(batch_size=ROWS, columns=list(found)):
            yield (
                {here: batch.column(name).to_numpy(zero_copy_only=False).astype(float) for name, here in found.items()},
                done + 1,
            )
            done += batch.num_rows
            progress(done, file.metadata.num_rows, "rows read")

    rounding = {here: Rounding(bits=24 if here in single else 53) for here in found.values()}
    return Trajectory(path, "Parquet table", _by_frame(blocks, clock, path), rounding, clock)


def _by_frame(
    blocks: Callable[[Progress], Iterator[tuple[dict[str, FloatArray], int]]], clock: str, path: Path
) -> Callable[[Progress], Iterator[Frame]]:
    """Frames out of blocks of rows: rows of one instant stand together."""

    def frames(progress: Progress) -> Iterator[Frame]:
        held: dict[str, FloatArray] = {}
        number = 0
        for block, line in blocks(progress):
            kept = len(next(iter(held.values()))) if held else 0
            held = {name: np.concatenate([held[name], column]) if held else column for name, column in block.items()}
            keys = held[clock]
            ends = np.flatnonzero(keys[1:] != keys[:-1]) + 1
            begins = np.concatenate([[0], ends]).astype(int)
            if len(ends) > 2 and (np.diff(keys[begins]) < 0.0).any() and len(ends) > 0.9 * (len(keys) - 1):
                at = int(ends[np.flatnonzero(np.diff(keys[begins]) < 0.0)[0]])
                raise UsageError(
                    f"{path}, line {line - kept + at}: {clock} goes back: sort the rows by {clock} first, then by id"
                )
            for k in range(len(begins) - 1):
                part = {name: column[begins[k] : begins[k + 1]] for name, column in held.items()}
                yield _row_frame(part, number, line - kept + int(begins[k]))
                number += 1
            held = {name: column[begins[-1] :] for name, column in held.items()}
        if held:
            yield _row_frame(held, number, -1)

    return frames


def _row_frame(part: dict[str, FloatArray], number: int, line: int) -> Frame:
    step = part["step"][0] if "step" in part else number
    t = part["t"][0] if "t" in part else np.nan
    return Frame(
        int(step) if np.isfinite(step) else number, float(t), part, f"line {line}" if line > 0 else "the last rows"
    )


def _stacked(path: Path) -> Trajectory:
    """Arrays ``t (s,), x (s, n, 2)`` and, if there are, ``v, omega, angle, radius, mass, step``."""
    data = _archive(path)
    x, t = data.get("x"), data.get("t")
    if x is not None and x.ndim == 3 and x.shape[2] == 3:
        raise UsageError(f"{path}: x has the shape {x.shape}: {IN_SPACE}")
    if x is None or t is None or x.ndim != 3 or x.shape[2] != 2 or t.shape != x.shape[:1]:
        raise UsageError(
            f"{path}: expected t of shape (s,) and x of (s, n, 2), found {', '.join(f'{k} {v.shape}' for k, v in data.items())}"
        )
    for name, shape in (("v", x.shape), ("omega", x.shape[:2]), ("angle", x.shape[:2])):
        if name in data and data[name].shape != shape:
            raise UsageError(f"{path}: {name} has the shape {data[name].shape}, expected {shape}")

    def frames(progress: Progress) -> Iterator[Frame]:
        for k in range(len(t)):
            progress(k, len(t), "frames")
            names = {name: array[k] for name, array in data.items() if name in ("x", "v", "omega", "angle")}
            names |= {name: np.broadcast_to(data[name], x.shape[1:2]) for name in ("radius", "mass") if name in data}
            step = int(data["step"][k]) if "step" in data else k
            yield Frame(step, float(t[k]), _vector_columns(names), f"row {k}")

    return Trajectory(path, "NumPy arrays", frames, _binary(data), "t")


def _binary(data: Mapping[str, NDArray[Any]]) -> dict[str, Rounding]:
    made = {name: Rounding(bits=24 if array.dtype == np.float32 else 53) for name, array in data.items()}
    return made | {
        new: made[old] for old, news in (("x", ("x", "y")), ("v", ("vx", "vy"))) if old in made for new in news
    }


def _vector_columns(arrays: Mapping[str, NDArray[Any]]) -> dict[str, FloatArray]:
    """Vectors as columns of their components."""
    made: dict[str, FloatArray] = {}
    for name, array in arrays.items():
        if name in ("x", "v"):
            made["x" if name == "x" else "vx"], made["y" if name == "x" else "vy"] = (
                array[:, 0].astype(float),
                array[:, 1].astype(float),
            )
        elif name != "t":
            made[name] = array.astype(float)
    return made


def _archive(path: Path) -> dict[str, NDArray[Any]]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, KeyError, zlib.error, EOFError) as error:
        raise UsageError(f"{path} is no NumPy archive that can be read ({error})") from error
    except Exception as error:  # zipfile.BadZipFile, which NumPy lets through
        raise UsageError(f"{path} is no NumPy archive that can be read ({error})") from error


def _series(path: Path, columns: Mapping[str, str]) -> Trajectory:
    """A folder of files with a frame each."""
    files, times = _series_files(path)
    kind = files[0].suffix

    def raw(file: Path) -> dict[str, NDArray[Any]]:
        if kind == ".npz":
            data = _archive(file)
            if "x" in data and data["x"].ndim == 2 and data["x"].shape[1] == 3:
                raise UsageError(f"{file}: x has the shape {data['x'].shape}: {IN_SPACE}")
            if "x" not in data or data["x"].ndim != 2 or data["x"].shape[1] != 2:
                raise UsageError(f"{file}: expected an array x of shape (n, 2), found {', '.join(data) or 'none'}")
            return data
        return _legacy(file)[0] if kind == ".vtk" else _xml(file)[0]

    chosen = sorted({round(k * (len(files) - 1) / 4) for k in range(5)})
    tokens: dict[str, _Tokens] = {}
    if kind == ".npz":
        rounding = _binary(raw(files[0]))
    else:
        names = list(raw(files[0]))
        found = _column_name(names, columns, files[0])
        _require(found, names, files[0])
        rounding = {}
        for k in chosen:
            values, printed = (_legacy if kind == ".vtk" else _xml)(files[k])
            for name, here in found.items():
                tokens.setdefault(here, _Tokens()).seen.update(printed.get(name, ())[:1000])
                rounding[here] = Rounding(bits=24 if values[name].dtype == np.float32 else 53)
        for here, rule in _roundings({name: each for name, each in tokens.items() if each.seen}).items():
            # A single-precision array printed in full is single precision still.
            full = rule.significant is not None and rule.significant >= 9 and rounding[here].bits == 24
            rounding[here] = rounding[here] if full else rule

    def frames(progress: Progress) -> Iterator[Frame]:
        for k, file in enumerate(files):
            progress(k, len(files), file.name)
            data = raw(file)
            if kind == ".npz":
                part, t = _vector_columns(data), float(data["t"]) if "t" in data else np.nan
            else:
                if missing := [name for name in found if name not in data]:
                    raise UsageError(f"{file}: there is no array {missing[0]!r}, which the first frame has")
                part, t = {here: data[name].astype(float) for name, here in found.items()}, times[k]
            lengths = {len(column) for column in part.values()}
            if len(lengths) > 1:
                raise UsageError(
                    f"{file}: its arrays have different lengths: {', '.join(f'{n} {len(c)}' for n, c in part.items())}"
                )
            number = re.findall(r"\d+", file.stem)
            yield Frame(int(number[-1]) if number else k, t, part, file.name)

    timed = kind == ".npz" and "t" in raw(files[0])
    form = {".npz": "NumPy frames", ".vtk": "legacy VTK series"}.get(kind, "XML VTK series")
    return Trajectory(path, form, frames, rounding, "t" if timed or np.isfinite(times).all() else "index")


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
