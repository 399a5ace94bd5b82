"""A convex grain that rolls on an incline without slip: when it tips over, and how it then moves.

The grain is given by its support function ``p``: with the outward normal of the touching place turned by ``phi`` in the grain, the centroid
is ``p`` above the plane and ``p'`` behind the touching place, and rolling on by ``dphi`` moves it by ``p dphi`` along the plane
and by ``p' dphi`` off it. Hence, with k the radius of gyration, from rest

    ``1/2 (k^2 + p^2 + p'^2) omega^2 = g (sin(angle) integral of p - cos(angle) change of p)``

and the grain can rest where ``tan(angle) = p'/p``: the centroid is then above the touching place. On a slope of more than the
largest ``p'/p`` it can rest nowhere. A disk has p' = 0; on a corner that is rounded by a radius rho about a centre c from the centroid,
``p = rho + c cos``, ``p' = c sin`` of the angle still to go until the centre is below the centroid.

Source: the support function, Santalo, Integral Geometry and Geometric Probability (1976), section I.1.2; the rest is Newton and Euler.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import array, count, finite, fraction, positive, slope

FloatArray = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)
"""Gauss rule of the integrals over ``phi``: the integrands are analytic over a length of the order of 1."""


class RollingShape(Protocol):
    """What rolling needs to know of a shape."""

    @property
    def start(self) -> float:
        """``phi`` at which the shape is released to roll [rad]: where p'/p is largest."""
        ...

    @property
    def gyration(self) -> float:
        """Square of the radius of gyration about the centroid [m^2]."""
        ...

    def height(self, phi: FloatArray) -> FloatArray:
        """Support function p [m]."""
        ...

    def ahead(self, phi: FloatArray) -> FloatArray:
        """Its derivative p' [m]."""
        ...

    def bend(self, phi: FloatArray) -> FloatArray:
        """Its second derivative p'' [m]; ``p + p''`` is the radius of curvature."""
        ...


@dataclass(frozen=True)
class RoundedPolygon:
    """Regular polygon, ``phi`` measured from a face on; valid up to the next face, ``phi = 2 pi/faces``, where it lands.

    Parameters
    ----------
    faces : int
        m >= 3.
    apothem : float
        Distance H of the faces from the centre [m], > 0.
    roundness : float
        Radius rho of the corners over the apothem, in [0, 1).
    """

    faces: int
    apothem: float
    roundness: float

    def __post_init__(self) -> None:
        positive(apothem=self.apothem)
        count(faces=self.faces, least=3)
        fraction(roundness=self.roundness)
        if self.roundness == 1.0:
            raise ValueError(
                "roundness = 1.0 is not allowed: it must be < 1; 1 is a disk, which rests nowhere on a slope"
            )

    @property
    def start(self) -> float:
        """On a face."""
        return 0.0

    @property
    def _half(self) -> float:
        return math.pi / self.faces

    @property
    def corner(self) -> float:
        """Distance of the corners' centres from the polygon's [m]."""
        return (1.0 - self.roundness) * self.apothem / math.cos(self._half)

    @property
    def area(self) -> float:
        """``m ((H - rho)^2 + 2 rho (H - rho)) tan(pi/m) + pi rho^2`` [m^2]."""
        rho, inner = self.roundness * self.apothem, (1.0 - self.roundness) * self.apothem
        return self.faces * inner * (inner + 2.0 * rho) * math.tan(self._half) + math.pi * rho**2

    @property
    def gyration(self) -> float:
        """Of m triangles about the centre, m rectangles on the faces and m sectors at the corners."""
        half, rho, c = self._half, self.roundness * self.apothem, self.corner
        inner, side = c * math.cos(half), c * math.sin(half)
        square = side * inner * (inner**2 / 2.0 + side**2 / 6.0)
        square += 2.0 * side * rho * ((4.0 * side**2 + rho**2) / 12.0 + (inner + rho / 2.0) ** 2)
        square += half * rho**2 * c**2 + 4.0 / 3.0 * c * rho**3 * math.sin(half) + half * rho**4 / 2.0
        return square * self.faces / self.area

    def height(self, phi: FloatArray) -> FloatArray:
        """``rho + c cos(pi/m - phi)``."""
        return np.asarray(self.roundness * self.apothem + self.corner * np.cos(self._half - phi))

    def ahead(self, phi: FloatArray) -> FloatArray:
        """``c sin(pi/m - phi)``."""
        return np.asarray(self.corner * np.sin(self._half - phi))

    def bend(self, phi: FloatArray) -> FloatArray:
        """``-c cos(pi/m - phi)``."""
        return np.asarray(-self.corner * np.cos(self._half - phi))


@dataclass(frozen=True)
class EllipseShape:
    """Ellipse of half-axes ``a > b`` [m]; ``phi`` is 0 where it stands on the end of the axis b and falls back to it.

    Parameters
    ----------
    a, b : float
    """

    a: float
    b: float

    def __post_init__(self) -> None:
        positive(a=self.a, b=self.b)
        if not self.a > self.b:
            raise ValueError(f"a = {self.a!r} is not allowed: it must be > b = {self.b!r}")

    @property
    def start(self) -> float:
        """``tan phi = b/a``, where p'/p is ``(a^2 - b^2)/(2 a b)``."""
        return math.atan2(self.b, self.a)

    @property
    def area(self) -> float:
        """``pi a b`` [m^2]."""
        return math.pi * self.a * self.b

    @property
    def gyration(self) -> float:
        """``(a^2 + b^2)/4``."""
        return 0.25 * (self.a**2 + self.b**2)

    def height(self, phi: FloatArray) -> FloatArray:
        """``sqrt(b^2 cos^2 + a^2 sin^2)``."""
        return np.asarray(np.hypot(self.b * np.cos(phi), self.a * np.sin(phi)))

    def ahead(self, phi: FloatArray) -> FloatArray:
        """``(a^2 - b^2) sin cos / p``."""
        return np.asarray((self.a**2 - self.b**2) * np.sin(phi) * np.cos(phi) / self.height(phi))

    def bend(self, phi: FloatArray) -> FloatArray:
        """``a^2 b^2/p^3 - p``: the radius of curvature less p."""
        p = self.height(phi)
        return np.asarray((self.a * self.b) ** 2 / p**3 - p)


def tipping_slope(shape: RollingShape) -> float:
    """Tangent of the steepest slope on which the shape can rest: ``p'/p`` at its start; ``(1 - roundness) tan(pi/m)`` of a polygon."""
    at = np.array([shape.start])
    return float(shape.ahead(at)[0] / shape.height(at)[0])


def energy_gained(shape: RollingShape, phi: FloatArray, *, start: float, angle: float, g: float) -> FloatArray:
    """Kinetic energy over mass [m^2/s^2] at each ``phi``, released from rest at ``start`` [rad], on a slope of ``angle`` [rad]."""
    slope(angle)
    positive(g=g)
    finite(start=start)
    half = 0.5 * (array("phi", phi) - start)
    path = half * (shape.height(start + half[..., None] * (1.0 + NODES)) @ WEIGHTS)
    lift = shape.height(np.asarray(phi)) - shape.height(np.array([start]))[0]
    return np.asarray(g * (math.sin(angle) * path - math.cos(angle) * lift))


def kinetic_of(shape: RollingShape, phi: FloatArray, spin: FloatArray) -> FloatArray:
    """Kinetic energy over mass [m^2/s^2] of the shape that rolls with ``spin`` [rad/s] at ``phi`` [rad]."""
    phi, spin = array("phi", phi), array("spin", spin)
    return np.asarray(0.5 * (shape.gyration + shape.height(phi) ** 2 + shape.ahead(phi) ** 2) * np.square(spin))


def spin_at(shape: RollingShape, phi: FloatArray, *, start: float, angle: float, g: float) -> FloatArray:
    """Spin [rad/s] at each ``phi``, positive when it rolls down; NaN where it cannot come from rest at ``start``."""
    with np.errstate(invalid="ignore"):
        gained = energy_gained(shape, phi, start=start, angle=angle, g=g)
        return np.asarray(np.sqrt(gained / kinetic_of(shape, np.asarray(phi), np.ones_like(phi))))


def time_to(shape: RollingShape, end: float, *, start: float, angle: float, g: float) -> float:
    """Time [s] from rest at ``start`` to ``end`` [rad]; NaN if it does not come there.

    With ``phi = start + (end - start) u^2`` the integrand ``dphi/spin`` is smooth: the spin begins as the root of the way.
    """
    finite(end=end, start=start)
    u = 0.5 * (1.0 + NODES)
    spin = spin_at(shape, start + (end - start) * u**2, start=start, angle=angle, g=g)
    return float(0.5 * (2.0 * (end - start) * u / spin) @ WEIGHTS)


def forces_at(
    shape: RollingShape, phi: FloatArray, *, start: float, angle: float, g: float
) -> tuple[FloatArray, FloatArray]:
    """Normal and shear force over weight at each ``phi`` of the motion from rest at ``start``; shear is positive up the incline.

    ``m d(p omega)/dt = m g sin - fs`` and ``m d(p' omega)/dt = fn - m g cos``, where ``d omega/dt`` follows from the energy's slope,
    ``(k^2 + p^2 + p'^2) d omega/dt = g (p sin - p' cos) - p' (p + p'') omega^2``. A normal force below 0 means that it would leave
    the plane.
    """
    at = array("phi", phi)
    p, q, bend = shape.height(at), shape.ahead(at), shape.bend(at)
    square = 2.0 * energy_gained(shape, at, start=start, angle=angle, g=g) / (shape.gyration + p * p + q * q)
    rate = (g * (p * math.sin(angle) - q * math.cos(angle)) - q * (p + bend) * square) / (
        shape.gyration + p * p + q * q
    )
    normal = math.cos(angle) + (q * rate + bend * square) / g
    return np.asarray(normal), np.asarray(math.sin(angle) - (p * rate + q * square) / g)
