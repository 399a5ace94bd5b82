"""The page of engines at their own settings: by use and by case, beside the tuned profile."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from jinja2 import Environment

from ninedisk.harness.results.schema import STOCK, Row
from ninedisk.reports.panel.headlines import worst_headline
from ninedisk.reports.panel.load import Stored
from ninedisk.reports.panel.model import CaseData, EngineFacts, Panel, build_panel
from ninedisk.reports.panel.text import as_float, decade, decoded
from ninedisk.reports.panel.uses import Use, uses


def by_profile(stored: Stored) -> tuple[Stored, Stored]:
    """What is stored of engines tuned by their adapters, and of engines at their own settings."""

    def part(keep: Iterable[bool], of: str) -> Any:
        return [row for row, kept in zip(getattr(stored, of), keep, strict=True) if kept]

    def only(stock: bool) -> Stored:
        rows = {
            name: part((row["engine"].endswith(STOCK) is stock for row in getattr(stored, name)), name)
            for name in ("cells", "measurements", "headlines", "claims")
        }
        series = {key: curve for key, curve in stored.series.items() if key[2].endswith(STOCK) is stock}
        return replace(stored, series=series, **rows)

    return only(False), only(True)


@dataclass(frozen=True)
class Both:
    """Worst headline of an engine at its own settings and tuned; None where there is none."""

    stock: Row | None
    tuned: Row | None

    @property
    def decade(self) -> int:
        """Of the error at its own settings, as its colour has it."""
        return int(decade(as_float(self.stock["rel_error"]))[1:]) if self.stock else 0


def _shared(rows: Iterable[Row], others: Iterable[Row]) -> Both:
    """The worst rows of the places that both profiles have a number on."""
    held, beside = list(rows), list(others)
    known = {(row["case"], row["variant"], row["headline"]) for row in beside}
    return Both(
        worst_headline(held),
        worst_headline(row for row in beside if not held or (row["case"], row["variant"], row["headline"]) in known),
    )


def stock_page(env: Environment, tuned: Panel, stored: Stored) -> str:
    """Write the page; ``stored`` are the rows of engines at their own settings."""
    panel = build_panel(stored)
    beside = {name: name.removesuffix(STOCK) for name in panel.engines}
    stock_rows, tuned_rows = _by_engine(panel), _by_engine(tuned)
    found = {use.id: use for use in uses(panel)}
    of_use = [
        (use, [_of_use(use, engine, stock_rows, tuned_rows, beside) for engine in panel.engines])
        for use in found.values()
    ]
    of_case = [
        (case, [_of_case(case, engine, stock_rows, tuned_rows, beside) for engine in panel.engines])
        for case in panel.cases.values()
    ]
    ran = [(case, line) for case, line in of_case if any(each.stock for each in line)]
    return env.get_template("stock.html").render(
        root="",
        columns=list(panel.engines.values()),
        tuned=tuned.engines,
        beside=beside,
        uses=[(use, line) for use, line in of_use if any(each.stock for each in line)],
        cases=sorted(ran, key=lambda item: -max(as_float(each.stock["rel_error"]) for each in item[1] if each.stock)),
        pages=tuned.cases,
        settings=[(engine, _settings(panel, engine)) for engine in panel.engines.values()],
    )


def _by_engine(panel: Panel) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in panel.stored.headlines:
        found.setdefault(row["engine"], []).append(row)
    return found


def _in_use(use: Use, row: Row) -> bool:
    return use.id in ("all", row["use"])


def _of_use(
    use: Use, engine: str, stock: Mapping[str, list[Row]], tuned: Mapping[str, list[Row]], beside: Mapping[str, str]
) -> Both:
    own = [row for row in stock.get(engine, []) if _in_use(use, row)]
    return _shared(own, [row for row in tuned.get(beside[engine], []) if _in_use(use, row)])


def _of_case(
    case: CaseData,
    engine: str,
    stock: Mapping[str, list[Row]],
    tuned: Mapping[str, list[Row]],
    beside: Mapping[str, str],
) -> Both:
    own = [row for row in stock.get(engine, []) if row["case"] == case.id]
    return _shared(own, [row for row in tuned.get(beside[engine], []) if row["case"] == case.id])


def _settings(panel: Panel, engine: EngineFacts) -> dict[str, str]:
    """Settings of all its cells by name: the one value, or the smallest and the largest of numbers; others that differ are left out."""
    held: dict[str, dict[str, Any]] = {}
    for case in panel.cases.values():
        for cell in case.cells:
            if cell["engine"] == engine.id and cell["settings"]:
                for name, value in decoded(cell["settings"], dict).items():
                    held.setdefault(name, {})[str(value)] = value
    return {name: shown for name, values in sorted(held.items()) if (shown := _shown(list(values.values())))}


def _shown(values: Sequence[Any]) -> str:
    if len(values) == 1:
        return str(values[0])
    if all(isinstance(value, int | float) for value in values):
        return f"{min(values):g} to {max(values):g}"
    return ""
