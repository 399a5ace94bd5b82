"""What scenes of both dimensions share: bodies and walls by number and name, pairs, laws by materials, JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from ninedisk.core.errors import BehindWallError, InvalidSceneError, TooFastError, UnstableTimeStepError
from ninedisk.core.law import ContactLaw
from ninedisk.core.scene.bodies import Bodies
from ninedisk.core.scene.cell import Cell
from ninedisk.core.scene.loads import BodyForce
from ninedisk.core.scene.walls import AnyWall, endless, plain
from ninedisk.core.validate import all_of_kind, at_least, body_numbers, finite, items_of, kind_of, short_repr, whole


@dataclass(frozen=True, kw_only=True)
class AnyScene:
    """What scenes of both dimensions are: bodies ``0 .. n-1``, walls ``n .. n+m-1``, laws, gravity; equal if all values are.

    A pair is ``(i, j)`` with ``i < j``, the first of which is no wall. Scenes hold arrays and a mapping, so that they cannot be keys of
    a dictionary. `Scene` (2D) and `SphereScene` (3D) name their bodies and the law between them.

    Parameters
    ----------
    walls : sequence of Wall or PlaneWall
    gravity : d floats, optional
        Acceleration [m/s^2].
    laws : mapping from pair of names to ContactLaw
        Laws of contacts between two materials (`Bodies.material`, `AnyWall.material`), in either order; other contacts obey the law
        between bodies or the wall's own.
    xi : float
        Global damping [1/s], >= 0: the equation of motion is ``m a + xi m v = F``, and likewise for spins.
    initial_shear : mapping from pair to float, or to three floats
        Shear forces ``fs`` [N] that contacts carry at time 0 (preload); more than ``mu fn`` is cut off to that. In 3D they are vectors
        at right angles to the contact's normal.
    forces : sequence of BodyForce
        Forces and torques on single bodies, beside gravity.
    cell : Cell or None
        Periodic cell; a scene that has one has no walls.

    Raises
    ------
    InvalidSceneError
        Naming the offending body, its value and the allowed range.
    """

    walls: tuple[Any, ...] = ()
    gravity: Any
    laws: Mapping[tuple[str, str], ContactLaw] = field(default_factory=dict)
    xi: float = 0.0
    initial_shear: Mapping[tuple[int, int], Any] = field(default_factory=dict)
    forces: tuple[BodyForce, ...] = ()
    cell: Cell | None = None

    dimension: ClassVar[int]
    kind_of_bodies: ClassVar[type[Bodies]]
    kind_of_wall: ClassVar[type[AnyWall]]
    __hash__ = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        kind_of(self._names()[0], self.bodies, self.kind_of_bodies)
        kind_of(self._names()[1], self.law_of_bodies, ContactLaw)
        object.__setattr__(self, "walls", all_of_kind("walls", self.walls, self.kind_of_wall))
        gravity = finite("gravity", self.gravity, (self.dimension,))
        object.__setattr__(self, "gravity", tuple(float(each) for each in gravity))
        self._check_names()
        self._check_walls()
        object.__setattr__(self, "laws", self._checked_laws())
        self.law_of_bodies.check_dimension(self._names()[1], self.dimension)
        for pair, law in self.laws.items():
            law.check_dimension(f"law of {pair}", self.dimension)
        object.__setattr__(self, "xi", at_least("xi", self.xi, 0.0))
        shear = {}
        for pair, force in kind_of("initial_shear", self.initial_shear, Mapping).items():  # type: ignore[type-abstract]
            shear[self.check_pair(pair)] = self._checked_shear(f"initial shear of {pair}", force)
        object.__setattr__(self, "initial_shear", shear)
        object.__setattr__(self, "forces", all_of_kind("forces", self.forces, BodyForce))
        for load in self.forces:
            whole(f"force on {self.noun}", load.disk, 0, len(self.bodies) - 1, error=InvalidSceneError)
            if load.dimension != self.dimension:
                raise InvalidSceneError(
                    f"force on {self.noun} {load.disk} = {short_repr(load.force)} is not allowed: it must have {self.dimension} components"
                )

        if self.cell is not None:
            kind_of("cell", self.cell, Cell)
            if self.cell.dimension != self.dimension:
                raise InvalidSceneError(
                    f"cell size = {self.cell.size} is not allowed: it must have {self.dimension} edges"
                )
            if self.walls:
                raise InvalidSceneError(
                    f"wall {self.walls[0].name!r} is not allowed in a periodic cell: leave out the cell, or the walls"
                )

    def _checked_shear(self, name: str, force: Any) -> float | tuple[float, ...]:
        if self.dimension == 2:
            return float(finite(name, force, ()))
        return tuple(map(float, finite(name, force, (3,))))

    @classmethod
    def _names(cls) -> tuple[str, str]:
        """Names of the fields of the bodies and of the law between them."""
        noun = cls.kind_of_bodies.noun
        return f"{noun}s", f"{noun}_{noun}"

    @property
    def noun(self) -> str:
        """What a body is called in messages."""
        return self.kind_of_bodies.noun

    @property
    def bodies(self) -> Any:
        """The disks or spheres."""
        return getattr(self, self._names()[0])

    @property
    def law_of_bodies(self) -> ContactLaw:
        """Law between two bodies that no materials decide."""
        law: ContactLaw = getattr(self, self._names()[1])
        return law

    @classmethod
    def _fields_of(cls, data: Mapping[str, Any]) -> dict[str, Any]:
        """Fields of the scene whose `to_dict` gave ``data``."""
        bodies, law = cls._names()
        return {
            "walls": tuple(cls.kind_of_wall.from_dict(each) for each in data["walls"]),
            bodies: cls.kind_of_bodies(**data[bodies]),
            law: ContactLaw.from_dict(data[law]),
            "gravity": data["gravity"],
            "laws": {(one, two): ContactLaw.from_dict(law) for one, two, law in data.get("laws", ())},
            "xi": data["xi"] if cls.dimension == 2 else data.get("xi", 0.0),
            "initial_shear": {
                (i, j): force
                for i, j, force in (data["initial_shear"] if cls.dimension == 2 else data.get("initial_shear", ()))
            },
            "forces": tuple(BodyForce(**endless(force, "end")) for force in data.get("forces", ())),
            "cell": Cell(**data["cell"]) if "cell" in data else None,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; `from_dict` is its inverse, to the last bit.

        What few scenes have (outlines, materials, forces, a cell, and some fields of a law) is left out where it is not there, so that
        scenes keep the form that they had before there was this.
        """
        bodies, law = self._names()
        data: dict[str, Any] = {"dimension": 3} if self.dimension == 3 else {}
        data |= {
            bodies: self.bodies.to_dict(),
            law: self.law_of_bodies.to_dict(self.dimension),
            "walls": [wall.to_dict() for wall in self.walls],
            "gravity": list(self.gravity),
        }
        if self.laws:
            data["laws"] = [[*pair, law.to_dict(self.dimension)] for pair, law in self.laws.items()]
        if self.dimension == 2 or self.xi > 0.0:
            data["xi"] = self.xi
        if self.dimension == 2 or self.initial_shear:
            data["initial_shear"] = [
                [i, j, force if self.dimension == 2 else list(force)] for (i, j), force in self.initial_shear.items()
            ]
        if self.forces:
            data["forces"] = [plain(load) for load in self.forces]
        if self.cell is not None:
            data["cell"] = {"size": list(self.cell.size), "rate": [list(row) for row in self.cell.rate]}
        return data

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Build a scene from `to_dict` data.

        Raises
        ------
        InvalidSceneError
            If a key is missing or unknown, or a value is not allowed.
        """
        try:
            scene = cls(**cls._fields_of(data))
        except KeyError as error:
            raise InvalidSceneError(f"the scene lacks the key {error.args[0]!r}") from error
        except InvalidSceneError:
            raise
        except (TypeError, AttributeError, ValueError) as error:
            raise InvalidSceneError(f"the scene's data have the wrong form: {error}") from error
        known = {each.name for each in fields(cls)}
        unknown = set(data) - known - ({"dimension"} if cls.dimension == 3 else set())
        if unknown:
            raise InvalidSceneError(f"unknown key(s) in the scene: {', '.join(sorted(map(str, unknown)))}")
        return scene

    @property
    def n_bodies(self) -> int:
        """Number of bodies and walls together."""
        return len(self.bodies) + len(self.walls)

    def body_name(self, body: int) -> str:
        """Return a readable name of a body, for messages and figures."""
        body = whole("body", body, 0, self.n_bodies - 1, error=InvalidSceneError)
        n = len(self.bodies)
        return f"{self.noun} {body}" if body < n else f"wall {self.walls[body - n].name!r}"

    def wall_index(self, name: str) -> int:
        """Return the body number of the wall called ``name``."""
        for k, wall in enumerate(self.walls):
            if wall.name == name:
                return len(self.bodies) + k
        known = ", ".join(wall.name for wall in self.walls) or "none"
        raise InvalidSceneError(f"there is no wall {short_repr(name)}: the scene's walls are {known}")

    def check_pair(self, pair: Sequence[int]) -> tuple[int, int]:
        """Return ``pair`` as two body numbers in order, or raise `InvalidSceneError`."""
        bodies = body_numbers("a pair is two body numbers", pair)
        if len(bodies) != 2:
            raise InvalidSceneError(f"a pair is two body numbers, not {short_repr(pair)}")
        i, j = bodies
        if not (0 <= i < len(self.bodies) and i < j < self.n_bodies):
            raise InvalidSceneError(
                f"pair {(i, j)} is not allowed: the first body is a {self.noun} (0..{len(self.bodies) - 1}), the second a "
                f"later {self.noun} or a wall (up to {self.n_bodies - 1})"
            )
        return i, j

    def law(self, pair: tuple[int, int]) -> ContactLaw:
        """Return the contact law of a pair."""
        return self.law_between(*self.check_pair(pair))

    def law_between(self, i: int, j: int) -> ContactLaw:
        """Return the contact law of two bodies in order, which may be one and the same: it touches its own image in a periodic cell."""
        n, one = len(self.bodies), self.bodies.material[i]
        if j < n:
            return self.laws.get(ordered(one, self.bodies.material[j]), self.law_of_bodies)
        wall_law: ContactLaw = self.walls[j - n].law
        return self.laws.get(ordered(one, self.walls[j - n].material), wall_law)

    @property
    def laws_in_use(self) -> tuple[ContactLaw, ...]:
        """All laws that a pair of the scene can have: between bodies (of two or more, or in a cell), of each wall, of the materials."""
        periodic = self.cell is not None
        return (
            *((self.law_of_bodies,) if len(self.bodies) > 1 or periodic else ()),
            *(wall.law for wall in self.walls),
            *self.laws.values(),
        )

    def behind_wall(self, body: int, wall: int, height: float, when: str, step: str) -> BehindWallError:
        """Return the error of a body whose centre is at a height <= 0 [m] above a wall in a run; ``step`` says which step to reduce."""
        return BehindWallError(
            f"the centre of {self.noun} {body} is {-height:g} m behind wall {self.walls[wall].name!r} at {when}: it moves too far in a "
            f"step, its contact is too soft, or walls close in on it; reduce {step}, raise kn, or mend the walls' motion"
        )

    def unstable(self, body: int, step: float, critical: float, t: float, share: float) -> UnstableTimeStepError:
        """Return the error of a contact step above the critical one that contacts have at time ``t``, times in s; most of it at ``body``.

        ``share`` of the critical step is recommended.
        """
        return UnstableTimeStepError(
            f"contact_dt = {step:g} s exceeds the critical step {critical:g} s that the contacts have at t = {t:g} s, stiffest at "
            f"{self.body_name(body)}: use at most {share * critical:g} s ({share:g} of it) for accurate results, or set "
            "allow_unstable=True to run all the same"
        )

    def too_fast(self, body: int, other: str, dx: float, limit: float, t: float, step: float) -> TooFastError:
        """Return the error of a body that moves by ``dx`` against ``other`` in a contact step [s] that ends at ``t`` [s]; lengths in m."""
        return TooFastError(
            f"{self.body_name(body)} moves {dx:g} m against {other} in the contact step that ends at t = {t:g} s; at most {limit:g} m are "
            f"allowed, beyond which a contact can be jumped over: use contact_dt of at most {step * limit / dx:g} s (now {step:g} s), "
            "or lower the speeds"
        )

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed."""
        return replace(self, **changes)

    def with_laws(self, change: Callable[[ContactLaw], ContactLaw]) -> Self:
        """Return a copy in which each law is what ``change`` makes of it."""
        return self.replace(
            **{self._names()[1]: change(self.law_of_bodies)},
            walls=tuple(replace(wall, law=change(wall.law)) for wall in self.walls),
            laws={pair: change(law) for pair, law in self.laws.items()},
        )

    def _check_names(self) -> None:
        names = [wall.name for wall in self.walls]
        if len(set(names)) != len(names):
            raise InvalidSceneError(f"wall names must be unique: {', '.join(names)}")

    def _check_walls(self) -> None:
        for a, one in enumerate(self.walls):
            for two in self.walls[a + 1 :]:
                facing = float(np.dot(one.normal, two.normal))
                room = float(np.dot(one.normal, np.subtract(two.point, one.point)))
                if facing <= -1.0 + 1e-12 and room <= 0.0:
                    raise InvalidSceneError(
                        f"walls {one.name!r} and {two.name!r} overlap: they face each other and the room between them is "
                        f"{room:g} m; it must be > 0 (move one of them or turn its normal)"
                    )
        self._check_centres()

    def _check_centres(self) -> None:
        for wall in self.walls:
            height = (self.bodies.x - np.array(wall.point)) @ np.array(wall.normal)
            if len(height) and height.min() <= 0.0:
                i = int(np.argmin(height))
                raise InvalidSceneError(
                    f"the centre of {self.noun} {i} lies {-height[i]:g} m behind wall {wall.name!r}: a centre must lie on the side that "
                    "the wall's normal points to"
                )

    def _checked_laws(self) -> dict[tuple[str, str], ContactLaw]:
        """Laws of materials that some body has, each pair of names in alphabetical order."""
        used = {*self.bodies.material, *(wall.material for wall in self.walls)}
        laws: dict[tuple[str, str], ContactLaw] = {}
        for pair, law in kind_of("laws", self.laws, Mapping).items():  # type: ignore[type-abstract]
            names = items_of("the materials of a law", pair, "two names")
            if len(names) != 2 or not all(isinstance(name, str) for name in names):
                raise InvalidSceneError(
                    f"the materials of a law = {short_repr(pair)} are not allowed: they must be two names"
                )
            for name in names:
                if name not in used:
                    known = ", ".join(map(repr, sorted(used)))
                    raise InvalidSceneError(
                        f"no {self.noun} and no wall is made of the material {name!r} of a law: there are {known}"
                    )
            if ordered(*names) in laws:
                raise InvalidSceneError(f"the materials {names[0]!r} and {names[1]!r} have two laws: give one")
            laws[ordered(*names)] = kind_of(f"law of {short_repr(pair)}", law, ContactLaw)
        return laws


def ordered(one: str, two: str) -> tuple[str, str]:
    """Names of two materials in alphabetical order."""
    return (one, two) if one <= two else (two, one)
