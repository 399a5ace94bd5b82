"""``ninedisk tune``: what to change in an engine for an accuracy?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from ninedisk.harness.cli.support import INTERRUPTED, CellProgress, Store, fail, guarded, parse_settings
from ninedisk.harness.terminal import console, table

MISSED = 1
DEFAULT_TARGETS = (0.01, 0.001)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("tune", short_help="What to change in an engine for an accuracy, and what it costs.")(tune)


@guarded
def tune(
    case: Annotated[str | None, typer.Argument(metavar="[CASE]", help="One case by its id; --all takes none.")] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            "--engine", "-e", metavar="ID", help="Engine with stock settings; repeat it. Default: all installed."
        ),
    ] = None,
    target: Annotated[
        list[float] | None,
        typer.Option("--target", metavar="ERROR", help="Relative error to reach; repeat it. Default: 0.01 and 0.001."),
    ] = None,
    headline: Annotated[
        str,
        typer.Option("--headline", metavar="NAME", help="The headline that counts. Default: the worst of the case."),
    ] = "",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Fix a parameter of the case.")
    ] = None,
    halvings: Annotated[int, typer.Option("--halvings", metavar="N", help="How often the step is halved at most.")] = 6,
    everything: Annotated[
        bool, typer.Option("--all", help="Measure the cases of the report's tables and store them; minutes per engine.")
    ] = False,
    store: Store = Path("results"),
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write every setting.")] = None,
) -> None:
    """Start at an engine's own settings, halve its step and turn its knobs, and measure error and time of each setting.

    The answer is the cheapest setting within the target, what it changes of the engine's own, and its time as a multiple. A
    setting counts only if half its step stays within the target. `ninedisk list engines mujoco-stock` shows the knobs;
    `ninedisk run -e mujoco-stock --option mujoco-stock.impratio=100` sets one.

    \b
    Examples:
      ninedisk tune incline-block -e mujoco --headline 'distance down the incline'
      ninedisk tune impact/bouncing-disk -e pymunk -e box2d --target 0.01
      ninedisk tune box/incline -e bullet --set mu=0.3 --json box.json
      ninedisk tune --all -e pymunk --store results

    \b
    Exit codes:
      0  every target is reached, or --all has stored its results
      1  an engine reaches a target with no setting of its ladder
      2  wrong usage: unknown id or headline, value out of range, an engine without stock settings or not installed
      3  unforeseen failure
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.registry import STOCK_ENGINES, get_engine
    from ninedisk.harness.results.schema import STOCK
    from ninedisk.harness.results.store import prepare_store
    from ninedisk.harness.results.tables import plain_json
    from ninedisk.harness.results.whole_file import check_writable, write_whole
    from ninedisk.harness.run.tune import STUDY, stock_engine
    from ninedisk.harness.run.tune import tune as measured

    if everything == (case is not None):
        raise UsageError("give one case, or --all for the cases of the report's tables")
    if everything and (headline or settings):
        raise UsageError("--all has its own headlines and parameters: drop --headline and --set")
    targets = tuple(target or DEFAULT_TARGETS)
    engines = [stock_engine(each).of for each in engine or []] or [
        name.removesuffix(STOCK) for name in STOCK_ENGINES if get_engine(name).info().installed
    ]
    if json_file is not None:
        check_writable("--json", json_file)
    place = store / "tune"
    if everything:
        prepare_store(store)
        place.mkdir(exist_ok=True)
    todo = STUDY if case is None else ((case, parse_settings(settings or []), headline),)
    records: list[dict[str, Any]] = []
    try:
        with CellProgress() as progress:
            for name in engines:
                mine: list[dict[str, Any]] = []
                for case_id, params, wanted in todo:
                    try:
                        mine.append(
                            measured(
                                case_id,
                                engine=name,
                                params=params,
                                targets=targets,
                                headline=wanted,
                                halvings=halvings,
                                progress=progress,
                            )
                        )
                    except UsageError:
                        if not everything:
                            raise  # of the study an engine leaves out what it cannot express
                records += mine
                if everything:
                    write_whole("--store", place / f"{name}.json", plain_json(mine) + "\n")
    except KeyboardInterrupt:
        fail("interrupted" + (f": engines before {name} are stored" if everything else ""), INTERRUPTED)
    for record in records:
        _show(record)
    if json_file is not None:
        write_whole("--json", json_file, plain_json(records) + "\n")
    missed = any(not answer["reached"] for record in records for answer in record["answers"])
    raise typer.Exit(MISSED if missed and not everything else 0)


def _show(record: Mapping[str, Any]) -> None:
    from ninedisk.harness.api.text import one_line
    from ninedisk.reports.tuning import lines

    out = console()
    out.print(one_line(f"{record['case']} [{record['variant']}] on {record['engine']} {record['engine_version']}"))
    names = ", ".join(each["name"] for each in record["headlines"])
    out.print(one_line(f"error: {names}, relative to {record['headlines'][0]['scale_is']}"))
    if record["first_step"] < 0.999 * record["own_step"]:
        out.print(
            f"the case asks for steps of {record['first_step']:.4g} s; the engine's own is {record['own_step']:.4g} s"
        )
    shown = table("for", "step", "changed", "error", "time per s", "of own", "", right=("step", "error", "time per s", "of own"),
                  whole=("for", "step", "error", "time per s", "of own"))  # fmt: skip
    for line in lines(record):
        shown.add_row(*(one_line(text) for text in line))
    out.print(shown)
