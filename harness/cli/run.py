"""``ninedisk run``: check the request, run, store, tell.

What a run prints at its end, and what ``ninedisk show`` prints of a stored one: worst first, reasons, counts, where the results are.
"""

from __future__ import annotations

import json
import math
import shlex
from collections import Counter, defaultdict
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.api.registry import match_cases, problems
from ninedisk.harness.cli.support import FAILURE, CellProgress, console, fail, table
from ninedisk.harness.results.claims import judge_claims
from ninedisk.harness.results.schema import WORST_FIRST, Row, row_tolerance
from ninedisk.harness.results.store import new_run_id, prepare_store, write_run
from ninedisk.harness.results.tables import CaseResult, plain_json
from ninedisk.harness.results.whole_file import check_writable, write_whole
from ninedisk.harness.run.judge import exit_code
from ninedisk.harness.run.matrix import run_cells
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.provenance import command_line, provenance, usable_cores
from ninedisk.harness.run.published import check_folder
from ninedisk.harness.wire.command import engines_given

if TYPE_CHECKING:
    from rich.console import Console

    from ninedisk.harness.run.cluster import Cluster


def execute(
    *,
    globs: Sequence[str],
    engines: Sequence[str],
    settings: Sequence[str],
    options: Sequence[str] = (),
    store: Path,
    json_file: Path | None,
    published: Path | None,
    commands: Sequence[str] = (),
    all_engines: bool = False,
    jobs: str | None = None,
    dask: str | None = None,
) -> int:
    """Run, store, print; the exit code of the command.

    Every mistake in the request is found before the first cell runs, the store's and the JSON file's included.

    Raises
    ------
    UsageError, ParameterError, CoreError
        With the message to show.
    """
    if jobs is not None and dask is not None:
        raise UsageError("--jobs and --dask exclude each other: a cluster has the workers that it has")
    at_once = read_jobs(jobs)
    cells = plan_matrix(
        match_cases(globs),
        engines_given(engines, commands, everything=all_engines),
        parse_settings(settings),
        parse_settings(options, flag="--option", example="siconos.theta=1"),
    )
    for note in (*(f"warning: {problem}" for problem in problems()), *check_folder(published, cells)):
        typer.echo(note, err=True)
    prepare_store(store)
    if json_file is not None:
        check_writable("--json", json_file)
    started = _now()
    with _cluster(dask) as cluster, CellProgress() as progress:
        results = run_cells(cells, progress, published=published, jobs=at_once, cluster=cluster)
        claims = judge_claims(results)
        where = {"jobs": at_once} if cluster is None else cluster.facts()
        facts = {
            "started": started,
            "finished": _now(),
            "provenance": provenance(result.cell for result in results) | where,
            "argv": command_line(),
        }
    code = exit_code({status for result in results for status in result.statuses})
    try:
        folder: Path | None = write_run(store, new_run_id(), results, claims, facts)
        if json_file is not None:
            write_json(json_file, results)
    except StoreError as error:
        show_summary(*_told(results), None)
        fail(str(error), FAILURE)
    show_summary(*_told(results), folder)
    return code


def _told(results: Sequence[CaseResult]) -> tuple[list[Row], list[Row]]:
    return [result.cell for result in results], [row for result in results for row in result.rows]


def read_jobs(text: str | None) -> int:
    """Cells at once that ``--jobs`` means; 1 without it.

    Raises
    ------
    UsageError
        If it is neither a whole number >= 1 nor auto.
    """
    if text is None:
        return 1
    if text == "auto":
        return usable_cores()
    if text.isascii() and text.isdigit() and int(text) >= 1:
        return int(text)
    raise UsageError(f"--jobs {text} is not allowed: give a whole number >= 1, or auto for one for each core")


def _cluster(address: str | None) -> AbstractContextManager[Cluster | None]:
    if address is None:
        return nullcontext()
    from ninedisk.harness.run.cluster import connected

    return connected(address)


def parse_settings(settings: Sequence[str], *, flag: str = "--set", example: str = "dt=0.01") -> dict[str, str]:
    """``NAME=VALUE`` texts as a mapping; a name given twice is refused, since only one of them could count."""
    found: dict[str, str] = {}
    for text in settings:
        name, sign, value = text.partition("=")
        name, value = name.strip(), value.strip()
        if not sign or not name or not value:
            raise UsageError(f"{flag} {text!r} is not allowed: write NAME=VALUE, for instance {flag} {example}")
        if found.setdefault(name, value) != value:
            raise UsageError(f"{flag} gives {name!r} twice ({found[name]} and {value}): give it once")
    return found


def write_json(path: Path, results: Sequence[CaseResult]) -> None:
    """Write the measurement rows; raises as `write_rows` does."""
    write_rows(path, [row for result in results for row in result.rows])


def write_rows(path: Path, found: Sequence[Row]) -> None:
    """Write rows as a JSON list, NaN as null; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    rows = json.loads(plain_json(list(found)))
    write_whole("--json", path, json.dumps(rows, indent=1) + "\n")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


MAX_LINES = 28
"""Lines of table, reasons and notes together: with what stands around them a run ends within 40 lines of the terminal."""

LEAST_OF_TABLE = 10
"""Lines that reasons and notes leave to the table."""

MAX_REASONS, REASON_LINES = 8, 14
MAX_NOTES, NOTES_BESIDE_REASONS = 8, 3
MAX_LENGTH = 300
"""Letters of a reason where there is no room for all of them."""

BAD = ("error", "timeout", "fail", "gap-closed")
_NOT_RUN = ("unsupported", "not-installed")


def show_summary(
    cells: Sequence[Row],
    rows: Sequence[Row],
    folder: Path | None,
    *,
    everything: bool = False,
    counted: Sequence[Row] | None = None,
) -> None:
    """Print the worst checks, the reasons of what went wrong, the counts, and the run's folder.

    Parameters
    ----------
    cells, rows : sequence of dict
        With the columns of `schema.CELL_COLUMNS` and `schema.MEASUREMENT_COLUMNS`.
    folder : Path or None
        The stored run, ``STORE/runs/ID``; None: there is none.
    everything : bool
        All checks and reasons, whatever room they take.
    counted : sequence of dict, optional
        The rows whose statuses are counted, if more than are shown.
    """
    out = console()
    judged = sorted((row for row in rows if row["status"] not in _NOT_RUN), key=_worst_first)
    reasons = _reasons(judged, everything)
    notes = _not_run(cells, 10**9 if everything else NOTES_BESIDE_REASONS if reasons else MAX_NOTES)
    room = max(LEAST_OF_TABLE, MAX_LINES - len(reasons) - len(notes))
    left_out = 0 if everything else _print_table(out, judged, room)
    if everything and judged:
        out.print(_table(judged))
    lines = []
    if left_out:
        lines.append(f"... and {left_out} more: {_counts(Counter(row['status'] for row in judged[-left_out:]))}")
    lines += [*reasons, *notes]
    lines.append(f"cells: {_counts(Counter(str(cell['status']) for cell in cells))}")
    counts = Counter(row["status"] for row in (rows if counted is None else counted) if row["status"] not in _NOT_RUN)
    lines.append(f"checks: {_counts(counts)}")
    if folder is not None:
        lines.append(f"results: {folder}")
        if not everything:
            store = shlex.quote(str(folder.parent.parent))
            lines.append(f"all checks and reasons: ninedisk show {folder.name} --store {store}")
    for line in lines:
        out.print(line, soft_wrap=True)  # a command that is broken into two lines is none


def _print_table(out: Console, judged: Sequence[Row], room: int) -> int:
    """Print as many rows as fit into ``room`` lines of this terminal; the number of those left out."""
    for count in range(min(len(judged), room), 0, -1):
        with out.capture() as capture:
            out.print(_table(judged[:count]))
        if count == 1 or len(capture.get().splitlines()) <= room:
            out.print(capture.get(), end="")
            return len(judged) - count
    return 0


def _table(judged: Sequence[Row]) -> object:
    shown = table(
        "status", "case", "variant", "engine", "quantity", "error", "tolerance", "truth", right=("error", "tolerance")
    )
    for row in judged:
        shown.add_row(
            row["status"], row["case"], row["variant"], row["engine"], row["quantity"] or "-",
            _number(row["abs_error"]), _number(row_tolerance(row) if row["quantity"] else math.nan), row["truth"] or "-",
        )  # fmt: skip
    return shown


def _worst_first(row: Row) -> tuple[int, float]:
    allowed, error = row_tolerance(row), float(row["abs_error"])
    ratio = error / allowed if allowed > 0.0 else error
    return WORST_FIRST.index(row["status"]), -(math.inf if math.isnan(ratio) else ratio)


def _reasons(judged: Sequence[Row], everything: bool) -> list[str]:
    """Lines; where they are many, each reason has one, of its beginning and its end, so that none hides the others."""
    bad = [row for row in judged if row["status"] in BAD or (everything and row["reason"])]
    texts = []
    for row in bad if everything else bad[:MAX_REASONS]:
        quantity = f" {row['quantity']}" if row["quantity"] else ""
        texts.append(f"{row['status']}: {row['case']} [{row['variant']}] {row['engine']}{quantity}: {row['reason']}")
    lines = [line for text in texts for line in text.splitlines()]
    if not everything and len(lines) > REASON_LINES:
        lines = [_short(text) for text in texts]
    if not everything and len(bad) > MAX_REASONS:
        lines.append(f"... and {len(bad) - MAX_REASONS} more")
    return lines


def _short(text: str) -> str:
    """One line: what went wrong stands at the beginning, the way out or what the engine said last at the end."""
    lines = [
        line if len(line) <= MAX_LENGTH else f"{line[: MAX_LENGTH // 2]} ... {line[-MAX_LENGTH // 2 :]}"
        for line in text.splitlines()
    ]
    return " ... ".join([lines[0], *lines[1:][-1:]])


def _not_run(cells: Sequence[Row], most: int) -> list[str]:
    """One line for each engine and reason, in full; if these are more than ``most``, one for each status."""
    found: dict[str, Counter[tuple[str, str]]] = defaultdict(Counter)
    for cell in cells:
        if cell["status"] in _NOT_RUN:
            found[cell["status"]][str(cell["engine"]), str(cell["reason"])] += 1
    if sum(len(kinds) for kinds in found.values()) <= most:
        return [
            f"{status}: {engine}, {_cells(count)}: {reason}"
            for status, kinds in sorted(found.items())
            for (engine, reason), count in sorted(kinds.items())
        ]
    lines = []
    for status, kinds in sorted(found.items()):
        engines = sorted({engine for engine, _ in kinds})
        if status == "not-installed":
            lines.append(f"{status}: {', '.join(engines)}; how to install them: ninedisk list engines")
        else:
            lines.append(f"{status}: {_cells(kinds.total())} on {', '.join(engines)}")
    return lines


def _cells(count: int) -> str:
    return f"{count} cell{'s' if count > 1 else ''}"


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{counter[status]} {status}" for status in WORST_FIRST if counter[status]) or "none"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"
