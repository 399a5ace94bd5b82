"""Kernels of the levels of sizes that disks and spheres share: which level, order in memory, stripes that pairs do not jump."""

from __future__ import annotations

from math import floor

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import IntArray
from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.state import Levels

MARGIN = 1e-3
"""Of a cell, by which its neighbours are looked for further: far above the rounding of the number of a cell."""


@inline_kernel
def level_of(levels: Levels, radius: float) -> int:
    """Level of a body of this radius [m]."""
    level = 0
    while radius > levels.widest[level]:
        level += 1
    return level


@inline_kernel
def set_shifts(levels: Levels, width: float, skin: float) -> int:
    """Set the shifts for finest cells of this width [m], and return the largest.

    Bodies of two levels that are listed are at most ``W_l + W_k + skin`` apart, rounded up and one cell more for where they are in theirs.
    """
    levels.shift[0] = 0
    for k in range(1, levels.widest.shape[0]):
        apart = (levels.widest[k - 1] + levels.widest[k] + skin) / width
        levels.shift[k] = levels.shift[k - 1] + int(apart) + 2
    return int(levels.shift[levels.widest.shape[0] - 1])


@inline_kernel
def first_cell(position: float, reach: float, width: float) -> int:
    """First cell along an axis within reach of a position above the lower corner [m], at least 0."""
    return max(floor((position - reach) / width - MARGIN), 0)


@inline_kernel
def last_cell(position: float, reach: float, width: float, count: int) -> int:
    """Last cell within reach, at most the last one."""
    return min(floor((position + reach) / width + MARGIN), count - 1)


@kernel
def merge_stripes(start: IntArray | NDArray[np.int32], other: NDArray[np.uint32], stripe: IntArray) -> None:
    """Leave out ends of stripes so that no pair of a stripe reaches further than the next one.

    Parameters
    ----------
    start : ndarray, shape (n + 1,)
        Rows of the list of pairs; partners have higher rows.
    other : ndarray
        Partners.
    stripe : ndarray of int64, shape (s + 1,)
        First row of each stripe; the unused ones at its end are empty.
    """
    n, used, far, row = start.shape[0] - 1, 0, -1, 0
    for s in range(1, stripe.shape[0]):
        first = stripe[s]
        if stripe[used] < first < n and first > far:
            # All rows of stripes before the present one reach into it at most.
            for k in range(start[row], start[first]):
                far = max(far, int(other[k]))
            row, used = first, used + 1
            stripe[used] = first
    for s in range(used + 1, stripe.shape[0]):
        stripe[s] = n


@inline_kernel
def box_number(levels: Levels, k: int, a: int, b: int, c: int) -> int:
    """Number of a cell of level k among those of all levels."""
    return int(levels.base[k] + (c * levels.counts[k, 1] + b) * levels.counts[k, 0] + a)


@inline_kernel
def set_bases(levels: Levels) -> int:
    """First cells of the levels from their counts; number of all cells."""
    total = 0
    for k in range(levels.widest.shape[0]):
        levels.base[k] = total
        total += levels.counts[k, 0] * levels.counts[k, 1] * levels.counts[k, 2]
    return int(total)


@inline_kernel
def halve_to_fit(levels: Levels, k: int) -> None:
    """Halve the most numerous cells of level k of a periodic cell until they fit."""
    count = levels.counts[k]
    while count[0] * count[1] * count[2] > levels.room[k]:
        largest = int(np.argmax(count))
        count[largest] = max(1, count[largest] // 2)
