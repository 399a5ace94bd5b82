"""Row of three disks squeezed by smooth walls: a damped oscillator under a ramp."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import not_negative, positive, times_of

FloatArray = NDArray[np.float64]


def steady_force(*, kn: float, v_wall: float, t_wall: float) -> float:
    """Force of every contact once all is at rest [N]: ``kn v_wall t_wall / 2``.

    Each wall has closed ``v_wall t_wall``, shared by two equal springs in series.

    Parameters
    ----------
    kn : float
        Normal stiffness [N/m], > 0.
    v_wall : float
        Speed of each wall [m/s], >= 0.
    t_wall : float
        Duration of the walls' motion [s], >= 0.
    """
    positive(kn=kn)
    not_negative(v_wall=v_wall, t_wall=t_wall)
    return kn * v_wall * t_wall / 2.0


def row_frequency(*, kn: float, mass: float) -> float:
    """Angular frequency of the symmetric motion [rad/s]: ``sqrt(2 kn/mass)``.

    Parameters
    ----------
    kn : float
        Normal stiffness [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.
    """
    positive(kn=kn, mass=mass)
    return math.sqrt(2.0 * kn / mass)


def damping_ratio(*, kn: float, mass: float, xi: float) -> float:
    """Fraction of critical damping of the symmetric motion [-]: ``xi / (2 omega)``.

    Parameters
    ----------
    kn : float
        Normal stiffness [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.
    xi : float
        Global damping [1/s], >= 0.
    """
    not_negative(xi=xi)
    return xi / (2.0 * row_frequency(kn=kn, mass=mass))


def undamped_amplitude(*, kn: float, mass: float, v_wall: float, t_wall: float) -> float:
    """Amplitude of the contact forces' oscillation after the walls stop [N], for xi = 0.

    A ramp minus the same ramp delayed by T leaves ``-(v/(2 omega)) (sin omega t - sin omega (t - T))``, whose
    amplitude times kn is ``(kn v/omega) |sin(omega T/2)|``.

    Parameters
    ----------
    kn : float
        Normal stiffness [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.
    v_wall : float
        Speed of each wall [m/s], >= 0.
    t_wall : float
        Duration of the walls' motion [s], >= 0.
    """
    not_negative(v_wall=v_wall, t_wall=t_wall)
    omega = row_frequency(kn=kn, mass=mass)
    return kn * v_wall / omega * abs(math.sin(omega * t_wall / 2.0))


def continuous_row(
    t: ArrayLike, *, kn: float, mass: float, xi: float, v_wall: float, t_wall: float
) -> tuple[FloatArray, FloatArray]:
    """Contact forces of ``m x'' + xi m x' + 2 kn x = kn w(t)``, ``w = v_wall min(t, t_wall)``, from rest.

    Under-, over- and critically damped alike. The response to the ramp ``omega^2 s t``, ``s = v_wall/2``, is
    ``s (t - xi/omega^2) + exp(-xi t/2) (A C(t) + (xi A/2 - s) S(t))`` with ``A = s xi/omega^2``, C and S the cosine
    and sine (or hyperbolic) solutions with ``C(0) = 1, S'(0) = 1``; the hold subtracts the same response delayed by
    ``t_wall``.

    No contact ever opens: x is ``v_wall/2`` times the integral of the oscillator's step response over the last
    ``t_wall``, and that response lies in [0, 2], so ``0 <= x <= w``.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    kn : float
        Normal stiffness [N/m], > 0.
    mass : float
        Mass of a disk [kg], > 0.
    xi : float
        Global damping [1/s], >= 0.
    v_wall : float
        Speed of each wall [m/s], >= 0.
    t_wall : float
        Duration of the walls' motion [s], >= 0.

    Returns
    -------
    fn_disk_disk, fn_wall : ndarray
        Normal forces [N] of the shape of ``t``.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    not_negative(xi=xi, v_wall=v_wall, t_wall=t_wall)
    times = times_of(t)
    omega = row_frequency(kn=kn, mass=mass)
    hold = np.maximum(times - t_wall, 0.0)
    x = v_wall / 2.0 * (ramp_response(times, omega, xi) - ramp_response(hold, omega, xi))
    wall = v_wall * np.minimum(times, t_wall)
    return kn * x, kn * (wall - x)


def ramp_response(t: FloatArray, omega: float, xi: float) -> FloatArray:
    """Response [s] of ``x'' + xi x' + omega^2 x = omega^2 t`` from rest at 0; omega [rad/s] > 0, xi [1/s] >= 0."""
    positive(omega=omega)
    not_negative(xi=xi)
    t = times_of(t)
    half = xi / 2.0
    square = omega**2 - half**2
    if square > 0.0:
        wd = math.sqrt(square)
        cosine, sine = np.exp(-half * t) * np.cos(wd * t), np.exp(-half * t) * np.sin(wd * t) / wd
    elif square < 0.0:
        kappa = math.sqrt(-square)
        # -half + kappa = -omega^2/(half + kappa) without cancellation.
        slow, fast = np.exp(-(omega**2) / (half + kappa) * t), np.exp(-(half + kappa) * t)
        cosine, sine = (slow + fast) / 2.0, (slow - fast) / (2.0 * kappa)
    else:
        cosine, sine = np.exp(-half * t), np.exp(-half * t) * t
    lag = xi / omega**2
    return np.asarray(t - lag + lag * cosine + (half * lag - 1.0) * sine, dtype=np.float64)
