"""Binary impact in the theta scheme of contact dynamics: restitution and full history."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, count, not_negative, positive, theta_in_range

FloatArray = NDArray[np.float64]


def effective_restitution(*, gap: ArrayLike, speed: float, dt: float, theta: float) -> FloatArray:
    """Restitution that the theta scheme gives to an impact, as a function of the gap at the start.

    The disks fly freely until a step starts with a gap ``phi v dt`` smaller than what it would close,
    ``phi = frac(gap/(v dt))``. That step closes the gap exactly: ``dx = phi v dt``, so the approach velocity becomes
    ``w v`` with ``w = (phi - 1 + theta)/theta``. If ``w <= 0`` the disks part and ``e = -w``. If ``w > 0`` they still
    approach with gap 0, and the next step turns ``w`` into ``-w (1 - theta)/theta``.

    Parameters
    ----------
    gap : array_like
        Gap at time 0 [m], >= 0.
    speed : float
        Approach velocity [m/s], > 0.
    dt : float
        Time step [s], > 0.
    theta : float
        Parameter of the scheme, in [1/2, 1].

    Returns
    -------
    ndarray
        Restitution [-] of the shape of ``gap``.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Both ends of the phase give ``(1 - theta)/theta``, so e is continuous where ``gap/(v dt)`` is a whole number and
    it does not matter on which side round-off puts it; the slopes there, ``-1/theta`` and ``(1 - theta)/theta^2``,
    differ. An engine that adds up n steps of rounded positions sees the phase with an error of about n times the
    machine epsilon.

    Source: theta scheme of Lim's thesis, appendix A.2; derived here.
    """
    positive(speed=speed, dt=dt)
    theta_in_range(theta)
    start = array("gap", gap)
    if not np.all(start >= 0.0):
        raise ValueError(f"gap = {gap!r} is not allowed: every gap must be finite and >= 0")
    weight = np.longdouble(theta)
    _, phase = _free_steps_and_phase(start, speed, dt)
    w = (phase - 1 + weight) / weight
    return np.where(w <= 0, -w, w * (1 - weight) / weight).astype(np.float64)


class CollisionSteps(NamedTuple):
    """State after each step 0..n_steps, every array of shape (n_steps + 1,).

    ``x_1, x_2`` displacements since time 0 [m], ``vx_1, vx_2`` velocities [m/s], ``gap`` [m], ``fn`` the contact
    force of the step that ends there [N] (NaN in row 0), ``energy`` kinetic [J], ``momentum_x`` [kg m/s].
    """

    x_1: FloatArray
    x_2: FloatArray
    vx_1: FloatArray
    vx_2: FloatArray
    gap: FloatArray
    fn: FloatArray
    energy: FloatArray
    momentum_x: FloatArray


def collision_step_theta(
    *, gap: float, speed: float, dt: float, theta: float, n_steps: int, mass_1: float, mass_2: float
) -> CollisionSteps:
    """Every step of a head-on collision in the theta scheme; disk 1 moves at ``speed`` towards disk 2 at rest.

    The centre of mass moves uniformly and the relative motion is that of `effective_restitution`: with k whole steps
    of free flight, step k + 1 closes the gap and leaves the approach velocity ``w v``, step k + 2 turns a positive
    ``w``.

    Parameters
    ----------
    gap : float
        Gap at time 0 [m], >= 0.
    speed : float
        Velocity of disk 1 [m/s], > 0.
    dt : float
        Time step [s], > 0.
    theta : float
        Parameter of the scheme, in [1/2, 1].
    n_steps : int
        Number of steps.
    mass_1, mass_2 : float
        Masses [kg], > 0.

    Returns
    -------
    CollisionSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    The whole history, the force included, is continuous in the gap: just below a whole number of ``v dt``
    step k closes an almost full ``v dt`` with an almost vanishing force and the next step turns the motion, just as
    it does at the whole number.
    """
    positive(mass_1=mass_1, mass_2=mass_2)
    not_negative(gap=gap)
    count(n_steps=n_steps)
    effective_restitution(gap=gap, speed=speed, dt=dt, theta=theta)
    ext = np.longdouble
    v, step, weight = ext(speed), ext(dt), ext(theta)
    free, phase = _free_steps_and_phase(np.asarray(gap, dtype=np.float64), speed, dt)
    whole = int(np.minimum(free, n_steps + 1))  # beyond the last step it does not matter when they meet
    w = (phase - 1 + weight) / weight
    after = -w * (1 - weight) / weight if w > 0 else w

    n = np.arange(n_steps + 1)
    approach = np.where(n <= whole, v, np.where(n == whole + 1, w * v, after * v))
    # The second impact step starts and ends with gap 0; without one the disks part at once.
    first_open = whole + 2 if w > 0 else whole + 1
    distance = np.where(n <= whole, ext(gap) - n * v * step, -after * v * step * np.maximum(n - first_open, 0))
    total = ext(mass_1) + ext(mass_2)
    share_1, share_2 = ext(mass_2) / total, ext(mass_1) / total
    centre = v * share_2
    closed = ext(gap) - distance
    vx_1, vx_2 = centre + share_1 * approach, centre - share_2 * approach
    force = np.full(n_steps + 1, np.nan, dtype=ext)
    force[1:] = ext(mass_2) * np.diff(vx_2) / step
    columns = (
        centre * step * n + share_1 * closed,
        centre * step * n - share_2 * closed,
        vx_1,
        vx_2,
        distance,
        force,
        (ext(mass_1) * vx_1**2 + ext(mass_2) * vx_2**2) / 2,
        ext(mass_1) * vx_1 + ext(mass_2) * vx_2,
    )
    return CollisionSteps(*(np.asarray(column, dtype=np.float64) for column in columns))


def _free_steps_and_phase(
    gap: FloatArray, speed: float, dt: float
) -> tuple[NDArray[np.longdouble], NDArray[np.longdouble]]:
    """Whole number and fraction of ``gap/(speed dt)``."""
    quotient = gap.astype(np.longdouble) / (np.longdouble(speed) * np.longdouble(dt))
    whole = np.floor(quotient)
    return whole, quotient - whole
