"""A rigid box that rocks on its edges (Housner, The behavior of inverted pendulum structures during earthquakes, 1963)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from ninedisk.references._validate import not_negative, positive, times_of

FloatArray = NDArray[np.float64]


def rocking_ratio(*, half_length: float, half_height: float, inertia: float) -> float:
    """Spin after over spin before the impact in which a box passes from one edge to the other: 1 - (3/2) sin^2(alpha) if uniform.

    Its angular momentum about the new edge is kept: ``(I + h^2 - b^2)/(I + h^2 + b^2)``.

    Parameters
    ----------
    half_length, half_height : float
        Half the edges across the axis of rocking, level and upright [m], > 0.
    inertia : float
        Moment of inertia about the axis through the centre, over the mass [m^2], > 0.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> round(rocking_ratio(half_length=1.0, half_height=2.0, inertia=5.0 / 3.0), 12)
    0.7
    """
    positive(half_length=half_length, half_height=half_height, inertia=inertia)
    b, h = half_length, half_height
    return (inertia + h * h - b * b) / (inertia + h * h + b * b)


class Rocking(NamedTuple):
    """``angle`` [rad] and ``spin`` [rad/s] of a box on an edge, NaN once it ``lands`` [s]; the friction ``needed`` [-]."""

    angle: FloatArray
    spin: FloatArray
    lands: float
    needed: float


def rocking_box(
    t: ArrayLike, *, spin: float, half_length: float, half_height: float, inertia: float, g: float
) -> Rocking:
    """Motion of a box about a held edge, from standing flat with a spin that lifts it, until it lands again; integrated to 1e-12.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    spin : float
        At time 0 [rad/s], >= 0, and too small to turn it over.
    half_length, half_height, inertia
        As of `rocking_ratio`.
    g : float
        Gravity [m/s^2], > 0.

    Raises
    ------
    ValueError
        If a value is out of its range, or the box falls over.
    """
    times = times_of(t)
    positive(half_length=half_length, half_height=half_height, inertia=inertia, g=g)
    not_negative(spin=spin)
    slender, radius = math.atan2(half_length, half_height), math.hypot(half_length, half_height)
    rate = g * radius / (inertia + radius**2)
    most = math.sqrt(2.0 * rate * (1.0 - math.cos(slender)))
    if not spin < 0.999 * most:
        raise ValueError(f"spin = {spin!r} is not allowed: the box falls over; it must be < {0.999 * most:g}")

    # Turns in units of the one that gravity would stop if it stayed as it is, times in those of that stop: any spin is as good.
    slow = rate * math.sin(slender)
    unit, whole = spin / slow, spin * (spin / slow)

    def turning(_: float, y: FloatArray) -> list[float]:
        return [float(y[1]), -math.sin(slender - whole * float(y[0])) / math.sin(slender)]

    def landing(_: float, y: FloatArray) -> float:
        return float(y[0]) if y[1] < 0.0 else 1.0

    landing.terminal = True  # type: ignore[attr-defined]
    angle, turned = np.full(len(times), np.nan), np.full(len(times), np.nan)
    if not unit > 0.0:
        return Rocking(angle, turned, 0.0, slow * half_height / (g - slow * half_length))
    # Within a thousandth of the balance it stays for ln(1000) times of the growth there at most, on each way.
    until = max(20.0 / math.sqrt(rate) / unit, 3.0)
    found: Any = solve_ivp(
        turning, (0.0, until), [0.0, 1.0], method="DOP853", rtol=1e-12, atol=1e-14, events=landing, dense_output=True
    )
    lands = float(found.t_events[0][0])
    aloft = times < lands * unit
    angle[aloft], turned[aloft] = found.sol(times[aloft] / unit) * [[whole], [spin]]
    all_angles, all_spins = found.sol(np.linspace(0.0, lands, 200)) * [[whole], [spin]]
    lean = slender - all_angles
    alpha = -rate * np.sin(lean)
    level = radius * (alpha * np.cos(lean) + all_spins**2 * np.sin(lean))
    upright = g + radius * (alpha * np.sin(lean) - all_spins**2 * np.cos(lean))
    return Rocking(angle, turned, lands * unit, float(np.max(np.abs(level) / upright)))
