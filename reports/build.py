"""Building of the comparison report: read, draw, write, replace."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ninedisk.reports.errors import ReportError

Progress = Callable[[str, int, int], None]
MARKER = ".ninedisk-report"
"""File that says: this folder is a report and may be replaced."""


def build_report(store: Path, out: Path, progress: Progress | None = None) -> Path:
    """Build the comparison report of a store.

    Parameters
    ----------
    store : Path
        Folder with ``runs/<run_id>/``.
    out : Path
        Folder of the report. It is written beside it and replaced at the end, so that a reader never meets half a
        report; an existing folder that is neither empty nor a report is left alone.
    progress : callable, optional
        Called with a stage, the number of pieces done and their number.

    Returns
    -------
    Path
        ``out/index.html``.

    Raises
    ------
    ReportError
        If the store is empty or unreadable, or ``out`` cannot be written.
    """
    from ninedisk.reports.load import load_store
    from ninedisk.reports.site import write_site

    tell = progress or _silent
    store, out = Path(store), Path(out).absolute()
    _check_target(out)
    tell("reading runs", 0, 1)
    stored = load_store(store)
    tell("reading runs", 1, 1)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as problem:
        raise _unwritable(out, problem) from problem
    try:
        fresh.chmod(0o755)
        write_site(stored, fresh, tell)
        (fresh / MARKER).write_text("This folder is replaced as a whole by the next report.\n", encoding="utf-8")
        _replace(fresh, out)
    except OSError as problem:
        raise _unwritable(out, problem) from problem
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return out / "index.html"


def _silent(_stage: str, _done: int, _total: int) -> None:
    """No progress is wanted."""


def _check_target(out: Path) -> None:
    if not out.exists():
        return
    if not out.is_dir():
        raise ReportError(f"{out} is a file: name a folder for the report")
    try:
        foreign = not (out / MARKER).exists() and any(out.iterdir())
    except OSError as problem:
        raise _unwritable(out, problem) from problem
    if foreign:
        raise ReportError(f"{out} holds files that are no report of ninedisk: name another folder, or empty it")


def _replace(fresh: Path, out: Path) -> None:
    """Put ``fresh`` in the place of ``out``; the old report comes back if that fails."""
    if not out.exists():
        os.rename(fresh, out)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{out.name}-old-", dir=out.parent)) / out.name
    os.rename(out, old)
    try:
        os.rename(fresh, out)
    except OSError:
        os.rename(old, out)
        raise
    finally:
        shutil.rmtree(old.parent, ignore_errors=True)


def _unwritable(out: Path, problem: Any) -> ReportError:
    return ReportError(f"the report cannot be written to {out} ({problem}): name a folder that you may write to")
