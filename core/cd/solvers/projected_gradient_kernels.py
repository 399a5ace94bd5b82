"""Kernel of the accelerated projected-gradient method."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.problem_kernels import add_contact_force, contact_velocity, project_on_cone
from ninedisk.core.compile import kernel

Floats = NDArray[np.float64]

SLOPE, LENGTH, CURVATURE = range(3)


@kernel
def gradient_step(
    bodies: NDArray[np.int32],
    normal: Floats,
    arms: Floats,
    inverse_mass: Floats,
    mass: Floats,
    offset: Floats,
    compliance: Floats,
    shear_0: Floats,
    mu: Floats,
    rho: Floats,
    lipschitz: float,
    r_old: Floats,
    y: Floats,
    v_y: Floats,
    r_new: Floats,
    v_new: Floats,
    sums: Floats,
) -> None:
    """``r_new = P(y - rho u(y) / L)`` in the metric ``diag(rho)^-1``, and its velocities.

    Parameters
    ----------
    bodies, normal, arms, inverse_mass, offset, compliance, shear_0, mu, rho
        As in `ContactProblem`.
    mass : ndarray, shape (b, 3)
        Masses, 0 for blocked unknowns.
    lipschitz : float
        Estimate L of the largest eigenvalue of ``rho^1/2 W rho^1/2``.
    r_old : ndarray, shape (c, 2)
        Iterate before, for the restart test.
    y, v_y : ndarray, shapes (c, 2) and (b, 3)
        Extrapolated forces and their velocities ``M^-1 (f + H' y)``.
    r_new, v_new : ndarray
        Out.
    sums : ndarray, shape (3,)
        Out: ``SLOPE`` ``u(y) . (r_new - r_old)``, ``LENGTH`` ``|r_new - y|^2`` in the metric, ``CURVATURE``
        ``(r_new - y)' W (r_new - y)``.
    """
    for m in range(3):
        sums[m] = 0.0
    for i in range(v_y.shape[0]):
        for d in range(3):
            v_new[i, d] = v_y[i, d]
    for k in range(bodies.shape[0]):
        p, q = y[k, 0], y[k, 1]
        un, ut = contact_velocity(k, bodies, normal, arms, v_y)
        un += offset[k, 0] + compliance[k, 0] * p
        ut = ut + offset[k, 1] + compliance[k, 1] * (q - shear_0[k]) if mu[k] > 0.0 else 0.0
        step = rho[k] / lipschitz
        p_new, q_new = project_on_cone(p - step * un, q - step * ut, mu[k])
        r_new[k, 0], r_new[k, 1] = p_new, q_new
        sums[SLOPE] += un * (p_new - r_old[k, 0]) + ut * (q_new - r_old[k, 1])
        dp, dq = p_new - p, q_new - q
        if dp != 0.0 or dq != 0.0:
            add_contact_force(k, dp, dq, bodies, normal, arms, inverse_mass, v_new)
            sums[LENGTH] += (dp * dp + dq * dq) / rho[k]
            sums[CURVATURE] += compliance[k, 0] * dp * dp + compliance[k, 1] * dq * dq
    for i in range(v_y.shape[0]):
        for d in range(3):
            dv = v_new[i, d] - v_y[i, d]
            sums[CURVATURE] += mass[i, d] * dv * dv


@kernel
def iterate(
    bodies: NDArray[np.int32],
    normal: Floats,
    arms: Floats,
    inverse_mass: Floats,
    mass: Floats,
    offset: Floats,
    compliance: Floats,
    shear_0: Floats,
    mu: Floats,
    rho: Floats,
    count: int,
    r: Floats,
    v: Floats,
    r_work: Floats,
    v_work: Floats,
    y: Floats,
    v_y: Floats,
    state: Floats,
    sums: Floats,
) -> None:
    """``count`` accelerated steps with adaptive L and restarts.

    Parameters
    ----------
    bodies .. rho
        As in `gradient_step`.
    r, v : ndarray, shapes (c, 2) and (b, 3)
        Forces and their velocities, updated in place.
    r_work, v_work : ndarray
        Work arrays of the same shapes.
    y, v_y : ndarray
        Extrapolated point, kept between calls.
    state : ndarray, shape (2,)
        Momentum parameter t and Lipschitz estimate L, kept between calls.
    sums : ndarray, shape (3,)
        Work array.

    Notes
    -----
    Y. Nesterov, Soviet Math. Dokl. 27 (1983) 372-376; restarts on an uphill step: B. O'Donoghue and E. Candes, Found.
    Comput. Math. 15 (2015) 715-732; for contact: H. Mazhar et al., ACM Trans. Graph. 34 (2015) 32.
    """
    for _ in range(count):
        while True:
            gradient_step(
                bodies, normal, arms, inverse_mass, mass, offset, compliance, shear_0, mu, rho, state[1], r, y, v_y,
                r_work, v_work, sums,
            )  # fmt: skip
            # The quadratic is below its majorant if the curvature along the step does not exceed L.
            # Written so that a step that is not finite ends the search, too.
            if not sums[CURVATURE] > state[1] * sums[LENGTH] * (1.0 + 1e-12):
                break
            state[1] = max(1.2 * state[1], sums[CURVATURE] / sums[LENGTH])
        if sums[SLOPE] > 0.0:
            state[0] = 1.0
            beta = 0.0
        else:
            t = 0.5 * (1.0 + (1.0 + 4.0 * state[0] * state[0]) ** 0.5)
            beta = (state[0] - 1.0) / t
            state[0] = t
        for k in range(r.shape[0]):
            for m in range(2):
                y[k, m] = r_work[k, m] + beta * (r_work[k, m] - r[k, m])
                r[k, m] = r_work[k, m]
        for i in range(v.shape[0]):
            for d in range(3):
                v_y[i, d] = v_work[i, d] + beta * (v_work[i, d] - v[i, d])
                v[i, d] = v_work[i, d]
        # A little optimism, so that one unlucky step does not shorten all later ones; the scaled diagonal is 1, so L is not less.
        state[1] = max(1.0, 0.99 * state[1])
