"""Findings: what an engine, or a source, is known to do otherwise than the physics or its own documentation says.

A finding holds no measured number: its size is read from the store, so that it can be seen to be still there, gone or larger
(`ninedisk.harness.results.findings`). Findings stand beside what they are about, in a tuple ``FINDINGS`` of a module ``findings``: those of
an engine beside its adapter (``harness/engines/<engine>/findings.py``), errata of the source beside the cases that show them
(``harness/cases/<family>/findings.py``); so do those of other packages' engines and cases, beside the module that their entry point names.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from ninedisk.harness.api.registry import BUILTIN, case_table, engine_table

COMMANDS = "ninedisk.harness.wire.findings"
"""Module of the findings of engines that are known by their commands alone."""


@dataclass(frozen=True, kw_only=True)
class Size:
    """Where the size of a finding is in a store: the largest value of a column over the rows that match.

    Sizes are relative, so that findings can be ranked: ``rel_error`` and ``penetration`` as they are stored, ``abs_error`` and
    ``value`` divided by a scale that the store has as well.

    Parameters
    ----------
    table : {"measurements", "headlines", "cells", "determinism"}
        Table of `ninedisk.harness.results.schema`.
    case, variant : str
        Id of the case, and a glob of its variants' ids; of determinism that word, and the kind of repetition.
    column : str
        Column that is read: ``rel_error``, ``abs_error`` or ``value`` of a measurement, ``rel_error`` of a headline,
        ``penetration`` of a cell, or its ``broken``: 1 where it ended without an answer, 0 where it ran; ``difference`` of a repetition.
        The absolute value counts.
    quantity : str
        Quantity of the row, or the headline's name; empty for ``cells``.
    truth : str
        Kind of truth of a measurement, "" for any but ``published``: what is printed somewhere may itself be wrong.
    per : str
        Quantity of the same cell whose scale, the largest ``|expected|``, ``abs_error`` and ``value`` are divided by; "": the
        row's own quantity; "1": the quantity is relative as it is.
    over : float
        The finding is there while the size [-] is larger than this.
    over_why : str
        Why that and no other number: round-off, the order of the scheme, what a right engine shows.
    fails : bool
        Whether the check that measures it fails because of it: its tolerance then bounds nothing, and only growth makes it larger.
    sign : {-1, 0, 1}
        1 where the value is too large, -1 where it is too small (`sign_of`): an error of the other sign is not this finding. 0 where
        either sign is: of forces whose sense depends on the path, of what only says that something breaks.

    Examples
    --------
    >>> size = Size(
    ...     case="incline-block", variant="mu=0.4,dt=0.01", quantity="distance", over=1e-9, over_why="a stuck block rests"
    ... )
    >>> 2e-6 > size.over, 1e-12 > size.over
    (True, False)
    """

    table: Literal["measurements", "headlines", "cells", "determinism"] = "measurements"
    case: str
    variant: str = "*"
    column: str = "rel_error"
    quantity: str = ""
    truth: str = ""
    per: str = ""
    over: float
    over_why: str
    fails: bool = False
    sign: Literal[-1, 0, 1] = 0


def sign_of(value: float, expected: float) -> int:
    """Return 1 where a value is too large, -1 where it is too small, 0 where it is right or one of them is NaN.

    Of a truth below zero, such as a spin that turns clockwise, the size counts: -1.2 is too large where -1 is expected. A truth that is
    zero, or nothing beside the error, has no side: there a positive value is too large.

    Parameters
    ----------
    value, expected : float
        In the same unit.

    Returns
    -------
    int

    Examples
    --------
    >>> sign_of(1.2, 1.0), sign_of(-1.2, -1.0), sign_of(0.5, 1.0), sign_of(1.0, 1.0)
    (1, 1, -1, 0)
    """
    away = value - expected
    if expected < -NOTHING_BESIDE * abs(away):
        away = -away
    return int(away > 0.0) - int(away < 0.0)


NOTHING_BESIDE = 0.1
"""Truth over error below which the sign of the truth says nothing: a load at rest overlaps by m g/kn, and not by a hundred of it."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What is otherwise than it should be, and how to see it.

    Parameters
    ----------
    id : str
        ``<engine>/<words>``, as in ``kratos/arm-at-walls``; ``source/<words>`` for errata of the source.
    engine : str
        Id of the engine, by default that of ``id``; the engine that shows it where the source is wrong.
    versions : str
        Versions in which it was seen.
    what : str
        What happens, in one sentence.
    size : Size
        How large it is.
    cause_tested : bool
        Whether the size shows all that ``what`` says, so that another engine of that size does the same. False where ``what`` names a
        cause: other causes give similar sizes.
    documented : str
        Where the engine's documentation says so; "" where no such place is known.
    thread : str
        Address of an upstream issue or discussion; "" where none is known.
    command : str
        Complete ``ninedisk`` command that shows it; by default one that runs the case of ``size`` with the parameters that its
        variant names, or repeats runs of the engine.

    Examples
    --------
    >>> size = Size(
    ...     case="incline-block", variant="mu=0.4,dt=0.01", quantity="distance", over=1e-9, over_why="a stuck block rests"
    ... )
    >>> finding = Finding(id="acme/creeps", versions="1.0", what="a block that should stick creeps", size=size)
    >>> finding.engine, finding.command
    ('acme', 'ninedisk run incline-block --engine acme --set mu=0.4 --set dt=0.01')
    """

    id: str
    engine: str = ""
    versions: str
    what: str
    size: Size
    cause_tested: bool = False
    documented: str = ""
    thread: str = ""
    command: str = ""

    def __post_init__(self) -> None:
        """Fill in what the id and the place of the size say already."""
        engine = self.engine or self.id.partition("/")[0]
        parts = (part.strip("*") for part in self.size.variant.split(","))
        sets = "".join(f" --set {part}" for part in parts if "=" in part)
        if self.size.table == "determinism":
            command = f"ninedisk determinism --engine {engine}"
        else:
            command = f"ninedisk run {self.size.case} --engine {engine}{sets}"
        object.__setattr__(self, "engine", engine)
        object.__setattr__(self, "command", self.command or command)


@lru_cache(maxsize=1)
def known_findings() -> tuple[Finding, ...]:
    """Return the findings of all engines and cases that are registered, engines first; loads neither engines nor cases.

    Returns
    -------
    tuple of Finding

    Examples
    --------
    Ids are unique, and each begins with the engine's:

    >>> ids = [finding.id for finding in known_findings()]
    >>> len(ids) == len(set(ids)), all("/" in each for each in ids)
    (True, True)
    """
    return _collect()[0]


def finding_problems() -> tuple[str, ...]:
    """Return what is wrong with the findings of installed packages, a sentence each; such findings are left out.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> all(isinstance(sentence, str) for sentence in finding_problems())
    True
    """
    return _collect()[1]


@lru_cache(maxsize=1)
def _collect() -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    found: dict[str, Finding] = {}
    wrong: list[str] = []
    for module, origin in _modules().items():
        try:
            held: Iterable[Finding] = importlib.import_module(module).FINDINGS
            for each in held:
                if found.setdefault(each.id, each) is not each:
                    wrong.append(
                        f"{module} of {origin} has a finding {each.id!r} that another module has already: rename it"
                    )
        except (Exception, SystemExit) as error:
            if origin == BUILTIN:
                raise
            wrong.append(f"the findings of {origin} cannot be read from {module}: {type(error).__name__}: {error}")
    return tuple(found.values()), tuple(wrong)


def _modules() -> dict[str, str]:
    """Modules of findings that exist, beside those of registered engines and cases, and the distributions that they are from."""
    found = {COMMANDS: BUILTIN}
    for entry in (*engine_table().values(), *case_table().values()):
        package = entry.where.partition(":")[0].rpartition(".")[0]
        module = f"{package}.findings"
        if package and module not in found and _module_exists(module):
            found[module] = entry.origin
    return found


def _module_exists(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (Exception, SystemExit):  # whatever a broken package does where it begins; its engines say so
        return False
