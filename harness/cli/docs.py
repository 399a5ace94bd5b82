"""``ninedisk docs``: the documentation as pages, made of the cases themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from ninedisk.harness.cli.support import guarded

Record = list[dict[str, Any]]
WriteDocs = Callable[[Record, Sequence[tuple[str, str]], Path, Path | None], Path]


def register(app: typer.Typer, write_docs: WriteDocs) -> None:
    """Add the command; ``write_docs`` makes the pages, which the harness knows nothing of."""

    @app.command("docs", short_help="Build the documentation: a page for every case, and the guides.")
    @guarded
    def docs(
        out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pages.")] = Path("docs-html"),
        guides: Annotated[
            Path | None,
            typer.Option("--guides", metavar="DIR", help="Also render the Markdown files of this folder."),
        ] = None,
    ) -> None:
        """Build static pages that need no network: every case with its sketch, source, requirement, parameters with units and
        ranges, truths, tolerances with their reasons, and commands to try; with --guides also the pages of a folder of
        Markdown files, for instance that of the source tree's docs.

        Nothing is run: which truths bind which engine follows from the case and the engine's facts. Cases of installed
        packages have their pages, too.

        \b
        Examples:
          ninedisk docs
          ninedisk docs --guides docs --out public
        """
        from ninedisk.harness.cli.docs_part import docs_record, guides_in, read_guides
        from ninedisk.harness.cli.support import CellProgress
        from ninedisk.harness.results.whole_file import check_folder

        check_folder("--out", out)
        texts = read_guides(guides_in(guides))
        with CellProgress() as progress:
            record = docs_record(progress)
        typer.echo(f"documentation: {write_docs(record, texts, out, guides)}")
