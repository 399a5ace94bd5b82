"""When a timing got worse: the rule for comparing few runs with few.

A single timing says little: other work on the machine adds to it, now and then doubles it, and a machine as a whole
drifts. So timings of one machine only are compared; what all timings of a run share is taken out of each and shown as one
line of its own; and the noise is read off the timings themselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.harness.results.rank_test import chance_of_order

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
