"""Pages of single studies: a comparison (what got worse, and where both runs came from); orders of convergence over the step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import Environment

from ninedisk.harness.results.schema import CHANGE_VERDICTS, Change, Comparison
from ninedisk.reports import pages
from ninedisk.reports.drawing.charts import Dots, PointChart, engine_looks, on_page, slopes
from ninedisk.reports.panel import text

SHOWN = 200
"""Rows of one verdict that the page lists."""
VERDICTS = {
    "worse": ("✗", "out3"),
    "suspect": ("?", "out1"),
    "lost": ("∅", "out1"),
    "not-comparable": ("≠", "none"),
    "better": ("✓", "in0"),
    "new": ("+", "none"),
    "same": ("=", "in1"),
}
"""Symbol and colour class of each verdict; its words are in `ninedisk.harness.results.statuses`."""
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
"""Colour class of each verdict; the word itself is beside it."""


def environment() -> Environment:
    """The reports' templates with what these pages need besides."""
    env = pages.environment()
    env.filters |= {"amount": _amount, "factor": _factor, "what": _what}
    env.globals |= {"verdicts": VERDICTS}
    return env


def comparison_page(comparison: Comparison) -> str:
    """A comparison as one file that holds its style sheet, too."""
    return (
        environment()
        .get_template("dashboard/compare_alone.html")
        .render(**values(comparison), sheet=pages.sheet("dashboard.css"))
    )


def values(comparison: Comparison) -> dict[str, Any]:
    """What the template shows."""
    counts = Counter(change.verdict for change in comparison.changes)
    by_verdict: dict[str, list[Change]] = {verdict: [] for verdict in CHANGE_VERDICTS if verdict != "same"}
    for change in comparison.changes:
        if change.verdict in by_verdict:
            by_verdict[change.verdict].append(change)
    return {
        "root": "",
        "comparison": comparison,
        "counts": {verdict: counts[verdict] for verdict in CHANGE_VERDICTS},
        "by_verdict": {verdict: changes for verdict, changes in by_verdict.items() if changes},
        "versions": changed_versions(comparison),
        "shown": SHOWN,
    }


def changed_versions(comparison: Comparison) -> list[tuple[str, str, str]]:
    """Packages and engines whose version differs: name, before, after."""
    base, head = comparison.base.versions, comparison.head.versions
    return [
        (name, base.get(name, text.NOTHING), head.get(name, text.NOTHING))
        for name in sorted({*base, *head})
        if base.get(name) != head.get(name)
    ]


def _what(change: Change) -> str:
    return "the cell" if change.kind == "cell" else change.quantity or "their median"


def _amount(value: float, change: Change) -> str:
    if change.kind == "timing" and change.unit == "s":
        return text.seconds(value)
    unit = f" {change.unit}" if change.unit not in ("", "-", "1") else ""
    shown = text.error(value) if change.kind == "error" else f"{value:.2f}" if value == value else text.NOTHING
    return shown + (unit if shown != text.NOTHING else "")


def _factor(change: Change) -> str:
    base, head = change.base, change.head
    if base != base or head != head or base <= 0.0:
        return text.NOTHING
    return f"{text.factor(head / base)}×"


def converge_page(record: Mapping[str, Any]) -> str:
    """One HTML file that holds its style sheet, scripts and numbers.

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
            figures=[on_page(chart) for chart in charts(record)],
            shades_of=VERDICT_CLASS,
            **pages.single_file(),
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
        # A difference is at the coarser of its two steps; the slope is the same.
        series = row["errors"] if by == "error" else row["differences"]
        points = [(h, y) for h, y in zip(record["steps"], series, strict=False) if y > row["floor"]]
        x, y = zip(*sorted(points), strict=True)
        dots.append(Dots(row["quantity"], looks[row["quantity"]], x, y))
    what = "error against the truth" if by == "error" else "difference of neighbouring levels"
    label = f"{record['step']} [{record['unit']}]"
    return PointChart(f"{what} [{unit or '-'}]", label, f"{what} [{unit or '-'}]", tuple(dots), slopes(dots))
