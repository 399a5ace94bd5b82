"""``ninedisk determinism``: is a run the same run again?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.cli.support import (
    INTERRUPTED,
    CellProgress,
    Commands,
    Store,
    fail,
    guarded,
    refuse_not_installed,
    write_rows,
)
from ninedisk.harness.terminal import console, table

if TYPE_CHECKING:
    from ninedisk.harness.api.engine import Engine
    from ninedisk.harness.results.schema import Row

WORSE = 1


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("determinism", short_help="Check whether engines give the same result again, bit for bit.")(determinism)


@guarded
def determinism(
    engine: Annotated[
        list[str] | None,
        typer.Option("--engine", "-e", metavar="ID", help="Only this engine; repeat for several. None: all installed."),
    ] = None,
    engine_cmd: Commands = None,
    spheres: Annotated[
        bool, typer.Option("--spheres", help="Of spheres in space, on engines that have them; None given: of disks.")
    ] = False,
    store: Store = Path("results"),
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the rows as JSON.")
    ] = None,
) -> None:
    """Run one scene again in ten ways that should change nothing, and report what changes, by how much and from when on.

    Disks of unequal size fall into a box and press on each other: two dozen with friction, or nine smooth ones where the engine has no
    friction. With --spheres spheres do. The run is repeated in one process, in another one, after a run that failed, after another
    scene, and on two threads. It is also restarted half way, run with other contacts watched, sampled less often, and run with its
    bodies and its walls in another order.
    Each must be the same to the last bit; the last two within round-off, as sums come in another order.

    \b
    What a repetition may be:
      bitwise         all that the engine reports is the same to the last bit: places, velocities, forces, energies
      round-off       no farther apart than rounding in each step, or the solver's tolerance, can have grown to by then;
                      the growth is measured: a run that starts beside by the root of the precision
      different       farther apart than that
      broken          the engine ended without an answer
      not applicable  the engine has no such thing: no threads, no restart, one run a process

    --store keeps the newest rows of each engine; `ninedisk report` makes a page of them, and `ninedisk findings` reads them.
    A row of --json has engine, kind, scene, verdict, difference, allowance, growth, first_step, beyond_step and reason.

    \b
    Examples:
      ninedisk determinism
      ninedisk determinism --engine dem --engine cd
      ninedisk determinism --engine dem --spheres
      ninedisk determinism --engine box2d --json box2d.json
      ninedisk determinism --engine-cmd 'node my-engine.mjs'

    \b
    Exit codes:
      0  every repetition is what it must be
      1  one is not: it is named first
      2  wrong usage: an unknown engine, one that is not installed or can run no such scene
      130  interrupted; engines that were done are stored
    """
    from ninedisk.harness.api.errors import StoreError
    from ninedisk.harness.api.registry import check_engine_ids, engines_that_load, get_engine
    from ninedisk.harness.api.text import count_noun
    from ninedisk.harness.results.schema import worse_than_promised
    from ninedisk.harness.results.store import prepare_store
    from ninedisk.harness.results.tables import plain_json
    from ninedisk.harness.results.whole_file import check_writable, write_whole
    from ninedisk.harness.run.determinism import measure
    from ninedisk.harness.wire.command import engines_given

    engines, commands = engine or [], engine_cmd or []
    check_engine_ids(engines)
    if json_file is not None:
        check_writable("--json", json_file)
    prepare_store(store)
    place = store / "determinism"
    try:
        place.mkdir(exist_ok=True)
    except OSError as error:
        raise StoreError(
            f"{str(place)!r} cannot be written ({error.strerror or error}): give another --store"
        ) from error
    if engines or commands:
        chosen: list[Engine] = [
            get_engine(each) if isinstance(each, str) else each for each in engines_given(engines, commands)
        ]
        refuse_not_installed({each.id: each for each in chosen})
    else:
        chosen = [each for each in engines_that_load(lambda _: True).values() if _installed(each, spheres)]
    rows: list[Row] = []
    number = 0

    def notify(done: int, of: int, name: str) -> None:
        progress(number * of + done, len(chosen) * of, name)

    try:
        with CellProgress() as progress:
            for number, each in enumerate(chosen):  # noqa: B007  (read by `notify`)
                found = measure(each, notify, space=spheres)
                write_whole(
                    "--store", place / f"{each.id}{'.spheres' if spheres else ''}.json", plain_json(found) + "\n"
                )
                rows += found
    except KeyboardInterrupt:
        fail(f"interrupted: stored {number} of {count_noun(len(chosen), 'engine')}", INTERRUPTED)
    if json_file is not None:
        write_rows(json_file, rows)
    _show(rows)
    raise typer.Exit(WORSE if any(worse_than_promised(row) for row in rows) else 0)


def _installed(engine: Engine, spheres: bool) -> bool:
    from ninedisk.harness.api.capabilities import Capability

    try:
        info = engine.info()
        return info.installed and (not spheres or Capability.SPHERES in info.capabilities)
    except Exception:  # an outsider's engine that cannot even say what it is must not hide the others
        return False


def _show(rows: Sequence[Row]) -> None:
    from ninedisk.harness.api.text import one_line
    from ninedisk.harness.results.schema import DETERMINISM_KINDS, DETERMINISM_VERDICTS, worse_than_promised

    out = console()
    shown = table(
        "",
        "engine",
        "repetition",
        "difference",
        "allowed",
        "first",
        "why",
        right=("difference", "allowed", "first"),
        whole=("", "engine", "difference", "allowed", "first"),
    )
    reported = [row for row in rows if row["verdict"] not in ("bitwise", "not applicable")]
    for row in sorted(
        reported, key=lambda row: (not worse_than_promised(row), DETERMINISM_VERDICTS.index(row["verdict"]))
    ):
        numbers = ("-" if number != number else f"{number:.1e}" for number in (row["difference"], row["allowance"]))
        first = "-" if row["first_step"] < 0 else f"step {row['first_step']}"
        shown.add_row(("✗ " if worse_than_promised(row) else "  ") + row["verdict"], row["engine"], DETERMINISM_KINDS[row["kind"]][0],
                      *numbers, first, one_line(row["reason"])[:160])  # fmt: skip
    if reported:
        out.print(shown)
    for engine in dict.fromkeys(row["engine"] for row in rows):
        mine = [row for row in rows if row["engine"] == engine]
        same = [row["kind"] for row in mine if row["verdict"] == "bitwise"]
        none = [f"{row['kind']} ({row['reason']})" for row in mine if row["verdict"] == "not applicable"]
        text = f"{engine} [{mine[0]['scene']}]: the same to the last bit: {', '.join(same) or 'never'}"
        out.print(one_line(text + (f"; not applicable: {', '.join(none)}" if none else "")), soft_wrap=True)
    worse = sum(worse_than_promised(row) for row in rows)
    out.print(f"{len(rows)} repetitions, {worse} of them worse than required")
