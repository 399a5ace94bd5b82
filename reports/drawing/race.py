"""The race of contact solvers on the open set: shares solved, performance profiles, hardest problems; from rows of a benchmark record."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ninedisk.reports.drawing.charts import Dots, PointChart, engine_looks
from ninedisk.reports.panel.text import as_float

Row = Mapping[str, Any]
RULES = {"coulomb": "Coulomb's law", "associated": "Associated rule"}
FACTORS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1_000.0)
"""Of the best time, at which the profiles are drawn."""
PROFILES = {"coulomb": (1e-3, 1e-8, 1e-12), "associated": (1e-8,)}
"""Targets by rule; one that was not raced has no chart."""
MOST_SINGLE = 3
"""Families of one problem each that are shown as families."""
TARGET = 1e-8
"""Of the tables and charts over sizes and families."""
MOST_PROBLEMS = 60


@dataclass(frozen=True)
class Standing:
    """A solver in the table of shares: of all problems, by target; problems at `TARGET` where it is the fastest one.

    ``claimed`` are answers that it calls solved and that miss the loosest target.
    """

    engine: str
    version: str
    problems: int
    shares: tuple[float, ...]
    median_s: float
    fastest: int
    claimed: int
    absent: str


@dataclass(frozen=True)
class Race:
    """All that the page says of one rule."""

    rule: str
    title: str
    targets: tuple[float, ...]
    charts: tuple[PointChart, ...]
    standings: tuple[Standing, ...]
    families: tuple[tuple[str, int, tuple[float, ...]], ...]
    hardest: tuple[tuple[str, int, tuple[tuple[float, float], ...]], ...]
    more: int
    limit: float
    repeats: int


def races(rows: Iterable[Row], suite: str) -> list[Race]:
    """What there is to say of each rule in a suite of contact problems."""
    held = [row for row in rows if row["suite"] == suite]
    return [_race(rule, own) for rule in RULES if (own := [row for row in held if row["start"] == rule])]


def _race(rule: str, rows: Sequence[Row]) -> Race:
    targets = tuple(sorted({float(row["tolerance"]) for row in rows}, reverse=True))
    engines = {row["engine"]: row["engine"] for row in rows}
    problems = {row["problem"]: int(row["contacts"]) for row in rows}
    times = {
        (row["engine"], row["problem"], float(row["tolerance"])): as_float(row["median_s"])
        for row in rows
        if row["status"] == "pass"
    }
    # Best first in tables and legends: by the share at all targets together.
    order = sorted(engines, key=lambda engine: -sum(each == engine for each, _, _ in times))
    target = TARGET if TARGET in targets else targets[-1]
    met = {(engine, problem): _tightest(times, engine, problem, targets) for engine in order for problem in problems}
    # Worst first: what the first solver, ours if it leads, solves least of; then what all the others do.
    missed = sorted(
        (problem for problem in problems if any(met[engine, problem][0] > target for engine in order)),
        key=lambda problem: ([-met[engine, problem][0] for engine in order], -problems[problem]),
    )
    return Race(
        rule=rule,
        title=RULES[rule],
        targets=targets,
        charts=_charts(rule, rows, order, problems, times, targets),
        standings=tuple(_standing(engine, rows, problems, times, targets, target) for engine in order),
        families=_families(rows, order, times, target),
        hardest=tuple(
            (problem, problems[problem], tuple(met[each, problem] for each in order))
            for problem in missed[:MOST_PROBLEMS]
        ),
        more=max(0, len(missed) - MOST_PROBLEMS),
        limit=max((as_float(json.loads(row["settings"])["time limit [s]"]) for row in rows), default=math.nan),
        repeats=max(int(row["repeats"]) for row in rows),
    )


Times = Mapping[tuple[str, str, float], float]


def _standing(
    engine: str, rows: Sequence[Row], problems: Mapping[str, int], times: Times, targets: Sequence[float], target: float
) -> Standing:
    own = [row for row in rows if row["engine"] == engine]
    best = _best(times, target)
    mine = {problem: seconds for (name, problem, t), seconds in times.items() if name == engine and t == target}
    claims = {row["problem"] for row in own if json.loads(row["settings"]).get("claimed")}
    return Standing(
        engine=engine,
        version=own[0]["engine_version"],
        problems=len(problems),
        shares=tuple(sum((engine, problem, t) in times for problem in problems) / len(problems) for t in targets),
        median_s=statistics.median(mine.values()) if mine else math.nan,
        fastest=sum(seconds <= best[problem] for problem, seconds in mine.items()),
        claimed=len(claims),
        absent=next((row["reason"] for row in own if row["status"] == "not-installed"), ""),
    )


def _tightest(times: Times, engine: str, problem: str, targets: Sequence[float]) -> tuple[float, float]:
    """The tightest target that a solver meets, infinite where it meets none, and its time."""
    found = [(t, times[engine, problem, t]) for t in targets if (engine, problem, t) in times]
    return min(found, default=(math.inf, math.nan))


def _best(times: Times, target: float) -> dict[str, float]:
    """Shortest time of each problem that any solver solves to a target."""
    found: dict[str, float] = {}
    for (_, problem, t), seconds in times.items():
        if t == target:
            found[problem] = min(seconds, found.get(problem, math.inf))
    return found


def _families(
    rows: Sequence[Row], order: Sequence[str], times: Times, target: float
) -> tuple[tuple[str, int, tuple[float, ...]], ...]:
    """Family, number of its problems and shares solved, by solver; the family least solved first. Files by many hands have none."""
    members: dict[str, set[str]] = {}
    for row in rows:
        members.setdefault(str(row["problem"]).partition("-")[0], set()).add(row["problem"])
    if sum(len(its) == 1 for its in members.values()) > 0.5 * len(members) and len(members) > MOST_SINGLE:
        return ()
    found = [
        (
            name,
            len(its),
            tuple(sum((engine, problem, target) in times for problem in its) / len(its) for engine in order),
        )
        for name, its in members.items()
    ]
    return tuple(sorted(found, key=lambda each: sum(each[2])))


def _charts(
    rule: str,
    rows: Sequence[Row],
    order: Sequence[str],
    problems: Mapping[str, int],
    times: Times,
    targets: Sequence[float],
) -> tuple[PointChart, ...]:
    looks = engine_looks({engine: engine for engine in order})

    def lines(points: Mapping[str, Sequence[tuple[float, float]]]) -> tuple[Dots, ...]:
        return tuple(
            Dots(engine, looks[engine], *(tuple(axis) for axis in zip(*points[engine], strict=True)))  # type: ignore[arg-type]
            for engine in order
            if points[engine]
        )

    def share(engine: str, some: Iterable[str], target: float) -> float:
        held = list(some)
        return 100.0 * sum((engine, problem, target) in times for problem in held) / len(held)

    title = RULES[rule]
    solved = {engine: [(t, share(engine, problems, t)) for t in sorted(targets)] for engine in order}
    low = min(y for points in solved.values() for _, y in points)
    edges = (0.6 * min(targets), 1.7 * max(targets))
    charts = [
        PointChart(
            f"{title}: solved to a tolerance",
            "largest error allowed",
            "% of the problems",
            lines(solved),
            y_log=False,
            limits=(edges, _percent(low)),
        )
    ]
    for target in PROFILES[rule]:
        best = _best(times, target)
        if not best:
            continue
        slower = {
            engine: [times.get((engine, problem, target), math.inf) / least for problem, least in best.items()]
            for engine in order
        }
        profile = {
            engine: [
                (factor, 100.0 * sum(each <= factor for each in slower[engine]) / len(problems)) for factor in FACTORS
            ]
            for engine in order
        }
        charts.append(
            PointChart(
                f"{title}: performance profile, {target:g}",
                "factor of the shortest time",
                "% of the problems",
                lines(profile),
                y_log=False,
                limits=((0.9, 1.2 * FACTORS[-1]), _percent(0.0)),
            )
        )
    target = TARGET if TARGET in targets else targets[-1]
    sizes: dict[int, set[str]] = {}
    for row in rows:
        sizes.setdefault(int(row["disks"]), set()).add(row["problem"])
    if len(sizes) > 1:
        by_size = {
            engine: [(float(n), share(engine, its, target)) for n, its in sorted(sizes.items())] for engine in order
        }
        worst = min(y for points in by_size.values() for _, y in points)
        charts.append(
            PointChart(
                f"{title}: solved to {target:g}, over size", "disks", "% of the problems", lines(by_size), y_log=False,
                limits=((0.7 * min(sizes), 1.5 * max(sizes)), _percent(worst)),
            )
        )  # fmt: skip
        spent = {
            engine: [
                (float(n), statistics.median(held))
                for n, its in sorted(sizes.items())
                if (held := [times[engine, p, target] for p in its if (engine, p, target) in times])
            ]
            for engine in order
        }
        if any(spent.values()):
            charts.append(PointChart(f"{title}: time to {target:g}, where solved", "disks", "median [s]", lines(spent)))
    return tuple(charts)


def _percent(low: float) -> tuple[float, float]:
    """Limits of an axis of percents that begins below ``low``, at a ten."""
    return (max(0.0, 10.0 * ((low - 5.0) // 10.0)), 103.0)
