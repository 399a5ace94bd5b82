"""``ninedisk check-engine`` and ``new-engine``: the commands for who brings an engine."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from ninedisk.harness.cli.support import CellProgress, Command, guarded, refuse_not_installed


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command("check-engine", short_help="Test an engine's adapter alone, on scenes with closed forms.")(check_engine)
    app.command("new-engine", short_help="Write a package for an engine of your own.")(new_engine)


@guarded
def check_engine(
    engine: Annotated[
        str | None, typer.Argument(metavar="ENGINE", help="Id of the engine; ninedisk list engines shows them.")
    ] = None,
    engine_cmd: Command = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--check", metavar="GLOB", help="Only these checks, e.g. 'supports: *'; repeat for several."),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the findings to FILE, too.")
    ] = None,
) -> None:
    """Test an engine's adapter alone: form of its answers, units, signs, sampling, conduct, and the honesty of what it declares.

    Each check runs a scene so small that its numbers are known in closed form: free flight, one contact, a weight on a
    floor, and one scene for each capability. What the engine refuses for a stated reason, and what it does not observe, is no
    defect. The most informative fault comes first, with what was found, what was expected and what to run next; what is declared
    but was not tested is named.

    \b
    Examples:
      ninedisk check-engine dem
      ninedisk check-engine acme --check 'units: *' --check warm-up
      ninedisk check-engine acme --json findings.json
      ninedisk check-engine --engine-cmd 'node my-engine.mjs'

    \b
    Exit codes:
      0  every check passes, or the engine refuses its scene for a stated reason
      1  some check fails
      2  wrong usage (unknown id, an engine that is not installed, file that cannot be written)
      3  the engine's facts cannot be had
    """
    from ninedisk.harness.api.engine import Engine, facts_of
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.registry import get_engine
    from ninedisk.harness.check_engine.check import check_engine as check
    from ninedisk.harness.check_engine.outcomes import FAIL, write_json
    from ninedisk.harness.check_engine.verdict import print_verdict
    from ninedisk.harness.results.whole_file import check_writable
    from ninedisk.harness.wire.command import CommandEngine

    if (engine is None) == (engine_cmd is None):
        raise UsageError("give one engine: its id, or --engine-cmd COMMAND")
    found: Engine = get_engine(engine) if engine is not None else CommandEngine(str(engine_cmd))
    engine = found.id
    if json_file is not None:
        check_writable("--json", json_file)
    refuse_not_installed({found.id: found})
    info = facts_of(found)
    with CellProgress() as progress:
        outcomes = check(found, progress, only or ())
    given = ["--engine-cmd", engine_cmd] if engine_cmd is not None else ["--engine", engine]
    print_verdict(found, info, outcomes, given)
    if json_file is not None:
        write_json(json_file, engine, info.version or "", outcomes)
    raise typer.Exit(int(any(each.status == FAIL for each in outcomes)))


@guarded
def new_engine(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Id of the engine: small letters, digits and dashes, a letter first.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder to write; it must not exist. None: NAME.")
    ] = None,
    language: Annotated[
        str | None,
        typer.Option("--language", metavar="LANGUAGE", help="An engine by its command, in javascript, c or python."),
    ] = None,
    spheres: Annotated[
        bool, typer.Option("--spheres", help="An engine of spheres in space; with --language javascript or python.")
    ] = False,
) -> None:
    """Write a package that brings an engine: an adapter that works, tests that run the suite, known gaps, a CI example.

    What comes out installs and passes as it is, with a minimal engine of smooth springs in it; put yours in its place. With
    --language it is one that is run by its command and not imported: it moves disks that meet nothing, or smooth spheres,
    refuses all else, and passes check-engine for that.

    \b
    Examples:
      ninedisk new-engine acme
      ninedisk new-engine acme --out packages/ninedisk-acme
      ninedisk new-engine acme --language javascript
      ninedisk new-engine acme --language javascript --spheres
      pip install --editable packages/ninedisk-acme && ninedisk check-engine acme
    """
    from ninedisk.harness.new_engine.write import LANGUAGES, write_package

    folder = write_package(name, out if out is not None else Path(name), language, spheres=spheres)
    where = shlex.quote(str(folder))
    then = [f"pip install --editable {where}", f"ninedisk check-engine {name}"]
    if language is not None:
        _, run, build = LANGUAGES[language]
        then = [f"cd {where}", *([build] if build else []), f"ninedisk check-engine --engine-cmd {shlex.quote(run)}"]
    typer.echo(f"{folder}: now  {' && '.join(then)}")
