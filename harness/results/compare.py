"""Two runs, or two groups of runs, side by side: what got worse, what got better, what cannot be compared."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ninedisk.harness.results.rules import ERROR_RULE, error_of, judge_errors
from ninedisk.harness.results.schema import CHANGE_VERDICTS, Change, Comparison, row_tolerance
from ninedisk.harness.results.snapshot import BROKEN, NOT_RUN, CellKey, CheckKey, Snapshot
from ninedisk.harness.results.tables import Row
from ninedisk.harness.results.timing_rule import LEAST, TIMING_RULE, judge_timings

NAN = float("nan")
TIMINGS = {"advance_s": "stepping", "setup_s": "set-up"}
"""Timings that are compared. Warm-up is not: it depends on whether compiled code was already in a cache."""

EVERY = "all timings"
"""Stands where a case's id stands, for what all timings share."""


@dataclass(frozen=True)
class Side:
    """Runs on one side: ``decisive`` is the one whose errors count, ``sample`` (with it) gives the timings."""

    decisive: Snapshot
    sample: tuple[Snapshot, ...]


def side(runs: Sequence[Snapshot]) -> Side:
    """A side of runs in their order in time: the newest decides."""
    return Side(runs[-1], tuple(runs))


def compare(base: Side, head: Side) -> Comparison:
    """Compare every cell, check and timing of two sides."""
    found = list(_cells(base.decisive, head.decisive))
    different = {(c.case, c.variant, c.engine) for c in found if c.verdict == "not-comparable"}
    found += _errors(base.decisive, head.decisive, different)
    found += _timings(base, head, different)
    return Comparison(
        base=base.decisive.facts,
        head=head.decisive.facts,
        base_runs=len(base.sample),
        head_runs=len(head.sample),
        changes=tuple(sorted(found, key=attention)),
        rules=(ERROR_RULE, TIMING_RULE),
    )


def attention(change: Change) -> tuple[Any, ...]:
    """Sort key: what wants attention first; broken cells before failed checks before larger factors."""
    kind = ("cell", "error", "timing").index(change.kind)
    fails = change.head_status != "fail"
    return CHANGE_VERDICTS.index(change.verdict), kind, fails, -growth(change), change.case, change.variant


def growth(change: Change) -> float:
    """Factor between base and head, above 1 in the direction of the change; 1 without numbers."""
    base, head = change.base, change.head
    if math.isnan(base) or math.isnan(head) or base == head:
        return 1.0
    small, large = sorted((base, head))
    return large / small if small > 0.0 else math.inf


def counts(comparison: Comparison) -> dict[str, int]:
    """How many changes have each verdict, in the order of `records.CHANGE_VERDICTS`."""
    found = Counter(change.verdict for change in comparison.changes)
    return {verdict: found[verdict] for verdict in CHANGE_VERDICTS}


def _change(row: Row, **what: Any) -> Change:
    common = {"kind": "cell", "quantity": "", "unit": "", "truth": "", "base": NAN, "head": NAN, "tolerance": NAN}
    place = {name: row[name] for name in ("case", "case_version", "variant", "engine")}
    return Change(**{**common, **place, **what})


def _cells(base: Snapshot, head: Snapshot) -> Iterator[Change]:
    for key in {**base.cells, **head.cells}:
        before, after = base.cells.get(key), head.cells.get(key)
        if before is None:
            yield _change(head.cells[key], verdict="new", base_status="", head_status=head.cells[key]["status"],
                          reason="not in BASE")  # fmt: skip
            continue
        if after is None:
            yield _change(before, verdict="lost", base_status=before["status"], head_status="", reason="not in HEAD")
            continue
        verdict, reason = _judge_cell(before, after)
        statuses = {"base_status": before["status"], "head_status": after["status"]}
        if verdict != "same" or not _ran(after):
            yield _change(after, verdict=verdict, reason=reason, **statuses)


def _judge_cell(before: Row, after: Row) -> tuple[str, str]:
    if before["case_version"] != after["case_version"]:
        versions = f"version {before['case_version']} in BASE, {after['case_version']} in HEAD"
        return "not-comparable", f"not comparable: the case has {versions}"
    if after["status"] in BROKEN:
        return ("same" if before["status"] in BROKEN else "worse"), str(after["reason"])
    if before["status"] in BROKEN:
        return ("better", "it runs again") if _ran(after) else ("lost", str(after["reason"]))
    if _ran(before) and not _ran(after):
        return "lost", str(after["reason"])
    return ("new", "it did not run in BASE") if _ran(after) and not _ran(before) else ("same", "")


def _ran(cell: Row) -> bool:
    return cell["status"] not in BROKEN | NOT_RUN


def _shared(base: Snapshot, head: Snapshot, different: set[CellKey]) -> list[CellKey]:
    """Cells that ran on both sides in the same version."""
    return [
        key
        for key, cell in head.cells.items()
        if key in base.cells and key not in different and _ran(cell) and _ran(base.cells[key])
    ]


def _errors(base: Snapshot, head: Snapshot, different: set[CellKey]) -> Iterator[Change]:
    for key in _shared(base, head, different):
        before, after = base.checks.get(key, {}), head.checks.get(key, {})
        for check in {**before, **after}:
            if check not in before:
                yield _one_sided(after[check], check, "new", "no such check in BASE")
            elif check not in after:
                yield _one_sided(before[check], check, "lost", "no such check in HEAD")
            else:
                yield _error(before[check], after[check], check)


def _error(before: Row, after: Row, check: CheckKey) -> Change:
    verdict, reason = judge_errors(before, after)
    return _change(
        after,
        kind="error",
        verdict=verdict,
        reason=reason,
        quantity=check[0],
        unit=after["unit"],
        truth=check[2],
        base=error_of(before),
        head=error_of(after),
        tolerance=row_tolerance(after),
        base_status=before["status"],
        head_status=after["status"],
    )


def _one_sided(row: Row, check: CheckKey, verdict: str, reason: str) -> Change:
    new = verdict == "new"
    return _change(
        row,
        kind="error",
        verdict=verdict,
        reason=reason,
        quantity=check[0],
        unit=row["unit"],
        truth=check[2],
        tolerance=row_tolerance(row),
        base=NAN if new else error_of(row),
        head=error_of(row) if new else NAN,
        base_status="" if new else row["status"],
        head_status=row["status"] if new else "",
    )


def _timings(base: Side, head: Side, different: set[CellKey]) -> Iterator[Change]:
    machines = [each.decisive.facts.machine for each in (base, head)]
    apart = machines[0] != machines[1]
    samples = {}
    for key in _shared(base.decisive, head.decisive, different):
        version = head.decisive.cells[key]["case_version"]
        for name in TIMINGS:
            pair = tuple(seconds(each, key, name, version) for each in (base, head))
            if all(pair):
                samples[key, name] = pair
    if not samples:
        return
    if apart:
        words = f"not comparable: timings of {machines[0]} and of {machines[1]}"
        yield _every("not-comparable", NAN, NAN, words)
        return
    found, common = judge_timings({key: (pair[0], pair[1]) for key, pair in samples.items()})
    for (key, name), judged in found.items():
        row = head.decisive.cells[key]
        yield _change(row, kind="timing", quantity=TIMINGS[name], unit="s", base=judged.base, head=judged.head,
                      verdict=judged.verdict, reason=judged.reason, base_status=base.decisive.cells[key]["status"],
                      head_status=row["status"])  # fmt: skip
    if abs(math.log(common)) >= LEAST:
        reason = (
            "all timings moved together: the machine, or something that every engine uses; taken out of each timing"
        )
        yield _every("suspect" if common > 1.0 else "same", 1.0, common, reason)


def seconds(one: Side, key: CellKey, name: str, version: int) -> list[float]:
    """A timing [s] in the runs of a side that have the cell in this version, on the machine of its decisive run."""
    held = []
    for run in one.sample:
        cell = run.cells.get(key)
        if cell is not None and cell["case_version"] == version and run.facts.machine == one.decisive.facts.machine:
            value = float(cell[name])
            if math.isfinite(value) and value > 0.0:
                held.append(value)
    return held


def _every(verdict: str, before: float, after: float, reason: str) -> Change:
    nowhere = {"case": EVERY, "case_version": 0, "variant": "", "engine": ""}
    return _change(nowhere, kind="timing", verdict=verdict, base=before, head=after, unit="1", reason=reason,
                   base_status="", head_status="")  # fmt: skip
