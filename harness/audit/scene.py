"""The TOML beside a trajectory: what the file itself does not report (masses, walls and their motion, friction, stiffness, the step)."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.scene.walls import AnyWall, PlaneSegment, PlaneWall, Wall, WallSegment
from ninedisk.harness.api.errors import UsageError, close_matches

COLUMNS = (
    "step", "t", "id", "type", "x", "y", "z", "vx", "vy", "vz", "angle", "omega", "omegax", "omegay", "radius", "diameter", "mass",
    "fx", "fy", "fz", "torque", "tqx", "tqy",
)  # fmt: skip
"""What a trajectory may hold; ``x, y`` and one of ``step, t`` it must. ``omega`` and ``torque`` are about z, also in space."""
CONTACT_COLUMNS = (
    "step", "t", "i", "j", "fn", "fs", "fsx", "fsy", "fsz", "fx", "fy", "fz", "fnx", "fny", "fnz", "nx", "ny", "nz",
)  # fmt: skip
"""What a file of contacts holds: bodies by the ids of the trajectory, walls by negative numbers; see `ninedisk.harness.audit.forces`."""
SAME_COLUMNS = {"omegaz": "omega", "tqz": "torque"}

LEVER_ARMS = ("radius", "overlap", "torque-overlap")
MOST_WALLS = 60
"""Walls of a group are bits of an integer."""
KEYS: dict[str, tuple[str, ...]] = {
    "": (
        "dimension", "gravity", "damping", "time", "disks", "spheres", "contact", "walls", "columns", "contacts", "reverse", "periodic",
        "data", "open", "single",
    ),
    "time": ("dt", "interval"),
    "disks": ("radius", "mass", "density", "inertia", "fixed"),
    "spheres": ("radius", "mass", "density", "inertia", "fixed"),
    "contact": ("mu", "kn", "ks", "restitution", "rigid", "slop", "cohesive", "pull", "rolling", "lever_arm"),
    "walls": ("name", "point", "normal", "mu", "kn", "ks", "motion"),
    "contacts": ("file", "columns"),
    "data": ("file", "style"),
}  # fmt: skip
"""Every key by its table."""

INERTIA = {2: 0.5, 3: 0.4}
"""Moment of inertia over m R^2 where none is given: of disks in the plane, of spheres in space."""
LARGEST = 1e75
"""Numbers from here on count as no numbers: energies would overflow."""
Fact = float | FloatArray | Mapping[int, float]
"""A property of disks: one number, one a disk in the order of ids, or one a type."""


@dataclass(frozen=True)
class AuditScene:
    """What is given of a trajectory.

    Attributes
    ----------
    gravity : ndarray, shape (2,) or (3,)
        Acceleration [m/s^2].
    dimension : {2, 3}
        Components of every vector.
    stated_dimension : bool
        Whether the TOML says so, by ``dimension`` or by a vector; else a file in space makes it 3.
    lever_arm : {"radius", "overlap", "torque-overlap"} or None
        Arms of shear forces between bodies, as in `ninedisk.core.ContactLaw`; None: either.
    walls_known : bool
        False: nothing is said of walls, and what they would explain is not judged.
    damping : float
        Global damping [1/s], m a + damping m v = F.
    dt, interval : float or None
        The engine's own step and the time between two frames [s].
    radius, mass, density : number, array, mapping or None
        [m], [kg], [kg/m^2] or, in space, [kg/m^3]; None: the file has it.
    inertia : float
        Moment of inertia over m R^2: 1/2 of disks, 2/5 of spheres.
    fixed : tuple of int
        Ids of disks that nothing moves, or that are moved by what is not given.
    mu, kn, ks, restitution : float or None
        Law of every contact without its own law; [N/m].
    rigid : bool
        Contacts store no energy and are meant not to overlap, but by ``slop`` [m].
    cohesive, rolling : bool
        Contacts attract; contacts resist rolling.
    pull : bool
        Dashpots may pull at the end of a contact; where the TOML does not say, those of soft contacts that lose energy may.
    walls : tuple of Wall or PlaneWall
        Their laws hold mu, kn (1 where none is known) and ks.
    wall_kn : tuple of float or None
    columns, contact_columns : mapping
        Name here -> name in the file.
    contacts, reverse : Path or None
        File of contact forces; trajectory that starts at this one's end with all velocities turned round.
    periodic : tuple of {"x", "y", "z"}
        Axes along which the domain of a file repeats that does not say so.
    data, data_style : Path, str or None
        LAMMPS data file with radii and masses; its atom style where its own head does not say enough.
    open : bool
        Disks may leave.
    single : bool
        The engine computes in single precision, whatever its file shows.
    """

    gravity: FloatArray
    dimension: int = 2
    stated_dimension: bool = True
    lever_arm: str | None = None
    walls_known: bool = True
    inertia_given: bool = False
    damping: float = 0.0
    dt: float | None = None
    interval: float | None = None
    radius: Fact | None = None
    mass: Fact | None = None
    density: Fact | None = None
    inertia: float = 0.5
    fixed: tuple[int, ...] = ()
    mu: float | None = None
    kn: float | None = None
    ks: float | None = None
    restitution: float | None = None
    rigid: bool = False
    slop: float = 0.0
    cohesive: bool = False
    rolling: bool = False
    pull: bool = True
    walls: tuple[AnyWall, ...] = ()
    wall_mu: tuple[float | None, ...] = ()
    wall_kn: tuple[float | None, ...] = ()
    wall_ks: tuple[float | None, ...] = ()
    columns: Mapping[str, str] = field(default_factory=dict)
    contact_columns: Mapping[str, str] = field(default_factory=dict)
    contacts: Path | None = None
    reverse: Path | None = None
    periodic: tuple[str, ...] = ()
    data: Path | None = None
    data_style: str | None = None
    open: bool = False
    single: bool = False

    def in_dimension(self, dimension: int) -> AuditScene:
        """The same scene in another dimension, of one that states none."""
        if dimension == self.dimension:
            return self
        inertia = self.inertia if self.inertia_given else INERTIA[dimension]
        return replace(self, dimension=dimension, gravity=np.zeros(dimension), inertia=inertia)

    @property
    def conservative(self) -> bool:
        """Whether what is given leaves nothing that takes energy."""
        return self.restitution == 1.0 and not self.frictional and self.damping == 0.0 and not self.rolling

    @property
    def pulling(self) -> float:
        """Most impulse by which a dashpot pulls at the end of a contact, over mass and speed: 2 beta^2, by the coefficient of restitution.

        The force ``c v - kn overlap`` pulls from the overlap ``c v/kn`` on; its impulse is ``c^2 v/(2 kn) = 2 beta^2 m v``.
        """
        if not self.pull:
            return 0.0
        if not self.restitution:
            return 2.0
        log = float(np.log(self.restitution))
        share = 2.0 * log * log / (np.pi**2 + log * log)
        return float(min(2.0, share / max(1.0 - share, 0.5)))

    @property
    def frictional(self) -> bool:
        """Whether some contact may have friction: all that say nothing."""
        return self.mu != 0.0 or any(mu != 0.0 for mu in self.wall_mu)


class _Reader:
    """Values of a TOML with the places where they stand, for messages."""

    def __init__(self, path: Path, text: str | None = None) -> None:
        self.path = path
        try:
            self.text = path.read_text(encoding="utf-8") if text is None else text
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(
                f"{str(path)!r} cannot be read ({getattr(error, 'strerror', None) or 'it is no UTF-8 text'}): give a TOML by --scene "
                "FILE; `ninedisk audit --example DIR` writes one"
            ) from error
        try:
            self.data = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            raise UsageError(f"{path} is no TOML: {error}") from error

    def wrong(self, where: str, key: str, value: Any, allowed: str) -> UsageError:
        """The error of a value."""
        return UsageError(f"{self.place(where, key)}: {_dotted_key(where, key)} = {value!r} is not allowed: {allowed}")

    def place(self, where: str, key: str) -> str:
        """File, line and column of a key, as well as they can be found."""
        begin = 0
        if where and (table := re.search(rf"^\s*\[+\s*{re.escape(where)}\b", self.text, re.M)):
            begin = table.start()
        found = re.compile(rf"(?:^|[{{,\[])\s*({re.escape(key)})\s*[=.\]]", re.M).search(self.text, begin)
        at = found.start(1) if found else begin
        line = self.text.count("\n", 0, at) + 1
        return f"{self.path}, line {line}, column {at - (self.text.rfind(chr(10), 0, at) + 1) + 1}"

    def table(self, data: Mapping[str, Any], where: str, key: str) -> Mapping[str, Any]:
        """A table; empty where there is none."""
        value = data.get(key, {})
        if not isinstance(value, dict):
            raise self.wrong(where, key, value, f"it must be a table, [{key}]")
        return value

    def known(self, data: Mapping[str, Any], where: str) -> None:
        """Refuse keys that nobody reads."""
        for key in data:
            if key not in KEYS[where]:
                raise UsageError(
                    f"{self.place(where, key)}: {_dotted_key(where, key)} is no key of an audit: allowed are "
                    f"{', '.join(KEYS[where])}.{close_matches(key, KEYS[where])}"
                )

    def number(
        self, data: Mapping[str, Any], where: str, key: str, *, strict: bool = False, most: float = np.inf
    ) -> float | None:
        """A number >= 0 (> 0), or None."""
        value = data.get(key)
        if value is None:
            return None
        right = isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
        if not right or value < 0.0 or (strict and value == 0.0) or value > most:
            bound = f" and <= {most:g}" if np.isfinite(most) else ""
            raise self.wrong(where, key, value, f"it must be a number {'>' if strict else '>='} 0{bound}")
        return float(value)

    def vector(self, data: Mapping[str, Any], where: str, key: str, dimension: int) -> FloatArray:
        """So many numbers; zeros where they are not given."""
        value = data.get(key, (0.0,) * dimension)
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != (dimension,) or not (np.abs(array) < LARGEST).all():
            example = "two numbers, e.g. [0.0, -9.81]" if dimension == 2 else "three numbers, e.g. [0.0, 0.0, -9.81]"
            raise self.wrong(where, key, value, f"it must be {example}")
        return array

    def flag(self, data: Mapping[str, Any], where: str, key: str) -> bool:
        """True or false; false where it is not given."""
        value = data.get(key, False)
        if not isinstance(value, bool):
            raise self.wrong(where, key, value, "it must be true or false")
        return value

    def fact(self, data: Mapping[str, Any], where: str, key: str) -> Fact | None:
        """A positive number, a list of them, or a table by type."""
        value = data.get(key)
        if value is None:
            return None
        given = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else [value]
        right = given and all(
            isinstance(v, int | float) and not isinstance(v, bool) and 0.0 < v < np.inf for v in given
        )
        if not right or (isinstance(value, dict) and not all(re.fullmatch(r"\d+", name) for name in value)):
            raise self.wrong(
                where,
                key,
                value,
                "it must be a number > 0, a list with one a disk (ids in order), or a table by type {1 = 0.01}",
            )
        if isinstance(value, dict):
            return {int(name): float(v) for name, v in value.items()}
        return np.array(value, dtype=float) if isinstance(value, list) else float(value)

    def names(self, data: Mapping[str, Any], where: str, allowed: tuple[str, ...]) -> dict[str, str]:
        """Names of columns."""
        for key, value in data.items():
            if SAME_COLUMNS.get(key, key) not in allowed or not isinstance(value, str):
                raise self.wrong(
                    where, key, value, f'write NAME = "column of the file", NAME one of {", ".join(allowed)}'
                )
        return {SAME_COLUMNS.get(key, key): value for key, value in data.items()}


def _dotted_key(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


def read_scene(path: Path) -> AuditScene:
    """Read the TOML beside a trajectory.

    Raises
    ------
    UsageError
        Naming file, line, column, value, allowed form.
    """
    return _scene_of(_Reader(path))


def scene_of_text(text: str, name: str) -> AuditScene:
    """The same out of a text without a file; ``name`` is for messages."""
    return _scene_of(_Reader(Path(name), text))


def _scene_of(reader: _Reader) -> AuditScene:
    path = reader.path
    data = reader.data
    reader.known(data, "")
    if "disks" in data and "spheres" in data:
        raise reader.wrong(
            "", "spheres", data["spheres"], "the bodies are described by [disks] already; give one of the two"
        )
    named = "spheres" if "spheres" in data else "disks"
    tables = {key: reader.table(data, "", key) for key in ("time", named, "contact", "contacts", "data")}
    for where, each in tables.items():
        reader.known(each, where)
    time, disks, contact, forces, written = tables.values()
    dimension = _dimension(reader, data)
    shape = disks.get("inertia", "disk" if (dimension or 2) == 2 else "sphere")
    shapes = {"disk": 0.5, "sphere": 0.4}
    if (
        not (isinstance(shape, str) and shape in shapes)
        and reader.number(disks, named, "inertia", strict=True, most=1.0) is None
    ):
        raise reader.wrong(named, "inertia", shape, 'it must be "disk", "sphere" or I/(m R^2) in (0, 1]')
    if "mass" in disks and "density" in disks:
        raise reader.wrong(named, "density", disks["density"], "masses are given already; give one of mass and density")
    fixed = disks.get("fixed", [])
    if not isinstance(fixed, list) or not all(isinstance(each, int) for each in fixed):
        raise reader.wrong(named, "fixed", fixed, "it must be a list of ids")
    rigid, kn = reader.flag(contact, "contact", "rigid"), reader.number(contact, "contact", "kn", strict=True)
    if rigid and kn is not None:
        raise reader.wrong("contact", "rigid", rigid, "a contact with kn is not rigid; give one of the two")
    law = {key: reader.number(contact, "contact", key) for key in ("mu", "ks")}
    restitution = reader.number(contact, "contact", "restitution", most=1.0)
    arm = contact.get("lever_arm")
    if arm is not None and arm not in LEVER_ARMS:
        raise reader.wrong(
            "contact",
            "lever_arm",
            arm,
            'it must be "radius" (R), "overlap" (R less half the overlap) or "torque-overlap"',
        )
    unknown = data.get("walls") == "unknown"
    walls = _walls(reader, [] if unknown else data.get("walls", []), {**law, "kn": kn}, dimension or 2)
    if len(walls) > MOST_WALLS:
        raise UsageError(f"{path}: {len(walls)} walls; an audit takes {MOST_WALLS} at most")
    return AuditScene(
        gravity=reader.vector(data, "", "gravity", dimension or 2),
        dimension=dimension or 2,
        stated_dimension=dimension is not None,
        lever_arm=arm,
        walls_known=not unknown,
        inertia_given="inertia" in disks,
        damping=reader.number(data, "", "damping") or 0.0,
        dt=reader.number(time, "time", "dt", strict=True),
        interval=reader.number(time, "time", "interval", strict=True),
        radius=reader.fact(disks, named, "radius"),
        mass=reader.fact(disks, named, "mass"),
        density=reader.fact(disks, named, "density"),
        inertia=shapes[shape] if isinstance(shape, str) else float(shape),
        fixed=tuple(fixed),
        mu=law["mu"],
        kn=kn,
        ks=law["ks"],
        restitution=restitution,
        rigid=rigid,
        slop=reader.number(contact, "contact", "slop") or 0.0,
        cohesive=reader.flag(contact, "contact", "cohesive"),
        rolling=reader.flag(contact, "contact", "rolling"),
        pull=reader.flag(contact, "contact", "pull") if "pull" in contact else not rigid and restitution != 1.0,
        walls=tuple(wall for wall, _ in walls),
        wall_mu=tuple(given["mu"] for _, given in walls),
        wall_kn=tuple(given["kn"] for _, given in walls),
        wall_ks=tuple(given["ks"] for _, given in walls),
        columns=reader.names(reader.table(data, "", "columns"), "columns", COLUMNS),
        contact_columns=reader.names(reader.table(forces, "contacts", "columns"), "columns", CONTACT_COLUMNS),
        contacts=_companion_file(reader, forces, "contacts", "file"),
        reverse=_companion_file(reader, data, "", "reverse"),
        periodic=_periodic(reader, data, dimension or 3),
        data=_companion_file(reader, written, "data", "file"),
        data_style=_style(reader, written),
        open=reader.flag(data, "", "open"),
        single=reader.flag(data, "", "single"),
    )


def _dimension(reader: _Reader, data: Mapping[str, Any]) -> int | None:
    """2 or 3 by ``dimension``, gravity, or the first wall; None where nothing says."""
    given = data.get("dimension")
    if given is not None and (given not in (2, 3) or isinstance(given, bool)):
        raise reader.wrong("", "dimension", given, "it must be 2 or 3")
    walls = data.get("walls", [])
    vectors = [("", "gravity", data.get("gravity"))]
    vectors += [("walls", key, wall.get(key)) for wall in walls if isinstance(wall, dict) for key in ("point", "normal")] \
        if isinstance(walls, list) else []  # fmt: skip
    for where, key, value in vectors:
        if isinstance(value, list) and len(value) in (2, 3):
            if given is None:
                given = len(value)
            elif given != len(value):
                raise reader.wrong(
                    where, key, value, f"it must be {given} numbers, as the vectors before it or dimension"
                )
    return int(given) if given is not None else (3 if "spheres" in data else None)


def _periodic(reader: _Reader, data: Mapping[str, Any], dimension: int) -> tuple[str, ...]:
    given = data.get("periodic", [])
    axes = list("xyz"[:dimension])
    if not isinstance(given, list) or any(each not in axes for each in given) or len(set(given)) < len(given):
        raise reader.wrong("", "periodic", given, f"it must be a list of axes, each once, of {', '.join(axes)}")
    return tuple(given)


def _style(reader: _Reader, data: Mapping[str, Any]) -> str | None:
    style = data.get("style")
    if style is not None and not isinstance(style, str):
        raise reader.wrong("data", "style", style, 'it must be the atom_style, e.g. "hybrid sphere bond"')
    if style is not None and "file" not in data:
        raise reader.wrong("data", "style", style, 'it is the style of a data file: give [data] file = "..." as well')
    return style


def _companion_file(reader: _Reader, data: Mapping[str, Any], where: str, key: str) -> Path | None:
    value = data.get(key)
    if value is None:
        return None
    path = reader.path.parent / str(value)
    if not isinstance(value, str) or not path.exists():
        raise reader.wrong(where, key, value, f"it must name a file that exists, beside {reader.path.name}")
    return path


def _walls(
    reader: _Reader, given: Any, common: Mapping[str, float | None], dimension: int
) -> list[tuple[AnyWall, dict[str, float | None]]]:
    kind: Any = Wall if dimension == 2 else PlaneWall
    part: Any = WallSegment if dimension == 2 else PlaneSegment
    numbers = "two" if dimension == 2 else "three"
    if not isinstance(given, list) or not all(isinstance(wall, dict) for wall in given):
        raise reader.wrong(
            "",
            "walls",
            given,
            'write one [[walls]] table a wall: name, point, normal, and mu, motion if any; "unknown" where nobody knows',
        )
    made: list[tuple[AnyWall, dict[str, float | None]]] = []
    for number, wall in enumerate(given):
        reader.known(wall, "walls")
        name = wall.get("name", f"wall {number}")
        if lacking := [key for key in ("point", "normal") if key not in wall]:
            raise UsageError(
                f"{reader.place('walls', 'name')}: wall {name!r} lacks {' and '.join(lacking)}: {numbers} numbers each"
            )
        law = {
            key: common[key] if key not in wall else reader.number(wall, "walls", key, strict=key == "kn")
            for key in ("mu", "kn", "ks")
        }
        try:
            segments = wall.get("motion", [])
            motion = tuple(part(**segment) for segment in (segments if isinstance(segments, list) else [segments]))
            contact = ContactLaw(kn=law["kn"] or 1.0, ks=law["ks"] or 0.0, mu=law["mu"] or 0.0)
            made.append((kind(name=name, point=wall["point"], normal=wall["normal"], law=contact, motion=motion), law))
        except TypeError as error:
            allowed = ", ".join(part.__dataclass_fields__)
            raise UsageError(
                f"{reader.place('walls', 'motion')}: the motion of wall {name!r} is not allowed ({error}): write tables of {allowed}"
            ) from error
        except InvalidSceneError as error:
            raise UsageError(f"{reader.place('walls', 'name')}: {error}") from error
    names = [wall.name for wall, _ in made]
    if len(set(names)) < len(names):
        raise UsageError(f"{reader.place('walls', 'name')}: wall names must be unique: {', '.join(names)}")
    return made
