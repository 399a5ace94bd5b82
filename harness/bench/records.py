"""The record of a benchmark run: one JSON file with its provenance and one Parquet file with the same rows.

What a benchmark prints at its end.
"""

from __future__ import annotations

import json
import math
import os
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.api.text import one_line
from ninedisk.harness.results.schema import Row
from ninedisk.harness.results.statuses import VERDICTS
from ninedisk.harness.results.tables import complete
from ninedisk.harness.terminal import console, table

BENCH_VERSION = 7

COLUMNS: dict[str, str] = {
    "suite": "string",  # dem | spheres | cd | coulomb | coulomb3d | flow | harness
    "problem": "string",
    "engine": "string",
    "engine_version": "string",
    "threads": "int64",
    "disks": "int64",
    "contacts": "int64",  # suite dem: mean over the run, walls included
    "listed_pairs": "int64",  # in the neighbour lists, mean over the run, walls included
    "rebuilds": "int64",  # of the neighbour lists in the whole run
    "steps": "int64",
    "start": "string",  # cold | warm; suite coulomb: the rule, coulomb | associated
    "tolerance": "float64",  # target of a solver, NaN elsewhere
    "status": "string",  # of STATUSES
    "reason": "string",
    "check": "string",  # what was checked before anything was timed
    "check_value": "float64",
    "check_bound": "float64",
    "repeats": "int64",
    "median_s": "float64",  # wall-clock seconds of the same work; NaN unless the check passed
    "low_s": "float64",
    "high_s": "float64",
    "ratio": "float64",  # median over the repeats of seconds / seconds of the base engine in the same repeat
    "base": "string",  # engine that the ratio refers to
    "rate": "float64",
    "rate_unit": "string",
    "whole_s": "float64",  # median with start-up, set-up and transport
    "cpu_s": "float64",  # median of the processor seconds of all processes: what a busy machine changes least
    "bytes_per_disk": "float64",  # arrays that a run holds (in-house engine)
    "resident_per_disk": "float64",  # growth of the process' resident memory
    "iterations": "int64",
    "natural_map": "float64",
    "duality_gap": "float64",
    "objective_error": "float64",  # relative to the best solution known
    "penetration": "float64",  # overlaps over the sum of radii, summed over the contacts, per disk, mean of the samples
    "deepest": "float64",  # largest overlap over the sum of radii
    "energy_gained": "float64",  # largest growth from sample to sample beyond the walls' work, over the largest kinetic energy
    "missed": "int64",  # suite flow: steps of contact dynamics that missed their tolerance and were accepted
    "worst_missed": "float64",  # larger one of natural map and duality gap of the worst of them
    "equal_ratio": "float64",  # suite flow: time over that of ours at the same penetration
    "friction_error": "float64",  # suite flow: friction off Coulomb's law over what it could bear, watched contacts, all steps
    "equal_friction_ratio": "float64",  # suite flow: time over that of ours at the same friction_error
    "settings": "string",  # JSON object; suite flow, under "steps that missed the tolerance": each with its error
    "samples_s": "string",  # JSON list: seconds of every repeat
}
"""One row per problem, engine, number of threads, start and tolerance."""

STATUSES = tuple(VERDICTS["bench"])


def new_row(**known: Any) -> Row:
    """A row with every column; KeyError for an unknown one, ValueError for an unknown status."""
    row = complete(known, COLUMNS)
    if row["status"] not in STATUSES:
        raise ValueError(f"status = {row['status']!r} is not one of {', '.join(STATUSES)}")
    return row


def prepare_folder(folder: Path) -> None:
    """Make sure that the record can be written, before hours are spent on it.

    Raises
    ------
    UsageError
        If the folder cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:  # a name may hold a zero byte
        why = getattr(error, "strerror", None) or error
        raise UsageError(f"--out {str(folder)!r} cannot be written ({why}): give another folder") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"--out {str(folder)!r} cannot be written: give another folder")


def write_records(folder: Path, run_id: str, facts: Mapping[str, Any], rows: Sequence[Row]) -> tuple[Path, Path]:
    """Write ``<run_id>.json`` and ``<run_id>.parquet``; each appears whole or not at all.

    Raises
    ------
    StoreError
        If one cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64()}
    schema = pa.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
    table = pa.Table.from_pylist([dict(row) for row in rows], schema=schema)
    plain = [{key: _plain_value(value) for key, value in row.items()} for row in rows]
    record = {"bench_version": BENCH_VERSION, "run_id": run_id, **facts, "rows": plain}
    paths = folder / f"{run_id}.json", folder / f"{run_id}.parquet"
    try:
        for path in paths:
            half = path.with_name(f".tmp-{path.name}")
            if path.suffix == ".json":
                half.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
            else:
                with half.open("wb") as stream:  # Arrow takes no path that is not UTF-8
                    pq.write_table(table, stream, compression="zstd")
            half.replace(path)
    except OSError as error:
        raise StoreError(f"the record {str(paths[0])!r} cannot be written ({error.strerror or error})") from error
    return paths


def _plain_value(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


MAX_REASON = 200
RACES, TIMED = ("coulomb", "coulomb3d"), 1e-6
"""Suites of many contact problems, and the target whose times are printed."""


def print_rows(rows: Sequence[Row], paths: Sequence[Path]) -> None:
    """Print a line for each row: median, spread, ratio to the base; then why others have no time, and the files."""
    out = console()
    for suite in RACES:
        if raced := [row for row in rows if row["suite"] == suite]:
            _show_race(raced, suite)
    rows = [row for row in rows if row["suite"] not in RACES]
    suites = list(dict.fromkeys(row["suite"] for row in rows))
    for suite in suites:
        chosen = [row for row in rows if row["suite"] == suite]
        solver, flow = suite == "cd", suite == "flow"
        numbers = ("median", "spread", "ratio", "rate", "iterations", "residual", "gap")
        of_flow = (
            "penetration",
            "deepest",
            "residual",
            "gap",
            "missed",
            "energy gained",
            "ratio at equal penetration",
            "friction error",
            "ratio at equal friction error",
        )
        right = (*numbers, "with start-up", "bytes/disk", *of_flow)
        extra = ("start", "to", "iterations", "residual", "gap") if solver else ("threads", "disks", "steps")
        more = () if solver else of_flow if flow else ("with start-up", "processors", "bytes/disk")
        shown = table("problem", "engine", *extra, "status", "median", "spread", "ratio", "rate", *more, right=right)
        for row in chosen:
            shown.add_row(*(one_line(text) for text in _cells(row, solver)))
        out.print(f"suite {suite}: {_legend(chosen)}")
        out.print(shown)
    for row in rows:
        if row["status"] != "pass":
            place = ", ".join(text for text in (row["problem"], row["start"], _target(row)) if text)
            out.print(one_line(f"{row['status']}: {row['engine']} on {place}: {row['reason'][:MAX_REASON]}"))
    for path in paths:
        out.print(f"written: {path}")


def _show_race(rows: Sequence[Row], suite: str) -> None:
    """Print how many problems each solver solves to each tolerance, and its median time; there are too many rows to print."""
    out = console()
    targets = sorted({row["tolerance"] for row in rows}, reverse=True)
    names = [f"{target:g}" for target in targets]
    median = f"median s to {TIMED:g}"
    shown = table("rule", "solver", *names, median, "problems", right=(*names, median, "problems"))
    for rule, engine in dict.fromkeys((row["start"], row["engine"]) for row in rows):
        own = [row for row in rows if (row["start"], row["engine"]) == (rule, engine)]
        count = len({row["problem"] for row in own})
        solved = [sum(row["status"] == "pass" for row in own if row["tolerance"] == target) for target in targets]
        timed = [row for row in own if row["tolerance"] == TIMED]
        times = [row["median_s"] if row["status"] == "pass" else math.inf for row in timed]
        middle = statistics.median(times) if times else math.inf
        shares = (f"{100.0 * each / count:.1f} %" for each in solved)
        shown.add_row(rule, engine, *shares, _seconds(middle) if math.isfinite(middle) else "-", str(count))
    out.print(
        f"suite {suite}: share of the problems solved, by the largest error of an independent judge; unsolved ones count in medians"
    )
    out.print(shown)
    absent = dict.fromkeys(row["reason"] for row in rows if row["status"] == "not-installed")
    for reason in absent:
        out.print(one_line(reason[:MAX_REASON]))


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
        more += [
            str(row["missed"]) if row["missed"] >= 0 else "-",
            _number(row["energy_gained"]),
            *(_number(row[name]) for name in ("equal_ratio", "friction_error", "equal_friction_ratio")),
        ]
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
