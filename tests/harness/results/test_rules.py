"""When an error got worse.

When a timing got worse, from two runs to ten a side.

The rank-sum test and its scan: exact chances, and alarms as rare as they say.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from ninedisk.harness.api.text import found_and_expected
from ninedisk.harness.results.change_points import LONGEST, chance_of_order, find_change
from ninedisk.harness.results.error_rules import QUIET, judge_errors
from ninedisk.harness.results.timing_rules import Samples, judge_timings


def row(error: float, status: str = "pass", rtol: float = 1e-12, scale: float = 2.0) -> dict[str, Any]:
    return {"abs_error": error, "status": status, "atol": 0.0, "rtol": rtol, "scale": scale}


@pytest.mark.parametrize(
    ("base", "head", "verdict"),
    [
        (row(1e-16), row(3e-16), "same"),  # round-off
        (row(0.0), row(1e-15), "same"),  # from exact to round-off
        (row(1e-15), row(1e-13), "same"),  # a hundred times, and still a twentieth of the tolerance
        (row(1e-14), row(2.1 * QUIET * 1e-12), "worse"),  # beyond round-off's share and more than doubled
        (row(1.1e-12), row(1.9e-12), "same"),  # not doubled
        (row(0.3e-12), row(3e-12, "fail"), "worse"),  # ten times, outside
        (row(1.99e-12), row(2.01e-12, "fail"), "worse"),  # hardly more, but the check fails now
        (row(3e-12, "fail"), row(1e-12), "better"),
        (row(3e-12, "fail"), row(3e-12, "fail"), "same"),
        (row(3e-12, "fail"), row(3e-11, "fail"), "worse"),
        (row(1e-12), row(0.2e-12), "better"),
        (row(1e-14), row(1e-16), "same"),
        (row(0.1), row(math.nan, "fail"), "worse"),  # no number any more
        (row(math.nan, "no-truth"), row(math.nan, "no-truth"), "same"),
        (row(5.0, "known-gap"), row(5.0, "gap-closed"), "better"),
        (row(5.0, "known-gap"), row(50.0, "known-gap"), "worse"),
        (row(0.0, rtol=0.0), row(1e-17, "fail", rtol=0.0), "worse"),  # no tolerance at all
        (row(3e-12, "fail"), row(3e-12, rtol=1e-11), "suspect"),  # passes because the tolerance was widened
        (row(1e-13), row(1e-13, rtol=1e-11), "suspect"),
    ],
)
def test_verdicts(base: dict[str, Any], head: dict[str, Any], verdict: str) -> None:
    assert judge_errors(base, head)[0] == verdict


def test_a_changed_tolerance_is_said() -> None:
    assert "tolerance changed from 2e-12 to 2e-11" in judge_errors(row(3e-12, "fail"), row(3e-12, rtol=1e-11))[1]


def test_what_was_found_is_said_where_an_error_got_worse() -> None:
    head = {**row(2.4, "fail"), "value": -1.2, "expected": 1.2}
    assert judge_errors(row(0.0), head)[1] == "now outside its tolerance, found -1.2, expected +1.2"
    assert judge_errors(row(1.2, "fail"), head) == ("same", "")


@pytest.mark.parametrize(
    ("value", "expected", "said"),
    [(-1.2, 1.2, ("-1.2", "+1.2")), (1.0, 1.0, ("+1", "+1")), (0.123456, 0.123457, ("+0.123456", "+0.123457"))],
)
def test_numbers_have_the_digits_in_which_they_differ(value: float, expected: float, said: tuple[str, str]) -> None:
    assert found_and_expected(value, expected) == said


SLOW = 1.3


def timings(seed: int, runs: int, noise: float, *, many: int = 60, outliers: float = 0.0) -> dict[int, Samples]:
    """Timing 0 is 30 % slower in HEAD; of single runs all others are 20 % slower, too."""
    random = np.random.default_rng(seed)
    found = {}
    for k in range(many):
        sides = [
            np.exp(noise * random.normal(size=runs)) * np.where(random.random(runs) < outliers, 2.0, 1.0) for _ in "ab"
        ]
        found[k] = Samples(list(sides[0]), list((1.2 if runs == 1 else 1.0) * sides[1] * (SLOW if k == 0 else 1.0)))
    return found


def test_a_quiet_machine_needs_one_run() -> None:
    found, common = judge_timings(timings(1, 1, 0.005))
    assert common == pytest.approx(1.2, rel=0.01)
    assert found[0].verdict == "worse"
    assert found[0].head / found[0].base == pytest.approx(SLOW, rel=0.05)
    assert {verdict.verdict for k, verdict in found.items() if k} == {"same"}


def test_under_noise_of_ten_per_cent_fifteen_runs_find_it() -> None:
    verdicts = [judge_timings(timings(seed, 15, 0.10, outliers=0.02))[0][0].verdict for seed in range(40)]
    assert verdicts.count("worse") >= 32
    assert "better" not in verdicts


@pytest.mark.sampled(1)
@pytest.mark.long
@pytest.mark.parametrize(("runs", "outliers"), [(1, 0.02), (3, 0.0), (10, 0.02)])
def test_noise_is_no_change(runs: int, outliers: float) -> None:
    """One false alarm in a hundred comparisons is accepted; three of 60 leave room for two standard deviations."""
    alarms = 0
    for seed in range(60):
        found, _ = judge_timings(timings(1000 + seed, runs, 0.10, outliers=outliers))
        alarms += any(verdict.verdict in ("worse", "better") for k, verdict in found.items() if k)
    assert alarms <= 3


def test_one_outlier_is_suspect_at_most() -> None:
    held = {k: Samples([1.0 + 0.01 * (k % 7)], [2.0 if k == 0 else 1.0 + 0.01 * (k % 5)]) for k in range(4)}
    found, _ = judge_timings(held)
    assert found[0].verdict == "suspect"


@pytest.mark.parametrize("runs", [1, 5])
@pytest.mark.parametrize(
    ("before", "after", "gates", "verdict"),
    [
        (0.3e-3, 21e-3, True, "suspect"),  # below 5 ms: a busy machine, a page fault
        (0.3e-3, 4e-3, True, "same"),
        (30e-3, 2.1, False, "suspect"),  # wall-clock time
        (30e-3, 2.1, True, "worse"),
    ],
)
def test_only_cpu_times_above_five_milliseconds_gate(
    runs: int, before: float, after: float, gates: bool, verdict: str
) -> None:
    quiet = {k: Samples([1e-2] * runs, [1e-2 * (1.0 + 1e-3 * (k % 3))] * runs) for k in range(1, 20)}
    found, _ = judge_timings({0: Samples([before] * runs, [after] * runs, gates=gates), **quiet})
    assert found[0].verdict == verdict


def test_thirty_per_cent_from_five_runs_a_side_even_of_every_timing() -> None:
    """Noise of 4 % and doubled outliers, what runs on a busy machine show relative to the reference computation."""
    random = np.random.default_rng(11)
    for slow in (SLOW, 1.0):
        found_in = []
        for _ in range(20):
            draw = [
                np.exp(0.04 * random.normal(size=(2, 5))) * np.where(random.random((2, 5)) < 0.02, 2.0, 1.0)
                for _ in range(30)
            ]
            found, common = judge_timings({k: Samples(base, slow * head) for k, (base, head) in enumerate(draw)})
            assert common == pytest.approx(slow, rel=0.05)
            found_in += [each.verdict for each in found.values()]
        assert found_in.count("worse") >= 0.9 * len(found_in) if slow > 1.0 else "worse" not in found_in


def test_repeats_that_scatter_within_a_run_are_noise() -> None:
    quiet = {k: Samples([1e-2], [1e-2 * (1.0 + 1e-3 * (k % 3))]) for k in range(1, 20)}
    verdicts = [
        judge_timings({0: Samples([1e-2], [2e-2], spread=spread), **quiet})[0][0].verdict for spread in (0.01, 0.2)
    ]
    assert verdicts == ["worse", "suspect"]


def test_nothing_to_judge() -> None:
    assert judge_timings({}) == ({}, 1.0)


RANDOM = np.random.default_rng(20260101)


@pytest.mark.parametrize(("m", "n"), [(1, 4), (3, 7), (8, 5), (12, 30), (25, 25)])
def test_chances_are_those_of_the_exact_test(m: int, n: int) -> None:
    for shift in (0.0, 0.7, 2.0):
        one, two = RANDOM.normal(size=m), RANDOM.normal(shift, size=n)
        exact = mannwhitneyu(one, two, method="exact").pvalue
        assert chance_of_order(one, two) == pytest.approx(exact, rel=1e-12)


def test_the_smallest_chances_keep_their_digits() -> None:
    one, two = np.arange(60.0), 100.0 + np.arange(60.0)
    from math import comb

    assert chance_of_order(one, two) == pytest.approx(2.0 / comb(120, 60), rel=1e-12)


def test_long_samples_are_cut_to_their_newest() -> None:
    one, two = RANDOM.normal(size=300), RANDOM.normal(size=400)
    assert chance_of_order(one, two) == chance_of_order(one[-LONGEST // 2 :], two[-LONGEST // 2 :])


def test_ties_are_no_evidence() -> None:
    assert chance_of_order(np.ones(6), np.ones(6)) == 1.0
    assert find_change(np.ones(20)) is None
    assert find_change(np.arange(5.0)) is None


@pytest.mark.sampled(1)
@pytest.mark.long
@pytest.mark.parametrize("noise", ["normal", "outliers", "cauchy"])
def test_the_scan_alarms_as_rarely_as_it_says(noise: str) -> None:
    """Under any noise whose order means nothing, a chance below p comes up in at most a share p of all histories."""
    random = np.random.default_rng(7)
    draw = {
        "normal": lambda: random.normal(size=40),
        "outliers": lambda: 0.1 * random.normal(size=40) + np.where(random.random(40) < 0.05, np.log(2), 0.0),
        "cauchy": lambda: random.standard_cauchy(size=40),
    }[noise]
    chances = np.array([find_change(draw()).chance for _ in range(600)])  # type: ignore[union-attr]
    # Three standard deviations of the count above the bound itself; the bound is loose, as Bonferroni's is.
    assert (chances < 0.05).sum() <= 600 * 0.05 + 3 * np.sqrt(600 * 0.05)


def test_a_planted_change_is_placed() -> None:
    """30 % under noise of 10 %, one value in fifty doubled: the named span holds the truth in nine of ten histories."""
    random = np.random.default_rng(3)
    found = []
    for _ in range(200):
        values = 0.1 * random.normal(size=50) + np.where(random.random(50) < 0.02, np.log(2), 0.0)
        values[30:] += np.log(1.3)
        found.append(find_change(values))
    places = np.array([(c.at, c.first, c.last) for c in found if c is not None])
    assert np.mean(places[:, 0] == 30) > 0.5
    assert np.mean(np.abs(places[:, 0] - 30) <= 1) > 0.8
    assert np.mean((places[:, 1] <= 30) & (places[:, 2] >= 30)) > 0.9
    assert np.median(places[:, 2] - places[:, 1]) <= 2
    assert np.median([c.chance for c in found if c is not None]) < 1e-6


def test_a_clear_change_is_placed_exactly() -> None:
    random = np.random.default_rng(3)
    for _ in range(50):
        values = 0.03 * random.normal(size=40)
        values[25:] += np.log(1.3)
        found = find_change(values)
        assert found is not None
        assert (found.at, found.first, found.last) == (25, 25, 25)
