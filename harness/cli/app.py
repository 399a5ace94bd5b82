"""The command line: what it offers. Each command is a file of this folder; its work is imported when it is called."""

from __future__ import annotations

import io
import signal
import sys
from typing import Annotated, Any

import typer

from ninedisk.harness.cli import (
    audit,
    bench,
    cd_problems,
    compare,
    converge,
    determinism,
    docs,
    engines,
    findings,
    law_test,
    protocol,
    report,
    run,
    selftest,
    site,
    solve,
    store,
    tune,
    versions,
)
from ninedisk.harness.cli import list as listing
from ninedisk.harness.cli.pipe import guard_output
from ninedisk.harness.cli.support import INTERRUPTED, Group

FIRST = (
    *("list", "run", "report", "check-engine", "audit"),
    *("compare", "converge", "findings", "bench", "new-engine"),
)
"""Commands that the help explains, what a newcomer needs first."""

MORE = {
    "stored runs": ("show", "runs", "merge", "export", "prune"),
    "pages": ("dashboard", "site", "docs"),
    "engines": ("request", "schema", "determinism", "tune", "versions"),
    "contact problems": ("solve", "cd-problems"),
    "contact laws": ("law-test",),
    "this suite": ("selftest",),
}
"""The other commands, by what they are about; the help names them."""

ORDER = (*FIRST, *(name for names in MORE.values() for name in names))


class _TwoLevels(Group):
    """The help of a few commands, and the names of the others."""

    def list_commands(self, ctx: Any) -> list[str]:
        return sorted(super().list_commands(ctx), key=ORDER.index)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        width = formatter.width - 6 - max(map(len, FIRST))
        found = [(name, self.get_command(ctx, name)) for name in FIRST]
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.get_short_help_str(width)) for name, command in found if command])
        with formatter.section("More (ninedisk COMMAND --help explains each)"):
            formatter.write_dl([(about, ", ".join(names)) for about, names in MORE.items()])


app = typer.Typer(
    name="ninedisk",
    cls=_TwoLevels,
    help="Verify and compare engines for granular DEM and contact dynamics on problems with known answers.\n\n"
    "Start with: ninedisk run binary-collision --engine dem, then ninedisk report; ninedisk list cases shows all problems.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(wanted: bool) -> None:
    if wanted:
        import ninedisk

        typer.echo(f"ninedisk {ninedisk.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


for command in (
    listing,
    run,
    report,
    findings,
    audit,
    law_test,
    bench,
    solve,
    cd_problems,
    converge,
    determinism,
    docs,
    protocol,
    engines,
    compare,
    selftest,
    site,
    store,
    tune,
    versions,
):
    command.register(app)


def main() -> None:
    """Entry point of the console script and of ``python -m ninedisk``."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:  # under nohup a hang-up stays ignored
            signal.signal(number, signal.default_int_handler)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # names of files and arguments need not be text in any encoding
            stream.reconfigure(errors="backslashreplace")
    guard_output()
    try:
        app(prog_name="ninedisk")
    except KeyboardInterrupt:  # outside of a command: while it starts or ends
        raise SystemExit(INTERRUPTED) from None
    finally:
        sys.stdout.flush()
