"""Forces and torques that act on single disks, and periodic cells."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, at_least, finite, real, shown, whole


@dataclass(frozen=True, kw_only=True)
class BodyForce:
    """A force through the centre of a disk and a torque on it, constant between two times; several on one disk add up.

    The impulse of a step is exact wherever in it the force begins or ends: a step gets the mean over its own time, which is from
    ``t_n - dt/2`` to ``t_n + dt/2`` where velocities are those of half steps (the first one: from 0 to ``dt/2``). A step of the
    static limit has the load of its end.

    Parameters
    ----------
    disk : int
        Number of the disk.
    force : (float, float)
        [N].
    torque : float
        [N m], counter-clockwise positive.
    begin, end : float
        Times [s] with ``0 <= begin < end``; ``end`` may be infinite.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.
    """

    disk: int
    force: tuple[float, float] = (0.0, 0.0)
    torque: float = 0.0
    begin: float = 0.0
    end: float = inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "disk", whole("force on disk", self.disk, 0, 2**31 - 1, error=InvalidSceneError))
        force = finite("force on a disk", self.force, (2,), most=LARGEST)
        object.__setattr__(self, "force", (float(force[0]), float(force[1])))
        object.__setattr__(self, "torque", float(finite("torque on a disk", self.torque, (), most=LARGEST)))
        object.__setattr__(self, "begin", at_least("begin of a force", self.begin, 0.0))
        end = real(self.end)
        if not end > self.begin:
            raise InvalidSceneError(
                f"end of a force = {shown(self.end)} is not allowed: it must be a time after its begin, {self.begin:g} s, or inf"
            )
        object.__setattr__(self, "end", end)


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
        """Edges of the cell at time ``t`` [s] as columns [m], shape (2, 2)."""
        return (np.eye(2) + t * np.array(self.rate)) @ np.diag(self.size)
