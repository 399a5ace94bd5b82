"""Energy that the chord's force takes from two colliding ellipses, to leading order in the overlap.

The force of `ninedisk.core.law.ContactLaw` with ``contact = "chord"`` is kn times the overlap, at right angles to the chord in its middle.
Where the outlines have a common normal n, with s along the tangent t, the first outline is ``d - k1 s^2/2 - k1' s^3/6`` and the second
one ``k2 s^2/2 + k2' s^3/6`` along n; k are the curvatures and k' their slopes along s. With K = k1 + k2 and K' = k1' + k2' the
intersections are at ``+-sqrt(2 d/K)`` about the middle ``B d``, ``B = -K'/(3 K^2)``, and the chord rises with the slope ``T d``,
``T = k2 B + k2'/(3 K)``. The power that the bodies lose is therefore ``kn d (d' - d (T u_t + B Omega))``: besides the rate d' of the
depth, whose integral over the contact is 0, the relative velocity along t and the relative spin. The depth is half a period of a
spring, ``d = (u_n/w) sin(w t)``, ``w^2 = kn/m_eff``, during which u_t and Omega go from their values before to those after, symmetrically
about its middle; so that the energy changes by

    ``kn (u_n/w)^2 pi/(2 w) (T u_t + B Omega)``, with the means of u_t and Omega before and after,

which is of the order of the overlap over the size. What is left out is of second order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import finite, pair, positive

FloatArray = NDArray[np.float64]

DIRECTIONS, HALVINGS = 721, 60
"""Directions among which the common normal is sought, and halvings of intervals: to the last bits."""


@dataclass(frozen=True)
class MovingEllipse:
    """An ellipse in free motion: half-axes [m], mass [kg], inertia [kg m^2]; position [m], velocity [m/s], angle [rad], spin [rad/s]."""

    a: float
    b: float
    mass: float
    inertia: float
    x: ArrayLike
    v: ArrayLike
    angle: float
    spin: float

    def __post_init__(self) -> None:
        positive(a=self.a, b=self.b, mass=self.mass, inertia=self.inertia)
        finite(angle=self.angle, spin=self.spin)
        pair("x", self.x)
        pair("v", self.v)

    def centre(self, t: float) -> FloatArray:
        """Position at a time [m]."""
        return np.asarray(self.x, dtype=np.float64) + t * np.asarray(self.v, dtype=np.float64)

    def support(self, phi: FloatArray, t: float) -> tuple[FloatArray, FloatArray]:
        """Support function about the centre for outward normals at the angles ``phi``, and its derivative [m]."""
        own = phi - self.angle - self.spin * t
        height = np.hypot(self.a * np.cos(own), self.b * np.sin(own))
        return height, (self.b**2 - self.a**2) * np.sin(own) * np.cos(own) / height

    def curvature(self, phi: float, t: float) -> tuple[float, float]:
        """Curvature [1/m] where the outward normal is at the angle ``phi``, and its slope along the outline, counter-clockwise [1/m^2]."""
        height, slope = (float(value) for value in self.support(np.array(phi), t))
        radius = (self.a * self.b) ** 2 / height**3
        return 1.0 / radius, 3.0 * slope / height / radius**2


def _separation(one: MovingEllipse, two: MovingEllipse, t: float, phi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gap between the two tangents with normals at the angles ``phi`` [m], and its derivative; the distance is the largest."""
    apart = two.centre(t) - one.centre(t)
    h1, s1 = one.support(phi, t)
    h2, s2 = two.support(phi + math.pi, t)
    along = np.cos(phi) * apart[0] + np.sin(phi) * apart[1]
    return along - h1 - h2, np.cos(phi) * apart[1] - np.sin(phi) * apart[0] - s1 - s2


def _coarse(one: MovingEllipse, two: MovingEllipse, t: float) -> tuple[FloatArray, FloatArray]:
    """Some angles about the line of centres, and the separations there."""
    apart = two.centre(t) - one.centre(t)
    angles = math.atan2(apart[1], apart[0]) + np.linspace(-0.5, 0.5, DIRECTIONS) * math.pi
    return angles, _separation(one, two, t, angles)[0]


def gap_and_direction(one: MovingEllipse, two: MovingEllipse, t: float) -> tuple[float, float]:
    """Distance of two ellipses that are apart [m], and the direction of their common normal [rad]: that of the largest separation."""
    finite(t=t)
    angles, separations = _coarse(one, two, t)
    k = int(np.argmax(separations))
    low, high = float(angles[max(k - 1, 0)]), float(angles[min(k + 1, DIRECTIONS - 1)])
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _separation(one, two, t, np.array(middle))[1] > 0.0 else (low, middle)
    return float(_separation(one, two, t, np.array(low))[0]), low


def touching_time(one: MovingEllipse, two: MovingEllipse, until: float) -> float:
    """When two ellipses that are apart at time 0 first touch [s], to a thousandth of ``until`` at least and then to the last bits.

    Raises
    ------
    ValueError
        If they do not.
    """
    positive(until=until)
    times = np.linspace(0.0, until, 1001)

    def meet(t: float) -> bool:
        # One tangent between the two shows that they are apart; the largest separation is needed about the first touch alone.
        return bool(_coarse(one, two, t)[1].max() <= 0.0) and gap_and_direction(one, two, t)[0] < 0.0

    k = next((k for k in range(1, 1001) if meet(float(times[k]))), 0)
    if k == 0 or gap_and_direction(one, two, 0.0)[0] <= 0.0:
        raise ValueError(f"until = {until!r} s is not allowed: the ellipses must be apart at time 0 and touch before")
    low, high = float(times[k - 1]), float(times[k])
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap_and_direction(one, two, middle)[0] > 0.0 else (low, middle)
    return low


class ChordWork(NamedTuple):
    """Change of the kinetic energy by the collision [J], and the largest overlap [m]."""

    change: float
    depth: float


def chord_work(one: MovingEllipse, two: MovingEllipse, *, kn: float, until: float) -> ChordWork:
    """What the chord's force does in the collision, see the module.

    Parameters
    ----------
    one, two : MovingEllipse
        At time 0, apart.
    kn : float
        Normal stiffness [N/m], > 0.
    until : float
        Time [s] before which they touch.
    """
    positive(kn=kn)
    t = touching_time(one, two, until)
    _, phi = gap_and_direction(one, two, t)
    n, along = np.array([math.cos(phi), math.sin(phi)]), np.array([-math.sin(phi), math.cos(phi)])
    height, slope = one.support(np.array(phi), t)
    arm1 = float(height) * n + float(slope) * along
    arm2 = one.centre(t) + arm1 - two.centre(t)
    b1, b2 = float(arm1 @ along), float(arm2 @ along)
    apart = np.asarray(one.v, dtype=np.float64) - np.asarray(two.v, dtype=np.float64)
    approach = float(apart @ n) - b1 * one.spin + b2 * two.spin
    inverse = 1.0 / one.mass + 1.0 / two.mass + b1**2 / one.inertia + b2**2 / two.inertia
    # Half of the elastic impulse leads to the means of before and after.
    half = approach / inverse
    spin1, spin2 = one.spin + half * b1 / one.inertia, two.spin - half * b2 / two.inertia
    tangential = float(apart @ along) + spin1 * float(arm1 @ n) - spin2 * float(arm2 @ n)
    k1, k1_slope = one.curvature(phi, t)
    # The second outline runs in the other direction along the tangent.
    k2, against = two.curvature(phi + math.pi, t)
    k2_slope = -against
    total, total_slope = k1 + k2, k1_slope + k2_slope
    middle = -total_slope / (3.0 * total**2)
    rise = k2 * middle + k2_slope / (3.0 * total)
    frequency = math.sqrt(kn * inverse)
    depth = approach / frequency
    change = kn * depth**2 * math.pi / (2.0 * frequency) * (rise * tangential + middle * (spin1 - spin2))
    return ChordWork(change, depth)
