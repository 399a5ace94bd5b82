"""The HTML: templates with everything escaped, and the values that each kind of page shows.

Claims of the source that measurements contradict: what it says, what follows instead, and what engines give.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ninedisk.harness.results.schema import (
    CHANGE_VERDICTS,
    DETERMINISM_KINDS,
    USES,
    Comparison,
    Row,
    worse_than_promised,
)
from ninedisk.harness.results.statuses import TABLE, VERDICTS
from ninedisk.reports import citation
from ninedisk.reports.drawing.charts import Chart
from ninedisk.reports.findings import of_engines
from ninedisk.reports.panel import ranking, text
from ninedisk.reports.panel.headlines import (
    AGREES,
    Rating,
    disagreements,
    ratings,
    slower_than_fastest,
    standings,
    without_headline,
    worst_headline,
)
from ninedisk.reports.panel.model import (
    NOT_RUN,
    SHOWN,
    CaseData,
    EngineFacts,
    Panel,
    Summary,
    is_wide,
    summarise,
)
from ninedisk.reports.panel.text import as_float, number, pair_shade, parameters, shade, symbol
from ninedisk.reports.panel.uses import Use
from ninedisk.reports.stock import Both
from ninedisk.reports.tuning import of_engine as of_tuned

HERE = Path(__file__).parent

LISTED = 10
"""Lines of a short ranked table."""

OPEN_GROUPS = 4
"""Groups of variants of one figure that are open; the rest is folded."""


@dataclass(frozen=True)
class CellGroup:
    """Cells of one case and engine that differ in nothing but the variant."""

    status: str
    support: str
    reason: str
    missing: list[str]
    notes: list[str]
    settings: dict[str, str]
    cells: list[Row]

    @property
    def total(self) -> float:
        """Stepping time of all cells [s]."""
        times = [text.as_float(cell["advance_s"]) for cell in self.cells]
        return sum(time for time in times if time == time)


def environment() -> Environment:
    """Templates: everything escaped, and a missing value is an error, not an empty string."""
    env = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    env.filters |= {
        "error": text.error,
        "number": text.number,
        "order": text.order,
        "ratio": text.ratio,
        "seconds": text.seconds,
        "variant": _variant,
        "unit": lambda unit: "" if unit in ("-", "1") else unit,
        "shade": shade,
        "symbol": symbol,
        "pair_shade": pair_shade,
        "decade": text.decade,
        "percent": ranking.percent,
        "some": text.count_noun,
        "slower_shade": text.slower_shade,
        "times": text.factor_text,
        "css": lambda word: re.sub(r"[^a-z-]", "", str(word)),
    }
    env.globals |= {
        "pips": text.SUPPORT_PIPS,
        "support_meaning": text.SUPPORT_MEANING,
        "statuses": TABLE,
        "other_verdicts": VERDICTS,
        "shades": text.SHADES,
        "pair_shades": text.PAIR_SHADES,
        "nothing": text.NOTHING,
        "slower": text.SLOWER,
    }
    return env


def sheet(*more: str) -> Markup:
    """The pages' style sheet, followed by other ones of the assets."""
    return Markup("\n".join(map(_asset, ("style.css", *more))))


def single_file() -> dict[str, Markup]:
    """Style sheet and scripts of a page with charts that is one file."""
    licence = f"/*\n{_asset('uplot-LICENSE.txt')}*/"
    return {
        "sheet": sheet("uplot.css"),
        "scripts": Markup("\n".join((licence, *map(_asset, ("uplot.js", "data.js", "charts.js"))))),
    }


def _asset(name: str) -> str:
    return (HERE / "assets" / name).read_text(encoding="utf-8")


MODES = {
    "error": "error",
    "ratio": "error ÷ tolerance",
    "time": "time",
    "support": "support",
    "penetration": "penetration",
}
"""What the squares of the matrix can show; the first one that the store has is shown at the start."""

PARTS = {"In the plane": False, "In space": True}
"""Parts of the matrix, and whether a case's scenes are in space; given where there are both."""


@dataclass(frozen=True)
class Square:
    """A case on an engine: its cells and checks, its headlines, and its stepping time over the fastest engine's."""

    engine: EngineFacts
    summary: Summary
    rating: Rating
    slower: float


def squares(panel: Panel) -> dict[tuple[str, str], Square]:
    """Every square of the matrix by case and engine, of engines that are installed."""
    checked = _by(panel.measurements, "case", "engine")
    found = {}
    for case in panel.cases.values():
        rated, slower = ratings(case), slower_than_fastest(case)
        for (name,), cells in _by(case.cells, "engine").items():
            summary = summarise(cells, checked.get((case.id, name), []))
            if summary is not None and summary.status != "not-installed":
                rating = rated.get(name, Rating(None, 0, 0))
                found[case.id, name] = Square(panel.engines[name], summary, rating, slower.get(name, math.nan))
    return found


def _matrix(panel: Panel, found: dict[tuple[str, str], Square]) -> tuple[list[EngineFacts], list[CaseData]]:
    """Engines and cases in the order of the matrix: those with the largest errors of headlines first, then by error over tolerance.

    A case counts by its worst engine, an engine by the middle of its cases: its worst one says little of it.
    """

    def size(square: Square) -> tuple[float, float]:
        error, ratio = square.rating.error, square.summary.ratio
        return (-1.0 if math.isnan(error) else error), (-1.0 if math.isnan(ratio) else ratio)

    of_engine = {
        name: sorted(size(s) for (_, e), s in found.items() if e == name and s.summary.ran) for name in panel.engines
    }
    of_case = {
        name: max((size(s) for (c, _), s in found.items() if c == name), default=(-1.0, -1.0)) for name in panel.cases
    }
    engines = [panel.engines[name] for name in dict.fromkeys(name for _, name in found)]
    middle = {name: sizes[len(sizes) // 2] if sizes else (-1.0, -1.0) for name, sizes in of_engine.items()}
    engines.sort(key=lambda engine: tuple(-each for each in middle[engine.id]))
    return engines, sorted(panel.cases.values(), key=lambda case: tuple(-each for each in of_case[case.id]))


def verdict_counts(panel: Panel) -> dict[str, int]:
    """How many checks have each status."""
    counts = Counter(str(row["status"]) for row in panel.measurements if row["status"] not in NOT_RUN)
    reported = {word: counts.pop(word, 0) for word in ("pass", "known-difference", "known-gap", "fail")}
    return reported | dict(counts)


def index_page(env: Environment, panel: Panel, uses: Sequence[Use] = (), *, stock: bool = False) -> str:
    """The overview: verdicts by use, what is wrong with whom, the matrix, what to take for what; the largest errors come first.

    ``stock`` says whether engines at their own settings have a page.
    """
    rows, filled = panel.open_rows(), squares(panel)
    engines, cases = _matrix(panel, filled)
    worst = sorted(
        (s.rating.worst for s in filled.values() if s.rating.worst), key=lambda row: -as_float(row["rel_error"])
    )
    return env.get_template("index.html").render(
        root="",
        stock=stock,
        engines=panel.engines,
        columns=engines,
        n_programs=len({engine.program for engine in engines}),
        absent=[engine for engine in panel.engines.values() if engine not in engines],
        cases=panel.cases,
        modes=MODES,
        mode="error" if worst else "ratio",
        parts=[
            (words, lines)
            for words, within in PARTS.items()
            if (
                lines := [
                    (case, [(engine, filled.get((case.id, engine.id))) for engine in engines])
                    for case in cases
                    if case.in_space is within
                ]
            )
        ],
        worst_headline=worst[0] if worst else None,
        findings=of_engines(panel.stored),
        determinism=panel.stored.determinism,
        n_findings=len(panel.stored.findings),
        described={each.id for each in panel.stored.findings},
        uses=uses if any(use.headlines for use in uses) else (),
        changes=panel.stored.changes,
        **_moved(panel.stored.changes),
        counts=verdict_counts(panel),
        n_wide=sum(map(is_wide, panel.measurements)),
        disagreements=disagreements(panel)[:LISTED],
        worst_pairs=panel.worst_of_pairs(),
        causes=_grouped(ranking.causes(panel, panel.gap_rows())),
        example=ranking.example,
        unfinished=panel.unfinished(),
        fine=not panel.unfinished() and all(row["ratio"] <= 1.0 for row in rows),
        errata=errata(panel),
        n_claims=len(_all_claims(panel)),
        provenance=provenance(panel.stored.runs[0]) if panel.stored.runs else [],
        runs=[_run(run) for run in panel.stored.runs],
        outdated=panel.stored.outdated,
    )


def _moved(changes: Comparison | None) -> dict[str, Any]:
    """What changed between two runs, counted, and the first of it; cells that only one of them was asked for have not changed."""
    found = changes.changes if changes else ()
    held = [
        change
        for change in found
        if change.verdict not in ("new", "lost") or (change.base_status and change.head_status)
    ]
    counts = Counter(change.verdict for change in held)
    alone = len(found) - len(held)
    first = next((change for change in held if change.verdict != "same"), None)
    return {
        "moved": {word: counts[word] for word in CHANGE_VERDICTS if counts[word]},
        "first_moved": first,
        "alone": alone,
    }


@dataclass(frozen=True)
class CauseGroup:
    """Causes of one finding, those without one by their status; ``engines`` and ``count`` of all of them."""

    finding: str
    status: str
    engines: list[str]
    count: int
    causes: list[ranking.Cause]


def _grouped(causes: list[ranking.Cause]) -> list[CauseGroup]:
    """Known differences by the finding that they belong to, most checks first; the other causes one by one after them."""
    groups: dict[tuple[str, str], list[ranking.Cause]] = {}
    for cause in causes:
        finding = str(cause.worst["finding"] or "") if cause.status == "known-difference" else ""
        groups.setdefault((finding, "" if finding else f"{cause.status} {cause.text}"), []).append(cause)
    found = [
        CauseGroup(
            finding=finding,
            status=members[0].status,
            engines=list(dict.fromkeys(name for cause in members for name in cause.engines)),
            count=sum(cause.count for cause in members),
            causes=members,
        )
        for (finding, _), members in groups.items()
    ]
    return sorted(found, key=lambda group: (not group.finding, -group.count))


def errata_page(env: Environment, panel: Panel) -> str:
    """Claims of the source that are contradicted."""
    return env.get_template("errata.html").render(root="", errata=errata(panel), measured=measured_statement)


def statuses_page(env: Environment) -> str:
    """What statuses and other verdicts mean; the footer of every page leads here."""
    return env.get_template("statuses.html").render(root="")


def case_page(env: Environment, panel: Panel, case: CaseData, drawn: dict[str, Any]) -> str:
    """A case; ``drawn`` holds its figures and difference tables, as `CaseDrawing.values` gives them."""
    rows = drawn["tables"].rows
    cells, facts = _by(case.cells, "engine"), citation.caption_facts(panel, case)
    return env.get_template("case.html").render(
        root="../",
        case=case,
        cases=panel.cases,
        engines=panel.engines,
        worst=rows[0] if rows else None,
        fine=bool(rows) and rows[0]["ratio"] <= 1.0,
        ranking=ranking.rank(panel, case),
        causes=ranking.causes(panel, drawn["tables"].gaps),
        example=ranking.example,
        percent=ranking.percent,
        caption_facts=facts,
        caption_json=json.dumps(facts),
        cite=citation.cite(panel),
        shown=SHOWN,
        open_groups=OPEN_GROUPS,
        claims=_claims(panel, case.claims),
        cell_groups=[(panel.engines[key[0]], cell_groups(group)) for key, group in cells.items()],
        **drawn,
    )


def engine_page(
    env: Environment, panel: Panel, engine: EngineFacts, overall: Use, speed: Chart | None, stock: Both | None = None
) -> str:
    """An engine: how wrong and how fast it is, what it does well, what otherwise, what was never asked of it.

    ``overall`` is the use that has all headlines, ``speed`` the engine's chart of accuracy against speed, ``stock`` its
    worst headlines at its own settings and tuned.
    """
    mine = [row for row in panel.measurements if row["engine"] == engine.id]
    rated = _by(mine, "case", "variant")
    lines, groups = [], []
    for case in panel.cases.values():
        cells = [cell for cell in case.cells if cell["engine"] == engine.id]
        if cells:
            groups.append((case, cell_groups(cells)))
        for cell in cells:
            reported = [
                row for row in case.headlines if (row["variant"], row["engine"]) == (cell["variant"], engine.id)
            ]
            summary = summarise([cell], rated.get((case.id, cell["variant"]), []))
            lines.append((case, cell, summary, worst_headline(reported)))
    lines.sort(key=lambda line: (-as_float(line[3]["rel_error"]) if line[3] else 1.0, _worst_ratio(line[2])))
    ranked = standings(panel, engine.id)
    first = [each for each in ranked if each.rank == 1 and engine.id not in each.case.wrong]
    differences = _by([row for row in mine if row["status"] == "known-difference"], "reason")
    findings = [each for each in of_engines(panel.stored) if each.engine == engine.id]
    return env.get_template("engine.html").render(
        root="../",
        engine=engine,
        lines=lines,
        cell_groups=groups,
        speed=speed,
        stock=stock,
        tuning=of_tuned(panel, engine.id),
        overall=overall,
        rank=next((rank for rank in (*overall.ranks, *overall.little) if rank.engine == engine), None),
        declared=bool(findings) and not (ranked and ranked[-1].error > findings[0].size),
        ranked=ranked,
        n_near=sum(each.error <= AGREES for each in ranked),
        n_first=len(first),
        well=[each for each in first if each.error <= AGREES and each.of > 1],
        otherwise=[each for each in reversed(ranked) if each.error > AGREES],
        listed=LISTED,
        siblings=[other for other in panel.engines.values() if other != engine and other.program == engine.program],
        findings=findings,
        differences=[(reason, rows) for (reason,), rows in differences.items()],
        determinism=[row for row in panel.stored.determinism if row["engine"] == engine.id],
        kinds=DETERMINISM_KINDS,
        worse=worse_than_promised,
        n_passed=sum(row["status"] == "pass" for row in mine),
        wide=sorted(filter(is_wide, mine), key=lambda row: -row["share"]),
        asked=without_headline(panel, engine),
        uses=USES,
        none_known=math.nan,
    )


def _worst_ratio(summary: Summary | None) -> float:
    """Sorts by error over tolerance, the largest first, what was not measured last."""
    return -summary.ratio if summary and summary.worst else 1.0


def cell_groups(cells: list[Row]) -> list[CellGroup]:
    """Cells joined where status, support, reason, notes and settings agree."""
    columns = ("status", "support", "reason", "missing", "notes", "settings")
    return [
        CellGroup(
            status=key[0],
            support=key[1],
            reason=key[2],
            missing=[str(item) for item in text.decoded(key[3], list)],
            notes=[str(item) for item in text.decoded(key[4], list)],
            settings={str(k): _plain(v) for k, v in text.decoded(key[5], dict).items()},
            cells=members,
        )
        for key, members in _by(cells, *columns).items()
    ]


def provenance(run: Row) -> list[tuple[str, str]]:
    """Date, command and every recorded fact of the newest run."""
    facts = run["provenance"] if isinstance(run["provenance"], dict) else {"provenance": run["provenance"]}
    known = [("date", _plain(run["started"])), ("command", _run(run)["argv"])]
    return known + [(str(name), _plain(value)) for name, value in facts.items() if value not in ("", None)]


def _run(run: Row) -> Row:
    facts = run["provenance"] if isinstance(run["provenance"], dict) else {}
    argv = run["argv"] if isinstance(run["argv"], list) else [run["argv"]]
    return {**run, "commit": str(facts.get("commit") or "")[:19], "argv": " ".join(str(word) for word in argv)}


def _all_claims(panel: Panel) -> list[Row]:
    return [claim for case in panel.cases.values() for claim in case.claims]


def _claims(panel: Panel, claims: list[Row]) -> list[Row]:
    """Claims joined over the engines of one verdict, contradicted ones first."""
    order = {"contradicted": 0, "undecided": 1, "confirmed": 2}
    joined = []
    for key, rows in _by(claims, "claim", "case", "verdict").items():
        names = [panel.engines[row["engine"]].name if row["engine"] in panel.engines else row["engine"] for row in rows]
        evidence = dict.fromkeys(row["evidence"] for row in rows if row["evidence"])
        if len(evidence) > 1:
            evidence = dict.fromkeys(
                f"{name}: {row['evidence']}" for name, row in zip(names, rows, strict=True) if row["evidence"]
            )
        engines = [name for name in dict.fromkeys(names) if name]
        joined.append({**rows[0], "verdict": key[2], "engines": engines, "evidence": list(evidence)})
    return sorted(joined, key=lambda claim: (order.get(claim["verdict"], 1), claim["case"], claim["claim"]))


def _by(rows: Iterable[Row], *columns: str) -> dict[tuple[str, ...], list[Row]]:
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[column] for column in columns), []).append(row)
    return groups


def _variant(name: str) -> Markup:
    """A variant's id with short numbers and places after its commas where it may wrap."""
    return Markup(",<wbr>").join(text.short_variant(name).split(","))


def _plain(value: Any) -> str:
    """A recorded fact on one line."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {_plain(item)}" for name, item in value.items())
    if isinstance(value, list):
        return ", ".join(_plain(item) for item in value)
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


@dataclass(frozen=True)
class Statement:
    """One quantity that the source states, beside what the better truth and the engines give."""

    quantity: str
    unit: str
    where: str
    stated: float
    follows: float
    middle: float
    lowest: float
    highest: float
    engines: int


@dataclass(frozen=True)
class Erratum:
    """A claim with at least one contradiction; ``everywhere``: no engine confirms it."""

    claim: Row
    case: CaseData
    contradicted: dict[str, list[str]]  # engines by evidence
    confirmed: list[str]
    undecided: list[str]
    everywhere: bool
    derivation: tuple[str, ...]
    statements: list[Statement]


def errata(panel: Panel) -> list[Erratum]:
    """Contradicted claims: those that no engine confirms first, then in the order of the records."""
    found = []
    for case in panel.cases.values():
        claims: dict[str, list[Row]] = {}
        for row in case.claims:
            claims.setdefault(row["claim"], []).append(row)
        for rows in claims.values():

            def engines(verdict: str, rows: list[Row] = rows) -> list[str]:
                held = [row["engine"] for row in rows if row["verdict"] == verdict]
                return [panel.engines[engine].name if engine in panel.engines else engine for engine in held]

            against = [row["evidence"] for row in rows if row["verdict"] == "contradicted"]
            if against:
                reported: dict[str, list[str]] = {}
                for engine, evidence in zip(engines("contradicted"), against, strict=True):
                    reported.setdefault(evidence, []).append(engine)
                confirmed = engines("confirmed")
                derivation = tuple(str(line) for line in text.decoded(rows[0]["derivation"], list))
                stated = [] if confirmed else _statements(case)
                undecided = engines("undecided")
                found.append(Erratum(rows[0], case, reported, confirmed, undecided, not confirmed, derivation, stated))
    return sorted(found, key=lambda erratum: not erratum.everywhere)


def _statements(case: CaseData) -> list[Statement]:
    """Published numbers of a case that the better truth of the same variant and quantity contradicts."""
    best: dict[tuple[str, str], float] = {}
    for row in case.measurements:
        if row["norm"] == "scalar" and row["truth"] == "analytic" and math.isfinite(as_float(row["expected"])):
            best[row["variant"], row["quantity"]] = as_float(row["expected"])
    held: dict[tuple[str, str, float, float], tuple[dict[str, Any], list[float], set[str]]] = {}
    for row in case.measurements:
        stated, follows = as_float(row["expected"]), best.get((row["variant"], row["quantity"]), math.nan)
        apart = abs(stated - follows) > max(as_float(row["uncertainty"]) or 0.0, 1e-9 * abs(follows))
        if row["truth"] == "published" and row["status"] == "known-gap" and math.isfinite(follows) and apart:
            mu = {k: v for k, v in case.variants[row["variant"]].items() if k == "mu"}
            key = row["quantity"], parameters(mu, mu), stated, follows
            _, values, engines = held.setdefault(key, (row, [], set()))
            if math.isfinite(as_float(row["value"])):
                values.append(as_float(row["value"]))
                engines.add(row["engine"])
    return [
        Statement(key[0], row["unit"], key[1], key[2], key[3], median(values), min(values), max(values), len(engines))
        for key, (row, values, engines) in held.items()
        if values
    ]


def measured_statement(statement: Statement) -> str:
    """Median of what the engines gave, and its span."""
    low, high = number(statement.lowest), number(statement.highest)
    return low if low == high else f"{number(statement.middle)} ({low} … {high})"
