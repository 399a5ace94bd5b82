"""The CPU time of an engine's run, the least of repeats, and that of a reference computation beside it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from statistics import median

from ninedisk.harness.api.engine import EngineRun, Timings
from ninedisk.harness.results.schema import GATED_SECONDS, Row

MOST_REPEATS = 5
"""Runs of a cell at most; others on a busy machine share caches with it, and one run in five is hardly disturbed."""

REPEATS_TAKE = 0.15
"""Wall-clock seconds that the repeats of one cell may take: what makes the full matrix some ten per cent longer."""

REFERENCE_ROUNDS = 12_000
"""Rounds of the reference computation: about a millisecond, long against the clock's resolution, nothing beside a cell."""

REFERENCE_TRIES = 3


def reference_seconds() -> float:
    """CPU seconds of a fixed computation, least of a few: what a faster or slower, quiet or crowded processor changes in all timings."""
    return min(_reference() for _ in range(REFERENCE_TRIES))


def _reference() -> float:
    """One go: floating point, integers and branches of the interpreter, whatever library or engine is installed."""
    begin = time.thread_time()
    x, k = 0.5, 1
    for _ in range(REFERENCE_ROUNDS):
        x = 3.7 * x * (1.0 - x)
        k = (k * 69069 + 1) & 0xFFFF
        if k & 1:
            x += 1e-9
    return time.thread_time() - begin


def timing_columns(run: Callable[[], EngineRun], first: Timings, took: float, before: float) -> Row:
    """Columns of a cell's CPU time; its run is repeated where it is long enough to be compared and short enough to be repeated.

    Parameters
    ----------
    run : callable
        The same run again; one that fails now says nothing about the first, whose results count, and ends the repeats.
    first : Timings
    took : float
        Wall-clock seconds of the first run, set-up included.
    before : float
        `reference_seconds` before it.
    """
    spent, references = [first.cpu], [before, reference_seconds()]
    begin = time.perf_counter()
    while (
        first.cpu is not None
        and first.cpu >= GATED_SECONDS
        and len(spent) < MOST_REPEATS
        and time.perf_counter() - begin + took <= REPEATS_TAKE
    ):
        try:
            spent.append(run().timings.cpu)
        except Exception:
            break
        references.append(reference_seconds())
    held = [seconds for seconds in spent if seconds is not None]
    return {
        "cpu_s": min(held, default=math.nan),
        "cpu_of": first.cpu_of if held else "",
        "cpu_spread": median(held) / min(held) - 1.0 if len(held) > 1 else math.nan,
        "reference_s": min(references),
        "repeats": len(spent),
    }
