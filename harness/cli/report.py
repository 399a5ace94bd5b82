"""``ninedisk report``: the comparison pages of a store."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.cli.support import CellProgress, Store, guarded

if TYPE_CHECKING:
    from ninedisk.harness.results.schema import Comparison


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("report", short_help="Build the comparison report from the store.")(report)


@guarded
def report(
    store: Store = Path("results"),
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pages.")] = Path("report"),
) -> None:
    """Build the comparison report from the stored results and say where its first page is.

    \b
    Example:
      ninedisk report --store results --out report
    """
    from ninedisk.harness.api.finding import known_findings
    from ninedisk.harness.results.findings import evaluate
    from ninedisk.reports.build import build_report

    with CellProgress() as progress:
        findings = evaluate(store, known_findings(), progress)
        changes = _since_the_run_before(store)
        page = build_report(store, out, lambda label, done, total: progress(done, total, label), findings, changes)
    typer.echo(f"report: {page}")


def _since_the_run_before(store: Path) -> Comparison | None:
    """The newest run against the one before; None where there is none."""
    from ninedisk.harness.results.compare import compare, resolve, side
    from ninedisk.harness.results.reader import run_ids

    if len(run_ids(store)) < 2:
        return None
    return compare(side(resolve("latest~1", store)), side(resolve("latest", store)))
