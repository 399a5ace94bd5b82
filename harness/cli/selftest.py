"""``ninedisk selftest``: does the suite catch deliberately wrong engines?"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.cli.support import FAILURE, CellProgress, fail, guarded, write_rows
from ninedisk.harness.terminal import console, table

if TYPE_CHECKING:
    from ninedisk.harness.results.schema import Row
    from ninedisk.harness.selftest.defect import Defect
MISSED = 1
SHOWN = 2
"""Failing checks that a line of the table names."""


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("selftest", short_help="Check whether the suite catches deliberately wrong engines.")(selftest)


@guarded
def selftest(
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="GLOB", help="Only these defects, e.g. 'dem/torque-*'; repeat for several."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", metavar="N", min=1, help="Engines at the same time. None: one a core."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Run each defect on the one variant that is known to catch it.")
    ] = False,
    show: Annotated[bool, typer.Option("--list", help="List the defects and run nothing.")] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write a row a defect, as a JSON list.")
    ] = None,
    html: Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Also write a page.")] = None,
) -> None:
    """Plant a defect into our own engines, run the suite, and see which checks fail; one defect after the other.

    A verification suite is worth what it catches. Each defect is one small change: a sign in a kernel, a missing torque, a
    dashpot of half the strength, a wall one step late, a wrong mass. The unchanged engines run first and must pass every check; then
    every wrong one must fail at least one. What no case can see is listed as a known hole, with the reason. A hole is closed when a
    check fails. impulse/... and soft/... are faults of third-party engines: friction a fifth too small, a wall's rotation ignored,
    steps that take no time. Our engine shows them, declared as one with impulses or with soft contacts, which are judged most
    leniently. Wrong engines run in their own processes. No file of the installation is changed, and no result enters a store.

    Variants are those of `ninedisk run` at smaller cost (softer springs, shorter settling), every kind of check included: some
    five minutes on two idle cores, --quick about one and a half.

    A row of --json has defect, engine, kind, what, caught, checks (ids of those that failed), by_case, hole, errors, judged,
    passed (the unchanged engines'), edits and seconds; headlines: by case, how far the headline that moves most is from the unchanged
    engine's, in parts of its scale.

    \b
    Examples:
      ninedisk selftest
      ninedisk selftest --only 'dem/torque-*' --only 'wall-*'
      ninedisk selftest --quick --jobs 2
      ninedisk selftest --only 'impulse/*' --only 'soft/*'
      ninedisk selftest --json selftest.json --html selftest.html

    \b
    Exit codes:
      0  every defect is caught or a known hole, and the unchanged engines pass
      1  some defect is not caught, or an unchanged engine fails
      2  wrong usage
      3  a defect no longer fits the source that it was written for
      130  interrupted; nothing was written
    """
    from ninedisk.harness.results.whole_file import check_writable, write_whole
    from ninedisk.harness.selftest.edits import StaleEditError
    from ninedisk.harness.selftest.mutants import chosen_defects
    from ninedisk.harness.selftest.run import is_as_expected, run_selftest
    from ninedisk.reports.selftest import selftest_page

    defects = chosen_defects(only or [])
    if show:
        _list(defects)
        raise typer.Exit(0)
    for flag, path in (("--json", json_file), ("--html", html)):
        if path is not None:
            check_writable(flag, path)
    try:
        with CellProgress() as progress:
            rows = run_selftest(defects, jobs=jobs or os.cpu_count() or 1, quick=quick, progress=progress)
    except StaleEditError as error:
        fail(str(error), FAILURE)
    if json_file is not None:
        write_rows(json_file, rows)
    if html is not None:
        write_whole("--html", html, selftest_page(rows))
    _show(rows)
    raise typer.Exit(0 if all(is_as_expected(row) for row in rows) else MISSED)


def _list(defects: Sequence[Defect]) -> None:

    shown = table("defect", "kind", "what")
    for defect in defects:
        shown.add_row(defect.id, defect.kind, defect.what)
    console().print(shown)


def _show(rows: Sequence[Row]) -> None:
    from ninedisk.harness.api.text import one_line
    from ninedisk.harness.selftest.run import headlines_agree, is_as_expected

    out = console()
    shown = table("", "defect", "kind", "what", "failed", "of", "first of them", right=("failed", "of"))
    for row in sorted(rows, key=lambda row: (is_as_expected(row), not row["hole"])):
        word = _outcome_word(row, is_as_expected(row))
        named = [*row["checks"][:SHOWN], *row["errors"][:1]]
        count = len(row["checks"])
        shown.add_row(word, row["defect"], row["kind"], row["what"], str(count), str(row["judged"]),
                      one_line("; ".join(named))[:160])  # fmt: skip
    out.print(shown)
    wrong = [row for row in rows if row["kind"] != "clean" and not row["hole"]]
    missed = [row["defect"] for row in wrong if not row["caught"]]
    dirty = [row["defect"] for row in rows if row["kind"] == "clean" and not is_as_expected(row)]
    out.print(
        f"caught: {len(wrong) - len(missed)} of {len(wrong)} defects"
        + (f"; missed: {', '.join(missed)}" if missed else "")
    )
    holes = [row for row in rows if row["hole"]]
    for title, caught in (("known holes", False), ("closed holes, whose notes must go", True)):
        named = [f"{row['defect']} ({row['hole']})" for row in holes if row["caught"] == caught]
        if named:
            out.print(f"{title}: {'; '.join(named)}")
    if blind := [f"{row['defect']} ({', '.join(cases)})" for row in wrong if (cases := headlines_agree(row))]:
        out.print(f"caught, but no headline of the case moves: {'; '.join(blind)}", soft_wrap=True)
    if dirty:
        out.print(f"unchanged engines that fail: {', '.join(dirty)}")


def _outcome_word(row: Row, well: bool) -> str:
    if row["hole"]:
        return "closed" if row["caught"] else "hole"
    if well:
        return "ok"
    return "fails" if row["kind"] == "clean" else "missed"
