"""Every check and timing of a store over its runs, with what changed and when."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ninedisk.harness.results.compare import EVERY, Side, compare
from ninedisk.harness.results.error_rules import ERROR_RULE, error_of
from ninedisk.harness.results.marks import SHIFT_RULE, cell_shifts, error_shifts, timing_shifts
from ninedisk.harness.results.reader import CellKey
from ninedisk.harness.results.schema import Comparison, Line, Point, Row, StoreHistory, row_tolerance
from ninedisk.harness.results.store import BROKEN, HEADLINE, Snapshot
from ninedisk.harness.results.timing_rules import MANY, timing

AROUND = 10
"""Runs on each side of a mark that give the timings of the comparison around it."""

LineKey = tuple[str, str, int, str, str, str, str, int]
"""Kind, case, case version, variant, engine, quantity, kind of truth, number of the check: one line on a machine."""


def history(runs: Sequence[Snapshot], progress: Callable[[int, int], None] | None = None) -> StoreHistory:
    """Lines and marks of runs in their order in time, and the comparisons around the marks.

    Runs on different machines, and of different versions of a case, give different lines.
    """
    by_machine: dict[str, list[int]] = {}
    for number, run in enumerate(runs):
        by_machine.setdefault(run.facts.machine, []).append(number)
    lines: list[Line] = []
    for done, (machine, numbers) in enumerate(by_machine.items()):
        if progress is not None:
            progress(done, len(by_machine))
        lines += _lines_of_machine(machine, [(number, runs[number]) for number in numbers])
    n_timings = sum(line.kind == "timing" for line in lines)
    marked = [line for line in _marked(lines, n_timings) if line.points]
    return StoreHistory(
        runs=tuple(run.facts for run in runs),
        lines=tuple(marked),
        comparisons=_comparisons(runs, by_machine, marked),
        rules=(ERROR_RULE, SHIFT_RULE),
    )


def _lines_of_machine(machine: str, runs: Sequence[tuple[int, Snapshot]]) -> Iterator[Line]:
    """All lines of one machine, yet without marks."""
    points: dict[LineKey, list[Point]] = {}
    first: dict[LineKey, tuple[str, str]] = {}  # engine's name and unit, newest
    for number, run in runs:
        for key, cell in run.cells.items():
            for line, point, unit in _points(number, key, cell, run):
                points.setdefault(line, []).append(point)
                first[line] = (str(cell["engine_name"] or cell["engine"]), unit)
    for line, held in points.items():
        kind, case, version, variant, engine, quantity, truth, _ = line
        if kind == "cell" and not any(point.status in BROKEN for point in held):
            continue
        name, unit = first[line]
        yield Line(kind=kind, case=case, case_version=version, variant=variant, engine=engine, engine_name=name,
                   machine=machine, quantity=quantity, unit=unit, truth=truth, points=tuple(held), shifts=())  # fmt: skip


def _points(number: int, key: CellKey, cell: Row, run: Snapshot) -> Iterator[tuple[LineKey, Point, str]]:
    case, variant, engine = key
    version, status = int(cell["case_version"]), str(cell["status"])
    own = str(cell["engine_version"])
    nan = math.nan
    yield (
        ("cell", case, version, variant, engine, "", "", 0),
        Point(number, nan, nan, status, own, str(cell["reason"])),
        "",
    )
    for (quantity, norm, truth, k), row in run.checks.get(key, {}).items():
        error = error_of(row)
        if not math.isnan(error):
            shown = Point(number, error, row_tolerance(row), str(row["status"]), own, str(row["reason"]))
            kind = "headline" if truth == HEADLINE else "error"
            against = "" if truth == HEADLINE else f"{truth}, {norm}" if norm == "max" else truth
            yield (kind, case, version, variant, engine, quantity, against, k), shown, str(row["unit"])
    of, seconds = timing(cell)
    if math.isfinite(seconds) and seconds > 0.0:
        yield ("timing", case, version, variant, engine, of, "", 0), Point(number, seconds, nan, status, own), "s"


def _marked(lines: Sequence[Line], n_timings: int) -> Iterator[Line]:
    """Lines with their marks, and for each machine a line of what all its timings share."""
    shared: dict[str, dict[int, float]] = {}
    for machine in dict.fromkeys(line.machine for line in lines):
        shared[machine] = _shared([line for line in lines if line.kind == "timing" and line.machine == machine])
    for machine, factors in shared.items():
        if any(factors.values()):
            logs = np.array(list(factors.values()))
            yield Line(kind="timing", case=EVERY, case_version=0, variant="", engine="", engine_name="every engine",
                       machine=machine, quantity="speed of the whole run", unit="1", truth="",
                       points=tuple(Point(k, math.exp(log), math.nan, "", "") for k, log in factors.items()),
                       shifts=timing_shifts(logs, n_timings + len(shared), drifts=True))  # fmt: skip
    for line in lines:
        if line.kind in ("error", "headline"):
            shifts = error_shifts(line.points)
        elif line.kind == "cell":
            shifts = cell_shifts(line.points, BROKEN)
        else:
            factors = shared[line.machine]
            line = replace(line, points=tuple(replace(p, shared=math.exp(factors[p.run])) for p in line.points))
            logs = np.log([point.value / point.shared for point in line.points])
            shifts = timing_shifts(logs, n_timings + len(shared))
        yield replace(line, shifts=shifts)


def _shared(timings: Sequence[Line]) -> dict[int, float]:
    """By run, the logarithm of what all timings share: the median distance of each from its own median.

    Runs with too few timings to decide what they share from what one of them does are left alone.
    """
    apart: dict[int, list[float]] = {}
    for line in timings:
        logs = np.log([point.value for point in line.points])
        for point, log in zip(line.points, logs - np.median(logs), strict=True):
            apart.setdefault(point.run, []).append(float(log))
    return {run: float(np.median(each)) if len(each) >= MANY else 0.0 for run, each in sorted(apart.items())}


def _comparisons(
    runs: Sequence[Snapshot], by_machine: dict[str, list[int]], lines: Sequence[Line]
) -> dict[tuple[int, int], Comparison]:
    """The comparison of the two runs around each mark, with their neighbours for the timings."""
    wanted = {(line.machine, line.points[s.at - 1].run, line.points[s.at].run) for line in lines for s in line.shifts}
    found = {}
    for machine, before, after in sorted(wanted):
        numbers = by_machine[machine]
        old = [runs[k] for k in numbers if k <= before][-AROUND:]
        new = [runs[k] for k in numbers if k >= after][:AROUND]
        found[before, after] = compare(Side(runs[before], tuple(old)), Side(runs[after], tuple(new)))
    return found
