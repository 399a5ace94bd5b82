"""What a run prints at its end: worst first, counts by status, where the results are."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path

from ninedisk.harness.cli_tables import console, table
from ninedisk.harness.records import WORST_FIRST, row_tolerance
from ninedisk.harness.results import CaseResult, Row

MAX_ROWS = 40
MAX_REASONS = 8
_NOT_RUN = ("unsupported", "not-installed")


def show_summary(results: Sequence[CaseResult], folder: Path | None) -> None:
    """Print the table, the reasons of what went wrong, the counts, and the run's folder."""
    out = console()
    rows = [row for result in results for row in result.rows]
    judged = sorted((row for row in rows if row["status"] not in _NOT_RUN), key=_worst_first)
    if judged:
        shown = table(
            "status",
            "case",
            "variant",
            "engine",
            "quantity",
            "error",
            "tolerance",
            "truth",
            right=("error", "tolerance"),
        )
        for row in judged[:MAX_ROWS]:
            shown.add_row(
                row["status"], row["case"], row["variant"], row["engine"], row["quantity"] or "-",
                _number(row["abs_error"]), _number(row_tolerance(row) if row["quantity"] else math.nan), row["truth"] or "-",
            )  # fmt: skip
        out.print(shown)
    if len(judged) > MAX_ROWS:
        rest = Counter(row["status"] for row in judged[MAX_ROWS:])
        out.print(f"... and {len(judged) - MAX_ROWS} more: {_counts(rest)}")
    for line in _reasons(judged):
        out.print(line)
    for line in _not_run(results):
        out.print(line)
    out.print(f"cells: {_counts(Counter(result.status for result in results))}")
    out.print(f"checks: {_counts(Counter(row['status'] for row in judged))}")
    if folder is not None:
        out.print(f"results: {folder}")


def _worst_first(row: Row) -> tuple[int, float]:
    allowed, error = row_tolerance(row), row["abs_error"]
    ratio = error / allowed if allowed > 0.0 else error
    return WORST_FIRST.index(row["status"]), -(math.inf if math.isnan(ratio) else ratio)


def _reasons(judged: Sequence[Row]) -> list[str]:
    bad = [row for row in judged if row["status"] in ("error", "timeout", "fail", "gap-closed")]
    lines = []
    for row in bad[:MAX_REASONS]:
        quantity = f" {row['quantity']}" if row["quantity"] else ""
        lines.append(f"{row['status']}: {row['case']} [{row['variant']}] {row['engine']}{quantity}: {row['reason']}")
    if len(bad) > MAX_REASONS:
        lines.append(f"... and {len(bad) - MAX_REASONS} more, with their reasons, in the stored results")
    return lines


def _not_run(results: Sequence[CaseResult]) -> list[str]:
    cells: dict[tuple[str, str, str], int] = defaultdict(int)
    for result in results:
        if result.status in _NOT_RUN:
            cells[result.status, str(result.cell["engine"]), result.reason] += 1
    return [
        f"{status}: {engine}, {count} cell{'s' if count > 1 else ''}: {reason}"
        for (status, engine, reason), count in sorted(cells.items())
    ]


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{counter[status]} {status}" for status in WORST_FIRST if counter[status]) or "none"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"
