"""``ninedisk compare`` and ``ninedisk dashboard``: better or worse than before?"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.api.text import one_line
from ninedisk.harness.cli.support import CellProgress, Store, guarded
from ninedisk.harness.terminal import console, table

if TYPE_CHECKING:
    from ninedisk.harness.results.schema import Comparison, RunFacts

MAX_ROWS = 60
SUMMARY_VARIABLE = "GITHUB_STEP_SUMMARY"
"""Names the file that GitHub Actions shows as the summary of a step."""


def execute(
    base: str,
    head: str,
    *,
    store: Path,
    files: Mapping[str, Path | None],
    everything: bool,
) -> int:
    """Compare, print, write; the exit code of the command.

    Raises
    ------
    UsageError, StoreError
        With the message to show.
    """
    from ninedisk.harness.results.compare import as_json, counts, junit, markdown, resolve, side
    from ninedisk.harness.results.compare import compare as compared
    from ninedisk.harness.results.whole_file import check_writable, write_whole
    from ninedisk.reports.studies import comparison_page

    for name, path in files.items():
        if path is not None:
            check_writable(f"--{name}", path)
    found = compared(side(resolve(base, store)), side(resolve(head, store)))
    _show(found, everything)
    texts = {"markdown": markdown, "junit": junit, "json": as_json, "html": comparison_page}
    for name, path in files.items():
        if path is not None:
            write_whole(f"--{name}", path, texts[name](found))
    _append_summary(found)
    return 1 if counts(found)["worse"] else 0


def _build_dashboard(store: Path, out: Path, last: int) -> Path:
    """Read the newest ``last`` runs, find what changed, write the pages; the first page.

    Raises
    ------
    UsageError, StoreError
        If there is no run, or one cannot be read.
    """
    from ninedisk.harness.results.history import history
    from ninedisk.harness.results.reader import run_ids
    from ninedisk.harness.results.store import load_snapshot, sorted_runs
    from ninedisk.reports.dashboard import build_dashboard

    ids = run_ids(store)
    if not ids:
        raise UsageError(f"the store {str(store)!r} has no finished run: run `ninedisk run --store {store}` first")
    with CellProgress() as progress:
        runs = []
        for done, run_id in enumerate(ids):
            progress(done, len(ids), "reading runs")
            runs.append(load_snapshot(store, run_id))
        progress(len(ids), len(ids), "looking for changes")
        found = history(sorted_runs(runs)[-last:])
        return build_dashboard(found, out, lambda stage, done, total: progress(done, total, stage))


def _append_summary(found: Comparison) -> None:
    from ninedisk.harness.results.compare import markdown

    path = os.environ.get(SUMMARY_VARIABLE)
    if not path:
        return
    try:
        with open(path, "a", encoding="utf-8") as file:
            file.write(markdown(found) + "\n")
    except OSError as error:
        raise StoreError(f"${SUMMARY_VARIABLE} {path!r} cannot be written ({error.strerror or error})") from error


def _show(found: Comparison, everything: bool) -> None:
    from ninedisk.harness.results.compare import change_numbers, changed_quantity, headline, worth_showing
    from ninedisk.harness.results.schema import short_variant

    out = console()
    for name, facts, runs in (("BASE", found.base, found.base_runs), ("HEAD", found.head, found.head_runs)):
        out.print(f"{name}: {_facts(facts)}" + (f"; timings of {runs} runs" if runs > 1 else ""))
    changes = list(found.changes) if everything else worth_showing(found)
    if changes:
        shown = table("", "case", "variant", "engine", "what", "base", "head", "change", "tolerance", "why",
                      right=("base", "head", "change", "tolerance"), whole=("", "engine", "base", "head", "change"))  # fmt: skip
        for change in changes if everything else changes[:MAX_ROWS]:
            words = (
                change.verdict,
                change.case,
                short_variant(change.variant),
                change.engine,
                changed_quantity(change),
            )
            shown.add_row(*(one_line(str(text)) for text in (*words, *change_numbers(change), change.reason[:200])))
        out.print(shown)
    if not everything and len(changes) > MAX_ROWS:
        out.print(f"... and {len(changes) - MAX_ROWS} more; --all, --json or --html shows them")
    out.print(headline(found))


def _facts(facts: RunFacts) -> str:
    commit = f", commit {facts.commit[:12]}" if facts.commit else ""
    return one_line(f"{facts.run_id}, {facts.started}{commit}, {facts.machine}")


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command("compare", short_help="Check whether HEAD is worse than BASE.")(compare)
    app.command("dashboard", short_help="Build pages with the history of every error and timing.")(dashboard)


@guarded
def compare(
    base: Annotated[str, typer.Argument(metavar="BASE", help="The run(s) before.")],
    head: Annotated[str, typer.Argument(metavar="HEAD", help="The run(s) after.")],
    markdown: Annotated[
        Path | None, typer.Option("--markdown", metavar="FILE", help="Also write GitHub-flavoured Markdown.")
    ] = None,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="Also write JUnit XML for a CI's test view.")
    ] = None,
    html: Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Also write a page.")] = None,
    json: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write every change.")] = None,
    everything: Annotated[bool, typer.Option("--all", help="Show what stayed the same, too.")] = False,
    store: Store = Path("results"),
) -> None:
    """Compare errors, statuses and timings of two runs, and report what got worse beyond its noise or tolerance.

    BASE and HEAD are each a run id (or its beginning), latest, latest~1, a range latest~9..latest~5, the folder of a
    store or of one run, or a file of `ninedisk export`. Where a side has several runs, its newest decides about errors,
    and all of them together give the timings: five runs a side find a slowdown of 30 %.

    \b
    An error got worse when its check now fails, or when it is more than twice as large and above a tenth of its
    tolerance: below that it is round-off, which any other compiler or processor moves. A timing,
    CPU seconds relative to a reference computation timed beside it, got worse when it is above 5 ms and 20 % slower
    beyond the noise of the same runs; --html and --markdown state the rule in full.
    Results of different case versions, and timings of different machines, are said to be not comparable.

    \b
    Examples:
      ninedisk compare latest~1 latest
      ninedisk compare latest~9..latest~5 latest~4..latest
      ninedisk compare base.parquet head.parquet --junit compare.xml
      ninedisk compare main-results results --markdown summary.md --html compare.html

    \b
    In GitHub Actions the summary is also appended to the file that $GITHUB_STEP_SUMMARY names.

    \b
    Exit codes:
      0  nothing got worse
      1  something got worse: a check, a timing, or a cell that ran and now breaks
      2  wrong usage, or a run that cannot be read
    """

    files = {"markdown": markdown, "junit": junit, "html": html, "json": json}
    raise typer.Exit(execute(base, head, store=store, files=files, everything=everything))


@guarded
def dashboard(
    store: Store = Path("results"),
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pages.")] = Path("dashboard"),
    last: Annotated[int, typer.Option("--last", metavar="N", min=2, help="Use the newest N runs only.")] = 120,
) -> None:
    """Build the regression dashboard: static pages that need no server and no network.

    One line for each measured error and each timing, per case, engine and machine; places where a line changed for
    good are marked, worst first, with commit and versions, and lead to a comparison of the runs around them. Runs of
    another machine, or of another version of a case, are never joined into one line.

    \b
    Examples:
      ninedisk dashboard
      ninedisk merge from-ci --store history && ninedisk dashboard --store history --out public
    """

    typer.echo(f"dashboard: {_build_dashboard(store, out, last)}")
