"""Schema of stored results: with `figures` and `reader` beside it the only thing of the harness that the reports know.

A run is a folder with ``run.json`` (`RUN_KEYS`) and the Parquet tables of `TABLES`. Columns are never renamed or
reused; `SCHEMA_VERSION` grows when one is added. What is derived from several runs, comparisons and histories, has its
form here too, so that pages can be made of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ninedisk.harness.results.statuses import TABLE, VERDICTS

Row = dict[str, Any]
"""A row of a table, by column."""

EMPTY: dict[str, Any] = {"string": "", "float64": math.nan, "int64": -1}
"""What represents an unknown value of each kind of column; in a file an unknown number may also be null."""

SCHEMA_VERSION = 3

OLDEST_SCHEMA = 1
"""Older runs than this cannot be read; those between lack columns, which are then empty."""

STATUSES = tuple(TABLE)
"""Every status that a cell or a measurement can have."""

EXCUSED = frozenset(status for status, each in TABLE.items() if not each.fails)
"""Statuses that leave the exit code at 0."""

WORST_FIRST = (
    "error",
    "timeout",
    "fail",
    "gap-closed",
    "known-difference",
    "known-gap",
    "no-truth",
    "unsupported",
    "not-installed",
    "pass",
    "not-observed",
)
"""Order in which a cell's measurements decide its status: the first one present wins."""


AS_DEFAULT = "which this engine does not have: its run is that of the default"
"""End of the reason of a cell whose variant sets only what engines of another kind have."""

NO_VALUE = "no-value"
"""Not a status but a choice of `ninedisk show --status`: failures for want of a number."""


def has_no_value(row: Mapping[str, Any]) -> bool:
    """Whether a check has no error to compare although its truth gives a number: the engine gives none, or NaN at some step."""
    return bool(row["status"] == "fail" and row["quantity"] and math.isnan(float(row["abs_error"])))


def short_variant(name: str) -> str:
    """A variant's id with its numbers cut to four digits, to be read and not to be typed."""
    return re.sub(r"(?<==)-?\d+\.\d{5,}(?=,|$)", lambda match: f"{float(match[0]):.4g}", name)


def worst_status(statuses: Iterable[str]) -> str:
    """The status that decides among those of measurements or cells: the first of `WORST_FIRST` that is present, ``""`` of none.

    A word that is no status comes before all others, so that it is seen; it is in no `EXCUSED` either.
    """
    present = set(statuses)
    unknown = sorted(present - set(WORST_FIRST))
    return unknown[0] if unknown else next((status for status in WORST_FIRST if status in present), "")


def tolerance(atol: float | None, rtol: float | None, scale: float | None) -> float:
    """Largest error that passes, ``atol + rtol scale``, in the quantity's unit.

    Where the truth has no finite value, ``scale`` is infinite or NaN and ``atol`` stands alone; what is unknown (NaN, or None from a
    run that lacks the column) counts as zero.
    """
    absolute, relative, size = (math.nan if part is None else float(part) for part in (atol, rtol, scale))
    absolute = 0.0 if math.isnan(absolute) else absolute
    return absolute + relative * size if math.isfinite(relative * size) else absolute


def row_tolerance(row: Mapping[str, Any]) -> float:
    """`tolerance` of a measurement."""
    return tolerance(row["atol"], row["rtol"], row["scale"])


WIDE = 0.05
"""A check that passes is wide where its tolerance exceeds this part of what it is held against (`allowed_shares`)."""

ROUND_OFF = 1e-12
"""A reference below this part of the largest one of its case and unit is zero but for round-off; an error below it has no order."""


def allowed_shares(rows: Sequence[Mapping[str, Any]]) -> list[float]:
    """Tolerance of each measurement over the largest value of its reference; NaN where nothing shows how large that is.

    A reference that is zero, or zero but for round-off, is no measure. There the largest one among ``rows`` counts that the same
    quantity has in another variant of the case, and if it is zero in all of them, the largest of the same unit.
    """
    largest: dict[tuple[str, ...], float] = {}
    sizes = [math.nan if row["scale"] is None else float(row["scale"]) for row in rows]
    keys = [((row["case"], row["unit"]), (row["case"], row["unit"], row["quantity"])) for row in rows]
    for held, size in zip(keys, sizes, strict=True):
        for key in held if math.isfinite(size) else ():
            largest[key] = max(size, largest.get(key, 0.0))
    shares = []
    for row, size, (unit, quantity) in zip(rows, sizes, keys, strict=True):
        most = largest.get(unit, 0.0)
        measure = next(
            (each for each in (size, largest.get(quantity, 0.0)) if ROUND_OFF * most < each < math.inf), most
        )
        shares.append(row_tolerance(row) / measure if measure > 0.0 else math.nan)
    return shares


RUN_KEYS = ("run_id", "schema_version", "started", "finished", "provenance", "argv")

CELL_COLUMNS: dict[str, str] = {
    "case": "string",
    "case_version": "int64",
    "case_title": "string",
    "case_source": "string",
    "case_requirement": "string",
    "case_figures": "string",  # JSON list of `ninedisk.harness.results.figures.Figure`
    "variant": "string",
    "params": "string",  # JSON object
    "engine": "string",
    "engine_name": "string",
    "engine_version": "string",
    "engine_licence": "string",
    "engine_runs": "string",
    "support": "string",
    "missing": "string",  # JSON list of capability descriptions
    "asked": "string",  # JSON list of the capabilities that the scene asks for, of springs and of rigid contacts alike
    "capabilities": "string",  # JSON list of those that the engine declares
    "notes": "string",  # JSON list
    "settings": "string",  # JSON object
    "status": "string",
    "reason": "string",
    "setup_s": "float64",
    "warm_up_s": "float64",
    "advance_s": "float64",  # recorded only where the physics checks pass, and so is all that follows down to repeats
    "cpu_s": "float64",  # CPU seconds of what cpu_of says, the least of repeats
    "cpu_of": "string",  # stepping | whole process
    "cpu_spread": "float64",  # median over least of the repeats, less 1; NaN of one
    "reference_s": "float64",  # CPU seconds of the harness' reference computation, the least of those before, between and after
    "repeats": "int64",
    "n_steps": "int64",
    "n_disks": "int64",  # disks or spheres
    "setup": "string",  # JSON: scene, numerics, watch, labels
    # Deepest overlap of the samples beyond that with which the scene begins, over the smallest radius: of watched contacts, and of round
    # disks, spheres and walls by their places. NaN where neither is known (outlines that nobody watches).
    "penetration": "float64",
    "frames": "string",  # JSON: {"step": [...], "x": [[[x, y]]], "angle": [...], "wall_point":..., "wall_angle":...} as in History
}
"""One row per case variant and engine."""

MEASUREMENT_COLUMNS: dict[str, str] = {
    "case": "string",
    "case_version": "int64",
    "variant": "string",
    "params": "string",
    "engine": "string",
    "engine_version": "string",
    "support": "string",
    "quantity": "string",
    "unit": "string",
    "norm": "string",
    "truth": "string",
    "source": "string",
    "value": "float64",
    "expected": "float64",
    "uncertainty": "float64",
    "abs_error": "float64",
    "rel_error": "float64",
    "scale": "float64",  # largest |expected|, or the size that the case states where that is larger: what rel_error and rtol refer to
    "atol": "float64",
    "rtol": "float64",
    "why": "string",
    "worst_step": "int64",  # -1 for numbers
    "first_divergence_step": "int64",  # -1: never
    "status": "string",
    "reason": "string",
    "finding": "string",  # id of the known difference that this check allows for, "" for none
    "known_size": "float64",  # largest error that the known difference explains, in the quantity's unit
}
"""One row per checked quantity; a cell that did not run has one row with its status and empty numbers."""

GATED_SECONDS = 5e-3
"""Timings below this are shown and never judged: a page fault or a cold cache is a tenth of them."""

REFERENCE_SECONDS = 1e-3
"""What the reference computation takes on a processor on which `standard_seconds` are CPU seconds."""


def standard_seconds(cell: Mapping[str, Any]) -> float:
    """CPU time of a cell in seconds of a processor that computes the reference in `REFERENCE_SECONDS`; NaN where one is unknown.

    Whatever makes the processor faster or slower for a while, its clock rate or a neighbour on the same core, divides out.
    """
    cpu, reference = float(cell["cpu_s"]), float(cell["reference_s"])
    return cpu * REFERENCE_SECONDS / reference if reference > 0.0 else math.nan


HEADLINE_COLUMNS: dict[str, str] = {
    "case": "string",
    "case_version": "int64",
    "variant": "string",
    "params": "string",
    "engine": "string",
    "engine_version": "string",
    "support": "string",
    "headline": "string",  # in a physicist's words
    "use": "string",  # one of USES
    "quantity": "string",
    "unit": "string",
    "source": "string",
    "value": "float64",  # at the worst step; NaN where the engine does not observe it
    "expected": "float64",
    "scale": "float64",
    "scale_is": "string",
    "rel_error": "float64",  # |value - expected|/scale
    "worst_step": "int64",  # -1 for numbers
}
"""One row per headline of a cell that ran: how far the engine is from the continuous problem, whatever its scheme."""

STOCK = "-stock"
"""How the id of an engine at its own settings ends, beside that of the tuned one."""

USES = {
    "impacts": "impacts",
    "sliding": "sliding",
    "rolling": "rolling",
    "rest": "stacks and packs at rest",
    "moving-walls": "moving and turning walls",
    "energy": "energy over long runs",
    "invariance": "laws that hold for every observer",
    "large": "large scenes",
}
"""What people choose an engine for; each headline serves one use."""

SERIES_COLUMNS: dict[str, str] = {
    "case": "string",
    "variant": "string",
    "engine": "string",
    "quantity": "string",
    "unit": "string",
    "step": "int64",
    "t": "float64",
    "value": "float64",
    "expected": "float64",  # of the best truth that speaks about the quantity; NaN where none does
    "truth": "string",  # kind of that truth, "" where none
}
"""One row per sampled step and quantity."""

REFERENCE_COLUMNS: dict[str, str] = {
    "case": "string",
    "variant": "string",
    "label": "string",
    "truth": "string",
    "source": "string",
    "quantity": "string",
    "unit": "string",
    "step": "int64",
    "t": "float64",
    "value": "float64",
    "uncertainty": "float64",
}
"""Reference curves that belong to a variant whatever engine runs (exact-step, analytic, converged, digitised)."""

CLAIM_COLUMNS: dict[str, str] = {
    "claim": "string",
    "place": "string",
    "text": "string",
    "case": "string",
    "engine": "string",
    "verdict": "string",  # confirmed | contradicted | undecided
    "evidence": "string",
    "derivation": "string",  # JSON list of paragraphs: why measurements differ from the claim, where they do
}
"""One row per claim of the source and engine."""

TABLES: dict[str, dict[str, str]] = {
    "cells": CELL_COLUMNS,
    "measurements": MEASUREMENT_COLUMNS,
    "series": SERIES_COLUMNS,
    "references": REFERENCE_COLUMNS,
    "claims": CLAIM_COLUMNS,
    "headlines": HEADLINE_COLUMNS,
}

SINCE = {"headlines": 3}
"""Schema from which on a run has a table, where that is not the oldest one."""

CHANGE_VERDICTS = tuple(VERDICTS["compare"])
"""How something changed between two runs, what wants attention first."""


DETERMINISM_KINDS: dict[str, tuple[str, str]] = {
    "twice": ("the same run again in one process", "bitwise"),
    "process": ("in another process", "bitwise"),
    "error": ("after a run that failed in the same process", "bitwise"),
    "scene": ("after another scene in the same process", "bitwise"),
    "threads": ("on two threads", "bitwise"),
    "restart": ("saved half way and restarted in another process", "bitwise"),
    "watched": ("no contact watched", "bitwise"),
    "sampled": ("sampled at every seventh step only", "bitwise"),
    "bodies": ("bodies given in another order", "round-off"),
    "walls": ("walls given in another order", "round-off"),
}
"""Repetitions of a run, and what each should be at least: sums over contacts may be rounded otherwise where these come in another order."""

DETERMINISM_VERDICTS = tuple(VERDICTS["determinism"])
"""Worst first."""

DETERMINISM_COLUMNS: dict[str, str] = {
    "engine": "string",
    "engine_name": "string",
    "engine_version": "string",
    "kind": "string",  # a key of DETERMINISM_KINDS
    "scene": "string",
    "scene_why": "string",  # why no scene that shows more
    "verdict": "string",  # one of DETERMINISM_VERDICTS
    # Largest difference of the state, where it exceeds its allowance most: of centres over the mean radius, of velocities over that of a
    # fall through the scene. Where the state is the same to the last bit, of forces and energies, over the largest. NaN: no number.
    "difference": "float64",
    "allowance": "float64",  # what round-off, or the solver's tolerance, may have become by then
    "growth": "float64",  # of a difference at the start, to the end of the run
    "first_step": "int64",  # sample of the first different bit; -1: none
    "beyond_step": "int64",  # of the first difference beyond the allowance; -1: none
    "reason": "string",
}
"""One row per engine and kind, in ``determinism/<engine>.json`` of a store: the newest measurement alone."""


def worse_than_promised(row: Mapping[str, Any]) -> bool:
    """Whether a repetition is less than `DETERMINISM_KINDS` asks of any engine."""
    promised = DETERMINISM_KINDS[row["kind"]][1]
    return row["verdict"] in ("different", "broken") or (row["verdict"] == "round-off" and promised == "bitwise")


FINDING_VERDICTS = tuple(VERDICTS["findings"])
"""What a store says of a finding, what wants attention first."""


@dataclass(frozen=True, kw_only=True)
class EvaluatedFinding:
    """A finding (`ninedisk.harness.api.finding`), and what a store says of it.

    Parameters
    ----------
    id, engine, versions, what, documented, thread, command : str
        As they are declared.
    verdict : str
        One of `FINDING_VERDICTS`; ``reason`` says why where it is not ``there``, and what else is to be said.
    size : float
        Relative, NaN where it is not measured; the finding is there while it is larger than ``over``, for ``over_why``.
    before : float
        The same cell's size in the run before, ``before_run``; NaN where there is none.
    least, least_engine : float, str
        The smallest size that another engine shows on the same cells: what is possible. NaN where there is none.
    case, variant, quantity, unit, truth, value, expected, scale
        The row that the size was read from.
    of, per : float, str
        What the size is relative to, in ``unit``, and its name; NaN and "" where the number is relative as it is.
    engine_version, run_id : str
        Of that row.
    """

    id: str
    engine: str
    versions: str
    what: str
    documented: str = ""
    thread: str = ""
    command: str = ""
    verdict: str
    reason: str = ""
    size: float = math.nan
    over: float = math.nan
    over_why: str = ""
    before: float = math.nan
    before_run: str = ""
    least: float = math.nan
    least_engine: str = ""
    case: str = ""
    variant: str = ""
    quantity: str = ""
    unit: str = ""
    truth: str = ""
    value: float = math.nan
    expected: float = math.nan
    scale: float = math.nan
    of: float = math.nan
    per: str = ""
    engine_version: str = ""
    run_id: str = ""


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """What a run came from.

    ``machine`` is processor, cores, platform and, if more than one, cells at once; ``versions`` those of packages and engines.
    """

    run_id: str
    started: str
    commit: str
    machine: str
    versions: Mapping[str, str]
    command: str


@dataclass(frozen=True, kw_only=True)
class Change:
    """A check, a timing or a whole cell, before and after.

    ``kind`` is ``error`` (``base``, ``head`` and ``tolerance`` are absolute errors in ``unit``), ``timing`` (seconds) or
    ``cell`` (no numbers, NaN). ``verdict`` is one of `CHANGE_VERDICTS`, ``reason`` says why.
    """

    verdict: str
    kind: str
    case: str
    case_version: int
    variant: str
    engine: str
    quantity: str
    unit: str
    truth: str
    base: float
    head: float
    tolerance: float
    base_status: str
    head_status: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Two runs, or two groups of runs for the timings; ``changes`` has what wants attention first."""

    base: RunFacts
    head: RunFacts
    base_runs: int
    head_runs: int
    changes: tuple[Change, ...]
    rules: tuple[str, ...]


@dataclass(frozen=True)
class Point:
    """One run's value: an absolute error with its tolerance, or seconds; NaN where the cell left none.

    ``reason`` says why where ``status`` is no pass; ``shared`` is the factor of a timing that all timings of its run
    have in common, compared with other runs on the machine.
    """

    run: int
    value: float
    tolerance: float
    status: str
    engine_version: str
    reason: str = ""
    shared: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A lasting change of a line: ``before`` and ``after`` are its levels around point number ``at``,
    those of timings without what all timings of a run share.

    The change lies in all likelihood before one of the points ``first .. last``; for errors that is ``at`` alone.
    ``chance`` is the probability that noise alone shows such a shift anywhere on the dashboard (NaN for errors, which
    are no random numbers); ``open`` says that the line has not come back since.
    """

    at: int
    first: int
    last: int
    verdict: str
    before: float
    after: float
    chance: float
    reason: str
    open: bool


@dataclass(frozen=True, kw_only=True)
class Line:
    """History of one check (``error``), headline error (``headline``), timing (``timing``) or status (``cell``) on one machine, of one
    case version."""

    kind: str
    case: str
    case_version: int
    variant: str
    engine: str
    engine_name: str
    machine: str
    quantity: str
    unit: str
    truth: str
    points: tuple[Point, ...]
    shifts: tuple[Shift, ...]


@dataclass(frozen=True, kw_only=True)
class StoreHistory:
    """All runs of a store, oldest first; ``comparisons`` holds those around shifts by numbers of the two runs."""

    runs: tuple[RunFacts, ...]
    lines: tuple[Line, ...]
    comparisons: Mapping[tuple[int, int], Comparison]
    rules: tuple[str, ...]
