"""Which engine for what: of everything and of each use the engines by headline error, and by the time that an error of 1 % takes them.

The figure of an engine is its *worst* headline error in a use, not a mean. A mean of decades hides one result that is off by half
behind nine that are exact, and who takes the engine meets that one as well; which headline it is, is given beside. Engines are compared on
what they share: of a headline the variants count that two engines or more have a number on (all, where only one engine has any), so that
settings that one engine alone has neither spoil nor save it. What an engine covers is the share of these variants that it has a number on,
mean over the headlines; one that covers less than half of a use, as one that knows plastic impacts only, stands apart and is neither the
most accurate nor the fastest nor the farthest. One that fails a check of a case of the use, or breaks in it, ranks after all that pass
there, and is neither the most accurate nor the fastest. A variant that an engine does not support leaves no number and is covered by
others alone.

Time at 1 % is that of stepping: between two stored steps by the logarithms, of the largest step where that is good enough
(`ninedisk.reports.panel.ranking.time_at`). Absolute times depend on the case; an engine's figure is the geometric mean, over all it
reaches, of its time over that of the fastest engine there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from ninedisk.harness.results.schema import ROUND_OFF, USES, Row
from ninedisk.reports.panel.headlines import has_number
from ninedisk.reports.panel.model import STEPS, EngineFacts, Panel
from ninedisk.reports.panel.ranking import EQUAL, percent, time_at
from ninedisk.reports.panel.text import as_float, decade, decoded, factor_text

LITTLE = 0.5
"""What an engine has to cover of a use to be ranked."""

OVERALL = {"all": "everything", "space": "all of spheres in space"}
"""Uses of all headlines, whatever use each of them names; that in space where a store has both."""

Place = tuple[str, str]
"""Case and headline."""


@dataclass(frozen=True)
class Rank:
    """An engine in a use.

    Attributes
    ----------
    engine : EngineFacts
    worst : dict
        The headline row with the largest relative error.
    typical : float
        Median over the headlines of the use.
    rated : int
        Headlines of the use that it has a number on.
    covers : float
        Share of the variants that it has a number on, mean over the headlines of the use.
    slower : float
        Time at an error of 1 % over that of the fastest engine, geometric mean; NaN where none is known.
    reached, timed : int
        On how many series of steps it comes to 1 %, of how many that it ran and some engine does so on.
    wrong : int
        Cases of the use on which a check fails or a cell breaks.
    """

    engine: EngineFacts
    worst: Row
    typical: float
    rated: int
    covers: float
    slower: float
    reached: int
    timed: int
    wrong: int

    @property
    def error(self) -> float:
        """Largest relative headline error."""
        return as_float(self.worst["rel_error"])

    @property
    def decade(self) -> int:
        """That error's decade, as its colour has it: 0 for round-off."""
        return int(decade(self.error)[1:])

    @property
    def measure(self) -> str:
        """The error as pages print it, all of round-off alike: engines tie that a reader could not distinguish by it."""
        return percent(max(self.error, ROUND_OFF))


@dataclass(frozen=True)
class Use:
    """A use with its engines, the most accurate first, of those within round-off the fastest; ``headlines`` is how many it has.

    ``little`` are engines that cover less than half of it.
    """

    id: str
    title: str
    headlines: int
    ranks: Sequence[Rank]
    little: Sequence[Rank]

    @property
    def best(self) -> Sequence[Rank]:
        """The ranked engines of the least error, all that tie; none where each of them fails a check."""
        return [rank for rank in self.right if rank.measure == self.right[0].measure]

    @property
    def right(self) -> Sequence[Rank]:
        """The ranked engines that fail no check."""
        return [rank for rank in self.ranks if not rank.wrong]

    @property
    def widest(self) -> Sequence[Rank]:
        """The ranked engines of the least error among those with a number on the most headlines, all that tie; none where `best` has it."""
        most = max((rank.rated for rank in self.right), default=0)
        reported = [rank for rank in self.right if rank.rated == most]
        return [
            rank
            for rank in reported
            if rank.measure == reported[0].measure
            if max(each.rated for each in self.best) < most
        ]

    @property
    def able(self) -> Sequence[Rank]:
        """The ranked engines that fail no check and come to 1 % wherever they were tried."""
        return [rank for rank in self.right if rank.timed and rank.reached == rank.timed]

    @property
    def fastest(self) -> Sequence[Rank]:
        """Those of `able` that take the least time, all whose factors print alike."""
        least = factor_text(min((rank.slower for rank in self.able), default=math.nan))
        return [rank for rank in self.able if factor_text(rank.slower) == least]

    @property
    def farthest(self) -> Sequence[Rank]:
        """The ranked engines of the largest error, all that tie; none where all of them do, as nobody is farther off than another.

        An engine counts as in `best`: with numbers on half of the use at least. What it does not support is no error.
        """
        least, most = (pick(self.ranks, key=lambda rank: rank.error, default=None) for pick in (min, max))
        if least is None or most is None or least.measure == most.measure:
            return []
        return [rank for rank in self.ranks if rank.measure == most.measure]

    def place(self, rank: Rank) -> int:
        """Place of a ranked engine; those that tie share one, and those that fail a check come last."""
        return 1 + [(other.wrong > 0, other.measure) for other in self.ranks].index((rank.wrong > 0, rank.measure))


def uses(panel: Panel) -> list[Use]:
    """Everything together, all in space, then every use of `schema.USES` in its order; one that no stored headline serves has no ranks.

    No case is large: what large scenes cost, and how deep disks overlap there, is measured by ``ninedisk bench flow``, whose
    records are no part of a store.

    Parameters
    ----------
    panel : Panel
        Its headlines, the cells' times, and the engines that are shown; others are left out.
    """
    took = {(cell["case"], cell["variant"], cell["engine"]): as_float(cell["advance_s"]) for cell in panel.stored.cells}
    rows = [row for row in panel.stored.headlines if row["engine"] in panel.engines and has_number(row)]
    within = {case.id for case in panel.cases.values() if case.in_space}
    chosen = {"all": rows, "space": [row for row in rows if row["case"] in within]}
    chosen |= {name: [row for row in rows if row["use"] == name] for name in USES}
    return [
        _use(name, title, chosen[name], took, panel)
        for name, title in (OVERALL | USES).items()
        if name != "space" or 0 < len(chosen[name]) < len(rows)
    ]


def _use(
    name: str,
    title: str,
    rows: Sequence[Row],
    took: Mapping[tuple[str, str, str], float],
    panel: Panel,
) -> Use:
    wrong = {case: panel.cases[case].wrong for case in {row["case"] for row in rows}}
    worst: dict[str, dict[Place, Row]] = {}
    covered: dict[str, float] = {}
    shared = _shared(rows)
    for place, variants in shared.items():
        for row in (row for group in variants for row in group):
            covered[row["engine"]] = covered.get(row["engine"], 0.0) + 1.0 / len(variants) / len(shared)
            own = worst.setdefault(row["engine"], {})
            if place not in own or row["rel_error"] > own[place]["rel_error"]:
                own[place] = row
    slower, tried = _times(rows, took)
    ranks = [
        Rank(
            engine=panel.engines[engine],
            worst=max(own.values(), key=lambda row: as_float(row["rel_error"])),
            typical=median(as_float(row["rel_error"]) for row in own.values()),
            rated=len(own),
            covers=covered[engine],
            slower=math.exp(sum(held) / len(held)) if (held := slower.get(engine, [])) else math.nan,
            reached=len(held),
            timed=tried.get(engine, 0),
            wrong=sum(engine in held for held in wrong.values()),
        )
        for engine, own in worst.items()
    ]
    ranks.sort(
        key=lambda rank: (
            rank.wrong > 0,
            max(rank.error, ROUND_OFF),
            math.inf if math.isnan(rank.slower) else rank.slower,
            rank.engine.name,
        )
    )
    enough = [rank for rank in ranks if rank.covers >= LITTLE]
    return Use(name, title, len(shared), enough, [rank for rank in ranks if rank.covers < LITTLE])


def _shared(rows: Iterable[Row]) -> dict[Place, list[list[Row]]]:
    """By headline the rows of each variant that two engines have a number on; of all its variants where one engine alone has any."""
    held: dict[Place, dict[str, list[Row]]] = {}
    for row in rows:
        held.setdefault((row["case"], row["headline"]), {}).setdefault(row["variant"], []).append(row)
    return {
        place: [group for group in variants.values() if len(group) > 1] or list(variants.values())
        for place, variants in held.items()
    }


def _times(
    rows: Iterable[Row], took: Mapping[tuple[str, str, str], float]
) -> tuple[dict[str, list[float]], dict[str, int]]:
    """By engine, logarithms of its times at 1 % over the fastest one's, and on how many series of steps it was tried.

    A series of steps is a headline on the variants that differ in the step alone; one on which no engine comes to 1 % says nothing.
    """
    held: dict[tuple[Place, str], dict[str, list[tuple[float, float, float]]]] = {}
    for row in rows:
        spent = took.get((row["case"], row["variant"], row["engine"]), math.nan)
        if not spent > 0.0:
            continue
        params = decoded(row["params"], dict)
        step = next((name for name in STEPS if isinstance(params.get(name), int | float)), "")
        others = repr(sorted((name, value) for name, value in params.items() if name != step))
        series = held.setdefault(((row["case"], row["headline"]), others), {})
        series.setdefault(row["engine"], []).append(
            (as_float(params.get(step, 0.0)), spent, as_float(row["rel_error"]))
        )
    slower: dict[str, list[float]] = {}
    tried: dict[str, int] = {}
    for series in held.values():
        at = {
            engine: time_at(EQUAL, [(spent, max(error, ROUND_OFF)) for _, spent, error in sorted(points)])[0]
            for engine, points in series.items()
        }
        least = min(at.values())
        if math.isinf(least):
            continue
        for engine, time in at.items():
            tried[engine] = tried.get(engine, 0) + 1
            if not math.isinf(time):
                slower.setdefault(engine, []).append(math.log(time / least))
    return slower, tried
