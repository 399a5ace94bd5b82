"""What a planted defect is: a small, named change of an engine, of what it is asked, or of what it reports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ninedisk.harness.selftest.edits import Edit

if TYPE_CHECKING:
    from ninedisk.core.history import History
    from ninedisk.core.numerics import Numerics
    from ninedisk.core.scene import Scene
    from ninedisk.harness.api.engine import Timings

Kind = Literal["clean", "kernel", "python", "scene", "numerics", "history"]
KINDS: dict[str, str] = {
    "clean": "the engine as it is",
    "kernel": "a kernel of the core with code replaced",
    "python": "another module of the core with code replaced",
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
        "dem", "cd", or a kind of contact that contact dynamics is declared as, see `ninedisk.harness.selftest.faulty_engines`.
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


def planted(engine: str, kind: Kind, name: str, what: str, witness: str, *edits: tuple[str, str, str, str]) -> Defect:
    """The defect ``name`` of an engine; each edit is what `Edit` takes."""
    return Defect(
        name=name, engine=engine, kind=kind, what=what, witness=witness, edits=tuple(Edit(*edit) for edit in edits)
    )
