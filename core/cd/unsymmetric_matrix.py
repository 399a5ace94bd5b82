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
        self._mass = np.where(problem.free > 0.0, problem.mass, 1.0).ravel()
        self._shape = (2 * problem.n_contacts, 2 * problem.n_contacts)
        self._place = np.arange(3 * problem.n_bodies)
        # One ordering for all factorisations: the graph does not change.
        lu = _factors(
            self._made(np.tile(np.eye(2), (problem.n_contacts, 1, 1)) * problem.rho[:, None, None]), "MMD_AT_PLUS_A"
        )
        self._place = np.argsort(lu.perm_c)
        self._lu: Any = None

    def _made(self, d: FloatArray) -> sp.csc_array:
        c = len(d)
        blocks = sp.bsr_array((d, np.arange(c), np.arange(c + 1)), shape=self._shape)
        k = sp.csc_array(self.h.T @ (blocks @ self.h) + sp.diags_array(self._mass))
        ordered = sp.csc_array(k[self._place][:, self._place])
        ordered.sort_indices()
        return ordered

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


def _factors(matrix: sp.csc_array, order: str) -> Any:
    import scipy.sparse.linalg as linalg

    # The solver takes 32-bit indices.
    narrow = sp.csc_matrix(
        (matrix.data, matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)), shape=matrix.shape
    )
    solver: Any = linalg.splu
    return solver(narrow, permc_spec=order, diag_pivot_thresh=PIVOT, options={"SymmetricMode": True})
