"""Row of equal smooth disks in the theta scheme of contact dynamics: every step, its complementarity problem solved by cases."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import count, fraction, positive, sizes, theta_in_range

FloatArray = NDArray[np.float64]

MOST_STEPS = 100_000
"""All sets of contacts are tried in each."""
TOUCH = 1e-12
"""Gap [m] at the end of the free step up to which Newton's law acts: the rounding of coordinates."""


class ChainSteps(NamedTuple):
    """State after each step 0..n_steps: velocities ``v`` [m/s], shape (n_steps + 1, n), and ``gap`` [m], (n_steps + 1, n - 1)."""

    v: FloatArray
    gap: FloatArray


def chain_theta(
    *,
    gaps: Sequence[float],
    speed: float,
    dt: float,
    theta: float,
    restitution: float | None,
    n_steps: int,
) -> ChainSteps:
    """Equal disks in a row at rest, the first one with a velocity towards the others.

    With opening velocities ``u = v_{k+1} - v_k`` the impulses P (over the mass) of a step solve ``0 <= P, w >= 0, P w = 0``::

        theta's own impact law    w = gap/(theta dt) + (1 - theta)/theta u0 + u1
        Newton's                  w = (restitution u0 if u0 < 0, else u0) + u1

    with ``u1 = u0 + W P``, W the matrix with 2 on and -1 beside the diagonal. Under Newton's law a contact takes part that the free
    step, or the impulses of the others, would close; one that opens is pushed back with its own speed, no more, so that its impulse
    ``P (u0 + u1)/2 <= 0`` feeds no energy. The matrix is positive definite, so that exactly one set of contacts that push
    gives a solution; all are tried.

    Parameters
    ----------
    gaps : sequence of float
        Gaps between neighbours [m], >= 0; one to seven, all sets of contacts being tried.
    speed : float
        Velocity of the first disk [m/s], > 0.
    dt : float
        Time step [s], > 0.
    theta : float
        Parameter of the scheme, in [1/2, 1].
    restitution : float or None
        Newton's coefficient, in [0, 1]; None: the theta scheme's own impact law.
    n_steps : int
        Number of steps.

    Notes
    -----
    Source: theta scheme of Lim's thesis, appendix A.2, and Moreau's (1988) impact law, for more than one contact; solved here.
    """
    positive(speed=speed, dt=dt)
    gaps = sizes("gaps", gaps, most=7)
    count(n_steps=n_steps, most=MOST_STEPS)
    if restitution is not None:
        fraction(restitution=restitution)
    theta_in_range(theta)
    n = len(gaps) + 1
    back = (1.0 - theta) / theta
    gap, v = np.asarray(gaps, dtype=np.float64), np.zeros(n)
    v[0] = speed
    found = ChainSteps(np.empty((n_steps + 1, n)), np.empty((n_steps + 1, n - 1)))
    found.v[0], found.gap[0] = v, gap
    for step in range(1, n_steps + 1):
        u = np.diff(v)
        if restitution is None:
            impulse = _complementary(gap / (theta * dt) + (back + 1.0) * u, np.ones(n - 1, dtype=np.bool_))
        else:
            impulse = _newton(gap, u, dt, theta, restitution)
        after = v - np.diff(impulse, prepend=0.0, append=0.0)
        gap = gap + dt * np.diff(theta * after + (1.0 - theta) * v)
        v = after
        found.v[step], found.gap[step] = v, gap
    return found


def _newton(gap: FloatArray, u: FloatArray, dt: float, theta: float, restitution: float) -> FloatArray:
    """Impulses under Newton's law on a set of contacts that grows until no other would close."""
    inside = gap + dt * u < TOUCH
    while True:
        impulse = _complementary(u + np.where(u < 0.0, restitution * u, u), inside)
        end = gap + dt * (u + theta * _openings(impulse))
        missed = ~inside & (end < -TOUCH)
        if not missed.any():
            return impulse
        inside |= missed


def _openings(impulse: FloatArray) -> FloatArray:
    """``W P``."""
    padded = np.concatenate(([0.0], impulse, [0.0]))
    return np.asarray(2.0 * impulse - padded[:-2] - padded[2:])


def _complementary(free: FloatArray, allowed: NDArray[np.bool_]) -> FloatArray:
    """P of ``0 <= P, free + W P >= 0``, complementary, on the contacts that are allowed."""
    c = len(free)
    matrix = 2.0 * np.eye(c) - np.eye(c, k=1) - np.eye(c, k=-1)
    best, least = np.zeros(c), np.inf
    for chosen in product((False, True), repeat=c):
        push = np.array(chosen)
        if (push & ~allowed).any():
            continue
        impulse = np.zeros(c)
        impulse[push] = np.linalg.solve(matrix[np.ix_(push, push)], -free[push])
        opening = free + matrix @ impulse
        wrong = max(0.0, float(-impulse.min()), float(-opening[allowed].min(initial=0.0)))
        if wrong < least:
            best, least = impulse, wrong
    return best
