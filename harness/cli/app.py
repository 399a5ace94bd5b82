"""The command line: what it offers; the work is imported by the command that needs it."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.cli import bench as cli_bench
from ninedisk.harness.cli import compare as cli_history
from ninedisk.harness.cli import converge as cli_converge
from ninedisk.harness.cli import docs as cli_docs
from ninedisk.harness.cli import engines as cli_engines
from ninedisk.harness.cli import protocol as cli_protocol
from ninedisk.harness.cli import selftest as cli_selftest
from ninedisk.harness.cli import store as cli_store
from ninedisk.harness.cli.protocol import Commands
from ninedisk.harness.cli.store import Store
from ninedisk.harness.cli.support import INTERRUPTED, guarded

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any

    from ninedisk.harness.results.schema import Comparison, History
app = typer.Typer(
    name="ninedisk",
    help="Verify and compare engines for granular DEM and contact dynamics on problems with known answers.\n\n"
    "Start with: ninedisk list cases, then ninedisk run 'nine-disk/*' --engine dem, then ninedisk report.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
listing = typer.Typer(help="Show the cases and their parameters, and the engines.", no_args_is_help=True)
app.add_typer(listing, name="list")


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


@listing.command("cases")
@guarded
def list_cases(
    case: Annotated[
        str | None, typer.Argument(metavar="[CASE]", help="Show one case with its parameters, ranges and units.")
    ] = None,
) -> None:
    """List the cases, or one case with everything that --set can change.

    \b
    Examples:
      ninedisk list cases
      ninedisk list cases binary-collision
    """
    from ninedisk.harness.cli.list import show_case, show_cases

    show_cases() if case is None else show_case(case)


@listing.command("engines")
@guarded
def list_engines(
    engine: Annotated[
        str | None,
        typer.Argument(metavar="[ENGINE]", help="Show one engine: what it can express and lacks, and its options."),
    ] = None,
    engine_cmd: Commands = None,
) -> None:
    """List the engines (installed or not, version, licence, how they run, what they express, how to install them), or one of them
    with everything that --option can change.

    \b
    Examples:
      ninedisk list engines
      ninedisk list engines siconos
      ninedisk list engines --engine-cmd 'node my-engine.mjs'
    """
    from ninedisk.harness.cli.list import show_described, show_engine, show_engines

    if engine_cmd:
        show_described(engine_cmd)
    elif engine is None:
        show_engines()
    else:
        show_engine(engine)


@app.command("run", short_help="Run cases on engines and judge the results.")
@guarded
def run(
    globs: Annotated[
        list[str] | None,
        typer.Argument(metavar="GLOB", help="Cases by id or pattern, e.g. 'nine-disk/*'. None: all cases."),
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option("--engine", "-e", metavar="ID", help="Engine to run; repeat for several. None: all engines."),
    ] = None,
    engine_cmd: Commands = None,
    all_engines: Annotated[
        bool, typer.Option("--all-engines", help="All known engines (the default without --engine and --engine-cmd).")
    ] = False,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="Fix a parameter, unit allowed ('dt=10 ms'); repeat for several."
        ),
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option(
            "--option",
            metavar="ENGINE.NAME=VALUE",
            help="Fix a setting of one engine; repeat for several. ninedisk list engines ENGINE shows what there is.",
        ),
    ] = None,
    store: Store = Path("results"),
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the measurement rows as JSON.")
    ] = None,
    published: Annotated[
        Path | None,
        typer.Option("--published", metavar="DIR", help="Folder with your own digitised curves (CSV + TOML)."),
    ] = None,
    jobs: Annotated[
        str | None,
        typer.Option(
            "--jobs",
            "-j",
            metavar="N",
            help="Cells at once, each in a process of its own; auto: one for each core. More than 1 spoils timings. Default: 1.",
        ),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS", help="Run on the Dask cluster whose scheduler listens there."),
    ] = None,
) -> None:
    """Run cases on engines, hold the results against every known truth, and store them.

    \b
    Examples:
      ninedisk run
      ninedisk run nine-disk/compression --engine dem
      ninedisk run 'nine-disk/*' -e dem -e yade --set phi_deg=20
      ninedisk run incline-block -e pymunk --set 'dt=5 ms' --set mu=0.36 --json rows.json
      ninedisk run slip-to-roll -e siconos --option siconos.theta=1
      ninedisk run binary-collision --engine-cmd 'node my-engine.mjs' --engine dem
      ninedisk run --jobs auto
      ninedisk run --dask tcp://head:8786

    Results do not depend on --jobs or --dask; timings do, so runs with different ones are not compared by their timings.

    \b
    Exit codes:
      0  every cell passes or is excused (unsupported, not-installed, known-gap, gap-closed, no-truth)
      1  the run is complete but some check failed
      2  wrong usage (unknown id or parameter, value out of range, store that cannot be written)
      3  an engine failed, crashed or ran out of time in some cell
      130  interrupted (Ctrl-C, SIGTERM, SIGHUP); nothing was stored
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.cli.run import execute

    if engine and all_engines:
        raise UsageError("--engine and --all-engines exclude each other: give one of them")
    code = execute(
        globs=globs or [],
        engines=engine or [],
        settings=settings or [],
        options=options or [],
        store=store,
        json_file=json_file,
        published=published,
        commands=engine_cmd or [],
        all_engines=all_engines,
        jobs=jobs,
        dask=dask,
    )
    raise typer.Exit(code)


@app.command("report", short_help="Build the comparison report from the store.")
@guarded
def report(
    store: Store = Path("results"),
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pages.")] = Path("report"),
) -> None:
    """Build the comparison report from the stored results and say where its first page is.

    \b
    Example:
      ninedisk report --store results --out report
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.cli.support import CellProgress
    from ninedisk.reports.build import build_report
    from ninedisk.reports.folder import ReportError

    try:
        with CellProgress() as progress:
            page = build_report(store, out, lambda label, done, total: progress(done, total, label))
    except ReportError as error:
        raise UsageError(str(error)) from error
    typer.echo(f"report: {page}")


def _comparison_page(comparison: Comparison, path: Path) -> None:
    from ninedisk.reports.studies import write_comparison

    write_comparison(comparison, path)


def _dashboard_folder(history: History, out: Path, progress: Callable[[str, int, int], None]) -> Path:
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.reports.dashboard import build_dashboard
    from ninedisk.reports.folder import ReportError

    try:
        return build_dashboard(history, out, progress)
    except ReportError as error:
        raise UsageError(str(error)) from error


def _bench_page(record: Mapping[str, Any], path: Path) -> None:
    from ninedisk.reports.bench import write_bench

    write_bench(record, path)


def _selftest_page(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    from ninedisk.reports.selftest import write_selftest

    write_selftest(rows, path)


def _converge_page(record: Mapping[str, Any]) -> str:
    from ninedisk.reports.studies import converge_page

    return converge_page(record)


def _docs_folder(
    record: Sequence[Mapping[str, Any]], guides: Sequence[tuple[str, str]], out: Path, beside: Path | None
) -> Path:
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.reports.docs import write_docs
    from ninedisk.reports.folder import ReportError

    try:
        return write_docs(record, guides, out, beside)
    except ReportError as error:
        raise UsageError(str(error)) from error


cli_bench.register(app, _bench_page)
cli_converge.register(app, _converge_page)
cli_docs.register(app, _docs_folder)
cli_protocol.register(app)
cli_engines.register(app)
cli_history.register(app, _comparison_page, _dashboard_folder)
cli_selftest.register(app, _selftest_page)
cli_store.register(app)


def main() -> None:
    """Entry point of the console script and of ``python -m ninedisk``."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:  # under nohup a hang-up stays ignored
            signal.signal(number, signal.default_int_handler)
    try:
        app(prog_name="ninedisk")
    except KeyboardInterrupt:  # outside of a command: while it starts or ends
        raise SystemExit(INTERRUPTED) from None
