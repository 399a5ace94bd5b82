"""Rotation of a rigid body on which no torque acts: Euler's equations, integrated to round-off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from ninedisk.references._validate import positive, times_of

FloatArray = NDArray[np.float64]


class Rotation(NamedTuple):
    """``spin`` about the axes of the body [rad/s], shape (s, 3), and ``quaternion`` (w, x, y, z) to the frame of space, shape (s, 4)."""

    spin: FloatArray
    quaternion: FloatArray


def gyration(inertia: FloatArray, spin: FloatArray) -> FloatArray:
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
    """
    times = times_of(t)
    moments, start = np.asarray(inertia, dtype=np.float64), np.asarray(spin, dtype=np.float64)
    positive(first=float(moments[0]), second=float(moments[1]), third=float(moments[2]))

    def rate(_: float, y: FloatArray) -> FloatArray:
        return np.concatenate([gyration(moments, y[:3]), quaternion_rate(y[3:], y[:3])])

    found = solve_ivp(
        rate,
        (0.0, max(float(times.max(initial=0.0)), 1e-300)),
        np.concatenate([start, np.asarray(quaternion, dtype=np.float64)]),
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
        t_eval=times,
    )
    turned = found.y[3:].T
    return Rotation(found.y[:3].T, turned / np.linalg.norm(turned, axis=1)[:, None])


def quaternion_rate(quaternion: FloatArray, spin: FloatArray) -> FloatArray:
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
        Length of a step [s], > 0.
    inertia, spin, quaternion
        As of `free_rotation`.
    """
    positive(dt=dt)
    moments, w = np.asarray(inertia, dtype=np.float64), np.array(spin, dtype=np.float64)
    q = np.array(quaternion, dtype=np.float64)
    spins, turned = [w], [q]
    for _ in range(n_steps):
        w = w + dt * gyration(moments, w)
        q = q + dt * quaternion_rate(q, w)
        q = q / np.linalg.norm(q)
        spins.append(w)
        turned.append(q)
    return Rotation(np.array(spins), np.array(turned))
