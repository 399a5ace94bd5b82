"""Kernel of the nonsmooth Gauss-Seidel sweep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.cd.cone_kernels import project_on_cone, solve_associated_contact, solve_coulomb_contact
from ninedisk.core.cd.problem_kernels import add_contact_force, contact_velocity
from ninedisk.core.cd.solvers.stripe_kernels import (
    ARM_NI,
    ARM_NJ,
    ARM_TI,
    ARM_TJ,
    C_N,
    C_T,
    G_N,
    G_T,
    MU,
    NX,
    NY,
    W_NN,
    W_NT,
    W_TT,
    P,
    Q,
)
from ninedisk.core.threads import wait_for_all

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


FEWEST = 2
"""Sweeps between two measurements at the start: on few contacts a measurement costs as much as some sweeps."""


@inline_kernel
def next_batch(done: int) -> int:
    """Sweeps until the next measurement: it costs about one and sets v anew from r; the distance grows with the number of sweeps."""
    return max(FEWEST, done // 4)


@inline_kernel
def _solve_contact(
    un: float,
    ut: float,
    p: float,
    q: float,
    w_nn: float,
    w_nt: float,
    w_tt: float,
    mu: float,
    relaxation: float,
    coulomb: bool,
) -> tuple[float, float]:
    """New force of a contact with the block ``w`` that has the velocity ``(un, ut)`` under the force ``(p, q)``."""
    bn = un - w_nn * p - w_nt * q
    bt = ut - w_nt * p - w_tt * q
    if coulomb:
        p_new, q_new = solve_coulomb_contact(w_nn, w_nt, w_tt, bn, bt, mu)
    else:
        p_new, q_new = solve_associated_contact(w_nn, w_nt, w_tt, bn, bt, mu)
    if relaxation != 1.0:
        return project_on_cone(p + relaxation * (p_new - p), q + relaxation * (q_new - q), mu)
    return p_new, q_new


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
) -> None:
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

    Notes
    -----
    Nonsmooth Gauss-Seidel: M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Engrg. 177
    (1999) 235-257.
    """
    for _ in range(count):
        for k in range(bodies.shape[0]):
            p, q = r[k, 0], r[k, 1]
            un, ut = contact_velocity(k, bodies, normal, arms, v)
            un += offset[k, 0] + compliance[k, 0] * p
            ut += offset[k, 1] + compliance[k, 1] * (q - shear_0[k])
            p_new, q_new = _solve_contact(
                un, ut, p, q, blocks[k, 0], blocks[k, 1], blocks[k, 2], mu[k], relaxation, coulomb
            )
            dp, dq = p_new - p, q_new - q
            if dp != 0.0 or dq != 0.0:
                r[k, 0], r[k, 1] = p_new, q_new
                add_contact_force(k, dp, dq, bodies, normal, arms, inverse_mass, v)


@kernel
def sweep_stripes(
    me: int,
    crew: int,
    flags: NDArray[np.int64],
    bounds: Ints,
    pairs: Ints,
    inverse_mass: Floats,
    relaxation: float,
    coulomb: bool,
    count: int,
    v: Floats,
    rows: Floats,
) -> int:
    """The share of thread ``me`` of ``crew`` in ``count`` sweeps over stripes of contacts: first all even ones, then all odd ones.

    Stripes of one parity have no body in common, so the result is that of one thread.

    Parameters
    ----------
    flags : ndarray of int64
        Of `wait_for_all`.
    bounds, pairs, rows
        Of `stripe_kernels`; the forces in the rows are updated in place.
    inverse_mass, v : ndarray, shape (b, 3)
        As in `sweep`, by the bodies' numbers.
    relaxation, coulomb, count
        As in `sweep`.
    """
    stripes = bounds.shape[0] - 1
    low, high = stripes * me // crew, stripes * (me + 1) // crew
    wait_for_all(flags, me, crew)
    for _ in range(count):
        for parity in range(2):
            for s in range(low + (low + parity) % 2, high, 2):
                for m in range(bounds[s], bounds[s + 1]):
                    _sweep_row(m, pairs, inverse_mass, relaxation, coulomb, v, rows)
            wait_for_all(flags, me, crew)
    return 0


@inline_kernel
def _sweep_row(
    m: int, pairs: Ints, inverse_mass: Floats, relaxation: float, coulomb: bool, v: Floats, rows: Floats
) -> None:
    i, j = pairs[m, 0], pairs[m, 1]
    nx, ny, p, q = rows[m, NX], rows[m, NY], rows[m, P], rows[m, Q]
    un, ut = rows[m, G_N] + rows[m, C_N] * p, rows[m, G_T] + rows[m, C_T] * q
    if i >= 0:
        un += -nx * v[i, 0] - ny * v[i, 1] + rows[m, ARM_NI] * v[i, 2]
        ut += -ny * v[i, 0] + nx * v[i, 1] + rows[m, ARM_TI] * v[i, 2]
    if j >= 0:
        un += nx * v[j, 0] + ny * v[j, 1] + rows[m, ARM_NJ] * v[j, 2]
        ut += ny * v[j, 0] - nx * v[j, 1] + rows[m, ARM_TJ] * v[j, 2]
    p_new, q_new = _solve_contact(
        un, ut, p, q, rows[m, W_NN], rows[m, W_NT], rows[m, W_TT], rows[m, MU], relaxation, coulomb
    )
    dp, dq = p_new - p, q_new - q
    if dp == 0.0 and dq == 0.0:
        return
    rows[m, P], rows[m, Q] = p_new, q_new
    fx, fy = -nx * dp - ny * dq, -ny * dp + nx * dq
    if i >= 0:
        v[i, 0] += inverse_mass[i, 0] * fx
        v[i, 1] += inverse_mass[i, 1] * fy
        v[i, 2] += inverse_mass[i, 2] * (rows[m, ARM_NI] * dp + rows[m, ARM_TI] * dq)
    if j >= 0:
        v[j, 0] -= inverse_mass[j, 0] * fx
        v[j, 1] -= inverse_mass[j, 1] * fy
        v[j, 2] += inverse_mass[j, 2] * (rows[m, ARM_NJ] * dp + rows[m, ARM_TJ] * dq)
