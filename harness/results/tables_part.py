"""Rows of the result tables, from checks and observed quantities."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.case import Check, Observed
from ninedisk.harness.results.schema import MEASUREMENT_COLUMNS
from ninedisk.harness.results.tables import Block, Row, complete
from ninedisk.harness.run.judge import compare, expected_series
from ninedisk.harness.run.verdict import judge

TRUTH_PREFERENCE = ("exact-step", "analytic", "converged", "published", "consensus")
"""Which truth a series shows beside its values: the first of these that speaks about the quantity."""


def measurement_row(common: Mapping[str, Any], check: Check, observed: Observed) -> Row:
    """Compare, judge, and write the row of `records.MEASUREMENT_COLUMNS`."""
    found = compare(check, observed)
    status, reason = judge(check, found)
    return complete(
        {
            **common,
            "quantity": check.quantity,
            "unit": found.unit,
            "norm": check.norm,
            "truth": check.truth,
            "source": check.source,
            "value": found.value,
            "expected": found.expected,
            "uncertainty": check.uncertainty,
            "abs_error": found.abs_error,
            "rel_error": found.rel_error,
            "scale": found.scale,
            "atol": check.atol,
            "rtol": check.rtol,
            "why": check.why,
            "worst_step": found.worst_step,
            "first_divergence_step": found.first_divergence_step,
            "status": status,
            "reason": reason,
        },
        MEASUREMENT_COLUMNS,
    )


def best_truth(quantity: str, checks: Sequence[Check], observed: Observed) -> tuple[NDArray[np.float64], str]:
    """The preferred truth about a series and its kind; NaN and ``""`` where none speaks.

    A truth that is itself known to be off (``gap_reason``) comes after every other.
    """
    candidates = [check for check in checks if check.quantity == quantity and check.norm == "max"]
    for check in sorted(candidates, key=lambda c: (bool(c.gap_reason), TRUTH_PREFERENCE.index(c.truth))):
        expected = expected_series(check, observed)
        if not np.isnan(expected).all():
            return expected, check.truth
    return np.full(observed.step.shape, np.nan), ""


def series_blocks(names: tuple[str, str, str], observed: Observed, checks: Sequence[Check]) -> list[Block]:
    """A block a series quantity; ``names`` are case, variant and engine."""
    case, variant, engine = names
    blocks = []
    for quantity, (unit, value) in observed.series.items():
        expected, truth = best_truth(quantity, checks, observed)
        columns = {
            "case": case,
            "variant": variant,
            "engine": engine,
            "quantity": quantity,
            "unit": unit,
            "step": observed.step,
            "t": observed.t,
            "value": np.asarray(value, dtype=np.float64),
            "expected": expected,
            "truth": truth,
        }
        blocks.append(Block(length=len(observed.step), columns=columns))
    return blocks


def reference_blocks(names: tuple[str, str], observed: Observed, checks: Sequence[Check]) -> list[Block]:
    """Curves of the truths that are arrays, where they speak.

    Consensus truths stay out: they are computed for one engine's conventions and do not belong to the variant.
    """
    case, variant = names
    blocks = []
    for check in checks:
        if check.norm != "max" or check.truth == "consensus" or np.ndim(check.expected) == 0:
            continue
        expected = expected_series(check, observed)
        speaks = ~np.isnan(expected)
        columns = {
            "case": case,
            "variant": variant,
            "label": f"{check.truth}: {check.source}",
            "truth": check.truth,
            "source": check.source,
            "quantity": check.quantity,
            "unit": observed.series[check.quantity][0],
            "step": observed.step[speaks],
            "t": observed.t[speaks],
            "value": expected[speaks],
            "uncertainty": check.uncertainty,
        }
        blocks.append(Block(length=int(speaks.sum()), columns=columns))
    return blocks


def distinct_references(blocks: Sequence[Block]) -> list[Block]:
    """Each curve once: the same truth binds several engines; curves that differ keep both."""
    kept: dict[tuple[Any, ...], Block] = {}
    for block in blocks:
        columns = block.columns
        text = tuple(columns[name] for name in ("case", "variant", "label", "quantity"))
        kept.setdefault((*text, columns["step"].tobytes(), columns["value"].tobytes()), block)
    return list(kept.values())


def plain_json(data: Any) -> str:
    """JSON text of plain data; numbers that JSON does not know become null, NumPy values become Python's."""
    return json.dumps(_plain(data), allow_nan=False)


def _plain(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {str(key): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    if isinstance(data, np.ndarray | np.generic):
        return _plain(data.tolist())
    if isinstance(data, float) and not math.isfinite(data):
        return None
    if data is None or isinstance(data, str | int | float | bool):
        return data
    return str(data)
