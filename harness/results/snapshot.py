"""A run as comparisons and histories need it: its facts, its cells and its checks, without curves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ninedisk.harness.results.schema import CELL_COLUMNS, MEASUREMENT_COLUMNS, RunFacts
from ninedisk.harness.results.store import read_about, read_table, run_ids
from ninedisk.harness.results.tables import Row

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
