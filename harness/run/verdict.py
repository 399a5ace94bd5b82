"""From measured errors to statuses, of one check and of a whole cell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ninedisk.harness.api.case import Check
from ninedisk.harness.results.schema import EXCUSED, worst_status
from ninedisk.harness.run.judge import Comparison


def judge(check: Check, comparison: Comparison) -> tuple[str, str]:
    """Status and reason of one check.

    A number that is missing where the truth speaks is a failure even for a check with a known gap: the gap explains a
    difference, not the absence of a value.
    """
    if comparison.spoken == 0:
        return "no-truth", f"the {check.truth} truth says nothing here"
    if comparison.missing:
        return "fail", _missing(comparison)
    inside = comparison.abs_error <= comparison.tolerance
    if check.gap_reason:
        return ("gap-closed" if inside else "known-gap"), check.gap_reason
    return ("pass", "") if inside else ("fail", _beyond(check, comparison))


def _missing(comparison: Comparison) -> str:
    if comparison.spoken == 1:
        return "the engine gives no number (NaN)"
    if comparison.missing == comparison.spoken:
        return "the engine does not observe this quantity: every value is NaN"
    return f"NaN at {comparison.missing} of {comparison.spoken} compared steps, first at step {comparison.worst_step}"


def _beyond(check: Check, comparison: Comparison) -> str:
    text = f"error {comparison.abs_error:.3g} {_unit(comparison)}exceeds the tolerance {comparison.tolerance:.3g}"
    if comparison.first_divergence_step >= 0:
        text += f"; first beyond it at step {comparison.first_divergence_step}, worst at {comparison.worst_step}"
    if check.uncertainty > comparison.tolerance:
        text += f" (the truth itself is uncertain by {check.uncertainty:.3g})"
    return text


def _unit(comparison: Comparison) -> str:
    return f"{comparison.unit} " if comparison.unit and comparison.unit != "-" else ""


def cell_verdict(measurements: Iterable[Mapping[str, Any]]) -> tuple[str, str]:
    """Status and reason of a cell: the worst of its measurements decides (`records.WORST_FIRST`)."""
    rows = list(measurements)
    if not rows:
        return "no-truth", "no truth binds this engine on this variant"
    worst = worst_status(str(row["status"]) for row in rows)
    named = [f"{row['quantity']} ({row['truth']}): {row['reason']}" for row in rows if row["status"] == worst]
    if worst == "pass":
        return worst, ""
    more = f" (and {len(named) - 1} more)" if len(named) > 1 else ""
    return worst, named[0] + more


def exit_code(statuses: Iterable[str]) -> int:
    """Exit code of a run over its cells' and measurements' statuses: 3 crash, 1 failed check, 0 all pass or excused."""
    present = set(statuses)
    if present & {"error", "timeout"}:
        return 3
    return 0 if present <= EXCUSED else 1
