"""The panel: stored rows joined into cases, engines and rated measurements."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from ninedisk.harness.results.schema import WORST_FIRST, row_tolerance, worst_status
from ninedisk.reports.load import Row, Stored
from ninedisk.reports.text import Slugs, as_float, decoded

NOT_RUN = frozenset({"error", "timeout", "unsupported", "not-installed"})
"""Statuses of cells that left no numbers."""

NOT_TRIED = frozenset({"unsupported", "not-installed"})
"""Statuses of cells that no engine was asked to run: they do not decide where other variants ran."""

EXPLAINED = frozenset({"known-gap", "gap-closed"})
"""Statuses of measurements whose truth is itself known to be off; they are ranked apart."""

SUPPORT = ("exact", "equivalent", "approximate", "no")


def error_ratio(row: Row) -> float:
    """Error over tolerance; inf for a failure without a number or beyond a zero tolerance, NaN if unmeasured."""
    if row["status"] in NOT_RUN:
        return math.nan
    error, limit = as_float(row["abs_error"]), row_tolerance(row)
    if not math.isfinite(error):
        return math.inf if row["status"] == "fail" else math.nan
    if limit > 0.0:
        return error / limit
    if row["status"] == "no-truth":
        return math.nan
    return 0.0 if error == 0.0 else math.inf


def is_rated(row: Row) -> bool:
    """Whether a measurement has an error over tolerance."""
    return not math.isnan(row["ratio"])


def worst_first(rows: Iterable[Row]) -> list[Row]:
    """Rated rows by error over tolerance, largest first; rows without a number at the end, failures before the rest."""

    def key(row: Row) -> tuple[float, int, str, str, str]:
        rank = WORST_FIRST.index(row["status"]) if row["status"] in WORST_FIRST else -1
        size = -row["ratio"] if not math.isnan(row["ratio"]) else math.inf
        return size, rank, row["engine"], row["variant"], row["quantity"]

    return sorted(rows, key=key)


@dataclass(frozen=True)
class EngineFacts:
    """What the newest cells say about an engine."""

    id: str
    slug: str
    name: str
    version: str
    licence: str
    runs: str


@dataclass
class CaseData:
    """Everything of one case; ``variants`` keeps params in the stored order."""

    id: str
    slug: str
    title: str
    source: str
    requirement: str
    version: int
    cells: list[Row] = field(default_factory=list)
    measurements: list[Row] = field(default_factory=list)
    claims: list[Row] = field(default_factory=list)
    variants: dict[str, dict[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Summary:
    """One square of the matrix, or one line of an engine's table; status and support are those of what ``ran``, if any."""

    status: str
    counts: tuple[tuple[str, int], ...]
    support: tuple[str, ...]
    worst: Row | None
    gaps: int
    ran: int
    variants: int

    @property
    def ratio(self) -> float:
        """Worst error over tolerance; NaN where nothing was measured."""
        return float(self.worst["ratio"]) if self.worst else math.nan


@dataclass(frozen=True)
class Panel:
    """Cases and engines of a store, with every measurement rated."""

    stored: Stored
    cases: dict[str, CaseData]
    engines: dict[str, EngineFacts]
    measurements: list[Row]

    def open_rows(self) -> list[Row]:
        """Rated measurements, worst first, without those whose truth is known to be off."""
        return worst_first(r for r in self.measurements if is_rated(r) and r["status"] not in EXPLAINED)

    def worst_of_pairs(self) -> list[Row]:
        """The worst open row of each case and engine, worst first."""
        first: dict[tuple[str, str], Row] = {}
        for row in self.open_rows():
            first.setdefault((row["case"], row["engine"]), row)
        return list(first.values())

    def gap_rows(self) -> list[Row]:
        """Measurements against truths that are known to be off, worst first."""
        return worst_first(row for row in self.measurements if row["status"] in EXPLAINED)

    def unfinished(self) -> list[Row]:
        """Cells that broke."""
        return [cell for case in self.cases.values() for cell in case.cells if cell["status"] in ("error", "timeout")]


def summarise(cells: list[Row], measurements: list[Row]) -> Summary | None:
    """Join the cells of a case and engine (or of one variant); None if there are none."""
    if not cells:
        return None
    rated = [row for row in measurements if is_rated(row)]
    counted = [row for row in rated if row["status"] not in EXPLAINED]
    counts = Counter(cell["status"] for cell in cells)
    order = {status: k for k, status in enumerate(WORST_FIRST)}
    tried = [cell for cell in cells if cell["status"] not in NOT_TRIED]
    support = {cell["support"] for cell in tried or cells if cell["support"]}
    return Summary(
        status=worst_status(cell["status"] for cell in tried or cells),
        counts=tuple(sorted(counts.items(), key=lambda item: order.get(item[0], -1))),
        support=tuple(sorted(support, key=lambda word: SUPPORT.index(word) if word in SUPPORT else -1)),
        worst=worst_first(counted)[0] if counted else None,
        gaps=sum(row["status"] in EXPLAINED for row in measurements),
        ran=len(tried),
        variants=len(cells),
    )


def build_panel(stored: Stored) -> Panel:
    """Join the stored rows; cases come out by id, engines by id with those that are not installed last."""
    case_slug, engine_slug = Slugs(), Slugs()
    cases: dict[str, CaseData] = {}
    engines: dict[str, EngineFacts] = {}
    for cell in sorted(stored.cells, key=lambda row: (row["case"], row["engine"])):
        case = cases.setdefault(
            cell["case"],
            CaseData(
                id=cell["case"],
                slug=case_slug(cell["case"]),
                title=cell["case_title"] or cell["case"],
                source=cell["case_source"],
                requirement=cell["case_requirement"],
                version=int(cell["case_version"] or 0),
            ),
        )
        case.cells.append(cell)
        case.variants.setdefault(cell["variant"], decoded(cell["params"], dict))
        known = engines.get(cell["engine"])
        if known is None or (cell["engine_version"] and not known.version):
            engines[cell["engine"]] = EngineFacts(
                id=cell["engine"],
                slug=engine_slug(cell["engine"]),
                name=cell["engine_name"] or cell["engine"],
                version=cell["engine_version"],
                licence=cell["engine_licence"],
                runs=cell["engine_runs"],
            )
    rated = []
    for row in stored.measurements:
        measured = {**row, "ratio": error_ratio(row), "tolerance": row_tolerance(row)}
        rated.append(measured)
        cases[row["case"]].measurements.append(measured)
    for claim in stored.claims:
        if claim["case"] in cases:
            cases[claim["case"]].claims.append(claim)
    return Panel(
        stored=stored,
        cases=cases,
        engines=dict(sorted(engines.items(), key=lambda item: (not item[1].version, item[0]))),
        measurements=rated,
    )
