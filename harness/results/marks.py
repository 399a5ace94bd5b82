"""Lasting changes of a line over many runs: of errors, of cells that break, of timings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ninedisk.harness.api.text import short_number
from ninedisk.harness.results.change_points import FEWEST, LONGEST, ChangePoint, FloatArray, find_change
from ninedisk.harness.results.error_rules import GROWTH, QUIET, has_grown
from ninedisk.harness.results.schema import GATED_SECONDS, Point, Shift
from ninedisk.harness.results.timing_rules import FALSE_ALARMS, LEAST

RESTLESS = 6.0
"""A line that moves from run to run must beat its own usual step this many times over, in logarithms."""

NEAR = 5
"""Runs on either side of a place that distinguish a jump from a drift."""

CLEARLY = 0.999
"""Share of the least error before that one must fall below to be back inside: an equal one, whose last digits moved, is not."""

SHIFT_RULE = (
    f"Errors: a point is marked where the rule above holds against every earlier run since the last mark, so a single run "
    f"is enough: the same code gives the same digits. Where a line moves from run to run, its usual step (the median, in "
    f"logarithms, {RESTLESS:g} times over) is asked for on top. Timings: a point is marked where an exact rank-sum scan "
    f"over all places of its line finds two levels at least {math.expm1(LEAST):.0%} apart, both above {GATED_SECONDS * 1e3:g} ms. "
    f"Its threshold is derived, not tuned: the chance of the best place, times the number of places, times the number of "
    f"timings (Bonferroni), must be below {FALSE_ALARMS:.0%}. So at most one dashboard in a hundred marks a timing by "
    f"chance, whatever the distribution of the noise, as long as the order of the runs means nothing; what all timings of "
    f"a run share is divided out before. That share has its own line; machines drift, so there a mark must be a jump: "
    f"{RESTLESS:g} times the usual step from run to run. The price: a slowdown shows after about six runs if it stands clear of the noise, "
    f"after about ten if it is 30% under noise of 10%. Runs of another machine or another case version are another line."
)


def error_shifts(points: Sequence[Point]) -> tuple[Shift, ...]:
    """Marks of a line of errors; a mark begins a new level, against which the later points are held."""
    found: list[Shift] = []
    level: list[Point] = []
    step = _usual_step(points)
    for at, point in enumerate(points):
        if math.isnan(point.value):
            continue
        judged = _judge(level, point, step) if level else None
        if judged is not None:
            before = float(np.median([each.value for each in level]))
            found.append(
                Shift(at=at, first=at, last=at, verdict=judged[0], before=before, after=point.value, chance=math.nan, reason=judged[1],
                      open=False)
            )  # fmt: skip
            level = []
        level.append(point)
    return with_open(found)


def _judge(level: Sequence[Point], point: Point, step: float) -> tuple[str, str] | None:
    """Verdict and reason if a point leaves the level of the points before it."""
    errors = [each.value for each in level]
    most, least = max(errors), min(errors)
    fails, failed = point.status == "fail", [each.status == "fail" for each in level]
    if fails and not any(failed):
        return "worse", "outside its tolerance since then"
    if has_grown(most, point.value, point.tolerance, GROWTH * step):
        return (
            "worse",
            f"{short_number(point.value / most)} times the error" if most > 0.0 else "an error where there was none",
        )
    # A line that flickers around its tolerance is not back inside: it must get there by more than its usual step.
    if not fails and all(failed) and point.value * step ** (1.0 / RESTLESS) < CLEARLY * least:
        return "better", "inside its tolerance since then"
    if has_grown(point.value, least, level[-1].tolerance, GROWTH * step):
        return "better", f"a fraction {short_number(point.value / least)} of the error"
    return None


def _usual_step(points: Sequence[Point]) -> float:
    """Factor that the line's own restlessness asks for: 1 for one that repeats its digits.

    Steps between two values that are both below round-off's share of the tolerance say nothing and are left out.
    """
    held = [point for point in points if math.isfinite(point.value) and point.value > 0.0]
    steps = [
        abs(math.log(two.value / one.value))
        for one, two in pairwise(held)
        if max(one.value, two.value) > QUIET * max(one.tolerance, two.tolerance)
    ]
    return math.exp(min(RESTLESS * float(np.median(steps)), 700.0)) if len(steps) >= FEWEST else 1.0


def cell_shifts(points: Sequence[Point], broken: frozenset[str]) -> tuple[Shift, ...]:
    """Marks where a cell begins to break, and where it runs again."""
    found = []
    for at in range(1, len(points)):
        was, now = (points[k].status in broken for k in (at - 1, at))
        if was != now:
            reason = f"{points[at].status}: {points[at].reason}" if now else "runs again"
            found.append(
                Shift(at=at, first=at, last=at, verdict="worse" if now else "better", before=math.nan, after=math.nan, chance=math.nan,
                      reason=reason, open=False)
            )  # fmt: skip
    last = len(found) - 1
    return tuple(replace(s, open=k == last and s.verdict == "worse") for k, s in enumerate(found))


def timing_shifts(logs: FloatArray, lines: int, *, drifts: bool = False) -> tuple[Shift, ...]:
    """Marks of a line of timings.

    Parameters
    ----------
    logs : ndarray, shape (n,)
        Logarithms of the seconds, what all timings of a run share already taken out.
    lines : int
        Number of timings that are searched beside this one.
    drifts : bool
        Whether the line may wander, so that only a jump is a mark.
    """
    begin = max(0, len(logs) - LONGEST)
    cuts = _change_cuts(logs[begin:], begin, lines, drifts)
    edges = [begin, *(cut.at for cut in cuts), len(logs)]
    levels = [float(np.median(logs[a:b])) for a, b in pairwise(edges)]
    found = []
    for cut, (before, after) in zip(cuts, pairwise(levels), strict=True):
        word, verdict = ("slow", "worse") if after > before else ("fast", "better")
        found.append(
            Shift(at=cut.at, first=cut.first, last=cut.last, verdict=verdict, before=math.exp(before),
                  after=math.exp(after), chance=cut.chance,
                  reason=f"{math.exp(abs(after - before)):.2f} times as {word}", open=False)
        )  # fmt: skip
    return with_open(found)


def _change_cuts(logs: FloatArray, offset: int, lines: int, drifts: bool) -> list[ChangePoint]:
    """The most striking change, then what is left on either side of it, in the order of the runs."""
    best = find_change(logs)
    if best is None or best.chance * lines >= FALSE_ALARMS:
        return []
    at = best.at
    before, after = float(np.median(logs[:at])), float(np.median(logs[at:]))
    if abs(after - before) < LEAST or (not drifts and math.exp(min(after, before)) < GATED_SECONDS):
        return []
    if drifts and not _medians_jump(logs, at):
        return []
    here = ChangePoint(offset + at, offset + best.first, offset + best.last, best.chance * lines)
    parts = (_change_cuts(logs[:at], offset, lines, drifts), _change_cuts(logs[at:], offset + at, lines, drifts))
    return [*parts[0], here, *parts[1]]


def _medians_jump(logs: FloatArray, at: int) -> bool:
    """Whether the medians of the `NEAR` runs on either side lie farther apart than a wandering line takes them."""
    steps = np.abs(np.diff(logs))
    apart = abs(float(np.median(logs[at : at + NEAR])) - float(np.median(logs[max(0, at - NEAR) : at])))
    return apart > max(2.0 * LEAST, RESTLESS * float(np.median(steps)))


def with_open(shifts: Sequence[Shift]) -> tuple[Shift, ...]:
    """Find which marks for the worse still stand: those that no later mark brought back to where they had begun."""
    standing: list[int] = []
    for number, shift in enumerate(shifts):
        if shift.verdict == "worse":
            standing.append(number)
        else:
            standing = [k for k in standing if shift.after > math.exp(LEAST) * shifts[k].before]
    return tuple(replace(shift, open=number in standing) for number, shift in enumerate(shifts))
