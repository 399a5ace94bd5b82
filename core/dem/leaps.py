"""Bodies that move so far in a contact step that they could jump over a contact, in the plane and in space.

Rule: two bodies whose paths meet may move at most by the smaller one's radius relative to each other in a step. Then no step that a
contact starts in takes a centre through the other body's surface, which at walls is an error, too. A contact that lies between two steps
is no deeper than a sixteenth of that radius: a chord of length s of the circle of radius ``R_i + R_j`` is ``s^2/(8 (R_i + R_j))`` high.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray


def leaping_pair(
    x: FloatArray, step: FloatArray, size: FloatArray, radius: FloatArray, fixed: NDArray[np.bool_], skin: float
) -> tuple[int, int] | None:
    """Two of n bodies in d dimensions that meet and move farther than they may (see the module); None if there are none.

    Lists of neighbours are looked at when they are renewed, which they are before a body has moved by half of ``skin``. So the straight
    path of the last step counts as long by the skin at both ends.

    Parameters
    ----------
    x, step : ndarray, shape (n, d)
        Centres, and displacements in the step that led there [m].
    size, radius : ndarray, shape (n,)
        Allowed displacement, and radius of the circle or sphere around each body [m].
    fixed : ndarray of bool, shape (n,)
        Bodies that have no contact among each other.
    skin : float
        [m].
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        own = np.linalg.norm(step - 0.5 * (step.min(axis=0) + step.max(axis=0)), axis=1)
        order = np.argsort(x[:, 0], kind="stable")
        along = x[order, 0]
        # Of two bodies one moves by more than half of what both do relative to each other: the faster one looks for the other.
        for i in np.argsort(-own, kind="stable").tolist():
            if not 2.0 * own[i] > size.min():
                break
            reach = radius[i] + radius.max() + 2.0 * own[i] + skin
            near = order[
                np.searchsorted(along, x[i, 0] - reach) : np.searchsorted(along, x[i, 0] + reach, side="right")
            ]
            near = near[(near != i) & ~(fixed[near] & fixed[i])]
            apart, move = x[near] - x[i], step[near] - step[i]
            way = np.linalg.norm(move, axis=1)
            when = np.clip(-np.sum(apart * move, axis=1) / way**2, -(1.0 + skin / way), skin / way)
            distance = np.linalg.norm(apart + when[:, None] * move, axis=1)
            met = (way > np.minimum(size[near], size[i])) & (distance < radius[near] + radius[i])
            if met.any():
                return i, int(near[np.argmax(met)])
    return None
