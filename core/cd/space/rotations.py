"""Rotations of bodies in space: quaternions, inertia in the scene's axes, and free rotation that keeps angular momentum."""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidNumericsError

MAX_ITERATIONS = 100
CONVERGED = 4e-16
"""Change of the mean spin, over its size, at which its iteration ends: two roundings."""
STALLED = 1e-12
"""Change up to which an iteration that comes no nearer has converged to rounding."""


def exponential(turn: FloatArray) -> FloatArray:
    """Unit quaternions ``(w, x, y, z)``, shape (n, 4), of rotation vectors [rad], shape (n, 3)."""
    half = 0.5 * np.sqrt(np.sum(turn**2, axis=1))
    small = half < 1e-8  # there sin(a)/a is 1 to rounding
    share = np.where(small, 0.5, 0.5 * np.sin(half) / np.where(small, 1.0, half))
    return np.column_stack([np.cos(half), share[:, None] * turn])


def product(p: FloatArray, q: FloatArray) -> FloatArray:
    """Quaternions of the rotations q and then p, shape (n, 4), of size 1."""
    (a, b, c, d), (w, x, y, z) = p.T, q.T
    both = np.column_stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ]
    )
    return np.asarray(both / np.sqrt(np.sum(both**2, axis=1))[:, None])


def matrices(q: FloatArray) -> FloatArray:
    """Rotation matrices, shape (n, 3, 3), of unit quaternions, shape (n, 4)."""
    w, x, y, z = q.T
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=1) for row in rows], axis=1)


def turned_diagonal(q: FloatArray, diagonal: FloatArray) -> FloatArray:
    """``R diag R'``, shape (n, 3, 3): tensors with these entries, shape (n, 3), along the axes of the bodies."""
    r = matrices(q)
    return np.asarray(np.einsum("nij,nj,nkj->nik", r, diagonal, r))


def applied(tensor: FloatArray, vector: FloatArray) -> FloatArray:
    """``A v`` of each body, shape (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", tensor, vector))


def middle_of_step(q: FloatArray, moments: FloatArray, momentum: FloatArray, dt: float) -> FloatArray:
    """Orientations in the middle of a step under a mean angular momentum, shape (n, 4).

    The mean spin w is that of the middle, ``w = I(R_m)^-1 L`` with ``R_m = exp(dt w/2) R``: the implicit midpoint rule in the axes of the
    scene. Without torque L is a constant to the last bit, the rule is of second order and reversible, so that the energy has no drift.

    Parameters
    ----------
    q : ndarray, shape (n, 4)
        Orientations at the start of the step.
    moments : ndarray, shape (n, 3)
        Moments of inertia about the axes of the bodies [kg m^2].
    momentum : ndarray, shape (n, 3)
        Mean angular momentum of the step, in the axes of the scene [kg m^2/s].
    dt : float
        Step [s].

    Raises
    ------
    InvalidNumericsError
        If a body turns so far in a step that the rule has no solution near.
    """
    middle, before, last = q, np.zeros_like(momentum), np.inf
    for _ in range(MAX_ITERATIONS):
        spin = applied(turned_diagonal(middle, 1.0 / moments), momentum)
        middle = product(exponential(0.5 * dt * spin), q)
        size = np.sqrt(np.sum(spin**2, axis=1))
        change = float(
            (np.sqrt(np.sum((spin - before) ** 2, axis=1)) / np.where(size > 0.0, size, 1.0)).max(initial=0.0)
        )
        if change <= CONVERGED or STALLED >= change >= last:
            return middle
        before, last = spin, change
    fastest = float(size.max())
    raise InvalidNumericsError(
        f"dt = {dt:g} s is not allowed for a body that spins at {fastest:g} rad/s: it turns by {dt * fastest:g} rad in a step, and the "
        f"midpoint rule has no solution near; use dt of at most {0.5 / fastest:.2g} s"
    )
