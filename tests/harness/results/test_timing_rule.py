"""When a timing got worse, from two runs to ten a side."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.harness.results.timing_rule import Samples, judge_timings

SLOW = 1.3


def timings(seed: int, runs: int, noise: float, *, many: int = 60, outliers: float = 0.0) -> dict[int, Samples]:
    """Timing 0 is 30 % slower in HEAD, and the machine 20 % slower as a whole."""
    random = np.random.default_rng(seed)
    found = {}
    for k in range(many):
        sides = [
            np.exp(noise * random.normal(size=runs)) * np.where(random.random(runs) < outliers, 2.0, 1.0) for _ in "ab"
        ]
        found[k] = (list(sides[0]), list(1.2 * sides[1] * (SLOW if k == 0 else 1.0)))
    return found


def test_a_quiet_machine_needs_one_run() -> None:
    found, common = judge_timings(timings(1, 1, 0.005))
    assert common == pytest.approx(1.2, rel=0.01)
    assert found[0].verdict == "worse"
    assert found[0].head / found[0].base == pytest.approx(SLOW, rel=0.05)
    assert {verdict.verdict for k, verdict in found.items() if k} == {"same"}


def test_under_noise_of_ten_per_cent_ten_runs_find_it() -> None:
    verdicts = [judge_timings(timings(seed, 12, 0.10, outliers=0.02))[0][0].verdict for seed in range(40)]
    assert verdicts.count("worse") >= 32
    assert "better" not in verdicts


@pytest.mark.parametrize("runs", [1, 3, 10])
@pytest.mark.parametrize("outliers", [0.0, 0.02])
def test_noise_is_no_change(runs: int, outliers: float) -> None:
    """One false alarm in a hundred comparisons is accepted; three of 60 leave room for two standard deviations."""
    alarms = 0
    for seed in range(60):
        found, _ = judge_timings(timings(1000 + seed, runs, 0.10, outliers=outliers))
        alarms += any(verdict.verdict in ("worse", "better") for k, verdict in found.items() if k)
    assert alarms <= 3


def test_one_outlier_is_suspect_at_most() -> None:
    found, _ = judge_timings({k: ([1.0 + 0.01 * (k % 7)], [2.0 if k == 0 else 1.0 + 0.01 * (k % 5)]) for k in range(4)})
    assert found[0].verdict == "suspect"


def test_differences_of_microseconds_do_not_count() -> None:
    found, _ = judge_timings({k: ([1e-5], [3e-5 if k == 0 else 1e-5]) for k in range(20)})
    assert found[0].verdict == "same"


def test_nothing_to_judge() -> None:
    assert judge_timings({}) == ({}, 1.0)
