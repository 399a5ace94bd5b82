"""The page of engines at their own settings: by use and by case, beside the tuned profile."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
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


class Profiles:
    """Headlines of engines at their own settings beside those of the tuned ones.

    Parameters
    ----------
    tuned : Panel
    stored : Stored
        Rows of engines at their own settings alone.
    """

    def __init__(self, tuned: Panel, stored: Stored) -> None:
        self.tuned, self.panel = tuned, build_panel(stored)
        self._rows: dict[str, list[Row]] = {}
        for row in (*self.panel.stored.headlines, *tuned.stored.headlines):
            self._rows.setdefault(row["engine"], []).append(row)

    def both(self, engine: str, wanted: Callable[[Row], bool] = lambda _: True) -> Both:
        """The worst wanted headlines of a stock engine, and of the tuned one on the variants that both ran."""
        own = [row for row in self._rows.get(engine, []) if wanted(row)]
        places = {(row["case"], row["variant"], row["headline"]) for row in own}
        others = [row for row in self._rows.get(engine.removesuffix(STOCK), []) if wanted(row)]
        shared = [row for row in others if (row["case"], row["variant"], row["headline"]) in places]
        return Both(worst_headline(own), worst_headline(shared if own else others))

    def of_tuned(self, engine: str) -> Both | None:
        """All headlines of an engine at its own settings, by the id of the tuned one; None where it has none."""
        found = self.both(f"{engine}{STOCK}")
        return found if found.stock else None

    def page(self, env: Environment) -> str:
        """The page that has all of them."""
        columns = list(self.panel.engines.values())
        of_use = [(use, [self.both(each.id, partial(_serves, use)) for each in columns]) for use in uses(self.panel)]
        of_case = [
            (case, [self.both(each.id, partial(_belongs, case)) for each in columns])
            for case in self.panel.cases.values()
        ]
        return env.get_template("stock.html").render(
            root="",
            columns=columns,
            uses=[(use, line) for use, line in of_use if use.id != "space" and any(each.stock for each in line)],
            cases=sorted((item for item in of_case if any(each.stock for each in item[1])), key=_farthest_first),
            pages=self.tuned.cases,
            settings=[(engine, _settings(self.panel, engine)) for engine in columns],
        )


def _serves(use: Use, row: Row) -> bool:
    return use.id in ("all", row["use"])


def _belongs(case: CaseData, row: Row) -> bool:
    return bool(row["case"] == case.id)


def _farthest_first(item: tuple[CaseData, list[Both]]) -> float:
    return -max(as_float(each.stock["rel_error"]) for each in item[1] if each.stock)


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
