"""What to change in an engine for an accuracy: records of ``ninedisk tune`` as lines of a table, in the terminal and on pages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ninedisk.harness.results.schema import ROUND_OFF, USES
from ninedisk.reports.drawing.charts import Dots, Look, PointChart
from ninedisk.reports.panel import text
from ninedisk.reports.panel.model import Panel
from ninedisk.reports.panel.ranking import percent

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Tuned:
    """A record on the page of its engine: the case, what people choose an engine for it, and the table's `lines`; no ``slug``: no page."""

    record: Record
    use: str
    title: str
    slug: str
    lines: list[tuple[str, ...]]


def of_engine(panel: Panel, engine: str) -> list[Tuned]:
    """What is stored of an engine, by use."""
    records = [record for record in panel.stored.tuning if record["engine"] == engine]
    found = [
        Tuned(
            record=record,
            use=USES.get(record["headlines"][0]["use"], record["headlines"][0]["use"]),
            title=panel.cases[record["case"]].title if record["case"] in panel.cases else record["case"],
            slug=panel.cases[record["case"]].slug if record["case"] in panel.cases else "",
            lines=lines(record),
        )
        for record in records
    ]
    return sorted(
        found, key=lambda each: list(USES.values()).index(each.use) if each.use in USES.values() else len(USES)
    )


def curves(panel: Panel, case: str, looks: Mapping[str, Look]) -> list[tuple[str, PointChart]]:
    """For each headline that was tuned of a case: time against error, one curve per engine from its own settings to the tuned ones.

    A curve has the engine's own settings, every measured setting that is closer to the truth than these and all that take less time, and
    the adapter's.
    """
    held: dict[str, list[Dots]] = {}
    for record in panel.stored.tuning:
        if record["case"] == case and record["engine"] in looks and (points := front(record)):
            x, y, names = zip(*points, strict=True)
            dots = Dots(record["engine"], looks[record["engine"]], x, y, names=names)
            held.setdefault(record["headline"] or "the worst headline", []).append(dots)
    return [
        (
            name,
            PointChart(
                f"Time against error: {name}",
                "stepping, s per simulated second",
                "relative error",
                tuple(dots),
                bare=True,
            ),
        )
        for name, dots in held.items()
    ]


def front(record: Record) -> list[tuple[float, float, str]]:
    """Points of a curve: seconds, error and name.

    Examples
    --------
    >>> point = {"step": 0.02, "halvings": 0, "changed": {}, "error": 0.03, "seconds": 0.001}
    >>> half, worse = {**point, "halvings": 1, "error": 0.01, "seconds": 0.002}, {**point, "error": 0.02, "seconds": 0.003}
    >>> tuned = {**point, "error": None}
    >>> [each[:2] for each in front({"points": [point, half, worse], "tuned": tuned})]
    [(0.001, 0.03), (0.002, 0.01)]
    """

    def shown(point: Record, name: str) -> list[tuple[float, float, str]]:
        spent, error = text.as_float(point["seconds"]), text.as_float(point["error"])
        return [(spent, max(error, ROUND_OFF), name)] if spent > 0.0 and math.isfinite(error) else []

    own, *others = record["points"]
    found = shown(own, "stock")
    tried = [each for point in others for each in shown(point, f"step {text.seconds(point['step'])}, {changes(point)}")]
    for spent, error, name in sorted(tried):
        if not found or error < min(each[1] for each in found):
            found.append((spent, error, name))
    return sorted(found + shown(record["tuned"], "tuned"))


def lines(record: Record) -> list[tuple[str, ...]]:
    """Rows of a record's table: for, step, what is changed, error, time per simulated second, that over the engine's own, remark.

    Parameters
    ----------
    record : mapping
        What `ninedisk.harness.run.tune.tune` returns.

    Examples
    --------
    >>> own = {"step": 0.02, "halvings": 0, "changed": {}, "error": 0.03, "seconds": 0.001, "reason": ""}
    >>> half = {**own, "step": 0.01, "halvings": 1, "error": 0.008, "target": 0.01, "reached": True, "times": 2.0}
    >>> record = {"points": [own], "answers": [half], "tuned": {**own, "step": None, "error": 0.0001}}
    >>> lines(record)[1][:4]
    ('1 %', '10 ms', 'the step alone', '0.8 %')
    """
    own = record["points"][0]
    rows = [("stock", own, "nothing", own["reason"])]
    for answer in record["answers"]:
        missed = "" if answer["reached"] else "no setting of the ladder reaches it; this is the closest"
        rows.append(
            (percent(answer["target"]), answer, changes(answer), "; ".join(filter(None, (missed, answer["reason"]))))
        )
    rows.append(("tuned", record["tuned"], "all settings of the adapter", record["tuned"]["reason"]))
    return [
        (name, _step(point), changed, _error(point), text.seconds(point["seconds"]), _times(point, own), remark)
        for name, point, changed, remark in rows
    ]


def changes(point: Record) -> str:
    """What a setting changes besides the step.

    Examples
    --------
    >>> changes({"halvings": 1, "changed": {"impratio": 100.0, "cone": "elliptic"}})
    'impratio = 100, cone = elliptic'
    """
    words = [
        f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}"
        for name, value in point["changed"].items()
    ]
    return ", ".join(words) or ("the step alone" if point["halvings"] else "nothing")


def _step(point: Record) -> str:
    return text.seconds(point["step"])


def _error(point: Record) -> str:
    return percent(text.as_float(point["error"]))


def _times(point: Record, own: Record) -> str:
    spent, least = text.as_float(point["seconds"]), text.as_float(own["seconds"])
    times = text.as_float(point["times"]) if "times" in point else spent / least if least > 0.0 else math.nan
    return text.NOTHING if math.isnan(times) else f"{times:.2g} ×" if times < 10.0 else f"{times:.0f} ×"
