"""Which checks a cell will have, found without running its engine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from ninedisk.harness.api.case import Check
from ninedisk.harness.api.engine import EngineInfo
from ninedisk.harness.run.observation import blank_history
from ninedisk.harness.run.plan import Cell
from ninedisk.harness.run.runner import all_checks


def check_ids(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """``quantity-truth`` ids in order, numbered where the same pair comes again."""
    seen: Counter[str] = Counter()
    ids = []
    for quantity, truth in pairs:
        name = f"{quantity}-{truth}"
        seen[name] += 1
        ids.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return ids


def dry_checks(cell: Cell, info: EngineInfo, published: Path | None = None) -> list[Check]:
    """The checks of a cell over a history without numbers: quantities and truths are right, values are NaN.

    Which truths bind a cell follows from its parameters, its set-up and the engine's facts, never from the numbers that
    the engine computes; so the case's own ``observe`` and ``checks`` tell them from a blank history.
    """
    if isinstance(cell.setup, Exception):
        raise cell.setup
    observed = cell.case.observe(cell.variant.params, cell.setup, blank_history(cell.setup))
    return all_checks(cell, cell.setup, observed, info, published)
