"""Pairs of bounding spheres that are near, from cells of several sizes."""

from __future__ import annotations

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.shapes.state import Floats, Integers


@inline_kernel
def first_at_least(keys: Integers, key: int) -> int:
    """Place of the first of ascending keys that is not below ``key``."""
    low, high = 0, keys.shape[0]
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def pairs_of_level(
    x: Floats,
    radius: Floats,
    margin: float,
    level: Integers,
    cell: Integers,
    keys: Integers,
    order: Integers,
    here: int,
    span: Integers,
    pairs: Integers,
    count: int,
) -> int:
    """List the near pairs of the bodies of one level with those of the same level and of lower ones.

    Parameters
    ----------
    x, radius : ndarray, shape (b, 3), (b,)
        Centres and radii [m].
    level : ndarray of int64, shape (b,)
        Level of each body; a higher one has larger bodies.
    cell : ndarray of int64, shape (b, 3)
        Cell of each body among those of this level.
    keys, order : ndarray of int64, shape (k,)
        Cells of this level's bodies as one number, ascending, and the bodies.
    here : int
        The level.
    span : ndarray of int64, shape (2,)
        What a cell along y and along x adds to the number of a cell.
    pairs : ndarray of int64, shape (p, 2)
        Out, from row ``count``: the lower body first. What does not fit is counted only.
    """
    for i in range(x.shape[0]):
        if level[i] > here:
            continue
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                # Three cells along z are next to each other.
                low = (cell[i, 0] + dx) * span[1] + (cell[i, 1] + dy) * span[0] + cell[i, 2] - 1
                k = first_at_least(keys, low)
                while k < keys.shape[0] and keys[k] <= low + 2:
                    j = order[k]
                    k += 1
                    if j == i or (level[i] == here and j < i):
                        continue
                    ax, ay, az = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
                    far = radius[i] + radius[j] + margin
                    if far >= 0.0 and ax * ax + ay * ay + az * az <= far * far:
                        if count < pairs.shape[0]:
                            pairs[count, 0], pairs[count, 1] = min(i, j), max(i, j)
                        count += 1
    return count
