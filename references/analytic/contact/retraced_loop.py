"""Contacts whose distance and normal retrace a path: shear as a function of the place on it, and what slip of the step's end adds.

With the distance r and the angle phi of the normal from body i to body j the shear spring of two bodies without spin is stretched by
``fs/ks = integral of r phi' dt``: a line integral, 0 along a path that is gone to and fro. Slip of half steps that is measured with the
normal of the step's end sums ``(d_n - d_{n-1}) . t_n`` with ``t_n = t + (dt/2) phi' (-n)`` in place of the middle's: per step it adds
``-(dt/2) r' phi' dt``, and that does not change its sign on the way back.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, finite, flag, positive

FloatArray = NDArray[np.float64]

QUADRATURE = 256
"""Points of a cycle: the integrands are smooth and periodic, and their trapezoidal sums converge faster than any power."""


def passing_shear(path: ArrayLike, *, ahead: float, aside: float) -> FloatArray:
    """``fs/ks`` [m] of a centre i that has gone ``path`` along the x axis past a centre j at rest.

    With ``d = (ahead - path, aside)`` and ``t = (-d_y, d_x)/|d|`` it is the integral of ``-t_x``, ``aside/|d|``.

    Parameters
    ----------
    way : array_like
        [m], from where the shear force was 0.
    ahead, aside : float
        Of the centre j from there [m]; ``aside`` is not 0.

    Raises
    ------
    ValueError
        If an argument is not finite, or ``aside`` is 0: the centres would meet.

    Notes
    -----
    Source: derived here.
    """
    finite(ahead=ahead, aside=aside)
    if aside == 0.0:
        raise ValueError(f"aside = {aside!r} is not allowed: the centres would meet; it must be above or below 0")
    left = ahead - array("path", path)
    return np.asarray(aside * (math.asinh(ahead / abs(aside)) - np.arcsinh(left / abs(aside))))


def passing_drift(*, amplitude: float, frequency: float, ahead: float, aside: float, dt: float) -> float:
    """What slip of the step's end adds to ``fs/ks`` per cycle of ``path = amplitude sin(frequency t)`` to first order [m].

    ``-(dt/2)`` times the integral of ``r' phi'``, with ``r' = -path' (ahead - path)/r`` and ``phi' = aside path'/r^2``.

    Parameters
    ----------
    amplitude, frequency, dt : float
        [m], [rad/s], [s], > 0.
    ahead, aside : float
        As for `passing_shear`.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: derived here; the "ratchet" of Vyas, Ottino, Lueptow & Umbanhowar, Comput. Phys. Commun. 310 (2025) 109524.
    """
    positive(amplitude=amplitude, frequency=frequency, dt=dt)
    passing_shear(0.0, ahead=ahead, aside=aside)
    angle = np.arange(QUADRATURE) * (2.0 * math.pi / QUADRATURE)
    left = ahead - amplitude * np.sin(angle)
    rate = amplitude * frequency * np.cos(angle)
    turned = -(rate**2) * aside * left / np.hypot(left, aside) ** 3
    return -0.5 * dt * float(turned.mean()) * 2.0 * math.pi / frequency


def turning_wall_shear(
    part: ArrayLike, *, radius: float, overlap: float, path: float, angle: float, mid_overlap: bool
) -> FloatArray:
    """``fs/ks`` [m] of a disk at rest on a wall that has gone a part of its path towards it, turning about the disk's centre as it goes.

    The wall's pivot, at first the disk's centre, goes along the wall's first normal by ``y = path s`` and the wall turns by ``angle s``:
    its surface passes the disk's foot with ``y' sin(phi) + phi' (R - overlap)``, and the middle of the overlap with half of
    ``phi' (overlap + y cos(phi))`` more.

    Parameters
    ----------
    part : array_like
        s [-], in [0, 1].
    radius, overlap : float
        Of the disk, and of the contact at s = 0 [m], > 0; the disk's centre is in front of the wall: ``overlap < radius``.
    way, angle : float
        [m], [rad], > 0.
    mid_overlap : bool
        Whether the wall's velocity is that in the middle of the overlap.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: derived here.
    """
    positive(radius=radius, overlap=overlap, path=path, angle=angle)
    flag(mid_overlap=mid_overlap)
    if overlap >= radius:
        raise ValueError(f"overlap = {overlap!r} m is not allowed: it must be below the radius {radius!r} m")
    s = array("part", part)
    if ((s < 0.0) | (s > 1.0)).any():
        raise ValueError(f"part = {part!r:.200} is not allowed: every part of the way must lie in [0, 1]")
    towards = path * (1.0 - np.cos(angle * s)) / angle
    surface = towards + (radius - overlap) * angle * s
    # By parts, of angle way s cos(angle s).
    deeper = 0.5 * (overlap * angle * s + path * s * np.sin(angle * s) - towards)
    return np.asarray(surface + deeper if mid_overlap else surface)


def turning_wall_drift(*, path: float, angle: float, period: float, dt: float, mid_overlap: bool) -> float:
    """What slip of the step's end adds to ``fs/ks`` per cycle to first order [m]; s goes to 1 and back at constant rates.

    A sum of ``f(t_n) dt`` is the integral and ``(dt/2)`` times what f grows by: ``path' sin(angle)`` on the way to s = 1 and, as its sign
    is turned there, as much on the way back; half of ``angle' path cos(angle)`` twice.

    Parameters
    ----------
    way, angle, period, dt : float
        [m], [rad], [s], [s], > 0.
    mid_overlap : bool
        As for `turning_wall_shear`.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: derived here.
    """
    positive(path=path, angle=angle, period=period, dt=dt)
    flag(mid_overlap=mid_overlap)
    grown = path * math.sin(angle) + (0.5 * angle * path * math.cos(angle) if mid_overlap else 0.0)
    return 2.0 * dt / period * grown
