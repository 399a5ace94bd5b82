"""Columns of `records.CELL_COLUMNS`, as they become known while a cell runs, and results of cells that did not run to their end."""

from __future__ import annotations

import json
from contextlib import suppress

from ninedisk.harness.api.case import Setup
from ninedisk.harness.api.engine import EngineInfo, Support
from ninedisk.harness.results.schema import CELL_COLUMNS, MEASUREMENT_COLUMNS
from ninedisk.harness.results.tables import CaseResult, Row, complete
from ninedisk.harness.results.tables_part import plain_json
from ninedisk.harness.run.plan import Cell


def broken_cell(cell: Cell, reason: str) -> CaseResult:
    """Result of a cell whose process did not live to tell it: status error."""
    head = planned_columns(cell)
    if not isinstance(cell.engine, Exception):
        with suppress(Exception):  # facts that cannot be had are no reason to lose the cell
            head |= engine_columns(cell.engine.info())
    return without_measurements(cell, head, "error", reason)


def without_measurements(cell: Cell, head: Row, status: str, reason: str) -> CaseResult:
    """Result of a cell that was not run to its end, with one row that says so."""
    verdict = {"status": status, "reason": reason}
    common = {name: head[name] for name in head if name in MEASUREMENT_COLUMNS}
    return CaseResult(
        cell=complete(head | verdict, CELL_COLUMNS),
        rows=[complete(common | verdict, MEASUREMENT_COLUMNS)],
        setup=None if isinstance(cell.setup, Exception) else cell.setup,
    )


def planned_columns(cell: Cell) -> Row:
    """What a stored cell holds of its plan, known before it runs."""
    case = cell.case
    return {
        "case": case.id,
        "case_version": case.version,
        "case_title": case.title,
        "case_source": case.source,
        "case_requirement": case.requirement,
        "variant": cell.variant.id,
        "params": plain_json(dict(cell.variant.params)),
        "engine": cell.engine_id,
        **({} if isinstance(cell.setup, Exception) else _setup_columns(cell.setup)),
    }


def _setup_columns(setup: Setup) -> Row:
    stored = {
        "scene": setup.scene.to_dict(),
        "numerics": setup.numerics.to_dict(),
        "watch": [list(pair) for pair in setup.watch],
        "labels": {name: list(pair) for name, pair in setup.labels.items()},
    }
    return {"n_steps": setup.numerics.n_steps, "n_disks": len(setup.scene.disks), "setup": plain_json(stored)}


def engine_columns(info: EngineInfo) -> Row:
    """Columns of the facts about an engine."""
    return {
        "engine_name": info.name,
        "engine_version": info.version or "",
        "engine_licence": info.licence,
        "engine_runs": info.how_it_runs,
    }


def support_columns(support: Support) -> Row:
    """Columns of how faithfully the engine expresses the scene."""
    return {
        "support": str(support.level),
        "missing": json.dumps([str(capability) for capability in support.missing]),
        "notes": json.dumps(list(support.notes)),
    }
