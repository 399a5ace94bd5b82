"""Periodic cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, at_least, finite


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A periodic cell that deforms affinely: every disk has images at all whole combinations of the cell's two edges.

    The edges are the columns of ``h(t) = (I + t rate) h(0)`` with ``h(0) = diag(size)``. The image of a disk that lies ``s`` edges away is
    displaced by ``h s`` and moves faster by ``h' s`` (Lees & Edwards, J. Phys. C 5 (1972) 1921). Positions and velocities of a disk are
    those of one and the same image throughout, whether it is still in the cell or not; disks begin where the scene puts them, with the
    scene's velocities: a uniform shear flow begins only where these are ``h' h^-1 x``.

    Parameters
    ----------
    size : (float, float)
        Edges along x and y at time 0 [m], > 0.
    rate : ((float, float), (float, float))
        Rate of deformation [1/s] as rows, ``d x_a / d x_b``; ``rate[0][1]`` is a simple shear. The first edge keeps its direction,
        ``rate[1][0] = 0``.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.

    Examples
    --------
    A cell of 2 m by 2 m under a simple shear of 0.5 1/s: after 1 s its second edge leans by 1 m:

    >>> Cell(size=(2.0, 2.0), rate=((0.0, 0.5), (0.0, 0.0))).edges(t=1.0)
    array([[2., 1.],
           [0., 2.]])
    """

    size: tuple[float, float]
    rate: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))

    def __post_init__(self) -> None:
        size = finite("cell size", self.size, (2,))
        edges = tuple(at_least(f"cell size[{k}]", edge, 0.0, strict=True) for k, edge in enumerate(size))
        object.__setattr__(self, "size", edges)
        rate = finite("cell rate", self.rate, (2, 2), most=LARGEST)
        if rate[1, 0] != 0.0:
            raise InvalidSceneError(
                f"cell rate[1][0] = {rate[1, 0]:g} is not allowed: the cell's first edge keeps its direction; turn the scene, or shear it "
                "along x by rate[0][1]"
            )
        object.__setattr__(self, "rate", tuple((float(a), float(b)) for a, b in rate))

    def edges(self, t: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        """Return the edges of the cell at time ``t`` [s] as columns [m], shape (2, 2)."""
        return (np.eye(2) + t * np.array(self.rate)) @ np.diag(self.size)
