"""Shear springs of contacts that retrace a path, step by step, with slip measured in the middle of the step or at its end."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import MOST, array, count, flag, positive

FloatArray = NDArray[np.float64]


def oscillation_central(*, frequency: float, speed: float, dt: float, n_steps: int) -> FloatArray:
    """Places [m] at ``t_0 .. t_n`` of a linear oscillator that central differences start from rest's place, shape (n + 1,).

    ``x_{n+1} - 2 x_n + x_{n-1} = -(frequency dt)^2 x_n`` has the solution ``C sin(n a)``, ``sin(a/2) = frequency dt/2``; with no force at
    ``x_0 = 0`` the first step is ``speed dt``.

    Parameters
    ----------
    frequency, speed, dt : float
        [rad/s], [m/s], [s], > 0; ``frequency dt`` < 2.
    n_steps : int

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    positive(frequency=frequency, speed=speed, dt=dt)
    count(n_steps=n_steps)
    if not 0.0 < frequency * dt < 2.0:
        raise ValueError(
            f"dt = {dt!r} is not allowed with frequency = {frequency!r}: the scheme is stable below 2/frequency, and frequency dt must be "
            "above 0"
        )
    turn = 2.0 * math.asin(0.5 * frequency * dt)
    return np.asarray(speed * dt / math.sin(turn) * np.sin(turn * np.arange(n_steps + 1)), dtype=np.float64)


def pair_shear(d: FloatArray, *, slip_at: str) -> FloatArray:
    """``fs/ks`` [m] at ``t_0 .. t_n`` of two bodies without spin, from ``d = x_j - x_i`` [m], shape (n + 1, 2).

    Velocities of half steps times dt are the differences of d; ``t`` is at right angles to ``d_n`` ("end"), or to the mean of
    ``d_{n-1}`` and ``d_n`` ("middle"). The contact neither opens nor slides.

    Raises
    ------
    ValueError
        If ``slip_at`` is neither, or ``d`` is no table of finite pairs that are apart at all of those times.
    """
    _known(slip_at)
    if array("d", d, dimensions=(2,)).shape[1] != 2 or not len(d):
        raise ValueError(f"d of shape {np.shape(d)} is not allowed: it must be (n + 1, 2)")
    places = np.asarray(d, dtype=np.longdouble)
    step = np.diff(places, axis=0)
    normal = places[1:] if slip_at == "end" else (places[1:] + places[:-1]) / 2
    apart = np.sqrt((normal**2).sum(axis=1))
    if not (apart > 0.0).all():
        raise ValueError(
            f"d is not allowed: the centres meet in step {int(np.argmin(apart)) + 1}, where there is no normal"
        )
    normal /= apart[:, None]
    slid = step[:, 1] * normal[:, 0] - step[:, 0] * normal[:, 1]
    return np.asarray(np.concatenate([[0.0], np.cumsum(slid)]), dtype=np.float64)


def turning_wall_steps(
    *, radius: float, overlap: float, path: float, angle: float, half: int, cycles: int, mid_overlap: bool, slip_at: str
) -> FloatArray:
    """``fs/ks`` [m] at every step of the disk at rest of `ninedisk.references.analytic.contact.retraced_loop.turning_wall_shear`.

    The wall takes ``half`` steps to go there, and as many back; in each of them it goes and turns by the same, which is its velocity in
    the middle of the step, and the pose is that of the middle of the step or of its end.

    Parameters
    ----------
    radius, overlap, way : float
        [m], > 0; ``overlap < radius``.
    angle : float
        [rad], > 0.
    half, cycles : int
        At least 1 and 0; ``2 half cycles`` steps are at most `MOST`.
    mid_overlap : bool
    slip_at : {"middle", "end"}

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    positive(radius=radius, overlap=overlap, path=path, angle=angle)
    if overlap >= radius:
        raise ValueError(f"overlap = {overlap!r} m is not allowed: it must be below the radius {radius!r} m")
    count(least=1, half=half)
    count(cycles=cycles)
    if 2 * half * cycles > MOST:
        raise ValueError(
            f"half, cycles = {half!r}, {cycles!r} are not allowed: 2 half cycles steps must be at most {MOST}"
        )
    half, cycles = int(half), int(cycles)
    flag(mid_overlap=mid_overlap)
    _known(slip_at)
    steps = np.arange(1, 2 * half * cycles + 1, dtype=np.longdouble) - (0.5 if slip_at == "middle" else 0.0)
    forth = (np.arange(2 * half * cycles) // half) % 2 == 0
    sign = np.where(forth, np.longdouble(1.0), np.longdouble(-1.0)) / half
    at = steps % (2 * half) / half
    part = np.minimum(at, 2 - at)
    # At the end of the way back the remainder is 0 and so is the part.
    slid = path * np.sin(angle * part) + (np.longdouble(radius) - overlap) * angle
    if mid_overlap:
        slid = slid + angle * (overlap + path * part * np.cos(angle * part)) / 2
    return np.asarray(np.concatenate([[0.0], np.cumsum(sign * slid)]), dtype=np.float64)


def _known(slip_at: str) -> None:
    if not (isinstance(slip_at, str) and slip_at in ("middle", "end")):
        raise ValueError(f"slip_at = {slip_at!r} is unknown: use middle or end")
