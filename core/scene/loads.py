"""Forces and torques that act on single disks."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

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

    Examples
    --------
    A torque of 0.2 N m for 1 s gives a disk with the moment of inertia 0.1 kg m^2 a spin of 2 rad/s:

    >>> push = BodyForce(disk=0, torque=0.2, end=1.0)
    >>> disks = Disks(x=[[0.0, 0.0]], radius=1.0, mass=0.2)
    >>> float(push.torque * (push.end - push.begin) / disks.inertia[0])
    2.0
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
