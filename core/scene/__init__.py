"""The scene: disks and grains, half-plane walls and their motion, contact laws, gravity, forces, damping, a periodic cell.

A `Scene` says what is simulated; `ninedisk.core.numerics.Numerics` says how. Both are plain
frozen data that serialise to JSON, which is also the wire format to external engines.

Bodies are numbered: disks ``0 .. n-1``, walls ``n .. n+m-1``. A pair is ``(i, j)`` with ``i < j``.

Conventions (see ``docs/reference/notation.md``)
--------------------------------------
- ``n`` is the unit normal from body ``i`` to body ``j``; ``t = (-n_y, n_x)``.
- the force of the contact on body ``i`` is ``-fn n + fs t``; ``fn >= 0`` is compression.
- ``gap`` is positive when open; ``overlap = -gap``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw, LeverArm, Rolling, SlipAt, WallVelocityAt
from ninedisk.core.scene.bodies import BodiesAndWalls, endless, plain, walls_of
from ninedisk.core.scene.cell import Cell
from ninedisk.core.scene.disks import Disks, check_outlines, outlines_from, plain_outline
from ninedisk.core.scene.loads import BodyForce
from ninedisk.core.scene.walls import Wall, WallSegment
from ninedisk.core.validate import all_of_kind, at_least, finite, kind_of, whole

if TYPE_CHECKING:
    from ninedisk.core.nurbs.curve import NurbsCurve

__all__ = [
    "BodyForce",
    "Cell",
    "ContactLaw",
    "Disks",
    "FloatArray",
    "LeverArm",
    "Rolling",
    "Scene",
    "SlipAt",
    "Wall",
    "WallSegment",
    "WallVelocityAt",
]


@dataclass(frozen=True, kw_only=True)
class Scene(BodiesAndWalls[ContactLaw]):
    """Everything that physics needs to know.

    Two scenes are equal if all their values are; they hold arrays and a mapping, so that they cannot be keys of a dictionary.

    Parameters
    ----------
    disks : Disks
    walls : sequence of Wall
    disk_disk : ContactLaw
        Law of every contact between two disks, where ``laws`` has none for their materials.
    gravity : (float, float)
        Acceleration [m/s^2].
    xi : float
        Global damping [1/s], >= 0: the equation of motion is ``m a + xi m v = F``, and likewise for spins.
    initial_shear : mapping from pair to float
        Shear forces ``fs`` [N] that contacts carry at time 0 (preload); more than ``mu fn`` is cut off to that.
    outlines : sequence of NurbsCurve
        Boundaries that ``disks.outline`` refers to, each in the body's frame: centroid at the origin, at angle 0.
    laws : mapping from pair of names to ContactLaw
        Laws of contacts between two materials (`Disks.material`, `Wall.material`), in either order; other contacts obey
        ``disk_disk`` or the wall's own law.
    forces : sequence of BodyForce
        Forces and torques on single disks, beside gravity.
    cell : Cell or None
        Periodic cell; a scene that has one has no walls.

    Raises
    ------
    InvalidSceneError
        Naming the offending body, its value and the allowed range.
    """

    disks: Disks
    disk_disk: ContactLaw
    walls: tuple[Wall, ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)
    xi: float = 0.0
    initial_shear: Mapping[tuple[int, int], float] = field(default_factory=dict)
    outlines: tuple[NurbsCurve, ...] = ()
    laws: Mapping[tuple[str, str], ContactLaw] = field(default_factory=dict)
    forces: tuple[BodyForce, ...] = ()
    cell: Cell | None = None

    dimension: ClassVar[int] = 2
    noun: ClassVar[str] = "disk"
    __hash__ = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        kind_of("disks", self.disks, Disks)
        kind_of("disk_disk", self.disk_disk, ContactLaw)
        object.__setattr__(self, "walls", all_of_kind("walls", self.walls, Wall))
        gravity = finite("gravity", self.gravity, (2,))
        object.__setattr__(self, "gravity", (float(gravity[0]), float(gravity[1])))
        object.__setattr__(self, "xi", at_least("xi", self.xi, 0.0))
        self._check_names()
        self._check_walls()
        object.__setattr__(self, "outlines", check_outlines(self.outlines, self.disks))
        shear = {}
        for pair, force in kind_of("initial_shear", self.initial_shear, Mapping).items():  # type: ignore[type-abstract]
            shear[self.check_pair(pair)] = float(finite(f"initial shear of {pair}", force, ()))
        object.__setattr__(self, "initial_shear", shear)
        object.__setattr__(self, "laws", self._checked_laws(ContactLaw))
        object.__setattr__(self, "forces", all_of_kind("forces", self.forces, BodyForce))
        for force in self.forces:
            whole("force on disk", force.disk, 0, len(self.disks) - 1, error=InvalidSceneError)
        if self.cell is not None:
            kind_of("cell", self.cell, Cell)
            if self.walls:
                raise InvalidSceneError(
                    f"wall {self.walls[0].name!r} is not allowed in a periodic cell: leave out the cell, or the walls"
                )

    @property
    def bodies(self) -> Disks:
        """The disks."""
        return self.disks

    @property
    def law_of_bodies(self) -> ContactLaw:
        """Law between disks that no materials decide."""
        return self.disk_disk

    def _check_walls(self) -> None:
        for a, one in enumerate(self.walls):
            for two in self.walls[a + 1 :]:
                facing = one.normal[0] * two.normal[0] + one.normal[1] * two.normal[1]
                room = one.normal[0] * (two.point[0] - one.point[0]) + one.normal[1] * (two.point[1] - one.point[1])
                if facing <= -1.0 + 1e-12 and room <= 0.0:
                    raise InvalidSceneError(
                        f"walls {one.name!r} and {two.name!r} overlap: they face each other and the room between them is "
                        f"{room:g} m; it must be > 0 (move one of them or turn its normal)"
                    )
        self._check_centres()

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; `from_dict` is its inverse, to the last bit.

        What few scenes have (outlines, materials, forces, a cell, and some fields of a law) is left out where it is not there, so that
        scenes keep the form that they had before there was this.
        """
        disks = self.disks
        data: dict[str, Any] = {
            "disks": {
                "x": disks.x.tolist(),
                "v": disks.v.tolist(),
                "omega": disks.omega.tolist(),
                "radius": disks.radius.tolist(),
                "mass": disks.mass.tolist(),
                "inertia": disks.inertia.tolist(),
                "rotating": disks.rotating.tolist(),
                "held": disks.held.tolist(),
            },
            "disk_disk": self.disk_disk.to_dict(),
            "walls": self._plain_walls(),
            "gravity": list(self.gravity),
            "xi": self.xi,
            "initial_shear": [[i, j, force] for (i, j), force in self.initial_shear.items()],
        }
        if np.any(disks.outline >= 0):
            data["disks"]["outline"] = disks.outline.tolist()
        if np.any(disks.angle):
            data["disks"]["angle"] = disks.angle.tolist()
        if self.outlines:
            data["outlines"] = [plain_outline(curve) for curve in self.outlines]
        if any(disks.material):
            data["disks"]["material"] = list(disks.material)
        if self.laws:
            data["laws"] = self._plain_laws()
        if self.forces:
            data["forces"] = [plain(force) for force in self.forces]
        if self.cell is not None:
            data["cell"] = {"size": list(self.cell.size), "rate": [list(row) for row in self.cell.rate]}
        return data

    @classmethod
    def _fields_of(cls, data: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "walls": walls_of(data["walls"], Wall, WallSegment, ContactLaw),
            "disks": Disks(**data["disks"]),
            "disk_disk": ContactLaw.from_dict(data["disk_disk"]),
            "gravity": data["gravity"],
            "xi": data["xi"],
            "initial_shear": {(i, j): force for i, j, force in data["initial_shear"]},
            "outlines": outlines_from(data.get("outlines", ())),
            "laws": {(one, two): ContactLaw.from_dict(law) for one, two, law in data.get("laws", ())},
            "forces": tuple(BodyForce(**endless(force, "end")) for force in data.get("forces", ())),
            "cell": Cell(**data["cell"]) if "cell" in data else None,
        }
