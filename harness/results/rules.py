"""When a number got worse: the rules for errors and for timings, rank tests, and lasting changes of a line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.api.text import short
from ninedisk.harness.results.schema import Point, Row, Shift, row_tolerance

QUIET = 0.1
"""Fraction of its tolerance below which an error may move freely."""

GROWTH = 2.0
"""Factor by which an error above `QUIET` must grow (or shrink) to count."""

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


def grew(before: float, after: float, allowed: float, factor: float = GROWTH) -> bool:
    """Whether an error grew by more than ``factor`` and lies beyond round-off's share of the tolerance ``allowed``."""
    return after > QUIET * allowed and after > factor * before


def judge_errors(base: Row, head: Row) -> tuple[str, str]:
    """Verdict (one of `schema.CHANGE_VERDICTS`) and reason for a check before and after."""
    before, after = error_of(base), error_of(head)
    allowed_before, allowed = row_tolerance(base), row_tolerance(head)
    moved = abs(allowed - allowed_before) > 0.01 * max(allowed, allowed_before)
    note = f"; its tolerance changed from {short(allowed_before)} to {short(allowed)}" if moved else ""
    failed, fails = base["status"] == "fail", head["status"] == "fail"
    if fails and not failed:
        return "worse", f"now outside its tolerance{note}"
    if failed and not fails:
        if moved and after >= before:
            return "suspect", f"passes only because of its tolerance{note}"
        return "better", f"inside its tolerance again{note}"
    if math.isnan(before) or math.isnan(after):
        return "same", "no truth speaks about it"
    if grew(before, after, allowed):
        inside = f", {'outside' if fails else 'still inside'} its tolerance" if head["status"] else ""
        return "worse", f"{_times(before, after)} the error{inside}{note}"
    if grew(after, before, allowed_before):
        return "better", f"a fraction {short(after / before)} of the error{note}"
    if head["status"] == "gap-closed" and base["status"] == "known-gap":
        return "better", "a known gap has closed"
    if moved and allowed > allowed_before:
        return "suspect", f"the error holds still{note}"
    return "same", ""


def _times(before: float, after: float) -> str:
    return f"{short(after / before)} times" if before > 0.0 else "it was exact; now"


FloatArray = NDArray[np.float64]
Samples = tuple[Sequence[float], Sequence[float]]
"""Seconds of one timing in the runs of BASE and of HEAD."""

FALSE_ALARMS = 0.01
"""Accepted probability of one false alarm in a whole comparison."""

LEAST = math.log(1.10)
"""Smallest change that is worth a word: ten per cent."""

LEAST_SECONDS = 5e-5
"""Smaller differences are within what the operating system takes for one interruption."""

MANY = 8
"""Timings from which on the spread between them says how noisy the runs are, and what they share can be seen."""

PLENTY = 7
"""Runs a side from which on a median is safe: four outliers of seven are 6 in a million where 2% of timings are such."""

WIDE = 10.0
"""With fewer runs a change must exceed this many standard deviations: under noise of 10% a timing that other work doubled
lies five away by that alone, and its own noise can take it four further."""

ASSUMED_NOISE = 0.10
"""Relative noise of one timing where too few timings were taken to measure it."""

TIMING_RULE = (
    f"Timings are compared on one machine only. What all timings of a run have in common is divided out first. One got "
    f"worse when it is at least {math.expm1(LEAST):.0%} and {LEAST_SECONDS * 1e6:g} us slower and beyond the noise, which is "
    f"read off the timings themselves. With {PLENTY} runs a side or more: when the order of its runs (exact rank-sum test) "
    f"or the distance of its medians, measured by the spread of all timings, leaves a chance below {FALSE_ALARMS:.0%} of "
    f"one false alarm in the whole comparison (Bonferroni). With fewer runs: when it moved by more than {WIDE:g} standard "
    f"deviations of all timings and 1.5 times as far as the largest speed-up beside it, because a single outlier looks "
    f"like a slowdown: three runs a side are safe from that, one on a quiet machine is not. What is slower but not by "
    f"that much is suspect: repeat the runs and compare ranges (latest~13..latest~7 latest~6..latest)."
)


@dataclass(frozen=True)
class TimingVerdict:
    """``base`` and ``head`` are medians [s], ``head`` with the common factor taken out."""

    verdict: str
    base: float
    head: float
    reason: str


def judge_timings(samples: Mapping[Any, Samples]) -> tuple[dict[Any, TimingVerdict], float]:
    """Judge every timing that both sides have; also the factor by which all of them moved together (1 if too few).

    The common factor is the median of the single ones, so that a change of fewer than half of the timings stays visible.
    """
    held = {key: _logs(pair) for key, pair in samples.items()}
    if not held:
        return {}, 1.0
    moves = {key: float(np.median(head) - np.median(base)) for key, (base, head) in held.items()}
    all_moves = np.array(list(moves.values()))
    many = len(moves) >= MANY
    common = float(np.median(all_moves)) if many else 0.0
    spread = 1.4826 * float(np.median(np.abs(all_moves - common))) if many else 0.0
    fastest = max(0.0, float((common - all_moves).max()))
    level = NormalDist().inv_cdf(1.0 - FALSE_ALARMS / (4 * len(moves)))  # two directions, two tests
    found = {}
    for key, (base, head) in held.items():
        counts = min(len(base), len(head))
        noise = spread if many else _median_noise(len(base), len(head), ASSUMED_NOISE)
        few = max(WIDE * noise, 1.5 * fastest)
        limit = level * max(noise, _own_noise(base, head)) if counts >= PLENTY else few
        found[key] = _verdict(base, head - common, max(limit, LEAST), level * noise, len(moves), alone=not many)
    return found, math.exp(common)


def _verdict(base: FloatArray, head: FloatArray, limit: float, near: float, many: int, *, alone: bool) -> TimingVerdict:
    before, after = float(np.median(base)), float(np.median(head))
    move, seconds = after - before, (math.exp(before), math.exp(after))
    size = f"{math.exp(abs(move)):.2f} times as {'slow' if move > 0 else 'fast'}"
    if abs(move) < LEAST or abs(seconds[1] - seconds[0]) < LEAST_SECONDS:
        return TimingVerdict("same", *seconds, "")
    ranked = chance_of_order(base, head) * many < FALSE_ALARMS / 2
    # Two single runs with hardly a timing beside this one: nothing tells noise from change.
    known = not (alone and min(len(base), len(head)) < 3)
    if (abs(move) > limit and known) or ranked:
        return TimingVerdict("worse" if move > 0 else "better", *seconds, size)
    if move > max(LEAST, near):
        return TimingVerdict("suspect", *seconds, f"{size}, not beyond doubt with {len(base)} and {len(head)} run(s)")
    return TimingVerdict("same", *seconds, "")


def _logs(pair: Samples) -> tuple[FloatArray, FloatArray]:
    base, head = (np.log(np.asarray(side, dtype=np.float64)) for side in pair)
    return base, head


def _own_noise(base: FloatArray, head: FloatArray) -> float:
    """Standard deviation of the difference of the medians, from the timing's own runs; 0 if they are too few."""
    if len(base) + len(head) < MANY:
        return 0.0
    apart = np.concatenate([base - np.median(base), head - np.median(head)])
    return _median_noise(len(base), len(head), 1.4826 * float(np.median(np.abs(apart))))


def _median_noise(m: int, n: int, single: float) -> float:
    """Standard deviation of the difference of two medians of ``m`` and ``n`` values with deviation ``single`` each.

    A median of three or more varies sqrt(pi/2) times as much as a mean.
    """
    mean = single * math.sqrt(1.0 / m + 1.0 / n)
    return mean * (math.sqrt(math.pi / 2.0) if min(m, n) >= 3 else 1.0)


LONGEST = 120
"""Most values that are ranked together: an exact test takes ever longer, and older runs say ever less."""

FEWEST = 3
"""Fewest values on each side of a change point."""


LIKELY = 0.05
"""Likelihood, compared with the best place, down to which another place is still named."""


def chance_of_order(one: FloatArray, two: FloatArray) -> float:
    """Two-sided probability of ranks at least as separated as those of two samples, if nothing tells them apart.

    Exact also among ties: half a point of a tie counts against a discovery.
    """
    from scipy.stats import mannwhitneyu

    if len(one) + len(two) > LONGEST:
        one, two = one[-LONGEST // 2 :], two[-LONGEST // 2 :]
    return float(mannwhitneyu(one, two, method="exact").pvalue)


@dataclass(frozen=True)
class ChangePoint:
    """A change before value number ``at``; in all likelihood before one of the numbers ``first .. last``."""

    at: int
    first: int
    last: int
    chance: float


def find_change(values: FloatArray) -> ChangePoint | None:
    """The most striking change point of at most `LONGEST` values.

    The chance is the exact one of the split whose ranks lie farthest apart in standard deviations, multiplied by the
    number of splits (Bonferroni), at most 1: a bound on the probability of anything as striking if the order of the
    values means nothing. The place is that of the least squares about two means, values beyond three deviations pulled
    in; others belong to ``first .. last`` if their likelihood under normal noise is at least `LIKELY` of its.

    Returns
    -------
    ChangePoint or None
        None if there are too few values, or all are equal.
    """
    from scipy.stats import rankdata

    n = len(values)
    splits = np.arange(FEWEST, n - FEWEST + 1)
    if len(splits) < 1 or np.ptp(values) == 0.0:
        return None
    ranks = rankdata(values)
    excess = np.cumsum(ranks)[splits - 1] - splits * (n + 1) / 2  # sum of the first ranks less its mean
    farthest = splits[int(np.argmax(np.abs(excess) / np.sqrt(splits * (n - splits))))]
    chance = chance_of_order(values[:farthest], values[farthest:])
    best = splits[int(np.argmin(_costs(values, splits)))]
    apart = np.concatenate([values[:best] - np.median(values[:best]), values[best:] - np.median(values[best:])])
    noise = 1.4826 * float(np.median(np.abs(apart)))
    costs = _costs(np.clip(values, *_bounds(values, best, 3.0 * noise)), splits)
    place = int(np.argmin(costs))
    near = splits[costs - costs[place] <= 2.0 * noise**2 * math.log(1.0 / LIKELY)]
    return ChangePoint(int(splits[place]), int(near[0]), int(near[-1]), min(1.0, chance * len(splits)))


def _bounds(values: FloatArray, split: int, reach: float) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest value that counts in full, each about the median of its side."""
    middle = np.repeat([np.median(values[:split]), np.median(values[split:])], [split, len(values) - split])
    return middle - reach, middle + reach


def _costs(values: FloatArray, splits: NDArray[np.int64]) -> FloatArray:
    """Sum of squares about the two means, for each split."""
    return np.array([_squares(values[:k]) + _squares(values[k:]) for k in splits])


def _squares(values: FloatArray) -> float:
    return float(((values - values.mean()) ** 2).sum())


RESTLESS = 6.0
"""A line that moves from run to run must beat its own usual step this many times over, in logarithms."""

NEAR = 5
"""Runs on either side of a place that tell a jump from a drift."""

SHIFT_RULE = (
    f"Errors: a point is marked where the rule above holds against every earlier run since the last mark, so a single run "
    f"is enough: the same code gives the same digits. Where a line moves from run to run, its usual step (the median, in "
    f"logarithms, {RESTLESS:g} times over) is asked for on top. Timings: a point is marked where an exact rank-sum scan "
    f"over all places of its line finds two levels at least {math.expm1(LEAST):.0%} and {LEAST_SECONDS * 1e6:g} us apart. "
    f"Its threshold is derived, not tuned: the chance of the best place, times the number of places, times the number of "
    f"timings (Bonferroni), must be below {FALSE_ALARMS:.0%}. So at most one dashboard in a hundred marks a timing by "
    f"chance, whatever the distribution of the noise, as long as the order of the runs means nothing; what all timings of "
    f"a run share is divided out before. That share has a line of its own; machines drift, so there a mark must be a jump: "
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
    if grew(most, point.value, point.tolerance, GROWTH * step):
        return (
            "worse",
            f"{short(point.value / most)} times the error" if most > 0.0 else "an error where there was none",
        )
    # A line that flickers around its tolerance is not back inside: it must get there by more than its usual step.
    if not fails and all(failed) and point.value * step ** (1.0 / RESTLESS) < 0.999 * least:
        return "better", "inside its tolerance since then"
    if grew(point.value, least, level[-1].tolerance, GROWTH * step):
        return "better", f"a fraction {short(point.value / least)} of the error"
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
    cuts = _cuts(logs[begin:], begin, lines, drifts)
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


def _cuts(logs: FloatArray, offset: int, lines: int, drifts: bool) -> list[ChangePoint]:
    """The most striking change, then what is left on either side of it, in the order of the runs."""
    best = find_change(logs)
    if best is None or best.chance * lines >= FALSE_ALARMS:
        return []
    at = best.at
    before, after = float(np.median(logs[:at])), float(np.median(logs[at:]))
    if abs(after - before) < LEAST or abs(math.exp(after) - math.exp(before)) < LEAST_SECONDS:
        return []
    if drifts and not _jumps(logs, at):
        return []
    here = ChangePoint(offset + at, offset + best.first, offset + best.last, best.chance * lines)
    parts = (_cuts(logs[:at], offset, lines, drifts), _cuts(logs[at:], offset + at, lines, drifts))
    return [*parts[0], here, *parts[1]]


def _jumps(logs: FloatArray, at: int) -> bool:
    """Whether the medians of the `NEAR` runs on either side lie farther apart than a wandering line takes them."""
    steps = np.abs(np.diff(logs))
    apart = abs(float(np.median(logs[at : at + NEAR])) - float(np.median(logs[max(0, at - NEAR) : at])))
    return apart > max(2.0 * LEAST, RESTLESS * float(np.median(steps)))


def with_open(shifts: Sequence[Shift]) -> tuple[Shift, ...]:
    """Tell which marks for the worse still stand: those that no later mark brought back to where they had begun."""
    standing: list[int] = []
    for number, shift in enumerate(shifts):
        if shift.verdict == "worse":
            standing.append(number)
        else:
            standing = [k for k in standing if shift.after > math.exp(LEAST) * shifts[k].before]
    return tuple(replace(shift, open=number in standing) for number, shift in enumerate(shifts))
