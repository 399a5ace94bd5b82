"""All files of the report into one folder."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from ninedisk.reports import pages
from ninedisk.reports.drawing import CaseDrawing
from ninedisk.reports.load import Stored
from ninedisk.reports.panel import build_panel
from ninedisk.reports.render import render


def write_site(stored: Stored, folder: Path, tell: Callable[[str, int, int], None]) -> None:
    """Write index, case and engine pages, style sheet and figures into ``folder``."""
    panel = build_panel(stored)
    env = pages.environment()
    for name in ("case", "engine", "figures"):
        (folder / name).mkdir()
    shutil.copyfile(pages.HERE / "assets" / "style.css", folder / "style.css")
    cases, engines = list(panel.cases.values()), list(panel.engines.values())
    drawings = []
    for done, case in enumerate(cases):
        tell("planning figures", done, len(cases))
        drawings.append(CaseDrawing(panel, case, folder))
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
        page = pages.engine_page(env, panel, engine)
        (folder / "engine" / f"{engine.slug}.html").write_text(page, encoding="utf-8")
    (folder / "index.html").write_text(pages.index_page(env, panel), encoding="utf-8")
    tell("writing pages", total, total)
