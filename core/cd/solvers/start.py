"""Where an iterative contact solver starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.cd.problem import ContactProblem
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError
from ninedisk.core.validate import numbers


def starting_forces(problem: ContactProblem, start: ArrayLike | None) -> NDArray[np.float64]:
    """Contact forces, shape (c, 2), inside the cones: ``start`` projected, or zero.

    Raises
    ------
    InvalidNumericsError
        If ``start`` has the wrong shape or is not finite.
    """
    shape = (problem.n_contacts, 2)
    if start is None:
        return np.zeros(shape)
    try:
        r = numbers("start", start)
    except InvalidSceneError as error:
        raise InvalidNumericsError(str(error)) from error
    if r.shape != shape or not np.isfinite(r).all():
        raise InvalidNumericsError(
            f"start, the starting forces, must be finite and of shape {shape}; they have shape {r.shape}"
        )
    p, q, mu = r[:, 0], np.abs(r[:, 1]), problem.mu
    outside = q > mu * p
    along = np.maximum(0.0, (p + mu * q) / (1.0 + mu * mu))
    r[:, 1] = np.where(outside, np.sign(r[:, 1]) * mu * along, r[:, 1])
    r[:, 0] = np.where(outside, along, p)
    return r
