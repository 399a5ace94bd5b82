"""The page on determinism: engines against repetitions of a run that should change nothing, worst first."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment

from ninedisk.harness.results.schema import DETERMINISM_KINDS, DETERMINISM_VERDICTS, Row, worse_than_promised
from ninedisk.reports.panel.model import Panel


def shade(row: Row) -> str:
    """Colour class of a square; its word or number is in it."""
    if row["verdict"] == "not applicable":
        return "none"
    if row["verdict"] in ("different", "broken"):
        return "out3"
    return "in0" if row["verdict"] == "bitwise" else "out1" if worse_than_promised(row) else "in1"


def by_engine(panel: Panel) -> list[tuple[str, dict[str, Row]]]:
    """Rows of each engine by kind, disks and spheres apart; first those with most that is different, then not what it must be."""
    found: dict[tuple[str, bool], dict[str, Row]] = {}
    for row in panel.stored.determinism:
        found.setdefault((row["engine"], row["scene"] == "spheres"), {})[row["kind"]] = row

    def order(item: tuple[tuple[str, bool], dict[str, Row]]) -> tuple[Any, ...]:
        rows = item[1].values()
        counts = [-sum(row["verdict"] == verdict for row in rows) for verdict in DETERMINISM_VERDICTS[:3]]
        return counts[0] + counts[1], -sum(map(worse_than_promised, rows)), counts[2], item[0]

    return [(engine, rows) for (engine, _), rows in sorted(found.items(), key=order)]


def determinism_page(env: Environment, panel: Panel) -> str:
    """The matrix, what is not as it must be in words, and how it is measured."""
    lines = by_engine(panel)
    rows = [row for _, mine in lines for row in mine.values()]
    return env.get_template("determinism.html").render(
        root="",
        lines=lines,
        kinds=DETERMINISM_KINDS,
        shade=shade,
        worse=sorted(filter(worse_than_promised, rows), key=lambda row: DETERMINISM_VERDICTS.index(row["verdict"])),
        engines=panel.engines,
        sames=sum(row["verdict"] == "bitwise" for row in rows),
        asked=sum(row["verdict"] != "not applicable" for row in rows),
    )
