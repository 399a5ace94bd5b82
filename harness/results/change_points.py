"""Where a series of numbers changes: exact rank-sum tests, and the most striking place of a line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LONGEST = 120
"""Most values that are ranked together: an exact test takes ever longer, and older runs say ever less."""

FEWEST = 3
"""Fewest values on each side of a change point."""


PULLED_IN = 3.0
"""Standard deviations beyond which a value is an outlier, and counts as one that lies there."""

LIKELY = 0.05
"""Likelihood, compared with the best place, down to which another place is still named."""


TO_DEVIATION = 1.0 / NormalDist().inv_cdf(0.75)
"""Standard deviation over median distance from the middle, of normal noise: 1.4826."""


DEVIATION_OF_DEVIATION = 1.166
"""Relative standard deviation of `deviation` of n normal values, times sqrt(n): Rousseeuw & Croux, J. Am. Stat. Assoc. 88 (1993) 1273."""


def deviation(distances: FloatArray) -> float:
    """Standard deviation of values from their distances to the middle, blind to what fewer than half of them do."""
    return TO_DEVIATION * float(np.median(np.abs(distances)))


def chance_of_order(one: FloatArray, two: FloatArray) -> float:
    """Two-sided probability of ranks at least as separated as those of two samples, if nothing distinguishes them.

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
    values means nothing. The place is that of the least squares about two means, values beyond `PULLED_IN` deviations
    pulled in; others belong to ``first .. last`` if their likelihood under normal noise is at least `LIKELY` of its.

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
    noise = deviation(apart)
    costs = _costs(np.clip(values, *_bounds(values, best, PULLED_IN * noise)), splits)
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
