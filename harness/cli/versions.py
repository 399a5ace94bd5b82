"""``ninedisk versions``: what changed in an engine from version to version."""

from __future__ import annotations

import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.text import count_noun
from ninedisk.harness.cli.run import Profile
from ninedisk.harness.cli.support import FAILURE, INTERRUPTED, Store, guarded
from ninedisk.harness.terminal import console, table

if TYPE_CHECKING:
    from ninedisk.harness.results.store import Snapshot

MOST_LINES = 15
"""Changes that are shown of each step from one version to the next."""


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("versions", short_help="Run several versions of an engine and show what changed.")(versions)


@guarded
def versions(
    engine: Annotated[
        str,
        typer.Argument(
            metavar="ENGINE",
            help="Id of an engine that is a Python package, or a command with {version} in it.",
        ),
    ],
    version: Annotated[list[str], typer.Argument(metavar="VERSION...", help="Two versions or more, oldest first.")],
    case: Annotated[
        list[str] | None,
        typer.Option("--case", "-c", metavar="GLOB", help="Cases by id or pattern; repeat for several. None: all."),
    ] = None,
    profile: Annotated[
        Profile,
        typer.Option("--profile", help="Settings: tuned by the adapter, stock as the engine has them, or both."),
    ] = Profile.BOTH,
    jobs: Annotated[
        str | None, typer.Option("--jobs", "-j", metavar="N", help="Cells at once, as of ninedisk run.")
    ] = None,
    store: Store = Path("results"),
) -> None:
    """Run the same cases on several versions of one engine and show what changed from each to the next.

    Each version of a Python package is installed once, into a folder of the cache; the environment here stays as it is. Every run is
    stored like any other and knows the engine's version, so that compare, dashboard and report work on them.

    \b
    Examples:
      ninedisk versions mujoco 3.2.7 3.3.7 4.0.0 --case incline-block --case friction/hold
      ninedisk versions pymunk 7.2.0 7.3.1 --profile stock
      ninedisk versions './acme-{version}/engine' 1.4 1.5 -c 'spheres/*'

    \b
    Exit codes:
      0  no version is worse than the one before
      1  a headline, a check or a timing got worse
      2  wrong usage (unknown engine or version, one version alone)
      3  an engine failed in some cell, or a version could run nothing
      130  interrupted
    """
    from ninedisk.harness.api.registry import match_cases
    from ninedisk.harness.results.store import load_snapshot
    from ninedisk.harness.run.versions import PLACE, cache, check_versions, environment_of, installed, run_with

    check_versions(version)
    match_cases(case or [])
    distribution = "" if PLACE in engine else _distribution(engine)
    shared = [*(case or []), "--allow-unsupported", *(["--jobs", jobs] if jobs else [])]
    # All are installed before the first runs: a version that does not exist is a mistake in the request.
    places = [installed(distribution, each, cache(), _note) if distribution else None for each in version]
    runs: list[tuple[str, Snapshot]] = []
    worst = 0
    for each, place in zip(version, places, strict=True):
        _note(f"running version {each}")
        named = ["--engine", engine, "--profile", profile.value]
        own = named if distribution else ["--engine-cmd", engine.replace(PLACE, each)]
        run_id, code, said = run_with(environment_of(place), [*own, *shared], store)
        if code == INTERRUPTED:
            raise typer.Exit(INTERRUPTED)
        if not run_id:
            raise UsageError(f"version {each} could run nothing:\n{said.strip()[-1000:]}")
        worst = max(worst, FAILURE if code == FAILURE else 0)
        runs.append((each, load_snapshot(store, run_id)))
        ran = {str(cell["engine_version"]) for cell in runs[-1][1].cells.values()} - {""}
        if distribution and ran != {each}:
            raise UsageError(
                f"asked for {distribution} {each}, and {', '.join(sorted(ran)) or 'nothing'} ran: write the version as the package "
                f"does, or remove {places[len(runs) - 1]}"
            )
    _show(runs)
    grew = [_changes(before, after) for before, after in pairwise(runs)]
    raise typer.Exit(worst or int(any(grew)))


def _note(line: str) -> None:
    typer.echo(line, err=True)


def _distribution(engine: str) -> str:
    """The Python package of an engine; refuses one that is none."""
    from ninedisk.harness.api.registry import STOCK_ENGINES, engine_table, get_engine

    found: Any = get_engine(engine.removesuffix("-stock") if engine in STOCK_ENGINES else engine)
    name = str(getattr(found, "distribution", ""))
    if not name:
        have = [each for each in engine_table() if getattr(_loaded(each), "distribution", "")]
        raise UsageError(
            f"{engine} is no Python package whose versions can be installed; engines that are: {', '.join(have)}. "
            "An engine behind a command takes {version} in the command"
        )
    return name


def _loaded(engine: str) -> Any:
    from ninedisk.harness.api.registry import BrokenEntryError, get_engine

    try:
        return get_engine(engine)
    except BrokenEntryError:
        return None


def _show(runs: list[tuple[str, Snapshot]]) -> None:
    """A line for each version: how its cells ended, its largest headline error, where it is stored."""
    from ninedisk.harness.results.store import HEADLINE

    shown = table("version", "reported", "cells", "largest headline error", "run", whole=("version", "reported", "run"))
    for version, run in runs:
        statuses = Counter(str(cell["status"]) for cell in run.cells.values())
        counts = ", ".join(f"{count} {status}" for status, count in statuses.most_common())
        reported = sorted({str(cell["engine_version"]) for cell in run.cells.values() if cell["engine_version"]})
        headlines = [row for rows in run.checks.values() for row in rows.values() if row["truth"] == HEADLINE]
        far = max(
            (row for row in headlines if row["abs_error"] == row["abs_error"]),
            key=lambda row: float(row["abs_error"]),
            default=None,
        )
        place = f"{100.0 * far['abs_error']:.3g} %: {far['case']}, {far['quantity']}" if far else "none"
        shown.add_row(version, ", ".join(reported), counts, place, run.facts.run_id)
    console().print(shown)


def _changes(before: tuple[str, Snapshot], after: tuple[str, Snapshot]) -> int:
    """Print what changed from one version to the next; how much got worse."""
    from ninedisk.harness.results.compare import (
        change_numbers,
        changed_quantity,
        compare,
        counts,
        headline,
        side,
        worth_showing,
    )
    from ninedisk.harness.results.schema import short_variant

    found = compare(side([before[1]]), side([after[1]]))
    out = console()
    out.print(f"\n{before[0]} to {after[0]}:", markup=False)
    changes = worth_showing(found)
    if changes:
        shown = table(
            "", "case", "variant", "engine", "what", "before", "after", "change", right=("before", "after", "change")
        )
        for change in changes[:MOST_LINES]:
            words = (
                change.verdict,
                change.case,
                short_variant(change.variant),
                change.engine,
                changed_quantity(change),
            )
            shown.add_row(*words, *change_numbers(change)[:3])
        out.print(shown)
    if len(changes) > MOST_LINES:
        out.print(f"... and {count_noun(len(changes) - MOST_LINES, 'more change')}")
    out.print(headline(found), markup=False)
    runs = f"{before[1].facts.run_id} {after[1].facts.run_id}"
    out.print(f"all of it: ninedisk compare {runs}", markup=False, soft_wrap=True)
    sys.stdout.flush()
    return counts(found)["worse"]
