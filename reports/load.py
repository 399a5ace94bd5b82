"""Reader of a store: finished runs only, the newest rows of each case variant and engine."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ninedisk.harness.results.schema import RUN_KEYS, SCHEMA_VERSION, TABLES
from ninedisk.reports.curves import Curve, References, Series, keep_rows, split_references, split_series
from ninedisk.reports.errors import ReportError

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
