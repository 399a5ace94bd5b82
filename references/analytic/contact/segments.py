"""A free body under forces that are constant by segments of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, finite, positive, times_of

FloatArray = NDArray[np.float64]


class Driven(NamedTuple):
    """Way [m] and velocity [m/s] of a body, or angle [rad] and spin [rad/s], at the times asked for."""

    path: FloatArray
    rate: FloatArray


def under_segments(t: ArrayLike, *, inertia: float, start: float, segments: Sequence[Sequence[float]]) -> Driven:
    """``inertia path'' = sum of the forces whose segment holds t``: a force F from b to e adds ``F (min(t, e) - b)`` to the momentum.

    Parameters
    ----------
    t : array_like
        Times [s], >= 0.
    inertia : float
        Mass [kg] or moment of inertia [kg m^2], > 0.
    start : float
        Velocity [m/s] or spin [rad/s] at time 0.
    segments : sequence of (begin, end, force)
        Times [s] with ``0 <= begin < end`` and force [N] or torque [N m] of each.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Source: Newton's second law; derived here.
    """
    times = times_of(t)
    positive(inertia=inertia)
    finite(start=start)
    rows = array("segments", segments, dimensions=(2,))
    if rows.shape[1] != 3 or not ((rows[:, 0] >= 0.0) & (rows[:, 0] < rows[:, 1])).all():
        raise ValueError(
            f"segments = {segments!r:.200} are not allowed: each must be (begin, end, force) with 0 <= begin < end"
        )
    path, rate = start * times, np.full_like(times, start)
    for begin, end, force in rows:
        within, after = np.clip(times - begin, 0.0, end - begin), np.maximum(times - end, 0.0)
        rate = rate + force / inertia * within
        path = path + force / inertia * (0.5 * within**2 + (end - begin) * after)
    return Driven(path, rate)
