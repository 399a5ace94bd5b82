"""An order of elimination of bodies that keeps the factors sparse."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.solvers.ordering_kernels import LINES, minimum_degree

IntArray = NDArray[np.int64]

DENSE = 10.0
"""Bodies with more than this times ``sqrt(b)`` neighbours come last, as in AMD: they would slow down every step."""


def elimination_order(ptr: IntArray, neighbour: IntArray) -> IntArray:
    """Bodies in the order of elimination, by approximate minimum degree.

    Parameters
    ----------
    ptr, neighbour : ndarray of int64
        Neighbours of body i, without itself: ``neighbour[ptr[i]:ptr[i + 1]]``.
    """
    n = len(ptr) - 1
    order, table = np.empty(n, dtype=np.int64), np.empty((LINES, n), dtype=np.int64)
    room = 4 * len(neighbour) + 2 * n
    while not minimum_degree(
        ptr, neighbour, max(16, int(DENSE * n**0.5)), table, np.empty(room, dtype=np.int64), order
    ):
        room *= 2
    return order
