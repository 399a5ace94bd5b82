"""Reader of a store: finished runs only, the newest rows of each case variant and engine.

Curves: one sampled quantity each, cut out of the long tables.
"""

from __future__ import annotations

import json
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.results.schema import RUN_KEYS, SCHEMA_VERSION, TABLES
from ninedisk.reports.folder import ReportError

Row = dict[str, Any]
CellKey = tuple[str, str, str]
CELL_KEY = ("case", "variant", "engine")


@dataclass(frozen=True)
class Stored:
    """What the pages are made of.

    Parameters
    ----------
    runs : list of dict
        ``run.json`` of every run that contributes a row, newest first.
    cells, measurements, claims : list of dict
        Rows with the columns of `ninedisk.harness.results.schema`.
    series, references : mapping
        Curves by (case, variant, engine, quantity), and by (case, variant, quantity).
    outdated : list of str
        Cells that were left out because their case has a newer version.
    """

    runs: list[Row]
    cells: list[Row]
    measurements: list[Row]
    claims: list[Row]
    series: Series
    references: References
    outdated: list[str] = field(default_factory=list)


def load_store(store: Path) -> Stored:
    """Read every finished run below ``store/runs`` and keep the newest rows.

    For each (case, variant, engine) the newest run by ``started`` wins; reference curves follow the newest run of their
    (case, variant), claims the newest run that states them. Cells of an older case version than the newest stored one
    are left out, because results of two definitions must not stand in one table.

    Which cells are shown is found from their keys alone: of a cell that a newer run replaces, no scene, frame, measurement or
    curve is read or made.

    Raises
    ------
    ReportError
        If the store has no finished run, a run was written by a newer schema, or a file is damaged.
    """
    runs = _finished_runs(store)
    owner: dict[CellKey, int] = {}
    versions: dict[CellKey, int] = {}
    for index, run in enumerate(runs):
        for row in _rows(_table(run, "cells", (*CELL_KEY, "case_version"))):
            owner[_key(row)], versions[_key(row)] = index, int(row["case_version"] or 0)
    version: dict[str, int] = {}
    for key, number in versions.items():
        version[key[0]] = max(version.get(key[0], 0), number)
    old = [key for key, number in versions.items() if number < version[key[0]]]
    for key in old:
        del owner[key]
    if not owner:
        raise ReportError(f"{store} holds no results: its runs have no cells; run `ninedisk run --store {store}` first")

    reference_owner: dict[tuple[str, str], int] = {}
    for (case, variant, _), index in owner.items():
        reference_owner[case, variant] = max(index, reference_owner.get((case, variant), -1))
    cells: dict[CellKey, Row] = {}
    measurements: list[Row] = []
    claims: dict[tuple[str, str, str], Row] = {}
    series: dict[tuple[str, str, str, str], Curve] = {}
    references: dict[tuple[str, str, str], list[Curve]] = {}
    shown = set(owner.values())
    for index, run in enumerate(runs):
        for row in _rows(_table(run, "claims")):
            claims[row["claim"], row["case"], row["engine"]] = row
        if index not in shown:
            continue
        own = {key for key, run_index in owner.items() if run_index == index}
        places = {place for place, run_index in reference_owner.items() if run_index == index}
        cells |= {_key(row): row for row in _rows(keep_rows(_table(run, "cells"), CELL_KEY, own))}
        measurements += _rows(keep_rows(_table(run, "measurements"), CELL_KEY, own))
        series |= split_series(keep_rows(_table(run, "series"), CELL_KEY, own))
        references |= split_references(keep_rows(_table(run, "references"), CELL_KEY[:2], places))
    used = [run.record for index, run in reversed(list(enumerate(runs))) if index in shown]
    outdated = [f"{case} / {variant} on {engine}" for case, variant, engine in sorted(old)]
    return Stored(
        used, [cells[key] for key in owner], measurements, list(claims.values()), series, references, outdated
    )


@dataclass(frozen=True)
class _Run:
    folder: Path
    record: Row


def _key(row: Row) -> CellKey:
    return row["case"], row["variant"], row["engine"]


def _finished_runs(store: Path) -> list[_Run]:
    if not (store / "runs").is_dir():
        raise ReportError(f"{store} is no store: it has no folder 'runs'; name the folder that `ninedisk run` wrote")
    # A writer that was killed leaves a folder without run.json, or one whose name still begins with a dot.
    found = [path for path in sorted((store / "runs").glob("*/run.json")) if not path.parent.name.startswith(".")]
    runs = [_Run(path.parent, _record(path)) for path in found]
    if not runs:
        raise ReportError(f"{store} holds no finished run: run `ninedisk run --store {store}` first")
    return sorted(runs, key=lambda run: (_when(run.record["started"]), str(run.record["run_id"])))


def _record(path: Path) -> Row:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as problem:
        raise ReportError(f"{path} cannot be read ({problem}): delete that run or copy it again") from problem
    missing = [key for key in RUN_KEYS if key not in record] if isinstance(record, dict) else list(RUN_KEYS)
    if missing:
        raise ReportError(f"{path} lacks {', '.join(missing)}: delete that run or copy it again")
    version = record["schema_version"]
    if not isinstance(version, int) or version > SCHEMA_VERSION:
        raise ReportError(
            f"{path} has schema version {version!r}, this ninedisk reads up to {SCHEMA_VERSION}: update ninedisk, or "
            f"name a store without that run"
        )
    return dict(record)


def _when(started: Any) -> datetime:
    try:
        moment = datetime.fromisoformat(str(started))
    except ValueError:
        return datetime.min.replace(tzinfo=UTC)
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def _table(run: _Run, name: str, only: Sequence[str] = ()) -> Any:
    """Parquet table with exactly the columns of the schema, or ``only`` these; columns that an older run lacks are empty."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = run.folder / f"{name}.parquet"
    try:
        file = pq.ParquetFile(path)
        wanted = [column for column in file.schema_arrow.names if column in (only or TABLES[name])]
        table = file.read(columns=wanted, use_threads=False)
    except (OSError, UnicodeDecodeError, pa.ArrowException) as problem:
        raise ReportError(f"{path} cannot be read ({problem}): delete that run or copy it again") from problem
    types = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64()}
    columns = []
    kinds = {column: TABLES[name][column] for column in only or TABLES[name]}
    for column, kind in kinds.items():
        held = column in table.column_names
        try:
            columns.append(table[column].cast(types[kind]) if held else pa.nulls(table.num_rows, types[kind]))
        except pa.ArrowException as problem:
            raise ReportError(f"{path}: column {column!r} is not {kind} ({problem})") from problem
    return pa.table(columns, names=list(kinds))


def _rows(table: Any) -> list[Row]:
    """Rows of a table; empty strings instead of nulls."""
    texts = [field.name for field in table.schema if field.type == "string"]
    rows: list[Row] = table.to_pylist()
    for row in rows:
        for column in texts:
            row[column] = row[column] or ""
    return rows


FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """One quantity over the samples of a run or of a reference, ordered by step.

    Parameters
    ----------
    step, t, value, expected : ndarray, shape (s,)
        Step numbers, times [s], values and best truth in ``unit`` (NaN where none speaks).
    unit : str
    truth : str
        Kind of the truth behind ``expected`` (series) or of the curve itself (references).
    label, source : str
        Name and origin of a reference curve; empty for series.
    """

    step: FloatArray
    t: FloatArray
    value: FloatArray
    expected: FloatArray
    unit: str
    truth: str
    label: str = ""
    source: str = ""

    @property
    def error(self) -> FloatArray:
        """``|value - expected|``; NaN where there is no truth."""
        with np.errstate(invalid="ignore"):  # inf - inf
            return np.abs(self.value - self.expected)

    @property
    def scale(self) -> float:
        """Largest finite ``|expected|``; 0 without truth."""
        size = np.abs(self.expected[np.isfinite(self.expected)])
        return float(size.max()) if len(size) else 0.0


Series = Mapping[tuple[str, str, str, str], Curve]
References = Mapping[tuple[str, str, str], list[Curve]]


def split_series(table: Any) -> dict[tuple[str, str, str, str], Curve]:
    """Curves of a ``series`` table by (case, variant, engine, quantity)."""
    return {
        (key[0], key[1], key[2], key[3]): _curve(table, rows)
        for key, rows in _groups(table, ("case", "variant", "engine", "quantity"))
    }


def split_references(table: Any) -> dict[tuple[str, str, str], list[Curve]]:
    """Curves of a ``references`` table by (case, variant, quantity); several labels share a key.

    Curves of one label that differ (a truth that depends on the engine's conventions) follow each other in the table:
    a step that does not increase begins the next one.
    """
    found: dict[tuple[str, str, str], list[Curve]] = {}
    for key, rows in _groups(table, ("case", "variant", "quantity", "label")):
        steps = table["step"].take(rows).to_numpy(zero_copy_only=False)
        for part in np.split(rows, np.flatnonzero(np.diff(steps) <= 0) + 1):
            found.setdefault((key[0], key[1], key[2]), []).append(_curve(table, part, label=key[3]))
    return found


def keep_rows(table: Any, columns: tuple[str, ...], wanted: Container[tuple[str, ...]]) -> Any:
    """The rows of a table whose ``columns``, texts, are among the combinations ``wanted``, in the table's order."""
    kept = [rows for key, rows in _groups(table, columns) if key in wanted]
    rows = np.sort(np.concatenate(kept)) if kept else np.empty(0, dtype=np.int64)
    return table if len(rows) == table.num_rows else table.take(rows)


def differences(one: Curve, two: Curve, scale: float) -> float:
    """``max |one - two| / scale`` over the steps that both have; NaN if they share none, 0 without a scale."""
    _, a, b = np.intersect1d(one.step, two.step, return_indices=True)
    both = np.isfinite(one.value[a]) & np.isfinite(two.value[b])
    if not both.any():
        return float("nan")
    worst = float(np.abs(one.value[a][both] - two.value[b][both]).max())
    return worst / scale if scale > 0.0 else 0.0


def _groups(table: Any, columns: tuple[str, ...]) -> list[tuple[tuple[str, ...], NDArray[np.int64]]]:
    """Row numbers of each distinct combination of text columns, each in the table's own order."""
    import pyarrow.compute as pc

    if table.num_rows == 0:
        return []
    code = np.zeros(table.num_rows, dtype=np.int64)
    names = []
    for column in columns:
        coded = pc.fill_null(table[column], "").combine_chunks().dictionary_encode()
        names.append(coded.dictionary.to_pylist())
        code = code * len(names[-1]) + coded.indices.to_numpy(zero_copy_only=False)
    order = np.argsort(code, kind="stable")
    cuts = np.flatnonzero(np.diff(code[order])) + 1
    groups = []
    for rows in np.split(order, cuts):
        rest, key = int(code[rows[0]]), []
        for values in reversed(names):
            rest, digit = divmod(rest, len(values))
            key.append(str(values[digit]))
        groups.append((tuple(reversed(key)), rows))
    return groups


def _curve(table: Any, rows: NDArray[np.int64], label: str = "") -> Curve:
    part = table.take(rows)

    def column(name: str) -> FloatArray:
        return np.asarray(part[name].to_numpy(zero_copy_only=False), dtype=np.float64)

    order = np.argsort(column("step"), kind="stable")
    is_series = "expected" in part.column_names
    truths = [truth for truth in part["truth"].unique().to_pylist() if truth]
    return Curve(
        step=column("step")[order],
        t=column("t")[order],
        value=column("value")[order],
        expected=(column("expected") if is_series else np.full(len(rows), np.nan))[order],
        unit=part["unit"][0].as_py() or "",
        truth=truths[0] if truths else "",
        label=label,
        source="" if is_series else part["source"][0].as_py() or "",
    )
