"""Pairs of bodies that are close to each other, and allocation and growth of the lists that the search kernels fill."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.dem.plane.neighbour_kernels import build_pairs, build_wall_pairs, sort_into_cells
from ninedisk.core.dem.state import OK, Cells, NeighbourList
from ninedisk.core.errors import InvalidSceneError, NonFiniteStateError

PAIRS_PER_DISK = 2.1
"""First guess of listed pairs a disk: a settled polydisperse packing has 2.0 with the first skin."""

MOST_PAIRS_PER_DISK, MANY_PAIRS = 100, 1_000_000
"""Listed pairs a disk above which disks lie on top of each other (packings have 2 to 3), in scenes with more than so many pairs."""


class PairFinder:
    """Finds all pairs with a gap below a limit.

    Parameters
    ----------
    radius : ndarray, shape (n,)
        Radii [m].
    n_walls : int
    fixed : ndarray of bool, shape (n,), optional
        Disks that have no contacts among themselves and with walls (`Disks.fixed`).
    """

    def __init__(self, radius: FloatArray, n_walls: int, fixed: NDArray[np.bool_] | None = None) -> None:
        n = len(radius)
        walls = np.ones(n_walls, dtype=bool)
        self._fixed = None if fixed is None or not fixed.any() else np.concatenate([fixed, walls])
        self._radius, self._cells = radius, empty_cells(n)
        self._widest = float(radius.max())
        self._none, self._no_walls = empty_list(n, 0), empty_list(n_walls, 0)
        self._disks, self._walls = empty_list(n, int(PAIRS_PER_DISK * n) + 16), empty_list(n_walls, n // 4 + 16)
        self._listed, self._scratch = np.arange(n, dtype=np.uint32), np.zeros(n)

    def within(self, x: FloatArray, wall: FloatArray, reach: float, wall_reach: float | None = None) -> IntArray:
        """Pairs with a gap below ``reach`` [m], shape (k, 2), as body numbers in ascending order.

        Parameters
        ----------
        x : ndarray, shape (n, 2)
            Centres [m].
        wall : ndarray, shape (m, 11)
            Walls as `place_walls` fills them.
        reach : float
            Limit of the gap [m], > 0.
        wall_reach : float, optional
            That of pairs with walls; None: the same.

        Raises
        ------
        NonFiniteStateError
            If a position is no finite number.
        """
        far = reach if wall_reach is None else wall_reach
        if not sort_into_cells(x, 2.0 * self._widest + reach, self._cells):
            raise NonFiniteStateError("the position of a disk is no finite number: reduce dt")
        while build_pairs(x, self._radius, reach, self._cells, False, self._listed, self._none, self._disks) != OK:
            check_crowd(self._disks)
            self._disks = enlarged_list(empty_list(len(x), self._disks.other.shape[0]))
        while (
            build_wall_pairs(x, self._radius, far, wall, self._listed, self._scratch, self._no_walls, self._walls) != OK
        ):
            self._walls = enlarged_list(empty_list(wall.shape[0], self._walls.other.shape[0]))
        start, other = self._disks.start, self._disks.other
        first = np.repeat(np.arange(len(x), dtype=np.int64), np.diff(start))
        second = other[: start[-1]].astype(np.int64)
        w_start, w_other = self._walls.start, self._walls.other
        of_wall = len(x) + np.repeat(np.arange(wall.shape[0], dtype=np.int64), np.diff(w_start))
        bodies = len(x) + wall.shape[0]
        keys = np.concatenate([first * bodies + second, w_other[: w_start[-1]].astype(np.int64) * bodies + of_wall])
        keys.sort()  # one number for each pair: several times as fast as sorting by two columns
        pairs = np.column_stack(np.divmod(keys, max(bodies, 1)))
        return pairs if self._fixed is None else pairs[~self._fixed[pairs].all(axis=1)]


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


def empty_list(rows: int, capacity: int, bends: bool = False) -> NeighbourList:
    """A neighbour list of ``rows`` empty rows and room for ``capacity`` pairs; ``bends``: with torques of rolling resistance."""
    return NeighbourList(
        start=np.zeros(rows + 1, dtype=np.int32),
        other=np.zeros(capacity, dtype=np.uint32),
        shear=np.zeros(capacity),
        bending=np.zeros(capacity if bends else 0),
    )


def enlarged_list(pairs: NeighbourList) -> NeighbourList:
    """Copy of a list with 1.2 times its room."""
    room = pairs.other.shape[0] + pairs.other.shape[0] // 5 + 16
    larger = empty_list(pairs.start.shape[0] - 1, room, len(pairs.bending) > 0)
    used = int(pairs.start[-1])
    larger.start[:] = pairs.start
    larger.other[:used] = pairs.other[:used]
    larger.shear[:used] = pairs.shear[:used]
    larger.bending[:used] = pairs.bending[:used]
    return larger


def empty_cells(n: int) -> Cells:
    """Work arrays of the cell list for ``n`` disks; as many cells as disks cover a packing, looser ones get wider cells."""
    return Cells(
        start=np.zeros(n + 65, dtype=np.int32),
        order=np.zeros(n, dtype=np.uint32),
        cell=np.zeros(n, dtype=np.int32),
        grid=np.zeros(5),
    )
