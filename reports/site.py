"""All files of the report into one folder."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from ninedisk.reports import pages
from ninedisk.reports.draw_points import PointChart
from ninedisk.reports.drawing import CaseDrawing, Chart, svg_image
from ninedisk.reports.load import Stored
from ninedisk.reports.model import build_panel
from ninedisk.reports.render import Job, render
from ninedisk.reports.speed import engine_speed

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
    speeds: dict[str, tuple[PointChart, Path]] = {}
    for engine in engines:
        chart = engine_speed(panel, engine.id)
        if chart is not None:
            speeds[engine.id] = chart, folder / "figures" / f"engine-{engine.slug}.svg"
    tell("planning figures", len(cases), len(cases))
    jobs = [job for drawing in drawings for job in drawing.jobs] + [Job(*speed) for speed in speeds.values()]
    render(jobs, lambda done, count: tell("drawing figures", done, count))
    total = len(cases) + len(engines) + 1
    for done, (case, drawing) in enumerate(zip(cases, drawings, strict=True)):
        tell("writing pages", done, total)
        page = pages.case_page(env, panel, case, drawing.values())
        (folder / "case" / f"{case.slug}.html").write_text(page, encoding="utf-8")
    for done, engine in enumerate(engines, start=len(cases)):
        tell("writing pages", done, total)
        shown = None
        if engine.id in speeds:
            chart, path = speeds[engine.id]
            shown = Chart(
                json.dumps(chart.spec(), allow_nan=False), chart.alt(), svg_image(path, chart.alt()), chart.looks
            )
        page = pages.engine_page(env, panel, engine, shown)
        (folder / "engine" / f"{engine.slug}.html").write_text(page, encoding="utf-8")
    (folder / "errata.html").write_text(pages.errata_page(env, panel), encoding="utf-8")
    (folder / "index.html").write_text(pages.index_page(env, panel), encoding="utf-8")
    tell("writing pages", total, total)
