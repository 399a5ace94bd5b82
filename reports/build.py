"""The comparison report of a store: what is drawn of each case, all pictures, all pages, into one folder that replaces the old one."""

from __future__ import annotations

import json
import multiprocessing
import os
import re
import shutil
import signal
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ninedisk.harness.results.schema import Comparison, EvaluatedFinding
from ninedisk.reports import pages
from ninedisk.reports.citation import caption_facts
from ninedisk.reports.determinism import determinism_page
from ninedisk.reports.drawing.charts import Chart, Image, on_page
from ninedisk.reports.drawing.draw import (
    Configuration,
    HistoryPanel,
    Projection,
    SceneView,
    StackPanel,
    draw_configuration,
    draw_history,
    draw_projection,
    draw_sketch,
    draw_stack,
    numbers_of,
    numeral,
    read_scene,
    read_space,
)
from ninedisk.reports.drawing.figures import (
    LEAST,
    Shown,
    case_budgets,
    case_figures,
    case_speed,
    convergences,
    engine_speed,
    looks_of,
    values_against_step,
)
from ninedisk.reports.drawing.places import place_figures
from ninedisk.reports.drawing.scenes import Arrays, case_configurations, moving_scenes, pack_case, spaces
from ninedisk.reports.findings import findings_page
from ninedisk.reports.folder import fresh_folder
from ninedisk.reports.panel.load import Stored, load_store
from ninedisk.reports.panel.model import CaseData, Panel, build_panel, case_tables, difference_matrix, folded_rows
from ninedisk.reports.panel.text import decoded
from ninedisk.reports.panel.uses import uses
from ninedisk.reports.stock import Profiles, by_profile
from ninedisk.reports.studies import comparison_page
from ninedisk.reports.tuning import curves

Progress = Callable[[str, int, int], None]
Picture = HistoryPanel | StackPanel | SceneView | Projection | Configuration
MARKER = ".ninedisk-report"
"""File that says: this folder is a report and may be replaced."""
BUNDLE = (
    "uplot.js",
    "uplot.css",
    "uplot-LICENSE.txt",
    "data.js",
    "paper.js",
    "charts.js",
    "player.js",
    "turning.js",
    "tables.js",
    "overview.js",
)
"""Scripts that the pages share, and the licence of the one that is not ours."""
MOST_SKETCHES = 4
"""Set-ups of one case that are drawn; those that look alike are drawn once."""
DRAWN_GROUPS = 2
"""Groups of variants of a figure of the source that have pictures for print; the charts show every group."""
GRIDS = {1: "", 2: "two", 3: "three", 4: "four"}
_POINTS_TO_PIXELS = 4.0 / 3.0
MOST_WORKERS = 4
FEW = 12
"""Below this number of figures the start of the workers costs more than it saves."""


def _no_progress(_stage: str, _done: int, _total: int) -> None:
    """No progress is wanted."""


def build_report(
    store: Path,
    out: Path,
    progress: Progress = _no_progress,
    findings: Sequence[EvaluatedFinding] = (),
    changes: Comparison | None = None,
) -> Path:
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
    findings : sequence of EvaluatedFinding
        What this store says of known findings (`ninedisk.harness.results.findings.evaluate`), largest first; their page is written
        where there are any.
    changes : Comparison or None
        The newest run against the one before; has a page as well.

    Returns
    -------
    Path
        ``out/index.html``.

    Raises
    ------
    ReportError
        If the store is empty or unreadable, or ``out`` cannot be written.
    """
    with fresh_folder(out, MARKER, "report") as fresh:
        progress("reading runs", 0, 1)
        stored = replace(load_store(Path(store)), findings=tuple(findings), changes=changes)
        progress("reading runs", 1, 1)
        write_site(stored, fresh, progress)
    return Path(out).absolute() / "index.html"


def write_site(stored: Stored, folder: Path, progress: Progress) -> None:
    """Write index, errata, case and engine pages, style sheet, scripts, numbers and figures into ``folder``."""
    tuned, stock = by_profile(stored)
    stored = tuned if tuned.cells else stored
    panel = build_panel(stored)
    profiles = Profiles(panel, stock) if stock.cells else None
    env = pages.environment()
    for name in ("case", "engine", "figures", "data", "assets"):
        (folder / name).mkdir()
    shutil.copyfile(pages.HERE / "assets" / "style.css", folder / "style.css")
    for name in BUNDLE:
        shutil.copyfile(pages.HERE / "assets" / name, folder / "assets" / name)
    cases, engines = list(panel.cases.values()), list(panel.engines.values())
    drawings = []
    for done, case in enumerate(cases):
        progress("planning figures", done, len(cases))
        drawings.append(CaseDrawing(panel, case, folder))
        (folder / "data" / f"{case.slug}.js").write_text(drawings[-1].numbers, encoding="utf-8")
    progress("planning figures", len(cases), len(cases))
    jobs = [job for drawing in drawings for job in drawing.jobs]
    render(jobs, lambda done, count: progress("drawing figures", done, count))
    found, total = uses(panel), len(cases) + len(engines) + 1
    for done, (case, drawing) in enumerate(zip(cases, drawings, strict=True)):
        progress("writing pages", done, total)
        page = pages.case_page(env, panel, case, drawing.values())
        (folder / "case" / f"{case.slug}.html").write_text(page, encoding="utf-8")
    for done, engine in enumerate(engines, start=len(cases)):
        progress("writing pages", done, total)
        speed = engine_speed(panel, engine.id)
        own = profiles.of_tuned(engine.id) if profiles else None
        page = pages.engine_page(env, panel, engine, found[0], on_page(speed) if speed else None, own)
        (folder / "engine" / f"{engine.slug}.html").write_text(page, encoding="utf-8")
    (folder / "errata.html").write_text(pages.errata_page(env, panel), encoding="utf-8")
    if stored.findings:
        (folder / "findings.html").write_text(findings_page(env, panel), encoding="utf-8")
    if stored.determinism:
        (folder / "determinism.html").write_text(determinism_page(env, panel), encoding="utf-8")
    if stored.changes:
        (folder / "changes.html").write_text(comparison_page(stored.changes), encoding="utf-8")
    (folder / "statuses.html").write_text(pages.statuses_page(env), encoding="utf-8")
    if profiles:
        (folder / "stock.html").write_text(profiles.page(env), encoding="utf-8")
    (folder / "index.html").write_text(pages.index_page(env, panel, found, stock=bool(profiles)), encoding="utf-8")
    progress("writing pages", total, total)


class CaseDrawing:
    """Plans the pictures of a case (`jobs`); once they are drawn, `values` is what the page's template asks for."""

    def __init__(self, panel: Panel, case: CaseData, folder: Path) -> None:
        self.panel, self.case, self.folder = panel, case, folder
        self.jobs: list[Job] = []
        self.looks = looks_of(panel, case)
        self.sketches = [(scene, variant, self._file(scene, "setup")) for variant, scene in self._scenes()]
        self.blocks = case_figures(panel, case)
        self.printed = {
            id(shown): self._file(shown.picture, "history")
            for block in self.blocks
            if block.plan.number
            for group in block.groups[:DRAWN_GROUPS]
            for shown in group.panels
        }
        self.budgets = [
            (plan, [(heading, [(p, self._file(p, "budget")) for p in panels]) for heading, panels in groups])
            for plan, groups in case_budgets(panel, case)
        ]
        self.plan, self.groups = case_configurations(case, self.looks.engines)
        self.frames = {id(picture): self._file(picture, "frame") for _, pictures in self.groups for picture in pictures}
        self.convergences = convergences(case, self.looks.engines)
        self.value_charts = values_against_step(case, self.looks.engines)
        self.places = place_figures(case, self.looks.engines, panel.stored.series)
        self.speed = case_speed(case, self.looks.engines)
        arrays = Arrays()
        self.moving = moving_scenes(case, arrays)
        self.spaces = spaces(case, arrays)
        self.tables = case_tables(case)
        folded = folded_rows(panel, self.tables)
        self.numbers = pack_case(
            panel, case, self.looks, arrays, {"scenes": self.moving, "spaces": self.spaces, "tables": folded}
        )

    def _file(self, picture: Picture, kind: str) -> Path:
        path = self.folder / "figures" / f"{self.case.slug}-{kind}-{len(self.jobs) + 1}.svg"
        self.jobs.append(Job(picture, path))
        if not isinstance(picture, HistoryPanel | StackPanel):  # those have their numbers in the page's data
            facts = caption_facts(self.panel, self.case)
            about = " ".join(f"# Case {facts['case']}, {facts['run']}. Cite: {facts['text']}".split())
            path.with_suffix(".csv").write_text(f"{about}\n{numbers_of(picture)}", encoding="utf-8")
        return path

    def _scenes(self) -> list[tuple[str, SceneView | Projection]]:
        """Set-ups that look different, by the first variant that has them; those in space from the side and from above."""
        found: dict[Any, list[tuple[str, SceneView | Projection]]] = {}
        for cell in self.case.cells:
            setup = decoded(cell["setup"], dict)
            if (scene := read_scene(setup)) is not None:
                found.setdefault(scene.signature, [(cell["variant"], scene)])
            elif (space := read_space(setup)) is not None:
                both = [(cell["variant"], Projection(space, above)) for above in (False, True)]
                found.setdefault(space.signature, list(both))
        return [one for sketches in found.values() for one in sketches][:MOST_SKETCHES]

    def values(self) -> dict[str, Any]:
        """Images, charts, legends and difference tables for the template."""
        names, differences = difference_matrix(self.panel.stored.series, self.case.id, self.case.measurements)
        blocks = [
            {
                "plan": block.plan,
                "legend": block.legend,
                "left_out": block.left_out,
                "has_error": any(s.picture.error_limits for group in block.groups for s in group.panels),
                "groups": [
                    {
                        "heading": group.heading,
                        "grid": GRIDS.get(group.columns, ""),
                        "panels": [self._panel(shown) for shown in group.panels],
                        "zero": group.zero,
                    }
                    for group in block.groups
                ],
            }
            for block in self.blocks
        ]
        used = {id(body[0]): body[0] for _, pictures in self.groups for p in pictures for body in p.bodies}
        return {
            "sketches": [self._sketch(scene, variant, path) for scene, variant, path in self.sketches],
            "setup_figure": next((figure.number for figure in self.case.figures if figure.kind == "setup"), ""),
            "blocks": blocks,
            "budgets": [
                (
                    plan,
                    [(heading, [self._stacked(p, path, heading) for p, path in panels]) for heading, panels in groups],
                )
                for plan, groups in self.budgets
            ],
            "configuration_plan": self.plan,
            "configuration_looks": {engine: look for engine, look in self.looks.engines.items() if id(look) in used},
            "configurations": [
                (
                    heading,
                    [svg_image(self.frames[id(p)], self._alt(p, heading), self._alt(p, heading)) for p in pictures],
                )
                for heading, pictures in self.groups
            ],
            "moving": next(
                (name for name in self.moving if self.plan.matches(self.case.variants[name])),
                next(iter(self.moving), None),
            ),
            "turning": next((variant for _, variant, _ in self.sketches if variant in self.spaces), None),
            "convergences": [(c, on_page(c.chart) if c.chart else None) for c in self.convergences],
            "value_charts": [(plan, [on_page(chart) for chart in charts]) for plan, charts in self.value_charts],
            "least": LEAST,
            "place_charts": [
                (each.plan, each.legend, [on_page(chart) for chart in each.charts]) for each in self.places
            ],
            "speed": on_page(self.speed) if self.speed else None,
            "tuning": [(name, on_page(chart)) for name, chart in curves(self.panel, self.case.id, self.looks.engines)],
            "engine_looks": {
                engine: look
                for engine, look in self.looks.engines.items()
                if any(cell["engine"] == engine and cell["support"] != "no" for cell in self.case.cells)
            },
            "tables": self.tables,
            "compared": names,
            "differences": differences,
        }

    def _panel(self, shown: Shown) -> Chart:
        path = self.printed.get(id(shown))
        image = svg_image(path, shown.alt) if path else None
        return Chart(json.dumps(shown.spec, allow_nan=False), shown.alt, {}, image)

    def _stacked(self, picture: StackPanel, path: Path, heading: str) -> Image:
        where = f" ({heading})" if heading else ""
        total = picture.base + sum((values for *_, values in picture.bands), start=0.0 * picture.base)
        spread = float(total.max() - total.min())
        reported = f"The sum of {', '.join(name for name, *_ in picture.bands)} changes by {spread:.2g} J of {float(total[0]):.3g} J"
        return svg_image(
            path, f"{picture.title}{where}: stacked energies. {reported}.", f"{picture.title}. {reported}."
        )

    def _alt(self, picture: Configuration, heading: str) -> str:
        engines = ", ".join(body[0].label for body in picture.bodies)
        where = f" ({heading})" if heading else ""
        return f"Configuration at {picture.title}{where}: {bodies(len(picture.radius))} and walls, by {engines}."

    def _sketch(self, picture: SceneView | Projection, variant: str, path: Path) -> Image:
        scene: Any = picture.scene if isinstance(picture, Projection) else picture
        turns = [np.any(wall.spin) for wall in scene.walls]
        moving = [
            f"{wall.name} {'turns' if turn else 'moves'}"
            for wall, turn in zip(scene.walls, turns, strict=True)
            if turn or wall.moves
        ]
        walls = ", ".join(moving) or ("walls at rest" if scene.walls else "no walls")
        alt = f"Set-up {variant}: {bodies(len(scene.x))} and {len(scene.walls)} wall{'' if len(scene.walls) == 1 else 's'}; {walls}."
        marks = "; ".join(f"{numeral(k)} = {label.replace('_', ' ')}" for k, (label, _) in enumerate(scene.marks))
        caption = f"Set-up of {variant.replace(',', ', ') or 'the case'}." + (
            f" Watched contacts: {marks}." if marks else ""
        )
        if isinstance(picture, Projection):
            caption = f"{picture.title[0].upper()}{picture.title[1:]}. {caption}"
            alt = f"{alt[:-1]}; seen {picture.title}."
        elif scene.block:
            caption += " The body cannot turn: a block, which engines get as a disk of that width that may not rotate."
        return svg_image(path, alt, caption)


def bodies(number: int) -> str:
    """A number of bodies in words."""
    return "1 body" if number == 1 else f"{number} bodies"


def svg_image(path: Path, alt: str, caption: str = "") -> Image:
    """Image with the size that its SVG states, so that the page does not jump while it loads."""
    with path.open(encoding="utf-8") as file:
        head = file.read(600)
    sizes = [re.search(rf'\b{name}="([0-9.]+)pt"', head) for name in ("width", "height")]
    width, height = (round(float(size[1]) * _POINTS_TO_PIXELS) if size else 0 for size in sizes)
    data = f"figures/{path.stem}.csv" if path.with_suffix(".csv").exists() else ""
    return Image(f"figures/{path.name}", alt, width, height, caption, data)


@dataclass(frozen=True)
class Job:
    """A picture and the file that it goes to."""

    picture: Picture
    path: Path


def render(jobs: Sequence[Job], progress: Callable[[int, int], None], workers: int | None = None) -> None:
    """Draw every job; ``progress`` hears how many are done and how many there are.

    Workers are forked, so that they neither load matplotlib again nor import the caller's main module; without fork, or
    if a worker dies, the rest is drawn here.
    """

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    count = min(workers or cores, MOST_WORKERS)
    left = dict(enumerate(jobs))
    if count > 1 and len(jobs) >= FEW and "fork" in multiprocessing.get_all_start_methods():
        try:
            context = multiprocessing.get_context("fork")
            with ProcessPoolExecutor(count, context, initializer=_end_with, initargs=(os.getpid(),)) as pool:
                waiting = {pool.submit(_draw, job): number for number, job in left.items()}
                for future in as_completed(waiting):
                    future.result()
                    del left[waiting[future]]
                    progress(len(jobs) - len(left), len(jobs))
        except BrokenProcessPool:
            pass
    for number in list(left):
        _draw(left.pop(number))
        progress(len(jobs) - len(left), len(jobs))


def _end_with(parent: int) -> None:
    """In a worker: end it by the usual signals, and when its parent is gone, whose pipes its siblings hold open."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


_DRAW: dict[type, Callable[[Any], str]] = {
    HistoryPanel: draw_history,
    StackPanel: draw_stack,
    SceneView: draw_sketch,
    Projection: draw_projection,
    Configuration: draw_configuration,
}


def _draw(job: Job) -> None:
    job.path.write_text(_DRAW[type(job.picture)](job.picture), encoding="utf-8")
