"""``ninedisk findings``: what is known to be wrong, held against what is stored."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.api.errors import UsageError, close_matches
from ninedisk.harness.api.text import found_and_expected, one_line, with_unit
from ninedisk.harness.cli.support import CellProgress, Commands, Store, guarded, refuse_not_installed, write_rows
from ninedisk.harness.results.schema import FINDING_VERDICTS, EvaluatedFinding
from ninedisk.harness.terminal import console, share, table

if TYPE_CHECKING:
    from ninedisk.harness.api.finding import Finding, Size
    from ninedisk.harness.wire.command import CommandEngine


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("findings", short_help="Check which known findings are there, gone or larger.")(findings)


@guarded
def findings(
    globs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ID", help="Findings by id or pattern, shown in full, e.g. 'kratos/*'. None: a table of all."
        ),
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option("--engine", "-e", metavar="ID", help="Only findings of this engine; repeat for several."),
    ] = None,
    engine_cmd: Commands = None,
    store: Store = Path("results"),
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write them with all their numbers as JSON.")
    ] = None,
) -> None:
    """Hold every finding against the stored results: is it still there, gone, or larger than before?

    A finding is something that an engine does otherwise than the physics or its own documentation says, or an erratum of the source. It
    holds no measured number: its size is read anew from the newest result of each cell, relative to a scale that the case states. The
    largest come first; what the store does not hold is `not-measured`. `ninedisk findings ID` prints one in full, with the command that
    measures it.

    Nothing is run, except with --engine-cmd: then cases in which other engines have findings are run on that engine and stored, and
    the table says of each finding whether that engine shows it:

    \b
      yes           the size shows all that the finding says
      similar size  the sign and the size fit; the cause is not tested, and may be another one
      other size    the sign fits, the size differs from that of the finding's own engine in the store by more than a factor of 2
      no            the size is that of a right engine, or the error has the other sign

    \b
    Verdicts:
      there         the size exceeds what a right engine shows
      larger        it grew by a tenth since the run before, or exceeds what its check explains
      gone          it no longer exceeds what a right engine shows: the engine was mended, or the finding is stale
      not-measured  the store has no such cell, or the cell no number; other versions than those in which it was seen are named

    \b
    Examples:
      ninedisk findings
      ninedisk findings --engine kratos --store nightly
      ninedisk findings siconos/elastic-gas-gains-energy
      ninedisk findings --json findings.json
      ninedisk findings --engine-cmd 'node my-engine.mjs'

    \b
    Exit codes:
      0  each finding that the store can show is there, as it is known; without a stored run they are listed
      1  one is gone or larger: what is known of an engine has changed, look at it
         (of an engine given by --engine-cmd this is about differences that it declares; what it shows besides is reported, not judged)
      2  wrong usage, or a store that cannot be read
    """
    from ninedisk.harness.api.finding import finding_problems, known_findings
    from ninedisk.harness.results.findings import evaluate, exit_code
    from ninedisk.harness.results.whole_file import check_writable

    if json_file is not None:
        check_writable("--json", json_file)
    globs, engines, commands = globs or [], engine or [], engine_cmd or []
    known = known_findings()
    for problem in finding_problems():
        typer.echo(f"warning: {problem}", err=True)
    if commands:
        if globs or engines:
            raise UsageError("--engine-cmd holds its engine against all findings: leave ids and --engine out")
        raise typer.Exit(_compare_engines(commands, known, store, json_file))
    with CellProgress() as progress:
        found = evaluate(store, known, progress)
    chosen = _chosen_findings(found, known, globs, engines)
    counts = Counter(each.verdict for each in chosen)
    if globs:
        _details(chosen)
    elif set(counts) == {"not-measured"}:
        _known_sizes(chosen)
    else:
        _table(chosen)
    console().print(", ".join(f"{counts[verdict]} {verdict}" for verdict in FINDING_VERDICTS if counts[verdict]))
    if set(counts) == {"not-measured"}:
        run = chosen[0].command if len(chosen) == 1 else "ninedisk run"
        typer.echo(
            f"note: none is measured, {chosen[0].reason} ({str(store)!r}); `{run} --store {store}` would", err=True
        )
    if json_file is not None:
        write_rows(json_file, [asdict(each) for each in chosen])
    raise typer.Exit(exit_code(chosen))


def _compare_engines(commands: Sequence[str], known: Sequence[Finding], store: Path, json_file: Path | None) -> int:
    """Run engines where findings of others are seen, and say which of these they show (`shows_finding`)."""
    from ninedisk.harness.results.findings import evaluate, exit_code, shows_finding
    from ninedisk.harness.wire.command import CommandEngine

    asked = {
        each.size: each
        for each in reversed(known)
        if not (
            each.id.startswith("source/")
            or each.size.fails
            or each.size.column == "broken"
            or each.size.table == "determinism"  # `ninedisk determinism --engine-cmd` measures those, and no case does
        )
    }
    engines = [CommandEngine(line) for line in dict.fromkeys(commands)]
    refuse_not_installed({engine.id: engine for engine in engines})
    _run([each.size for each in asked.values()], engines, store)
    known_of = {each.id: each for each in asked.values()}
    own = {each.id: each.size for each in evaluate(store, [*known_of.values()])}
    found, out = [], console()
    for engine in engines:
        of_engine = evaluate(store, [*reversed(asked.values())], engine=engine.id)
        found += of_engine
        shown = table("size", "shows it", "finding", "what happens", right=("size",), whole=("size", "shows it"))
        for each in of_engine:
            if each.verdict != "not-measured":
                other = known_of.get(each.id)
                word = shows_finding(other, each, own[each.id]) if other else each.verdict
                shown.add_row(share(each.size), word, *(one_line(part) for part in (each.id, each.what)))
        out.print(f"{engine.id}: what is known of other engines, and what it declares itself")
        out.print(shown)
        reasons = Counter(each.reason for each in of_engine if each.verdict == "not-measured")
        for reason, count in reasons.most_common():
            out.print(one_line(f"{count} not measured: {reason}"), soft_wrap=True)
    if json_file is not None:
        write_rows(json_file, [asdict(each) for each in found])
    return exit_code(each for each in found if each.id not in known_of)


def _run(sizes: Sequence[Size], engines: Sequence[CommandEngine], store: Path) -> None:
    """Run and store the cells that sizes are read from."""
    from ninedisk.harness.results.claims import judge_claims
    from ninedisk.harness.results.store import new_run_id, prepare_store, write_run
    from ninedisk.harness.run.plan import plan_matrix
    from ninedisk.harness.run.provenance import command_line, provenance
    from ninedisk.harness.run.workers import run_cells

    prepare_store(store)
    planned = plan_matrix(sorted({size.case for size in sizes}), engines, {})
    cells = [
        cell
        for cell in planned
        if any(cell.case.id == size.case and fnmatchcase(cell.variant.id, size.variant) for size in sizes)
    ]
    started = datetime.now(UTC)
    with CellProgress() as progress:
        results = run_cells(cells, progress)
    facts = {
        "started": started.isoformat(timespec="seconds"),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "provenance": provenance(result.cell for result in results) | {"jobs": 1},
        "argv": command_line(),
    }
    write_run(store, new_run_id(), results, judge_claims(results), facts)


def _chosen_findings(
    found: Sequence[EvaluatedFinding], known: Sequence[Finding], globs: Sequence[str], engines: Sequence[str]
) -> list[EvaluatedFinding]:
    ids, names = {each.id for each in known} | {each.id for each in found}, {each.engine for each in found}
    for glob in globs:
        if not any(fnmatchcase(name, glob) for name in ids):
            raise UsageError(
                f"no finding matches {glob!r}.{close_matches(glob, ids)} `ninedisk findings` lists them (quote patterns)"
            )
    for name in engines:
        if name not in names:
            raise UsageError(
                f"there is no finding of the engine {name!r}.{close_matches(name, names)} Engines with findings: {', '.join(sorted(names))}"
            )
    return [
        each
        for each in found
        if (not globs or any(fnmatchcase(each.id, glob) for glob in globs)) and (not engines or each.engine in engines)
    ]


def _table(found: Sequence[EvaluatedFinding]) -> None:
    shown = table("size", "verdict", "finding", "what happens", right=("size",), whole=("size", "verdict"))
    for each in (each for each in found if each.verdict != "not-measured"):
        text = each.what if each.verdict == "there" and not each.reason else f"{each.what} [{each.reason}]"
        shown.add_row(share(each.size), each.verdict, *(one_line(part) for part in (each.id, text)))
    out = console()
    if shown.rows:
        out.print(shown)
    if left := [each.id for each in found if each.verdict == "not-measured"]:
        out.print(one_line(f"not measured: {', '.join(left)}; `ninedisk findings ID` says why"), soft_wrap=True)


def _known_sizes(found: Sequence[EvaluatedFinding]) -> None:
    """What is known, where the store has no size of it."""
    shown = table("finding", "seen in", "what happens")
    for each in sorted(found, key=lambda each: each.id):
        shown.add_row(*(one_line(part) for part in (each.id, each.versions, each.what)))
    console().print(shown)


def _details(found: Sequence[EvaluatedFinding]) -> None:
    out = console()
    for each in found:
        numbers = each.quantity
        if each.value == each.value:
            found_value, wanted = found_and_expected(each.value, each.expected)
            numbers = f"{each.quantity} = {with_unit(found_value, each.unit)} for {wanted}"
        lines = {
            "what": each.what,
            "verdict": each.verdict + (f": {each.reason}" if each.reason else ""),
            "size": f"{share(each.size)} ({each.case}[{each.variant}] on {each.engine}: {numbers})",
            "before": f"{share(each.before)} in {each.before_run}" if each.before_run else "",
            "other engines": f"{share(each.least)} at least ({each.least_engine})" if each.least_engine else "",
            "there above": f"{share(each.over)}: {each.over_why}",
            "version": f"{each.engine_version or 'not in the store'}; seen in {each.versions}",
            "documented": each.documented or "no place is known",
            "thread": each.thread or "none known",
            "see it": each.command,
        }
        out.print(one_line(each.id))
        for name, text in lines.items():
            if text:
                out.print(f"  {name}: {one_line(text)}", soft_wrap=True)
