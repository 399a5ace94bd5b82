"""``ninedisk docs``: the documentation as pages, made of the cases and docstrings themselves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.cli.support import CellProgress, guarded


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("docs", short_help="Build the documentation: cases, API reference, guides.")(docs)


@guarded
def docs(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pages.")] = Path("docs-html"),
    guides: Annotated[
        Path | None,
        typer.Option(
            "--guides", metavar="DIR", help="Also render the Markdown files of this folder and of the folders in it."
        ),
    ] = None,
) -> None:
    """Build static pages that need no network: every case with its sketch, source, requirement, parameters with units and
    ranges, truths, tolerances with their reasons, and commands to try; the API reference, from the docstrings; with --guides
    also the Markdown files of a folder and of the folders in it, for instance those of the source tree's docs. The index lists them
    folder by folder.

    Nothing is run: which truths bind which engine follows from the case and the engine's facts. Cases of installed
    packages have their pages, too.

    \b
    Examples:
      ninedisk docs
      ninedisk docs --guides docs --out public
    """
    from ninedisk.harness.results.whole_file import check_folder
    from ninedisk.harness.run.api_record import api_record
    from ninedisk.harness.run.case_record import docs_record
    from ninedisk.reports.docs import write_docs

    check_folder("--out", out)
    texts = [] if guides is None else read_guides(guides, guides_in(guides))
    with CellProgress() as progress:
        record = docs_record(progress)
    typer.echo(f"documentation: {write_docs(record, texts, out, guides, api_record())}")


def read_guides(folder: Path, files: Sequence[Path]) -> list[tuple[str, str]]:
    """Path within the folder and text of every Markdown file.

    Raises
    ------
    UsageError
        If one cannot be read.
    """
    found = []
    for path in files:
        try:
            found.append((path.relative_to(folder).as_posix(), path.read_text(encoding="utf-8")))
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"the guide {str(path)!r} cannot be read: {error}") from error
    return found


def guides_in(folder: Path) -> list[Path]:
    """Markdown files of a folder and of the folders in it, by name; no deeper, where examples may keep packages of others.

    Raises
    ------
    UsageError
        If there is none.
    """
    found = sorted([*folder.glob("*.md"), *folder.glob("*/*.md")]) if folder.is_dir() else []
    if not found:
        raise UsageError(f"--guides {str(folder)!r} holds no Markdown file: give a folder with *.md")
    return found
