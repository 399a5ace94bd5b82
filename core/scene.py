"""The scene: disks and grains, half-plane walls and their motion, contact laws, gravity, forces, damping, a periodic cell.

A `Scene` says what is simulated; `ninedisk.core.numerics.Numerics` says how. Both are plain
frozen data that serialise to JSON, which is also the wire format to external engines.

Bodies are numbered: disks ``0 .. n-1``, walls ``n .. n+m-1``. A pair is ``(i, j)`` with ``i < j``.

Conventions (see ``docs/notation.md``)
--------------------------------------
- ``n`` is the unit normal from body ``i`` to body ``j``; ``t = (-n_y, n_x)``.
- the force of the contact on body ``i`` is ``-fn n + fs t``; ``fn >= 0`` is compression.
- ``gap`` is positive when open; ``overlap = -gap``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.disks import Disks, check_outlines, outlines_from, plain_outline
from ninedisk.core.errors import BehindWallError, InvalidSceneError
from ninedisk.core.law import ContactLaw, LeverArm, Rolling, SlipAt, WallVelocityAt
from ninedisk.core.loads import BodyForce, Cell
from ninedisk.core.validate import all_of_kind, at_least, body_numbers, finite, items_of, kind_of, shown, whole
from ninedisk.core.walls import Wall, WallSegment

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
class Scene:
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

    __hash__ = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        kind_of("disks", self.disks, Disks)
        kind_of("disk_disk", self.disk_disk, ContactLaw)
        object.__setattr__(self, "walls", all_of_kind("walls", self.walls, Wall))
        gravity = finite("gravity", self.gravity, (2,))
        object.__setattr__(self, "gravity", (float(gravity[0]), float(gravity[1])))
        object.__setattr__(self, "xi", at_least("xi", self.xi, 0.0))
        names = [wall.name for wall in self.walls]
        if len(set(names)) != len(names):
            raise InvalidSceneError(f"wall names must be unique: {', '.join(names)}")
        self._check_walls()
        object.__setattr__(self, "outlines", check_outlines(self.outlines, self.disks))
        shear = {}
        for pair, force in kind_of("initial_shear", self.initial_shear, Mapping).items():  # type: ignore[type-abstract]
            shear[self.check_pair(pair)] = float(finite(f"initial shear of {pair}", force, ()))
        object.__setattr__(self, "initial_shear", shear)
        self._check_materials()
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
    def n_bodies(self) -> int:
        """Number of disks and walls together."""
        return len(self.disks) + len(self.walls)

    def body_name(self, body: int) -> str:
        """Readable name of a body, for messages and figures."""
        body = whole("body", body, 0, self.n_bodies - 1, error=InvalidSceneError)
        n = len(self.disks)
        return f"disk {body}" if body < n else f"wall {self.walls[body - n].name!r}"

    def wall_index(self, name: str) -> int:
        """Body number of the wall called ``name``."""
        for k, wall in enumerate(self.walls):
            if wall.name == name:
                return len(self.disks) + k
        known = ", ".join(wall.name for wall in self.walls) or "none"
        raise InvalidSceneError(f"there is no wall {shown(name)}: the scene's walls are {known}")

    def check_pair(self, pair: Sequence[int]) -> tuple[int, int]:
        """Return ``pair`` as two body numbers in order, or raise `InvalidSceneError`."""
        bodies = body_numbers("a pair is two body numbers", pair)
        if len(bodies) != 2:
            raise InvalidSceneError(f"a pair is two body numbers, not {shown(pair)}")
        i, j = bodies
        if not (0 <= i < len(self.disks) and i < j < self.n_bodies):
            raise InvalidSceneError(
                f"pair {(i, j)} is not allowed: the first body is a disk (0..{len(self.disks) - 1}), the second a "
                f"later disk or a wall (up to {self.n_bodies - 1})"
            )
        return i, j

    def law(self, pair: tuple[int, int]) -> ContactLaw:
        """Contact law of a pair."""
        i, j = self.check_pair(pair)
        n, one = len(self.disks), self.disks.material[i]
        if j < n:
            return self.laws.get(_ordered(one, self.disks.material[j]), self.disk_disk)
        return self.laws.get(_ordered(one, self.walls[j - n].material), self.walls[j - n].law)

    @property
    def laws_in_use(self) -> tuple[ContactLaw, ...]:
        """All laws that a pair of the scene can have: between disks (of two or more), of each wall, of the materials."""
        return (
            *((self.disk_disk,) if len(self.disks) > 1 else ()),
            *(wall.law for wall in self.walls),
            *self.laws.values(),
        )

    def behind_wall(self, disk: int, wall: int, height: float, when: str, step: str) -> BehindWallError:
        """The error of a disk whose centre is at this height <= 0 [m] above a wall during a run; ``step`` says which step to reduce."""
        return BehindWallError(
            f"the centre of disk {disk} is {-height:g} m behind wall {self.walls[wall].name!r} at {when}: it moves too far in a step, its "
            f"contact is too soft, or walls close in on it; reduce {step}, raise kn, or mend the walls' motion"
        )

    def _check_materials(self) -> None:
        """Laws of materials that somebody has, each pair of names in alphabetical order."""
        used = {*self.disks.material, *(wall.material for wall in self.walls)}
        laws: dict[tuple[str, str], ContactLaw] = {}
        for pair, law in kind_of("laws", self.laws, Mapping).items():  # type: ignore[type-abstract]
            names = items_of("the materials of a law", pair, "two names")
            if len(names) != 2 or not all(isinstance(name, str) for name in names):
                raise InvalidSceneError(
                    f"the materials of a law = {shown(pair)} are not allowed: they must be two names"
                )
            for name in names:
                if name not in used:
                    known = ", ".join(map(repr, sorted(used)))
                    raise InvalidSceneError(
                        f"no disk and no wall is made of the material {name!r} of a law: there are {known}"
                    )
            if _ordered(*names) in laws:
                raise InvalidSceneError(f"the materials {names[0]!r} and {names[1]!r} have two laws: give one")
            laws[_ordered(*names)] = kind_of(f"law of {shown(pair)}", law, ContactLaw)
        object.__setattr__(self, "laws", laws)

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
        x = self.disks.x
        for wall in self.walls:
            height = (x - np.array(wall.point)) @ np.array(wall.normal)
            if len(height) and height.min() <= 0.0:
                i = int(np.argmin(height))
                raise InvalidSceneError(
                    f"the centre of disk {i} lies {-height[i]:g} m behind wall {wall.name!r}: a centre must lie on the "
                    f"side that the wall's normal points to"
                )

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
            "walls": [
                {
                    "name": wall.name,
                    "point": list(wall.point),
                    "normal": list(wall.normal),
                    "law": wall.law.to_dict(),
                    "motion": [_plain(segment) for segment in wall.motion],
                    **({"material": wall.material} if wall.material else {}),
                }
                for wall in self.walls
            ],
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
            data["laws"] = [[*pair, law.to_dict()] for pair, law in self.laws.items()]
        if self.forces:
            data["forces"] = [_plain(force) for force in self.forces]
        if self.cell is not None:
            data["cell"] = {"size": list(self.cell.size), "rate": [list(row) for row in self.cell.rate]}
        return data

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scene:
        """Build a scene from `to_dict` data.

        Raises
        ------
        InvalidSceneError
            If a key is missing or unknown, or a value is not allowed.
        """
        try:
            walls = []
            for wall in data["walls"]:
                law = ContactLaw.from_dict(wall["law"])
                motion = tuple(WallSegment(**_endless(segment, "duration")) for segment in wall["motion"])
                walls.append(Wall(**{**wall, "law": law, "motion": motion}))
            scene = cls(
                disks=Disks(**data["disks"]),
                disk_disk=ContactLaw.from_dict(data["disk_disk"]),
                walls=tuple(walls),
                gravity=data["gravity"],
                xi=data["xi"],
                initial_shear={(i, j): force for i, j, force in data["initial_shear"]},
                outlines=outlines_from(data.get("outlines", ())),
                laws={(one, two): ContactLaw.from_dict(law) for one, two, law in data.get("laws", ())},
                forces=tuple(BodyForce(**_endless(force, "end")) for force in data.get("forces", ())),
                cell=Cell(**data["cell"]) if "cell" in data else None,
            )
        except KeyError as error:
            raise InvalidSceneError(f"the scene lacks the key {error.args[0]!r}") from error
        except InvalidSceneError:
            raise
        except (TypeError, AttributeError, ValueError) as error:
            raise InvalidSceneError(f"the scene's data have the wrong form: {error}") from error
        unknown = set(data) - {name.name for name in fields(cls)}
        if unknown:
            raise InvalidSceneError(f"unknown key(s) in the scene: {', '.join(sorted(map(str, unknown)))}")
        return scene

    def replace(self, **changes: Any) -> Scene:
        """Copy with some fields changed."""
        return replace(self, **changes)


def _ordered(one: str, two: str) -> tuple[str, str]:
    return (one, two) if one <= two else (two, one)


def _plain(record: WallSegment | BodyForce) -> dict[str, Any]:
    """Fields of a flat record as JSON data; an infinite time becomes the string ``"inf"``."""
    plain: dict[str, Any] = {}
    for name, value in vars(record).items():
        if isinstance(value, tuple):
            plain[name] = list(value)
        elif isinstance(value, float) and np.isinf(value):
            plain[name] = "inf"
        else:
            plain[name] = value
    return plain


def _endless(record: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The same fields, with the time ``name`` infinite where it is the string ``"inf"``."""
    return {**record, name: np.inf} if record.get(name) == "inf" else dict(record)
