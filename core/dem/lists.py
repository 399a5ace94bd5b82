"""Allocation and growth of the lists that the search kernels fill."""

from __future__ import annotations

import numpy as np

from ninedisk.core.dem.neighbour_kernels import Cells, NeighbourList
from ninedisk.core.errors import InvalidSceneError

PAIRS_PER_DISK = 2.1
"""First guess of listed pairs a disk: a settled polydisperse packing has 2.0 with the first skin."""


MOST_PAIRS_PER_DISK, MANY_PAIRS = 100, 1_000_000
"""Listed pairs a disk above which disks lie on top of each other (packings have 2 to 3), in scenes with more than so many pairs."""


def check_crowd(pairs: NeighbourList) -> None:
    """Refuse to let a full list of pairs of disks grow beyond what disks that are beside each other can need.

    Raises
    ------
    InvalidSceneError
        Within a second: pairs of n disks in one place are n^2/2, which no memory holds.
    """
    n = pairs.start.shape[0] - 1
    if pairs.other.shape[0] > max(MANY_PAIRS, MOST_PAIRS_PER_DISK * n):
        raise InvalidSceneError(
            f"disks lie on top of each other: more than {pairs.other.shape[0]} pairs of the {n} disks overlap or nearly touch, "
            f"{MOST_PAIRS_PER_DISK} a disk; is disks.x or disks.radius in another unit than the other?"
        )


def empty_list(rows: int, capacity: int) -> NeighbourList:
    """A neighbour list of ``rows`` empty rows and room for ``capacity`` pairs."""
    return NeighbourList(
        start=np.zeros(rows + 1, dtype=np.int32),
        other=np.zeros(capacity, dtype=np.uint32),
        shear=np.zeros(capacity),
    )


def grown(pairs: NeighbourList) -> NeighbourList:
    """Copy of a list with 1.2 times its room."""
    room = pairs.other.shape[0] + pairs.other.shape[0] // 5 + 16
    larger = empty_list(pairs.start.shape[0] - 1, room)
    used = int(pairs.start[-1])
    larger.start[:] = pairs.start
    larger.other[:used] = pairs.other[:used]
    larger.shear[:used] = pairs.shear[:used]
    return larger


def empty_cells(n: int) -> Cells:
    """Work arrays of the cell list for ``n`` disks; as many cells as disks cover a packing, looser ones get wider cells."""
    return Cells(
        start=np.zeros(n + 65, dtype=np.int32),
        order=np.zeros(n, dtype=np.uint32),
        cell=np.zeros(n, dtype=np.int32),
        grid=np.zeros(5),
    )
