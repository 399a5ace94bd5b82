"""The page of one convergence study: errors over the step, log-log, and the table of orders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from ninedisk.reports import pages
from ninedisk.reports.bench import embedded
from ninedisk.reports.convergence import slopes
from ninedisk.reports.draw_points import Dots, PointChart
from ninedisk.reports.pages import HERE
from ninedisk.reports.style import engine_looks

Row = Mapping[str, Any]

MOST_LINES = 6
"""Quantities in one chart; more of one unit share the next."""

VERDICT_CLASS = {
    "wrong order": "out3",
    "wrong limit": "out3",
    "undecided": "out1",
    "not judged": "none",
    "converges": "in0",
    "step-independent": "in1",
    "exact": "in0",
}
"""Colour class of each verdict; the word itself stands beside it."""


def converge_page(record: Mapping[str, Any]) -> str:
    """One HTML file that holds its style sheet and its figures.

    Parameters
    ----------
    record : mapping
        What ``ninedisk converge --json`` writes.
    """
    return (
        pages.environment()
        .get_template("converge.html")
        .render(
            record=record,
            figures=[embedded(chart) for chart in charts(record)],
            shades_of=VERDICT_CLASS,
            sheet=Markup((HERE / "assets" / "style.css").read_text(encoding="utf-8")),
        )
    )


def charts(record: Mapping[str, Any]) -> list[PointChart]:
    """A chart for each unit and way of measuring: all quantities that have something above round-off."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in record["rows"]:
        if row["order"] == row["order"]:
            groups.setdefault((row["unit"], row["by"]), []).append(row)
    made = []
    for (unit, by), rows in sorted(groups.items(), key=lambda item: item[0][1] != "error"):
        for first in range(0, len(rows), MOST_LINES):
            made.append(_chart(record, unit, by, rows[first : first + MOST_LINES]))
    return made


def _chart(record: Mapping[str, Any], unit: str, by: str, rows: Sequence[Row]) -> PointChart:
    names = {row["quantity"]: row["quantity"] for row in rows}
    looks = engine_looks(names)
    dots = []
    for row in rows:
        # A difference stands at the coarser of its two steps; the slope is the same.
        series = row["errors"] if by == "error" else row["differences"]
        points = [(h, y) for h, y in zip(record["steps"], series, strict=False) if y > row["floor"]]
        x, y = zip(*sorted(points), strict=True)
        dots.append(Dots(row["quantity"], looks[row["quantity"]], x, y))
    what = "error against the truth" if by == "error" else "difference of neighbouring levels"
    label = f"{record['step']} [{record['unit']}]"
    return PointChart(f"{what} [{unit or '-'}]", label, f"{what} [{unit or '-'}]", tuple(dots), slopes(dots))
