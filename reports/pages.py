"""The HTML: templates with everything escaped, and the values that each kind of page shows.

Claims of the source that measurements contradict: what it says, what follows instead, and what engines give.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ninedisk.harness.results.schema import Row
from ninedisk.reports import citation, ranking, text
from ninedisk.reports.charts import Chart
from ninedisk.reports.model import SHOWN, CaseData, EngineFacts, Panel, Summary, summarise
from ninedisk.reports.text import as_float, number, pair_shade, parameters, shade, symbol

HERE = Path(__file__).parent

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
        "css": lambda word: re.sub(r"[^a-z-]", "", str(word)),
    }
    env.globals |= {
        "pips": text.SUPPORT_PIPS,
        "support_meaning": text.SUPPORT_MEANING,
        "status_meaning": text.STATUS_MEANING,
        "shades": text.SHADES,
        "pair_shades": text.PAIR_SHADES,
        "nothing": text.NOTHING,
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


def index_page(env: Environment, panel: Panel) -> str:
    """The overview: cases and engines with the worst error come first."""
    rows, gaps = panel.open_rows(), panel.gap_rows()
    by_cell = _by(panel.measurements, "case", "engine")
    squares: dict[tuple[str, str], Summary | None] = {}
    for case in panel.cases.values():
        cells = _by(case.cells, "engine")
        for name in panel.engines:
            squares[case.id, name] = summarise(cells.get((name,), []), by_cell.get((case.id, name), []))

    def worst(*, case: str = "", engine: str = "") -> tuple[float, int]:
        mine = [s for (c, e), s in squares.items() if s and (c == case or e == engine)]
        return -max((s.ratio for s in mine if s.worst), default=-1.0), -sum(s.ran for s in mine)

    engines = sorted(panel.engines.values(), key=lambda engine: worst(engine=engine.id))
    cases = sorted(panel.cases.values(), key=lambda case: worst(case=case.id))
    found = errata(panel)
    return env.get_template("index.html").render(
        root="",
        engines=panel.engines,
        columns=engines,
        cases=panel.cases,
        matrix=[(case, [squares[case.id, engine.id] for engine in engines]) for case in cases],
        open_rows=rows,
        worst_pairs=panel.worst_of_pairs(),
        gap_rows=gaps,
        unfinished=panel.unfinished(),
        n_failed=sum(row["ratio"] > 1.0 for row in rows),
        n_rated=len(rows),
        fine=not panel.unfinished() and all(row["ratio"] <= 1.0 for row in rows),
        errata=found,
        n_claims=len(_all_claims(panel)),
        provenance=provenance(panel.stored.runs[0]) if panel.stored.runs else [],
        runs=[_run(run) for run in panel.stored.runs],
        outdated=panel.stored.outdated,
    )


def errata_page(env: Environment, panel: Panel) -> str:
    """Claims of the source that are contradicted."""
    return env.get_template("errata.html").render(root="", errata=errata(panel), measured=measured)


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


def engine_page(env: Environment, panel: Panel, engine: EngineFacts, speed: Chart | None) -> str:
    """An engine; ``speed`` is its chart of accuracy against speed."""
    rated = _by([row for row in panel.measurements if row["engine"] == engine.id], "case", "variant")
    lines, groups = [], []
    for case in panel.cases.values():
        cells = [cell for cell in case.cells if cell["engine"] == engine.id]
        if cells:
            groups.append((case, cell_groups(cells)))
        for cell in cells:
            lines.append((case, cell, summarise([cell], rated.get((case.id, cell["variant"]), []))))
    lines.sort(key=lambda line: -line[2].ratio if line[2] and line[2].worst else 1.0)
    return env.get_template("engine.html").render(
        root="../", engine=engine, lines=lines, cell_groups=groups, speed=speed
    )


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
                told: dict[str, list[str]] = {}
                for engine, evidence in zip(engines("contradicted"), against, strict=True):
                    told.setdefault(evidence, []).append(engine)
                confirmed = engines("confirmed")
                derivation = tuple(str(line) for line in text.decoded(rows[0]["derivation"], list))
                stated = [] if confirmed else _statements(case)
                undecided = engines("undecided")
                found.append(Erratum(rows[0], case, told, confirmed, undecided, not confirmed, derivation, stated))
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


def measured(statement: Statement) -> str:
    """Median of what the engines gave, and its span."""
    low, high = number(statement.lowest), number(statement.highest)
    return low if low == high else f"{number(statement.middle)} ({low} … {high})"
