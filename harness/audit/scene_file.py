"""The TOML beside a trajectory, read into an `AuditScene`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.scene.walls import AnyWall, PlaneSegment, PlaneWall, Wall, WallSegment
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.audit.scene import AuditScene, ContactFile
from ninedisk.harness.audit.toml_values import TomlReader

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
        "data", "open", "partial", "single",
    ),
    "time": ("dt", "interval"),
    "disks": ("radius", "mass", "density", "inertia", "fixed"),
    "spheres": ("radius", "mass", "density", "inertia", "fixed"),
    "contact": ("mu", "kn", "ks", "restitution", "rigid", "slop", "cohesive", "pull", "rolling", "lever_arm"),
    "walls": ("name", "point", "normal", "mu", "kn", "ks", "motion"),
    "contacts": ("file", "columns", "wall"),
    "data": ("file", "style"),
}  # fmt: skip
"""Every key by its table."""


def read_scene(path: Path) -> AuditScene:
    """Read the TOML beside a trajectory.

    Raises
    ------
    UsageError
        Naming file, line, column, value, allowed form.
    """
    return _scene_of(TomlReader(path, KEYS))


def scene_of_text(text: str, name: str) -> AuditScene:
    """The same out of a text without a file; ``name`` is for messages."""
    return _scene_of(TomlReader(Path(name), KEYS, text))


def _scene_of(reader: TomlReader) -> AuditScene:
    path = reader.path
    data = reader.data
    reader.known(data, "")
    if "disks" in data and "spheres" in data:
        raise reader.wrong(
            "", "spheres", data["spheres"], "the bodies are described by [disks] already; give one of the two"
        )
    named = "spheres" if "spheres" in data else "disks"
    tables = {key: reader.table(data, "", key) for key in ("time", named, "contact", "data")}
    for where, each in tables.items():
        reader.known(each, where)
    time, disks, contact, written = tables.values()
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
        columns=_names(reader, reader.table(data, "", "columns"), "columns", COLUMNS),
        contacts=_contacts(reader, data, [wall.name for wall, _ in walls]),
        reverse=_companion_file(reader, data, "", "reverse"),
        periodic=_periodic(reader, data, dimension or 3),
        data=_companion_file(reader, written, "data", "file"),
        data_style=_style(reader, written),
        open=reader.flag(data, "", "open"),
        partial=reader.flag(data, "", "partial"),
        single=reader.flag(data, "", "single"),
    )


def _dimension(reader: TomlReader, data: Mapping[str, Any]) -> int | None:
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


def _periodic(reader: TomlReader, data: Mapping[str, Any], dimension: int) -> tuple[str, ...]:
    given = data.get("periodic", [])
    axes = list("xyz"[:dimension])
    if not isinstance(given, list) or any(each not in axes for each in given) or len(set(given)) < len(given):
        raise reader.wrong("", "periodic", given, f"it must be a list of axes, each once, of {', '.join(axes)}")
    return tuple(given)


def _style(reader: TomlReader, data: Mapping[str, Any]) -> str | None:
    style = data.get("style")
    if style is not None and not isinstance(style, str):
        raise reader.wrong("data", "style", style, 'it must be the atom_style, e.g. "hybrid sphere bond"')
    if style is not None and "file" not in data:
        raise reader.wrong("data", "style", style, 'it is the style of a data file: give [data] file = "..." as well')
    return style


def _companion_file(reader: TomlReader, data: Mapping[str, Any], where: str, key: str) -> Path | None:
    value = data.get(key)
    if value is None:
        return None
    path = reader.path.parent / str(value)
    if not isinstance(value, str) or not path.exists():
        raise reader.wrong(where, key, value, f"it must name a file that exists, beside {reader.path.name}")
    return path


def _contacts(reader: TomlReader, data: Mapping[str, Any], walls: Sequence[str]) -> tuple[ContactFile, ...]:
    """Files of contact forces: one table, or one a file."""
    given = data.get("contacts", [])
    tables = given if isinstance(given, list) else [given]
    if not all(isinstance(each, dict) for each in tables):
        raise reader.wrong("", "contacts", given, 'write [contacts] file = "...", or one [[contacts]] table a file')
    found = []
    for each in tables:
        reader.known(each, "contacts")
        path = _companion_file(reader, each, "contacts", "file")
        if path is None:
            raise UsageError(f'{reader.place("", "contacts")}: [contacts] lacks file = "..."')
        wall = each.get("wall")
        if wall is not None and wall not in walls:
            raise reader.wrong(
                "contacts", "wall", wall, f"it must be the name of a wall: {', '.join(walls) or 'there is none'}"
            )
        columns = _names(reader, reader.table(each, "contacts", "columns"), "columns", CONTACT_COLUMNS)
        found.append(ContactFile(path, columns, None if wall is None else walls.index(wall)))
    return tuple(found)


def _walls(
    reader: TomlReader, given: Any, common: Mapping[str, float | None], dimension: int
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


def _names(reader: TomlReader, data: Mapping[str, Any], where: str, allowed: tuple[str, ...]) -> dict[str, str]:
    """Names of columns."""
    for key, value in data.items():
        if SAME_COLUMNS.get(key, key) not in allowed or not isinstance(value, str):
            raise reader.wrong(
                where, key, value, f'write NAME = "column of the file", NAME one of {", ".join(allowed)}'
            )
    return {SAME_COLUMNS.get(key, key): value for key, value in data.items()}
