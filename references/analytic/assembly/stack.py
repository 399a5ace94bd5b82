"""Disks at rest under gravity: a column, and three disks between smooth walls, rigid or on linear springs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.references._validate import positive, positive_or_inf, sizes

FloatArray = NDArray[np.float64]


class PyramidForces(NamedTuple):
    """Normal forces [N] of a disk that rests on two: ``side`` at each of them, ``wall`` and ``floor`` below either, and
    ``angle`` [rad] of the lines of centres to the vertical."""

    side: float
    wall: float
    floor: float
    angle: float


def column_forces(weights: Sequence[float]) -> FloatArray:
    """Contact forces of a column of disks [N], from the floor up: contact k bears disk k and all above it.

    Parameters
    ----------
    weights : sequence of float
        Weight of each disk [N], > 0, the lowest first.

    Returns
    -------
    ndarray, shape (n,)
    """
    return np.cumsum(np.array(sizes("weights", weights, strict=True))[::-1])[::-1]


def pyramid_forces(*, weight: float, chord: float, half_width: float, kn: float = math.inf) -> PyramidForces:
    """Forces of a disk on top of two others that do not touch each other, held by smooth walls and a smooth floor.

    With the lines of centres at ``angle`` to the vertical the top disk asks for ``2 side cos(angle) = weight``, a lower one for
    ``wall = side sin(angle)`` and ``floor = weight + weight/2``: statically determinate. On springs the walls give way by ``wall/kn``
    and the chord is shorter by ``side/kn``, so that ``sin(angle) = (half_width + wall/kn)/(chord - side/kn)``, which is iterated
    to the last bit (its contraction is about ``weight/(kn chord)``).

    Parameters
    ----------
    weight : float
        Weight of each disk [N], > 0.
    chord : float
        Distance of the centres in touch [m], ``2 R``.
    half_width : float
        Horizontal distance of the centres where all touch without force [m], in [chord/2, chord): the lower disks do not press each other.
    kn : float
        Stiffness of every contact [N/m], > 0; ``inf`` for rigid disks.

    Raises
    ------
    ValueError
        If an argument is out of range, or the springs are so soft that the top disk falls through.

    Notes
    -----
    Source: equilibrium of three forces; derived here.
    """
    positive(weight=weight, chord=chord, half_width=half_width)
    positive_or_inf(kn=kn)
    if not half_width >= 0.5 * chord:
        raise ValueError(
            f"half_width = {half_width!r} m is not allowed: it must be at least {0.5 * chord!r} m, where the lower disks touch"
        )
    angle = _angle(half_width, chord, kn)
    for _ in range(100):
        side = 0.5 * weight / math.cos(angle)
        wall = 0.5 * weight * math.tan(angle)
        before, angle = angle, _angle(half_width + wall / kn, chord - side / kn, kn)
        if abs(angle - before) <= 1e-16:
            break
    return PyramidForces(0.5 * weight / math.cos(angle), 0.5 * weight * math.tan(angle), 1.5 * weight, angle)


def _angle(opposite: float, chord: float, kn: float) -> float:
    if not 0.0 < opposite < chord:
        raise ValueError(
            f"half_width = {opposite!r} m is not allowed with kn = {kn:g} N/m: the top disk falls through, it must be below "
            f"the chord, {chord!r} m"
        )
    return math.asin(opposite / chord)
