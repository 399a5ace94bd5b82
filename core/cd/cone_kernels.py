"""Kernels of the friction cone ``|q| <= mu p, p >= 0``: projection and the exact solution for one contact."""

from __future__ import annotations

from ninedisk.core.compile import inline_kernel

SINGULAR = 1e-14
"""Relative size below which the determinant of a 2 x 2 block is round-off."""


@inline_kernel
def project_on_cone(p: float, q: float, mu: float) -> tuple[float, float]:
    """Nearest point of the cone to the force ``(p, q)`` [N]."""
    size = abs(q)
    if p >= 0.0 and size <= mu * p:
        return p, q
    if p + mu * size <= 0.0:
        return 0.0, 0.0
    p = (p + mu * size) / (1.0 + mu * mu)
    return p, mu * p if q > 0.0 else -mu * p


@inline_kernel
def solve_associated_contact(
    w_nn: float, w_nt: float, w_tt: float, b_n: float, b_t: float, mu: float
) -> tuple[float, float]:
    """Minimise ``1/2 r' W r + b' r`` over the cone, for one contact, exactly.

    The minimum is 0 if b lies in the dual cone (``b_n >= mu |b_t|``), the free minimum ``-W^-1 b`` if that lies in the
    cone, else it lies on the better one of the two rays ``p (1, +-mu)``, where ``p = -(b_n +- mu b_t) / (1, +-mu) W (1, +-mu)'``.
    W is positive semidefinite with ``w_nn > 0``.
    """
    if b_n >= mu * abs(b_t):
        return 0.0, 0.0
    if mu == 0.0:
        return -b_n / w_nn, 0.0
    det = w_nn * w_tt - w_nt * w_nt
    if det > SINGULAR * w_nn * w_tt:
        p = (w_nt * b_t - w_tt * b_n) / det
        q = (w_nt * b_n - w_nn * b_t) / det
        if abs(q) <= mu * p:
            return p, q
    elif w_nn * b_t == w_nt * b_n:
        return -b_n / w_nn, 0.0
    best, p_best, q_best = 0.0, 0.0, 0.0
    for side in range(2):
        slope = mu if side == 0 else -mu
        pull = b_n + slope * b_t
        if pull < 0.0:
            stiff = w_nn + slope * (2.0 * w_nt + slope * w_tt)
            value = -pull * pull / stiff
            if value < best:
                best, p_best, q_best = value, -pull / stiff, -slope * pull / stiff
    return p_best, q_best


@inline_kernel
def solve_coulomb_contact(
    w_nn: float, w_nt: float, w_tt: float, b_n: float, b_t: float, mu: float
) -> tuple[float, float]:
    """Solve ``u = W r + b`` with Coulomb's law (no dilation) for one contact.

    Open if ``b_n >= 0``; else stick if ``-W^-1 b`` lies in the cone; else slip with ``u_n = 0`` and q against the slip:
    ``p = -b_n / (w_nn +- mu w_nt)``. Where neither slip direction is consistent (possible only if ``mu |w_nt|`` exceeds
    ``w_nn``: Painleve's paradox) the one that leaves the smaller error is taken.
    """
    if b_n >= 0.0:
        return 0.0, 0.0
    if mu == 0.0:
        return -b_n / w_nn, 0.0
    det = w_nn * w_tt - w_nt * w_nt
    if det > SINGULAR * w_nn * w_tt:
        p = (w_nt * b_t - w_tt * b_n) / det
        q = (w_nt * b_n - w_nn * b_t) / det
        if abs(q) <= mu * p:
            return p, q
    elif w_nn * b_t == w_nt * b_n:
        return -b_n / w_nn, 0.0
    worst, p_best, q_best = 1e300, -b_n / w_nn, 0.0
    for side in range(2):
        slope = mu if side == 0 else -mu
        stiff = w_nn + slope * w_nt
        if stiff > 0.0:
            p = -b_n / stiff
            slip = b_t + (w_nt + slope * w_tt) * p
            wrong = slip if side == 0 else -slip
            if wrong < worst:
                worst, p_best, q_best = wrong, p, slope * p
    return p_best, q_best
