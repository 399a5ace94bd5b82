"""Contact forces from step to step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class ContactMemory:
    """Forces of the last step by pair: the shear springs' state and the solvers' warm start.

    Parameters
    ----------
    n_bodies : int
        Disks and walls.
    pairs : ndarray of int64, shape (c, 2)
        In ascending order.
    forces : ndarray, shape (c, 2)
        Normal and shear forces ``(p, q)`` [N].
    """

    def __init__(self, n_bodies: int, pairs: IntArray, forces: FloatArray) -> None:
        self._n = n_bodies
        self.pairs, self.forces = pairs, forces
        self._keys = pairs[:, 0] * n_bodies + pairs[:, 1]

    def of(self, pairs: IntArray) -> FloatArray:
        """Forces of these pairs, shape (c, 2); 0 where there was no contact."""
        found = np.zeros((len(pairs), 2))
        if len(self._keys) and len(pairs):
            keys = pairs[:, 0] * self._n + pairs[:, 1]
            at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
            known = self._keys[at] == keys
            found[known] = self.forces[at[known]]
        return found

    def same(self, pairs: IntArray, others: IntArray) -> NDArray[np.bool_]:
        """Which of the pairs are among the others, shape (c,)."""
        return np.isin(pairs[:, 0] * self._n + pairs[:, 1], others[:, 0] * self._n + others[:, 1])

    def renewed(self, pairs: IntArray, forces: FloatArray) -> ContactMemory:
        """Memory of the next step."""
        return ContactMemory(self._n, pairs, forces)
