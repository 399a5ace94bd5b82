"""``ninedisk run``: check the request, run, store, print.

What a run prints at its end, and what ``ninedisk show`` prints of a stored one: worst first, reasons, counts, where the results are.
"""

from __future__ import annotations

import math
import shlex
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from datetime import UTC, datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.api.text import count_noun, found_and_expected, with_unit
from ninedisk.harness.cli.support import (
    FAILURE,
    INTERRUPTED,
    CellProgress,
    Commands,
    Store,
    fail,
    guarded,
    parse_settings,
    refuse_not_installed,
    write_rows,
)
from ninedisk.harness.results.lacking import as_default, missing_capabilities, ranking_lines, reasons
from ninedisk.harness.results.schema import (
    WIDE,
    WORST_FIRST,
    Row,
    allowed_shares,
    has_no_value,
    row_tolerance,
    short_variant,
)
from ninedisk.harness.terminal import console, share, table

if TYPE_CHECKING:
    from rich.console import Console

    from ninedisk.harness.run.cluster import Cluster
    from ninedisk.harness.run.journal import Journal


MAX_LINES = 27
"""Lines of table, reasons and notes together: with what stands around them a run ends within 40 lines of the terminal."""

LEAST_OF_TABLE = 10
"""Lines that reasons and notes leave to the table."""

MAX_REASONS, REASON_LINES = 8, 14

MAX_NOTES, NOTES_BESIDE_REASONS = 8, 3

HEADLINES, HEADLINES_BESIDE_REASONS = 8, 3
"""Lines of the end of a run about headlines, their heading and their last one apart."""

MAX_LACKING, LACKING_LENGTH = 6, 60
"""Reasons of unsupported cells in one line, and letters of each."""

NARROW = 120
"""Columns of a terminal below which the table leaves out the kind of truth, and has case and variant in one column."""

MAX_LENGTH = 300
"""Letters of a reason where there is no room for all of them."""

BAD = ("error", "timeout", "fail", "gap-closed")

_NOT_RUN = ("unsupported", "not-installed")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("run", short_help="Run cases on engines and judge the results.")(run)


class Profile(StrEnum):
    """Settings of the engines of a run."""

    TUNED = "tuned"
    STOCK = "stock"
    BOTH = "both"


@guarded
def run(
    globs: Annotated[
        list[str] | None,
        typer.Argument(metavar="GLOB", help="Cases by id or pattern, e.g. 'nine-disk/*'. None: all cases."),
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option("--engine", "-e", metavar="ID", help="Engine to run; repeat for several. None: all engines."),
    ] = None,
    engine_cmd: Commands = None,
    all_engines: Annotated[
        bool, typer.Option("--all-engines", help="All known engines (the default without --engine and --engine-cmd).")
    ] = False,
    profile: Annotated[
        Profile,
        typer.Option(
            "--profile",
            help="Settings of the engines: tuned by their adapters, stock as a plain script has them, or both.",
        ),
    ] = Profile.TUNED,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="Fix a parameter, unit allowed ('dt=10 ms'); repeat for several."
        ),
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option(
            "--option",
            metavar="ENGINE.NAME=VALUE",
            help="Fix a setting of one engine; repeat for several. ninedisk list engines ENGINE shows what there is.",
        ),
    ] = None,
    store: Store = Path("results"),
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the measurement rows as JSON.")
    ] = None,
    published: Annotated[
        Path | None,
        typer.Option("--published", metavar="DIR", help="Folder with your own digitised curves (CSV + TOML)."),
    ] = None,
    jobs: Annotated[
        str | None,
        typer.Option(
            "--jobs",
            "-j",
            metavar="N",
            help="Cells at once, each in its own process; auto: one for each core. More than 1 spoils timings. Default: 1.",
        ),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS", help="Run on the Dask cluster whose scheduler listens there."),
    ] = None,
    known_gaps: Annotated[
        Path | None,
        typer.Option(
            "--known-gaps",
            metavar="FILE",
            help="TOML file of differences that are expected to fail (docs/how-to/continuous-integration.md).",
        ),
    ] = None,
    write_known_gaps: Annotated[
        Path | None,
        typer.Option("--write-known-gaps", metavar="FILE", help="Write the checks that fail here as such a file."),
    ] = None,
    allow_unsupported: Annotated[
        bool,
        typer.Option(
            "--allow-unsupported",
            help="Not an error: a case that was asked for and of which a named engine can run no variant.",
        ),
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Take the finished cells of an interrupted run; only the others run.")
    ] = False,
    memory_limit: Annotated[
        str | None,
        typer.Option(
            "--memory-limit",
            metavar="SIZE",
            help="Memory that the engine of one cell may hold ('4 GB', none). Default: half of the machine's, shared by the jobs.",
        ),
    ] = None,
) -> None:
    """Run cases on engines, compare the results with every known truth, and store them.

    \b
    Examples:
      ninedisk run
      ninedisk run nine-disk/compression --engine dem
      ninedisk run 'nine-disk/*' -e dem -e yade --set phi_deg=20
      ninedisk run incline-block -e pymunk --set 'dt=5 ms' --set mu=0.36 --json rows.json
      ninedisk run slip-to-roll -e siconos --option siconos.theta=1
      ninedisk run binary-collision --engine-cmd 'node my-engine.mjs' --engine dem
      ninedisk run incline-block -e mujoco --profile both
      ninedisk run --jobs auto
      ninedisk run --dask tcp://head:8786
      ninedisk run -e acme --write-known-gaps known_gaps.toml
      ninedisk run -e acme --known-gaps known_gaps.toml --memory-limit '4 GB'

    Results do not depend on --jobs or --dask; timings do, so runs with different ones are not compared by their timings.

    A run that is interrupted or killed keeps its finished cells. The same command with --resume runs the others, and those that ended as an
    error or a timeout; cells of other code, versions or --jobs are not taken.

    A named engine (--engine, --engine-cmd) must be able to run some variant of each case that a GLOB selects, and without a GLOB
    of any case. Else the run ends with 3 and says what the engine lacks; --allow-unsupported permits it.

    \b
    Exit codes:
      0  every cell passes or is excused (unsupported, not-installed, known-gap, gap-closed,
         known-difference, no-truth, not-observed); ninedisk list statuses explains these words
      1  the run is complete but some check failed, or passes that --known-gaps expects to fail
      2  wrong usage (unknown id or parameter, value out of range, store that cannot be written, a named engine
         that is not installed)
      3  an engine failed, crashed, ran out of time or took too much memory in some cell; one that runs out of time
         three times in a row is not asked again; or a named engine could run no variant of a selected case
      130  interrupted (Ctrl-C, SIGTERM, SIGHUP); finished cells are kept for --resume
    """
    if engine and all_engines:
        raise UsageError("--engine and --all-engines exclude each other: give one of them")
    from ninedisk.core.compile import cache_folder
    from ninedisk.harness.api.registry import entry_problems, match_cases
    from ninedisk.harness.results.claims import judge_claims
    from ninedisk.harness.results.store import new_run_id, prepare_store, write_run
    from ninedisk.harness.results.whole_file import check_writable
    from ninedisk.harness.run.gaps import GapFile, read_gaps, write_gaps
    from ninedisk.harness.run.journal import Journal as Kept
    from ninedisk.harness.run.journal import run_digest
    from ninedisk.harness.run.judge import exit_code
    from ninedisk.harness.run.limits import memory_limit as memory_limit_from_environment
    from ninedisk.harness.run.limits import read_size, time_limit_from_environment
    from ninedisk.harness.run.plan import plan_matrix, run_command
    from ninedisk.harness.run.provenance import command_line, provenance
    from ninedisk.harness.run.published import check_folder
    from ninedisk.harness.run.workers import run_cells
    from ninedisk.harness.wire.command import engines_given

    if jobs is not None and dask is not None:
        raise UsageError("--jobs and --dask exclude each other: a cluster has the workers that it has")
    if known_gaps is not None and write_known_gaps is not None:
        raise UsageError("--known-gaps and --write-known-gaps exclude each other: a first file is made without one")
    # Every mistake in the request is found before the first cell runs, the store's and the JSON file's included.
    at_once = read_jobs(jobs)
    for variable in (time_limit_from_environment, memory_limit_from_environment):
        variable()  # a wrong one is reported before anything runs
    new_here = not any(Path(cache_folder()).iterdir())  # scenes compile some already
    limit = None if memory_limit is None else read_size(memory_limit, "--memory-limit")
    gaps = GapFile() if known_gaps is None else read_gaps(known_gaps)
    engines = engines_given(engine or [], engine_cmd or [], everything=all_engines, profile=profile.value)
    named = {each if isinstance(each, str) else each.id for each in engines if not isinstance(each, str) or engine}
    cells = plan_matrix(
        match_cases(globs or []),
        engines,
        parse_settings(settings or []),
        parse_settings(options or [], flag="--option", example="siconos.theta=1"),
    )
    refuse_not_installed({cell.engine_id: cell.engine for cell in cells if cell.engine_id in named})
    gaps.check((cell.engine_id for cell in cells), cells)
    for note in (*(f"warning: {problem}" for problem in entry_problems()), *check_folder(published, cells)):
        typer.echo(note, err=True)
    prepare_store(store)
    if json_file is not None:
        check_writable("--json", json_file)
    if write_known_gaps is not None:
        check_writable("--write-known-gaps", write_known_gaps)
        if write_known_gaps.exists():
            raise UsageError(
                f"--write-known-gaps {str(write_known_gaps)!r} exists: give another file, or use it with --known-gaps"
            )
    if new_here and {"dem", "cd"} & {cell.engine_id for cell in cells}:
        typer.echo("note: our engines' kernels are compiled first, once: about half a minute for each engine", err=True)
    started = _current_time()
    with ExitStack() as stack:
        cluster = stack.enter_context(_cluster(dask))
        where = {"jobs": at_once} if cluster is None else cluster.facts()
        journal = Kept.start(
            store, cells, run_digest(where, published), resume=resume, notify=partial(typer.echo, err=True)
        )
        for note in journal.notes:
            typer.echo(note, err=True)
        stack.enter_context(_interruptible(journal))
        with CellProgress(len(journal.kept)) as progress:
            found = run_cells(
                cells,
                progress,
                published=published,
                jobs=at_once,
                cluster=cluster,
                memory=limit,
                kept=journal.kept,
                keep=journal.keep,
            )
        results = [gaps.with_known_gaps(result) for result in found]
        claims = judge_claims(results)
        resumed = {"resumed": len(journal.kept)} if journal.kept else {}
        facts = {
            "started": started,
            "finished": _current_time(),
            "provenance": provenance(result.cell for result in results) | where | resumed | gaps.facts(),
            "argv": command_line(),
        }
    shown = [result.cell for result in results]
    rows = [row for result in results for row in result.rows]
    headlines = [row for result in results for row in result.headlines]
    code = exit_code({status for result in results for status in result.statuses})
    if code == 0 and gaps.closed(found):
        code = 1
    idle = [] if allow_unsupported else engines_without_cells(shown, named, by_case=bool(globs))
    code = FAILURE if idle else code
    nothing = all(cell["status"] in _NOT_RUN for cell in shown)
    folder: Path | None = None
    try:
        with _interruptible(journal):
            if not (nothing and idle):
                folder = write_run(store, new_run_id(), results, claims, facts)
            journal.done()
        if json_file is not None:
            write_rows(json_file, rows)
        if write_known_gaps is not None:
            write_gaps(write_known_gaps, results)
    except StoreError as error:
        show_summary(shown, rows, None, headlines)
        fail(f"{error}{journal.after_failure()}", FAILURE)
    show_summary(shown, rows, folder, headlines)
    bad = [(WORST_FIRST.index(each.status), k) for k, each in enumerate(results) if each.status in BAD]
    if code and bad:
        typer.echo(f"to repeat the first cell that failed: {run_command(cells[min(bad)[1]])}")
    for text in idle:
        typer.echo(f"error: {text}", err=True)
    if nothing:
        stored = "" if folder is not None else ", and nothing is stored"
        typer.echo(f"warning: nothing ran, so that nothing is shown{stored}: the reasons are above", err=True)
    if write_known_gaps is not None:
        typer.echo(f"known gaps: {write_known_gaps}; write a cause into each reason")
    raise typer.Exit(code)


@contextmanager
def _interruptible(journal: Journal) -> Iterator[None]:
    """Say what is kept of a run that is interrupted in here."""
    try:
        yield
    except KeyboardInterrupt:
        fail(journal.close_unfinished(), INTERRUPTED)


def engines_without_cells(cells: Sequence[Row], named: Collection[str], *, by_case: bool) -> list[str]:
    """A message for each named engine, and with ``by_case`` each case, of which no cell ran."""
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for cell in cells:
        if cell["engine"] in named:
            groups[cell["engine"], cell["case"] if by_case else ""].append(cell)
    messages = []
    for (engine, case), group in groups.items():
        if any(cell["status"] not in _NOT_RUN for cell in group):
            continue
        sets = [frozenset(names) for cell in group if (names := missing_capabilities(cell))]
        if sets and by_case:
            fewest = min((sorted(each) for each in sets), key=lambda names: (len(names), names))
            why = f"it lacks {', '.join(fewest)}"
        else:
            why = f"it lacks {reasons(group)[0][0]}" if sets else str(group[0]["reason"]).partition("\n")[0]
        what = f"no variant of {case}" if by_case else "no variant of any case"
        messages.append(f"{engine} can run {what}: {why}; declare what it has, or give --allow-unsupported")
    return messages


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
        from ninedisk.harness.run.provenance import usable_cores

        return usable_cores()
    if text.isascii() and text.isdigit() and int(text) >= 1:
        return int(text)
    raise UsageError(f"--jobs {text} is not allowed: give a whole number >= 1, or auto for one for each core")


def _cluster(address: str | None) -> AbstractContextManager[Cluster | None]:
    if address is None:
        return nullcontext()
    from ninedisk.harness.run.cluster import connected

    return connected(address)


def _current_time() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def show_summary(
    cells: Sequence[Row],
    rows: Sequence[Row],
    folder: Path | None,
    headlines: Sequence[Row] = (),
    *,
    everything: bool = False,
    counted: Sequence[Row] | None = None,
) -> None:
    """Print the worst checks, the reasons of what went wrong, how far the engines are from the physics, the counts, and the run's folder.

    Parameters
    ----------
    cells, rows : sequence of dict
        With the columns of `schema.CELL_COLUMNS` and `schema.MEASUREMENT_COLUMNS`.
    folder : Path or None
        The stored run, ``STORE/runs/ID``; None: there is none.
    headlines : sequence of dict, optional
        With the columns of `schema.HEADLINE_COLUMNS`.
    everything : bool
        All checks and reasons, whatever room they take.
    counted : sequence of dict, optional
        The rows whose statuses are counted, if more than are shown.
    """
    out = console()
    judged = sorted((row for row in rows if row["status"] not in _NOT_RUN), key=_worst_first)
    first, rest = _first_lines(judged, everything)
    notes = _skipped_lines(cells, 10**9 if everything else NOTES_BESIDE_REASONS if first else MAX_NOTES)
    far = _headlines(headlines, 10**9 if everything else HEADLINES_BESIDE_REASONS if first else HEADLINES)
    line_limit = max(LEAST_OF_TABLE - len(far), MAX_LINES - len(first) - len(notes) - len(far))
    for line in first:
        out.print(line, soft_wrap=True)
    left_out = _print_table(out, rest, line_limit)
    lines = []
    if left_out:
        lines.append(f"... and {left_out} more: {_counts(Counter(row['status'] for row in rest[-left_out:]))}")
    lines += [*notes, *far]
    ran = [cell for cell in cells if cell["status"] not in _NOT_RUN]
    lines.append(f"ran: {' on '.join(count_noun(len({cell[key] for cell in ran}), key) for key in ('engine', 'case'))}")
    lines.append(f"cells: {_counts(Counter(str(cell['status']) for cell in cells))}")
    if same := sum(as_default(cell) for cell in cells):
        lines[-1] += f"; {same} of the unsupported only repeat the default variant"
    checks = rows if counted is None else counted
    lines.append(f"checks: {_counts(Counter(row['status'] for row in checks if row['status'] not in _NOT_RUN))}")
    wide = [
        share
        for row, share in zip(checks, allowed_shares(checks), strict=True)
        if row["status"] == "pass" and share > WIDE
    ]
    if wide:
        lines[-1] += f" ({len(wide)} of them wide: the tolerance is more than {WIDE:.0%} of the reference)"
    if folder is not None:
        lines.append(f"results: {folder}")
        if not everything:
            store = shlex.quote(str(folder.parent.parent))
            lines.append(f"all checks and reasons: ninedisk show {folder.name} --store {store}")
    for line in lines:
        out.print(line, soft_wrap=True)  # a command that is broken into two lines is none


def _headlines(rows: Sequence[Row], most: int) -> list[str]:
    """Lines: the largest headline error of each case and engine, worst first, at most so many."""
    worst: dict[tuple[str, str], Row] = {}
    for row in rows:
        if row["rel_error"] > max(worst.get((row["case"], row["engine"]), {"rel_error": -1.0})["rel_error"], -1.0):
            worst[row["case"], row["engine"]] = row
    if not worst:
        return []
    pairs = sorted(worst.values(), key=lambda row: -row["rel_error"])
    lines = [f"largest errors against exact physics ({count_noun(len(pairs), 'case-engine pair')}):"]
    for row in pairs[:most]:
        found, expected = found_and_expected(row["value"], row["expected"])
        numbers = f"{found} instead of {with_unit(expected, row['unit'])}, relative to the {row['scale_is']}"
        place = f"{row['case']} {row['engine']}: {row['headline']} [{row['variant']}]"
        lines.append(f"{share(row['rel_error']):>9} {place}: {numbers}")
    if rest := [row["rel_error"] for row in pairs[most:]]:
        lines.append(f"... and {len(rest)} more, half of them at most {share(rest[len(rest) // 2])}")
    return lines


def _print_table(out: Console, judged: Sequence[Row], line_limit: int) -> int:
    """Print as many rows as fit into ``line_limit`` lines of this terminal; the number of those left out."""
    for count in range(min(len(judged), line_limit), 0, -1):
        with out.capture() as capture:
            out.print(_table(judged[:count], narrow=out.width < NARROW))
        if count == 1 or len(capture.get().splitlines()) <= line_limit:
            out.file.write(capture.get())  # printed, its colours would count as letters and break the lines once more
            return len(judged) - count
    return 0


def _table(judged: Sequence[Row], *, narrow: bool = False) -> object:
    numbers = ("found", "expected", "error", "allowed" if narrow else "tolerance")
    headers = ("status", *(["case [variant]"] if narrow else ["case", "variant"]), "engine", "quantity", *numbers)
    truth = [] if narrow else ["truth"]
    shown = table(*headers, *truth, right=numbers, whole=("status", "engine", *numbers, "truth"))
    for row in judged:
        place = [row["case"], short_variant(row["variant"])]
        words = [
            row["status"],
            *([f"{place[0]} [{place[1]}]"] if narrow else place),
            row["engine"],
            row["quantity"] or "-",
        ]
        words += ["-" if math.isnan(row[name]) else f"{row[name]:+.4g}" for name in ("value", "expected")]
        error = _number(row["abs_error"])
        words.append(error if narrow or error == "-" else with_unit(error, row["unit"]))
        words.append(_number(row_tolerance(row) if row["quantity"] else math.nan))
        shown.add_row(*words, *([] if narrow else [row["truth"] or "-"]))
    return shown


def _worst_first(row: Row) -> tuple[bool, int, bool, float]:
    """Failures without a number come after all else that went wrong, so that they hide no number."""
    allowed, error = row_tolerance(row), float(row["abs_error"])
    ratio = error / allowed if allowed > 0.0 else error
    unknown = math.isnan(ratio)
    return (
        row["status"] not in BAD,
        len(WORST_FIRST) if has_no_value(row) else WORST_FIRST.index(row["status"]),
        unknown,
        -ratio,
    )


def _first_lines(judged: Sequence[Row], everything: bool) -> tuple[list[str], list[Row]]:
    """Lines of what went wrong, worst first, and the rows that they leave to the table.

    Each check has one line; of a cell, those without a number share one. Where lines are many, each reason has one, of its beginning
    and its end, so that none hides the others.
    """
    rows = [row for row in judged if everything or row["status"] in BAD]
    groups: dict[tuple[object, ...], list[Row]] = {}
    for k, row in enumerate(rows):
        place = (row["case"], row["variant"], row["engine"], row["reason"])
        groups.setdefault(place if has_no_value(row) else (k,), []).append(row)
    shown = [*groups.values()][: None if everything else MAX_REASONS]
    texts = [_check_text(group) for group in shown]
    lines = [line for text in texts for line in text.splitlines()]
    if not everything and len(lines) > REASON_LINES:
        lines = [_short_reason(text) for text in texts]
    listed = {id(row) for group in shown for row in group}
    return lines, [row for row in judged if id(row) not in listed]


def _check_text(group: Sequence[Row]) -> str:
    """One check with its numbers and its reason, or the checks of a cell that lack a number for one reason."""
    row = group[0]
    place = f"{row['status']}: {row['case']} [{row['variant']}] {row['engine']}"
    if has_no_value(row):
        return f"{place}, no value of {', '.join(dict.fromkeys(each['quantity'] for each in group))}: {row['reason']}"
    if not row["quantity"]:
        return f"{place}: {row['reason']}" if row["reason"] else place
    numbers, reason = "", row["reason"]
    if row["status"] != "fail" and not math.isnan(row["abs_error"]):
        found, expected = found_and_expected(row["value"], row["expected"])
        error = with_unit(f"{row['abs_error']:.3g}", row["unit"])
        numbers = f"found {found}, expected {expected}: error {error}, tolerance {row_tolerance(row):.3g}"
    return f"{place} {row['quantity']}: {'; '.join(text for text in (numbers, reason) if text)} ({row['truth']})"


def _short_reason(text: str) -> str:
    """One line: what went wrong is at the beginning, the way out or what the engine said last at the end."""
    lines = [
        line if len(line) <= MAX_LENGTH else f"{line[: MAX_LENGTH // 2]} ... {line[-MAX_LENGTH // 2 :]}"
        for line in text.splitlines()
    ]
    return " ... ".join([lines[0], *lines[1:][-1:]])


def _skipped_lines(cells: Sequence[Row], most: int) -> list[str]:
    """One line for each engine and reason, the most frequent first; if these are more than ``most``, one for each status.

    Then what each engine behind a command should declare first.
    """
    found: dict[str, Counter[tuple[str, str]]] = defaultdict(Counter)
    for cell in cells:
        if cell["status"] in _NOT_RUN:
            found[cell["status"]][str(cell["engine"]), str(cell["reason"])] += 1
    commands = dict.fromkeys(cell["engine"] for cell in cells if str(cell["engine_runs"]).startswith("command `"))
    ranked = [line for engine in commands for line in ranking_lines(engine, cells)]
    if sum(len(kinds) for kinds in found.values()) <= most:
        return [
            *(
                f"{status}: {engine}, {count_noun(count, 'cell')}: {reason}"
                for status, kinds in sorted(found.items())
                for (engine, reason), count in sorted(kinds.items(), key=lambda each: (each[0][0], -each[1], each[0]))
            ),
            *ranked,
        ]
    lines = []
    for status, kinds in sorted(found.items()):
        engines = sorted({engine for engine, _ in kinds})
        if status == "not-installed":
            lines.append(f"{status}: {', '.join(engines)}; how to install them: ninedisk list engines")
        else:
            why = reasons(cells)
            words = [f"{count} {reason[:LACKING_LENGTH]}" for reason, count in why[:MAX_LACKING]]
            words += [f"{sum(count for _, count in why[MAX_LACKING:])} for other reasons"] if why[MAX_LACKING:] else []
            words += (
                [f"{same} only repeat the default variant"] if (same := sum(as_default(cell) for cell in cells)) else []
            )
            lines.append(
                f"{status}: {count_noun(kinds.total(), 'cell')} on {', '.join(engines)}; lacking: {', '.join(words)}"
            )
    return [*lines, *ranked]


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{counter[status]} {status}" for status in WORST_FIRST if counter[status]) or "none"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"
