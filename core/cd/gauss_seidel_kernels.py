"""Kernel of the nonsmooth Gauss-Seidel sweep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd._jit import inline_kernel, kernel
from ninedisk.core.cd.cone_kernels import project_on_cone, solve_associated_contact, solve_coulomb_contact
from ninedisk.core.cd.contact_kernels import add_contact_force, contact_velocity

Floats = NDArray[np.float64]


FEWEST = 2
"""Sweeps between two measurements at the start: on few contacts a measurement costs as much as some sweeps."""


@inline_kernel
def next_batch(done: int) -> int:
    """Sweeps until the next measurement: it costs about one and sets v anew from r; the distance grows with the number of sweeps."""
    return max(FEWEST, done // 4)


@kernel
def sweep(
    bodies: NDArray[np.int32],
    normal: Floats,
    arms: Floats,
    inverse_mass: Floats,
    offset: Floats,
    compliance: Floats,
    shear_0: Floats,
    mu: Floats,
    blocks: Floats,
    relaxation: float,
    coulomb: bool,
    count: int,
    v: Floats,
    r: Floats,
) -> float:
    """``count`` sweeps over all contacts; each contact is solved exactly with the others held fixed.

    Parameters
    ----------
    bodies, normal, arms, inverse_mass, offset, compliance, shear_0, mu, blocks
        As in `ContactProblem`.
    relaxation : float
        The change of a contact's force is multiplied by this and projected back on the cone.
    coulomb : bool
        Coulomb's law instead of the associated rule.
    count : int
    v : ndarray, shape (b, 3)
        Velocities ``M^-1 (f + H' r)``, kept up to date.
    r : ndarray, shape (c, 2)
        Contact forces, updated in place.

    Returns
    -------
    float
        Largest change of a force in the last sweep, as a contact velocity: ``|dr| W_nn``.

    Notes
    -----
    Nonsmooth Gauss-Seidel: M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Engrg. 177
    (1999) 235-257.
    """
    change = 0.0
    for _ in range(count):
        change = 0.0
        for k in range(bodies.shape[0]):
            p, q = r[k, 0], r[k, 1]
            un, ut = contact_velocity(k, bodies, normal, arms, v)
            un += offset[k, 0] + compliance[k, 0] * p
            ut += offset[k, 1] + compliance[k, 1] * (q - shear_0[k])
            w_nn, w_nt, w_tt = blocks[k, 0], blocks[k, 1], blocks[k, 2]
            bn = un - w_nn * p - w_nt * q
            bt = ut - w_nt * p - w_tt * q
            if coulomb:
                p_new, q_new = solve_coulomb_contact(w_nn, w_nt, w_tt, bn, bt, mu[k])
            else:
                p_new, q_new = solve_associated_contact(w_nn, w_nt, w_tt, bn, bt, mu[k])
            if relaxation != 1.0:
                p_new, q_new = project_on_cone(p + relaxation * (p_new - p), q + relaxation * (q_new - q), mu[k])
            dp, dq = p_new - p, q_new - q
            if dp != 0.0 or dq != 0.0:
                r[k, 0], r[k, 1] = p_new, q_new
                add_contact_force(k, dp, dq, bodies, normal, arms, inverse_mass, v)
                change = max(change, w_nn * (abs(dp) + abs(dq)))
    return change
