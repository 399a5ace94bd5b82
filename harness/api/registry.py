"""Which cases and engines there are: built-in ones and those of installed packages (entry points).

Ids are listed without importing anything that belongs to a case or an engine, so that ``ninedisk --help`` and
``ninedisk list`` stay fast; an object is imported when it is asked for. What is wrong with one package, be it an id that is
taken or metadata that cannot be read, is kept for whoever asks (`entry_problems`) and takes nothing from the others.
"""

from __future__ import annotations

import fnmatch
import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import distributions
from typing import TYPE_CHECKING, Any

from ninedisk.harness.api.errors import UsageError, close_matches

if TYPE_CHECKING:
    from ninedisk.harness.api.case import Case
    from ninedisk.harness.api.engine import Engine
BUILTIN_CASES: dict[str, str] = {
    "nine-disk/compression": "ninedisk.harness.cases.nine_disk.compression:CASE",
    "nine-disk/distortion": "ninedisk.harness.cases.nine_disk.distortion:CASE",
    "binary-collision": "ninedisk.harness.cases.impact.binary:CASE",
    "incline-block": "ninedisk.harness.cases.incline.block:CASE",
    "friction/hold": "ninedisk.harness.cases.incline.hold:CASE",
    "sliding/quasistatic": "ninedisk.harness.cases.sliding.quasistatic:CASE",
    "sliding/dynamic": "ninedisk.harness.cases.sliding.dynamic:CASE",
    "slip-to-roll": "ninedisk.harness.cases.rolling.slip_to_roll:CASE",
    "chain/newton-cradle": "ninedisk.harness.cases.chain.newton_cradle:CASE",
    "impact/bouncing-disk": "ninedisk.harness.cases.impact.bouncing:CASE",
    "impact/oblique": "ninedisk.harness.cases.impact.oblique:CASE",
    "gas/elastic": "ninedisk.harness.cases.impact.gas:CASE",
    "gas/cooling": "ninedisk.harness.cases.impact.cooling:CASE",
    "spinning-disk": "ninedisk.harness.cases.rolling.spinning_disk:CASE",
    "rolling/incline-disk": "ninedisk.harness.cases.rolling.incline_disk:CASE",
    "static/stack": "ninedisk.harness.cases.static.stack:CASE",
    "row/pushed": "ninedisk.harness.cases.chain.row_pushed:CASE",
    "strength/hexagonal": "ninedisk.harness.cases.static.strength_hexagonal:CASE",
    "nurbs/overlap": "ninedisk.harness.cases.nurbs.overlap:CASE",
    "nurbs/collision": "ninedisk.harness.cases.nurbs.collision:CASE",
    "nurbs/settle": "ninedisk.harness.cases.nurbs.settle:CASE",
    "nurbs/rolling": "ninedisk.harness.cases.nurbs.rolling:CASE",
    "invariance/units": "ninedisk.harness.cases.invariance.observers:CASES",
    "invariance/rotation": "ninedisk.harness.cases.invariance.observers:CASES",
    "invariance/galilei": "ninedisk.harness.cases.invariance.observers:CASES",
    "contact/reopening": "ninedisk.harness.cases.contact.reopening:CASE",
    "contact/moving-wall": "ninedisk.harness.cases.contact.moving_wall:CASE",
    "contact/belt": "ninedisk.harness.cases.contact.belt:CASE",
    "contact/driven-wall": "ninedisk.harness.cases.contact.driven_wall:CASE",
    "impact/two-disks": "ninedisk.harness.cases.impact.two_disks:CASE",
    "impact/held-disk": "ninedisk.harness.cases.impact.held_disk:CASE",
    "energy/budget": "ninedisk.harness.cases.energy.budget:CASE",
    "contact/cluster": "ninedisk.harness.cases.contact.cluster:CASE",
    "contact/orbit": "ninedisk.harness.cases.contact.orbit:CASE",
    "contact/retraced-loop": "ninedisk.harness.cases.contact.retraced_loop:CASE",
    "rolling/off-disk": "ninedisk.harness.cases.rolling.off:OFF_DISK",
    "spheres/off-ball": "ninedisk.harness.cases.rolling.off:OFF_BALL",
    "rolling/resistance": "ninedisk.harness.cases.rolling.resistance:CASE",
    "impact/cohesion": "ninedisk.harness.cases.impact.cohesion:CASE",
    "contact/holding": "ninedisk.harness.cases.contact.holding:CASE",
    "contact/materials": "ninedisk.harness.cases.contact.materials:CASE",
    "motion/forces": "ninedisk.harness.cases.motion.forces:CASE",
    "cell/lattice": "ninedisk.harness.cases.cell.lattice:CASE",
    "cell/own-image": "ninedisk.harness.cases.cell.own_image:CASE",
    "cell/shear": "ninedisk.harness.cases.cell.shear:CASE",
    "invariance/objectivity": "ninedisk.harness.cases.invariance.rotating_box:CASE",
    "spheres/chung-ooi/1": "ninedisk.harness.cases.impact.chung_ooi:ONE",
    "spheres/chung-ooi/2": "ninedisk.harness.cases.impact.chung_ooi:TWO",
    "spheres/chung-ooi/3": "ninedisk.harness.cases.impact.chung_ooi:THREE",
    "spheres/chung-ooi/4": "ninedisk.harness.cases.impact.chung_ooi:FOUR",
    "spheres/chung-ooi/5": "ninedisk.harness.cases.impact.chung_ooi:FIVE",
    "spheres/chung-ooi/6": "ninedisk.harness.cases.impact.chung_ooi:SIX",
    "spheres/chung-ooi/7": "ninedisk.harness.cases.impact.chung_ooi:SEVEN",
    "spheres/chung-ooi/8": "ninedisk.harness.cases.impact.chung_ooi:EIGHT",
    "spheres/thornton": "ninedisk.harness.cases.impact.thornton:CASE",
    "spheres/hertz-chain": "ninedisk.harness.cases.chain.hertz_chain:CASE",
    "spheres/rolling": "ninedisk.harness.cases.rolling.on_plane:ROLLING",
    "spheres/incline": "ninedisk.harness.cases.rolling.on_plane:INCLINE",
    "spheres/isotropy": "ninedisk.harness.cases.rolling.on_plane:ISOTROPY",
    "spheres/turntable": "ninedisk.harness.cases.rolling.on_plane:TURNTABLE",
    "spheres/turned": "ninedisk.harness.cases.contact.turned_shear:CASE",
    "spheres/top": "ninedisk.harness.cases.rolling.on_plane:TOP",
    **{
        f"spheres/invariance/{name}": "ninedisk.harness.cases.invariance.sphere_observers:CASES"
        for name in ("units", "rotation", "galilei", "mirror")
    },
    "spheres/budget": "ninedisk.harness.cases.energy.sphere_budget:CASE",
    "spheres/cooling": "ninedisk.harness.cases.impact.cooling_spheres:CASE",
    "spheres/jkr": "ninedisk.harness.cases.impact.jkr:CASE",
    "spheres/stack": "ninedisk.harness.cases.static.sphere_stack:CASE",
    "spheres/saddle": "ninedisk.harness.cases.rolling.saddle:CASE",
    "spheres/unequal": "ninedisk.harness.cases.contact.unequal_spheres:CASE",
    "spheres/rolling-resistance": "ninedisk.harness.cases.rolling.on_plane:RESISTED",
    "box/incline": "ninedisk.harness.cases.box.incline:CASE",
    "box/stop": "ninedisk.harness.cases.box.stop:CASE",
    "box/free": "ninedisk.harness.cases.box.free:CASE",
    "box/corner-drop": "ninedisk.harness.cases.box.corner:CASE",
    "box/rocking": "ninedisk.harness.cases.box.rocking:CASE",
    "box/carries-balls": "ninedisk.harness.cases.box.carries_balls:CASE",
    "box/stack": "ninedisk.harness.cases.box.stack:CASE",
    "box/domino": "ninedisk.harness.cases.box.domino:CASE",
    "box/spin": "ninedisk.harness.cases.box.spin:CASE",
}
BUILTIN_ENGINES: dict[str, str] = {
    "dem": "ninedisk.harness.engines.dem.adapter:ENGINE",
    "cd": "ninedisk.harness.engines.cd.adapter:ENGINE",
    "yade": "ninedisk.harness.engines.yade.adapter:ENGINE",
    "pymunk": "ninedisk.harness.engines.pymunk.adapter:ENGINE",
    "lammps": "ninedisk.harness.engines.lammps.adapter:ENGINE",
    "bullet": "ninedisk.harness.engines.bullet.adapter:ENGINE",
    "dart": "ninedisk.harness.engines.dart.adapter:ENGINE",
    "siconos": "ninedisk.harness.engines.siconos.adapter:ENGINE",
    "box2d": "ninedisk.harness.engines.box2d.adapter:ENGINE",
    "mujoco": "ninedisk.harness.engines.mujoco.adapter:ENGINE",
    "drake": "ninedisk.harness.engines.drake.adapter:ENGINES",
    "drake-sap": "ninedisk.harness.engines.drake.adapter:ENGINES",
    "drake-lagged": "ninedisk.harness.engines.drake.adapter:ENGINES",
    "liggghts": "ninedisk.harness.engines.liggghts.adapter:ENGINE",
    "esys-particle": "ninedisk.harness.engines.esys_particle.adapter:ENGINE",
    "kratos": "ninedisk.harness.engines.kratos.adapter:ENGINE",
    "jolt": "ninedisk.harness.engines.jolt.adapter:ENGINE",
    "sapien": "ninedisk.harness.engines.sapien.adapter:ENGINE",
}
STOCK_ENGINES: dict[str, str] = {
    f"{name}-stock": "ninedisk.harness.engines.stock:ENGINES"
    for name in ("pymunk", "bullet", "dart", "box2d", "mujoco", "drake-sap", "drake-lagged", "jolt", "sapien")
}
"""Engines at their own settings; they run where they are asked for."""
CASE_GROUP = "ninedisk.cases"
ENGINE_GROUP = "ninedisk.engines"


class UnknownIdError(UsageError):
    """No case or engine has this id.

    Examples
    --------
    >>> get_engine("lamps")
    Traceback (most recent call last):
    ninedisk.harness.api.registry.UnknownIdError: there is no engine 'lamps'. Did you mean 'lammps'? ...
    """


class BrokenEntryError(UsageError):
    """A case or engine is registered but cannot be loaded.

    Examples
    --------
    >>> from ninedisk.harness.api.errors import UsageError
    >>> issubclass(BrokenEntryError, UsageError)
    True
    """


@dataclass(frozen=True)
class Registered:
    """What is registered under an id.

    Parameters
    ----------
    where : str
        The object, ``"module:attribute"``.
    origin : str
        Distribution that provides it.
    problem : str
        What is wrong with it; "" for nothing.

    Examples
    --------
    >>> entry = engine_table()["dem"]
    >>> entry.where, entry.origin, entry.problem
    ('ninedisk.harness.engines.dem.adapter:ENGINE', 'ninedisk', '')
    """

    where: str
    origin: str
    problem: str = ""


BUILTIN = "ninedisk"
"""Origin of the cases and engines that come with ninedisk."""


@lru_cache(maxsize=1)
def case_table() -> Mapping[str, Registered]:
    """Return every known case by its id, without loading any.

    Returns
    -------
    mapping from str to Registered

    Examples
    --------
    >>> case_table()["binary-collision"].where
    'ninedisk.harness.cases.impact.binary:CASE'
    """
    return _registered(CASE_GROUP)[0]


@lru_cache(maxsize=1)
def engine_table() -> Mapping[str, Registered]:
    """Return every known engine by its id, without loading any.

    Returns
    -------
    mapping from str to Registered

    Examples
    --------
    >>> list(engine_table())[:2]
    ['dem', 'cd']
    """
    return _registered(ENGINE_GROUP)[0]


def engine_table_with_stock() -> Mapping[str, Registered]:
    """Return every known engine by its id, those at their own settings last, without loading any.

    Returns
    -------
    mapping from str to Registered

    Examples
    --------
    >>> sorted(set(engine_table_with_stock()) - set(engine_table()))[:2]
    ['box2d-stock', 'bullet-stock']
    """
    return {**engine_table(), **{name: Registered(where, BUILTIN) for name, where in STOCK_ENGINES.items()}}


def entry_problems() -> tuple[str, ...]:
    """Return what is wrong with the announcements of installed packages, a sentence each that names the package.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> all(isinstance(sentence, str) for sentence in entry_problems())
    True
    """
    found = (text for group in (CASE_GROUP, ENGINE_GROUP) for text in _registered(group)[1])
    return tuple(dict.fromkeys(found))


def _registered(group: str) -> tuple[dict[str, Registered], list[str]]:
    """Ids of a group, and what is wrong with it. A built-in id stays what it is; two packages with one id get neither."""
    builtin = BUILTIN_CASES if group == CASE_GROUP else BUILTIN_ENGINES
    table = {name: Registered(where, BUILTIN) for name, where in builtin.items()}
    wrong: list[str] = []
    for origin, name, where in _announced(group, wrong):
        held = table.get(name)
        if held is None:
            table[name] = Registered(where, origin)
        elif held.where != where and held.origin == BUILTIN:
            wrong.append(
                f"{origin} registers {name!r} under {group}, an id of ninedisk's own, which stays: rename it or uninstall {origin}"
            )
        elif held.where != where:
            both = (
                f"two packages register {name!r} under {group}: {held.where} of {held.origin} and {where} of {origin}"
            )
            table[name] = Registered(held.where, held.origin, f"{both}; uninstall one of them")
            wrong.append(table[name].problem)
    return table, wrong


def _announced(group: str, wrong: list[str]) -> Iterator[tuple[str, str, str]]:
    """Distribution, id and place of every entry of a group; each distribution once, the first on Python's path.

    What cannot be read is added to ``wrong``: one broken package must not hide the others, as it would from
    `importlib.metadata.entry_points`.
    """
    seen: set[str] = set()
    for distribution in distributions():
        try:
            entries = [entry for entry in distribution.entry_points if entry.group == group]
        except Exception as error:  # whatever a damaged file makes of the parser
            wrong.append(
                f"the entry points of {_name(distribution)} cannot be read ({type(error).__name__}: {error}): reinstall it"
            )
            continue
        if not entries or (origin := _name(distribution)) in seen:
            continue
        seen.add(origin)
        for entry in entries:
            yield origin, entry.name, entry.value


def _name(distribution: Any) -> str:
    """Name of a distribution; that of its folder where its metadata are damaged."""
    try:
        found = str(distribution.metadata["Name"] or "")
    except Exception:
        found = ""
    return found or str(getattr(distribution, "_path", "a nameless package")).rpartition("/")[2]


def get_case(case_id: str) -> Case:
    """Return the case with this id.

    Parameters
    ----------
    case_id : str

    Returns
    -------
    Case

    Raises
    ------
    UnknownIdError
        Naming close matches and all ids.
    BrokenEntryError
        If its module cannot be imported or does not define it.

    Examples
    --------
    >>> get_case("binary-collision").title
    'Binary collision of two disks'
    """
    found: Case = _load(case_id, case_table(), "case")
    return found


def get_engine(engine_id: str) -> Engine:
    """Return the engine with this id.

    Parameters
    ----------
    engine_id : str

    Returns
    -------
    Engine

    Raises
    ------
    UnknownIdError, BrokenEntryError
        As `get_case`.

    Examples
    --------
    >>> get_engine("cd").info().contact
    'cd'
    """
    found: Engine = _load(engine_id, engine_table_with_stock(), "engine")
    return found


def engines_that_load(wanted: Callable[[str], bool]) -> dict[str, Engine]:
    """Return the engines among the wanted ids whose adapters can be loaded, in the table's order.

    Parameters
    ----------
    wanted : callable
        Whether an id is wanted.

    Returns
    -------
    dict from str to Engine

    Examples
    --------
    >>> list(engines_that_load(lambda engine_id: engine_id in ("cd", "dem")))
    ['dem', 'cd']
    """
    found = {}
    for name in filter(wanted, engine_table()):
        with suppress(BrokenEntryError):
            found[name] = get_engine(name)
    return found


def check_engine_ids(ids: Iterable[str]) -> None:
    """Refuse ids of engines that do not exist, without loading any.

    Parameters
    ----------
    ids : iterable of str

    Raises
    ------
    UnknownIdError
        Naming close matches.

    Examples
    --------
    >>> check_engine_ids(["dem", "yad"])
    Traceback (most recent call last):
    ninedisk.harness.api.registry.UnknownIdError: there is no engine 'yad'. Did you mean 'yade'...
    """
    for name in ids:
        _check_id(name, engine_table_with_stock(), "engine")


def _check_id(name: str, table: Mapping[str, Registered], kind: str) -> None:
    if name not in table:
        raise UnknownIdError(f"there is no {kind} {name!r}{_suggestion(name, table, kind)}")


def _suggestion(name: str, table: Mapping[str, Registered], kind: str) -> str:
    """Return what a name may have meant, and where all names are listed."""
    return f".{close_matches(name, table)} `ninedisk list {kind}s` shows all {len(table)}"


def _load(name: str, table: Mapping[str, Registered], kind: str) -> Any:
    _check_id(name, table, kind)
    entry = table[name]
    if entry.problem:
        raise BrokenEntryError(f"the {kind} {name!r} is not clear: {entry.problem}")
    module_name, _, attribute = entry.where.partition(":")
    try:
        found = getattr(importlib.import_module(module_name), attribute)
        if isinstance(found, Sequence):  # a family module exports all of its cases at once
            found = next((member for member in found if member.id == name), None)
        own = getattr(found, "id", None)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a package that calls sys.exit must not end the command
        raise BrokenEntryError(
            f"the {kind} {name!r} of {entry.origin} cannot be loaded from {entry.where}: {type(error).__name__}: {error}; "
            f"mend or uninstall {entry.origin}"
        ) from error
    if own != name:
        raise BrokenEntryError(
            f"{entry.where} of {entry.origin} is registered as {kind} {name!r} but its id is {own!r}"
        )
    return found


def match_cases(globs: Iterable[str]) -> list[str]:
    """Return the ids of the cases that match any of the patterns, in the table's order; no pattern means all cases.

    Parameters
    ----------
    globs : iterable of str

    Returns
    -------
    list of str

    Raises
    ------
    UnknownIdError
        If a pattern matches nothing.

    Examples
    --------
    >>> match_cases(["nine-disk/*"])
    ['nine-disk/compression', 'nine-disk/distortion']
    """
    table, patterns = case_table(), list(globs)
    for pattern in patterns:
        if not fnmatch.filter(table, pattern):
            raise UnknownIdError(
                f"no case matches {pattern!r}{_suggestion(pattern, table, 'case')} (quote patterns such as 'nine-disk/*')"
            )
    return [name for name in table if not patterns or any(fnmatch.fnmatchcase(name, p) for p in patterns)]
