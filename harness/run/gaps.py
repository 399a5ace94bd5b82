"""Known gaps of an engine: differences whose cause is known, expected to fail until they are closed.

One TOML file serves `ninedisk run --known-gaps`, pytest, the exit code and, through the store, the pages. Its form, and what becomes of the
checks that it names: docs/how-to/continuous-integration.md.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ninedisk.harness.api.case import Case, ParameterError
from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import case_table, engine_table, get_case
from ninedisk.harness.results.schema import Row, row_tolerance
from ninedisk.harness.results.tables import CaseResult
from ninedisk.harness.results.whole_file import write_whole
from ninedisk.harness.run.judge import TRUTH_PREFERENCE, blank_history, cell_verdict
from ninedisk.harness.run.plan import Cell

REQUIRED = ("id", "quantity", "reason")
KEYS = (*REQUIRED, "engine", "truth")
SOME = 12
"""Known names that an error lists where none is near."""


@dataclass(frozen=True, kw_only=True)
class KnownGap:
    """One entry of the file, the ``number``-th."""

    id: str
    quantity: str
    reason: str
    engine: str = "*"
    truth: str = "*"
    number: int = 0

    def is_of(self, case: str, variant: str, engine: str) -> bool:
        """Whether the gap is about this cell."""
        place = f"{case}[{variant}]" if "[" in self.id else case
        return matches(self.id, place) and matches(self.engine, engine)

    def explains(self, case: str, variant: str, engine: str, quantity: str, truth: str) -> bool:
        """Whether the gap is about this check."""
        return self.is_of(case, variant, engine) and matches(self.quantity, quantity) and matches(self.truth, truth)


@dataclass(frozen=True)
class GapFile:
    """The gaps of a file; empty where there is none."""

    path: Path = Path()
    gaps: tuple[KnownGap, ...] = ()

    def judged(self, rows: Sequence[Row]) -> list[Row]:
        """Rows of a cell after the file: what is off and explained is a known gap, what is expected to fail and passes a closed one."""
        return [self._row(row) for row in rows]

    def with_known_gaps(self, result: CaseResult) -> CaseResult:
        """A cell after the file, its status the worst of what its rows now have; the very same where no entry is about it."""
        rows = self.judged(result.rows)
        if rows == result.rows:
            return result
        status, reason = cell_verdict(rows)
        return replace(result, cell=result.cell | {"status": status, "reason": reason}, rows=rows)

    def closed(self, results: Iterable[CaseResult]) -> bool:
        """Whether the file expects something to fail that passes in these results, which are not judged after it yet."""
        rows = [(row, self._row(row)) for result in results for row in result.rows]
        return any(before["status"] == "pass" != after["status"] for before, after in rows)

    def facts(self) -> dict[str, str]:
        """What the provenance of a run says of it, so that what it excused is not taken for a run's without it."""
        return {"known_gaps": hashlib.sha256(self.path.read_bytes()).hexdigest()} if self.gaps else {}

    def idle(self, checks: Iterable[tuple[str, str, str, str, str]]) -> list[KnownGap]:
        """Gaps that explain none of these checks, each given by case, variant, engine, quantity and truth."""
        found = list(checks)
        return [gap for gap in self.gaps if not any(gap.explains(*check) for check in found)]

    def check(self, engines: Iterable[str], cells: Sequence[Cell] = ()) -> None:
        """Refuse entries about what does not exist.

        Parameters
        ----------
        engines : iterable of str
            Ids of those that run, some of which may be commands.
        cells : sequence of Cell
            Those of the run, where their variants may be others than those of the matrix.

        Raises
        ------
        UsageError
            With the nearest names that do.
        """
        engines = {*engine_table(), *engines}
        for gap in self.gaps:
            where = f"--known-gaps {str(self.path)!r}, gap {gap.number}"
            name, _, rest = gap.id.partition("[")
            variant = _without_options(rest.removesuffix("]"))
            _known(where, "case", name, case_table())
            _known(where, "engine", gap.engine, engines)
            _known(where, "kind of truth", gap.truth, TRUTH_PREFERENCE)
            found = [
                (case, variant_id, params)
                for case in map(get_case, (each for each in case_table() if matches(name, each)))
                for variant_id, params in _variants(case, cells, variant).items()
            ]
            if rest:
                _known(where, "variant", variant, {each for _, each, _ in found})
                found = [each for each in found if matches(variant, each[1])]
            _known(where, "quantity", gap.quantity, _quantities(found, gap.quantity))

    def _row(self, row: Row) -> Row:
        place = (row["case"], row["variant"], row["engine"])
        gap = next((gap for gap in self.gaps if gap.explains(*place, row["quantity"], row["truth"])), None)
        if gap is None or not row["quantity"]:
            return row
        if row["status"] == "fail" and not math.isnan(row["abs_error"]):
            return row | {"status": "known-gap", "reason": f"{self.path.name}: {gap.reason}"}
        if row["status"] == "pass":
            return row | {
                "status": "gap-closed",
                "reason": f"it passes: remove this entry, or narrow it where others that it names still fail: {self.path.name}, "
                f"gap {gap.number}, id = {json.dumps(gap.id)}, quantity = {json.dumps(gap.quantity)} ({gap.reason})",
            }
        return row


def matches(pattern: str, text: str) -> bool:
    """Whether a pattern with ``*`` and ``?`` fits; brackets are literal, since ids have them."""
    return re.fullmatch(re.escape(pattern).replace(r"\*", ".*").replace(r"\?", "."), text) is not None


def read_gaps(path: Path) -> GapFile:
    """The gaps of a file.

    Raises
    ------
    UsageError
        Naming the file, the entry and what is wrong with it.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise UsageError(
            f"--known-gaps {str(path)!r}: there is no such file; `ninedisk run --write-known-gaps FILE` makes the first"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"--known-gaps {str(path)!r} cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"--known-gaps {str(path)!r} is no TOML: {error}") from error
    entries = data.pop("gap", [])
    if data or not isinstance(entries, list):
        raise UsageError(f"--known-gaps {str(path)!r}: write each gap as a table [[gap]], and nothing else")
    return GapFile(
        path, tuple(_gap(f"--known-gaps {str(path)!r}, gap {k}", k, each) for k, each in enumerate(entries, 1))
    )


def gaps_text(results: Sequence[CaseResult]) -> str:
    """A first file: an entry for each check of a run that fails with a number, those of all variants of a case together where all fail."""
    failing: dict[tuple[str, str, str, str], list[Row]] = defaultdict(list)
    judged: dict[tuple[str, str, str, str], int] = defaultdict(int)
    for row in (row for result in results for row in result.rows if row["quantity"]):
        key = (row["case"], row["engine"], row["quantity"], row["truth"])
        judged[key] += row["status"] not in ("no-truth", "not-observed")
        if row["status"] == "fail" and not math.isnan(row["abs_error"]):
            failing[key].append(row)
    lines = [
        "# Differences that are expected to fail, as `ninedisk run --write-known-gaps` found them.",
        "# Write into each reason what causes it; an entry whose check passes has to be removed.",
    ]
    for (case, engine, quantity, truth), rows in failing.items():
        together = len(rows) == judged[case, engine, quantity, truth] > 1
        for row in [max(rows, key=lambda row: row["abs_error"])] if together else rows:
            unit = "" if row["unit"] in ("", "-") else f" {row['unit']}"
            entry = {
                "id": case if together else f"{case}[{row['variant']}]",
                "quantity": quantity,
                "engine": engine,
                "truth": truth,
                "reason": f"not explained yet: off by {'up to ' if together else ''}{row['abs_error']:.3g}{unit}, "
                f"tolerance {row_tolerance(row):.3g}{unit}",
            }
            lines += [
                "",
                "[[gap]]",
                *(f"{key} = {json.dumps(text, ensure_ascii=False)}" for key, text in entry.items()),
            ]
    return "\n".join(lines) + "\n"


def write_gaps(path: Path, results: Sequence[CaseResult]) -> None:
    """Write `gaps_text`; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    write_whole("--write-known-gaps", path, gaps_text(results))


def _gap(where: str, number: int, entry: object) -> KnownGap:
    if not isinstance(entry, dict):
        raise UsageError(f"{where}: write it as a table [[gap]]")
    if unknown := sorted(set(entry) - set(KEYS)):
        raise UsageError(f"{where} has the unknown key(s) {', '.join(unknown)}: use {', '.join(KEYS)}")
    for name in REQUIRED:
        if not entry.get(name):
            raise UsageError(f"{where} lacks {name!r}: it needs {', '.join(REQUIRED)}")
    for name, value in entry.items():
        if not isinstance(value, str):
            raise UsageError(f"{where}: {name} = {value!r} is not allowed: it must be a text in quotes")
    if "[" in entry["id"] and not entry["id"].endswith("]"):
        raise UsageError(f"{where}: id = {entry['id']!r} is not allowed: write case[variant], or the case alone")
    return KnownGap(**entry, number=number)


def _known(where: str, kind: str, pattern: str, names: Iterable[str]) -> None:
    found = sorted(names)
    if not any(matches(pattern, name) for name in found):
        some = f" Known: {', '.join(found[:SOME])}{', ...' if len(found) > SOME else ''}"
        raise UsageError(f"{where}: there is no {kind} {pattern!r}.{close_matches(pattern, found) or some}")


def _without_options(variant: str) -> str:
    """The id of a variant without the options ``ENGINE.NAME=VALUE`` that a run may add to it."""
    parts = [part for part in variant.split(",") if "." not in part.partition("=")[0]]
    return ",".join(parts) or "default"


def _variants(case: Case, cells: Sequence[Cell], wanted: str) -> dict[str, Mapping[str, Any]]:
    """Parameters of the variants that there are: those of the matrix and of the run, and the wanted one if the case can have it."""
    found = {each.id: each.params for each in (resolve(case, row) for row in case.matrix())}
    found |= {_without_options(cell.variant.id): cell.variant.params for cell in cells if cell.case.id == case.id}
    with suppress(ParameterError):
        given = {} if wanted == "default" else dict(part.partition("=")[::2] for part in wanted.split(","))
        variant = resolve(case, given)
        found[variant.id] = variant.params
    return found


def _quantities(variants: Sequence[tuple[Case, str, Mapping[str, Any]]], pattern: str) -> set[str]:
    """What the variants observe, up to the first that has what is looked for; that does not depend on an engine's numbers."""
    names: set[str] = set()
    for case, _, params in variants:
        setup = case.build(params)
        observed = case.observe(params, setup, blank_history(setup))
        names |= {*observed.series, *observed.scalars}
        if any(matches(pattern, name) for name in names):
            break
    return names
