"""When a timing got worse: CPU seconds relative to the reference computation, of one or several runs a side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist, median
from typing import Any

import numpy as np

from ninedisk.harness.api.text import count_noun
from ninedisk.harness.results.change_points import DEVIATION_OF_DEVIATION, FloatArray, chance_of_order, deviation
from ninedisk.harness.results.schema import GATED_SECONDS, REFERENCE_SECONDS, Row, standard_seconds

WALL_CLOCK = "stepping by the wall clock"
"""What a timing is of where no CPU time is known: runs of old stores. It is shown, and at most suspect."""

FALSE_ALARMS = 0.01
"""Accepted probability of one false alarm in a whole comparison."""

LEAST = math.log(1.10)
"""Smallest change that is worth a word: ten per cent."""

LEAST_GATED = math.log(1.20)
"""Smallest change that gates: what the reference computation does not share with an engine, such as memory and caches, moved single
timings of groups of five unchanged runs on a crowded machine by up to 16 %."""

MANY = 8
"""Timings from which on the spread between them says how noisy the runs are, and what they share can be seen."""

PLENTY = 5
"""Runs a side from which on the noise of a timing is known from its own runs."""

WIDE = 10.0
"""With fewer runs a change must exceed this many standard deviations: under noise of 10% a timing that other work doubled
lies five away by that alone, and its own noise can take it four further."""

BEYOND_NEIGHBOURS = 1.5
"""With fewer runs a change must also be this many times the largest speed-up beside it: noise strikes either side."""

FEW_ALONE = 3
"""Runs a side below which a timing with hardly another beside it is no more than suspect."""

ASSUMED_NOISE = 0.10
"""Relative noise of one timing where too few timings were taken to measure it."""

TIMING_RULE = (
    f"Timings are CPU seconds, the least of the repeats within a run, relative to a reference computation that the harness "
    f"times beside each cell in the same way; they are shown in seconds of a processor that computes it in "
    f"{REFERENCE_SECONDS * 1e3:g} ms. They are compared on one machine only. One got worse when both sides take at least "
    f"{GATED_SECONDS * 1e3:g} ms, HEAD is at least {math.expm1(LEAST_GATED):.0%} slower, and that is beyond the noise. With {PLENTY} "
    f"runs a side or more: when the distance of their medians, measured by the scatter of the timing's own runs and by that "
    f"of all timings, or the order of the runs (exact rank-sum test), leaves a chance below {FALSE_ALARMS:.0%} of one false "
    f"alarm in the whole comparison (Bonferroni). With fewer runs: what all timings have in common is divided out, and one "
    f"must have moved by more than {WIDE:g} standard deviations of all timings, {WIDE:g} times as far as the repeats within its "
    f"runs scatter and {BEYOND_NEIGHBOURS:g} times as far as the largest speed-up beside it. What is slower but not by that much "
    f"is suspect, and so is a wall-clock time (stores of older versions): repeat the runs and compare ranges "
    f"(latest~9..latest~5 latest~4..latest)."
)


def timing(cell: Row) -> tuple[str, float]:
    """What a cell's timing is of, ``cpu_of`` or `WALL_CLOCK`, and its seconds; those of CPU time by `schema.standard_seconds`."""
    seconds = standard_seconds(cell)
    return (str(cell["cpu_of"]), seconds) if math.isfinite(seconds) else (WALL_CLOCK, float(cell["advance_s"]))


@dataclass(frozen=True)
class Samples:
    """One timing: its seconds in the runs of BASE and of HEAD, and the relative spread of repeats within a run, if known.

    ``gates`` is False of one that is shown and at most suspect.
    """

    base: Sequence[float]
    head: Sequence[float]
    spread: float = 0.0
    gates: bool = True


@dataclass(frozen=True)
class TimingVerdict:
    """``base`` and ``head`` are the medians of the runs of each side [s], ``head`` with what all timings share taken out."""

    verdict: str
    base: float
    head: float
    reason: str


def judge_timings(samples: Mapping[Any, Samples]) -> tuple[dict[Any, TimingVerdict], float]:
    """Judge every timing that both sides have; also the factor by which those long enough moved together (1 if too few).

    That factor is the median of the single ones, so that a change of fewer than half of the timings stays visible. It is divided out
    of sides of few runs; of sides of `PLENTY` it is a change like any other, because the reference computation has taken the machine's
    share already.
    """
    moves = {key: math.log(median(each.head) / median(each.base)) for key, each in samples.items()}
    # What is too short to be judged would only add its noise.
    judged = np.array([moves[key] for key, each in samples.items() if _faster_seconds(each) >= GATED_SECONDS])
    many, tests = len(judged) >= MANY, max(len(judged), 1)
    common = float(np.median(judged)) if many else 0.0
    scatter = deviation(judged - common) if many else 0.0
    uncertain = 1.0 + 2.0 * DEVIATION_OF_DEVIATION / math.sqrt(tests)  # the scatter of 30 timings is known to a fifth
    speed_up = max(0.0, float((common - judged).max())) if many else 0.0
    deviations = NormalDist().inv_cdf(1.0 - FALSE_ALARMS / (4 * tests))  # two directions, two tests
    found = {}
    for key, each in samples.items():
        base, head = (np.log(np.asarray(side, dtype=np.float64)) for side in (each.base, each.head))
        runs = min(len(base), len(head))
        noise = scatter if many else _noise_of_medians(len(base), len(head), ASSUMED_NOISE)
        if runs >= PLENTY:
            limit = deviations * max(noise, _own_noise(base, head))
        else:
            head = head - common
            limit = max(WIDE * uncertain * noise, WIDE * each.spread, BEYOND_NEIGHBOURS * speed_up)
            if runs < FEW_ALONE and not many:
                limit = math.inf  # hardly a timing beside this one: nothing separates noise from change
        near, gates = max(deviations * noise, LEAST), each.gates and _faster_seconds(each) >= GATED_SECONDS
        found[key] = _verdict(base, head, limit, near, tests, gates=gates)
    return found, math.exp(common)


def _faster_seconds(timing: Samples) -> float:
    """Seconds of the faster side."""
    return min(median(timing.base), median(timing.head))


def _verdict(
    base: FloatArray, head: FloatArray, limit: float, near: float, tests: int, *, gates: bool
) -> TimingVerdict:
    before, after = float(np.median(base)), float(np.median(head))
    move, seconds = after - before, (math.exp(before), math.exp(after))
    size = f"{math.exp(abs(move)):.2f} times as {'slow' if move > 0 else 'fast'}"
    if abs(move) < LEAST or max(seconds) < GATED_SECONDS:
        return TimingVerdict("same", *seconds, "")
    ranked = chance_of_order(base, head) * tests < FALSE_ALARMS / 2
    if abs(move) > LEAST_GATED and (abs(move) > limit or ranked) and gates:
        return TimingVerdict("worse" if move > 0 else "better", *seconds, size)
    if move > near:
        return TimingVerdict(
            "suspect", *seconds, f"{size}, not beyond doubt with {len(base)} and {count_noun(len(head), 'run')}"
        )
    return TimingVerdict("same", *seconds, "")


def _own_noise(base: FloatArray, head: FloatArray) -> float:
    """Standard deviation of the difference of the medians, from the timing's own runs."""
    apart = np.concatenate([base - np.median(base), head - np.median(head)])
    return _noise_of_medians(len(base), len(head), deviation(apart))


def _noise_of_medians(m: int, n: int, single: float) -> float:
    """Standard deviation of the difference of two medians of ``m`` and ``n`` values with deviation ``single`` each.

    A median of three or more varies sqrt(pi/2) times as much as a mean.
    """
    mean = single * math.sqrt(1.0 / m + 1.0 / n)
    return mean * (math.sqrt(math.pi / 2.0) if min(m, n) >= 3 else 1.0)
