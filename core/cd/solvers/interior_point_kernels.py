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

from ninedisk.core.cd.problem_kernels import Contacts, add_contact_force, contact_velocity
from ninedisk.core.compile import inline_kernel, kernel

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


@inline_kernel
def condense(mu: float, cn: float, ct: float, e0: float, e1: float, z0: float, z1: float) -> tuple[float, float]:
    """``r = G E^-1 z``: contact force that the ray velocities ``z`` of one contact call for."""
    if mu == 0.0:
        return z0 / (cn + e0), 0.0
    det = determinant(mu, cn, ct, e0, e1)
    tangential = 2.0 * mu * mu * ct
    p = ((tangential + e1) * z0 + (tangential + e0) * z1) / det
    return p, mu * ((2.0 * cn + e1) * z0 - (2.0 * cn + e0) * z1) / det


@inline_kernel
def expand(mu: float, cn: float, ct: float, e0: float, e1: float, z0: float, z1: float) -> tuple[float, float]:
    """``E^-1 z`` of one contact; 0 for the second ray of a smooth one."""
    if mu == 0.0:
        return z0 / (cn + e0), 0.0
    det = determinant(mu, cn, ct, e0, e1)
    plus, minus = cn + mu * mu * ct, cn - mu * mu * ct
    return ((plus + e1) * z0 - minus * z1) / det, ((plus + e0) * z1 - minus * z0) / det


@kernel
def load_of_target(
    contacts: Contacts,
    free: Floats,
    e: Floats,
    a: Floats,
    error_u: Floats,
    error_v: Floats,
    target: Floats,
    z: Floats,
    load: Floats,
) -> None:
    """Right-hand side of a Newton step: ``z = error_u + target/a`` and ``load = error_v + H' G E^-1 z``.

    Parameters
    ----------
    contacts, free
        As in `ContactProblem`.
    e, a, error_u, target : ndarray, shape (c, 2)
        Compliances and values of the rays, errors of the slacks, wanted changes of the products ``a s``.
    error_v : ndarray, shape (b, 3)
        Errors of the bodies' balances of momentum.
    z, load : ndarray, shapes (c, 2) and (b, 3)
        Out.
    """
    bodies, normal, arms, mu, compliance = contacts
    for i in range(load.shape[0]):
        for d in range(3):
            load[i, d] = error_v[i, d]
    for k in range(bodies.shape[0]):
        z[k, 0] = error_u[k, 0] + target[k, 0] / a[k, 0]
        z[k, 1] = error_u[k, 1] + target[k, 1] / a[k, 1]
        p, q = condense(mu[k], compliance[k, 0], compliance[k, 1], e[k, 0], e[k, 1], z[k, 0], z[k, 1])
        add_contact_force(k, p, q, bodies, normal, arms, free, load)


@kernel
def changes_of_rays(
    contacts: Contacts,
    e: Floats,
    a: Floats,
    ratio: Floats,
    z: Floats,
    target: Floats,
    dv: Floats,
    da: Floats,
    ds: Floats,
) -> None:
    """``da = E^-1 (z - G' H dv)`` and ``ds = target/a - ratio da`` of the change ``dv`` of the bodies' velocities.

    Arguments as in `load_of_target`; ``ratio = s/a``; ``da`` and ``ds``, shape (c, 2), are the result.
    """
    bodies, normal, arms, mu, compliance = contacts
    for k in range(bodies.shape[0]):
        un, ut = contact_velocity(k, bodies, normal, arms, dv)
        m = mu[k]
        z0, z1 = z[k, 0] - un - m * ut, z[k, 1] - un + m * ut
        da[k, 0], da[k, 1] = expand(m, compliance[k, 0], compliance[k, 1], e[k, 0], e[k, 1], z0, z1)
        ds[k, 0] = target[k, 0] / a[k, 0] - ratio[k, 0] * da[k, 0]
        ds[k, 1] = target[k, 1] / a[k, 1] - ratio[k, 1] * da[k, 1] if m > 0.0 else 0.0


@kernel
def longest_step(
    mu: Floats, a: Floats, s: Floats, da: Floats, ds: Floats, more_a: Floats, more_s: Floats, weight: float
) -> float:
    """Largest step up to 1 along ``(da, ds) + weight (more_a, more_s)`` that keeps rays ``a`` and slacks ``s`` non-negative."""
    step = 1.0
    for k in range(mu.shape[0]):
        for m in range(2 if mu[k] > 0.0 else 1):
            change_a = da[k, m] + weight * more_a[k, m]
            change_s = ds[k, m] + weight * more_s[k, m]
            if -change_a * step > a[k, m]:
                step = -a[k, m] / change_a
            if -change_s * step > s[k, m]:
                step = -s[k, m] / change_s
    return step


@kernel
def mean_product(mu: Floats, a: Floats, s: Floats, da: Floats, ds: Floats, step: float) -> float:
    """Mean of ``(a + step da)(s + step ds)`` over all rays."""
    total, count = 0.0, 0
    for k in range(mu.shape[0]):
        for m in range(2 if mu[k] > 0.0 else 1):
            total += (a[k, m] + step * da[k, m]) * (s[k, m] + step * ds[k, m])
            count += 1
    return total / count


@kernel
def pull_to_centre(
    mu: Floats, a: Floats, s: Floats, da: Floats, ds: Floats, step: float, goal: float, spread: float, target: Floats
) -> None:
    """Changes that products off the interval from ``spread goal`` to ``goal/spread`` after a step need to come back (Gondzio 1996).

    ``target``, shape (c, 2), receives them, none below ``-goal/spread``.
    """
    low, high = spread * goal, goal / spread
    for k in range(mu.shape[0]):
        target[k, 1] = 0.0
        for m in range(2 if mu[k] > 0.0 else 1):
            product = (a[k, m] + step * da[k, m]) * (s[k, m] + step * ds[k, m])
            target[k, m] = max(min(max(product, low), high) - product, -high)
