"""Shear of a contact of spheres that sticks while the spheres move and turn as prescribed: the spring turns with its contact, or not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, times_of

FloatArray = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def turned_by(vectors: ArrayLike, spin: ArrayLike, t: ArrayLike) -> FloatArray:
    """Vectors, shape (s, 3), each turned by a spin [rad/s], shape (3,), over its time t [s], shape (s,): Rodrigues' formula."""
    found, axis, times = array("vectors", vectors, dimensions=(2,)), array("spin", spin, dimensions=(1,)), times_of(t)
    if axis.shape != (3,) or found.shape != (*times.shape, 3):
        raise ValueError(
            f"vectors of shape {found.shape}, spin of shape {axis.shape} are not allowed: three components, a row a time"
        )
    rate = float(np.linalg.norm(axis))
    if rate == 0.0:
        return found.copy()
    unit = axis / rate
    c, s = np.cos(rate * times)[:, None], np.sin(rate * times)[:, None]
    return c * found + s * np.cross(unit, found) + (1.0 - c) * (found @ unit)[:, None] * unit


def turned_shear(
    *, apart: ArrayLike, v: ArrayLike, roll: ArrayLike, spin: ArrayLike, t: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Displacement of the shear spring of two spheres that never slide, on straight lines with constant spins, from time 0.

    With the unit normal ``n`` from the first to the second, a vector ``s`` in the tangent plane that turns with the contact, and about n
    with half the sum of the spins, obeys ``s' = (n x n') x s + (W/2) n x s - u``, ``W = (w_1 + w_2).n`` and the slip
    ``u = -v_t + (R_1 w_1 + R_2 w_2) x n``, v that of the second relative to the first. ``n x n'`` keeps its direction, so that the
    tangent ``e`` in the plane of the motion and ``n x e`` are carried along unturned, and for ``z = s.e + i s.(n x e)`` there remains
    ``z' = i (W/2) z - u``: ``z = -exp(i a(t)) int exp(-i a) u``, with the angle ``a = 1/2 (w_1 + w_2).int n`` in closed form. The
    integral is taken by Gauss' rule of eight points between the times. Without motion s runs through a circle of radius ``2 |u|/|W|``.

    Parameters
    ----------
    apart, v, roll, spin : array_like, shape (3,)
        From the first centre to the second one at time 0 [m], not 0; velocity of the second relative to the first [m/s];
        ``R_1 w_1 + R_2 w_2`` [m/s], of a plane with R = 0; ``w_1 + w_2`` [rad/s].
    t : array_like, shape (s,)
        [s], ascending.

    Returns
    -------
    shear : ndarray, shape (s, 3)
        Spring ``s`` [m]: the shear force on the first is ks s.
    frame : ndarray, shape (s, 2, 3)
        ``e`` and ``n x e``.

    Notes
    -----
    Source: derived above.
    """
    d0, u2, rolled, turned = (
        array(name, value, dimensions=(1,))
        for name, value in (("apart", apart), ("v", v), ("roll", roll), ("spin", spin))
    )
    times = times_of(t)
    if {d0.shape, u2.shape, rolled.shape, turned.shape} != {(3,)} or not d0.any() or (np.diff(times) < 0.0).any():
        raise ValueError(
            f"apart = {apart!r}, v = {v!r}, roll = {roll!r}, spin = {spin!r} are not allowed: three components each, apart not 0, and "
            "times t that ascend"
        )
    n0 = d0 / np.linalg.norm(d0)
    flat = u2 - (u2 @ n0) * n0
    if not flat.any():  # the normal keeps its direction: any tangent will do
        flat = np.eye(3)[np.argmin(np.abs(n0))]
        flat = flat - (flat @ n0) * n0
    binormal = np.cross(n0, flat / np.linalg.norm(flat))

    def seen(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normals and tangents e at times."""
        n = d0 + at[..., None] * u2
        n = n / np.linalg.norm(n, axis=-1, keepdims=True)
        return n, np.cross(binormal, n)

    def angle(at: FloatArray) -> FloatArray:
        """``a`` at times."""
        speed = float(np.linalg.norm(u2))
        if speed == 0.0:
            return np.asarray(0.5 * float(turned @ n0) * at)
        path = u2 / speed
        begin = float(d0 @ path)
        beside = d0 - begin * path
        least = float(np.linalg.norm(beside))
        along = begin + at * speed
        far = np.hypot(along, least) - np.hypot(begin, least)
        across = (np.arcsinh(along / least) - np.arcsinh(begin / least)) if least > 0.0 else np.zeros_like(at)
        return np.asarray(0.5 * (across * float(turned @ beside) + far * float(turned @ path)) / speed)

    edges = np.concatenate([[0.0], times])
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    at = middle[:, None] + half[:, None] * NODES
    n, e = seen(at)
    slip = np.cross(rolled, n) - u2
    u = np.einsum("ijk,ijk->ij", slip, e) + 1j * (slip @ binormal)
    z = -np.exp(1j * angle(times)) * np.cumsum(half * ((np.exp(-1j * angle(at)) * u) @ WEIGHTS))
    _, tangent = seen(times)
    frame = np.stack([tangent, np.broadcast_to(binormal, tangent.shape)], axis=1)
    return z.real[:, None] * frame[:, 0] + z.imag[:, None] * frame[:, 1], frame


def kept_shear(*, apart: ArrayLike, v: ArrayLike, roll: ArrayLike, t: ArrayLike) -> FloatArray:
    """Displacement of a spring as in `turned_shear` that keeps its direction in space while the contact turns, shape (s, 3) [m].

    ``s' = -u`` with the same slip u, by the same rule; what is left along the normal is taken off at the end.

    Notes
    -----
    Source: derived above.
    """
    d0, u2, rolled = (
        array(name, value, dimensions=(1,)) for name, value in (("apart", apart), ("v", v), ("roll", roll))
    )
    times = times_of(t)
    if {d0.shape, u2.shape, rolled.shape} != {(3,)} or not d0.any() or (np.diff(times) < 0.0).any():
        raise ValueError(
            f"apart = {apart!r}, v = {v!r}, roll = {roll!r} are not allowed: three components each, apart not 0, and times t that ascend"
        )

    def normals(at: FloatArray) -> FloatArray:
        n = d0 + at[..., None] * u2
        return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))

    edges = np.concatenate([[0.0], times])
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    n = normals(middle[:, None] + half[:, None] * NODES)
    slip = np.cross(rolled, n) - u2 + (n @ u2)[..., None] * n
    spring = -np.cumsum(half[:, None] * np.einsum("ijk,j->ik", slip, WEIGHTS), axis=0)
    end = normals(times)
    return np.asarray(spring - np.einsum("ij,ij->i", spring, end)[:, None] * end)
