"""Disks in contact that move little: the linear motion of unequal bodies on springs and dashpots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, finite, not_negative, positive, times_of

FloatArray = NDArray[np.float64]


class Touch(NamedTuple):
    """A contact that stays closed and does not slide.

    Parameters
    ----------
    i : int
        First body.
    j : int
        Second body; -1: a wall at rest.
    normal : (float, float)
        Unit normal from i to j.
    overlap : float
        Overlap at time 0 [m].
    kn, ks : float
        Stiffnesses [N/m]: kn > 0, ks >= 0.
    beta : float
        Damping ratio, >= 0: the dashpot is ``2 beta sqrt(m_eff kn)``, with ``1/m_eff`` the sum of 1/m of both bodies.
    """

    i: int
    j: int
    normal: tuple[float, float]
    overlap: float
    kn: float
    ks: float
    beta: float


class Swing(NamedTuple):
    """Motion of the bodies, and forces of the contacts, in the order in which both are given.

    ``shift`` [m, m, rad] and ``velocity`` [m/s, m/s, rad/s] have the shape (s, n, 3), ``overlap`` [m], ``fn`` and ``fs`` [N] the
    shape (s, c). ``fastest`` [rad/s] bounds the frequencies.
    """

    shift: FloatArray
    velocity: FloatArray
    overlap: FloatArray
    fn: FloatArray
    fs: FloatArray
    fastest: float


def cluster_swing(
    t: ArrayLike,
    *,
    velocity: ArrayLike,
    radius: ArrayLike,
    mass: ArrayLike,
    inertia: ArrayLike,
    touches: Sequence[Touch],
    xi: float = 0.0,
) -> Swing:
    """``M (q'' + xi q') + C q' + K q = F``, where the normals and lever arms are those of time 0.

    With ``q = (x, y, angle)`` of each body, a contact's overlap grows by ``n.(x_i - x_j)`` and its slip by
    ``t.(x_i - x_j) + R_i angle_i + R_j angle_j``, ``t = (-n_y, n_x)``. Its force on i is ``-fn n + fs t``, with
    ``fn = kn overlap + c overlap'`` and ``fs = -ks slip``, on j the opposite; both bodies get the torque ``R fs``.

    Parameters
    ----------
    t : array_like, shape (s,)
        Times [s], >= 0.
    velocity : array_like, shape (n, 3)
        Velocity [m/s] and spin [rad/s] at time 0.
    radius, mass, inertia : array_like, shape (n,)
        [m], [kg], [kg m^2], > 0; a huge inertia keeps the spin.
    touches : sequence of Touch
    xi : float
        Global damping [1/s], >= 0, of velocities and spins.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    The exponential of the system's matrix is exact. What is left out is of the order of the overlap over the radius.
    Source: small oscillations, Landau & Lifshitz, Mechanics, section 23; with dashpots, section 25.
    """
    not_negative(xi=xi)
    from scipy.linalg import expm  # slow to import, and most runs do not need it

    times, start = times_of(t), array("velocity", velocity, dimensions=(2,))
    r, m, turning = (array("radius, mass, inertia", each, dimensions=(1,)) for each in (radius, mass, inertia))
    n = len(r)
    if not len(m) == len(turning) == n or not (np.concatenate([r, m, turning]) > 0.0).all():
        raise ValueError("radius, mass and inertia are not allowed: they need one number > 0 for each body")
    if start.shape != (n, 3):
        raise ValueError(f"velocity of the shape {start.shape} is not allowed: it needs a row of three for each body")
    if (
        not isinstance(touches, Sequence)
        or not all(isinstance(each, Touch) for each in touches)
        or len(touches) > 1_000
    ):
        raise ValueError(f"touches = {touches!r:.200} are not allowed: they must be a sequence of at most 1000 `Touch`")
    normal, slip = np.zeros((len(touches), n, 3)), np.zeros((len(touches), n, 3))
    kn, ks, c, first = (np.zeros(len(touches)) for _ in range(4))
    for k, each in enumerate(touches):
        positive(kn=each.kn)
        not_negative(ks=each.ks, beta=each.beta)
        finite(overlap=each.overlap)
        if not (0 <= each.i < n and -1 <= each.j < n and each.j != each.i):
            raise ValueError(
                f"touch {k} is of bodies {each.i} and {each.j}: they must be two of 0 .. {n - 1}, or a body and -1"
            )
        nx, ny = each.normal
        for body, sign in ((each.i, 1.0), (each.j, -1.0)):
            if body >= 0:
                normal[k, body] = sign * nx, sign * ny, 0.0
                slip[k, body] = -sign * ny, sign * nx, r[body]
        light = 1.0 / m[each.i] + (1.0 / m[each.j] if each.j >= 0 else 0.0)
        kn[k], ks[k], first[k] = each.kn, each.ks, each.overlap
        c[k] = 2.0 * each.beta * np.sqrt(each.kn / light)
    g, h = normal.reshape(len(touches), -1), slip.reshape(len(touches), -1)
    ease = np.stack([1.0 / m, 1.0 / m, 1.0 / turning], axis=1).ravel()
    size = 3 * n
    system = np.zeros((2 * size + 1, 2 * size + 1))
    stiffness = ease[:, None] * ((g.T * kn) @ g + (h.T * ks) @ h)
    system[:size, size:-1] = np.eye(size)
    system[size:-1, :size] = -stiffness
    system[size:-1, size:-1] = -ease[:, None] * ((g.T * c) @ g) - xi * np.eye(size)
    system[size:-1, -1] = -ease * (g.T @ (kn * first))
    state = np.concatenate([np.zeros(size), start.ravel(), [1.0]])
    found = np.array([expm(system * at) @ state for at in times])
    q, v = found[:, :size], found[:, size:-1]
    overlap = first + q @ g.T
    return Swing(
        shift=q.reshape(-1, n, 3), velocity=v.reshape(-1, n, 3), overlap=overlap,
        fn=kn * overlap + c * (v @ g.T), fs=-ks * (q @ h.T),
        fastest=float(np.sqrt(np.abs(np.linalg.eigvals(stiffness)).max())),
    )  # fmt: skip
