"""Exact rank-sum test (Wilcoxon, Mann & Whitney), and the scan for change points that is built on it.

Where nothing changed, every order of the values is as likely as any other, whatever their distribution: the chance of
an order is counted, not estimated, and outliers cannot distort it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LONGEST = 120
"""Most values that are ranked together: the tables of chances grow with the third power of it."""

FEWEST = 3
"""Fewest values on each side of a change point."""


LIKELY = 0.05
"""Likelihood, compared with the best place, down to which another place is still named."""


def chance_of_order(one: FloatArray, two: FloatArray) -> float:
    """Two-sided probability of ranks at least as separated as those of two samples, if nothing tells them apart."""
    if len(one) + len(two) > LONGEST:
        one, two = one[-LONGEST // 2 :], two[-LONGEST // 2 :]
    pairs = one[:, None] - two[None, :]
    above = float((pairs > 0).sum() + 0.5 * (pairs == 0).sum())
    return _two_sided(len(one), len(two), above)


@dataclass(frozen=True)
class ChangePoint:
    """A change before value number ``at``; in all likelihood before one of the numbers ``first .. last``."""

    at: int
    first: int
    last: int
    chance: float


def find_change(values: FloatArray) -> ChangePoint | None:
    """The most striking change point of at most `LONGEST` values.

    The chance is that of the best split, multiplied by the number of splits (Bonferroni), at most 1: the probability of
    anything as striking if the order of the values means nothing. The place is that of the least squares about two
    means, values beyond three deviations pulled in; others belong to ``first .. last`` if their likelihood under normal
    noise is at least `LIKELY` of its.

    Returns
    -------
    ChangePoint or None
        None if there are too few values, or all are equal.
    """
    n = len(values)
    splits = np.arange(FEWEST, n - FEWEST + 1)
    if len(splits) < 1 or np.ptp(values) == 0.0:
        return None
    greater = (values[:, None] > values[None, :]) + 0.5 * (values[:, None] == values[None, :])
    chance = min(_two_sided(k, n - k, float(greater[:k, k:].sum())) for k in splits.tolist())
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


def _two_sided(m: int, n: int, above: float) -> float:
    u = math.floor(min(above, m * n - above) + 0.5)  # half a point of a tie counts against a discovery
    return min(1.0, 2.0 * float(_tail(min(m, n), max(m, n))[u]))


@cache
def _tail(m: int, n: int) -> FloatArray:
    """Probability that at most u of the m n pairs are in the wrong order, for u = 0 .. m n."""
    return np.cumsum(_counts(m, n))


@cache
def _counts(m: int, n: int) -> FloatArray:
    """Probability of each number of pairs in the wrong order, m <= n: the largest value is one of the m or one of the n.

    Only sums of positive numbers, so that the smallest probabilities keep all their digits.
    """
    if m == 0:
        return np.ones(1)
    found = np.zeros(m * n + 1)
    one, other = _counts(m - 1, n), _counts(*sorted((m, n - 1)))
    found[n : n + len(one)] += one * (m / (m + n))
    found[: len(other)] += other * (n / (m + n))
    return found
