"""Contact forces from step to step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class ContactMemory:
    """Forces of the last step by contact: the shear springs' state and the solvers' warm start.

    Parameters
    ----------
    n_bodies : int
        Disks and walls.
    pairs : ndarray of int64, shape (c, 2)
        In ascending order; a pair of outlines can occur several times.
    forces : ndarray, shape (c, 2)
        Normal and shear forces ``(p, q)`` [N].
    places : ndarray, shape (c, 2)
        Places on both outlines, 0 on disks and walls.
    shear : ndarray, shape (c,), optional
        Shear forces with which the next step begins [N]; None: those of the last one.

    Attributes
    ----------
    keys : ndarray of int64, shape (c,)
        One number for each pair, ascending.
    """

    def __init__(
        self, n_bodies: int, pairs: IntArray, forces: FloatArray, places: FloatArray, shear: FloatArray | None = None
    ) -> None:
        self._n = n_bodies
        self.pairs, self.forces, self.places = pairs, forces, places
        self.shear = forces[:, 1] if shear is None else shear
        self.keys = self.keys_of(pairs)

    def keys_of(self, pairs: IntArray) -> IntArray:
        """One number for each pair, in the order of the pairs."""
        return np.asarray(pairs[:, 0] * self._n + pairs[:, 1])

    def of(self, pairs: IntArray) -> FloatArray:
        """Forces of these pairs of disks and walls, shape (c, 2); 0 where there was no contact."""
        found = np.zeros((len(pairs), 2))
        if len(self.keys) and len(pairs):
            keys = self.keys_of(pairs)
            at = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
            known = self.keys[at] == keys
            found[known] = self.forces[at[known]]
        return found

    def sums(self, pairs: IntArray) -> FloatArray:
        """Sums of the forces of all contacts of each of these pairs, shape (c, 2)."""
        keys = self.keys_of(pairs)
        begin, end = (np.searchsorted(self.keys, keys, side) for side in ("left", "right"))
        return np.array([self.forces[i:j].sum(axis=0) for i, j in zip(begin, end, strict=True)]).reshape(len(pairs), 2)

    def same(self, pairs: IntArray, others: IntArray) -> NDArray[np.bool_]:
        """Which of the pairs are among the others, shape (c,)."""
        return np.isin(self.keys_of(pairs), self.keys_of(others))

    def renewed(
        self, pairs: IntArray, forces: FloatArray, places: FloatArray, shear: FloatArray | None = None
    ) -> ContactMemory:
        """Memory of the next step."""
        return ContactMemory(self._n, pairs, forces, places, shear)

    def springs(self) -> ContactMemory:
        """The same with the shear forces with which the next step begins."""
        return self.renewed(self.pairs, np.column_stack([self.forces[:, 0], self.shear]), self.places)
