"""Defects that are edits of a source of the core."""

from __future__ import annotations

from ninedisk.harness.selftest.defect import Defect, Kind
from ninedisk.harness.selftest.edits import Edit


def planted(engine: str, kind: Kind, name: str, what: str, witness: str, *edits: tuple[str, str, str]) -> Defect:
    """The defect ``name`` of an engine; each edit is a module of the core, a text in it, and what stands there instead."""
    return Defect(
        name=name, engine=engine, kind=kind, what=what, witness=witness, edits=tuple(Edit(*edit) for edit in edits)
    )
