"""Observed order of convergence from a step that is halved again and again: the rule, on plain numbers.

Level ``k`` has the step ``h/2^k``. Errors against a truth fall like ``h^p``; so do the differences of neighbouring levels,
which need no truth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

STEADY = 0.3
"""Levels are asymptotic where all orders between neighbours lie this close to their median: less than half of the half
order that separates kinks (1/2, 3/2) from smooth schemes (1, 2)."""

MARGIN = 0.25
"""An observed order may miss the expected one by this much, or by its own uncertainty: half the way to the next half order."""

LEVELLED = 4.0
"""Errors that are this many times the last difference have levelled off: ``1/(2^p - 1)``, p = 0.32, below any scheme's order."""

FEWEST = 3
"""Levels that an order needs: two orders between neighbours, so that they can disagree."""

GOOD = ("undecided", "not judged", "converges", "step-independent", "exact")
BAD = ("wrong order", "wrong limit")
VERDICTS = (*BAD, *GOOD)
"""Worst first; those of `BAD` fail."""

RULES = (
    "The step is halved each time and everything else stays; values are compared at the times that all levels have.",
    "Error: against a truth of the continuous problem (analytic, converged) that is the same at every step; where there is "
    "none, or where the errors have levelled off above "
    f"{LEVELLED:g} times the last difference (the limit is another than the truth's), the differences of neighbouring levels.",
    "Round-off: values below 1e-10 (single precision: 1e-5) of the scene's own size in that unit, below what one unit in the "
    "last place of a coordinate makes of forces and velocities through the stiffness, or below the truth's own uncertainty, "
    "and all finer levels, do not count. The differences of a single number (a peak, a count) may cancel, or jump where "
    "another sample becomes the peak: their order is shown, not judged.",
    f"Pre-asymptotic: coarse levels are left out until all orders between neighbours lie within {STEADY:g} of their median; "
    f"at least {FEWEST} levels must remain, else all count and the order is irregular.",
    "Order: slope of log error over log step by least squares. Uncertainty: half the range of the orders between neighbours, "
    "and at least what the last of them still has to go: the next term of the expansion halves with the step, so that it "
    "will move once more by what it moved last.",
    f"Wrong order: the expected one lies above the observed one by more than its uncertainty and more than {MARGIN:g}. "
    "A higher order is no fault. Wrong limit: the limit misses the truth by more than the check's tolerance.",
)
"""The rule in words, for the page and the record."""


@dataclass(frozen=True, kw_only=True)
class Order:
    """Observed order of one quantity.

    ``by`` is ``"error"`` or ``"difference"``, ``used`` the levels that counted, ``regular`` whether they are asymptotic;
    ``order`` and ``uncertainty`` are NaN where there are too few.
    """

    verdict: str
    order: float
    uncertainty: float
    by: str
    used: tuple[int, ...]
    regular: bool
    reason: str


def judge_order(
    errors: Sequence[float] | None,
    differences: Sequence[float],
    *,
    floor: float,
    expected: float | None,
    tolerance: float = math.inf,
    number: bool = False,
) -> Order:
    """Order of a quantity and its verdict.

    Parameters
    ----------
    errors : sequence of float or None
        Against a truth, by level, coarsest first; None where there is no truth.
    differences : sequence of float
        Between level k and k + 1, in the quantity's unit; one less than there are levels.
    floor : float
        Values at most this large are round-off, > 0.
    expected : float or None
        Order that the scheme declares.
    tolerance : float
        What the truth's check allows at the finest level.
    number : bool
        A single number; its differences may cancel or jump, and their order is shown only.
    """
    values = [*(errors or ()), *differences]
    if not all(math.isfinite(value) for value in values):
        return _none("undecided", "", "some levels give no number")
    if max(differences) <= floor:
        if errors is not None and errors[-1] > max(tolerance, floor):
            return _none("wrong limit", "error", _misses(errors[-1], tolerance) + "; the step changes nothing")
        if errors is not None and errors[-1] > floor:
            return _none("step-independent", "error", f"{errors[-1]:.2g} from the truth (allowed: {tolerance:.2g})")
        return _none("exact", "error" if errors is not None else "difference", "the step changes nothing but round-off")
    note, by, series = "", "difference", list(differences)
    if errors is not None:
        if errors[-1] > LEVELLED * differences[-1] and errors[-1] > floor:
            if errors[-1] > tolerance:
                return _none("wrong limit", "difference", _misses(errors[-1], tolerance))
            note = f"levels off {errors[-1]:.2g} from the truth (allowed: {tolerance:.2g})"
        else:
            by, series = "error", list(errors)
    above = next((k for k, value in enumerate(series) if value <= floor), len(series))
    if above < 2:
        return _none("exact", by, _joined(note, "round-off from the first halving on"))
    found = _fitted(series[:above], by)
    reason = _joined(note, _left_out(found, len(series), above))
    return _judged(found, expected, reason, shown_only=number and by == "difference")


def _joined(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


def _none(verdict: str, by: str, reason: str) -> Order:
    return Order(verdict=verdict, order=math.nan, uncertainty=math.nan, by=by, used=(), regular=False, reason=reason)


def _misses(error: float, tolerance: float) -> str:
    return f"the limit misses the truth by {error:.2g}, allowed are {tolerance:.2g}"


def _fitted(series: Sequence[float], by: str) -> Order:
    """Order over the asymptotic levels, or over all where there is no such range."""
    logs = np.log2(np.asarray(series))
    local = -np.diff(logs)
    regular, first = False, 0
    for start in range(len(series) - FEWEST + 1):
        tail = local[start:]
        if np.abs(tail - np.median(tail)).max() <= STEADY:
            regular, first = True, start
            break
    levels = np.arange(first, len(series))
    slope = -float(np.polyfit(levels, logs[first:], 1)[0])
    spread = math.nan
    if len(levels) >= FEWEST:
        to_go = abs(float(local[-1]) - slope) + abs(float(local[-1] - local[-2]))
        spread = max(0.5 * float(np.ptp(local[first:])), to_go)
    return Order(
        verdict="", order=slope, uncertainty=spread, by=by, used=tuple(map(int, levels)), regular=regular, reason=""
    )


def _left_out(found: Order, count: int, above: int) -> str:
    parts = [f"first {found.used[0]} left out as pre-asymptotic"] if found.used[0] else []
    parts += [f"last {count - above} left out as round-off"] if above < count else []
    return _joined(*parts)


def _judged(found: Order, expected: float | None, reason: str, *, shown_only: bool) -> Order:
    verdict = "converges"
    if expected is None or shown_only:
        verdict = "not judged"
    elif math.isnan(found.uncertainty):
        verdict, reason = "undecided", _joined(reason, "too few levels above round-off")
    elif found.order + max(found.uncertainty, MARGIN) < expected:
        verdict = "wrong order"
    elif not found.regular:
        verdict, reason = "undecided", _joined(reason, "irregular: no asymptotic range")
    return replace(found, verdict=verdict, reason=reason)
