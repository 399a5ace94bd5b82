"""Rotation of a rigid body on which no torque acts: Euler's equations, integrated to round-off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from ninedisk.references._validate import count, pair_of, positive, sizes, times_of

FloatArray = NDArray[np.float64]

MOST_TURNED, MOST_STEPS = 1e4, 100_000
"""Angle [rad] and number of steps up to which a rotation is followed: seconds of work."""


class Rotation(NamedTuple):
    """``spin`` about the axes of the body [rad/s], shape (s, 3), and ``quaternion`` (w, x, y, z) to the frame of space, shape (s, 4)."""

    spin: FloatArray
    quaternion: FloatArray


def _gyration(inertia: FloatArray, spin: FloatArray) -> FloatArray:
    """Rate of change of the spin about the body's axes [rad/s^2]: ``I^-1 (I w x w)``."""
    return np.cross(inertia * spin, spin) / inertia


def free_rotation(t: ArrayLike, *, inertia: ArrayLike, spin: ArrayLike, quaternion: ArrayLike) -> Rotation:
    """Rotation from a spin and an orientation, by an eighth-order method with the tolerance 1e-13.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    inertia : array_like, shape (3,)
        Principal moments [kg m^2], > 0.
    spin : array_like, shape (3,)
        Spin at time 0 about the axes of the body [rad/s].
    quaternion : array_like, shape (4,)
        Rotation from the body's frame at time 0, a unit quaternion (w, x, y, z).

    Raises
    ------
    ValueError
        If a value is out of its range, or the body turns by more than `MOST_TURNED`.
    """
    times = times_of(t)
    moments, start, first = _start(inertia, spin, quaternion)
    if not float(np.linalg.norm(start)) * float(times.max(initial=0.0)) <= MOST_TURNED:
        raise ValueError(f"t = {t!r:.200} is not allowed: the body turns by at most {MOST_TURNED:g} rad")

    def rate(_: float, y: FloatArray) -> FloatArray:
        return np.concatenate([_gyration(moments, y[:3]), _quaternion_rate(y[3:], y[:3])])

    found = solve_ivp(
        rate,
        (0.0, max(float(times.max(initial=0.0)), 1e-300)),
        np.concatenate([start, first]),
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
        t_eval=times,
    )
    turned = found.y[3:].T
    return Rotation(found.y[:3].T, turned / np.linalg.norm(turned, axis=1)[:, None])


def _quaternion_rate(quaternion: FloatArray, spin: FloatArray) -> FloatArray:
    """Rate of a quaternion [1/s] under a spin about the axes of the body [rad/s]: half their product."""
    w, x, y, z = quaternion
    a, b, c = spin
    return 0.5 * np.array([-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a])


def euler_steps(n_steps: int, *, dt: float, inertia: ArrayLike, spin: ArrayLike, quaternion: ArrayLike) -> Rotation:
    """The same by Euler's explicit rule, at every step: what a scheme of first order may err by.

    The spin changes by its rate at the begin of a step; the body then turns by the new spin.

    Parameters
    ----------
    n_steps : int
        Number of steps.
    dt : float
        Length of a step [s], > 0; the body turns by at most 1 rad in it.
    inertia, spin, quaternion
        As of `free_rotation`.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """
    positive(dt=dt)
    count(n_steps=n_steps, most=MOST_STEPS)
    moments, w, q = _start(inertia, spin, quaternion)
    if not dt * float(np.linalg.norm(w)) <= 1.0:
        raise ValueError(f"dt = {dt!r} is not allowed: the body turns by at most 1 rad in a step")
    spins, turned = [w], [q]
    for _ in range(n_steps):
        w = w + dt * _gyration(moments, w)
        q = q + dt * _quaternion_rate(q, w)
        q = q / np.linalg.norm(q)
        spins.append(w)
        turned.append(q)
    return Rotation(np.array(spins), np.array(turned))


def _start(inertia: ArrayLike, spin: ArrayLike, quaternion: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Moments, spin and unit quaternion as arrays; ValueError that names what is none."""
    turn = pair_of("quaternion", quaternion, 4)
    if not abs(float(np.linalg.norm(turn)) - 1.0) <= 1e-9:
        raise ValueError(f"quaternion = {quaternion!r:.200} is not allowed: its size must be 1")
    return np.array(sizes("inertia", inertia, least=3, most=3, strict=True)), pair_of("spin", spin, 3), turn
