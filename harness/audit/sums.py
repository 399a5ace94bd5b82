"""Compiled loops over bodies that replace several passes of NumPy each: lengths, sums by group, the largest ratio, energies."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import kernel

LOG2 = math.log10(2.0)
Ints = NDArray[np.int64]
Marks = NDArray[np.bool_]


@kernel
def row_lengths(vectors: FloatArray, found: FloatArray) -> None:
    """Lengths of vectors, shape (n, d)."""
    for k in range(len(vectors)):
        square = 0.0
        for axis in range(vectors.shape[1]):
            square += vectors[k, axis] * vectors[k, axis]
        found[k] = np.sqrt(square)


@kernel
def sum_groups(label: Ints, use: Marks, values: FloatArray, found: FloatArray) -> None:
    """Add the rows of ``values`` (n, k) whose bodies are used to those of their groups in ``found`` (g, k)."""
    for k in range(len(label)):
        if use[k]:
            for axis in range(values.shape[1]):
                found[label[k], axis] += values[k, axis]


@kernel
def largest_ratio(value: FloatArray, allowance: FloatArray, found: Ints) -> None:
    """Write the place of the largest value over its allowance, how many are above 1, and 1 if a number is not finite."""
    at = lost = odd = 0
    most = -1.0
    for k in range(len(value)):
        ratio = 0.0 if value[k] <= 0.0 else value[k] / allowance[k]
        if not (np.isfinite(ratio) and np.isfinite(value[k]) and np.isfinite(allowance[k])):
            odd = 1
        if ratio > most:
            most, at = ratio, k
        lost += ratio > 1.0
    found[0], found[1], found[2] = at, lost, odd


@kernel
def rows_of_bodies(ids: Ints, first: int, row: Ints) -> bool:
    """Row of each body whose ids are first, first + 1, ...; -1 where it has none. False: one is there twice, or new."""
    row[:] = -1
    for k in range(len(ids)):
        body = ids[k] - first
        if body < 0 or body >= len(row) or row[body] >= 0:
            return False
        row[body] = k
    return True


@kernel
def mark_large(values: FloatArray, most: float, mark: Marks) -> int:
    """Mark what is not below ``most`` in size, or no number; how many are."""
    count = 0
    for k in range(len(values)):
        if not abs(values[k]) < most:
            mark[k] = True
            count += 1
    return count


@kernel
def place_rounded(
    values: FloatArray, axis: int, unit: float, least: float, powers: FloatArray, decades: FloatArray, factor: float,
    absolute: float, single: float, found: FloatArray, squares: FloatArray,
) -> None:  # fmt: skip
    """Copy numbers to ``found[:, axis]`` and add the squares of the errors of their digits to ``squares``; NaN has that of 0.

    An error is ``factor`` times the largest of ``unit`` times the size before that factor, ``least`` and the entry of its decade in
    ``decades`` (may be empty; ``powers`` are where they start, and infinity), plus ``absolute``; at least ``single`` times the number.
    """
    for k in range(len(values)):
        value = values[k]
        found[k, axis] = value
        value = 0.0 if np.isnan(value) else min(abs(value), 1.7976931348623157e308)
        size = value / factor
        error = max(size * unit, least)
        if len(decades) > 0 and size > 0.0:
            # The decade of the power of two below, or the next one.
            decade = int(np.floor((math.frexp(size)[1] - 1) * LOG2)) + 324
            decade += size >= powers[decade + 1]
            error = max(error, decades[decade])
        error = max(factor * error + absolute, single * value)
        squares[k] += error * error
