"""The page of findings: what engines are known to do otherwise and errata of the source, largest first.

Findings come evaluated (`ninedisk.harness.results.findings.evaluate`), as ``Stored.findings``, and are plain data
(`ninedisk.harness.results.schema.EvaluatedFinding`). What other pages show of them is `of_engines`: those that the store measured,
largest first, each with the engine, ``what``, ``size``, the row that it was read from and the verdict.
"""

from __future__ import annotations

import math
from collections import Counter

from jinja2 import Environment

from ninedisk.harness.results.schema import FINDING_VERDICTS, EvaluatedFinding
from ninedisk.reports.panel.load import Stored
from ninedisk.reports.panel.model import Panel
from ninedisk.reports.panel.text import as_float

COLOURS = {"larger": "out3", "gone": "in0", "there": "out1", "not-measured": "none"}
"""Colour class of each verdict; the word itself is beside it."""


def of_engines(stored: Stored) -> list[EvaluatedFinding]:
    """What engines do otherwise, as far as the store has a number for it, largest first; errata of the source left out."""
    return [each for each in stored.findings if each.verdict in ("larger", "there") and not _of_source(each)]


def _right(finding: EvaluatedFinding, panel: Panel) -> float:
    """What a printed number should be: the better truth of the same quantity of the same cell; NaN where the store has none."""
    place = (finding.case, finding.variant, finding.engine, finding.quantity)
    return next(
        (
            as_float(row["expected"])
            for row in panel.measurements
            if (row["case"], row["variant"], row["engine"], row["quantity"]) == place
            and row["truth"] in ("exact-step", "analytic", "converged")
            and row["norm"] == "scalar"
        ),
        math.nan,
    )


def _of_source(finding: EvaluatedFinding) -> bool:
    return finding.id.startswith("source/")


def findings_page(env: Environment, panel: Panel) -> str:
    """All findings: what has changed, engines, the source, and what the store cannot show."""
    found = panel.stored.findings
    known = [each for each in found if each.verdict == "there"]
    groups = [
        ("changed", "Changed", [each for each in found if each.verdict in ("larger", "gone")]),
        ("engines", "Engines", [each for each in known if not _of_source(each)]),
        ("source", "The source", [each for each in known if _of_source(each)]),
    ]
    counts = Counter(each.verdict for each in found)
    return env.get_template("findings.html").render(
        root="",
        groups=[group for group in groups if group[2]],
        unmeasured=[each for each in found if each.verdict == "not-measured"],
        right={each.id: _right(each, panel) for each in found if each.truth == "published"},
        counts=[(verdict, counts[verdict]) for verdict in FINDING_VERDICTS if counts[verdict]],
        engines=panel.engines,
        cases=panel.cases,
        colours=COLOURS,
    )
