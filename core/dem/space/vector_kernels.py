"""Vectors of three numbers in registers: products, turns, projections."""

from __future__ import annotations

from math import cos, floor, sin, sqrt

from ninedisk.core.compile import fused_inline_kernel, inline_kernel
from ninedisk.core.dem.space.state import Floats, Vector


@fused_inline_kernel
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@fused_inline_kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@fused_inline_kernel
def plus(a: Vector, s: float, b: Vector) -> Vector:
    """``a + s b``."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@inline_kernel
def row(table: Floats, i: int, first: int) -> Vector:
    """Three columns of a row."""
    return table[i, first], table[i, first + 1], table[i, first + 2]


@inline_kernel
def turned(a: Vector, axis: Vector, time: float) -> Vector:
    """``a`` turned by ``time`` times the angular velocity ``axis`` [rad/s] (Rodrigues)."""
    rate = sqrt(dot(axis, axis))
    if rate == 0.0:
        return a
    u = (axis[0] / rate, axis[1] / rate, axis[2] / rate)
    c, s = cos(rate * time), sin(rate * time)
    part = plus((c * a[0], c * a[1], c * a[2]), s, cross(u, a))
    return plus(part, (1.0 - c) * dot(u, a), u)


@fused_inline_kernel
def scaled(q: Vector, s: float) -> Vector:
    """``s q``."""
    return s * q[0], s * q[1], s * q[2]


@fused_inline_kernel
def carried(q: Vector, before: Vector, n: Vector) -> Vector:
    """A vector at right angles to ``before``, turned with the normal into ``n`` on the shortest way: its size stays to round-off."""
    share = dot(q, n) / (1.0 + dot(before, n))
    return plus(q, -share, (before[0] + n[0], before[1] + n[1], before[2] + n[2]))


@fused_inline_kernel
def projected(q: Vector, n: Vector) -> Vector:
    """A vector's part at right angles to ``n``, stretched to the size that the vector had."""
    flat = plus(q, -dot(q, n), n)
    now = dot(flat, flat)
    return scaled(flat, sqrt(dot(q, q) / now) if now > 0.0 else 1.0)


@fused_inline_kernel
def capped(q: Vector, limit: float) -> Vector:
    """``q`` shortened to ``limit``."""
    size = sqrt(dot(q, q))
    return scaled(q, limit / size if size > limit else 1.0)


TURN, TURN_REST = 6.283185307179586, 2.4492935982947064e-16
"""A turn [rad] as the sum of two numbers."""
PER_TURN = 1.0 / TURN
S3, S5, S7, S9, S11, S13 = (-1.0 / (m * (m - 1.0)) for m in (3.0, 5.0, 7.0, 9.0, 11.0, 13.0))
C2, C4, C6, C8, C10, C12 = (-1.0 / (m * (m - 1.0)) for m in (2.0, 4.0, 6.0, 8.0, 10.0, 12.0))
"""Factors from one term of the series of sine and cosine to the next."""


@fused_inline_kernel
def spun(q: Vector, n: Vector, angle: float) -> Vector:
    """``q``, at right angles to the unit vector ``n``, turned about it by an angle [rad].

    Vector registers know no sine: that of an eighth of the angle, after whole turns have been taken off, by its series to 6e-19, and
    three times the formulas of the double angle.
    """
    turns = floor(angle * PER_TURN + 0.5)
    a = 0.125 * (angle - turns * TURN - turns * TURN_REST)
    a2 = a * a
    s = a + a * (S3 * a2 * (1.0 + S5 * a2 * (1.0 + S7 * a2 * (1.0 + S9 * a2 * (1.0 + S11 * a2 * (1.0 + S13 * a2))))))
    c = 1.0 + C2 * a2 * (1.0 + C4 * a2 * (1.0 + C6 * a2 * (1.0 + C8 * a2 * (1.0 + C10 * a2 * (1.0 + C12 * a2)))))
    for _ in range(3):
        s, c = 2.0 * s * c, 1.0 - 2.0 * s * s
    return plus(scaled(q, c), s, cross(n, q))


@fused_inline_kernel
def half_spun(q: Vector, n: Vector, angle: float) -> Vector:
    """A rate at right angles to ``n`` as a spring feels it that turns by a small ``angle`` [rad] meanwhile: turned by half of it."""
    return plus(q, 0.5 * angle, cross(n, q))
