"""Building of the comparison report: read the store, draw, write all files into one folder that replaces the old one."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from ninedisk.reports import pages
from ninedisk.reports.charts import on_page
from ninedisk.reports.drawing import CaseDrawing, render
from ninedisk.reports.figures import engine_speed
from ninedisk.reports.load import Stored
from ninedisk.reports.model import build_panel

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

    tell = progress or _silent
    with fresh_folder(out, MARKER, "report") as fresh:
        tell("reading runs", 0, 1)
        stored = load_store(Path(store))
        tell("reading runs", 1, 1)
        write_site(stored, fresh, tell)
    return Path(out).absolute() / "index.html"


def _silent(_stage: str, _done: int, _total: int) -> None:
    """No progress is wanted."""


BUNDLE = ("uplot.js", "uplot.css", "uplot-LICENSE.txt", "data.js", "charts.js", "player.js", "tables.js")
"""Scripts that the pages share, and the licence of the one that is not ours."""


def write_site(stored: Stored, folder: Path, tell: Callable[[str, int, int], None]) -> None:
    """Write index, errata, case and engine pages, style sheet, scripts, numbers and figures into ``folder``."""
    panel = build_panel(stored)
    env = pages.environment()
    for name in ("case", "engine", "figures", "data", "assets"):
        (folder / name).mkdir()
    shutil.copyfile(pages.HERE / "assets" / "style.css", folder / "style.css")
    for name in BUNDLE:
        shutil.copyfile(pages.HERE / "assets" / name, folder / "assets" / name)
    cases, engines = list(panel.cases.values()), list(panel.engines.values())
    drawings = []
    for done, case in enumerate(cases):
        tell("planning figures", done, len(cases))
        drawings.append(CaseDrawing(panel, case, folder))
        (folder / "data" / f"{case.slug}.js").write_text(drawings[-1].numbers, encoding="utf-8")
    tell("planning figures", len(cases), len(cases))
    jobs = [job for drawing in drawings for job in drawing.jobs]
    render(jobs, lambda done, count: tell("drawing figures", done, count))
    total = len(cases) + len(engines) + 1
    for done, (case, drawing) in enumerate(zip(cases, drawings, strict=True)):
        tell("writing pages", done, total)
        page = pages.case_page(env, panel, case, drawing.values())
        (folder / "case" / f"{case.slug}.html").write_text(page, encoding="utf-8")
    for done, engine in enumerate(engines, start=len(cases)):
        tell("writing pages", done, total)
        speed = engine_speed(panel, engine.id)
        page = pages.engine_page(env, panel, engine, on_page(speed) if speed else None)
        (folder / "engine" / f"{engine.slug}.html").write_text(page, encoding="utf-8")
    (folder / "errata.html").write_text(pages.errata_page(env, panel), encoding="utf-8")
    (folder / "index.html").write_text(pages.index_page(env, panel), encoding="utf-8")
    tell("writing pages", total, total)
