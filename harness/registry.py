"""Which cases and engines there are: built-in ones and those of installed packages (entry points).

Ids are listed without importing anything that belongs to a case or an engine, so that ``ninedisk --help`` and
``ninedisk list`` stay fast; an object is imported when it is asked for.
"""

from __future__ import annotations

import fnmatch
import importlib
from collections.abc import Iterable, Sequence
from functools import lru_cache
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

from ninedisk.harness.errors import UsageError, close_matches

if TYPE_CHECKING:
    from ninedisk.harness.case import Case
    from ninedisk.harness.engine import Engine

BUILTIN_CASES: dict[str, str] = {
    "nine-disk/compression": "ninedisk.harness.cases.nine_disk_compression:CASE",
    "nine-disk/distortion": "ninedisk.harness.cases.nine_disk_distortion:CASE",
    "binary-collision": "ninedisk.harness.cases.binary_collision:CASE",
    "incline-block": "ninedisk.harness.cases.incline_block:CASE",
    "sliding/quasistatic": "ninedisk.harness.cases.sliding_quasistatic:CASE",
    "sliding/dynamic": "ninedisk.harness.cases.sliding_dynamic:CASE",
    "slip-to-roll": "ninedisk.harness.cases.slip_to_roll:CASE",
    "chain/newton-cradle": "ninedisk.harness.cases.newton_cradle:CASE",
    "impact/bouncing-disk": "ninedisk.harness.cases.bouncing_disk:CASE",
    "impact/oblique": "ninedisk.harness.cases.oblique_impact:CASE",
    "gas/elastic": "ninedisk.harness.cases.gas:CASE",
    "spinning-disk": "ninedisk.harness.cases.spinning_disk:CASE",
    "rolling/incline-disk": "ninedisk.harness.cases.rolling_incline:CASE",
    "static/stack": "ninedisk.harness.cases.static_stack:CASE",
    "row/pushed": "ninedisk.harness.cases.row_pushed:CASE",
    "strength/hexagonal": "ninedisk.harness.cases.strength_hexagonal:CASE",
    "invariance/units": "ninedisk.harness.cases.invariance:CASES",
    "invariance/rotation": "ninedisk.harness.cases.invariance:CASES",
    "invariance/galilei": "ninedisk.harness.cases.invariance:CASES",
    "invariance/objectivity": "ninedisk.harness.cases.rotating_box:CASE",
}
BUILTIN_ENGINES: dict[str, str] = {
    "dem": "ninedisk.harness.engines.dem:ENGINE",
    "cd": "ninedisk.harness.engines.cd:ENGINE",
    "yade": "ninedisk.harness.engines.yade:ENGINE",
    "pymunk": "ninedisk.harness.engines.pymunk:ENGINE",
    "lammps": "ninedisk.harness.engines.lammps:ENGINE",
    "bullet": "ninedisk.harness.engines.bullet:ENGINE",
    "dart": "ninedisk.harness.engines.dart:ENGINE",
    "siconos": "ninedisk.harness.engines.siconos:ENGINE",
    "box2d": "ninedisk.harness.engines.box2d:ENGINE",
    "mujoco": "ninedisk.harness.engines.mujoco:ENGINE",
    "drake": "ninedisk.harness.engines.drake:ENGINES",
    "drake-sap": "ninedisk.harness.engines.drake:ENGINES",
    "drake-lagged": "ninedisk.harness.engines.drake:ENGINES",
    "liggghts": "ninedisk.harness.engines.liggghts:ENGINE",
    "esys-particle": "ninedisk.harness.engines.esys_particle:ENGINE",
    "kratos": "ninedisk.harness.engines.kratos:ENGINE",
}
CASE_GROUP = "ninedisk.cases"
ENGINE_GROUP = "ninedisk.engines"


class UnknownIdError(UsageError):
    """No case or engine has this id."""


class BrokenEntryError(UsageError):
    """A case or engine is registered but cannot be loaded."""


@lru_cache(maxsize=1)
def case_table() -> dict[str, str]:
    """Every known case: id -> ``"module:attribute"``."""
    return _with_entry_points(BUILTIN_CASES, CASE_GROUP)


@lru_cache(maxsize=1)
def engine_table() -> dict[str, str]:
    """Every known engine: id -> ``"module:attribute"``."""
    return _with_entry_points(BUILTIN_ENGINES, ENGINE_GROUP)


def _with_entry_points(builtin: dict[str, str], group: str) -> dict[str, str]:
    table = dict(builtin)
    for entry in entry_points(group=group):
        known = table.setdefault(entry.name, entry.value)
        if known != entry.value:
            raise BrokenEntryError(
                f"two packages register {entry.name!r} under {group}: {known} and {entry.value}; uninstall one of them"
            )
    return table


def get_case(case_id: str) -> Case:
    """The case with this id.

    Raises
    ------
    UnknownIdError
        Naming close matches and all ids.
    BrokenEntryError
        If its module cannot be imported or does not define it.
    """
    found: Case = _load(case_id, case_table(), "case")
    return found


def get_engine(engine_id: str) -> Engine:
    """The engine with this id; raises as `get_case` does."""
    found: Engine = _load(engine_id, engine_table(), "engine")
    return found


def _load(name: str, table: dict[str, str], kind: str) -> Any:
    if name not in table:
        raise UnknownIdError(
            f"there is no {kind} {name!r}.{close_matches(name, table)} Known {kind}s: {', '.join(table)}"
        )
    module_name, _, attribute = table[name].partition(":")
    try:
        found = getattr(importlib.import_module(module_name), attribute)
    except Exception as error:
        raise BrokenEntryError(
            f"the {kind} {name!r} cannot be loaded from {table[name]}: {type(error).__name__}: {error}; "
            f"mend or uninstall the package that provides it"
        ) from error
    if isinstance(found, Sequence):  # a family module exports all of its cases at once
        found = next((member for member in found if member.id == name), None)
    if getattr(found, "id", None) != name:
        raise BrokenEntryError(
            f"{table[name]} is registered as {kind} {name!r} but its id is {getattr(found, 'id', None)!r}"
        )
    return found


def match_cases(globs: Iterable[str]) -> list[str]:
    """Ids of the cases that match any of the patterns, in the table's order; no pattern means all cases.

    Raises
    ------
    UnknownIdError
        If a pattern matches nothing.
    """
    table, patterns = case_table(), list(globs)
    for pattern in patterns:
        if not fnmatch.filter(table, pattern):
            raise UnknownIdError(
                f"no case matches {pattern!r}.{close_matches(pattern, table)} Known cases: {', '.join(table)} "
                f"(quote patterns such as 'nine-disk/*')"
            )
    return [name for name in table if not patterns or any(fnmatch.fnmatchcase(name, p) for p in patterns)]
