"""The body-space matrix ``M + H' D H`` where D is not symmetric, as Coulomb's law makes it."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.cd.problem import ContactProblem

FloatArray = NDArray[np.float64]

PIVOT = 1e-3
"""Diagonal entries above this fraction of their column stay pivots: the matrix is nearly symmetric, and so its ordering holds."""


def times(d: FloatArray, z: FloatArray) -> FloatArray:
    """``d z`` contact by contact, shapes (c, 2, 2) and (c, 2)."""
    product: FloatArray = (d @ z[:, :, None])[:, :, 0]
    return product


class UnsymmetricMatrix:
    """``M + H' D H`` with blocks D that need not be symmetric, in an order that keeps its factors sparse."""

    def __init__(self, problem: ContactProblem) -> None:
        self.h = problem.jacobian()
        self._rows, self._unknowns = problem.rows()
        self._mass = np.where(problem.free > 0.0, problem.mass, 1.0).ravel()
        self._pattern(np.arange(3 * problem.n_bodies))
        # One ordering for all factorisations: the graph does not change.
        lu = _factors(self._made(np.eye(2) * problem.rho[:, None, None]), "MMD_AT_PLUS_A")
        self._pattern(np.asarray(lu.perm_c))
        self._lu: Any = None

    def _pattern(self, position: NDArray[np.integer[Any]]) -> None:
        """Places of the entries of all contacts and of the masses, for unknowns in these positions."""
        n, unknowns = len(position), position[self._unknowns]
        row = np.append(np.repeat(unknowns, 6, axis=1).ravel(), position)
        column = np.append(np.tile(unknowns, (1, 6)).ravel(), position)
        places, self._slot = np.unique(column.astype(np.int64) * n + row, return_inverse=True)
        self._indices = (places % n).astype(np.int32)
        self._indptr = np.searchsorted(places, n * np.arange(n + 1)).astype(np.int32)
        self._place = np.argsort(position)

    def _made(self, d: FloatArray) -> sp.csc_matrix:
        blocks = np.swapaxes(self._rows, 1, 2) @ (d @ self._rows)
        data = np.bincount(self._slot, np.append(blocks.ravel(), self._mass), len(self._indices))
        return sp.csc_matrix((data, self._indices, self._indptr), shape=(len(self._place),) * 2)

    def factorise(self, d: FloatArray) -> bool:
        """Factorise with the blocks ``d``, shape (c, 2, 2); False if that is impossible."""
        if not np.isfinite(d).all():
            return False
        self._matrix = self._made(d)
        try:
            self._lu = _factors(self._matrix, "NATURAL")
        except RuntimeError:
            return False
        return True

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve with the last factorisation and one refinement: pivots are not always the largest ones."""
        b = right[self._place]
        z = self._lu.solve(b)
        z += self._lu.solve(b - self._matrix @ z)
        out = np.empty(len(z))
        out[self._place] = z
        return out


def _factors(matrix: sp.csc_matrix, order: str) -> Any:
    import scipy.sparse.linalg as linalg

    solver: Any = linalg.splu
    return solver(matrix, permc_spec=order, diag_pivot_thresh=PIVOT, options={"SymmetricMode": True})
