"""What the headlines of a store report: errors relative to the case's own scale, ranks of engines, where they disagree.

An error counts on a headline as the largest over the variants that ran. Ranks compare what is comparable: of two engines the errors on
the variants that both have a number on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import median

from ninedisk.harness.results.schema import ROUND_OFF, Row
from ninedisk.reports.panel.model import NOT_RUN, CaseData, EngineFacts, Panel
from ninedisk.reports.panel.text import as_float, decoded

AGREES = 0.01
"""Relative error up to which an engine is said to agree with the truth."""


@dataclass(frozen=True)
class Rating:
    """An engine on a case by its headlines: the worst row, and how many have a number of how many that have a truth."""

    worst: Row | None
    rated: int
    of: int

    @property
    def error(self) -> float:
        """Largest relative error; NaN where nothing is rated."""
        return as_float(self.worst["rel_error"]) if self.worst else math.nan

    @property
    def partly(self) -> bool:
        """Whether some headline of some variant has no number although something was rated or should have been."""
        return 0 < self.rated < self.of


@dataclass(frozen=True)
class Standing:
    """An engine on one headline: its worst row, and its rank among ``of`` comparable engines (round-off apart ranks alike).

    Engines that fail a check of the case rank after all others.
    """

    case: CaseData
    row: Row
    error: float
    rank: int
    of: int


@dataclass(frozen=True)
class Disagreement:
    """The variant of a headline on which engines lie farthest apart, in parts of its scale; ``near`` agree with the truth."""

    case: CaseData
    low: Row
    high: Row
    apart: float
    middle: float
    near: int
    engines: int


def has_truth(row: Row) -> bool:
    """Whether the continuous problem says something about a headline."""
    return not math.isnan(as_float(row["expected"]))


def has_number(row: Row) -> bool:
    """Whether a headline has an error; an infinite one counts."""
    return not math.isnan(as_float(row["rel_error"]))


def worst_headline(rows: Iterable[Row]) -> Row | None:
    """The row of the largest relative error; None of rows without a number."""
    return max((row for row in rows if has_number(row)), key=lambda row: as_float(row["rel_error"]), default=None)


def ratings(case: CaseData) -> dict[str, Rating]:
    """How each engine that ran stands on a case.

    What counts as missing is what another engine has a truth for; a variant that sets what an engine does not have is none of
    its business (such a cell is refused before its support is asked for).
    """
    places = {(row["variant"], row["headline"]) for row in case.headlines if has_truth(row)}
    found = {}
    for engine in {cell["engine"] for cell in case.cells if cell["status"] not in NOT_RUN}:
        foreign = {
            cell["variant"]
            for cell in case.cells
            if cell["engine"] == engine and cell["status"] == "unsupported" and not cell["support"]
        }
        rows = [row for row in case.headlines if row["engine"] == engine and has_number(row)]
        of = sum(variant not in foreign for variant, _ in places)
        found[engine] = Rating(worst_headline(rows), len(rows), of)
    return found


def standings(panel: Panel, engine: str) -> list[Standing]:
    """An engine on every headline that it has a number for, smallest error first."""
    found = []
    for case in panel.cases.values():
        names = dict.fromkeys(row["headline"] for row in case.headlines if row["engine"] == engine and has_number(row))
        for name in names:
            held: dict[str, dict[str, Row]] = {}
            for row in case.headlines:
                if row["headline"] == name and has_number(row):
                    held.setdefault(row["engine"], {})[row["variant"]] = row
            own = held[engine]
            worst = worst_headline(own.values())
            assert worst is not None
            rivals = [(other, rows) for other, rows in held.items() if other != engine and own.keys() & rows.keys()]
            mine = engine in case.wrong
            better = sum(
                (other in case.wrong, _largest(rows, own)) < (mine, _largest(own, rows)) for other, rows in rivals
            )
            found.append(Standing(case, worst, as_float(worst["rel_error"]), 1 + better, 1 + len(rivals)))
    return sorted(found, key=lambda standing: (standing.error, standing.rank))


def _largest(rows: Mapping[str, Row], shared: Mapping[str, Row]) -> float:
    """Largest error of an engine on the variants that another one has a number on as well, round-off at least."""
    return max(ROUND_OFF, *(as_float(row["rel_error"]) for variant, row in rows.items() if variant in shared))


def disagreements(panel: Panel) -> list[Disagreement]:
    """Of each case the headline and variant on which engines lie farthest apart, the largest first.

    Compared are signed errors over the headline's scale: what engines say of a series belongs to different steps.
    """
    found = []
    for case in panel.cases.values():
        held: dict[tuple[str, str], list[tuple[float, Row]]] = {}
        for row in case.headlines:
            signed = (as_float(row["value"]) - as_float(row["expected"])) / as_float(row["scale"])
            if math.isfinite(signed):
                held.setdefault((row["headline"], row["variant"]), []).append((signed, row))
        worst: Disagreement | None = None
        for pairs in held.values():
            pairs.sort(key=lambda pair: pair[0])
            (low, least), (high, most) = pairs[0], pairs[-1]
            if len(pairs) > 1 and (worst is None or high - low > worst.apart):
                near = sum(abs(signed) <= AGREES for signed, _ in pairs)
                worst = Disagreement(case, least, most, high - low, median(s for s, _ in pairs), near, len(pairs))
        if worst is not None and worst.apart > 0.0:
            found.append(worst)
    return sorted(found, key=lambda each: -each.apart)


def slower_than_fastest(case: CaseData) -> dict[str, float]:
    """Stepping time of each engine over that of the fastest one on the same variant, geometric mean over the variants."""
    times = [(cell["variant"], cell["engine"], as_float(cell["advance_s"])) for cell in case.cells]
    times = [each for each in times if each[2] > 0.0 and math.isfinite(each[2])]
    fastest: dict[str, float] = {}
    for variant, _, time in times:
        fastest[variant] = min(time, fastest.get(variant, math.inf))
    logs: dict[str, list[float]] = {}
    for variant, engine, time in times:
        logs.setdefault(engine, []).append(math.log(time / fastest[variant]))
    return {engine: math.exp(sum(each) / len(each)) for engine, each in logs.items()}


def without_headline(panel: Panel, engine: EngineFacts) -> tuple[list[str], list[str]] | None:
    """Capabilities that an engine declares and no cell that it ran asked for, and those that some cell did; None where not stored."""
    cells = [cell for case in panel.cases.values() for cell in case.cells if cell["engine"] == engine.id]
    declared = {str(word) for cell in cells for word in decoded(cell["capabilities"], list)}
    ran = [cell for cell in cells if cell["status"] not in NOT_RUN]
    asked = {str(word) for cell in ran for word in decoded(cell["asked"], list)}
    return (sorted(declared - asked), sorted(declared & asked)) if declared and ran else None
