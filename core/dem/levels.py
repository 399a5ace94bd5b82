"""Levels of sizes: bodies of about one size have a grid to themselves, so that cells are as wide as what is in them.

A grid as wide as the largest body holds thousands of small ones in a cell. With levels every body looks for partners in its own level
and in those of larger ones, so that each pair is found once, from its smaller body.
"""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.dem.state import Levels

LEVELS_FROM = 2_000
"""Bodies from which a scene can have levels: fewer are found quickly in wide cells."""

STEP_OF_SIZE = 2.0
"""Ratio of the largest radii of neighbouring levels, at least."""

WORTH = 2.0
"""Two levels are kept apart if together they would have more than so many times the candidates."""

SPARE_CELLS = 64
"""Cells that a level can have beyond one for each of its bodies."""


def level_limits(radius: FloatArray, dimension: int) -> FloatArray:
    """Largest radii of the levels, ascending [m]; one for bodies of about one size.

    Of n bodies in a grid of the width w each meets a number of candidates proportional to ``n w^dimension``.

    Parameters
    ----------
    radius : ndarray, shape (n,)
        [m], n >= 1.
    dimension : int
        2 or 3.

    Returns
    -------
    ndarray, shape (levels,)

    Examples
    --------
    >>> import numpy as np
    >>> level_limits(np.array([1.0] * 1000 + [20.0]), 3).tolist()
    [1.0, 20.0]
    >>> level_limits(np.linspace(0.5, 1.0, 1000), 3).tolist()
    [1.0]
    """
    rest, limits, counts = np.sort(radius), [], []
    while len(rest):
        smaller = int(np.searchsorted(rest, rest[-1] / STEP_OF_SIZE, side="right"))
        limits.append(float(rest[-1]))
        counts.append(len(rest) - smaller)
        rest = rest[:smaller]
    kept, in_it = [limits[-1]], counts[-1]
    for limit, count in zip(limits[-2::-1], counts[-2::-1], strict=True):
        apart = in_it**2 * kept[-1] ** dimension + count**2 * limit**dimension
        if (in_it + count) ** 2 * limit**dimension <= WORTH * apart:
            kept[-1], in_it = limit, in_it + count
        else:
            kept.append(limit)
            in_it = count
    return np.array(kept)


def levels_of(radius: FloatArray, dimension: int) -> Levels | None:
    """Levels of these bodies with empty grids; None if one grid serves them all.

    Parameters
    ----------
    radius : ndarray, shape (n,)
        [m].
    dimension : int
        2 or 3.
    """
    n = len(radius)
    if n < LEVELS_FROM:
        return None
    widest = level_limits(radius, dimension)
    count = len(widest)
    if count == 1:
        return None
    of = np.searchsorted(widest, radius)
    room = np.bincount(of, minlength=count) + SPARE_CELLS
    return Levels(
        widest=widest,
        room=room.astype(np.int64),
        base=np.zeros(count, dtype=np.int64),
        width=np.zeros(count),
        counts=np.ones((count, 3), dtype=np.int64),
        shift=np.zeros(count, dtype=np.int64),
        low=np.zeros(3),
        axes=np.zeros(3, dtype=np.int64),
        start=np.zeros(int(room.sum()) + 1, dtype=np.int32),
        order=np.zeros(n, dtype=np.uint32),
        cell=np.zeros(n, dtype=np.int32),
    )


def no_levels() -> Levels:
    """What disks of one grid have for levels."""
    none, zeros = np.zeros(0), np.zeros(0, dtype=np.int64)
    return Levels(
        widest=none,
        room=zeros,
        base=zeros,
        width=none,
        counts=np.zeros((0, 3), dtype=np.int64),
        shift=zeros,
        low=none,
        axes=zeros,
        start=np.zeros(0, dtype=np.int32),
        order=np.zeros(0, dtype=np.uint32),
        cell=np.zeros(0, dtype=np.int32),
    )


def size_of_skins(radius: FloatArray, levels: Levels | None) -> float:
    """Radius that skins are measured by [m]: the mean, with levels the harmonic one.

    A skin h costs every body pairs in proportion to ``h/R`` (`ninedisk.core.dem.plane.neighbour_kernels.next_skin`).
    """
    return float(radius.mean()) if levels is None else float(1.0 / np.mean(1.0 / radius))
