"""The result store: one immutable folder a run, written whole or not at all; what is in it, joining and clearing of stores.

A run is written into ``runs/.tmp-<id>``, flushed to disk and renamed to ``runs/<id>``; whatever kills the writer in
between leaves a folder that no reader looks at. Stores merge by copying folders, without locks. A `Snapshot` is a run as
comparisons and histories need it: its facts, its cells and its checks, without curves.
"""

from __future__ import annotations

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
from typing import Any

from ninedisk.harness.api.errors import NewerSchemaError, StoreError, UsageError
from ninedisk.harness.results.reader import (
    CellKey,
    cell_key,
    read_about,
    read_rows,
    read_run,
    run_facts,
    run_ids,
    run_time,
)
from ninedisk.harness.results.schema import (
    CELL_COLUMNS,
    MEASUREMENT_COLUMNS,
    RUN_KEYS,
    SCHEMA_VERSION,
    TABLES,
    Row,
    RunFacts,
)
from ninedisk.harness.results.tables import CaseResult, complete, plain_json, tables, write_table

UNFINISHED = ".tmp-"
"""What the name of a half-written run begins with."""

INTERRUPTED = "interrupted"
"""Folder with the finished cells of runs that were interrupted (`ninedisk.harness.run.journal`)."""


CheckKey = tuple[str, str, str, int]
"""Quantity, norm, kind of truth, and a number that distinguishes checks alike in these."""

HEADLINE = "headline"
"""Kind of truth of a headline among checks."""

HEADLINE_FLOOR = 1e-6
"""Ten times the relative headline error from which on a change is no rounding: single precision has that of some steps."""

LEFT_OUT = ("setup", "frames", "settings")
"""Columns of cells that are large and that no comparison reads."""

CELLS = tuple(column for column in CELL_COLUMNS if column not in LEFT_OUT)

BROKEN = frozenset({"error", "timeout"})

NOT_RUN = frozenset({"unsupported", "not-installed"})

STALE_SECONDS = 86400.0
"""Age from which on a half-written folder is no longer anyone's: the longest main job takes a fraction of a day."""


def new_run_id() -> str:
    """UTC time and a random tail: sorts by time, unique across machines."""
    return f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(3)}"


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
    final, temporary = store / "runs" / run_id, store / "runs" / f"{UNFINISHED}{run_id}"
    try:
        temporary.mkdir(parents=True)
        for name, table in tables(results, claims).items():
            path = temporary / f"{name}.parquet"
            with path.open("wb") as stream:  # Arrow takes no path that is not UTF-8
                write_table(table, TABLES[name], stream)
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


def unfinished_folders(store: Path) -> list[Path]:
    """Folders that a writer left behind half-written, or is writing now."""
    runs = store / "runs"
    if not runs.is_dir():
        return []
    finished = set(run_ids(store))
    return sorted(path for path in runs.iterdir() if path.is_dir() and path.name not in finished)


def _flush(path: Path) -> None:
    """Force a file's data, or a folder's entries, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@dataclass(frozen=True)
class Snapshot:
    """One run: ``checks`` are the measured quantities of each cell that ran, its headlines (`as_check`) among them."""

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
    checks = read_rows(store, about, "measurements") + [as_check(row) for row in read_rows(store, about, "headlines")]
    return snapshot(run_facts(about), read_rows(store, about, "cells", CELLS), checks)


def as_check(headline: Row) -> Row:
    """A headline in the columns of a check, for comparisons and exports: its relative error, no verdict, `HEADLINE_FLOOR` as tolerance."""
    own = {name: headline[name] for name in MEASUREMENT_COLUMNS if name in headline}
    words = {"quantity": headline["headline"], "unit": "1", "norm": "scalar", "truth": HEADLINE}
    why = f"of the {headline['scale_is']}; a headline has no tolerance, and is compared from a tenth of this on"
    return complete(
        own | words | {"abs_error": headline["rel_error"], "atol": HEADLINE_FLOOR, "rtol": 0.0, "why": why},
        MEASUREMENT_COLUMNS,
    )


def load_snapshots(store: Path) -> list[Snapshot]:
    """Every finished run, oldest first; StoreError for the first that cannot be read."""
    return sorted_runs(load_snapshot(store, run_id) for run_id in run_ids(store))


def sorted_runs(snapshots: Iterable[Snapshot]) -> list[Snapshot]:
    """Oldest first, by the moment at which the run began."""
    return sorted(snapshots, key=lambda each: (run_time(each.facts.started), each.facts.run_id))


def snapshot(facts: RunFacts, cells: Iterable[Row], checks: Iterable[Row]) -> Snapshot:
    """Sort rows by cell and check; rows without a quantity represent a whole cell and are left out."""
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


@dataclass(frozen=True)
class ListedFolder:
    """A folder of a store; ``facts`` is None and ``problem`` says why if it cannot be read."""

    name: str
    facts: RunFacts | None
    cells: Counter[str]
    engines: tuple[str, ...]
    problem: str


def list_folders(store: Path) -> list[ListedFolder]:
    """Every folder of a store, oldest run first, those that cannot be read at the end."""
    found = []
    for run_id in run_ids(store):
        try:
            about = read_about(store, run_id)
            cells = read_rows(store, about, "cells", ("engine", "status"))
        except StoreError as error:
            found.append(ListedFolder(run_id, None, Counter(), (), str(error)))
            continue
        statuses = Counter(str(cell["status"]) for cell in cells)
        engines = tuple(sorted({str(cell["engine"]) for cell in cells}))
        found.append(ListedFolder(run_id, run_facts(about), statuses, engines, ""))
    found.sort(key=lambda run: (run.facts is None, run_time(run.facts.started if run.facts else ""), run.name))
    left = [
        ListedFolder(path.name, None, Counter(), (), "half-written: never read") for path in unfinished_folders(store)
    ]
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
class PruneCandidate:
    """A folder, or the file of an interrupted run, that `prune` would remove, and why."""

    path: Path
    reason: str


def prune_candidates(
    store: Path, *, keep: int | None = None, before: datetime | None = None, unreadable: bool = False
) -> list[PruneCandidate]:
    """What there is to remove: stale half-written folders and interrupted runs, and what is asked for.

    Parameters
    ----------
    store : Path
    keep : int, optional
        Remove all except so many of the newest finished runs.
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
        PruneCandidate(path, "half-written, untouched for a day")
        for path in unfinished_folders(store)
        if now - path.stat().st_mtime > STALE_SECONDS
    ]
    found += [
        PruneCandidate(path, "interrupted run, untouched for a day")
        for path in sorted((store / INTERRUPTED).glob("*.journal"))
        if now - path.stat().st_mtime > STALE_SECONDS
    ]
    bad = _unreadable(store) if unreadable else {}
    found += [PruneCandidate(store / "runs" / run_id, problem) for run_id, problem in bad.items()]
    if keep is None and before is None:
        return found
    ages = {
        run_id: run_time(run_facts(read_about(store, run_id)).started) for run_id in run_ids(store) if run_id not in bad
    }
    ordered = sorted(ages, key=lambda run_id: (ages[run_id], run_id))
    for place, run_id in enumerate(ordered):
        path = store / "runs" / run_id
        if keep is not None and place < len(ordered) - keep:
            found.append(PruneCandidate(path, f"not among the newest {keep}"))
        elif before is not None and ages[run_id] < before:
            found.append(PruneCandidate(path, f"older than {before:%Y-%m-%d}"))
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


def prune(doomed: Sequence[PruneCandidate]) -> None:
    """Remove folders, and files of interrupted runs: each folder is renamed to a name that no reader looks at before its files go.

    Raises
    ------
    StoreError
        If one cannot be removed.
    """
    for each in doomed:
        hidden = each.path.with_name(f"{UNFINISHED}{each.path.name.removeprefix(UNFINISHED)}")
        try:
            if each.path.is_file():
                each.path.unlink()
                continue
            os.rename(each.path, hidden)
            shutil.rmtree(hidden)
        except OSError as error:
            raise StoreError(f"{str(each.path)!r} cannot be removed: {error.strerror or error}") from error
