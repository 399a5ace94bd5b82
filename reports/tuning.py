"""What to change in an engine for an accuracy: records of ``ninedisk tune`` as lines of a table, in the terminal and on pages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ninedisk.reports.panel import text
from ninedisk.reports.panel.ranking import percent

Record = Mapping[str, Any]


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
    return text.NOTHING if math.isnan(times) else f"{times:.2g} ×"
