"""What the documentation says about every case, taken from the case itself; plain data for the pages."""

from __future__ import annotations

import inspect
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ninedisk.harness.api.case import Case
from ninedisk.harness.api.claims import claims_of
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.params import allowed, format_value
from ninedisk.harness.api.registry import case_table, engine_table, get_case
from ninedisk.harness.api.support import support_of
from ninedisk.harness.results.schema import Row, tolerance
from ninedisk.harness.results.tables import plain_json
from ninedisk.harness.run.judge import largest
from ninedisk.harness.run.plan import Cell, plan_matrix
from ninedisk.harness.run.runner import Progress, dry_checks

OURS = ("dem", "cd")
"""Engines that the example commands use."""


def docs_record(progress: Progress | None = None) -> list[Row]:
    """A record of every case: ``id, version, title, source, requirement, about, parameters, variants, setup, truths,
    claims, commands``.

    ``truths`` are those that bind the engines on the first variant of the matrix, found without running anything.
    """
    found = []
    ids = list(case_table())
    for done, case_id in enumerate(ids):
        if progress is not None:
            progress(done, len(ids), case_id)
        found.append(case_record(get_case(case_id)))
    if progress is not None:
        progress(len(ids), len(ids), "")
    return found


def case_record(case: Case) -> Row:
    """The record of one case."""
    shown = dict(case.matrix()[0])
    cells = plan_matrix([case.id], list(engine_table()), shown)
    setup = cells[0].setup
    if isinstance(setup, Exception):
        raise setup
    stored = {
        "scene": setup.scene.to_dict(),
        "watch": [list(pair) for pair in setup.watch],
        "labels": {name: list(pair) for name, pair in setup.labels.items()},
    }
    return {
        "id": case.id,
        "version": case.version,
        "title": case.title,
        "source": case.source,
        "requirement": case.requirement,
        "about": inspect.cleandoc(type(case).__doc__ or ""),
        "parameters": [
            {
                "name": p.name,
                "default": format_value(p.default),
                "unit": p.unit,
                "allowed": allowed(p),
                "help": p.help,
                "only_for": p.only_for,
            }
            for p in case.parameters
        ],
        "variants": [settings_text(row) for row in case.matrix()],
        "shown": settings_text(shown),
        "setup": json.loads(plain_json(stored)),
        "truths": truths(cells),
        "claims": [{"place": c.place, "text": c.text, "decided_by": c.decided_by} for c in claims_of(case)],
        "commands": commands(case.id, cells, shown),
    }


def settings_text(row: Any) -> str:
    """``name=value`` of a variant's overrides, joined by commas."""
    return ", ".join(f"{name}={format_value(value)}" for name, value in row.items()) or "the defaults"


def truths(cells: Sequence[Cell]) -> list[Row]:
    """Checks that bind the engines of some cells, equal ones joined: quantity, truth, tolerance and its reason, engines."""
    joined: dict[tuple[Any, ...], Row] = {}
    for cell in cells:
        if isinstance(cell.setup, Exception) or isinstance(cell.engine, Exception) or not _able(cell):
            continue
        info = cell.engine.info()
        for check in dry_checks(cell, info):
            if check.truth == "consensus":  # its expected values are a run of ours
                continue
            allowed_error = tolerance(check.atol, check.rtol, largest(np.asarray(check.expected, dtype=np.float64)))
            key = (
                check.quantity,
                check.norm,
                check.truth,
                check.source,
                f"{allowed_error:.3g}",
                check.why,
                check.gap_reason,
            )
            row = joined.setdefault(
                key,
                {
                    "quantity": check.quantity,
                    "norm": check.norm,
                    "truth": check.truth,
                    "source": check.source,
                    "tolerance": allowed_error,
                    "why": check.why,
                    "gap_reason": check.gap_reason,
                    "engines": [],
                },
            )
            row["engines"].append(cell.engine_id)
    return list(joined.values())


def commands(case_id: str, cells: Sequence[Cell], shown: Any) -> list[str]:
    """Example commands of a case; each of them runs unchanged, within seconds, on an engine that every machine has."""
    ours = next((cell.engine_id for cell in cells if cell.engine_id in OURS and _able(cell)), OURS[0])
    chosen = " ".join(f"--set {name}={format_value(value)}" for name, value in shown.items())
    return [
        f"ninedisk list cases {case_id}",
        f"ninedisk run {case_id} --engine {ours} {chosen}".rstrip(),
        f"ninedisk run {case_id} --engine {ours} --engine pymunk {chosen} --allow-unsupported --json rows.json",
    ]


def _able(cell: Cell) -> bool:
    """Whether the cell's engine can express its scene, installed or not."""
    if isinstance(cell.setup, Exception) or isinstance(cell.engine, Exception):
        return False
    return support_of(cell.engine, cell.setup.scene, cell.setup.numerics).level is not SupportLevel.NO
