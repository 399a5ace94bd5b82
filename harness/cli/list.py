"""``ninedisk list``: tables of cases and engines."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.api.registry import (
    STOCK_ENGINES,
    case_table,
    engine_table,
    engine_table_with_stock,
    entry_problems,
    get_case,
    get_engine,
)
from ninedisk.harness.api.text import count_noun
from ninedisk.harness.cli.support import Commands, Group, guarded
from ninedisk.harness.results.schema import short_variant
from ninedisk.harness.terminal import console, table

if TYPE_CHECKING:
    from rich.table import Table

    from ninedisk.harness.api.capabilities import Capability
    from ninedisk.harness.api.engine import Engine, EngineInfo


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    listing = typer.Typer(
        cls=Group, help="Show the cases and their parameters, the engines, and the statuses.", no_args_is_help=True
    )
    listing.command("cases", short_help="List the cases, or one with its parameters.")(list_cases)
    listing.command("engines", short_help="List the engines, or one with what it can express.")(list_engines)
    listing.command("statuses", short_help="List the statuses and other verdicts, with their meaning.")(list_statuses)
    app.add_typer(listing, name="list")


@guarded
def list_cases(
    case: Annotated[
        str | None, typer.Argument(metavar="CASE", help="Show one case with its parameters, ranges and units.")
    ] = None,
) -> None:
    """List the cases, or one case with its source and everything that --set can change.

    \b
    Examples:
      ninedisk list cases
      ninedisk list cases binary-collision
    """
    show_cases() if case is None else show_case(case)


@guarded
def list_engines(
    engine: Annotated[
        str | None,
        typer.Argument(metavar="ENGINE", help="Show one engine: what it can express and lacks, and its options."),
    ] = None,
    engine_cmd: Commands = None,
) -> None:
    """List the engines: which are installed, in which version, and how to install the others; or one of them with what it can express
    and lacks, and everything that --option can change.

    \b
    Examples:
      ninedisk list engines
      ninedisk list engines siconos
      ninedisk list engines --engine-cmd 'node my-engine.mjs'
    """
    if engine_cmd:
        show_described(engine_cmd)
    elif engine is None:
        show_engines()
    else:
        show_engine(engine)


@guarded
def list_statuses() -> None:
    """List the statuses of checks and cells: what each means, and the exit code of `ninedisk run`. Then the verdicts of other commands.

    Pages, badges and stored files use the same words.

    \b
    Example:
      ninedisk list statuses
    """
    from ninedisk.harness.results.statuses import TABLE, VERDICTS

    out = console()
    shown = table("status", "failure", "exit code", "meaning", right=("exit code",), whole=("status",))
    for word, status in TABLE.items():
        shown.add_row(word, "yes" if status.fails else "no", str(status.exit_code), status.meaning)
    out.print(shown)
    for name, words in VERDICTS.items():
        shown = table(name, "meaning", whole=(name,))
        for word, meaning in words.items():
            shown.add_row(word, meaning)
        out.print(shown)


def show_cases() -> None:
    """Every case with its title, number of variants and, if it is not ours, the package it comes from."""
    shown = table("case", "variants", "what it is", right=("variants",), whole=("case", "variants"))
    for case_id, entry in case_table().items():
        try:
            case = get_case(case_id)
            shown.add_row(case_id, str(len(case.matrix())), case.title + _origin(entry.origin))
        except Exception as error:  # an outsider's case must not hide the others
            shown.add_row(case_id, "", f"broken: {error}" + _origin(entry.origin))
    console().print(shown)
    _show_problems()
    console().print(f"{count_noun(len(case_table()), 'case')}; one of them in full: ninedisk list cases CASE")


def _origin(origin: str) -> str:
    """What another package's case or engine shows of its origin."""
    return "" if origin == "ninedisk" else f" (from {origin})"


def show_case(case_id: str) -> None:
    """One case: what it requires, its parameters, and the variants of its matrix."""
    from ninedisk.harness.api.params import allowed, format_value

    case = get_case(case_id)
    out = console()
    for line in (
        f"{case.id} (version {case.version}): {case.title}",
        f"source: {case.source}",
        f"from: {case_table()[case_id].origin}",
        case.requirement,
        "",
    ):
        out.print(line, markup=False, highlight=False)
    shown = table("parameter", "default", "unit", "allowed", "meaning")
    for p in case.parameters:
        shown.add_row(p.name, _readable(p.default), p.unit or "-", allowed(p), p.help)
    out.print(shown)
    first = case.parameters[0] if case.parameters else None
    variants = case.matrix()
    out.print(f"{count_noun(len(variants), 'variant')} run by default:", markup=False, highlight=False)
    for row in variants:
        words = [short_variant(f"{name}={format_value(value)}") for name, value in row.items()]
        text = ", ".join(words) or "the defaults"
        out.print(f"  {text}", markup=False, highlight=False)
    if first is not None:
        example = f"ninedisk run {case.id} --engine dem --set {first.name}={format_value(first.default)}"
        out.print(f"example: {example}", markup=False, highlight=False)


def _readable(value: object) -> str:
    """A value to be read, not to be typed: a long number has four digits."""
    from ninedisk.harness.api.params import format_value

    return short_variant(f"={format_value(value)}").removeprefix("=")


def show_engines() -> None:
    """Every engine: whether it is installed, its version, licence and kind of contact, what installs it."""
    shown = table(
        "engine", "name", "version", "contacts", "licence", "install", whole=("engine", "version", "contacts")
    )
    missing: list[str] = []
    for engine_id, entry in engine_table().items():
        try:
            _engine_row(shown, missing, get_engine(engine_id), entry.origin)
        except Exception as error:  # an outsider's adapter must not hide the others
            shown.add_row(engine_id, f"broken: {error}" + _origin(entry.origin), "", "", "", "")
    out = console()
    out.print(shown)
    for line in missing:
        out.print(line, markup=False, highlight=False)
    _show_problems()
    count = count_noun(len(engine_table()), "engine")
    out.print(
        f"{len(STOCK_ENGINES)} run at their own settings as well, named {next(iter(STOCK_ENGINES))} and so on: ninedisk run --profile both"
    )
    out.print(f"{count}; what one can express and lacks, and its options: ninedisk list engines ENGINE")


def _show_problems() -> None:
    """What installed packages announce wrongly, on standard error: the list itself is complete without it."""
    for problem in entry_problems():
        typer.echo(f"warning: {problem}", err=True)


def _engine_row(shown: Table, missing: list[str], engine: Engine, origin: str) -> None:
    from ninedisk.harness.api.engine import facts_of

    info = facts_of(engine)
    version = info.version if info.version is not None else "not installed"
    shown.add_row(info.id, info.name + _origin(origin), version, info.contact, info.licence, info.install)
    if not info.installed and info.not_installed_because:
        missing.append(f"{info.id}: {info.not_installed_because}")


def show_engine(engine_id: str) -> None:
    """One engine: facts, what it can express, what it lacks and where its documentation says so, its options."""
    from ninedisk.harness.api.engine import facts_of

    _show_info(facts_of(get_engine(engine_id)), engine_table_with_stock()[engine_id].origin, ["--engine", engine_id])


def show_described(commands: Sequence[str]) -> None:
    """Engines that are commands, as they describe themselves.

    Raises
    ------
    UsageError
        If one cannot be started, or its description is broken.
    """
    from ninedisk.harness.wire.command import CommandEngine

    for line in commands:
        _show_info(CommandEngine(line).info(), "--engine-cmd", ["--engine-cmd", line])


def _show_info(info: EngineInfo, origin: str, chosen: Sequence[str]) -> None:
    from ninedisk.harness.api.capabilities import Capability
    from ninedisk.harness.api.params import format_value

    state = f"version {info.version}" if info.installed else f"not installed: {info.not_installed_because}"
    lines = [
        f"{info.id}: {info.name}, {state}",
        f"licence: {info.licence}; runs: {info.how_it_runs}; {info.precision}, {count_noun(info.threads, 'thread')}",
        f"contacts: {info.contact}; scheme: {info.scheme}",
        f"install: {info.install}",
        f"from: {origin}",
        "",
        "It can express:",
        *(f"  {capability}" for capability in Capability if capability in info.capabilities),
        "It lacks:",
        *(
            f"  {capability}{_scope(info, capability)}"
            for capability in Capability
            if capability not in info.capabilities
        ),
    ]
    out = console()
    for line in lines:
        out.print(line, markup=False, highlight=False)
    if not info.options:
        out.print("It has no options.", markup=False, highlight=False)
        return
    shown = table("option", "default", "allowed", "why this default")
    for name, option in info.options.items():
        shown.add_row(f"{info.id}.{name}", format_value(option.default), option.allowed, option.why)
    out.print(shown)
    name, option = next(iter(info.options.items()))
    example = shlex.join(["ninedisk", "run", *chosen, "--option", f"{info.id}.{name}={format_value(option.default)}"])
    out.print(f"example: {example}", markup=False, highlight=False, soft_wrap=True)


def _scope(info: EngineInfo, capability: Capability) -> str:
    link = info.out_of_scope.get(capability)
    return f" (out of scope by its own documentation: {link})" if link else ""
