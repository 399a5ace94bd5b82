"""``ninedisk converge``: does the error shrink as fast as the scheme says?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ninedisk.harness.cli.support import (
    FAILURE,
    CellProgress,
    Command,
    fail,
    guarded,
    parse_settings,
    refuse_not_installed,
)
from ninedisk.harness.terminal import console, table

if TYPE_CHECKING:
    from ninedisk.harness.api.engine import Engine

WRONG = 1


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("converge", short_help="Halve the step and measure orders of convergence.")(converge)


@guarded
def converge(
    case: Annotated[str, typer.Argument(metavar="CASE", help="One case by its id.")],
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", metavar="ID", help="Engine to run; none given: dem.")
    ] = None,
    engine_cmd: Command = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Fix a parameter; its step is the coarsest one."),
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option("--option", metavar="ENGINE.NAME=VALUE", help="Fix a setting of the engine."),
    ] = None,
    halvings: Annotated[int, typer.Option("--halvings", metavar="N", help="How often the step is halved.")] = 5,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write every error.")] = None,
    html: Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Also write a page with figures.")] = None,
) -> None:
    """Run one variant of a case again and again, the step halved each time, and fit the order of every quantity's error.

    Engines with contact springs refine their contact step, all others the case's own (dt, increment). Errors are taken
    against a truth of the continuous problem; where there is none, between neighbouring levels. --json and --html state
    the rule in full. The expected order is the one that the engine's scheme has on this scene.

    \b
    Examples:
      ninedisk converge nine-disk/compression --engine dem
      ninedisk converge incline-block -e cd --set sliding=coulomb --html order.html
      ninedisk converge nine-disk/compression -e lammps --set settle_cycles=0 --halvings 4
      ninedisk converge incline-block --engine-cmd 'node my-engine.mjs'

    \b
    Exit codes:
      0  no order is wrong
      1  an order is lower than the scheme's, or a limit misses the truth
      2  wrong usage: unknown id or parameter, value out of range, an engine that cannot run the case
      3  a level's run failed, crashed or ran out of time
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.registry import get_engine
    from ninedisk.harness.results.tables import plain_json
    from ninedisk.harness.results.whole_file import check_writable, write_whole
    from ninedisk.harness.run.converge import BAD, BrokenLevelError
    from ninedisk.harness.run.converge import converge as measured
    from ninedisk.harness.wire.command import CommandEngine
    from ninedisk.reports.studies import converge_page

    if engine is not None and engine_cmd is not None:
        raise UsageError("--engine and --engine-cmd exclude each other: orders are measured on one engine")
    chosen_engine: Engine = (
        CommandEngine(engine_cmd) if engine_cmd is not None else get_engine("dem" if engine is None else engine)
    )
    refuse_not_installed({chosen_engine.id: chosen_engine})
    params, chosen = (
        parse_settings(settings or []),
        parse_settings(options or [], flag="--option", example="siconos.theta=1"),
    )
    for flag, path in (("--json", json_file), ("--html", html)):
        if path is not None:
            check_writable(flag, path)
    try:
        with CellProgress() as progress:
            progress(0, halvings + 1, f"{case}: the coarsest level comes first and gives an estimate")
            record = measured(
                case, engine=chosen_engine, params=params, options=chosen, halvings=halvings, progress=progress
            )
    except BrokenLevelError as error:
        fail(str(error), FAILURE)
    _show(record)
    if json_file is not None:
        write_whole("--json", json_file, plain_json(record) + "\n")
    if html is not None:
        write_whole("--html", html, converge_page(record))
    raise typer.Exit(WRONG if any(row["verdict"] in BAD for row in record["rows"]) else 0)


def _show(record: Mapping[str, Any]) -> None:
    from ninedisk.harness.api.text import count_noun, one_line, short_number
    from ninedisk.harness.run.converge import BAD

    out, steps = console(), record["steps"]
    out.print(one_line(f"{record['case']} [{record['variant']}] on {record['engine']} {record['engine_version']}"))
    out.print(
        f"{record['step']} = {steps[0]:.4g} {record['unit']}, halved {count_noun(len(steps) - 1, 'time')} to {steps[-1]:.4g}"
    )
    declared = "none declared" if record["expected"] is None else f"{record['expected']:g}"
    out.print(one_line(f"expected order: {declared} ({record['expected_why']})"))
    shown = table("", "quantity", "unit", "truth", "measured by", "coarsest", "finest", "order", "levels", "why",
                  right=("coarsest", "finest", "order"), whole=("", "unit", "coarsest", "finest", "order", "levels"))  # fmt: skip
    for row in record["rows"]:
        series = (row["errors"] if row["by"] != "difference" else row["differences"]) or row["differences"]
        order = "-" if row["order"] != row["order"] else f"{row['order']:.2f} ± {short_number(row['uncertainty'])}"
        levels = f"{row['used'][0] + 1}-{row['used'][-1] + 1}" if row["used"] else "-"
        words = (row["verdict"], row["quantity"], row["unit"], row["truth"] or "-", row["by"] or "-")
        ends = (f"{series[0]:.2e}", f"{series[-1]:.2e}", order, levels)
        shown.add_row(*(one_line(str(text)) for text in (*words, *ends, row["reason"])))
    out.print(shown)
    bad = sum(row["verdict"] in BAD for row in record["rows"])
    judged = sum(row["verdict"] == "converges" for row in record["rows"])
    out.print(
        f"{bad} wrong, {judged} converge as expected, {len(record['rows']) - bad - judged} without an order to judge."
    )
