"""A comparison as Markdown (GitHub's flavour) and as JUnit XML."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict
from xml.etree import ElementTree

from ninedisk.harness.api.text import duration, printable, short, times
from ninedisk.harness.results.compare import counts
from ninedisk.harness.results.schema import Change, Comparison, RunFacts
from ninedisk.harness.results.tables_part import plain_json

MOST_ROWS = 100
"""Rows of a Markdown table: GitHub cuts a summary at one megabyte, a reader tires earlier."""

SYMBOLS = {"worse": "❌", "suspect": "⚠️", "lost": "⚠️", "not-comparable": "↔️", "better": "✅", "new": "➕", "same": "·"}
_ACTIVE = re.compile(r"[\\`*\[\]<>|~@&#!$\"]|(?<=www)\.|:(?=//)")


def headline(comparison: Comparison) -> str:
    """One sentence that answers: better or worse?"""
    found = counts(comparison)
    parts = [f"{number} {verdict}" for verdict, number in found.items() if number and verdict != "same"]
    if not found["worse"]:
        return f"Nothing got worse ({', '.join([*parts, str(found['same']) + ' same'])})."
    return f"{', '.join([*parts, str(found['same']) + ' same'])}."


def worth_showing(comparison: Comparison) -> list[Change]:
    """Everything that is not the same, what wants attention first."""
    return [change for change in comparison.changes if change.verdict != "same"]


def markdown(comparison: Comparison) -> str:
    """A GitHub-flavoured summary; nothing in it that came from a run is read as markup."""
    lines = [
        "## ninedisk: " + headline(comparison),
        "",
        "| | run | started | commit | machine | runs |",
        "|---|---|---|---|---|---:|",
        _run("BASE", comparison.base, comparison.base_runs),
        _run("HEAD", comparison.head, comparison.head_runs),
        "",
    ]
    changes = worth_showing(comparison)
    if changes:
        lines += [
            "| | case | variant | engine | what | base | head | change | tolerance | why |",
            "|---|---|---|---|---|---:|---:|---:|---:|---|",
        ]
        lines += [_row(change) for change in changes[:MOST_ROWS]]
        if len(changes) > MOST_ROWS:
            lines += ["", f"{len(changes) - MOST_ROWS} more are not shown."]
    lines += ["", "<details><summary>What counts as worse</summary>", ""]
    lines += [f"- {_plain(rule)}" for rule in comparison.rules]
    return "\n".join([*lines, "", "</details>", ""])


def numbers(change: Change) -> tuple[str, str, str, str]:
    """Base, head, factor and tolerance as text."""
    if change.kind == "timing" and change.unit == "s":
        return duration(change.base), duration(change.head), times(change.base, change.head), "-"
    unit = f" {change.unit}" if change.unit not in ("", "-", "1") else ""
    values = [text if (text := short(value)) == "-" else text + unit
              for value in (change.base, change.head, change.tolerance)]  # fmt: skip
    return values[0], values[1], times(change.base, change.head), values[2]


def what(change: Change) -> str:
    """The quantity with its kind of truth, the timing, or the cell."""
    if change.kind == "cell":
        return "cell"
    return f"{change.quantity} ({change.truth})" if change.truth else change.quantity or "timing"


def junit(comparison: Comparison) -> str:
    """JUnit XML: a test for each thing compared; worse ones fail, those that could not be compared are skipped."""
    found = counts(comparison)
    skipped = found["lost"] + found["not-comparable"]
    suite = ElementTree.Element(
        "testsuite",
        name="ninedisk compare",
        tests=str(len(comparison.changes)),
        failures=str(found["worse"]),
        errors="0",
        skipped=str(skipped),
    )
    properties = ElementTree.SubElement(suite, "properties")
    for side in ("base", "head"):
        for name, value in asdict(getattr(comparison, side)).items():
            shown = json.dumps(dict(value)) if isinstance(value, dict) else str(value)
            ElementTree.SubElement(properties, "property", name=f"{side}.{name}", value=printable(shown))
    for change in comparison.changes:
        name = " ".join(part for part in (change.variant, change.engine, what(change)) if part)
        test = ElementTree.SubElement(suite, "testcase", classname=printable(change.case), name=printable(name))
        base, head, factor, allowed = numbers(change)
        text = printable(f"{change.reason} (base {base}, head {head}, {factor}, tolerance {allowed})")
        if change.verdict == "worse":
            ElementTree.SubElement(test, "failure", type=change.kind, message=text)
        elif change.verdict in ("lost", "not-comparable"):
            ElementTree.SubElement(test, "skipped", message=text)
        elif change.verdict != "same":
            ElementTree.SubElement(test, "system-out").text = f"{change.verdict}: {text}"
    ElementTree.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(suite, encoding="unicode") + "\n"


def as_json(comparison: Comparison) -> str:
    """The whole comparison; numbers that are none are null, an infinite error is the text ``inf``."""
    data = asdict(comparison) | {"counts": counts(comparison)}
    for change in data["changes"]:
        for name in ("base", "head", "tolerance"):
            change[name] = "inf" if change[name] == math.inf else change[name]
    return json.dumps(json.loads(plain_json(data)), indent=1, ensure_ascii=False) + "\n"


def _run(name: str, facts: RunFacts, runs: int) -> str:
    cells = (facts.run_id, facts.started, facts.commit[:12], facts.machine)
    return f"| {name} | " + " | ".join(_plain(cell) or "-" for cell in cells) + f" | {runs} |"


def _row(change: Change) -> str:
    base, head, factor, allowed = (_plain(text) for text in numbers(change))
    words = (change.case, change.variant, change.engine, what(change))
    cells = [_plain(word) or "-" for word in words]
    why = _plain(change.reason[:300])
    head_cell = f"**{head}**" if change.verdict == "worse" and head != "-" else head
    first = f"{SYMBOLS[change.verdict]} {change.verdict}"
    return f"| {first} | {' | '.join(cells)} | {base} | {head_cell} | {factor} | {allowed} | {why} |"


def _plain(text: str) -> str:
    """Text that Markdown shows as it stands: on one line, every active character as a numeric entity."""
    return _ACTIVE.sub(lambda match: f"&#{ord(match[0])};", printable(text))
