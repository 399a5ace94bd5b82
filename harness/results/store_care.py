"""Care of stores: what is in them, joining them, clearing them."""

from __future__ import annotations

import os
import shutil
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from ninedisk.harness.api.errors import NewerSchemaError, StoreError, UsageError
from ninedisk.harness.results.schema import RunFacts
from ninedisk.harness.results.snapshot import moment, run_facts
from ninedisk.harness.results.store import (
    UNFINISHED,
    prepare_store,
    read_about,
    read_run,
    read_table,
    run_ids,
    unfinished,
)

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
