"""Broad phase: which bounding spheres are near each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.shapes.search_kernels import pairs_of_level
from ninedisk.core.validate import LARGEST, at_least, finite, rows_of

CELLS = 2**20
"""Cells along an axis at most, so that three numbers of cells fit into one of 64 bits; beyond, cells are larger."""

PER_BODY = 16
"""Pairs per body for which memory is taken at first."""

NEAR = 1.0 + 1e-9
"""Factor on the width of a cell: coordinates over widths are rounded, and neighbours within the width must be in the next cell."""


def near_pairs(x: ArrayLike, radius: ArrayLike, margin: float) -> IntArray:
    """Find all pairs of spheres within a margin of each other.

    Bodies are sorted into levels by powers of two of their radii, and each level into cells as wide as two of its largest bodies and the
    margin (hierarchical grid: Ogarko and Luding, Comput. Phys. Commun. 183, 931-936, 2012). For n bodies and p pairs the time is
    O(n log n + p), whatever the radii.

    Parameters
    ----------
    x : array_like, shape (b, 3)
        Centres [m].
    radius : array_like, shape (b,)
        Radii of the spheres, or bounding radii [m].
    margin : float
        Largest gap of a pair [m].

    Returns
    -------
    ndarray of int64, shape (p, 2)
        Pairs, the lower body first, sorted.

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.

    Examples
    --------
    >>> near_pairs([[0.0, 0.0, 0.0], [2.5, 0.0, 0.0], [2.5, 2.1, 0.0]], [1.0, 1.0, 1.0], 0.2)
    array([[1, 2]])
    """
    centres = rows_of("x", x, 3)
    centres = finite("x", centres, centres.shape, most=LARGEST)
    radii = finite("radius", radius, (len(centres),), most=LARGEST)
    if np.any(radii < 0.0):
        raise InvalidSceneError(f"radius = {radii.min():g} is not allowed: it must be >= 0")
    margin = at_least("margin", margin, -LARGEST)
    if not len(centres):
        return np.empty((0, 2), dtype=np.int64)
    pairs = np.empty((PER_BODY * len(centres), 2), dtype=np.int64)
    while True:
        count = _list_pairs(centres, radii, margin, pairs)
        if count <= len(pairs):
            return pairs[:count][np.lexsort(pairs[:count].T[::-1])]
        pairs = np.empty((count, 2), dtype=np.int64)


def _list_pairs(x: FloatArray, radius: FloatArray, margin: float, pairs: IntArray) -> int:
    low = x.min(axis=0)
    extent = float((x.max(axis=0) - low).max())
    # Level 0 has what is no larger than the margin: cells cannot be smaller than that anyway.
    least = max(margin, 0.0, 2.0**-40 * float(radius.max()), 2.0**-1000)
    level = np.ceil(np.log2(np.maximum(radius / least, 1.0))).astype(np.int64)
    count = 0
    for here in np.unique(level):
        members = np.flatnonzero(level == here)
        width = max(NEAR * (2.0 * float(radius[members].max()) + max(margin, 0.0)), extent / CELLS, 2.0**-1000)
        # One cell more on each side: neighbours of the first and of the last one are cells, too.
        cell = np.floor((x - low) / width).astype(np.int64) + 1
        sizes = cell.max(axis=0) + 2
        span = np.array([sizes[2], sizes[1] * sizes[2]], dtype=np.int64)
        keys = cell[members, 0] * span[1] + cell[members, 1] * span[0] + cell[members, 2]
        order = np.argsort(keys, kind="stable")
        count = pairs_of_level(
            x, radius, margin, level, cell, keys[order], members[order], int(here), span, pairs, count
        )
    return int(count)
