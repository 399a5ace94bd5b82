"""When an error got worse: a check before and after."""

from __future__ import annotations

import math

from ninedisk.harness.api.text import found_and_expected, short_number
from ninedisk.harness.results.schema import Row, row_tolerance

QUIET = 0.1
"""Fraction of its tolerance below which an error may move freely."""

GROWTH = 2.0
"""Factor by which an error above `QUIET` must grow (or shrink) to count."""

SAME_TOLERANCE = 0.01
"""Relative difference up to which two tolerances count as one: those of other processors' round-off lie as close."""

ERROR_RULE = (
    f"An error got worse when its check now fails and did not before, or when it is more than {GROWTH:g} times as large "
    f"and above {QUIET:.0%} of its tolerance. Below that it may move: round-off adds up like the square root of the number "
    f"of operations, the tolerance allows for all of them in one direction, and a hundred operations make that a tenth. "
    f"Twice the error is what a scheme of first order shows when its step is doubled. A headline has no tolerance: its error "
    f"got worse when it is more than {GROWTH:g} times as large and above 1e-7 of its scale."
)


def error_of(row: Row) -> float:
    """``abs_error``; infinite for a failure without a number, NaN where no truth speaks."""
    error = float(row["abs_error"])
    return math.inf if math.isnan(error) and row["status"] == "fail" else error


def has_grown(before: float, after: float, allowed: float, factor: float = GROWTH) -> bool:
    """Whether an error grew by more than ``factor`` and lies beyond round-off's share of the tolerance ``allowed``."""
    return after > QUIET * allowed and after > factor * before


def judge_errors(base: Row, head: Row) -> tuple[str, str]:
    """Verdict (one of `schema.CHANGE_VERDICTS`) and reason for a check before and after."""
    before, after = error_of(base), error_of(head)
    allowed_before, allowed = row_tolerance(base), row_tolerance(head)
    moved = abs(allowed - allowed_before) > SAME_TOLERANCE * max(allowed, allowed_before)
    note = f"; its tolerance changed from {short_number(allowed_before)} to {short_number(allowed)}" if moved else ""
    failed, fails = base["status"] == "fail", head["status"] == "fail"
    if fails and not failed:
        return "worse", f"now outside its tolerance{_numbers(head)}{note}"
    if failed and not fails:
        if moved and after >= before:
            return "suspect", f"passes only because of its tolerance{note}"
        return "better", f"inside its tolerance again{note}"
    if math.isnan(before) or math.isnan(after):
        return "same", "no truth speaks about it"
    if has_grown(before, after, allowed):
        inside = f", {'outside' if fails else 'still inside'} its tolerance" if head["status"] else ""
        return "worse", f"{_times(before, after)} the error{inside}{_numbers(head)}{note}"
    if has_grown(after, before, allowed_before):
        return "better", f"a fraction {short_number(after / before)} of the error{note}"
    if head["status"] == "gap-closed" and base["status"] == "known-gap":
        return "better", "a known gap has closed"
    if moved and allowed > allowed_before:
        return "suspect", f"the error holds still{note}"
    return "same", ""


def _numbers(head: Row) -> str:
    """What was found and what was expected, where the row has both."""
    value, expected = (float(head.get(name, math.nan)) for name in ("value", "expected"))
    if math.isnan(value) or math.isnan(expected):
        return ""
    found, wanted = found_and_expected(value, expected)
    return f", found {found}, expected {wanted}"


def _times(before: float, after: float) -> str:
    return f"{short_number(after / before)} times" if before > 0.0 else "it was exact; now"
