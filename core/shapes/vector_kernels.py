"""Vectors of three numbers in registers.

Nothing here is fused: the vector product of two parallel vectors is exactly 0, and a product has the same bits with its factors exchanged.
"""

from __future__ import annotations

from math import sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.shapes.state import Floats, Vector


@inline_kernel
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline_kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline_kernel
def plus(a: Vector, s: float, b: Vector) -> Vector:
    """``a + s b``."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@inline_kernel
def minus(a: Vector, b: Vector) -> Vector:
    """``a - b``."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline_kernel
def scaled(a: Vector, s: float) -> Vector:
    """``s a``."""
    return s * a[0], s * a[1], s * a[2]


@inline_kernel
def row(table: Floats, k: int) -> Vector:
    """Row k of a table of vectors."""
    return table[k, 0], table[k, 1], table[k, 2]


@inline_kernel
def put(table: Floats, k: int, a: Vector) -> None:
    """Make ``a`` row k of a table of vectors."""
    table[k, 0], table[k, 1], table[k, 2] = a[0], a[1], a[2]


@inline_kernel
def tangents(n: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors that make a right-handed frame ``(n, t1, t2)`` with the unit vector ``n``.

    ``t1`` is ``n`` times the axis of the scene with which ``n`` has the largest angle, the first of equal ones.
    """
    x, y, z = abs(n[0]), abs(n[1]), abs(n[2])
    if x <= y and x <= z:
        size = sqrt(n[1] * n[1] + n[2] * n[2])
        first = (0.0, n[2] / size, -n[1] / size)
    elif y <= z:
        size = sqrt(n[0] * n[0] + n[2] * n[2])
        first = (-n[2] / size, 0.0, n[0] / size)
    else:
        size = sqrt(n[0] * n[0] + n[1] * n[1])
        first = (n[1] / size, -n[0] / size, 0.0)
    return first, cross(n, first)
