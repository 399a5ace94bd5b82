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

from ninedisk.harness.arrow import arrow_tables
from ninedisk.harness.errors import StoreError
from ninedisk.harness.records import RUN_KEYS, SCHEMA_VERSION, TABLES
from ninedisk.harness.results import CaseResult, Row
from ninedisk.harness.tables import plain_json

if TYPE_CHECKING:
    import pyarrow as pa

_UNFINISHED = ".tmp-"


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
        with tempfile.TemporaryDirectory(prefix=_UNFINISHED, dir=runs):
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

    final, temporary = store / "runs" / run_id, store / "runs" / f"{_UNFINISHED}{run_id}"
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


def read_run(store: Path, run_id: str) -> tuple[dict[str, Any], dict[str, pa.Table]]:
    """``run.json`` and the tables of a finished run.

    Raises
    ------
    StoreError
        If there is no such finished run, it is damaged, or it was written by a newer version.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = store / "runs" / run_id
    if run_id not in run_ids(store):
        raise StoreError(f"the store {str(store)!r} has no finished run {run_id!r}")
    try:
        about = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        version = int(about["schema_version"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"run {run_id!r} is damaged: its run.json cannot be read ({error})") from error
    if version > SCHEMA_VERSION:
        raise StoreError(
            f"run {run_id!r} was written with schema {version}, this version reads up to {SCHEMA_VERSION}: "
            f"upgrade ninedisk to read it"
        )
    try:
        return about, {name: pq.read_table(folder / f"{name}.parquet") for name in TABLES}
    except (OSError, pa.ArrowException) as error:
        raise StoreError(f"run {run_id!r} is damaged: {error}") from error


def _flush(path: Path) -> None:
    """Force a file's data, or a folder's entries, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
