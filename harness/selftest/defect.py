"""What a planted defect is: a small, named change of an engine, of what it is asked, or of what it reports.

Edits of the core's sources are made while they are imported: no file is copied and none is changed. This module imports nothing of
the core, so that a process can plant the edits before the core is loaded.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from ninedisk.core.history import History
    from ninedisk.core.numerics import Numerics
    from ninedisk.core.scene import Scene
    from ninedisk.harness.api.engine import Timings

Kind = Literal["clean", "kernel", "python", "scene", "numerics", "history"]
KINDS: dict[str, str] = {
    "clean": "the engine as it is",
    "kernel": "a kernel of the core with one text replaced",
    "python": "another module of the core with one text replaced",
    "scene": "a right engine on a wrong scene",
    "numerics": "a right engine with wrong numerics",
    "history": "a right engine whose report is wrong",
}

Before = Callable[["Scene", "Numerics"], tuple["Scene", "Numerics"]]
After = Callable[["History"], "History"]


@dataclass(frozen=True, kw_only=True)
class Defect:
    """One wrong engine.

    Parameters
    ----------
    name : str
        Unique among the defects of an engine.
    engine : str
        "dem", "cd", or a kind of contact that contact dynamics is declared as, see `ninedisk.harness.selftest.lies`.
    kind : str
        A key of `KINDS`.
    what : str
        What is wrong, in a few words.
    witness : str
        Probe of `ninedisk.harness.selftest.panel` that catches it at little cost; tests run this one alone.
    edits : tuple of Edit
        Changes of the core's sources (kinds "kernel" and "python").
    before : callable, optional
        What the engine sees in place of the scene and the numerics (kinds "scene" and "numerics").
    after : callable, optional
        What the engine reports in place of its history (kind "history").
    timed : callable, optional
        What it reports in place of its timings (kind "history").
    hole : str
        Not empty: no case of the suite can see this defect, for this reason. It is shown as a known hole; once a check fails, the
        hole is closed and the note must go.
    """

    name: str
    engine: str
    kind: Kind
    what: str
    witness: str = ""
    edits: tuple[Edit, ...] = ()
    before: Before | None = None
    after: After | None = None
    timed: Callable[[Timings], Timings] | None = None
    hole: str = ""

    @property
    def id(self) -> str:
        """``engine/name``."""
        return f"{self.engine}/{self.name}"


CORE = "ninedisk.core."


class StaleEditError(RuntimeError):
    """An edit no longer fits the source that it was written for."""


@dataclass(frozen=True)
class Edit:
    """Replace ``old`` by ``new`` in a module of the core, ``cd.step`` for instance; ``old`` must occur exactly once."""

    module: str
    old: str
    new: str

    @property
    def name(self) -> str:
        """Full name of the module."""
        return CORE + self.module


def edited(source: str, edits: Sequence[Edit]) -> str:
    """The source of one module after its edits.

    Raises
    ------
    StaleEditError
        If a text to replace does not occur exactly once, or replacing it changes nothing.
    """
    for edit in edits:
        count = source.count(edit.old)
        if count != 1 or edit.old == edit.new:
            found = f"occurs {count} times" if count != 1 else "is its own replacement"
            raise StaleEditError(
                f"a planted defect went stale: in {edit.name} the text {edit.old!r} {found}; "
                "write its edit anew for the source as it is now"
            )
        source = source.replace(edit.old, edit.new)
    return source


def check_edits(edits: Sequence[Edit]) -> None:
    """Try the edits on the sources as they are now.

    Raises
    ------
    StaleEditError
        As `edited` does, or if a module does not exist.
    """
    for name, chosen in by_module(edits).items():
        spec = importlib.util.find_spec(name)
        if spec is None or spec.origin is None:
            raise StaleEditError(f"a planted defect went stale: there is no module {name}")
        edited(Path(spec.origin).read_text(encoding="utf-8"), chosen)


def by_module(edits: Sequence[Edit]) -> dict[str, list[Edit]]:
    """Edits by the full name of their module."""
    found: dict[str, list[Edit]] = {}
    for edit in edits:
        found.setdefault(edit.name, []).append(edit)
    return found


class _EditedLoader(SourceFileLoader):
    """Loads a module from its edited source, never from a file of compiled code."""

    def __init__(self, name: str, path: str, edits: Sequence[Edit]) -> None:
        super().__init__(name, path)
        self._edits = edits

    def get_code(self, fullname: str) -> CodeType:  # noqa: ARG002
        source = edited(Path(self.path).read_text(encoding="utf-8"), self._edits)
        code: CodeType = compile(source, self.path, "exec", dont_inherit=True)
        return code


class _EditingFinder(MetaPathFinder):
    def __init__(self, edits: Mapping[str, Sequence[Edit]]) -> None:
        self._edits = edits

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname not in self._edits:
            return None
        for finder in sys.meta_path:
            spec = None if finder is self else finder.find_spec(fullname, path, target)
            if spec is not None and spec.origin is not None:
                spec.loader = _EditedLoader(fullname, spec.origin, self._edits[fullname])
                return spec
        return None


def plant(edits: Sequence[Edit]) -> None:
    """Have the modules of the core imported with their edits from now on.

    Raises
    ------
    RuntimeError
        If the core is loaded already.
    """
    loaded = [name for name in sys.modules if name.startswith(CORE[:-1])]
    if edits and loaded:
        raise RuntimeError(f"{loaded[0]} is loaded already: edits must be planted first")
    sys.meta_path.insert(0, _EditingFinder(by_module(edits)))


def planted(engine: str, kind: Kind, name: str, what: str, witness: str, *edits: tuple[str, str, str]) -> Defect:
    """The defect ``name`` of an engine; each edit is a module of the core, a text in it, and what stands there instead."""
    return Defect(
        name=name, engine=engine, kind=kind, what=what, witness=witness, edits=tuple(Edit(*edit) for edit in edits)
    )
