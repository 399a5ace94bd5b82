"""Building of the comparison report: read, draw, write, replace."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

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
    from ninedisk.reports.folder import fresh_folder
    from ninedisk.reports.load import load_store
    from ninedisk.reports.site import write_site

    tell = progress or _silent
    with fresh_folder(out, MARKER, "report") as fresh:
        tell("reading runs", 0, 1)
        stored = load_store(Path(store))
        tell("reading runs", 1, 1)
        write_site(stored, fresh, tell)
    return Path(out).absolute() / "index.html"


def _silent(_stage: str, _done: int, _total: int) -> None:
    """No progress is wanted."""
