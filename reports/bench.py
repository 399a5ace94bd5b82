"""The page of one benchmark record: charts over size and over accuracy, and every row as a table."""

from __future__ import annotations

import base64
import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ninedisk.reports import pages, text
from ninedisk.reports.bench_dem import dem_charts, line_of
from ninedisk.reports.bench_roofline import BINDS, estimates
from ninedisk.reports.draw_points import PointChart, draw_points
from ninedisk.reports.pages import HERE
from ninedisk.reports.style import Look, engine_looks

Row = Mapping[str, Any]

SUITES = {
    "dem": "Many disks, contact springs",
    "cd": "Contact solvers on packings at rest",
    "flow": "Rigid disks in motion: time per simulated second beside the penetration",
    "harness": "The whole verification run",
}


def write_bench(record: Mapping[str, Any], path: Path) -> None:
    """Write the page of a record, one file that holds its style sheet and its figures.

    Parameters
    ----------
    record : mapping
        ``run_id``, ``provenance``, ``argv``, ``versions`` and ``rows``, as the benchmark writes them.
    path : Path
        File to write.
    """
    rows: Sequence[Row] = record["rows"]
    env = pages.environment()
    page = env.get_template("bench.html").render(
        record=record,
        facts=record["provenance"],
        suites={name: [row for row in rows if row["suite"] == name] for name in SUITES},
        titles=SUITES,
        checks={name: _checks(rows, name) for name in SUITES},
        figures={name: [embedded(chart) for chart in charts(rows, name)] for name in SUITES},
        rooflines=estimates([row for row in rows if row["suite"] == "dem"]),
        binds=BINDS,
        sheet=Markup((HERE / "assets" / "style.css").read_text(encoding="utf-8")),
    )
    path.write_text(page, encoding="utf-8")


def charts(rows: Sequence[Row], suite: str) -> list[PointChart]:
    """Charts of one suite: rates over size, time over the accuracy reached, roofs; none where nothing was timed."""
    timed = [row for row in rows if row["suite"] == suite and _finite(row["median_s"])]
    if suite == "dem":
        return dem_charts(timed)
    if suite == "flow":
        return [
            _penetration(problem, [row for row in timed if row["problem"] == problem])
            for problem in dict.fromkeys(row["problem"] for row in timed)
        ]
    if suite != "cd":
        return []
    looks = engine_looks({row["engine"]: row["engine"] for row in timed})
    return [
        _accuracy(problem, start, chosen, looks)
        for problem in dict.fromkeys(row["problem"] for row in timed)
        for start in ("cold", "warm")
        if (chosen := [row for row in timed if (row["problem"], row["start"]) == (problem, start)])
    ]


def _accuracy(problem: str, start: str, rows: Sequence[Row], looks: Mapping[str, Look]) -> PointChart:
    dots = [
        line_of(
            look,
            [(row["median_s"], row["check_value"], f"{row['tolerance']:g}") for row in rows if row["engine"] == name],
        )
        for name, look in looks.items()
        if any(row["engine"] == name for row in rows)
    ]
    label = "larger of residual and gap"
    return PointChart(f"{problem}, {start}: accuracy against cost", "time [s]", label, tuple(dots))


def _penetration(problem: str, rows: Sequence[Row]) -> PointChart:
    families = {name: name for name in (row["engine"].partition(",")[0] for row in rows)}
    looks = engine_looks(families)
    dots = [
        line_of(
            look,
            sorted(
                (row["rate"], row["penetration"], row["engine"])
                for row in rows
                if row["engine"].partition(",")[0] == name
            ),
        )
        for name, look in looks.items()
    ]
    return PointChart(
        f"{problem}: penetration against cost", "s / simulated s", "overlap per disk / radii", tuple(dots)
    )


def embedded(chart: PointChart) -> dict[str, Any]:
    """Title, text alternative, image as a data address and legend of a chart, for pages that are one file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chart.svg"
        draw_points(chart, path)
        # As an image, not as part of the page: the classes of one figure would restyle the next.
        data = base64.b64encode(path.read_bytes()).decode("ascii")
    return {
        "title": chart.title,
        "alt": chart.alt(),
        "source": f"data:image/svg+xml;base64,{data}",
        "looks": chart.looks,
    }


def _checks(rows: Sequence[Row], suite: str) -> dict[str, list[str]]:
    """Engines by the text of the check that they had to pass."""
    found: dict[str, list[str]] = {}
    for row in rows:
        engines = found.setdefault(row["check"], []) if row["suite"] == suite and row["check"] else []
        if row["engine"] not in engines:
            engines.append(row["engine"])
    return found


def _finite(value: Any) -> bool:
    return math.isfinite(text.as_float(value))
