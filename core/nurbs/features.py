"""Where outlines are nearest to each other and to walls: the contacts that a step has to watch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve_kernels import ShapeTable
from ninedisk.core.nurbs.features_kernels import DEEPEST, features_of_pairs, features_with_walls
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.state import FULL, FeatureRows, feature_rows
from ninedisk.core.nurbs.table import vertices_of


class NurbsFeatures:
    """Features of grains of given shapes at any positions (see `features_kernels`).

    Parameters
    ----------
    table : ShapeTable
    shape : ndarray of int64, shape (n,)
        Row of the table of each grain.
    name : callable, optional
        What a body, or with numbers from n on a wall, is called in messages.
    """

    def __init__(self, table: ShapeTable, shape: IntArray, name: Callable[[int], str] | None = None) -> None:
        self._name = name or (lambda body: f"grain {body}" if body < len(shape) else f"wall {body - len(shape)}")
        self.table, self.shape, self.vertices = table, shape, vertices_of(table)
        self._grains = NurbsGrains.of_table(table, shape)
        self._rows = feature_rows(64)

    def of_pairs(
        self,
        x: FloatArray,
        angle: FloatArray,
        pairs: IntArray,
        reach: float,
        *,
        deep: bool | NDArray[np.bool_] = False,
    ) -> tuple[IntArray, FeatureRows]:
        """Features of pairs of grains.

        Parameters
        ----------
        x : ndarray, shape (n, 2)
            Positions [m].
        angle : ndarray, shape (n,)
            Rotations [rad].
        pairs : ndarray of int64, shape (k, 2)
            Grains i, j; normals point from i to j.
        reach : float
            Largest gap [m].
        deep : bool, or ndarray of bool, shape (k,)
            Whether pairs, all or each, may overlap by more than features are followed; they have none.

        Returns
        -------
        pair : ndarray of int64, shape (m,)
            Row of ``pairs`` to which each feature belongs, in ascending order.
        features : FeatureRows, of m rows

        Raises
        ------
        InvalidSceneError
            If two grains overlap by more than `DEEPEST` of the smaller one's radius, unless ``deep``.
        """
        turn = np.column_stack([np.cos(angle), np.sin(angle)])
        count = np.zeros(len(pairs), dtype=np.int64)
        arrays = (self.table, self.vertices, self.shape, x, turn, pairs, reach, count)
        total = self._listed(lambda: features_of_pairs(*arrays, self._rows), count)
        rigid = ~np.broadcast_to(deep, len(pairs))
        self._refuse_lost(x, angle, pairs[rigid], count[rigid])
        return np.repeat(np.arange(len(pairs)), count), self._first(total)

    def _refuse_lost(self, x: FloatArray, angle: FloatArray, pairs: IntArray, count: IntArray) -> None:
        """Raise if a pair without features overlaps."""
        apart = np.hypot(*(x[pairs[:, 1]] - x[pairs[:, 0]]).T)
        radius = self.table.radius[self.shape]
        close = np.flatnonzero((count == 0) & (apart < radius[pairs[:, 0]] + radius[pairs[:, 1]]))
        if len(close):
            lost, _ = self._grains.pair_contacts(x, angle, pairs[close])
            if len(lost):
                i, j = pairs[close[lost[0]]]
                raise InvalidSceneError(self._deep(i, j))

    def of_walls(
        self,
        x: FloatArray,
        angle: FloatArray,
        pairs: IntArray,
        wall: FloatArray,
        reach: float,
        *,
        deep: bool | NDArray[np.bool_] = False,
    ) -> tuple[IntArray, FeatureRows]:
        """Features of grains and walls, whose body numbers begin at n; ``wall``, shape (m, 11), as `place_walls` fills it.

        Raises
        ------
        InvalidSceneError
            If a grain is deeper in a wall than `DEEPEST` of its radius, unless ``deep`` (of all pairs, or of each).
        """
        turn = np.column_stack([np.cos(angle), np.sin(angle)])
        count = np.zeros(len(pairs), dtype=np.int64)
        arrays = (self.table, self.vertices, self.shape, x, turn, pairs, wall, reach, count)
        total = self._listed(lambda: features_with_walls(*arrays, self._rows), count)
        lost = (count < 0) & ~np.asarray(deep)
        if lost.any():
            i, j = pairs[np.argmax(lost)]
            raise InvalidSceneError(self._deep(i, j))
        return np.repeat(np.arange(len(pairs)), np.maximum(count, 0)), self._first(total)

    def _listed(self, kernel: Callable[[], int], count: IntArray) -> int:
        """Run a kernel until its rows have room."""
        while True:
            total = kernel()
            if not np.any(count == FULL):
                return total
            self._rows = feature_rows(2 * len(self._rows.gap))

    def _first(self, total: int) -> FeatureRows:
        return FeatureRows(*(column[:total].copy() for column in self._rows))

    def _deep(self, i: int, j: int) -> str:
        return (
            f"{self._name(i)} and {self._name(j)} overlap by more than {DEEPEST:g} of a radius, too deep for a contact: move them "
            "apart, reduce the time step, or make the contact elastic and stiff"
        )
