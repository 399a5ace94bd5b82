"""``ninedisk docs``: the documentation as pages, made of the cases themselves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.cli.support import CellProgress, guarded


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("docs", short_help="Build the documentation: a page for every case, and the guides.")(docs)


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
    from ninedisk.harness.results.whole_file import check_folder
    from ninedisk.harness.run.case_record import docs_record
    from ninedisk.reports.docs import write_docs

    check_folder("--out", out)
    texts = read_guides(guides_in(guides))
    with CellProgress() as progress:
        record = docs_record(progress)
    typer.echo(f"documentation: {write_docs(record, texts, out, guides)}")


def read_guides(files: Sequence[Path]) -> list[tuple[str, str]]:
    """Name and text of every Markdown file that was asked for.

    Raises
    ------
    UsageError
        If one cannot be read.
    """
    found = []
    for path in files:
        try:
            found.append((path.name, path.read_text(encoding="utf-8")))
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"the guide {str(path)!r} cannot be read: {error}") from error
    return found


def guides_in(folder: Path | None) -> list[Path]:
    """Markdown files of a folder, by name; none where no folder is named.

    Raises
    ------
    UsageError
        If the folder is named and has none.
    """
    if folder is None:
        return []
    found = sorted(folder.glob("*.md")) if folder.is_dir() else []
    if not found:
        raise UsageError(f"--guides {str(folder)!r} holds no Markdown file: give a folder with *.md")
    return found
