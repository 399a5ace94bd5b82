"""Tables of words: whatever is keyed by an enumeration says something of each of its members."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from enum import Enum
from types import ModuleType
from typing import Literal, get_args, get_origin

import pytest

import ninedisk.core
import ninedisk.harness
import ninedisk.references
import ninedisk.reports
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.cases.adapter.probe_of import probe_of
from ninedisk.harness.results.schema import CHANGE_VERDICTS, STATUSES, WORST_FIRST
from ninedisk.harness.run.converge import VERDICTS
from ninedisk.reports.panel import text as words

OUTSIDE = (
    "driver",
    "solver_driver",
    "yade_parts",
    "lammps_parts",
    "motion_parts",
    "drivers",
    "template",
    "pytest_plugin",
    "__main__",
)
"""Modules that run inside other programs."""

PARTIAL = {
    "harness.api.capabilities.IN_3D": "most capabilities have one name in 2D and 3D",
    "harness.api.capabilities.TWISTING": "resistance to twisting is never viscous",
    "reports.site.BADGE_COLOURS": "a badge tells whether all passes",
    "harness.cases.differences.FINDING_WORDS": "two differences choose the truth that binds, and are no findings",
    "harness.bench.problem_set.SUFFIX": "the open set is of the plane",
    "harness.check_engine.verdict.CASE_OF": "some capabilities have a probe and no case of their own",
    "harness.engines.yade.adapter.NOTE_ROLLING": "YADE has no constant torque",
    "reports.selftest.KINDS": "unchanged engines (clean) are no defect that the page describes",
}
"""Tables that speak of some members only, and why."""


def modules() -> Iterator[ModuleType]:
    """Every module of the package that can be imported here."""
    for package in (ninedisk.core, ninedisk.references, ninedisk.harness, ninedisk.reports):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not any(part in OUTSIDE or part.endswith("_session") for part in found.name.split(".")):
                try:
                    yield importlib.import_module(found.name)
                except ImportError:  # of an engine that is not installed
                    continue


def vocabularies() -> dict[str, frozenset[str]]:
    """Every enumeration, every `Literal` of words and the statuses, by name."""
    found = {
        "STATUSES": frozenset(STATUSES),
        "CHANGE_VERDICTS": frozenset(CHANGE_VERDICTS),
        "VERDICTS": frozenset(VERDICTS),
    }
    for module in modules():
        for name, value in vars(module).items():
            if isinstance(value, type) and issubclass(value, Enum) and value.__module__ == module.__name__:
                found[name] = frozenset(str(member.value) for member in value)
            elif (
                get_origin(value) is Literal
                and len(get_args(value)) > 1
                and all(isinstance(word, str) for word in get_args(value))
            ):
                found[name] = frozenset(get_args(value))
    return found


def tables() -> Iterator[tuple[str, frozenset[str]]]:
    """Every module's constant that maps from words, with its keys; named by the module nearest the top, where it stands."""
    seen: set[int] = set()
    for module in sorted(modules(), key=lambda each: each.__name__.count(".")):
        for name, value in vars(module).items():
            if (
                isinstance(value, Mapping)
                and id(value) not in seen  # imported elsewhere
                and len(value) > 1
                and all(isinstance(key, str) for key in value)
                and not name.startswith("__")
            ):
                seen.add(id(value))
                yield f"{module.__name__.removeprefix('ninedisk.')}.{name}", frozenset(str(key) for key in value)


def test_every_table_of_an_enumeration_is_complete() -> None:
    """A table whose keys are all of one enumeration has all of them; of several, those of one."""
    known, seen = vocabularies(), 0
    for name, keys in tables():
        fitting = {word: members for word, members in known.items() if keys <= members}
        if not fitting or name in PARTIAL:
            continue
        seen += 1
        least = min(fitting, key=lambda word: len(fitting[word] - keys))
        assert keys == fitting[least], (
            f"{name} lacks {sorted(fitting[least] - keys)} of {least}; or give the reason in PARTIAL"
        )
    assert seen >= 10


def test_exceptions_are_none_too_many() -> None:
    assert set(PARTIAL) <= {name for name, _ in tables()}


def test_statuses_and_support_have_symbol_and_meaning() -> None:
    for table, members in (
        (words.STATUS_SYMBOL, STATUSES), (words.STATUS_MEANING, STATUSES),
        (words.SUPPORT_PIPS, SupportLevel), (words.SUPPORT_MEANING, SupportLevel),
    ):  # fmt: skip
        assert set(table) == {str(member) for member in members}
    assert set(WORST_FIRST) | {"pass"} == set(STATUSES)


@pytest.mark.parametrize("capability", Capability)
def test_every_capability_has_a_probe(capability: Capability) -> None:
    assert probe_of(capability, get_engine("dem").info()).setup.scene.bodies is not None
