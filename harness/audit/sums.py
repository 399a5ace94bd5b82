"""Compiled loops over bodies that replace several passes of NumPy each: lengths, sums by group, the largest ratio, energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import kernel

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
