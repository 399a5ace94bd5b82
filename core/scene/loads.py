"""Forces and torques that act on single bodies."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.validate import LARGEST, at_least, finite, real, short_repr, whole


@dataclass(frozen=True, kw_only=True)
class BodyForce:
    """A force through the centre of a body and a torque on it, constant between two times; several on one body add up.

    The impulse of a step is exact wherever in it the force begins or ends: a step gets the mean over its own time, which is from
    ``t_n - dt/2`` to ``t_n + dt/2`` where velocities are those of half steps (the first one: from 0 to ``dt/2``). A step of the
    static limit has the load of its end.

    Parameters
    ----------
    disk : int
        Number of the disk or sphere.
    force : (float, float) or (float, float, float)
        [N]; three components in 3D.
    torque : float or (float, float, float)
        [N m], counter-clockwise positive; three components in 3D.
    begin, end : float
        Times [s] with ``0 <= begin < end``; ``end`` may be infinite.

    Raises
    ------
    InvalidSceneError
        If a value is outside its range.

    Examples
    --------
    A torque of 0.2 N m for 1 s gives a disk with the moment of inertia 0.1 kg m^2 a spin of 2 rad/s:

    >>> push = BodyForce(disk=0, torque=0.2, end=1.0)
    >>> disks = Disks(x=[[0.0, 0.0]], radius=1.0, mass=0.2)
    >>> float(push.torque * (push.end - push.begin) / disks.inertia[0])
    2.0
    """

    disk: int
    force: tuple[float, ...] = (0.0, 0.0)
    torque: float | tuple[float, ...] = 0.0
    begin: float = 0.0
    end: float = inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "disk", whole("force on disk", self.disk, 0, 2**31 - 1, error=InvalidSceneError))
        force: Any = self.force
        torque: Any = self.torque
        solid = components(torque) > 0 or components(force) == 3
        if solid and isinstance(force, tuple) and force == (0.0, 0.0):
            force = (0.0, 0.0, 0.0)
        if solid and real(torque) == 0.0:
            torque = (0.0, 0.0, 0.0)
        force = finite("force on a disk", force, (3,) if solid else (2,), most=LARGEST)
        torque = finite("torque on a disk", torque, (3,) if solid else (), most=LARGEST)
        object.__setattr__(self, "force", tuple(map(float, force)))
        object.__setattr__(self, "torque", tuple(map(float, torque)) if solid else float(torque))
        object.__setattr__(self, "begin", at_least("begin of a force", self.begin, 0.0))
        end = real(self.end)
        if not end > self.begin:
            raise InvalidSceneError(
                f"end of a force = {short_repr(self.end)} is not allowed: it must be a time after its begin, {self.begin:g} s, or inf"
            )
        object.__setattr__(self, "end", end)

    @property
    def dimension(self) -> int:
        """Of the scenes that it can be part of, 2 or 3."""
        return len(self.force)


def components(value: Any) -> int:
    """Return how many components a vector has; 0 for what is none."""
    if isinstance(value, str | bytes) or getattr(value, "ndim", 1) != 1:
        return 0
    try:
        return len(value)
    except (TypeError, ValueError, RuntimeError):
        return 0
