"""The page of one comparison: what got worse, beside what the two runs came from."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from jinja2 import Environment

from ninedisk.harness.results.schema import CHANGE_VERDICTS, Change, Comparison
from ninedisk.reports import pages, text
from ninedisk.reports.pages import HERE

SHOWN = 200
"""Rows of one verdict that the page lists."""

VERDICTS = {
    "worse": ("✗", "Got worse", "out3"),
    "suspect": ("?", "Suspect: look twice", "out1"),
    "lost": ("∅", "Lost: in BASE, not in HEAD", "out1"),
    "not-comparable": ("≠", "Not comparable", "none"),
    "better": ("✓", "Got better", "in0"),
    "new": ("+", "New in HEAD", "none"),
    "same": ("=", "Same", "in1"),
}
"""Symbol, heading and colour class of each verdict."""


def environment() -> Environment:
    """The reports' templates with what these pages need besides."""
    env = pages.environment()
    env.filters |= {"amount": _amount, "factor": _factor, "what": _what}
    env.globals |= {"verdicts": VERDICTS}
    return env


def write_comparison(comparison: Comparison, path: Path) -> None:
    """Write a comparison as one file that holds its style sheet, too."""
    sheets = "\n".join((HERE / "assets" / name).read_text(encoding="utf-8") for name in ("style.css", "dashboard.css"))
    page = environment().get_template("compare_alone.html").render(**values(comparison), sheet=sheets)
    path.write_text(page, encoding="utf-8")


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
    return f"{text.ratio(head / base)}×" if not 0.01 < head / base < 99.5 else f"{head / base:.2f}×"
