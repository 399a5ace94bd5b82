"""The work of ``ninedisk compare`` and ``ninedisk dashboard``."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.api.text import printable
from ninedisk.harness.cli.cli_tables import console, table
from ninedisk.harness.cli.support import CellProgress
from ninedisk.harness.results.compare import compare, counts, side
from ninedisk.harness.results.compare_sides import resolve
from ninedisk.harness.results.compare_text import as_json, headline, junit, markdown, numbers, what, worth_showing
from ninedisk.harness.results.history import history
from ninedisk.harness.results.schema import Comparison, History, RunFacts
from ninedisk.harness.results.snapshot import in_order, load_snapshot
from ninedisk.harness.results.store import run_ids

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
    write_page: Callable[[Comparison, Path], None],
) -> int:
    """Compare, print, write; the exit code of the command.

    Raises
    ------
    UsageError, StoreError
        With the message to show.
    """
    for name, path in files.items():
        if path is not None and (path.is_dir() or not path.absolute().parent.is_dir()):
            raise UsageError(f"--{name} {str(path)!r} cannot be written: give a file in a folder that exists")
    found = compare(side(resolve(base, store)), side(resolve(head, store)))
    _show(found, everything)
    writers: dict[str, Callable[[Path], None]] = {
        "markdown": lambda path: _write(path, markdown(found)),
        "junit": lambda path: _write(path, junit(found)),
        "json": lambda path: _write(path, as_json(found)),
        "html": lambda path: write_page(found, path),
    }
    for name, path in files.items():
        if path is not None:
            try:
                writers[name](path)
            except OSError as error:
                raise StoreError(f"--{name} {str(path)!r} cannot be written ({error.strerror or error})") from error
    _append_summary(found)
    return 1 if counts(found)["worse"] else 0


def build_dashboard(
    store: Path, out: Path, last: int, write_folder: Callable[[History, Path, Callable[[str, int, int], None]], Path]
) -> Path:
    """Read the newest ``last`` runs, find what changed, write the pages; the first page.

    Raises
    ------
    UsageError, StoreError
        If there is no run, or one cannot be read.
    """
    ids = run_ids(store)
    if not ids:
        raise UsageError(f"the store {str(store)!r} has no finished run: run `ninedisk run --store {store}` first")
    with CellProgress() as progress:
        runs = []
        for done, run_id in enumerate(ids):
            progress(done, len(ids), "reading runs")
            runs.append(load_snapshot(store, run_id))
        progress(len(ids), len(ids), "looking for changes")
        found = history(in_order(runs)[-last:])
        return write_folder(found, out, lambda stage, done, total: progress(done, total, stage))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _append_summary(found: Comparison) -> None:
    path = os.environ.get(SUMMARY_VARIABLE)
    if not path:
        return
    try:
        with open(path, "a", encoding="utf-8") as file:
            file.write(markdown(found) + "\n")
    except OSError as error:
        raise StoreError(f"${SUMMARY_VARIABLE} {path!r} cannot be written ({error.strerror or error})") from error


def _show(found: Comparison, everything: bool) -> None:
    out = console()
    for name, facts, runs in (("BASE", found.base, found.base_runs), ("HEAD", found.head, found.head_runs)):
        out.print(f"{name}: {_facts(facts)}" + (f"; timings of {runs} runs" if runs > 1 else ""))
    changes = list(found.changes) if everything else worth_showing(found)
    if changes:
        shown = table("", "case", "variant", "engine", "what", "base", "head", "change", "tolerance", "why",
                      right=("base", "head", "change", "tolerance"))  # fmt: skip
        for change in changes if everything else changes[:MAX_ROWS]:
            words = (change.verdict, change.case, change.variant, change.engine, what(change))
            shown.add_row(*(printable(str(text)) for text in (*words, *numbers(change), change.reason[:200])))
        out.print(shown)
    if not everything and len(changes) > MAX_ROWS:
        out.print(f"... and {len(changes) - MAX_ROWS} more; --all, --json or --html shows them")
    out.print(headline(found))


def _facts(facts: RunFacts) -> str:
    commit = f", commit {facts.commit[:12]}" if facts.commit else ""
    return printable(f"{facts.run_id}, {facts.started}{commit}, {facts.machine}")
