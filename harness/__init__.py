"""Runs verification cases on engines and judges them; `run_case` is the way in from Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ninedisk.harness.results.tables import CaseResult
    from ninedisk.harness.run.runner import run_case
    from ninedisk.harness.run.workers import run_matrix

__all__ = ["CaseResult", "run_case", "run_matrix"]

_HOMES = {
    "CaseResult": "ninedisk.harness.results.tables",
    "run_case": "ninedisk.harness.run.runner",
    "run_matrix": "ninedisk.harness.run.workers",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for: the command line starts faster without them."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(_HOMES[name]), name)
