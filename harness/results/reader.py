"""The one reader of stores: which finished runs there are, what they came from, and their tables in the form of today's schema.

A run that is half-written, or being written now, is never looked at. Commands, comparisons, histories, the suite and the reports
all read through here; the reports know nothing else of the harness but the schema and the declarations of figures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ninedisk.harness.api.errors import NewerSchemaError, StoreError
from ninedisk.harness.results.schema import (
    DETERMINISM_COLUMNS,
    DETERMINISM_KINDS,
    DETERMINISM_VERDICTS,
    EMPTY,
    OLDEST_SCHEMA,
    RUN_KEYS,
    SCHEMA_VERSION,
    SINCE,
    TABLES,
    Row,
    RunFacts,
)

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

CellKey = tuple[str, str, str]
"""Case, variant, engine."""

CELL_KEY = ("case", "variant", "engine")


def run_ids(store: Path) -> list[str]:
    """Ids of the finished runs, oldest first; a store that does not exist has none."""
    runs = store / "runs"
    if not runs.is_dir():
        return []
    return sorted(
        path.name for path in runs.iterdir() if not path.name.startswith(".") and (path / "run.json").is_file()
    )


def read_run(store: Path, run_id: str) -> tuple[dict[str, Any], dict[str, pd.DataFrame]]:
    """``run.json`` and the tables of a finished run; columns that an older schema lacks are empty.

    Raises
    ------
    StoreError
        If there is no such finished run, it is damaged, or its schema is newer or too old.
    """
    about = read_about(store, run_id)
    return about, {name: read_table(store, about, name) for name in TABLES}


def read_about(store: Path, run_id: str) -> dict[str, Any]:
    """``run.json`` of a finished run, once its schema is known to be readable.

    Raises
    ------
    StoreError
        As `read_run`.
    """
    if run_id not in run_ids(store):
        raise StoreError(f"the store {str(store)!r} has no finished run {run_id!r}; `ninedisk runs` lists them")
    try:
        about: dict[str, Any] = json.loads((store / "runs" / run_id / "run.json").read_text(encoding="utf-8"))
        version = int(about["schema_version"])
        lacking = [key for key in RUN_KEYS if key not in about]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(
            f"run {run_id!r} is damaged: its run.json cannot be read ({error}); copy the run again, or remove it"
        ) from error
    if lacking:
        raise StoreError(
            f"run {run_id!r} is damaged: its run.json lacks {', '.join(lacking)}; copy the run again, or remove it"
        )
    check_schema(f"run {run_id!r}", version)
    return {**about, "run_id": run_id, "schema_version": version}


def check_schema(what: str, version: int) -> None:
    """Refuse a schema that this version does not know.

    Raises
    ------
    StoreError
        If ``version`` is newer than `schema.SCHEMA_VERSION` or older than `schema.OLDEST_SCHEMA`.
    """
    if version > SCHEMA_VERSION:
        raise NewerSchemaError(
            f"{what} was written with schema {version}, this version reads up to {SCHEMA_VERSION}: "
            f"upgrade ninedisk to read it"
        )
    if version < OLDEST_SCHEMA:
        raise StoreError(
            f"{what} was written with schema {version}, which is unreadable now (the oldest readable one is "
            f"{OLDEST_SCHEMA}): run the cases again, and remove it with `ninedisk prune --unreadable`"
        )


def read_table(store: Path, about: Mapping[str, Any], name: str, columns: Sequence[str] = ()) -> pd.DataFrame:
    """One table of a run, or some of its columns, in the form of today's schema; what is unknown there is `schema.EMPTY`.

    Raises
    ------
    StoreError
        If the file is damaged.
    """
    table: pd.DataFrame = _read(store, about, name, columns).to_pandas()
    return table


def read_rows(store: Path, about: Mapping[str, Any], name: str, columns: Sequence[str] = ()) -> list[Row]:
    """As `read_table`, row by row."""
    rows: list[Row] = _read(store, about, name, columns).to_pylist()
    return rows


def _read(store: Path, about: Mapping[str, Any], name: str, columns: Sequence[str]) -> pa.Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    run_id = about["run_id"]
    kinds = {column: TABLES[name][column] for column in columns or TABLES[name]}
    arrow = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64()}
    if about["schema_version"] < SINCE.get(name, OLDEST_SCHEMA):
        return pa.table({column: pa.array([], arrow[kind]) for column, kind in kinds.items()})
    try:
        # Not `pandas.read_parquet`: that takes words such as "a=b" in the folder's name for columns. Opened here, since Arrow
        # takes no path that is not UTF-8.
        with (store / "runs" / run_id / f"{name}.parquet").open("rb") as stream:
            file = pq.ParquetFile(stream)
            held = [column for column in kinds if column in file.schema_arrow.names]
            table = file.read(columns=held, use_threads=False)
        table.validate(full=True)  # a checksum is nothing that these files have
        missing = sorted(set(kinds) - set(held))
        if missing and about["schema_version"] == SCHEMA_VERSION:
            raise StoreError(f"run {run_id!r} is damaged: {name}.parquet lacks the column(s) {', '.join(missing)}")
        empty = {column: pa.scalar(EMPTY[kind], arrow[kind]) for column, kind in kinds.items()}
        found = {
            column: table[column].cast(arrow[kind]).fill_null(empty[column])
            if column in held
            else pa.repeat(empty[column], file.metadata.num_rows)
            for column, kind in kinds.items()
        }
        return pa.table(found)
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        raise StoreError(
            f"run {run_id!r} is damaged: {name}.parquet cannot be read ({error}); copy the run again, or remove it"
        ) from error


def read_determinism(store: Path) -> list[Row]:
    """Rows of every engine whose determinism was measured, with the columns of `schema.DETERMINISM_COLUMNS`; an unknown number is NaN.

    Raises
    ------
    StoreError
        If a file is damaged.
    """
    found: list[Row] = []
    for path in sorted((store / "determinism").glob("*.json")):
        try:
            rows = json.loads(path.read_text(encoding="utf-8"))
            for row in rows:
                kept = {
                    name: EMPTY[kind] if row[name] is None else row[name] for name, kind in DETERMINISM_COLUMNS.items()
                }
                if kept["kind"] not in DETERMINISM_KINDS or kept["verdict"] not in DETERMINISM_VERDICTS:
                    raise ValueError(f"{kept['kind']}: {kept['verdict']}")
                found.append(kept)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StoreError(
                f"{str(path)!r} is damaged ({error}): measure again with `ninedisk determinism --engine "
                f"{path.stem.removesuffix('.spheres')}{' --spheres' if path.stem.endswith('.spheres') else ''}`, or remove it"
            ) from error
    return found


TUNING = ("case", "variant", "headline", "headlines", "engine", "engine_name", "own_step", "points", "tuned", "answers")
"""What a record of ``ninedisk tune`` has."""


def read_tuning(store: Path) -> list[Row]:
    """Records of ``ninedisk tune --all``, one for each engine and case, as `ninedisk.harness.run.tune.tune` returns them.

    Raises
    ------
    StoreError
        If a file is damaged.
    """
    found: list[Row] = []
    for path in sorted((store / "tune").glob("*.json")):
        try:
            for record in json.loads(path.read_text(encoding="utf-8")):
                found.append({name: record[name] for name in TUNING})
                if not record["points"]:
                    raise ValueError("no points")
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StoreError(
                f"{str(path)!r} is damaged ({error}): measure again with `ninedisk tune --all --engine {path.stem}`, or remove it"
            ) from error
    return found


def cell_key(row: Mapping[str, Any]) -> CellKey:
    """Case, variant and engine of a row."""
    return row["case"], row["variant"], row["engine"]


def run_facts(about: Mapping[str, Any]) -> RunFacts:
    """The facts of a ``run.json``; what is missing there is empty."""
    found = about["provenance"] if isinstance(about["provenance"], Mapping) else {}
    versions = {"ninedisk": _text(found.get("ninedisk")), "python": _text(found.get("python"))}
    for group in ("engines", "packages"):
        held = found.get(group)
        if isinstance(held, Mapping):
            versions |= {_text(name): _text(version) for name, version in held.items()}
    cores = found.get("cores")
    machine = (_text(found.get("cpu")), f"{cores} cores" if cores else "", _text(found.get("platform")), _load(found))
    argv = about["argv"] if isinstance(about["argv"], list) else [about["argv"]]
    return RunFacts(
        run_id=_text(about["run_id"]),
        started=_text(about["started"]),
        commit=_text(found.get("commit")),
        machine=", ".join(part for part in machine if part) or "unknown machine",
        versions={name: version for name, version in versions.items() if version},
        command=" ".join(_text(word) for word in argv),
    )


def _load(found: Mapping[str, Any]) -> str:
    """What ran beside each cell: cells of one run share the machine, so that its timings are those of another machine."""
    jobs = found.get("jobs")
    where = " on a Dask cluster" if found.get("dask") else ""
    return f"{jobs} cells at once{where}" if where or (isinstance(jobs, int) and jobs > 1) else ""


def run_time(started: str) -> datetime:
    """The time of a run; the earliest of all where it cannot be read."""
    try:
        found = datetime.fromisoformat(started)
    except ValueError:
        return datetime.min.replace(tzinfo=UTC)
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def _text(value: Any) -> str:
    return "" if value is None else str(value)
