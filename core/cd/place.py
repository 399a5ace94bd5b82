"""Where bodies are in a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contact_kernels import gap_round_off, wall_way

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """Where bodies are: disks at the start of a step, walls at both its ends.

    Attributes
    ----------
    x : ndarray, shape (n, 2)
        Centres [m].
    angle : ndarray, shape (n,)
        Angles [rad].
    radius : ndarray, shape (n,)
        Radii [m]; of bodies with outlines, those of circles around them.
    before, after : ndarray, shape (m, 11)
        Walls.
    """

    x: FloatArray
    angle: FloatArray
    radius: FloatArray
    before: FloatArray
    after: FloatArray

    def round_off(self) -> float:
        """Error of a gap [m] that the rounding of coordinates explains."""
        return gap_round_off(self.x, self.radius, self.after)

    def wall_way(self) -> float:
        """Bound on the displacement of a wall's surface over the step near the disks [m]."""
        return wall_way(self.x, self.before, self.after)
