"""Periodic cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.scene.loads import components
from ninedisk.core.validate import LARGEST, at_least, finite


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A periodic cell that deforms affinely: every body has images at all whole combinations of the cell's edges, two or three.

    The edges are the columns of ``h(t) = (I + t rate) h(0)`` with ``h(0) = diag(size)``. The image of a body that lies ``s`` edges away is
    displaced by ``h s`` and moves faster by ``h' s`` (Lees & Edwards, J. Phys. C 5 (1972) 1921). Positions and velocities of a body are
    those of one and the same image throughout, whether it is still in the cell or not; bodies begin where the scene puts them, with the
    scene's velocities: a uniform shear flow begins only where these are ``h' h^-1 x``.

    Parameters
    ----------
    size : d floats
        Edges along the axes at time 0 [m], > 0.
    rate : d rows of d floats, optional
        Rate of deformation [1/s], ``d x_a / d x_b``; ``rate[0][1]`` is a simple shear. The first edge keeps its direction and in 3D the
        second one its plane: ``rate[a][b] = 0`` for ``a > b``.

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

    size: tuple[float, ...]
    rate: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        d = 3 if components(self.size) == 3 else 2
        size = finite("cell size", self.size, (d,))
        edges = tuple(at_least(f"cell size[{k}]", edge, 0.0, strict=True) for k, edge in enumerate(size))
        object.__setattr__(self, "size", edges)
        still = isinstance(self.rate, tuple) and not self.rate
        rate = finite("cell rate", np.zeros((d, d)) if still else self.rate, (d, d), most=LARGEST)
        for row, column in ((1, 0), (2, 0), (2, 1))[: 3 if d == 3 else 1]:
            if rate[row, column] != 0.0:
                raise InvalidSceneError(
                    f"cell rate[{row}][{column}] = {rate[row, column]:g} is not allowed: the cell's first edge keeps its direction"
                    f"{' and the second one its plane' * (d == 3)}; turn the scene, or shear it by rate[{column}][{row}]"
                )
        object.__setattr__(self, "rate", tuple(tuple(map(float, row)) for row in rate))

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.size)

    def edges(self, t: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        """Return the edges of the cell at time ``t`` [s] as columns [m], shape (d, d)."""
        return (np.eye(self.dimension) + t * np.array(self.rate)) @ np.diag(self.size)
