"""Sparse Cholesky-type factorisation with a symbolic part that is reused: our own, or qdldl to check it."""

from __future__ import annotations

from typing import Any, Protocol

import numba
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.cd.solvers.cholesky import SupernodalCholesky

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class _Backend(Protocol):
    def update(self, data: FloatArray) -> bool: ...

    def solve(self, right: FloatArray) -> FloatArray: ...


class Factorisation:
    """Factors of symmetric positive definite matrices of one sparsity pattern.

    Parameters
    ----------
    indptr, indices : ndarray of int
        Compressed columns of the upper triangle, diagonal included, rows ascending, in complete blocks of 3 x 3.
    kind : {"auto", "supernodal", "qdldl"}
        "auto": supernodal, the faster one at all sizes, unless Numba is told not to compile: its vectors are machine code, without
        a form that could be interpreted. qdldl checks it.
    """

    def __init__(self, indptr: IntArray, indices: IntArray, kind: str = "auto") -> None:
        interpreted = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]
        self.kind = ("qdldl" if interpreted else "supernodal") if kind == "auto" else kind
        self._pattern = indptr, indices
        qdldl = self.kind == "qdldl"
        self._backend: _Backend = _Qdldl(indptr, indices) if qdldl else SupernodalCholesky(indptr, indices)

    def __reduce__(self) -> tuple[type[Factorisation], tuple[IntArray, IntArray, str]]:
        # A copy begins with the pattern: factors are machine objects and views, and every solution begins with `update`.
        return Factorisation, (*self._pattern, self.kind)

    def update(self, data: FloatArray) -> bool:
        """Factorise the matrix with these entries; False if it is not positive definite to round-off."""
        return self._backend.update(data)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve with the last factorisation."""
        return self._backend.solve(right)


class _Qdldl:
    def __init__(self, indptr: IntArray, indices: IntArray) -> None:
        n = len(indptr) - 1
        # The kind that qdldl takes as it is: conversions cost more than the factorisation of a small matrix.
        self._matrix = sp.csc_matrix((np.ones(len(indices)), indices, indptr), shape=(n, n))
        self._solver: Any = None

    def update(self, data: FloatArray) -> bool:
        import qdldl

        if not np.isfinite(data).all():
            return False
        self._matrix.data[:] = data
        try:
            if self._solver is None:
                self._solver = qdldl.Solver(self._matrix, upper=True)
            else:
                self._solver.update(self._matrix, upper=True)
        except (RuntimeError, ValueError):
            self._solver = None
            return False
        return True

    def solve(self, right: FloatArray) -> FloatArray:
        solution: FloatArray = self._solver.solve(right)
        return solution
