"""A tower of boxes at rest: what each face bears and where, by statics alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.references._validate import array, positive, sizes, slope

FloatArray = NDArray[np.float64]


class TowerForces(NamedTuple):
    """Of the faces below each box, shape (n,): normal forces ``fn`` and friction ``fs``, up the slope [N].

    ``centre``, shape (n, 2), is where they act [m], in the axes of the places; the first one points down the slope.
    """

    fn: FloatArray
    fs: FloatArray
    centre: FloatArray


def tower_forces(
    mass: Sequence[float], half_height: Sequence[float], place: ArrayLike, *, angle: float, g: float
) -> TowerForces:
    """Forces below each box of a tower on an incline: they hold the weight of all boxes above, on its line of action.

    Single corners of a face are statically indeterminate; the resultant and its place are not.

    Parameters
    ----------
    mass : sequence of float
        Of the boxes [kg], > 0, the lowest first.
    half_height : sequence of float
        Half the edges normal to the incline [m], > 0.
    place : array_like, shape (n, 2)
        Of the centres, down the slope and across [m].
    angle : float
        Slope [rad], in [0, pi/2).
    g : float
        Gravity [m/s^2], > 0.

    Raises
    ------
    ValueError
        If a value is out of its range, or the numbers of boxes differ.

    Examples
    --------
    The second of two boxes, of twice the mass, is 0.3 m aside; both together press 0.2 m aside:

    >>> found = tower_forces([1.0, 2.0], [0.5, 0.5], [[0.0, 0.0], [0.3, 0.0]], angle=0.0, g=10.0)
    >>> found.fn.tolist(), found.centre[:, 0].round(12).tolist()
    ([30.0, 20.0], [0.2, 0.3])
    """
    masses, halves = (
        np.array(sizes(name, values, strict=True)) for name, values in (("mass", mass), ("half_height", half_height))
    )
    slope(angle)
    positive(g=g)
    at = array("place", place, dimensions=(2,))
    if len(halves) != len(masses) or at.shape != (len(masses), 2):
        raise ValueError(
            f"place of shape {at.shape} and half_height of {len(halves)} boxes are not allowed with mass of {len(masses)}: each box needs "
            "one half_height and two numbers of its place"
        )
    low = 2.0 * (np.cumsum(halves) - halves)
    middle = np.column_stack([at, low + halves])
    above = np.cumsum(masses[::-1])[::-1]
    centroid = np.cumsum((masses[:, None] * middle)[::-1], axis=0)[::-1] / above[:, None]
    centre = centroid[:, :2] + np.outer((centroid[:, 2] - low) * math.tan(angle), [1.0, 0.0])
    return TowerForces(above * g * math.cos(angle), above * g * math.sin(angle), centre)
