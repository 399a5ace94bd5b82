"""Replacements in the core's sources, made while they are imported: no file is copied and none is changed.

This module imports nothing of the core, so that a process can plant the edits before the core is loaded.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

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
