"""How far each engine of a case is from the physics: its headlines ranked, with order, time at 1 % and the reason in words.

Besides, known gaps joined by their cause.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ninedisk.harness.results.schema import ROUND_OFF, Row
from ninedisk.reports.panel.model import (
    NOT_TRIED,
    STEPS,
    SUPPORT,
    CaseData,
    EngineFacts,
    Panel,
    Summary,
    summarise,
    worst_first,
)
from ninedisk.reports.panel.text import NOTHING, as_float, decoded, error, number, seconds

EQUAL = 0.01
"""Relative error at which the engines' times are compared."""
SLACK = 1.005
"""What is shown as 1 % counts as 1 %: a scheme of first order that was given the step for it is off by the next order."""
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
_PRINT = re.compile(r"the [\w-]+ truth is \S+, the print says \S+ \((?P<law>.*)\)", re.DOTALL)


def percent(value: float) -> str:
    """A relative error in per cent; below a thousandth of one in decades, ``1e-9``; above ten as a factor; an infinite one is a number."""
    if not math.isfinite(value):
        return NOTHING if math.isnan(value) else "∞"
    if value == 0.0:
        return "0"
    if value < 1e-5:
        return error(value)
    return f"{100.0 * value:.2g} %" if value < 0.995 else f"{100.0 * value:.0f} %" if value < 10.0 else f"{value:.3g} ×"


@dataclass(frozen=True)
class Ranked:
    """One engine of a case.

    Parameters
    ----------
    engine, summary
        What it is, and how its checks went.
    worst : dict
        Row with the largest relative error of each headline, over the variants; headlines that it has no number of are left out.
    order : float
        Slope of ``log error`` over ``log step`` of the headline that decides; NaN without two steps above round-off.
    time : str
        Stepping time at an error of 1 %, in words.
    reasons : list of str
        Why it is where it is.
    """

    engine: EngineFacts
    summary: Summary
    worst: dict[str, Row]
    order: float
    time: str
    reasons: list[str]

    @property
    def decides(self) -> Row | None:
        """The row with the largest error of all headlines; None without any."""
        return max(self.worst.values(), key=lambda row: as_float(row["rel_error"]), default=None)

    @property
    def error(self) -> float:
        """Largest relative error of all headlines; NaN without any."""
        return as_float(self.decides["rel_error"]) if self.decides else math.nan

    @property
    def signal(self) -> float:
        """The error, no smaller than what counts as round-off."""
        return max(self.error, ROUND_OFF)

    @property
    def at_round_off(self) -> bool:
        """Whether the largest error is round-off."""
        return self.error <= ROUND_OFF


@dataclass(frozen=True)
class Ranking:
    """The engines of a case, closest to the physics first; ``headlines`` are a row for each of its headlines.

    Engines with a failing check or a broken cell (`Summary.wrong`) come after all others: a wrong engine can look accurate in a headline
    that its fault does not touch.
    """

    headlines: dict[str, Row]
    engines: list[Ranked]

    @property
    def measured(self) -> list[Ranked]:
        """Engines with a headline error."""
        return [ranked for ranked in self.engines if ranked.decides]

    @property
    def scales(self) -> dict[str, str]:
        """What the shown errors of each headline are relative to; variants may differ in it."""
        found: dict[str, dict[str, None]] = {name: {} for name in self.headlines}
        for ranked in self.measured:
            for name, row in ranked.worst.items():
                found[name][str(row["scale_is"])] = None
        return {name: " or ".join(words) or str(self.headlines[name]["scale_is"]) for name, words in found.items()}

    @property
    def closest(self) -> list[Ranked]:
        """The engines of the first place; none where a check fails on every engine."""
        return [ranked for ranked in self.measured if self.place(ranked) == 1 and not ranked.summary.wrong]

    @property
    def farthest(self) -> Ranked | None:
        """The engine with the largest error of a headline, whatever its checks say; None without any."""
        return max(self.measured, key=lambda ranked: ranked.error, default=None)

    @property
    def ran(self) -> list[Ranked]:
        """Engines that ran at least one variant."""
        return [ranked for ranked in self.engines if ranked.summary.ran]

    @property
    def absent(self) -> dict[str, list[Ranked]]:
        """Engines that ran none, by the first reason why, the commonest first."""
        found: dict[str, list[Ranked]] = {}
        for ranked in self.engines:
            if not ranked.summary.ran:
                found.setdefault(ranked.reasons[0] if ranked.reasons else ranked.summary.status, []).append(ranked)
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))

    def place(self, ranked: Ranked) -> int:
        """Place of an engine with a headline error, after all that pass if it fails a check; what is round-off shares one."""
        own = bool(ranked.summary.wrong), ranked.signal
        return 1 + sum((bool(other.summary.wrong), other.signal) < own for other in self.measured)


def rank(panel: Panel, case: CaseData) -> Ranking:
    """Order the engines of a case by their largest headline error.

    Without headlines (runs of an older schema) the largest error over tolerance decides.
    """
    rows = [row for row in panel.stored.headlines if row["case"] == case.id]
    engines = []
    for name in dict.fromkeys(cell["engine"] for cell in case.cells):
        cells = [cell for cell in case.cells if cell["engine"] == name]
        measurements = [row for row in case.measurements if row["engine"] == name]
        summary = summarise(cells, measurements)
        if summary is None:
            continue
        own = [row for row in rows if row["engine"] == name]
        worst: dict[str, Row] = {}
        for row in own:
            if not math.isnan(as_float(row["rel_error"])) and (
                row["headline"] not in worst or row["rel_error"] > worst[row["headline"]]["rel_error"]
            ):
                worst[row["headline"]] = row
        order, own_order, time = math.nan, False, NOTHING
        if worst:
            decides = max(worst.values(), key=lambda row: as_float(row["rel_error"]))
            same = [row for row in own if row["headline"] == decides["headline"]]
            order, own_order = _order(case, same, decides)
            time = _time(case, cells, same)
        far = [row["variant"] for row in worst.values() if row["rel_error"] > EQUAL]
        why = reasons(cells, measurements, far)
        if far and own_order and order >= 0.5:
            why.append(f"its error shrinks with the step, of order {order:.2g}")
        if far:
            found = [each for each in panel.stored.findings if (each.engine, each.case) == (name, case.id)]
            reported = [
                f"finding {each.id}: {each.what}"
                for each in found
                if each.size > EQUAL and not each.id.startswith("source/")
            ]
            why = reported + why
        if far and not why:
            why.append("nothing stored says why: no note, no known difference")
        engines.append(Ranked(panel.engines[name], summary, worst, order, time, why))
    engines.sort(key=_order_of)
    return Ranking({row["headline"]: row for row in rows}, engines)


def _order_of(ranked: Ranked) -> tuple[int, bool, float, float, str]:
    """Headline errors first, of engines that pass before others, smallest first, the better support among equals; then what ran."""
    ratio = 0.0 if math.isnan(ranked.summary.ratio) else ranked.summary.ratio
    if ranked.decides:
        support = ranked.summary.support[-1:] or ("",)
        return (
            0,
            bool(ranked.summary.wrong),
            ranked.signal,
            SUPPORT.index(support[0]) if support[0] in SUPPORT else -1,
            ranked.engine.name,
        )
    return 1 if ranked.summary.ran else 2, bool(ranked.summary.wrong), ratio, 0.0, ranked.engine.name


def _families(case: CaseData, rows: Iterable[Row]) -> dict[str, list[tuple[float, Row]]]:
    """Rows of variants that differ in the step alone, with their steps (NaN where the case has none), largest step last."""
    found: dict[str, list[tuple[float, Row]]] = {}
    for row in rows:
        params = case.variants.get(row["variant"], {})
        step = next((name for name in STEPS if isinstance(params.get(name), int | float)), "")
        others = repr(sorted((name, value) for name, value in params.items() if name != step))
        found.setdefault(others, []).append((as_float(params.get(step)), row))
    return {others: sorted(family, key=lambda each: each[0]) for others, family in found.items()}


def _order(case: CaseData, rows: list[Row], decides: Row) -> tuple[float, bool]:
    """Order over variants that differ in the step alone, and whether the deciding row is among them.

    Of the families that have two steps above round-off the one with the largest error counts.
    """
    found = []
    for family in _families(case, rows).values():
        signal = [(step, as_float(row["rel_error"])) for step, row in family]
        signal = [(step, size) for step, size in signal if step > 0.0 and math.isfinite(size) and size > ROUND_OFF]
        if len({step for step, _ in signal}) > 1:
            found.append((max(size for _, size in signal), any(row is decides for _, row in family), signal))
    if not found:
        return math.nan, False
    _, own, signal = max(found)
    return fitted_order([step for step, _ in signal], [size for _, size in signal]), own


def fitted_order(steps: list[float], errors: list[float]) -> float:
    """Slope of ``log error`` over ``log step`` by least squares; NaN with fewer than two points."""
    if len(steps) < 2:
        return math.nan
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def _time(case: CaseData, cells: list[Row], rows: list[Row]) -> str:
    """Longest time at an error of 1 % over the families of variants."""
    took = {cell["variant"]: as_float(cell["advance_s"]) for cell in cells}
    found: list[tuple[float, str]] = []
    for family in _families(case, rows).values():
        points = [(took.get(row["variant"], math.nan), as_float(row["rel_error"])) for _, row in family]
        points = [(spent, size) for spent, size in points if spent > 0.0 and math.isfinite(size)]
        if not points:
            continue
        spent, words = time_at(EQUAL, points)
        if math.isinf(spent):
            return words
        found.append((spent, words))
    return max(found)[1] if found else NOTHING


def time_at(size: float, points: Sequence[tuple[float, float]]) -> tuple[float, str]:
    """Time at which the error is ``size``, in seconds and in words.

    Parameters
    ----------
    size : float
        Error, > 0.
    points : sequence of (float, float)
        Times [s] and errors of one family, smallest step first; not empty.

    Returns
    -------
    float
        Infinite where no step comes so close.
    str
        ``"3 ms"`` by interpolation of the logarithms, ``"≤ 3 ms"`` where the largest step is good enough.
    """
    close = [k for k, (_, got) in enumerate(points) if got <= SLACK * size]
    if not close:
        return math.inf, "1 % not reached"
    k = close[-1]
    spent, got = points[k]
    if k + 1 == len(points) or got == 0.0 or got >= size:
        return spent, f"≤ {seconds(spent)}"
    other, worse = points[k + 1]
    share = math.log(size / got) / math.log(worse / got)
    between = spent * (other / spent) ** share
    return between, seconds(between)


def reasons(cells: Sequence[Row], measurements: Sequence[Row], far: Sequence[str]) -> list[str]:
    """Why an engine is where it is: what broke, failed, is known to differ, or is expressed otherwise than the case says.

    ``far`` are variants whose headlines are off: where the engine meets the exact solution of its time-discrete scheme there, the
    scheme is what is off.
    """
    tried = [cell for cell in cells if cell["status"] not in NOT_TRIED]
    reported: dict[str, None] = {}
    for cell in [cell for cell in tried if cell["status"] in ("error", "timeout")] or ([] if tried else cells):
        reported[str(cell["reason"]) or str(cell["status"])] = None
    failed = worst_first(row for row in measurements if row["status"] == "fail")
    if failed:
        more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        reported[f"{failed[0]['quantity']} fails: {failed[0]['reason']}{more}"] = None
    for row in measurements:
        if row["status"] == "known-difference":
            reported[f"known-difference: {row['reason']}"] = None
    for row in measurements:
        if row["variant"] in far and row["truth"] == "exact-step" and row["status"] == "pass":
            reported[f"its scheme says so, and it meets that scheme's exact solution: {row['source']}"] = None
    for cell in tried:
        if cell["support"] in ("approximate", "equivalent"):
            for note in decoded(cell["notes"], list):
                reported[str(note)] = None
    return list(reported)


@dataclass(frozen=True)
class Cause:
    """Measurements that are excused for one reason; ``worst`` is the one with the largest error over tolerance."""

    text: str
    status: str
    engines: list[str]
    quantities: list[str]
    count: int
    worst: Row


def causes(panel: Panel, gaps: Iterable[Row]) -> list[Cause]:
    """Excused measurements by status and cause, those of most engines first.

    Reasons that differ in their numbers alone are one; what the print says otherwise than a law is named by that law.
    """
    held: dict[tuple[str, str], list[Row]] = {}
    for row in gaps:
        held.setdefault((row["status"], cause_of(str(row["reason"]))), []).append(row)
    found = [
        Cause(
            text=(
                text
                if _PRINT.match(rows[0]["reason"]) or len({row["reason"] for row in rows}) > 1
                else rows[0]["reason"]
            )
            .strip()
            .rstrip("."),
            status=status,
            engines=list(dict.fromkeys(panel.engines[row["engine"]].name for row in rows)),
            quantities=list(dict.fromkeys(str(row["quantity"]) for row in rows)),
            count=len(rows),
            worst=worst_first(rows)[0],
        )
        for (status, text), rows in held.items()
    ]
    return sorted(found, key=lambda cause: (-len(cause.engines), -cause.count, cause.text))


def cause_of(reason: str) -> str:
    """A reason without what differs from measurement to measurement."""
    printed = _PRINT.fullmatch(reason)
    if printed:
        return f"the print contradicts {printed['law']}"
    return _NUMBER.sub("…", reason) or "no reason is given"


def example(row: Row) -> str:
    """One measurement of a cause in words."""
    unit = "" if row["unit"] in ("", "-", "1") else f" {row['unit']}"
    return (
        f"{row['quantity']} = {number(row['value'])}{unit}, the {row['truth']} value is {number(row['expected'])}{unit}"
    )
