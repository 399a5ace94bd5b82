"""Lemke's method for Coulomb's law: a last resort for small problems, that ends in a solution where one exists by its theory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.lemke_kernels import SOLVED, lemke
from ninedisk.core.cd.problem import ContactProblem

FloatArray = NDArray[np.float64]

PIVOTS = 10
"""Pivots for each contact, at most: the method needs 3 to 5 where its tableau keeps its digits."""


def solve_lemke(problem: ContactProblem) -> tuple[FloatArray | None, int]:
    """Solve Coulomb's law by pivots on a dense tableau, from nothing.

    In two dimensions the law is a linear complementarity problem in ``(p, q+, q-, s)`` of each contact, where ``q = q+ - q-`` and s is
    the slip::

        u_n >= 0,   u_t + s >= 0,   -u_t + s >= 0,   mu p - q+ - q- >= 0,

    each complementary to its unknown. Its matrix is copositive, so that the method ends in a solution where some motion satisfies
    the contacts (D. E. Stewart, J. C. Trinkle, Int. J. Numer. Methods Eng. 39 (1996) 2673-2691; J.-S. Pang, J. C. Trinkle, Math.
    Programming 73 (1996) 199-226) - but for round-off. Forces and velocities are scaled by ``sqrt(rho)``, so that contacts of light and
    heavy bodies compare.

    Returns
    -------
    r : ndarray, shape (c, 2), or None
        Forces, as exact as the tableau; None where the method ends in a ray, or at `PIVOTS`.
    pivots : int
    """
    c, rough = problem.n_contacts, np.flatnonzero(problem.mu > 0.0)
    m, n = len(rough), problem.n_contacts + 3 * len(rough)
    scale = np.sqrt(problem.rho)
    w = problem.delassus().toarray().reshape(c, 2, c, 2) * scale[:, None, None, None] * scale[None, None, :, None]
    b = problem.b * scale[:, None]
    size = float(np.abs(b).max())
    normal, plus, minus, slip = np.arange(c), c + np.arange(m), c + m + np.arange(m), c + 2 * m + np.arange(m)
    t = np.zeros((n, n + 2))
    t[np.ix_(normal, normal)] = w[:, 0, :, 0]
    for sign, at in ((1.0, plus), (-1.0, minus)):
        t[np.ix_(normal, at)] = sign * w[:, 0, rough, 1]
        t[np.ix_(at, normal)] = sign * w[rough, 1, :, 0]
        for other, to in ((1.0, plus), (-1.0, minus)):
            t[np.ix_(at, to)] = sign * other * w[rough][:, 1][:, rough, 1]
        t[at, slip] = 1.0
        t[slip, at] = -1.0
        t[at, -1] = sign * b[rough, 1] / size
    t[slip, rough] = problem.mu[rough]
    t[normal, -1] = b[:, 0] / size
    t[:, n] = 1.0
    names, row_of, column_of = np.empty((3, 2 * n + 1), dtype=np.int64)
    end, pivots = lemke(t, names, row_of, column_of, PIVOTS * c)
    if end != SOLVED:
        return None, pivots
    rows = row_of[n : 2 * n]
    z = np.where(rows >= 0, t[rows, -1], 0.0)
    r = np.zeros((c, 2))
    r[:, 0] = z[normal]
    r[rough, 1] = z[plus] - z[minus]
    return r * (scale * size)[:, None], pivots
