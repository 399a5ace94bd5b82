"""Runs as one flat table: a row for each check, or for each cell that left none, with what it came from."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO, Any

from ninedisk.harness.api.errors import StoreError
from ninedisk.harness.results.reader import cell_key, check_schema
from ninedisk.harness.results.schema import CELL_COLUMNS, EMPTY, MEASUREMENT_COLUMNS, SCHEMA_VERSION, Row, RunFacts
from ninedisk.harness.results.store import Snapshot, snapshot, sorted_runs
from ninedisk.harness.results.tables import of_rows, plain_json, write_table
from ninedisk.harness.results.whole_file import open_whole

RUN_COLUMNS = {
    "schema_version": "int64",
    "run_id": "string",
    "started": "string",
    "commit": "string",
    "machine": "string",
    "versions": "string",  # JSON object
    "command": "string",
}
OF_CELL = (
    "case_title",
    "engine_name",
    "setup_s",
    "warm_up_s",
    "advance_s",
    "cpu_s",
    "cpu_of",
    "cpu_spread",
    "reference_s",
    "n_steps",
    "n_disks",
)
COLUMNS: dict[str, str] = {
    **RUN_COLUMNS,
    **MEASUREMENT_COLUMNS,
    **{name: CELL_COLUMNS[name] for name in OF_CELL},
    "cell_status": "string",
    "cell_reason": "string",
}
"""Columns of an exported table in their order, with their kinds."""

FORMATS = (".csv", ".json", ".parquet")


def export_rows(snapshots: Iterable[Snapshot]) -> list[Row]:
    """Rows of `COLUMNS`."""
    rows = []
    for run in snapshots:
        facts = run.facts
        head = {name: getattr(facts, name) for name in RUN_COLUMNS if name not in ("schema_version", "versions")}
        head |= {"schema_version": SCHEMA_VERSION, "versions": json.dumps(dict(facts.versions))}
        for key, cell in run.cells.items():
            common = {**head, **{name: cell[name] for name in COLUMNS if name in cell}}
            common |= {"cell_status": cell["status"], "cell_reason": cell["reason"]}
            checks = run.checks.get(key, {})
            for check in checks.values() or [{}]:
                row = {**common, **check}
                rows.append({name: row.get(name, EMPTY[kind]) for name, kind in COLUMNS.items()})
    return rows


def write_export(rows: Sequence[Row], path: Path) -> None:
    """Write rows as CSV, JSON or Parquet, by the ending of ``path``; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If the ending is none of `FORMATS` or the file cannot be written.
    """
    writers = {".csv": _write_csv, ".json": _write_json, ".parquet": _write_parquet}
    if path.suffix not in writers:
        raise StoreError(f"{str(path)!r} has no known ending: give a file that ends in {', '.join(FORMATS)}")
    with open_whole(path) as stream:
        writers[path.suffix](rows, stream)


def read_export(path: Path) -> list[Snapshot]:
    """Runs of an exported file, oldest first.

    Raises
    ------
    StoreError
        If it is no exported file of a schema that this version reads.
    """
    import pyarrow as pa

    readers = {".csv": _read_csv, ".json": _read_json, ".parquet": _read_parquet}
    if path.suffix not in readers:
        raise StoreError(f"{str(path)!r} is no exported file: its name must end in {', '.join(FORMATS)}")
    try:
        rows = readers[path.suffix](path)
        for version in {int(row["schema_version"]) for row in rows}:
            check_schema(repr(str(path)), version)
        typed = [{name: _typed(row.get(name), kind) for name, kind in COLUMNS.items()} for row in rows]
        return _runs(typed)
    except StoreError:
        raise
    except (OSError, ValueError, TypeError, KeyError, AttributeError, csv.Error, pa.ArrowException) as error:
        raise StoreError(
            f"{str(path)!r} cannot be read as a file of `ninedisk export` ({type(error).__name__}: {error}): "
            f"export the run again"
        ) from error


def _runs(rows: Iterable[Row]) -> list[Snapshot]:
    by_run: dict[str, list[Row]] = {}
    for row in rows:
        by_run.setdefault(row["run_id"], []).append(row)
    found = []
    for run_id, group in by_run.items():
        first = group[0]
        facts = RunFacts(
            run_id=run_id,
            started=first["started"],
            commit=first["commit"],
            machine=first["machine"],
            versions=json.loads(first["versions"]),
            command=first["command"],
        )
        cells = {cell_key(row): row | {"status": row["cell_status"], "reason": row["cell_reason"]} for row in group}
        found.append(snapshot(facts, cells.values(), group))
    return sorted_runs(found)


def _typed(value: Any, kind: str) -> Any:
    if kind == "string":
        return "" if value is None else str(value)
    if value is None or value == "":
        return EMPTY[kind]
    return int(value) if kind == "int64" else float(value)


def _write_csv(rows: Sequence[Row], stream: IO[bytes]) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _csv_value(value) for name, value in row.items()} for row in rows)
    stream.write(text.getvalue().encode())


def _csv_value(value: Any) -> Any:
    """Floats with the digits that give the same double back; an unknown one is an empty field."""
    return "" if isinstance(value, float) and math.isnan(value) else value


def _write_json(rows: Sequence[Row], stream: IO[bytes]) -> None:
    lines = ",\n".join(plain_json(row) for row in rows)
    stream.write(f"[\n{lines}\n]\n".encode())


def _write_parquet(rows: Sequence[Row], stream: IO[bytes]) -> None:
    write_table(of_rows(rows, COLUMNS), COLUMNS, stream)


def _read_csv(path: Path) -> list[Row]:
    text = path.read_text(encoding="utf-8")
    reader = csv.DictReader(io.StringIO(text, newline=""))
    _expect_columns(path, reader.fieldnames or ())
    rows = list(reader)
    if not text.endswith("\n"):  # its last number may be half a number
        raise ValueError(f"the file is cut off in its last line, after {len(rows)} rows")
    return rows


def _read_json(path: Path) -> list[Row]:
    rows = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ValueError("not a list of rows")
    _expect_columns(path, rows[0] if rows else COLUMNS)
    return rows


def _read_parquet(path: Path) -> list[Row]:
    import pyarrow.parquet as pq

    with path.open("rb") as stream:  # Arrow takes no path that is not UTF-8
        table = pq.ParquetFile(stream).read(use_threads=False)
    _expect_columns(path, table.column_names)
    rows: list[Row] = table.to_pylist()
    return rows


def _expect_columns(path: Path, held: Iterable[str]) -> None:
    missing = sorted({*RUN_COLUMNS, "case", "variant", "engine", "quantity", "cell_status"} - set(held))
    if missing:
        raise StoreError(
            f"{str(path)!r} is no file of `ninedisk export`: it lacks the column(s) {', '.join(missing[:5])}"
        )
