"""``ninedisk site``: a public site of stores, with an address for every number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ninedisk.harness.cli.support import CellProgress, guarded


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("site", short_help="Build a public site with an address for every number.")(site)


@guarded
def site(
    store: Annotated[
        list[Path] | None,
        typer.Option("--store", metavar="DIR", help="Folder of stored results; repeat for several. Default: results"),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the site.")] = Path("site"),
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Write nothing: derive every number anew from the stores, fail on the first that differs."
        ),
    ] = False,
) -> None:
    """Build a static site of any number of stores and versions: scores by case and engine, history, data, how to repeat.

    A score is the largest headline error of a case, in the newest run of the engine's newest version; it leads to the
    rows that it is made of. Addresses are made of names alone and stay: engine/ENGINE/VERSION/CASE.html#QUANTITY with
    .json, .parquet and .cite.html beside it, case/CASE.html, badge/ENGINE.svg for the engine's own README.

    \b
    Examples:
      ninedisk site --store results --out public
      ninedisk site --store nightly --store releases --out public
      ninedisk site --store nightly --store releases --out public --check

    \b
    Exit codes:
      0  the site is written, or every number of it follows from the stores
      1  --check: something differs; the first file and place are named
      2  wrong usage, or a store that cannot be read
    """
    from ninedisk.reports.site import build_site, check_site

    stores = store or [Path("results")]
    with CellProgress() as progress:
        reported = (check_site if check else build_site)(
            stores, out, lambda label, done, total: progress(done, total, label)
        )
    if not check:
        typer.echo(f"site: {reported}")
    elif reported:
        typer.echo(f"differs: {reported}", err=True)
        raise typer.Exit(1)
    else:
        typer.echo(f"every file of {out} follows from the stores")
