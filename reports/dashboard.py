"""Building of the regression dashboard from a history: overview, a page per case and engine, comparisons around marks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ninedisk.harness.results.schema import History
from ninedisk.reports.dashboard_pages import Pages
from ninedisk.reports.folder import fresh_folder
from ninedisk.reports.pages import HERE

MARKER = ".ninedisk-dashboard"
"""File that says: this folder is a dashboard and may be replaced."""


def build_dashboard(history: History, out: Path, progress: Callable[[str, int, int], None]) -> Path:
    """Write the dashboard into the folder ``out``, which is replaced as a whole.

    Parameters
    ----------
    history : History
    out : Path
    progress : callable
        Called with a stage, the number of pieces done and their number.

    Returns
    -------
    Path
        ``out/index.html``.

    Raises
    ------
    ReportError
        If ``out`` is something else than an earlier dashboard, or cannot be written.
    """
    with fresh_folder(out, MARKER, "dashboard") as folder:
        pages = Pages(history)
        for name in ("lines", "compare"):
            (folder / name).mkdir()
        sheets = [(HERE / "assets" / name).read_text(encoding="utf-8") for name in ("style.css", "dashboard.css")]
        (folder / "style.css").write_text("\n".join(sheets), encoding="utf-8")
        script = (HERE / "assets" / "dashboard.js").read_text(encoding="utf-8")
        (folder / "dashboard.js").write_text(script, encoding="utf-8")
        total = len(pages.places) + len(history.comparisons) + 1
        written = 0
        for place in pages.places:
            progress("writing pages", written, total)
            (folder / pages.file(place)).write_text(pages.lines(place), encoding="utf-8")
            written += 1
        for around in history.comparisons:
            progress("writing pages", written, total)
            (folder / pages.compare_file(around)).write_text(pages.compare(around), encoding="utf-8")
            written += 1
        (folder / "index.html").write_text(pages.index(), encoding="utf-8")
        progress("writing pages", total, total)
    return Path(out).absolute() / "index.html"
