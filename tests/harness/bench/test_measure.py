"""Interleaving, time limits, ratios, cores."""

from __future__ import annotations

import math
import os

import pytest

from ninedisk.harness.api.engine import EngineError, EngineNotInstalledError, EngineTimeoutError
from ninedisk.harness.bench.measure import (
    Contender,
    Measured,
    NotReachedError,
    Sample,
    interleave,
    on_cores,
    timings,
)


def scripted(name: str, log: list[str], *outcomes: float | Exception) -> Contender:
    """A contender whose repeats give these seconds or raise."""
    left = list(outcomes)

    def run(limit: float) -> Sample:
        assert limit >= 1.0
        log.append(name)
        outcome = left.pop(0)
        if isinstance(outcome, Exception):
            raise outcome
        return Sample(seconds=outcome)

    return Contender(name=name, run=run)


def test_repeats_alternate_and_ratios_are_taken_repeat_by_repeat() -> None:
    log: list[str] = []
    # The machine slows down fivefold in the middle: medians of each alone would be compared across that, ratios are not.
    found = interleave(
        [scripted("a", log, 1.0, 1.0, 5.0), scripted("b", log, 2.0, 10.0, 10.0)], repeats=3, time_limit=60.0
    )
    assert log == ["a", "b"] * 3
    row = timings(found["b"], found["a"], "a")
    assert row["ratio"] == 2.0
    assert (row["median_s"], row["low_s"], row["high_s"], row["repeats"]) == (10.0, 2.0, 10.0, 3)
    assert math.isnan(row["whole_s"])


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (EngineNotInstalledError("no"), "not-installed"),
        (EngineTimeoutError("late"), "timeout"),
        (NotReachedError("short", {"natural_map": 0.5}), "not-reached"),
        (EngineError("bad"), "error"),
    ],
)
def test_a_failure_is_a_status_and_stops_nobody_else(error: Exception, status: str) -> None:
    log: list[str] = []
    found = interleave([scripted("a", log, error), scripted("b", log, 1.0, 1.0)], repeats=2, time_limit=60.0)
    assert log == ["a", "b", "b"]
    assert (found["a"].status, found["a"].reason, found["a"].samples) == (status, str(error), ())
    assert found["a"].facts == getattr(error, "facts", {})
    assert timings(found["a"], found["b"], "b") == {"status": status, "reason": str(error)}


def test_a_late_crash_leaves_no_time_but_a_late_time_out_keeps_what_was_done() -> None:
    log: list[str] = []
    crash, late = EngineError("bad"), EngineTimeoutError("late")
    found = interleave([scripted("a", log, 1.0, crash), scripted("b", log, 1.0, late)], repeats=3, time_limit=60.0)
    assert found["a"].samples == ()
    assert found["b"].seconds == [1.0]
    assert log == ["a", "b", "a", "b"]


def test_no_further_repeat_beyond_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(range(0, 1000, 10))
    monkeypatch.setattr("ninedisk.harness.bench.measure.time.perf_counter", lambda: next(clock))
    log: list[str] = []
    found = interleave([scripted("a", log, *[1.0] * 9)], repeats=9, time_limit=25.0)
    assert len(found["a"].samples) == 3


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="this system does not pin processes")
def test_cores_are_given_back() -> None:
    before = os.sched_getaffinity(0)

    def fail_on_one() -> None:
        with on_cores(1) as count:
            assert count == 1
            assert len(os.sched_getaffinity(0)) == 1
            raise KeyError

    with pytest.raises(KeyError):
        fail_on_one()
    assert os.sched_getaffinity(0) == before
    with on_cores(10_000) as count:
        assert count == len(before)


def test_without_a_base_there_is_no_ratio() -> None:
    samples = (Sample(seconds=1.0),)
    empty = Measured((), "timeout", "late")
    assert "ratio" not in timings(Measured(samples, "pass", ""), empty, "a")
