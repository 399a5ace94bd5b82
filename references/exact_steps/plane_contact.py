"""Disk and plane, one contact, in the theta scheme of contact dynamics: exact steps of falls, bounces and oblique impacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import (
    count,
    finite,
    flag,
    fraction,
    not_negative,
    pair,
    positive,
    positive_or_inf,
    theta_in_range,
)

FloatArray = NDArray[np.float64]

TOUCH = 1e-12
"""Gap over radius at the end of the free step up to which Newton's law acts: the rounding of coordinates."""


class PlaneSteps(NamedTuple):
    """State after each step 0..n_steps, every array of shape (n_steps + 1,).

    ``x`` [m] and ``vx`` [m/s] along the plane, ``gap`` [m] and ``vy`` [m/s] normal to it, ``spin`` [rad/s] positive when rolling
    forward.
    """

    x: FloatArray
    vx: FloatArray
    gap: FloatArray
    vy: FloatArray
    spin: FloatArray


def plane_contact_theta(
    *,
    radius: float,
    inertia_ratio: float,
    gap: float,
    velocity: tuple[float, float],
    spin: float,
    g: float,
    mu: float,
    dt: float,
    theta: float,
    restitution: float | None,
    dilates: bool,
    n_steps: int,
) -> PlaneSteps:
    """Disk that meets a plane.

    A step has one contact, so that its program is solved by cases. The velocities of the program at the contact are, with
    ``e = (1 - theta)/theta``, ``u0`` before and ``u1`` after the step::

        theta's own impact law    un = gap/(theta dt) + e u0_n + u1_n,    ut = e u0_t + u1_t
        Newton's                  un = (restitution u0_n if u0_n < 0, else u0_n) + u1_n,   ut = u1_t

    the latter only where the free step would close the contact; one that opens can be pushed back with its own speed, no more. With
    those of the free step, ``P`` and ``Q`` in units of velocity (impulse over mass) and ``k = I/(m R^2)``, ``un = un_f + P`` and
    ``ut = ut_f - Q (1 + 1/k)``; the contact

    - is inactive if ``un_f >= mu |ut_f|`` (associated rule) or ``un_f >= 0`` (Coulomb's);
    - sticks, un = ut = 0, if that Q is at most mu P;
    - else slides, ``Q = mu P sgn(ut_f)``: ``P = (mu |ut_f| - un_f)/(1 + mu^2 (1 + 1/k))`` under the associated rule, where
      ``un = mu |ut|``, and ``P = -un_f`` under Coulomb's.

    Parameters
    ----------
    radius : float
        [m], > 0; the motion does not depend on the mass.
    inertia_ratio : float
        ``I/(m R^2)``, > 0; ``inf`` for a disk that cannot turn.
    gap : float
        Gap at the start [m], >= 0.
    velocity : (float, float)
        Velocity along the plane and away from it at the start [m/s].
    spin : float
        Spin at the start, positive when rolling forward [rad/s].
    g : float
        Gravity towards the plane [m/s^2], >= 0.
    mu : float
        Friction coefficient, >= 0.
    dt : float
        Time step [s], > 0.
    theta : float
        Parameter of the scheme, in [1/2, 1].
    restitution : float or None
        Newton's coefficient, in [0, 1]; None: the theta scheme's own impact law.
    dilates : bool
        True: associated sliding rule; False: Coulomb's.
    n_steps : int
        Number of steps.

    Returns
    -------
    PlaneSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: theta scheme of Lim's thesis, appendix A, (A.1) with rotations; Moreau (1988) for the impact law at velocity level;
    de Saxce & Feng (1998) for Coulomb's rule. Solved here.
    """
    positive(radius=radius, dt=dt)
    not_negative(gap=gap, g=g, mu=mu)
    count(n_steps=n_steps)
    theta_in_range(theta)
    positive_or_inf(inertia_ratio=inertia_ratio)
    finite(spin=spin)
    velocity = pair("velocity", velocity)
    flag(dilates=dilates)
    if restitution is not None:
        fraction(restitution=restitution)
    ext = np.longdouble
    step, weight, arm, turn, friction = ext(dt), ext(theta), ext(radius), 1 / ext(inertia_ratio), ext(mu)
    back = (1 - weight) / weight
    x, vx, height, vy, w = ext(0), ext(velocity[0]), ext(gap), ext(velocity[1]), ext(spin)
    rows = np.empty((n_steps + 1, 5), dtype=ext)
    rows[0] = (x, vx, height, vy, w)
    for n in range(1, n_steps + 1):
        slip, free = vx - arm * w, vy - ext(g) * step
        if restitution is None:
            opening = height / (weight * step) + back * vy + free
            along = (back + 1) * slip
            meets = True
        else:
            opening, along = free + (ext(restitution) * vy if vy < 0 else vy), slip
            rise = friction * abs(slip) * step if dilates else ext(0)
            meets = bool(height + step * (weight * free + (1 - weight) * vy) - rise < TOUCH * arm)
        normal, shear = _impulses(opening, along, friction, 1 + turn, dilates) if meets else (ext(0), ext(0))
        after = (vx - shear, free + normal, w + shear * turn / arm)
        x += step * (weight * after[0] + (1 - weight) * vx)
        height += step * (weight * after[1] + (1 - weight) * vy)
        vx, vy, w = after
        rows[n] = (x, vx, height, vy, w)
    return PlaneSteps(*(rows[:, k].astype(np.float64) for k in range(5)))


def _impulses(
    opening: np.longdouble, along: np.longdouble, mu: np.longdouble, ease: np.longdouble, dilates: bool
) -> tuple[np.longdouble, np.longdouble]:
    """P and Q of one step; ``ease`` is ``1 + 1/k``."""
    zero = np.longdouble(0)
    if opening >= (mu * abs(along) if dilates else 0):
        return zero, zero
    stick = along / ease
    if opening <= 0 and abs(stick) <= -mu * opening:
        return -opening, stick
    normal = (mu * abs(along) - opening) / (1 + mu**2 * ease) if dilates else -opening
    return normal, mu * normal * np.sign(along)
