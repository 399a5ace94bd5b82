"""Sparse Cholesky-type factorisation with a symbolic part that is reused: our own, qdldl, or MKL PARDISO where installed."""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ninedisk.core.cd.cholesky import SupernodalCholesky
from ninedisk.core.errors import InvalidNumericsError

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
    kind : {"auto", "supernodal", "qdldl", "pardiso"}
        "auto": supernodal, the fastest at all sizes; the others check it.

    Raises
    ------
    InvalidNumericsError
        If PARDISO is asked for and not installed.
    """

    def __init__(self, indptr: IntArray, indices: IntArray, kind: str = "auto") -> None:
        if kind == "pardiso" and _pardiso() is None:
            raise InvalidNumericsError("factoriser 'pardiso' is not installed: pip install pypardiso, or use 'qdldl'")
        self.kind = "supernodal" if kind == "auto" else kind
        made: dict[str, type[SupernodalCholesky | _Qdldl | _Pardiso]] = {
            "supernodal": SupernodalCholesky,
            "qdldl": _Qdldl,
            "pardiso": _Pardiso,
        }
        self._backend: _Backend = made[self.kind](indptr, indices)

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


class _Pardiso:
    """MKL PARDISO reads the upper triangle by rows.

    With the unknowns in reverse order the upper triangle by columns becomes the lower one by columns, which is the upper
    one by rows: all arrays are used back to front.
    """

    _POSITIVE_DEFINITE, _ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 2, 11, 22, 33, -1

    def __init__(self, indptr: IntArray, indices: IntArray) -> None:
        module = _pardiso()
        n, entries = len(indptr) - 1, len(indices)
        self._error = module.PyPardisoError
        self._solver = module.PyPardisoSolver(mtype=self._POSITIVE_DEFINITE)
        self._matrix = sp.csr_matrix(
            (np.zeros(entries), n - 1 - indices[::-1], entries - indptr[::-1]), shape=(n, n), copy=True
        )
        self._empty = np.zeros((n, 1))
        self._analysed = False

    def _run(self, phase: int, right: FloatArray) -> FloatArray:
        self._solver.set_phase(phase)
        result: FloatArray = self._solver._call_pardiso(self._matrix, right)
        return result

    def update(self, data: FloatArray) -> bool:
        if not np.isfinite(data).all():
            return False
        self._matrix.data[:] = data[::-1]
        try:
            if not self._analysed:
                self._run(self._ANALYSE, self._empty)
                self._analysed = True
            self._run(self._FACTORISE, self._empty)
        except self._error:
            return False
        return True

    def solve(self, right: FloatArray) -> FloatArray:
        return np.ascontiguousarray(self._run(self._SOLVE, np.asfortranarray(right[::-1, None]))[::-1, 0])

    def __del__(self) -> None:
        if getattr(self, "_analysed", False):
            self._run(self._RELEASE, self._empty)


@cache
def _pardiso() -> Any:
    """The module ``pypardiso``, or None where it or its MKL is missing."""
    try:
        import pypardiso
        import pypardiso.pardiso_wrapper as wrapper
    except (ImportError, OSError):
        return None
    del pypardiso
    return wrapper
