"""The measurements of a case in three tables: rated, known gaps, without a rating; long ones continue in the data file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ninedisk.reports import text
from ninedisk.reports.load import Row
from ninedisk.reports.model import EXPLAINED, CaseData, Panel, is_rated, worst_first
from ninedisk.reports.words import shade, symbol

SHOWN = 40
"""Measurements that a page shows before the rest is folded."""


@dataclass(frozen=True)
class CaseTables:
    """Rows of a case, worst first; ``notes`` are (reason of the tolerance, source of the truth, reason of the status)."""

    rows: list[Row]
    gaps: list[Row]
    unrated: list[Row]
    notes: list[tuple[str, str, str]]

    @property
    def folded(self) -> dict[str, list[Row]]:
        """Rows that the page shows on demand, by table."""
        return {"rows": self.rows[SHOWN:], "gaps": self.gaps[SHOWN:], "unrated": self.unrated}


def case_tables(case: CaseData) -> CaseTables:
    """Sort the measurements of a case into tables and number the reasons of the folded ones."""
    rows = worst_first(row for row in case.measurements if is_rated(row) and row["status"] not in EXPLAINED)
    gaps = worst_first(row for row in case.measurements if row["status"] in EXPLAINED)
    unrated = [row for row in case.measurements if not is_rated(row) and row["status"] not in EXPLAINED]
    notes: dict[tuple[str, str, str], int] = {}
    for row in (*rows[SHOWN:], *gaps[SHOWN:], *unrated):
        # What a failure says, its numbers say as well; every other reason is told once.
        reason = "" if row["status"] == "fail" else row["reason"]
        row["note"] = notes.setdefault((row["why"], row["source"], reason), len(notes) + 1)
    return CaseTables(rows, gaps, unrated, list(notes))


def folded_rows(panel: Panel, tables: CaseTables) -> dict[str, list[list[Any]]]:
    """The folded rows as the page prints them: class and text of status, class and text of the ratio, ten texts, note."""
    return {name: [_printed(panel, row) for row in rows] for name, rows in tables.folded.items()}


def _printed(panel: Panel, row: Row) -> list[Any]:
    unit = f" [{row['unit']}]" if row["unit"] not in ("", "-", "1") else ""
    step = f", worst at step {row['worst_step']}" if row["worst_step"] is not None and row["worst_step"] >= 0 else ""
    uncertain = f" ± {text.error(row['uncertainty'])}" if row["uncertainty"] else ""
    return [
        row["status"],
        f"{symbol(row['status'])} {row['status']}",
        shade(row["ratio"]),
        text.ratio(row["ratio"]),
        panel.engines[row["engine"]].name,
        text.short_variant(row["variant"]),
        f"{row['quantity'] or text.NOTHING}{unit}{step}",
        text.number(row["value"]),
        text.number(row["expected"]) + uncertain,
        text.error(row["abs_error"]),
        text.error(row["rel_error"]),
        text.error(row["tolerance"]) if row["truth"] else text.NOTHING,
        row["truth"] or text.NOTHING,
        row["note"],
    ]
