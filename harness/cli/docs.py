"""``ninedisk docs``: the documentation as pages, made of the cases themselves.

What the documentation says about every case, taken from the case itself; plain data for the pages.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ninedisk.harness.api.case import Case
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.params import allowed, format_value
from ninedisk.harness.api.registry import case_table, engine_table, get_case
from ninedisk.harness.cli.support import guarded
from ninedisk.harness.results.schema import Row, tolerance
from ninedisk.harness.results.tables import plain_json
from ninedisk.harness.run.judge import largest
from ninedisk.harness.run.plan import Cell, plan_matrix
from ninedisk.harness.run.runner import dry_checks

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
        from ninedisk.harness.cli.support import CellProgress
        from ninedisk.harness.results.whole_file import check_folder

        check_folder("--out", out)
        texts = read_guides(guides_in(guides))
        with CellProgress() as progress:
            record = docs_record(progress)
        typer.echo(f"documentation: {write_docs(record, texts, out, guides)}")


OURS = ("dem", "cd")
"""Engines that the example commands use."""

Progress = Callable[[int, int, str], None]


def docs_record(progress: Progress | None = None) -> list[Row]:
    """A record of every case: ``id, version, title, source, requirement, about, parameters, variants, setup, truths, commands``.

    ``truths`` are those that bind the engines on the first variant of the matrix, found without running anything.
    """
    found = []
    ids = list(case_table())
    for done, case_id in enumerate(ids):
        if progress is not None:
            progress(done, len(ids), case_id)
        found.append(case_record(get_case(case_id)))
    if progress is not None:
        progress(len(ids), len(ids), "")
    return found


def case_record(case: Case) -> Row:
    """The record of one case."""
    shown = dict(case.matrix()[0])
    cells = plan_matrix([case.id], list(engine_table()), shown)
    setup = cells[0].setup
    if isinstance(setup, Exception):
        raise setup
    stored = {
        "scene": setup.scene.to_dict(),
        "watch": [list(pair) for pair in setup.watch],
        "labels": {name: list(pair) for name, pair in setup.labels.items()},
    }
    return {
        "id": case.id,
        "version": case.version,
        "title": case.title,
        "source": case.source,
        "requirement": case.requirement,
        "about": inspect.cleandoc(type(case).__doc__ or ""),
        "parameters": [
            {
                "name": p.name,
                "default": format_value(p.default),
                "unit": p.unit,
                "allowed": allowed(p),
                "help": p.help,
                "only_for": p.only_for,
            }
            for p in case.parameters
        ],
        "variants": [settings_text(row) for row in case.matrix()],
        "shown": settings_text(shown),
        "setup": json.loads(plain_json(stored)),
        "truths": truths(cells),
        "commands": commands(case.id, cells, shown),
    }


def settings_text(row: Any) -> str:
    """``name=value`` of a variant's overrides, joined by commas."""
    return ", ".join(f"{name}={format_value(value)}" for name, value in row.items()) or "the defaults"


def truths(cells: Sequence[Cell]) -> list[Row]:
    """Checks that bind the engines of some cells, equal ones joined: quantity, truth, tolerance and its reason, engines."""
    joined: dict[tuple[Any, ...], Row] = {}
    for cell in cells:
        if isinstance(cell.setup, Exception) or isinstance(cell.engine, Exception) or not _able(cell):
            continue
        info = cell.engine.info()
        for check in dry_checks(cell, info):
            if check.truth == "consensus":  # its expected values are a run of ours
                continue
            allowed_error = tolerance(check.atol, check.rtol, largest(np.asarray(check.expected, dtype=np.float64)))
            key = (
                check.quantity,
                check.norm,
                check.truth,
                check.source,
                f"{allowed_error:.3g}",
                check.why,
                check.gap_reason,
            )
            row = joined.setdefault(
                key,
                {
                    "quantity": check.quantity,
                    "norm": check.norm,
                    "truth": check.truth,
                    "source": check.source,
                    "tolerance": allowed_error,
                    "why": check.why,
                    "gap_reason": check.gap_reason,
                    "engines": [],
                },
            )
            row["engines"].append(cell.engine_id)
    return list(joined.values())


def commands(case_id: str, cells: Sequence[Cell], shown: Any) -> list[str]:
    """Example commands of a case; each of them runs as it stands, within seconds, on an engine that every machine has."""
    ours = next((cell.engine_id for cell in cells if cell.engine_id in OURS and _able(cell)), OURS[0])
    chosen = " ".join(f"--set {name}={format_value(value)}" for name, value in shown.items())
    return [
        f"ninedisk list cases {case_id}",
        f"ninedisk run {case_id} --engine {ours} {chosen}".rstrip(),
        f"ninedisk run {case_id} --engine {ours} --engine pymunk {chosen} --json rows.json",
    ]


def _able(cell: Cell) -> bool:
    """Whether the cell's engine can express its scene, installed or not."""
    if isinstance(cell.setup, Exception) or isinstance(cell.engine, Exception):
        return False
    return cell.engine.supports(cell.setup.scene, cell.setup.numerics).level is not SupportLevel.NO


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
