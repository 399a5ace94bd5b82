"""What a benchmark prints at its end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from ninedisk.harness.api.text import printable
from ninedisk.harness.cli.cli_tables import console, table
from ninedisk.harness.results.tables import Row

MAX_REASON = 200


def show(rows: Sequence[Row], paths: Sequence[Path]) -> None:
    """Print a line for each row: median, spread, ratio to the base; then why others have no time, and the files."""
    out = console()
    suites = list(dict.fromkeys(row["suite"] for row in rows))
    for suite in suites:
        chosen = [row for row in rows if row["suite"] == suite]
        solver, flow = suite == "cd", suite == "flow"
        numbers = ("median", "spread", "ratio", "rate", "iterations", "residual", "gap")
        right = (*numbers, "with start-up", "bytes/disk", "penetration", "deepest")
        extra = ("start", "to", "iterations", "residual", "gap") if solver else ("threads", "disks", "steps")
        more = (
            ()
            if solver
            else ("penetration", "deepest", "residual", "gap")
            if flow
            else ("with start-up", "processors", "bytes/disk")
        )
        shown = table("problem", "engine", *extra, "status", "median", "spread", "ratio", "rate", *more, right=right)
        for row in chosen:
            shown.add_row(*(printable(text) for text in _cells(row, solver)))
        out.print(f"suite {suite}: {_legend(chosen)}")
        out.print(shown)
    for row in rows:
        if row["status"] != "pass":
            place = ", ".join(text for text in (row["problem"], row["start"], _target(row)) if text)
            out.print(printable(f"{row['status']}: {row['engine']} on {place}: {row['reason'][:MAX_REASON]}"))
    for path in paths:
        out.print(f"written: {path}")


def _legend(rows: Sequence[Row]) -> str:
    bases = sorted({row["base"] for row in rows if row["base"]})
    named = " or ".join(bases) or "nothing"
    return f"medians with smallest and largest; ratio = time over that of {named}, repeat by repeat"


def _cells(row: Row, solver: bool) -> list[str]:
    if solver:
        extra = [
            row["start"],
            _target(row),
            str(row["iterations"]) if row["iterations"] >= 0 else "-",
            _number(row["natural_map"]),
            _number(row["duality_gap"]),
        ]
    else:
        extra = [str(row[name]) if row[name] >= 0 else "-" for name in ("threads", "disks", "steps")]
    spread = "-"
    if math.isfinite(row["median_s"]):
        spread = f"{_seconds(row['low_s'])} .. {_seconds(row['high_s'])}"
    rate = f"{row['rate']:.3g} {row['rate_unit']}" if math.isfinite(row["rate"]) else "-"
    more = [] if solver else [_seconds(row["whole_s"]), _seconds(row["cpu_s"]), _number(row["bytes_per_disk"])]
    if row["suite"] == "flow":
        more = [_number(row[name]) for name in ("penetration", "deepest", "natural_map", "duality_gap")]
    return [
        row["problem"], row["engine"], *extra, row["status"], _seconds(row["median_s"]), spread, _number(row["ratio"]), rate,
        *more,
    ]  # fmt: skip


def _target(row: Row) -> str:
    return f"{row['tolerance']:g}" if math.isfinite(row["tolerance"]) else ""


def _seconds(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    unit, factor = next(
        ((unit, factor) for unit, factor in (("s", 1.0), ("ms", 1e3)) if value * factor >= 1.0), ("us", 1e6)
    )
    return f"{value * factor:.3g} {unit}"


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"
