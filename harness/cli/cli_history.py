"""``ninedisk compare`` and ``ninedisk dashboard``: better or worse than before?"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.cli.store import Store
from ninedisk.harness.cli.support import guarded

if TYPE_CHECKING:
    from ninedisk.harness.results.schema import Comparison, History
WritePage = Callable[["Comparison", Path], None]
WriteFolder = Callable[["History", Path, Callable[[str, int, int], None]], Path]


def register(app: typer.Typer, write_page: WritePage, write_folder: WriteFolder) -> None:
    """Add the commands; ``write_page`` and ``write_folder`` make the pages, which the harness knows nothing of."""

    @app.command("compare", short_help="Tell whether HEAD is worse than BASE.")
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
        """Compare errors, statuses and timings of two runs, and tell what got worse beyond its noise or tolerance.

        BASE and HEAD are each a run id (or its beginning), latest, latest~1, a range latest~9..latest~5, the folder of a
        store or of one run, or a file of `ninedisk export`. Where a side has several runs, its newest decides about errors,
        and all of them together give the timings: one timing alone is mostly noise, seven runs a side are plenty.

        \b
        An error got worse when its check now fails, or when it is more than twice as large and above a tenth of its
        tolerance: below that it is round-off, which any other compiler or processor moves. A timing got worse when it is
        10 % slower beyond the noise that the timings themselves show; --html and --markdown state the rule in full.
        Results of different case versions, and timings of different machines, are said to be not comparable.

        \b
        Examples:
          ninedisk compare latest~1 latest
          ninedisk compare latest~13..latest~7 latest~6..latest
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
        from ninedisk.harness.cli.compare import execute

        files = {"markdown": markdown, "junit": junit, "html": html, "json": json}
        raise typer.Exit(execute(base, head, store=store, files=files, everything=everything, write_page=write_page))

    @app.command("dashboard", short_help="Build pages with the history of every error and timing.")
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
        from ninedisk.harness.cli.compare import build_dashboard

        typer.echo(f"dashboard: {build_dashboard(store, out, last, write_folder)}")
