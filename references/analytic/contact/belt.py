"""Bodies on a belt that starts, stops and reverses: Coulomb friction takes them along."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, positive, times_of

FloatArray = NDArray[np.float64]


class BeltMotion(NamedTuple):
    """Displacement [m] and velocity [m/s] of a body along the belt, and displacement of the belt [m]."""

    x: FloatArray
    v: FloatArray
    belt: FloatArray


def belt_motion(t: ArrayLike, *, segments: Sequence[Sequence[float]], pull: float, ease: float) -> BeltMotion:
    """A body at rest at time 0 on a belt whose speed is constant by segments.

    While it slips, its velocity changes by ``pull`` in the direction of the slip, and the slip by ``ease`` times that; then it
    sticks, and a rolling body keeps its velocity: it is 1/ease of the belt's. The spin of a rolling body follows from the
    balance ``I w' = R m v'``.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    segments : sequence of (duration, speed)
        Of the belt [s], [m/s], durations > 0; it rests afterwards.
    pull : float
        mu g [m/s^2], > 0.
    ease : float
        1 for a block, ``1 + m R^2/I`` for a body that rolls, at least 1.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: Coulomb's law and Newton's second law; derived here.
    """
    times, rows = times_of(t), array("segments", segments, dimensions=(2,))
    positive(pull=pull, ease=ease)
    if ease < 1.0:
        raise ValueError(f"ease = {ease!r} is not allowed: it must be at least 1, that of a body that cannot turn")
    if rows.shape[1] != 2 or not (rows[:, 0] > 0.0).all():
        raise ValueError(
            f"segments = {segments!r:.200} are not allowed: each must be (duration, speed) with a duration > 0"
        )
    x, v, belt = (np.zeros_like(times) for _ in range(3))
    begin, place, speed, ran = 0.0, 0.0, 0.0, 0.0
    for duration, wanted in (*rows, (math.inf, 0.0)):
        change = wanted / ease - speed
        slips = min(abs(change) / pull, duration)
        within = np.clip(times - begin, 0.0, duration)
        here = (times >= begin) if begin else np.ones_like(times, dtype=bool)
        sliding = np.minimum(within, slips)
        rate = math.copysign(pull, change) if change else 0.0
        x = np.where(here, place + speed * within + rate * sliding * (within - 0.5 * sliding), x)
        v = np.where(here, speed + rate * sliding, v)
        belt = np.where(here, ran + wanted * within, belt)
        if math.isinf(duration):
            break
        place += speed * duration + rate * slips * (duration - 0.5 * slips)
        begin, speed, ran = begin + duration, speed + rate * slips, ran + wanted * duration
    return BeltMotion(x, v, belt)
