"""Cells of a finished run that are judged unchanged, because running them again could only give the same.

A stored cell is taken only if everything that can move its numbers is what it was: our sources by their content, Python, the
packages, the machine, the engine's version, the case's version, and the very scene and numerics. Cells of other packages' cases
and engines are run in any case, since nothing shows whether their sources changed; so are cells that ended without a
measurement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ninedisk.harness.api.errors import StoreError
from ninedisk.harness.api.registry import BUILTIN, case_table, engine_table_with_stock
from ninedisk.harness.results.reader import CellKey, cell_key, read_about, read_rows, run_ids
from ninedisk.harness.results.schema import Row
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.provenance import provenance
from ninedisk.harness.run.runner import planned_columns

ELSEWHERE = ("commit", "engines", "jobs", "resumed")
"""Facts that are not compared as such: the digest of the sources is sharper, engines are compared cell by cell, and how many cells
run at once, or were kept of an interrupted run, moves timings, not results."""

CELL_COLUMNS = ("case", "variant", "engine", "case_version", "params", "setup", "engine_version", "status", "reason")
SAME = ("case_version", "params", "setup")
"""Columns of a cell that its plan must repeat."""

MEASURED = frozenset({"pass", "fail", "known-gap", "gap-closed", "known-difference", "no-truth", "not-observed"})


@dataclass(frozen=True)
class StoredCells:
    """Cells that may be judged from a store, newest first, and what there is to report about it."""

    message: str
    cells: Mapping[CellKey, tuple[str, Row]] = field(default_factory=dict)
    rows: Mapping[tuple[str, CellKey], list[Row]] = field(default_factory=dict)

    def find(self, cell: Cell) -> CaseResult | None:
        """The stored result of a planned cell, or None if it has to run."""
        key = (cell.case.id, cell.variant.id, cell.engine_id)
        if key not in self.cells or isinstance(cell.engine, Exception) or not _is_own_engine(cell):
            return None
        run_id, stored = self.cells[key]
        planned = planned_columns(cell)
        same = all(stored[name] == planned.get(name) for name in SAME)
        if not same or stored["engine_version"] != cell.engine.info().version or stored["status"] not in MEASURED:
            return None
        return CaseResult(cell=stored, rows=self.rows[run_id, key])


def _is_own_engine(cell: Cell) -> bool:
    known = (case_table().get(cell.case.id), engine_table_with_stock().get(cell.engine_id))
    return all(entry is not None and entry.origin == BUILTIN for entry in known)


def open_store(store: Path) -> StoredCells:
    """The cells of all finished runs in a store that come from these sources, this environment and this machine."""
    now = provenance()
    cells: dict[CellKey, tuple[str, Row]] = {}
    rows: dict[tuple[str, CellKey], list[Row]] = {}
    used, newest = [], ""
    for run_id in reversed(run_ids(store)):
        try:
            about = read_about(store, run_id)
            differs = _differences(about["provenance"], now)
            if differs:
                newest = newest or f"the newest run, {run_id}, had other {', '.join(differs)}"
                continue
            for row in read_rows(store, about, "cells", CELL_COLUMNS):
                cells.setdefault(cell_key(row), (run_id, row))
            for row in read_rows(store, about, "measurements"):
                rows.setdefault((run_id, cell_key(row)), []).append(row)
        except StoreError as error:
            newest = newest or str(error)
            continue
        used.append(run_id)
    if used:
        return StoredCells(f"{store}: cells of {', '.join(used)} are judged as they are stored", cells, rows)
    return StoredCells(f"{store}: every cell runs ({newest or 'there is no finished run'})")


def _differences(stored: Any, now: Mapping[str, Any]) -> list[str]:
    """Names of the facts that are not what they were."""
    then: Mapping[str, Any] = stored if isinstance(stored, Mapping) else {}
    names = sorted(set(then) | set(now), key=str)
    return [name for name in names if name not in ELSEWHERE and then.get(name) != now.get(name)]
