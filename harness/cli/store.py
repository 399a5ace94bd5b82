"""``ninedisk runs``, ``show``, ``merge``, ``export`` and ``prune``: the commands that look after stores."""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

import typer

from ninedisk.harness.api.text import count_noun, one_line
from ninedisk.harness.cli.support import Store, guarded
from ninedisk.harness.results.schema import Row
from ninedisk.harness.terminal import console, table

MAX_ENGINES = 4
"""Engines of a run that `ninedisk runs` names."""


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command("runs", short_help="List the stored runs.")(runs)
    app.command("show", short_help="Show a stored run: checks, reasons, what did not run.")(show)
    app.command("merge", short_help="Copy the runs of other stores into one.")(merge)
    app.command("export", short_help="Write stored runs as CSV, JSON or Parquet.")(export)
    app.command("prune", short_help="Remove old or half-written runs.")(prune)


@guarded
def runs(store: Store = Path("results")) -> None:
    """List the stored runs, oldest first: when, of which commit, on which machine, with which outcome.

    The last line is what `latest` means; the one above it is `latest~1`. Runs that cannot be read are listed with the
    reason, half-written ones too.

    \b
    Examples:
      ninedisk runs
      ninedisk runs --store nightly
    """
    from ninedisk.harness.results.schema import WORST_FIRST
    from ninedisk.harness.results.store import list_folders

    found = list_folders(store)
    out = console()
    shown = table("run", "started", "commit", "machine", "engines", "cells", whole=("run", "started", "commit"))
    for run in found:
        if run.facts is None:
            shown.add_row(one_line(run.name), "", "", "", "", one_line(run.problem))
            continue
        outcome = ", ".join(f"{run.cells[status]} {status}" for status in WORST_FIRST if run.cells[status])
        few = ", ".join(run.engines) if len(run.engines) <= MAX_ENGINES else f"{len(run.engines)} engines"
        facts = (
            run.name,
            run.facts.started[:16].replace("T", " "),
            run.facts.commit[:12] or "-",
            run.facts.machine,
            few,
        )
        shown.add_row(*(one_line(text) for text in (*facts, outcome or "none")))
    if found:
        out.print(shown)
    else:
        out.print(f"no runs in {str(store)!r}; `ninedisk run --store {store}` makes one")


@guarded
def show(
    which: Annotated[
        str | None,
        typer.Argument(
            metavar="RUN", help="A run as in `ninedisk compare`. None: the newest with such an engine and case."
        ),
    ] = None,
    case: Annotated[str, typer.Option("--case", metavar="GLOB", help="Only cases whose ids match.")] = "*",
    engine: Annotated[str | None, typer.Option("--engine", "-e", metavar="ID", help="Only this engine.")] = None,
    status: Annotated[
        list[str] | None,
        typer.Option(
            "--status",
            metavar="STATUS",
            help="Only checks and cells of this status (ninedisk list statuses), or no-value: failures without a number. Repeat.",
        ),
    ] = None,
    store: Store = Path("results"),
) -> None:
    """Show what a run has stored: every check that does not pass, worst first, with its numbers and its reason in full, why cells did
    not run, and the largest headline error of each case and engine: how far from the physics it is.

    Passing checks are shown where --status pass, an engine or a case asks for them. Failures for want of a number come after the
    others, one line for each cell; --status no-value shows these alone. Nothing is run.

    \b
    Examples:
      ninedisk show
      ninedisk show latest~1 --engine yade
      ninedisk show --status fail --status error --case 'nine-disk/*'
      ninedisk show --engine acme --status no-value
    """
    from ninedisk.harness.api.errors import UsageError, close_matches, not_one_of
    from ninedisk.harness.cli.run import show_summary
    from ninedisk.harness.results.compare import newest_first, one_stored
    from ninedisk.harness.results.reader import cell_key, read_about, read_rows
    from ninedisk.harness.results.schema import NO_VALUE, STATUSES, has_no_value

    if unknown := sorted(set(status or ()) - {*STATUSES, NO_VALUE}):
        said = not_one_of("--status", unknown[0], (NO_VALUE, *STATUSES))
        raise UsageError(f"{said}; `ninedisk list statuses` explains them")
    few = set(status) if status else set(STATUSES) - (set() if engine or case != "*" else {"pass"})

    def of(run_id: str, name: str) -> list[Row]:
        rows = read_rows(store, read_about(store, run_id), name)
        return [row for row in rows if fnmatchcase(row["case"], case) and engine in (None, row["engine"])]

    newest = one_stored("latest" if which is None else which, store)
    candidates = newest_first(store) if which is None else [newest]
    run_id = next((each for each in candidates if of(each, "cells")), None)
    wanted = f"--case {case} --engine {engine or 'ID'}"
    if run_id is None:
        held = [
            (row["engine"], row["case"])
            for each in candidates
            for row in read_rows(store, read_about(store, each), "cells", ["engine", "case"])
        ]
        names, cases = ({pair[k] for pair in held} for k in (0, 1))
        where = "no run of the store has a" if which is None else f"the run {newest} has no"
        near = "" if engine in names or engine is None else close_matches(engine, names)
        near += "" if any(fnmatchcase(name, case) for name in cases) else close_matches(case, cases)
        out = "; leave RUN out for the newest run that has it" if which is not None else ""
        raise UsageError(
            f"{where} cell of {wanted}; its engines: {', '.join(sorted(names))}{out}{'.' if near else ''}{near}"
        )
    if run_id != newest:
        typer.echo(f"note: the newest run that has it is {run_id}; {newest} has no cell of {wanted}", err=True)
    cells, rows = of(run_id, "cells"), of(run_id, "measurements")
    chosen = [row for row in rows if row["status"] in few or (NO_VALUE in few and has_no_value(row))]
    missing = {cell_key(row) for row in chosen if has_no_value(row)}
    shown_cells = [
        cell
        for cell in cells
        if cell["status"] in set(status or STATUSES) or (NO_VALUE in few and cell_key(cell) in missing)
    ]
    shown_keys = {cell_key(cell) for cell in shown_cells}
    headlines = [row for row in of(run_id, "headlines") if cell_key(row) in shown_keys]
    show_summary(shown_cells, chosen, store / "runs" / run_id, headlines, everything=True, counted=rows)


@guarded
def merge(
    sources: Annotated[list[Path], typer.Argument(metavar="DIR", help="Stores to copy from; they stay as they are.")],
    store: Store = Path("results"),
) -> None:
    """Copy the runs of other stores, for instance of other machines, into one store.

    Runs that are there already are left alone; half-written ones are never copied, and a damaged one stops the merge
    before it is copied. Needs no lock and may be repeated.

    \b
    Examples:
      ninedisk merge from-laptop from-cluster
      ninedisk merge artifacts/results --store history
    """
    from ninedisk.harness.results.store import merge as merge_stores

    copied, present = merge_stores(sources, store)
    typer.echo(f"{count_noun(len(copied), 'run')} copied into {store}, {len(present)} already there")


@guarded
def export(
    which: Annotated[
        list[str] | None,
        typer.Argument(metavar="RUN", help="Runs as in `ninedisk compare`: ids, latest, latest~4..latest. None: all."),
    ] = None,
    csv: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write a .csv file.")] = None,
    json: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write a .json file.")] = None,
    parquet: Annotated[Path | None, typer.Option("--parquet", metavar="FILE", help="Write a .parquet file.")] = None,
    store: Store = Path("results"),
) -> None:
    """Write stored runs as one flat table: a row for each check, with its run, commit, machine, versions and timings.

    A cell that left no number has one row with its status and reason. Numbers keep all their digits. `ninedisk compare`
    reads all three kinds of file. Curves are not exported: they are in the store's series.parquet.

    \b
    Examples:
      ninedisk export --csv all.csv
      ninedisk export latest --json head.json
      ninedisk export latest~9..latest --parquet ten.parquet --store nightly
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.results.compare import resolve
    from ninedisk.harness.results.export import export_rows, write_export
    from ninedisk.harness.results.store import load_snapshots

    files = {".csv": csv, ".json": json, ".parquet": parquet}
    if not any(files.values()):
        raise UsageError("nothing to write: give --csv FILE, --json FILE or --parquet FILE")
    for suffix, path in files.items():
        if path is not None and path.suffix != suffix:
            raise UsageError(f"--{suffix[1:]} {str(path)!r} must end in {suffix}, so that it can be read again")
    chosen = [run for word in which for run in resolve(word, store)] if which else load_snapshots(store)
    distinct = {run.facts.run_id: run for run in chosen}
    if not distinct:
        raise UsageError(f"the store {str(store)!r} has no finished run: name another with --store DIR")
    rows = export_rows(distinct.values())
    for path in files.values():
        if path is not None:
            write_export(rows, path)
            typer.echo(f"{path}: {count_noun(len(rows), 'row')} of {count_noun(len(distinct), 'run')}")


@guarded
def prune(
    keep: Annotated[int | None, typer.Option("--keep", metavar="N", min=0, help="Keep only the newest N runs.")] = None,
    before: Annotated[
        str | None, typer.Option("--before", metavar="DATE", help="Remove runs that began before, e.g. 2026-01-31.")
    ] = None,
    unreadable: Annotated[
        bool, typer.Option("--unreadable", help="Remove damaged runs and those of too old a schema.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Really remove; without it, only say what would go.")] = False,
    store: Store = Path("results"),
) -> None:
    """Remove runs: half-written and interrupted ones untouched for a day, and what is asked for. Without --yes nothing is removed.

    What the report and the dashboard show comes from the runs: `ninedisk export` or a copy keeps them elsewhere first.

    \b
    Examples:
      ninedisk prune
      ninedisk prune --keep 100
      ninedisk prune --before 2026-01-31 --yes
    """
    from datetime import UTC, datetime

    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.results.store import prune as remove
    from ninedisk.harness.results.store import prune_candidates

    try:
        date = None if before is None else datetime.fromisoformat(before)
    except ValueError as error:
        raise UsageError(f"--before {before!r} is no date: write year-month-day, for instance 2026-01-31") from error
    if date is not None and date.tzinfo is None:
        date = date.replace(tzinfo=UTC)
    doomed = prune_candidates(store, keep=keep, before=date, unreadable=unreadable)
    for each in doomed:
        typer.echo(f"{'remove' if yes else 'would remove'} {each.path}: {one_line(each.reason)}")
    if yes:
        remove(doomed)
    rest = "" if yes or not doomed else "; nothing was removed: add --yes"
    typer.echo(f"{count_noun(len(doomed), 'run')}{rest}" if doomed else "nothing to remove")
