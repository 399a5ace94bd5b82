"""Kernel of Lemke's method on a dense tableau."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd._jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SOLVED, RAY, ENDED = range(3)
"""How the method ends: in a solution, in a ray without one, or at its limit of pivots."""

TIE = 1e-11
"""Relative difference of two ratios below which they are one: entries of a scaled tableau are of order 1 and keep some 12 digits."""
PIVOT = 1e-11
"""Entries below this are round-off of zero."""


@kernel
def lemke(t: Floats, names: Ints, row_of: Ints, column_of: Ints, limit: int) -> tuple[int, int]:
    """Solve ``w = q + M z``, ``w, z >= 0``, ``w z = 0`` by pivots; how it ended, and after how many.

    Parameters
    ----------
    t : ndarray, shape (n, n + 2)
        The dictionary ``basic = t[:, n + 1] + t[:, :n + 1] nonbasic``, at first ``[M, d, q]`` with the covering vector ``d > 0``;
        it is worked on in place. At the end its last column holds the basic variables.
    names : ndarray, shape (2 n + 1,)
        Variables of the rows, then of the columns. Set here.
    row_of, column_of : ndarray, shape (2 n + 1,)
        Row of each variable that is basic, column of each that is not, else -1; variables are ``w``, then ``z``, then the
        artificial one. Set here.
    limit : int
        Pivots at most.

    Notes
    -----
    C. E. Lemke, "Bimatrix equilibrium points and mathematical programming", Management Sci. 11 (1965) 681-689. Ties are broken by
    the lexicographic rule, ``q`` counting as ``q + (s, s^2, ..)`` with s small, so that no basis comes twice (R. W. Cottle, J.-S. Pang,
    R. E. Stone, "The linear complementarity problem", 1992, section 4.9): what s^j multiplies in a row is minus the entry of the column
    of w_j where that is not basic, else 1 in its own row and 0 in the others.
    """
    n = t.shape[0]
    rhs, artificial = n + 1, 2 * n
    in_row, in_column = names[:n], names[n:]
    for variable in range(2 * n + 1):
        names[variable] = variable
        row_of[variable] = variable if variable < n else -1
        column_of[variable] = variable - n if variable >= n else -1
    row = 0
    for i in range(1, n):
        # At equal ratios the later row is lower by the lexicographic rule: s^i falls with i.
        if t[i, rhs] * t[row, n] <= t[row, rhs] * t[i, n]:
            row = i
    if t[row, rhs] >= 0.0:
        return SOLVED, 0
    column = n
    for done in range(1, limit + 1):
        leaving, entering = in_row[row], in_column[column]
        _pivot(t, row, column)
        in_row[row], in_column[column] = entering, leaving
        row_of[entering], row_of[leaving] = row, -1
        column_of[leaving], column_of[entering] = column, -1
        if leaving == artificial:
            return SOLVED, done
        column = column_of[leaving + n if leaving < n else leaving - n]
        row = _leaving_row(t, column, row_of, column_of)
        if row < 0:
            return RAY, done
    return ENDED, limit


@kernel
def _pivot(t: Floats, row: int, column: int) -> None:
    """Exchange the basic variable of a row and the nonbasic one of a column."""
    inverse = 1.0 / t[row, column]
    width = t.shape[1]
    for c in range(width):
        t[row, c] *= -inverse
    t[row, column] = inverse
    for i in range(t.shape[0]):
        factor = t[i, column]
        if i == row or factor == 0.0:
            continue
        t[i, column] = 0.0
        for c in range(width):
            t[i, c] += factor * t[row, c]


@kernel
def _leaving_row(t: Floats, column: int, row_of: Ints, column_of: Ints) -> int:
    """Row whose basic variable first falls to zero as the column's variable grows; -1 if none falls."""
    n = t.shape[0]
    rhs, artificial = n + 1, row_of[2 * n]
    best, best_ratio = -1, np.inf
    for i in range(n):
        if t[i, column] < -PIVOT:
            ratio = max(t[i, rhs], 0.0) / -t[i, column]
            if best < 0 or ratio < best_ratio - TIE * max(1.0, best_ratio):
                best, best_ratio = i, ratio
            elif ratio <= best_ratio + TIE * max(1.0, best_ratio):
                if best == artificial:
                    continue
                if i == artificial or _lower(t, i, best, column, row_of, column_of):
                    best, best_ratio = i, min(ratio, best_ratio)
    return best


@kernel
def _lower(t: Floats, i: int, k: int, column: int, row_of: Ints, column_of: Ints) -> bool:
    """Whether row i comes before row k among rows of equal ratio."""
    n = t.shape[0]
    for j in range(n):
        own = row_of[j]
        if own >= 0:
            one, other = 1.0 if own == i else 0.0, 1.0 if own == k else 0.0
        else:
            one, other = -t[i, column_of[j]], -t[k, column_of[j]]
        difference = one / -t[i, column] - other / -t[k, column]
        if abs(difference) > TIE * max(1.0, abs(one / t[i, column])):
            return bool(difference < 0.0)
    return False
