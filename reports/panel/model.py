"""The panel: stored rows joined into cases, engines and rated measurements.

Besides, what a case's page says of them: its measurements in three tables (rated, known gaps, without a rating; long ones continue in
the data file), and how far the histories of two engines lie apart.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import combinations
from statistics import median
from typing import Any

import numpy as np

from ninedisk.harness.results.figures import Figure, figures_from_text
from ninedisk.harness.results.schema import WIDE, WORST_FIRST, Row, allowed_shares, row_tolerance, worst_status
from ninedisk.harness.results.statuses import TABLE
from ninedisk.reports.panel import text
from ninedisk.reports.panel.load import Curve, Series, Stored, differences
from ninedisk.reports.panel.text import Slugs, as_float, decoded, shade, symbol

NOT_RUN = frozenset({"error", "timeout", "unsupported", "not-installed"})
"""Statuses of cells that left no numbers."""

NOT_TRIED = frozenset({"unsupported", "not-installed"})
"""Statuses of cells that no engine was asked to run: they do not decide where other variants ran."""

EXPLAINED = frozenset({"known-gap", "gap-closed", "known-difference"})
"""Statuses of measurements whose truth is itself known to be off; they are ranked apart."""

STEPS = ("dt", "increment")
"""Parameters of cases that are step sizes."""

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

    @property
    def program(self) -> tuple[str, str, str]:
        """What engines of one program have in common: first word of the name, version, licence; one without a version stands alone."""
        return (self.name.split()[0] if self.version else self.id, self.version, self.licence)


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
    headlines: list[Row] = field(default_factory=list)
    claims: list[Row] = field(default_factory=list)
    figures: tuple[Figure, ...] = ()
    variants: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def in_space(self) -> bool:
        """Whether its scenes are of spheres in space; False where none is stored."""
        setups = (decoded(cell["setup"], dict) for cell in self.cells)
        scene: dict[str, Any] = next((setup["scene"] for setup in setups if isinstance(setup.get("scene"), dict)), {})
        return bool(scene.get("dimension") == 3)

    @property
    def wrong(self) -> frozenset[str]:
        """Ids of engines with a check or a cell that is `WRONG`; a cell's status is that of its worst check."""
        return frozenset(cell["engine"] for cell in self.cells if cell["status"] in WRONG)


WRONG = tuple(status for status, each in TABLE.items() if each.fails)
"""Statuses of an engine that is no measure for others: it ranks after all that pass, however small the errors of its headlines."""


@dataclass(frozen=True)
class Summary:
    """One square of the matrix, or one line of an engine's table; status and support are those of what ``ran``, if any.

    ``wide`` is the largest share of its reference that a passing check allows (`allowed_shares`), NaN where all are tight;
    ``penetration`` the deepest one, NaN where unknown; ``seconds`` the median of the stepping times.
    """

    status: str
    counts: tuple[tuple[str, int], ...]
    support: tuple[str, ...]
    worst: Row | None
    gaps: int
    ran: int
    variants: int
    wide: float
    penetration: float
    seconds: float

    @property
    def ratio(self) -> float:
        """Worst error over tolerance; NaN where nothing was measured."""
        return float(self.worst["ratio"]) if self.worst else math.nan

    @property
    def fails(self) -> int:
        """Number of cells in which a check fails."""
        return dict(self.counts).get("fail", 0)

    @property
    def wrong(self) -> str:
        """What is `WRONG` with it in words, "3 variants fail"; "" where nothing is."""
        counts = dict(self.counts)
        words = {
            "fail": ("variant fails", "variants fail"),
            "error": ("error", "errors"),
            "timeout": ("timeout", "timeouts"),
        }
        return ", ".join(f"{counts[each]} {words[each][counts[each] != 1]}" for each in WRONG if counts.get(each))


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
    counts = Counter(str(cell["status"]) for cell in cells)
    order = {status: k for k, status in enumerate(WORST_FIRST)}
    tried = [cell for cell in cells if cell["status"] not in NOT_TRIED]
    times = [time for cell in cells if math.isfinite(time := as_float(cell.get("advance_s")))]
    support = {cell["support"] for cell in tried or cells if cell["support"]}
    return Summary(
        status=worst_status(cell["status"] for cell in tried or cells),
        counts=tuple(sorted(counts.items(), key=lambda item: order.get(item[0], -1))),
        support=tuple(sorted(support, key=lambda word: SUPPORT.index(word) if word in SUPPORT else -1)),
        worst=worst_first(counted)[0] if counted else None,
        gaps=sum(row["status"] in EXPLAINED for row in measurements),
        ran=len(tried),
        variants=len(cells),
        wide=largest_number(row["share"] for row in measurements if is_wide(row)),
        penetration=largest_number(as_float(cell.get("penetration")) for cell in cells),
        seconds=median(times) if times else math.nan,
    )


def is_wide(row: Row) -> bool:
    """Whether a measurement passes a tolerance that is no small part of its reference."""
    return bool(row["status"] == "pass" and row["share"] > WIDE)


def largest_number(values: Iterable[float]) -> float:
    """The largest of those that are numbers; NaN of none."""
    return max((value for value in values if not math.isnan(value)), default=math.nan)


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
        case.figures = case.figures or figures_from_text(cell["case_figures"])
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
    for row, share in zip(stored.measurements, allowed_shares(stored.measurements), strict=True):
        measured = {**row, "ratio": error_ratio(row), "tolerance": row_tolerance(row), "share": share}
        rated.append(measured)
        cases[row["case"]].measurements.append(measured)
    for headline in stored.headlines:
        cases[headline["case"]].headlines.append(headline)
    for claim in stored.claims:
        if claim["case"] in cases:
            cases[claim["case"]].claims.append(claim)
    return Panel(
        stored=stored,
        cases=cases,
        engines=dict(sorted(engines.items(), key=lambda item: (not item[1].version, item[0]))),
        measurements=rated,
    )


@dataclass(frozen=True)
class EnginePair:
    """Largest relative difference of two engines over all shared histories, and the history where it occurs."""

    size: float
    variant: str
    quantity: str


def difference_matrix(
    series: Series, case: str, measurements: Iterable[Row]
) -> tuple[list[str], dict[tuple[str, str], EnginePair]]:
    """Engines with histories of a case, the one that differs most first, and every pair that shares a history.

    A difference is ``max |a - b|`` over the common steps of one history, over the largest ``|truth|`` of the quantity in
    the whole case, or the size that its checks are relative to where that is larger (over the values themselves where neither
    speaks): where nothing should move, round-off is then no difference. Both orders of a pair are keys.
    """
    scale = _scales(series, case, measurements)
    held: dict[tuple[str, str], dict[str, Curve]] = {}
    for (name, variant, engine, quantity), curve in series.items():
        if name == case:
            held.setdefault((variant, quantity), {})[engine] = curve
    worst: dict[tuple[str, str], EnginePair] = {}
    for (variant, quantity), engines in held.items():
        for one, two in combinations(sorted(engines), 2):
            apart = differences(engines[one], engines[two], scale[quantity])
            known = worst.get((one, two))
            if not math.isnan(apart) and (known is None or apart > known.size):
                worst[one, two] = worst[two, one] = EnginePair(apart, variant, quantity)
    middle: dict[str, float] = {}
    for engine in sorted({engine for engines in held.values() for engine in engines}):
        sizes = sorted(found.size for (one, _), found in worst.items() if one == engine)
        if sizes:
            middle[engine] = sizes[len(sizes) // 2]
    return sorted(middle, key=lambda engine: -middle[engine]), worst


def _scales(series: Series, case: str, measurements: Iterable[Row]) -> dict[str, float]:
    """Largest finite ``|truth|`` of each quantity of a case, or size of its checks; of the values where neither is above 0."""
    reported: dict[str, float] = {}
    value: dict[str, float] = {}
    for row in measurements:
        if math.isfinite(size := as_float(row["scale"])):
            reported[row["quantity"]] = max(reported.get(row["quantity"], 0.0), size)
    for (name, _, _, quantity), curve in series.items():
        if name == case:
            reported[quantity] = max(reported.get(quantity, 0.0), curve.scale)
            finite = np.abs(curve.value[np.isfinite(curve.value)])
            value[quantity] = max(value.get(quantity, 0.0), float(finite.max(initial=0.0)))
    return {quantity: reported[quantity] or size for quantity, size in value.items()}


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
        return {"rows": self.rows[SHOWN:], "gaps": self.gaps, "unrated": self.unrated}


def case_tables(case: CaseData) -> CaseTables:
    """Sort the measurements of a case into tables and number the reasons of the folded ones."""
    rows = worst_first(row for row in case.measurements if is_rated(row) and row["status"] not in EXPLAINED)
    gaps = worst_first(row for row in case.measurements if row["status"] in EXPLAINED)
    unrated = [row for row in case.measurements if not is_rated(row) and row["status"] not in EXPLAINED]
    notes: dict[tuple[str, str, str], int] = {}
    for row in (*rows[SHOWN:], *gaps, *unrated):
        # What a failure says, its numbers say as well; every other reason is printed once.
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
