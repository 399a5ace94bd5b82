"""Whether findings still hold: each is held against the newest results of a store, and against those before.

A finding's size is read anew from the stored rows: nothing of it is remembered anywhere else. It is

- ``larger`` where it exceeds what the check that measures it explains (its known difference, else its tolerance), or has grown since the
  run before by more than `GROWN`;
- ``gone`` where it no longer exceeds ``Size.over``, or has the other sign than ``Size.sign``;
- ``there`` otherwise;
- ``not-measured`` where the store has no number for it, with the reason.

A difference that a check allows for (`KnownDifference.finding`) and no finding describes is evaluated all the same, from the rows that name
it: those of engines that are known by their command alone are of this kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from ninedisk.harness.api.finding import Finding, Size, sign_of
from ninedisk.harness.results.reader import (
    CellKey,
    cell_key,
    read_about,
    read_determinism,
    read_rows,
    run_ids,
    run_time,
)
from ninedisk.harness.results.schema import FINDING_VERDICTS, EvaluatedFinding, Row, row_tolerance

Progress = Callable[[int, int, str], None]

GROWN = 1.1
"""Growth since the run before that counts: other compilers and processors move a size by round-off, which all of them exceed by far;
what is left are runs whose round-off grows, as the gas's does over its collisions."""

ROUND_OFF = 1e-9
"""Relative difference of stored numbers that say the same: each is rounded once or twice, to 1e-16."""

_EXPLAINED = frozenset({"known-gap", "gap-closed"})
"""Statuses of checks whose truth is known to be off: their tolerance explains nothing."""

_NOT_RUN = frozenset({"unsupported", "not-installed"})
_BROKEN = frozenset({"error", "timeout"})

CELLS = ("case", "case_version", "variant", "engine", "engine_version", "support", "status", "reason", "penetration")
MEASUREMENTS = (
    "case", "variant", "engine", "quantity", "unit", "truth", "value", "expected", "abs_error", "rel_error", "scale", "atol", "rtol",
    "status", "reason", "finding", "known_size",
)  # fmt: skip
HEADLINES = (
    "case", "variant", "engine", "headline", "quantity", "unit", "value", "expected", "scale", "scale_is", "rel_error",
)  # fmt: skip


@dataclass(frozen=True)
class Kept:
    """A cell of a run, and those of its rows that findings read."""

    run_id: str
    cell: Row
    measurements: list[Row] = field(default_factory=list)
    headlines: list[Row] = field(default_factory=list)


@dataclass(frozen=True)
class Reading:
    """What a cell says of a size: a number, or the reason why there is none."""

    size: float
    row: Row
    reason: str = ""


def evaluate(
    store: Path, findings: Sequence[Finding], progress: Progress | None = None, *, engine: str | None = None
) -> list[EvaluatedFinding]:
    """Hold findings against a store: largest first, those without a number at the end.

    Parameters
    ----------
    store : Path
    findings : sequence of Finding
    progress : callable, optional
        Called with the number of runs that are read, how many there are, and what is done.
    engine : str, optional
        Id of an engine that is looked at in place of each finding's own: does it show the same? Of declared differences its own.

    Raises
    ------
    StoreError
        If a run of the store cannot be read.
    """
    cells = _cells(store, findings, progress)
    found = [_evaluated(each, engine or each.engine, cells) for each in findings]
    declared = _declared({each.id for each in findings}, cells)
    found += [each for each in declared if engine in (None, each.engine)]
    return sorted(
        found, key=lambda each: (math.isnan(each.size), -each.size if each.size == each.size else 0.0, each.id)
    )


def exit_code(found: Iterable[EvaluatedFinding]) -> int:
    """0: the list of findings agrees with the store; 1: something is gone or larger."""
    return int(any(each.verdict in FINDING_VERDICTS[:2] for each in found))


def _cells(store: Path, findings: Sequence[Finding], progress: Progress | None) -> dict[CellKey, list[Kept]]:
    """The newest two of each cell, the newest first, as far as findings ask for them or rows name a difference."""
    abouts = sorted(
        (read_about(store, run_id) for run_id in run_ids(store)),
        key=lambda about: run_time(str(about["started"])),
        reverse=True,
    )
    asked = {(each.size.case, name) for each in findings for name in (each.size.quantity, each.size.per) if name}
    kept: dict[CellKey, list[Kept]] = {}
    for done, about in enumerate(abouts):
        if progress is not None:
            progress(done, len(abouts), "reading runs")
        fresh: dict[CellKey, Kept] = {}
        for cell in read_rows(store, about, "cells", CELLS):
            held = kept.setdefault(cell_key(cell), [])
            if len(held) < 2 and (not held or held[0].cell["case_version"] == cell["case_version"]):
                held.append(fresh.setdefault(cell_key(cell), Kept(str(about["run_id"]), cell)))
        if not fresh:
            continue
        for row in read_rows(store, about, "measurements", MEASUREMENTS):
            if cell_key(row) in fresh and ((row["case"], row["quantity"]) in asked or row["finding"]):
                fresh[cell_key(row)].measurements.append(row)
        for row in read_rows(store, about, "headlines", HEADLINES):
            if cell_key(row) in fresh and (row["case"], row["headline"]) in asked:
                fresh[cell_key(row)].headlines.append(row)
    for row in read_determinism(store):
        status = {"not applicable": "unsupported", "broken": "error"}.get(row["verdict"], "pass")
        variant = f"spheres/{row['kind']}" if row["scene"] == "spheres" else row["kind"]
        kept["determinism", variant, row["engine"]] = [Kept("", {**row, "variant": variant, "status": status})]
    return kept


def _evaluated(finding: Finding, engine: str, cells: Mapping[CellKey, Sequence[Kept]]) -> EvaluatedFinding:
    size = finding.size
    blank = EvaluatedFinding(
        id=finding.id, engine=engine, versions=finding.versions, what=finding.what, documented=finding.documented,
        thread=finding.thread, command=finding.command, verdict="not-measured", over=size.over, over_why=size.over_why,
        case=size.case, variant=size.variant, quantity=size.quantity or size.column, truth=size.truth,
    )  # fmt: skip
    mine = _matching(cells, size, engine)
    if not mine:
        known = {case for case, _, _ in cells}, {name for _, _, name in cells}
        lacks = (
            "finished run"
            if not cells
            else f"case {size.case!r}"
            if size.case not in known[0]
            else f"engine {engine!r}"
            if engine not in known[1]
            else "such cell"
        )
        return replace(blank, reason=f"the store has no {lacks}")
    readings = [(reading, held) for held in mine for reading in _readings(size, held[0])]
    numbers = [each for each in readings if not each[0].reason]
    if not numbers:
        return replace(blank, engine_version=str(mine[0][0].cell["engine_version"]), reason=readings[0][0].reason)
    same = [each for each in numbers if _sign_matches(size, each[0])]
    largest, held = max(same or numbers, key=lambda each: each[0].size)
    row, before = largest.row, [each for each in _readings(size, held[1]) if not each.reason] if len(held) > 1 else []
    least = min(
        (
            (max(sizes), name)
            for name in {key[2] for key in cells} - {engine}
            if (
                sizes := [
                    r.size for kept in _matching(cells, size, name) for r in _readings(size, kept[0]) if not r.reason
                ]
            )
        ),
        default=(math.nan, ""),
    )
    found = replace(
        blank, size=largest.size, least=least[0], least_engine=least[1],
        before=max((each.size for each in before), default=math.nan), before_run=held[1].run_id if before else "",
        variant=str(held[0].cell["variant"]), truth=str(row.get("truth", "")), unit=str(row.get("unit", "")),
        value=_number(row, "value"), expected=_number(row, "expected"), scale=_number(row, "scale"), **_relative_to(size, row, held[0]),
        engine_version=str(held[0].cell["engine_version"]), run_id=held[0].run_id,
    )  # fmt: skip
    rows = [each.row for each, _ in numbers] if engine == finding.engine and not size.fails else []
    rows += [row for kept in cells.values() for row in kept[0].measurements if row["finding"] == finding.id]
    verdict, reason = _verdict(found, rows)
    if not same and verdict != "larger":
        verdict, reason = "gone", f"the error has the other sign: {found.value:.6g} where {found.expected:.6g} is right"
    if (
        engine == finding.engine
        and not finding.id.startswith("source/")
        and found.engine_version not in finding.versions
    ):
        reason = "; ".join(
            filter(
                None, (reason, f"seen in {finding.versions}, this is {found.engine_version or 'of no known version'}")
            )
        )
    return replace(found, verdict=verdict, reason=reason)


def _sign_matches(size: Size, reading: Reading) -> bool:
    return size.sign in (0, sign_of(_number(reading.row, "value"), _number(reading.row, "expected")))


SIMILAR = 2.0
"""Sizes that differ by no more than this factor are similar: steps and softness of two engines with one cause do that."""


def shows_finding(finding: Finding, seen: EvaluatedFinding, own: float) -> str:
    """Whether another engine shows a finding, in words: ``no``, ``yes``, ``similar size`` or ``other size``.

    ``yes`` needs a finding whose size shows all that its words say (`Finding.cause_tested`). For others the sign is right and the size
    exceeds what a right engine shows, but nobody has tested the cause.

    Parameters
    ----------
    finding : Finding
    seen : EvaluatedFinding
        What the other engine shows.
    own : float
        Size that the finding's own engine has in the store; NaN where there is none.
    """
    if seen.verdict == "gone":
        return "no"
    if finding.cause_tested:
        return "yes"
    return "other size" if max(seen.size, own) > SIMILAR * min(seen.size, own) else "similar size"


def _matching(cells: Mapping[CellKey, Sequence[Kept]], size: Size, engine: str) -> list[Sequence[Kept]]:
    return [
        held
        for (case, variant, name), held in cells.items()
        if case == size.case and name == engine and fnmatchcase(variant, size.variant)
    ]


def _readings(size: Size, kept: Kept) -> list[Reading]:
    """What each matching row of a cell says, or one reading without a number that says why there is none."""
    if size.column == "broken":
        status = str(kept.cell["status"])
        return [_no_number(kept, "") if status in _NOT_RUN else Reading(float(status in _BROKEN), kept.cell)]
    if size.table in ("cells", "determinism"):
        value = _number(kept.cell, size.column)
        return [
            Reading(abs(value), kept.cell) if value == value else _no_number(kept, f"the cell has no {size.column}")
        ]
    if size.table == "headlines":
        rows = [row for row in kept.headlines if row["headline"] == size.quantity]
    else:
        rows = [
            row
            for row in kept.measurements
            if row["quantity"] == size.quantity
            and (row["truth"] == size.truth if size.truth else row["truth"] != "published")
        ]
    found = [_reading(size, row, kept) for row in rows if row.get("status") not in ("no-truth", "not-observed")]
    # One row that was tampered with takes the others' word, too: the largest of them may be what it hides.
    torn = [each for each in found if _contradiction(each.row)]
    return torn or found or [_no_number(kept, f"the cell ran and nothing there measures {size.quantity!r}")]


def _no_number(kept: Kept, otherwise: str) -> Reading:
    status = str(kept.cell["status"])
    ran = status not in _NOT_RUN | _BROKEN
    return Reading(math.nan, kept.cell, otherwise if ran else f"{status}: {kept.cell['reason']}")


def _reading(size: Size, row: Row, kept: Kept) -> Reading:
    if contradiction := _contradiction(row):
        return Reading(math.nan, row, f"{contradiction}: the stored row contradicts itself, run the case again")
    number = abs(_number(row, size.column))
    if size.column in ("abs_error", "value"):
        scale = 1.0 if size.per == "1" else _scale(kept, size.per or size.quantity)
        number = number / scale if scale > 0.0 else math.nan
    return Reading(
        number, row, "" if number == number else f"{size.quantity!r} has no number, or no scale that it is relative to"
    )


def _relative_to(size: Size, row: Row, kept: Kept) -> dict[str, Any]:
    """What a reading is relative to, and what that is called; nothing where the number is relative as it is."""
    if size.table in ("cells", "determinism") or size.per == "1":
        return {}
    name = size.per or size.quantity
    of = _number(row, "scale") if size.column == "rel_error" else _scale(kept, name)
    return {"of": of, "per": str(row.get("scale_is") or f"largest {name}")}


def _scale(kept: Kept, quantity: str) -> float:
    """Largest ``|expected|`` of a quantity, over its truths; 0 where there is none."""
    scales = (_number(row, "scale") for row in kept.measurements if row["quantity"] == quantity)
    return max((each for each in scales if math.isfinite(each)), default=0.0)


def _contradiction(row: Row) -> str:
    """What is wrong with a row that does not hold together: value, truth and errors say the same thing thrice."""
    value, expected, scale = (_number(row, name) for name in ("value", "expected", "scale"))
    relative = _number(row, "rel_error")
    error = _number(row, "abs_error") if "abs_error" in row else relative * scale
    if all(map(math.isfinite, (value, expected, error))):
        away = abs(abs(value - expected) - error)
        if away > ROUND_OFF * max(abs(value - expected), error) + 4e-16 * max(abs(value), abs(expected)):
            return f"value {value:g} against {expected:g} is no error of {error:g}"
    if all(map(math.isfinite, (error, relative, scale))) and abs(relative * scale - error) > ROUND_OFF * max(
        error, relative * scale
    ):
        return f"an error of {error:g} on a scale of {scale:g} is no relative error of {relative:g}"
    return ""


def _number(row: Row, name: str) -> float:
    value = row.get(name)
    return math.nan if value is None else float(value)


def _verdict(found: EvaluatedFinding, rows: Iterable[Row]) -> tuple[str, str]:
    beyond = max((row for row in rows if _unexplained(row) > 1.0), key=_unexplained, default=None)
    if beyond is not None:
        return "larger", (
            f"{beyond['quantity']} in {beyond['variant']} is off by {_unexplained(beyond):.3g} times what its check explains"
        )
    if not found.size > found.over:
        return "gone", f"the size is at most {found.over:.2g}"
    if found.size > GROWN * found.before:
        return "larger", f"it was {found.before:.3g} in the run {found.before_run}"
    return "there", ""


def _unexplained(row: Row) -> float:
    """A measurement's error in units of what its check allows for; 0 where the check's truth is itself known to be off."""
    if "abs_error" not in row or row["status"] in _EXPLAINED:
        return 0.0
    allowed, error = max(row_tolerance(row), known_size(row)), _number(row, "abs_error")
    return error / allowed if allowed > 0.0 else math.inf if error > 0.0 else 0.0


def known_size(row: Row) -> float:
    """Largest error that the row's known difference explains; 0 without one."""
    size = _number(row, "known_size")
    return 0.0 if math.isnan(size) else size


def _declared(described: set[str], cells: Mapping[CellKey, Sequence[Kept]]) -> list[EvaluatedFinding]:
    """Differences that checks need and that no finding describes, each at the row where it is largest."""
    rows: dict[str, list[tuple[Row, Kept]]] = {}
    for held in cells.values():
        for row in held[0].measurements:
            if row["finding"] and row["finding"] not in described:
                rows.setdefault(row["finding"], []).append((row, held[0]))
    found = []
    for name, named in rows.items():
        beyond = [each for each in named if _number(each[0], "abs_error") > row_tolerance(each[0])]
        if not beyond:
            continue
        row, kept = max(beyond, key=lambda each: -1.0 if math.isnan(_relative(each[0])) else _relative(each[0]))
        worst = max(_unexplained(each) for each, _ in named)
        larger = worst > 1.0
        version = str(kept.cell["engine_version"])
        found.append(
            EvaluatedFinding(
                id=name, engine=row["engine"], versions=version, engine_version=version,
                verdict="larger" if larger else "there",
                what=str(row["reason"]).removeprefix(f"{name}: ") or "declared by its adapter, not described",
                reason=f"{worst:.3g} times what is declared" if larger else "",
                size=_relative(row), case=row["case"], variant=row["variant"],
                quantity=row["quantity"], unit=row["unit"], truth=row["truth"], value=_number(row, "value"),
                expected=_number(row, "expected"), scale=_number(row, "scale"), of=_number(row, "scale"),
                per=f"largest {row['quantity']}", run_id=kept.run_id, over_why="the tolerance of its check",
                over=_relative({**row, "abs_error": row_tolerance(row)}),
                command=f"ninedisk run {row['case']} --engine {row['engine']}",
            )
        )  # fmt: skip
    return found


def _relative(row: Row) -> float:
    scale, error = _number(row, "scale"), _number(row, "abs_error")
    return error / scale if scale > 0.0 else math.nan
