"""The result store: one immutable folder a run, written whole or not at all.

A run is written into ``runs/.tmp-<id>``, flushed to disk and renamed to ``runs/<id>``; whatever kills the writer in
between leaves a folder that no reader looks at. Stores merge by copying folders, without locks.

A run as comparisons and histories need it: its facts, its cells and its checks, without curves.

Care of stores: what is in them, joining them, clearing them.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ninedisk.harness.api.errors import NewerSchemaError, StoreError, UsageError
from ninedisk.harness.results.schema import (
    CELL_COLUMNS,
    MEASUREMENT_COLUMNS,
    OLDEST_SCHEMA,
    RUN_KEYS,
    SCHEMA_VERSION,
    TABLES,
    RunFacts,
)
from ninedisk.harness.results.tables import CaseResult, Row, arrow_tables, empty_column, plain_json

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
        Rows of `schema.CLAIM_COLUMNS`.
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


CellKey = tuple[str, str, str]
"""Case, variant, engine."""

CheckKey = tuple[str, str, str, int]
"""Quantity, norm, kind of truth, and a number that tells checks alike in these apart."""

CELL_KEY = ("case", "variant", "engine")
LEFT_OUT = ("setup", "frames", "settings")
"""Columns of cells that are large and that no comparison reads."""

CELLS = tuple(column for column in CELL_COLUMNS if column not in LEFT_OUT)
CHECKS = tuple(MEASUREMENT_COLUMNS)
BROKEN = frozenset({"error", "timeout"})
NOT_RUN = frozenset({"unsupported", "not-installed"})


@dataclass(frozen=True)
class Snapshot:
    """One run: ``checks`` are the measured quantities of each cell that ran."""

    facts: RunFacts
    cells: Mapping[CellKey, Row]
    checks: Mapping[CellKey, Mapping[CheckKey, Row]]


def load_snapshot(store: Path, run_id: str) -> Snapshot:
    """Read a finished run.

    Raises
    ------
    StoreError
        If it is damaged, or its schema is newer or too old.
    """
    about = read_about(store, run_id)
    cells = read_table(store, about, "cells", CELLS).to_pylist()
    checks = read_table(store, about, "measurements", CHECKS).to_pylist()
    return snapshot(run_facts(about), cells, checks)


def load_snapshots(store: Path) -> list[Snapshot]:
    """Every finished run, oldest first; StoreError for the first that cannot be read."""
    return in_order(load_snapshot(store, run_id) for run_id in run_ids(store))


def in_order(snapshots: Iterable[Snapshot]) -> list[Snapshot]:
    """Oldest first, by the moment at which the run began."""
    return sorted(snapshots, key=lambda each: (moment(each.facts.started), each.facts.run_id))


def snapshot(facts: RunFacts, cells: Iterable[Row], checks: Iterable[Row]) -> Snapshot:
    """Sort rows by cell and check; rows without a quantity stand for a whole cell and are left out."""
    sorted_checks: dict[CellKey, dict[CheckKey, Row]] = {}
    for row in checks:
        if not row["quantity"]:
            continue
        of_cell = sorted_checks.setdefault(cell_key(row), {})
        number = 0
        while (key := (row["quantity"], row["norm"], row["truth"], number)) in of_cell:
            number += 1
        of_cell[key] = row
    return Snapshot(facts, {cell_key(row): row for row in cells}, sorted_checks)


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


def moment(started: str) -> datetime:
    """The time of a run; the earliest of all where it cannot be read."""
    try:
        found = datetime.fromisoformat(started)
    except ValueError:
        return datetime.min.replace(tzinfo=UTC)
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def _text(value: Any) -> str:
    return "" if value is None else str(value)


STALE_SECONDS = 86400.0
"""Age from which on a half-written folder is no longer anyone's: the longest main job takes a fraction of a day."""


@dataclass(frozen=True)
class Listed:
    """A folder of a store; ``facts`` is None and ``problem`` says why if it cannot be read."""

    name: str
    facts: RunFacts | None
    cells: Counter[str]
    engines: tuple[str, ...]
    problem: str


def listed(store: Path) -> list[Listed]:
    """Every folder of a store, oldest run first, those that cannot be read at the end."""
    found = []
    for run_id in run_ids(store):
        try:
            about = read_about(store, run_id)
            cells = read_table(store, about, "cells", ("engine", "status")).to_pylist()
        except StoreError as error:
            found.append(Listed(run_id, None, Counter(), (), str(error)))
            continue
        statuses = Counter(str(cell["status"]) for cell in cells)
        engines = tuple(sorted({str(cell["engine"]) for cell in cells}))
        found.append(Listed(run_id, run_facts(about), statuses, engines, ""))
    found.sort(key=lambda run: (run.facts is None, moment(run.facts.started if run.facts else ""), run.name))
    left = [Listed(path.name, None, Counter(), (), "half-written: never read") for path in unfinished(store)]
    return [*found, *left]


def merge(sources: Sequence[Path], store: Path) -> tuple[list[str], list[str]]:
    """Copy every finished run of ``sources`` that ``store`` lacks; ids of the copied ones and of those already there.

    Every run is read in full before it is copied, so that no damaged one spreads; a copy becomes visible in one step.

    Raises
    ------
    UsageError
        If a source holds no finished run; StoreError if one cannot be read, the store cannot be written, or a run of
        the same id but another content is there already.
    """
    for source in sources:
        if not run_ids(source):
            raise UsageError(f"{str(source)!r} holds no finished run: name folders that `ninedisk run --store` wrote")
    prepare_store(store)
    copied, present = [], []
    for source in sources:
        for run_id in run_ids(source):
            read_run(source, run_id)
            origin, target = (place / "runs" / run_id for place in (source, store))
            if target.exists():
                if not _same(origin, target):
                    raise StoreError(
                        f"run {run_id!r} of {str(source)!r} differs from the one in {str(store)!r}: one of them was "
                        f"changed by hand; remove it, then merge again"
                    )
                present.append(run_id)
                continue
            _copy(origin, target)
            copied.append(run_id)
    return copied, present


def _copy(origin: Path, target: Path) -> None:
    temporary = target.with_name(f"{UNFINISHED}{target.name}")
    try:
        shutil.rmtree(temporary, ignore_errors=True)
        shutil.copytree(origin, temporary)
        os.rename(temporary, target)
    except OSError as error:
        shutil.rmtree(temporary, ignore_errors=True)
        raise StoreError(f"run {origin.name!r} could not be copied: {error.strerror or error}") from error


def _same(one: Path, two: Path) -> bool:
    names = sorted(path.name for path in one.iterdir())
    if names != sorted(path.name for path in two.iterdir()):
        return False
    return all((one / name).read_bytes() == (two / name).read_bytes() for name in names)


@dataclass(frozen=True)
class Doomed:
    """A folder that `prune` would remove, and why."""

    path: Path
    reason: str


def to_prune(
    store: Path, *, keep: int | None = None, before: datetime | None = None, unreadable: bool = False
) -> list[Doomed]:
    """What there is to remove: stale half-written folders, and what is asked for.

    Parameters
    ----------
    store : Path
    keep : int, optional
        Remove all but so many of the newest finished runs.
    before : datetime, optional
        Remove finished runs that began earlier.
    unreadable : bool
        Remove runs that are damaged or have too old a schema; those of a newer one stay, since an upgrade reads them.

    Raises
    ------
    StoreError
        If a finished run that is to stay cannot be read, because its age is then unknown.
    """
    now = time.time()
    found = [
        Doomed(path, "half-written, untouched for a day")
        for path in unfinished(store)
        if now - path.stat().st_mtime > STALE_SECONDS
    ]
    bad = _unreadable(store) if unreadable else {}
    found += [Doomed(store / "runs" / run_id, problem) for run_id, problem in bad.items()]
    if keep is None and before is None:
        return found
    ages = {
        run_id: moment(run_facts(read_about(store, run_id)).started) for run_id in run_ids(store) if run_id not in bad
    }
    ordered = sorted(ages, key=lambda run_id: (ages[run_id], run_id))
    for place, run_id in enumerate(ordered):
        path = store / "runs" / run_id
        if keep is not None and place < len(ordered) - keep:
            found.append(Doomed(path, f"not among the newest {keep}"))
        elif before is not None and ages[run_id] < before:
            found.append(Doomed(path, f"older than {before:%Y-%m-%d}"))
    return found


def _unreadable(store: Path) -> dict[str, str]:
    found = {}
    for run_id in run_ids(store):
        try:
            read_run(store, run_id)
        except NewerSchemaError:
            continue
        except StoreError as error:
            found[run_id] = str(error)
    return found


def prune(doomed: Sequence[Doomed]) -> None:
    """Remove folders: each is renamed to a name that no reader looks at before its files go.

    Raises
    ------
    StoreError
        If one cannot be removed.
    """
    for each in doomed:
        hidden = each.path.with_name(f"{UNFINISHED}{each.path.name.removeprefix(UNFINISHED)}")
        try:
            os.rename(each.path, hidden)
            shutil.rmtree(hidden)
        except OSError as error:
            raise StoreError(f"{str(each.path)!r} cannot be removed: {error.strerror or error}") from error
