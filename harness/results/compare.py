"""Two runs, or two groups of runs, side by side: what got worse, what got better, what cannot be compared.

`resolve` reads what the words BASE and HEAD of ``ninedisk compare`` mean: runs of a store, folders, exported files. A comparison
is written as Markdown (GitHub's flavour), JUnit XML or JSON.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ninedisk.harness.api.errors import StoreError, UsageError, close_matches
from ninedisk.harness.api.text import count_noun, duration, factor_text, one_line, short_number
from ninedisk.harness.results.error_rules import ERROR_RULE, error_of, judge_errors
from ninedisk.harness.results.export import FORMATS, read_export
from ninedisk.harness.results.reader import CellKey, read_about, run_facts, run_ids, run_time
from ninedisk.harness.results.schema import CHANGE_VERDICTS, Change, Comparison, Row, RunFacts, row_tolerance
from ninedisk.harness.results.store import BROKEN, HEADLINE, NOT_RUN, CheckKey, Snapshot, load_snapshot, sorted_runs
from ninedisk.harness.results.tables import plain_json
from ninedisk.harness.results.timing_rules import LEAST, TIMING_RULE, WALL_CLOCK, Samples, judge_timings, timing

NAN = float("nan")
EVERY = "all timings"
"""Stands where a case's id stands, for what all timings share."""


_LATEST = re.compile(r"latest(?:~(\d+))?")

MEANINGS = (
    "give a run id (see `ninedisk runs`), latest, latest~1, a range such as latest~9..latest~5, a folder with runs, "
    "or a file of `ninedisk export`"
)

MOST_ROWS = 100
"""Rows of a Markdown table: GitHub cuts a summary at one megabyte, a reader tires earlier."""

SYMBOLS = {"worse": "❌", "suspect": "⚠️", "lost": "⚠️", "not-comparable": "↔️", "better": "✅", "new": "➕", "same": "·"}

_ACTIVE = re.compile(r"[\\`*\[\]<>|~@&#!$\"]|(?<=www)\.|:(?=//)")


@dataclass(frozen=True)
class Side:
    """Runs on one side: ``decisive`` is the one whose errors count, ``sample`` (with it) gives the timings."""

    decisive: Snapshot
    sample: tuple[Snapshot, ...]


def side(runs: Sequence[Snapshot]) -> Side:
    """A side of runs in their order in time: the newest decides."""
    return Side(runs[-1], tuple(runs))


def compare(base: Side, head: Side) -> Comparison:
    """Compare every cell, check and timing of two sides."""
    found = list(_cells(base.decisive, head.decisive))
    different = {(c.case, c.variant, c.engine) for c in found if c.verdict == "not-comparable"}
    found += _errors(base.decisive, head.decisive, different)
    found += _timings(base, head, different)
    return Comparison(
        base=base.decisive.facts,
        head=head.decisive.facts,
        base_runs=len(base.sample),
        head_runs=len(head.sample),
        changes=tuple(sorted(found, key=attention)),
        rules=(ERROR_RULE, TIMING_RULE),
    )


def attention(change: Change) -> tuple[Any, ...]:
    """Sort key: what wants attention first; broken cells before failed checks before larger factors."""
    kind = ("cell", "error", "timing").index(change.kind)
    fails = change.head_status != "fail"
    return CHANGE_VERDICTS.index(change.verdict), kind, fails, -growth(change), change.case, change.variant


def growth(change: Change) -> float:
    """Factor between base and head, above 1 in the direction of the change; 1 without numbers."""
    base, head = change.base, change.head
    if math.isnan(base) or math.isnan(head) or base == head:
        return 1.0
    small, large = sorted((base, head))
    return large / small if small > 0.0 else math.inf


def counts(comparison: Comparison) -> dict[str, int]:
    """How many changes have each verdict, in the order of `schema.CHANGE_VERDICTS`."""
    found = Counter(change.verdict for change in comparison.changes)
    return {verdict: found[verdict] for verdict in CHANGE_VERDICTS}


def _change(row: Row, **what: Any) -> Change:
    common = {"kind": "cell", "quantity": "", "unit": "", "truth": "", "base": NAN, "head": NAN, "tolerance": NAN}
    place = {name: row[name] for name in ("case", "case_version", "variant", "engine")}
    return Change(**{**common, **place, **what})


def _cells(base: Snapshot, head: Snapshot) -> Iterator[Change]:
    for key in {**base.cells, **head.cells}:
        before, after = base.cells.get(key), head.cells.get(key)
        if before is None:
            yield _change(head.cells[key], verdict="new", base_status="", head_status=head.cells[key]["status"],
                          reason="not in BASE")  # fmt: skip
            continue
        if after is None:
            yield _change(before, verdict="lost", base_status=before["status"], head_status="", reason="not in HEAD")
            continue
        verdict, reason = _judge_cell(before, after)
        statuses = {"base_status": before["status"], "head_status": after["status"]}
        if verdict != "same" or not _cell_ran(after):
            yield _change(after, verdict=verdict, reason=reason, **statuses)


def _judge_cell(before: Row, after: Row) -> tuple[str, str]:
    if before["case_version"] != after["case_version"]:
        versions = f"version {before['case_version']} in BASE, {after['case_version']} in HEAD"
        return "not-comparable", f"not comparable: the case has {versions}"
    if after["status"] in BROKEN:
        return ("same" if before["status"] in BROKEN else "worse"), str(after["reason"])
    if before["status"] in BROKEN:
        return ("better", "it runs again") if _cell_ran(after) else ("lost", str(after["reason"]))
    if _cell_ran(before) and not _cell_ran(after):
        return "lost", str(after["reason"])
    return ("new", "it did not run in BASE") if _cell_ran(after) and not _cell_ran(before) else ("same", "")


def _cell_ran(cell: Row) -> bool:
    return cell["status"] not in BROKEN | NOT_RUN


def _shared(base: Snapshot, head: Snapshot, different: set[CellKey]) -> list[CellKey]:
    """Cells that ran on both sides in the same version."""
    return [
        key
        for key, cell in head.cells.items()
        if key in base.cells and key not in different and _cell_ran(cell) and _cell_ran(base.cells[key])
    ]


def _errors(base: Snapshot, head: Snapshot, different: set[CellKey]) -> Iterator[Change]:
    """Of all checks of the cells that both have; of headlines only where both runs have any, which those of older schemas have not."""
    reported = all(
        any(check[2] == HEADLINE for of_cell in run.checks.values() for check in of_cell) for run in (base, head)
    )
    for key in _shared(base, head, different):
        before, after = base.checks.get(key, {}), head.checks.get(key, {})
        for check in {**before, **after}:
            if check[2] == HEADLINE and not reported:
                continue
            yield _error(before.get(check), after.get(check), check)


def _error(before: Row | None, after: Row | None, check: CheckKey) -> Change:
    row = after or before
    assert row is not None
    if before and after:
        verdict, reason = judge_errors(before, after)
    else:
        verdict, reason = ("new", "no such check in BASE") if after else ("lost", "no such check in HEAD")
    return _change(
        row,
        kind="error",
        verdict=verdict,
        reason=reason,
        quantity=check[0],
        unit=row["unit"],
        truth=check[2],
        tolerance=row_tolerance(row),
        base=error_of(before) if before else NAN,
        head=error_of(after) if after else NAN,
        base_status=before["status"] if before else "",
        head_status=after["status"] if after else "",
    )


def _timings(base: Side, head: Side, different: set[CellKey]) -> Iterator[Change]:
    machines = [each.decisive.facts.machine for each in (base, head)]
    apart = machines[0] != machines[1]
    samples = {}
    for key in _shared(base.decisive, head.decisive, different):
        of = [timing(each.decisive.cells[key])[0] for each in (base, head)]
        kind = of[0] if of[0] == of[1] else WALL_CLOCK
        sides = [_seconds(each, key, kind) for each in (base, head)]
        if all(sides):
            spreads = [float(each.decisive.cells[key]["cpu_spread"]) for each in (base, head)]
            spread = max((spread for spread in spreads if math.isfinite(spread)), default=0.0)
            samples[key, kind] = Samples(sides[0], sides[1], spread=spread, gates=kind != WALL_CLOCK)
    if not samples:
        return
    if apart:
        words = f"not comparable: timings of {machines[0]} and of {machines[1]}"
        yield _all_samples("not-comparable", NAN, NAN, words)
        return
    found, common = judge_timings(samples)
    for (key, kind), judged in found.items():
        row = head.decisive.cells[key]
        yield _change(row, kind="timing", quantity=kind, unit="s", base=judged.base, head=judged.head,
                      verdict=judged.verdict, reason=judged.reason, base_status=base.decisive.cells[key]["status"],
                      head_status=row["status"])  # fmt: skip
    if abs(math.log(common)) >= LEAST:
        reason = (
            "all timings moved together although the reference computation did not: something that every engine uses, or a "
            "machine that slows them more than it; with few runs a side it is taken out of each timing"
        )
        yield _all_samples("suspect" if common > 1.0 else "same", 1.0, common, reason)


def _seconds(one: Side, key: CellKey, kind: str) -> list[float]:
    """A timing [s] in the runs of a side that have it, in the version and on the machine of its decisive run."""
    held, version = [], one.decisive.cells[key]["case_version"]
    for run in one.sample:
        cell = run.cells.get(key)
        if cell is not None and cell["case_version"] == version and run.facts.machine == one.decisive.facts.machine:
            of, value = timing(cell)
            value = float(cell["advance_s"]) if kind == WALL_CLOCK else value
            if kind in (of, WALL_CLOCK) and math.isfinite(value) and value > 0.0:
                held.append(value)
    return held


def _all_samples(verdict: str, before: float, after: float, reason: str) -> Change:
    nowhere = {"case": EVERY, "case_version": 0, "variant": "", "engine": ""}
    return _change(nowhere, kind="timing", verdict=verdict, base=before, head=after, unit="1", reason=reason,
                   base_status="", head_status="")  # fmt: skip


def resolve(word: str, store: Path) -> list[Snapshot]:
    """Runs that a word names, oldest first, at least one.

    Parameters
    ----------
    word : str
        ``latest``, ``latest~N``, a run id or an unambiguous beginning of one, ``FROM..TO`` of these (both included), a
        store's or a run's folder, or a file that `ninedisk.harness.results.export` wrote.
    store : Path
        Where run ids are looked up.

    Raises
    ------
    UsageError
        If the word names nothing; StoreError if what it names cannot be read.
    """
    path = Path(word)
    if path.is_file():
        return _not_empty(read_export(path), word)
    if path.is_dir():
        return _folder(path)
    if word in run_ids(store):  # asked for by its full name, so that no other run can stand in the way
        return [load_snapshot(store, word)]
    first, dots, last = word.partition("..")
    ids = _ids_by_time(store)
    if dots:
        begin, end = (_index(part, ids, store) for part in (first, last))
        if begin > end:
            raise UsageError(f"{word!r} is empty: {first!r} is newer than {last!r}; write the older run first")
        wanted = ids[begin : end + 1]
    else:
        if path.suffix in FORMATS:
            raise UsageError(f"there is no file {word!r}: {MEANINGS}")
        wanted = [ids[_index(word, ids, store)]]
    return sorted_runs(load_snapshot(store, run_id) for run_id in wanted)


def one_stored(word: str, store: Path) -> str:
    """Id of the one run of a store that a word names: ``latest``, ``latest~N``, an id or an unambiguous beginning of one.

    Raises
    ------
    UsageError
        If the word names nothing.
    """
    if word in run_ids(store):
        return word
    ids = _ids_by_time(store)
    return ids[_index(word, ids, store)]


def newest_first(store: Path) -> list[str]:
    """Ids of the finished runs of a store, the newest first."""
    return [*reversed(_ids_by_time(store))]


def _folder(path: Path) -> list[Snapshot]:
    if (path / "run.json").is_file():
        if path.parent.name != "runs":
            raise StoreError(f"the run {str(path)!r} lies in no store: a store keeps it as runs/{path.name}")
        return [load_snapshot(path.parent.parent, path.name)]
    return _not_empty([load_snapshot(path, run_id) for run_id in run_ids(path)], str(path))


def _not_empty(runs: list[Snapshot], word: str) -> list[Snapshot]:
    if not runs:
        raise UsageError(f"{word!r} holds no finished run: {MEANINGS}")
    return sorted_runs(runs)


def _ids_by_time(store: Path) -> list[str]:
    """Ids of the finished runs by their start, oldest first: an id from elsewhere need not sort by time."""
    facts = [run_facts(read_about(store, run_id)) for run_id in run_ids(store)]
    return [each.run_id for each in sorted(facts, key=lambda each: (run_time(each.started), each.run_id))]


def _index(word: str, ids: list[str], store: Path) -> int:
    match = _LATEST.fullmatch(word)
    if match:
        back = int(match[1] or 0)
        if not ids:
            raise UsageError(f"the store {str(store)!r} has no finished run: run `ninedisk run --store {store}` first")
        if back >= len(ids):
            raise UsageError(
                f"{word!r} is too far back: the store {str(store)!r} has {count_noun(len(ids), 'finished run')}"
            )
        return len(ids) - 1 - back
    found = [k for k, run_id in enumerate(ids) if run_id == word or (word and run_id.startswith(word))]
    if len(found) == 1 or word in ids:
        return ids.index(word) if word in ids else found[0]
    if found:
        raise UsageError(f"{word!r} is the beginning of {len(found)} runs of {str(store)!r}: give more of it")
    raise UsageError(f"{word!r} names no run of the store {str(store)!r}: {MEANINGS}.{close_matches(word, ids)}")


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


def change_numbers(change: Change) -> tuple[str, str, str, str]:
    """Base, head, factor and tolerance as text."""
    if change.kind == "timing" and change.unit == "s":
        return duration(change.base), duration(change.head), factor_text(change.base, change.head), "-"
    unit = f" {change.unit}" if change.unit not in ("", "-", "1") else ""
    values = [text if (text := short_number(value)) == "-" else text + unit
              for value in (change.base, change.head, change.tolerance)]  # fmt: skip
    return values[0], values[1], factor_text(change.base, change.head), values[2]


def changed_quantity(change: Change) -> str:
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
            ElementTree.SubElement(properties, "property", name=f"{side}.{name}", value=one_line(shown))
    for change in comparison.changes:
        name = " ".join(part for part in (change.variant, change.engine, changed_quantity(change)) if part)
        test = ElementTree.SubElement(suite, "testcase", classname=one_line(change.case), name=one_line(name))
        base, head, factor, allowed = change_numbers(change)
        text = one_line(f"{change.reason} (base {base}, head {head}, {factor}, tolerance {allowed})")
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
    base, head, factor, allowed = (_plain(text) for text in change_numbers(change))
    words = (change.case, change.variant, change.engine, changed_quantity(change))
    cells = [_plain(word) or "-" for word in words]
    why = _plain(change.reason[:300])
    head_cell = f"**{head}**" if change.verdict == "worse" and head != "-" else head
    first = f"{SYMBOLS[change.verdict]} {change.verdict}"
    return f"| {first} | {' | '.join(cells)} | {base} | {head_cell} | {factor} | {allowed} | {why} |"


def _plain(text: str) -> str:
    """Text that Markdown shows unchanged: on one line, every active character as a numeric entity."""
    return _ACTIVE.sub(lambda match: f"&#{ord(match[0])};", one_line(text))
