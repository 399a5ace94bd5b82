"""The result store: one immutable folder a run, written whole or not at all.

A run is written into ``runs/.tmp-<id>``, flushed to disk and renamed to ``runs/<id>``; whatever kills the writer in
between leaves a folder that no reader looks at. Stores merge by copying folders, without locks.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ninedisk.harness.api.errors import NewerSchemaError, StoreError
from ninedisk.harness.results.arrow import arrow_tables, empty_column
from ninedisk.harness.results.schema import OLDEST_SCHEMA, RUN_KEYS, SCHEMA_VERSION, TABLES
from ninedisk.harness.results.tables import CaseResult, Row
from ninedisk.harness.results.tables_part import plain_json

if TYPE_CHECKING:
    import pyarrow as pa
UNFINISHED = ".tmp-"
"""What the name of a half-written run begins with."""


def new_run_id(now: datetime | None = None) -> str:
    """UTC time and a random tail: sorts by time, unique across machines."""
    moment = (now or datetime.now(UTC)).astimezone(UTC)
    return f"{moment:%Y%m%dT%H%M%SZ}-{secrets.token_hex(3)}"


def prepare_store(store: Path) -> None:
    """Make sure that a run can be written, before hours are spent on it.

    Raises
    ------
    StoreError
        If the folder cannot be made or written; nothing that it holds is touched.
    """
    runs = store / "runs"
    try:
        runs.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=UNFINISHED, dir=runs):
            pass
    except OSError as error:
        raise StoreError(
            f"the store {str(store)!r} cannot be written ({error.strerror or error}): "
            f"give another folder with --store DIR"
        ) from error


def write_run(
    store: Path,
    run_id: str,
    results: Sequence[CaseResult],
    claims: Sequence[Row],
    facts: Mapping[str, Any],
) -> Path:
    """Write a run and make it visible in one step.

    Parameters
    ----------
    store : Path
    run_id : str
        From `new_run_id`.
    results : sequence of CaseResult
    claims : sequence of dict
        Rows of `records.CLAIM_COLUMNS`.
    facts : mapping
        The values of ``started``, ``finished``, ``provenance`` and ``argv`` of ``run.json``.

    Returns
    -------
    Path
        The run's folder.

    Raises
    ------
    StoreError
        If anything cannot be written; no part of the run is then visible.
    """
    import pyarrow.parquet as pq

    final, temporary = store / "runs" / run_id, store / "runs" / f"{UNFINISHED}{run_id}"
    try:
        temporary.mkdir(parents=True)
        for name, table in arrow_tables(results, claims).items():
            path = temporary / f"{name}.parquet"
            pq.write_table(table, path, compression="zstd")
            _flush(path)
        about = {**facts, "run_id": run_id, "schema_version": SCHEMA_VERSION}
        path = temporary / "run.json"
        path.write_text(plain_json({key: about[key] for key in RUN_KEYS}) + "\n", encoding="utf-8")
        _flush(path)
        _flush(temporary)
        os.rename(temporary, final)
        _flush(final.parent)
    except BaseException as error:
        shutil.rmtree(temporary, ignore_errors=True)
        if isinstance(error, OSError):
            raise StoreError(f"the run could not be stored in {str(store)!r}: {error.strerror or error}") from error
        raise
    return final


def run_ids(store: Path) -> list[str]:
    """Ids of the finished runs, oldest first; a store that does not exist has none."""
    runs = store / "runs"
    if not runs.is_dir():
        return []
    return sorted(
        path.name for path in runs.iterdir() if not path.name.startswith(".") and (path / "run.json").is_file()
    )


def unfinished(store: Path) -> list[Path]:
    """Folders that a writer left behind half-written, or is writing now."""
    runs = store / "runs"
    if not runs.is_dir():
        return []
    finished = set(run_ids(store))
    return sorted(path for path in runs.iterdir() if path.is_dir() and path.name not in finished)


def read_run(store: Path, run_id: str) -> tuple[dict[str, Any], dict[str, pa.Table]]:
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
        raise StoreError(f"run {run_id!r} is damaged: its run.json cannot be read ({error})") from error
    if lacking:
        raise StoreError(f"run {run_id!r} is damaged: its run.json lacks {', '.join(lacking)}")
    check_schema(f"run {run_id!r}", version)
    return {**about, "run_id": run_id, "schema_version": version}


def check_schema(what: str, version: int) -> None:
    """Refuse a schema that this version does not know.

    Raises
    ------
    StoreError
        If ``version`` is newer than `records.SCHEMA_VERSION` or older than `records.OLDEST_SCHEMA`.
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


def read_table(store: Path, about: Mapping[str, Any], name: str, columns: Sequence[str] | None = None) -> pa.Table:
    """One table of a run, or some of its columns, in the form of today's schema.

    Raises
    ------
    StoreError
        If the file is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    run_id = about["run_id"]
    kinds = {column: TABLES[name][column] for column in columns or TABLES[name]}
    try:
        file = pq.ParquetFile(store / "runs" / run_id / f"{name}.parquet")
        held = [column for column in kinds if column in file.schema_arrow.names]
        table = file.read(columns=held, use_threads=False)
        table.validate(full=True)  # a checksum is nothing that these files have
        missing = sorted(set(kinds) - set(held))
        if missing and about["schema_version"] == SCHEMA_VERSION:
            raise StoreError(f"run {run_id!r} is damaged: {name}.parquet lacks the column(s) {', '.join(missing)}")
        return pa.table({c: table[c] if c in held else empty_column(kinds[c], file.metadata.num_rows) for c in kinds})
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        raise StoreError(f"run {run_id!r} is damaged: {error}") from error


def _flush(path: Path) -> None:
    """Force a file's data, or a folder's entries, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
