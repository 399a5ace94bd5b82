"""Kernels of the interior-point method on the two rays of each friction cone.

In two dimensions the cone ``|q| <= mu p`` is spanned by the rays (1, mu) and (1, -mu): ``p = a_0 + a_1``,
``q = mu (a_0 - a_1)`` with ``a >= 0``, and its dual is ``s_0 = u_n + mu u_t >= 0``, ``s_1 = u_n - mu u_t >= 0``. The convex
program is thus one with bounds only, and its optimality conditions are ``a s = 0`` ray by ray. A smooth contact
(``mu = 0``) has the one ray (1, 0): its second ray is left out everywhere.

Eliminating ``ds = (t - s da)/a`` and ``da`` from Newton's equations leaves the body-space matrix ``M + H' D H`` with

    D = G E^-1 G',   E = G' C G + diag(e),   e = s/a (bounded from below),   G = [[1, 1], [mu, -mu]]

The closed forms below have no differences of like numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd._jit import inline_kernel, kernel

Floats = NDArray[np.float64]


@inline_kernel
def determinant(mu: float, cn: float, ct: float, e0: float, e1: float) -> float:
    """Determinant of ``E`` for one contact with friction."""
    tangential = mu * mu * ct
    return 4.0 * cn * tangential + (cn + tangential) * (e0 + e1) + e0 * e1


@kernel
def stiffness_blocks(mu: Floats, compliance: Floats, e: Floats, d: Floats) -> None:
    """``D = G E^-1 G'``, as ``(D_nn, D_nt, D_tt)``, shape (c, 3), of the ray compliances ``e``, shape (c, 2)."""
    for k in range(mu.shape[0]):
        m, cn, ct = mu[k], compliance[k, 0], compliance[k, 1]
        if m == 0.0:
            d[k, 0], d[k, 1], d[k, 2] = 1.0 / (cn + e[k, 0]), 0.0, 0.0
        else:
            det = determinant(m, cn, ct, e[k, 0], e[k, 1])
            both = e[k, 0] + e[k, 1]
            d[k, 0] = (4.0 * m * m * ct + both) / det
            d[k, 1] = m * (e[k, 1] - e[k, 0]) / det
            d[k, 2] = m * m * (4.0 * cn + both) / det


@kernel
def ray_slacks(mu: Floats, u: Floats, s: Floats) -> None:
    """``s = G' u``, shape (c, 2); 1 for the second ray of a smooth contact."""
    for k in range(mu.shape[0]):
        s[k, 0] = u[k, 0] + mu[k] * u[k, 1]
        s[k, 1] = u[k, 0] - mu[k] * u[k, 1] if mu[k] > 0.0 else 1.0


@kernel
def forces_of_rays(mu: Floats, a: Floats, r: Floats) -> None:
    """``r = G a``, shape (c, 2)."""
    for k in range(mu.shape[0]):
        if mu[k] == 0.0:
            r[k, 0], r[k, 1] = a[k, 0], 0.0
        else:
            r[k, 0], r[k, 1] = a[k, 0] + a[k, 1], mu[k] * (a[k, 0] - a[k, 1])


@kernel
def condense(mu: Floats, compliance: Floats, e: Floats, z: Floats, r: Floats) -> None:
    """``r = G E^-1 z``, shape (c, 2): contact forces that the ray velocities ``z`` call for."""
    for k in range(mu.shape[0]):
        m, cn, ct = mu[k], compliance[k, 0], compliance[k, 1]
        if m == 0.0:
            r[k, 0], r[k, 1] = z[k, 0] / (cn + e[k, 0]), 0.0
        else:
            det = determinant(m, cn, ct, e[k, 0], e[k, 1])
            tangential = 2.0 * m * m * ct
            r[k, 0] = ((tangential + e[k, 1]) * z[k, 0] + (tangential + e[k, 0]) * z[k, 1]) / det
            r[k, 1] = m * ((2.0 * cn + e[k, 1]) * z[k, 0] - (2.0 * cn + e[k, 0]) * z[k, 1]) / det


@kernel
def expand(mu: Floats, compliance: Floats, e: Floats, z: Floats, du: Floats, da: Floats) -> None:
    """``da = E^-1 (z - G' du)``, shape (c, 2), with ``du = H dv`` the change of the contact velocities."""
    for k in range(mu.shape[0]):
        m, cn, ct = mu[k], compliance[k, 0], compliance[k, 1]
        z0 = z[k, 0] - du[k, 0] - m * du[k, 1]
        if m == 0.0:
            da[k, 0], da[k, 1] = z0 / (cn + e[k, 0]), 0.0
        else:
            z1 = z[k, 1] - du[k, 0] + m * du[k, 1]
            det = determinant(m, cn, ct, e[k, 0], e[k, 1])
            plus, minus = cn + m * m * ct, cn - m * m * ct
            da[k, 0] = ((plus + e[k, 1]) * z0 - minus * z1) / det
            da[k, 1] = ((plus + e[k, 0]) * z1 - minus * z0) / det


@kernel
def longest_step(mu: Floats, a: Floats, s: Floats, da: Floats, ds: Floats) -> tuple[float, float]:
    """Largest steps up to 1 that keep the rays ``a`` and slacks ``s`` non-negative."""
    primal = dual = 1.0
    for k in range(mu.shape[0]):
        for m in range(2 if mu[k] > 0.0 else 1):
            if da[k, m] < 0.0:
                primal = min(primal, -a[k, m] / da[k, m])
            if ds[k, m] < 0.0:
                dual = min(dual, -s[k, m] / ds[k, m])
    return primal, dual
