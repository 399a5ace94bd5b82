"""The rank-sum test and its scan: exact chances, and alarms as rare as they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from ninedisk.harness.results.rank_test import LONGEST, chance_of_order, find_change

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
