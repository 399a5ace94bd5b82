"""``ninedisk schema`` and ``ninedisk request``: for those who write an engine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ninedisk.harness.cli.support import Command, guarded, parse_settings


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command("schema", short_help="Print the JSON Schemas of the wire protocol.")(schema)
    app.command("request", short_help="Print the request that an engine gets for a case.")(request)


@guarded
def schema(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="describe, request, answer, scene, numerics or history.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="All schemas; needs --out.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write NAME.json into DIR instead of printing it.")
    ] = None,
) -> None:
    """Print the JSON Schemas (draft 2020-12) of what an engine reads and writes.

    \b
    Examples:
      ninedisk schema describe
      ninedisk schema --all --out schemas
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.wire.schemas import NAMES, schema_text, write_schemas

    if everything == (name is not None):
        raise UsageError(f"give either the name of one schema ({', '.join(NAMES)}) or --all")
    if out is not None:
        for path in write_schemas(NAMES if name is None else (name,), out):
            typer.echo(str(path))
    elif name is None:
        raise UsageError("--all prints several schemas: add --out DIR, a folder for them")
    else:
        typer.echo(schema_text(name), nl=False)


@guarded
def request(
    case: Annotated[str, typer.Argument(metavar="CASE", help="Id of a case.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Fix a parameter, as in ninedisk run; repeat for several."),
    ] = None,
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", metavar="ID", help="An engine by its id; ninedisk list engines.")
    ] = None,
    command: Command = None,
    options: Annotated[
        list[str] | None,
        typer.Option("--option", metavar="ENGINE.NAME=VALUE", help="A setting of that engine; repeat for several."),
    ] = None,
) -> None:
    """Print the request that `ENGINE run` reads for one variant of a case, to try an engine by hand.

    With --engine-cmd or --engine it is exactly what this engine gets, with a note on standard error where `ninedisk run` would not
    ask it at all; without, what an engine with contact springs gets. --option belongs to one of these engines.

    \b
    Examples:
      ninedisk request binary-collision > request.json
      ninedisk request binary-collision --engine siconos --option siconos.theta=1
      ninedisk request nine-disk/compression --set load_case=b1 --engine-cmd 'node my-engine.mjs' | node my-engine.mjs run
    """
    from ninedisk.harness.api.engine import Engine
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.registry import get_engine
    from ninedisk.harness.wire.command import CommandEngine
    from ninedisk.harness.wire.example import example_request

    if engine is not None and command is not None:
        raise UsageError("give one engine: --engine ID or --engine-cmd COMMAND")
    asked: Engine | None = (
        get_engine(engine) if engine is not None else CommandEngine(command) if command is not None else None
    )
    chosen = parse_settings(options or [], flag="--option", example="mine.theta=1")
    typer.echo(example_request(case, parse_settings(settings or []), asked, chosen, _note))


def _note(text: str) -> None:
    typer.echo(f"note: {text}", err=True)
