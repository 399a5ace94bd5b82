"""Block on an incline from rest: exact steps of the associated, Coulomb and Euler schemes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import count, not_negative, positive, slope, theta_in_range
from ninedisk.references.exact_steps.sliding import SlidingSteps

FloatArray = NDArray[np.float64]
Extended = NDArray[np.longdouble]


def associated_incline(*, mu: float, angle: float, g: float, mass: float, dt: float, n_steps: int) -> SlidingSteps:
    """Theta = 1 with the associated sliding rule, starting in touch (gap 0).

    Every sliding step ends with ``gap_n = mu dt vx_n``, so the normal velocity is ``vy_n = mu (vx_n - vx_{n-1})`` and
    the increments ``dv_n = vx_n - vx_{n-1}`` obey ``dv_n = (1 - r) a dt + r dv_{n-1}`` with ``r = mu^2/(1 + mu^2)``
    and ``a = g (sin - mu cos)``. Summed::

        vx_n = a dt (n - mu^2 (1 - r^n)),     x_n = a dt^2 (n (n + 1)/2 - mu^2 n + mu^4 (1 - r^n))
        vy_n = mu a dt (1 - r^n),             fn_n = m g cos + m mu a r^(n-1) (1 - r),   fs_n = mu fn_n

    For ``mu >= tan(angle)`` the block sticks: ``fn = m g cos``, ``fs = m g sin``, all else 0.

    Parameters
    ----------
    mu : float
        Friction coefficient, >= 0.
    angle : float
        Slope [rad], in [0, pi/2).
    g : float
        Gravity [m/s^2], > 0.
    mass : float
        Mass [kg], > 0.
    dt : float
        Time step [s], > 0.
    n_steps : int
        Number of steps.

    Returns
    -------
    SlidingSteps

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: (A.1)-(A.3) of Lim's thesis, appendix A.3; solved here.
    """
    n, a = _steps_and_acceleration(mu, angle, g, mass, dt, n_steps)
    if a is None:
        return _stick(angle, g, mass, n_steps)
    ext = np.longdouble
    mu2, step = ext(mu) ** 2, ext(dt)
    r = mu2 / (1 + mu2)
    decay = r**n
    vx = a * step * (n - mu2 * (1 - decay))
    fn = ext(mass) * (ext(g) * np.cos(ext(angle)) + ext(mu) * a * r ** np.maximum(n - 1, 0) * (1 - r))
    return _rounded(
        x=a * step**2 * (n * (n + 1) / 2 - mu2 * n + mu2**2 * (1 - decay)),
        vx=vx,
        gap=ext(mu) * step * vx,
        vy=ext(mu) * a * step * (1 - decay),
        fn=fn,
        fs=ext(mu) * fn,
    )


def coulomb_incline_theta(
    *, mu: float, angle: float, g: float, mass: float, dt: float, n_steps: int, theta: float
) -> SlidingSteps:
    """Theta scheme with Coulomb friction without dilation: ``x_n = a t^2/2 (1 + (2 theta - 1) dt/t)``, gap 0.

    ``theta`` in [1/2, 1]; other parameters, result and errors as in `associated_incline`.
    """
    theta_in_range(theta)
    # dx = dt (theta v1 + (1 - theta) v0) with v_n = n a dt: the offset counts theta instead of 1/2 per step.
    return _coulomb(mu, angle, g, mass, dt, n_steps, offset=2 * np.longdouble(theta) - 1)


def semi_implicit_euler_incline(
    *, mu: float, angle: float, g: float, mass: float, dt: float, n_steps: int
) -> SlidingSteps:
    """Velocity first, then position with the new velocity: ``x_n = a t^2/2 (1 + dt/t)``, exact Coulomb friction.

    Parameters, result and errors as in `associated_incline`.
    """
    return _coulomb(mu, angle, g, mass, dt, n_steps, offset=np.longdouble(1))


def position_first_euler_incline(
    *, mu: float, angle: float, g: float, mass: float, dt: float, n_steps: int
) -> SlidingSteps:
    """Position with the old velocity first, then velocity: ``x_n = a t^2/2 (1 - dt/t)``, exact Coulomb friction.

    The order of Chipmunk (pymunk). Parameters, result and errors as in `associated_incline`.
    """
    return _coulomb(mu, angle, g, mass, dt, n_steps, offset=np.longdouble(-1))


def _coulomb(
    mu: float, angle: float, g: float, mass: float, dt: float, n_steps: int, *, offset: np.longdouble
) -> SlidingSteps:
    n, a = _steps_and_acceleration(mu, angle, g, mass, dt, n_steps)
    if a is None:
        return _stick(angle, g, mass, n_steps)
    ext = np.longdouble
    zero = np.zeros_like(n)
    fn = np.full_like(n, ext(mass) * ext(g) * np.cos(ext(angle)))
    step = ext(dt)
    return _rounded(
        x=n * (n + offset) * (a * step * step / 2), vx=a * step * n, gap=zero, vy=zero, fn=fn, fs=ext(mu) * fn
    )


def _steps_and_acceleration(
    mu: float, angle: float, g: float, mass: float, dt: float, n_steps: int
) -> tuple[Extended, np.longdouble | None]:
    """Step numbers and ``g (sin - mu cos)``; None where the block sticks."""
    positive(g=g, mass=mass, dt=dt)
    not_negative(mu=mu)
    slope(angle)
    count(n_steps=n_steps)
    ext = np.longdouble
    excess = np.sin(ext(angle)) - ext(mu) * np.cos(ext(angle))
    return np.arange(n_steps + 1).astype(ext), ext(g) * excess if excess > 0 else None


def _stick(angle: float, g: float, mass: float, n_steps: int) -> SlidingSteps:
    ext = np.longdouble
    zero = np.zeros(n_steps + 1, dtype=ext)
    weight = ext(mass) * ext(g)
    fn, fs = weight * np.cos(ext(angle)), weight * np.sin(ext(angle))
    return _rounded(x=zero, vx=zero, gap=zero, vy=zero, fn=zero + fn, fs=zero + fs)


def _rounded(*, x: Extended, vx: Extended, gap: Extended, vy: Extended, fn: Extended, fs: Extended) -> SlidingSteps:
    steps = SlidingSteps(*(column.astype(np.float64) for column in (x, vx, gap, vy, fn, fs)))
    steps.fn[0] = steps.fs[0] = np.nan
    return steps
