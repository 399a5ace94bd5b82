"""Tables with a row for each body and frame: text and Parquet; and whole arrays of NumPy."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
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
    numbers_of,
    open_file,
    require,
    sample_roundings,
)
from ninedisk.harness.audit.readers.rounding import Rounding, of_arrays

ROWS = 200_000
"""Rows of a table that are read at once."""


def read_text(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """A table in text: a line of names, then a row for each body and frame."""
    with open_file(path) as stream:
        head = stream.readline()
    sep = next((mark for mark in (",", ";", "\t") if mark in head), None)
    names = [word.strip().strip('"') for word in head.lstrip("#").split(sep)]
    if not names or all(re.fullmatch(r"[-+0-9.eE]+", name) for name in names if name):
        raise UsageError(
            f"{path}, line 1: {head.strip()[:60]!r} is no line of column names: a table begins with one, e.g. t,id,x,y,vx,vy,omega"
        )
    found = column_names(names, columns, path)
    require(found, names, path, needed)
    if repeated := [name for name in names if name and names.count(name) > 1]:
        raise UsageError(f"{path}, line 1: the column {repeated[0]!r} appears twice: name each column once")
    if not {"t", "step"} & set(found.values()):
        raise UsageError(
            f'{path}, line 1: neither a column t nor step among {", ".join(names)}: name it in the TOML, [columns] t = "NAME"'
        )

    def blocks(progress: Progress) -> Iterator[tuple[dict[str, FloatArray], int]]:
        size, done, line = path.stat().st_size, 0, 2
        with open_file(path) as stream:
            stream.readline()
            while lines := list(islice(stream, ROWS)):
                while lines and not lines[-1].strip():
                    lines.pop()
                values = numbers_of(lines, names, sep, path, line)
                done += sum(map(len, lines))
                progress(done >> 10, size >> 10, "kB read")
                yield halved({here: values[name] for name, here in found.items()}), line
                line += len(lines)

    clock = "t" if "t" in found.values() else "step"
    rounding = halved_rounding(sample_roundings(path, names, sep, found))
    return Trajectory(path, "table", _by_frame(blocks, clock, path), rounding, clock, frozenset(found.values()))


def read_parquet(path: Path, columns: Mapping[str, str], needed: Sequence[str]) -> Trajectory:
    """The same in Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path.open("rb"))  # Arrow takes no path that is not UTF-8; read later, frame by frame
    except (OSError, pa.ArrowInvalid) as error:
        raise UsageError(f"{path} is no Parquet file that can be read ({error}): give {FORMS}") from error
    names = list(file.schema_arrow.names)
    found = column_names(names, columns, path)
    require(found, names, path, needed)
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
            part = {
                here: batch.column(name).to_numpy(zero_copy_only=False).astype(float) for name, here in found.items()
            }
            yield halved(part), done + 1
            done += batch.num_rows
            progress(done, file.metadata.num_rows, "rows read")

    rounding = {here: Rounding(bits=24 if here in single else 53) for here in found.values()}
    return Trajectory(
        path,
        "Parquet table",
        _by_frame(blocks, clock, path),
        halved_rounding(rounding),
        clock,
        frozenset(found.values()),
    )


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


def read_arrays(path: Path) -> Trajectory:
    """Arrays ``t (s,), x (s, n, d)`` and, if there are, ``v, omega, angle, force, torque, radius, mass, step``."""
    data = archive(path)
    x, t = data.get("x"), data.get("t")
    if x is None or t is None or x.ndim != 3 or x.shape[2] not in (2, 3) or t.shape != x.shape[:1]:
        raise UsageError(
            f"{path}: expected t of shape (s,) and x of (s, n, 2) or (s, n, 3), found "
            f"{', '.join(f'{k} {v.shape}' for k, v in data.items())}"
        )
    turned = x.shape[:2] if x.shape[2] == 2 else x.shape
    for name, shape in {"v": x.shape, "force": x.shape, "omega": turned, "torque": turned, "angle": turned}.items():
        if name in data and data[name].shape != shape:
            raise UsageError(f"{path}: {name} has the shape {data[name].shape}, expected {shape}")
    kinds = {name: array.dtype for name, array in data.items() if array.dtype.kind not in "fiu"}
    if kinds:
        raise UsageError(f"{path}: {next(iter(kinds))} holds {next(iter(kinds.values()))}, expected numbers")
    for name in ("radius", "mass"):
        if name in data and data[name].shape not in ((), x.shape[1:2]):
            raise UsageError(f"{path}: {name} has the shape {data[name].shape}, expected {x.shape[1:2]}")
    if "step" in data and data["step"].shape != t.shape:
        raise UsageError(f"{path}: step has the shape {data['step'].shape}, expected {t.shape}")

    def frames(progress: Progress) -> Iterator[Frame]:
        for k in range(len(t)):
            progress(k, len(t), "frames")
            names = {name: array[k] for name, array in data.items() if name in VECTOR_COLUMNS}
            names |= {name: np.broadcast_to(data[name], x.shape[1:2]) for name in ("radius", "mass") if name in data}
            step = int(data["step"][k]) if "step" in data else k
            yield Frame(step, float(t[k]), vector_columns(names), f"row {k}")

    return Trajectory(path, "NumPy arrays", frames, vector_roundings(data), "t")


VECTOR_COLUMNS = {
    "x": ("x", "y", "z"), "v": ("vx", "vy", "vz"), "omega": ("omegax", "omegay", "omega"), "force": ("fx", "fy", "fz"),
    "torque": ("tqx", "tqy", "torque"), "angle": ("anglex", "angley", "angle"),
}  # fmt: skip
"""Arrays and the columns of their components; of one component, the last."""


def vector_roundings(data: Mapping[str, NDArray[Any]]) -> dict[str, Rounding]:
    """Roundings of the columns of arrays."""
    made = of_arrays(data)
    return made | {new: made[old] for old, news in VECTOR_COLUMNS.items() if old in made for new in news}


def vector_columns(arrays: Mapping[str, NDArray[Any]]) -> dict[str, FloatArray]:
    """Vectors as columns of their components."""
    made: dict[str, FloatArray] = {}
    for name, array in arrays.items():
        if name == "t":
            continue
        news = VECTOR_COLUMNS.get(name)
        if news is None or array.ndim == 1:
            made[name if news is None else news[-1]] = array.astype(float)
        else:
            made |= {new: array[:, k].astype(float) for k, new in enumerate(news[: array.shape[1]])}
    return made


def archive(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of an archive of NumPy."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, KeyError, zlib.error, EOFError) as error:
        raise UsageError(f"{path} is no NumPy archive that can be read ({error})") from error
    except Exception as error:  # zipfile.BadZipFile, which NumPy lets through
        raise UsageError(f"{path} is no NumPy archive that can be read ({error})") from error
