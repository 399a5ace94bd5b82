"""The scene, in 2D or 3D: bodies, walls and their motion, contact laws, gravity, forces, damping, a periodic cell.

A `Scene` (2D) or `SphereScene` (3D, of spheres and boxes) says what is simulated; `ninedisk.core.numerics.Numerics` says how. Both
are plain frozen data that serialise to JSON, which is also the wire format to external engines.

Bodies are numbered: disks or spheres ``0 .. n-1``, walls ``n .. n+m-1``. A pair is ``(i, j)`` with ``i < j``.

Conventions (see ``docs/reference/notation.md``)
--------------------------------------
- ``n`` is the unit normal from body ``i`` to body ``j``; in 2D ``t = (-n_y, n_x)``.
- the force of the contact on body ``i`` is ``-fn n + fs t`` in 2D, ``-fn n + fs`` in 3D with the vector ``fs`` at right angles to n;
  ``fn >= 0`` is compression.
- ``gap`` is positive when open; ``overlap = -gap``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from ninedisk.core.array_types import FloatArray
from ninedisk.core.law import ContactLaw, LeverArm, Rolling, SlipAt, SphereLaw, WallVelocityAt
from ninedisk.core.scene.base import AnyScene
from ninedisk.core.scene.bodies import Bodies, Disks, Spheres
from ninedisk.core.scene.cell import Cell
from ninedisk.core.scene.loads import BodyForce
from ninedisk.core.scene.outlines import check_outlines, outlines_from, plain_outline
from ninedisk.core.scene.walls import AnyWall, PlaneSegment, PlaneWall, Wall, WallSegment

if TYPE_CHECKING:
    from ninedisk.core.nurbs.curve import NurbsCurve

__all__ = [
    "AnyScene",
    "AnyWall",
    "Bodies",
    "BodyForce",
    "Cell",
    "ContactLaw",
    "Disks",
    "FloatArray",
    "LeverArm",
    "PlaneSegment",
    "PlaneWall",
    "Rolling",
    "Scene",
    "SlipAt",
    "SphereLaw",
    "SphereScene",
    "Spheres",
    "Wall",
    "WallSegment",
    "WallVelocityAt",
]


@dataclass(frozen=True, kw_only=True)
class Scene(AnyScene):
    """A scene in 2D: everything that physics needs to know.

    Parameters
    ----------
    disks : Disks
    walls, gravity, laws, xi, initial_shear, forces, cell
        As in `AnyScene`, with d = 2.
    disk_disk : ContactLaw
        Law of every contact between two disks, where ``laws`` has none for their materials.
    outlines : sequence of NurbsCurve
        Boundaries that ``disks.outline`` refers to, each in the body's frame: centroid at the origin, at angle 0.

    Raises
    ------
    InvalidSceneError
        Naming the offending body, its value and the allowed range.

    Examples
    --------
    One disk on a floor; walls are numbered after the disks:

    >>> law = ContactLaw(kn=1e6)
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law)
    >>> disk = Disks(x=[[0.0, 0.5]], radius=0.5, mass=2.0)
    >>> scene = Scene(disks=disk, disk_disk=law, walls=[floor], gravity=(0.0, -10.0))
    >>> scene.n_bodies, scene.wall_index("floor"), scene.body_name(1)
    (2, 1, "wall 'floor'")
    """

    disks: Disks
    disk_disk: ContactLaw
    walls: tuple[Wall, ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)
    outlines: tuple[NurbsCurve, ...] = ()

    dimension: ClassVar[int] = 2
    kind_of_bodies: ClassVar[type[Bodies]] = Disks
    kind_of_wall: ClassVar[type[AnyWall]] = Wall
    __hash__ = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "outlines", check_outlines(self.outlines, self.disks))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, see `AnyScene.to_dict`."""
        data = super().to_dict()
        if self.outlines:
            data["outlines"] = [plain_outline(curve) for curve in self.outlines]
        return data

    @classmethod
    def _fields_of(cls, data: Mapping[str, Any]) -> dict[str, Any]:
        return {
            **super()._fields_of(data),
            "outlines": outlines_from(data.get("outlines", ())),
        }


@dataclass(frozen=True, kw_only=True)
class SphereScene(AnyScene):
    """A scene in 3D: everything that physics needs to know.

    Parameters
    ----------
    spheres : Spheres
    sphere_sphere : ContactLaw
        Law of every contact between two spheres, where ``laws`` has none for their materials.
    walls, gravity, laws, xi, initial_shear, forces, cell
        As in `AnyScene`, with d = 3.

    Raises
    ------
    InvalidSceneError
        Naming the offending body, its value and the allowed range.

    Examples
    --------
    Two spheres of 2 kg that move apart at 3 m/s each carry 9 J each, and no momentum together:

    >>> spheres = Spheres(x=[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], v=[[-3.0, 0.0, 0.0], [3.0, 0.0, 0.0]], radius=0.5, mass=2.0)
    >>> scene = SphereScene(spheres=spheres, sphere_sphere=ContactLaw(kn=1e6))
    >>> (scene.bodies.mass @ scene.bodies.v).tolist(), float(0.5 * scene.bodies.mass @ scene.bodies.v[:, 0] ** 2)
    ([0.0, 0.0, 0.0], 18.0)
    """

    spheres: Spheres
    sphere_sphere: ContactLaw
    walls: tuple[PlaneWall, ...] = ()
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    dimension: ClassVar[int] = 3
    dashpots_pull: ClassVar[bool] = True
    """Whether linear dashpots may pull at the end of a contact."""
    kind_of_bodies: ClassVar[type[Bodies]] = Spheres
    kind_of_wall: ClassVar[type[AnyWall]] = PlaneWall
    __hash__ = None
