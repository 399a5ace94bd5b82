"""Disk on a plane under the associated sliding rule at theta = 1: exact steps, with and without rotation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import count, not_negative, positive, positive_or_inf

FloatArray = NDArray[np.float64]


class RollingSteps(NamedTuple):
    """State after each step 0..n_steps, every array of shape (n_steps + 1,).

    ``x`` [m] and ``vx`` [m/s] along the plane, ``gap`` [m] and ``vy`` [m/s] normal to it, ``spin`` [rad/s] positive when
    rolling forward, ``slip`` [m/s] the velocity of the lowest point, ``fn`` and ``fs`` [N] of the step that ends there (NaN
    in row 0); ``fs`` positive against forward slip.
    """

    x: FloatArray
    vx: FloatArray
    gap: FloatArray
    vy: FloatArray
    spin: FloatArray
    slip: FloatArray
    fn: FloatArray
    fs: FloatArray


def associated_rolling(
    *,
    mu: float,
    g: float,
    mass: float,
    radius: float,
    inertia_ratio: float,
    speed: float,
    dt: float,
    n_steps: int,
    gap_0: float = 0.0,
    pull: float = 0.0,
) -> RollingSteps:
    """Disk thrown along a plane without spin, or pulled along it from rest.

    A step has one contact, so that its program is solved by cases. With the free displacements ``dx, dy`` and the free slip
    ``s`` of the lowest point, the forces in units of displacement ``P = p dt^2/m``, ``Q = q dt^2/m``, and ``k = I/(m R^2)``,
    the step ends with ``gap = g_0 + dy + P`` and the slip ``s - Q (1 + 1/k)``. (A.6) asks that the gap be ``mu`` times the
    magnitude of the slip where the contact is active:

    - inactive, ``P = Q = 0``, if ``g_0 + dy >= mu |s|``;
    - rolling, slip and gap 0: ``Q = s/(1 + 1/k)``, ``P = -(g_0 + dy)``, if that is inside the friction cone;
    - sliding, ``Q = mu P sgn(s)``: ``P = (mu |s| - g_0 - dy)/(1 + mu^2 (1 + 1/k))``.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    g : float
        Gravity [m/s^2], >= 0.
    mass, radius : float
        Mass [kg] and radius [m], > 0.
    inertia_ratio : float
        ``I/(m R^2)``, > 0; ``inf`` for a disk that cannot turn.
    speed : float
        Velocity along the plane at the start [m/s], >= 0.
    dt : float
        Time step [s], > 0.
    n_steps : int
        Number of steps.
    gap_0 : float
        Gap at the start [m], >= 0.
    pull : float
        Acceleration along the plane by gravity [m/s^2], >= 0; ``g`` is then the part normal to it.

    Returns
    -------
    RollingSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: (A.6) of Lim's thesis, appendix A.3.3, in the time-discrete form of (A.1); solved here. As printed, (A.6) has
    the normal force's torque in its tangential row; for a disk it is zero.
    """
    positive(mass=mass, radius=radius, dt=dt)
    not_negative(mu=mu, g=g, gap_0=gap_0, speed=speed, pull=pull)
    count(n_steps=n_steps)
    positive_or_inf(inertia_ratio=inertia_ratio)
    ext = np.longdouble
    step, friction, turn = ext(dt), ext(mu), 1 / ext(inertia_ratio)
    rows = np.full((n_steps + 1, 8), np.nan, dtype=ext)
    x, vx, gap, vy, spin = ext(0), ext(speed), ext(gap_0), ext(0), ext(0)
    rows[0] = (x, vx, gap, vy, spin, vx, np.nan, np.nan)
    for n in range(1, n_steps + 1):
        dx, opened = (vx + ext(pull) * step) * step, gap + vy * step - ext(g) * step**2
        slip = dx - ext(radius) * spin * step
        normal, shear = _forces(opened, slip, friction, turn)
        dx, dy = dx - shear, opened - gap + normal
        spin += shear * turn / (ext(radius) * step)
        x, gap, vx, vy = x + dx, gap + dy, dx / step, dy / step
        scale = ext(mass) / step**2
        rows[n] = (x, vx, gap, vy, spin, vx - ext(radius) * spin, normal * scale, shear * scale)
    return RollingSteps(*(rows[:, k].astype(np.float64) for k in range(8)))


def _forces(
    opened: np.longdouble, slip: np.longdouble, mu: np.longdouble, turn: np.longdouble
) -> tuple[np.longdouble, np.longdouble]:
    """``P`` and ``Q`` of one step: ``opened`` is the gap, ``slip`` the slip that it would end with without contact."""
    if opened >= mu * abs(slip):
        return np.longdouble(0), np.longdouble(0)
    stick = slip / (1 + turn)
    if opened <= 0 and abs(stick) <= -mu * opened:
        return -opened, stick
    normal = (mu * abs(slip) - opened) / (1 + mu**2 * (1 + turn))
    return normal, mu * normal * np.sign(slip)
