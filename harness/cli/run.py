"""``ninedisk run``: check the request, run, store, tell."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ninedisk.harness.api.errors import StoreError, UsageError
from ninedisk.harness.api.registry import match_cases, problems
from ninedisk.harness.cli.cli_summary import show_summary
from ninedisk.harness.cli.support import FAILURE, CellProgress, fail
from ninedisk.harness.results.claims import judge_claims
from ninedisk.harness.results.store import new_run_id, prepare_store, write_run
from ninedisk.harness.results.tables import CaseResult, Row
from ninedisk.harness.results.tables_part import plain_json
from ninedisk.harness.results.whole_file import check_writable, write_whole
from ninedisk.harness.run.matrix import run_cells
from ninedisk.harness.run.plan import plan_matrix
from ninedisk.harness.run.provenance import command_line, provenance, usable_cores
from ninedisk.harness.run.published import check_folder
from ninedisk.harness.run.verdict import exit_code
from ninedisk.harness.wire.given import engines_given

if TYPE_CHECKING:
    from ninedisk.harness.run.cluster import Cluster


def execute(
    *,
    globs: Sequence[str],
    engines: Sequence[str],
    settings: Sequence[str],
    options: Sequence[str] = (),
    store: Path,
    json_file: Path | None,
    published: Path | None,
    commands: Sequence[str] = (),
    all_engines: bool = False,
    jobs: str | None = None,
    dask: str | None = None,
) -> int:
    """Run, store, print; the exit code of the command.

    Every mistake in the request is found before the first cell runs, the store's and the JSON file's included.

    Raises
    ------
    UsageError, ParameterError, CoreError
        With the message to show.
    """
    if jobs is not None and dask is not None:
        raise UsageError("--jobs and --dask exclude each other: a cluster has the workers that it has")
    at_once = read_jobs(jobs)
    cells = plan_matrix(
        match_cases(globs),
        engines_given(engines, commands, everything=all_engines),
        parse_settings(settings),
        parse_settings(options, flag="--option", example="siconos.theta=1"),
    )
    for note in (*(f"warning: {problem}" for problem in problems()), *check_folder(published, cells)):
        typer.echo(note, err=True)
    prepare_store(store)
    if json_file is not None:
        check_writable("--json", json_file)
    started = _now()
    with _cluster(dask) as cluster, CellProgress() as progress:
        results = run_cells(cells, progress, published=published, jobs=at_once, cluster=cluster)
        claims = judge_claims(results)
        where = {"jobs": at_once} if cluster is None else cluster.facts()
        facts = {
            "started": started,
            "finished": _now(),
            "provenance": provenance(result.cell for result in results) | where,
            "argv": command_line(),
        }
    code = exit_code({status for result in results for status in result.statuses})
    try:
        folder: Path | None = write_run(store, new_run_id(), results, claims, facts)
        if json_file is not None:
            write_json(json_file, results)
    except StoreError as error:
        show_summary(*_told(results), None)
        fail(str(error), FAILURE)
    show_summary(*_told(results), folder)
    return code


def _told(results: Sequence[CaseResult]) -> tuple[list[Row], list[Row]]:
    return [result.cell for result in results], [row for result in results for row in result.rows]


def read_jobs(text: str | None) -> int:
    """Cells at once that ``--jobs`` means; 1 without it.

    Raises
    ------
    UsageError
        If it is neither a whole number >= 1 nor auto.
    """
    if text is None:
        return 1
    if text == "auto":
        return usable_cores()
    if text.isascii() and text.isdigit() and int(text) >= 1:
        return int(text)
    raise UsageError(f"--jobs {text} is not allowed: give a whole number >= 1, or auto for one for each core")


def _cluster(address: str | None) -> AbstractContextManager[Cluster | None]:
    if address is None:
        return nullcontext()
    from ninedisk.harness.run.cluster import connected

    return connected(address)


def parse_settings(settings: Sequence[str], *, flag: str = "--set", example: str = "dt=0.01") -> dict[str, str]:
    """``NAME=VALUE`` texts as a mapping; a name given twice is refused, since only one of them could count."""
    found: dict[str, str] = {}
    for text in settings:
        name, sign, value = text.partition("=")
        name, value = name.strip(), value.strip()
        if not sign or not name or not value:
            raise UsageError(f"{flag} {text!r} is not allowed: write NAME=VALUE, for instance {flag} {example}")
        if found.setdefault(name, value) != value:
            raise UsageError(f"{flag} gives {name!r} twice ({found[name]} and {value}): give it once")
    return found


def write_json(path: Path, results: Sequence[CaseResult]) -> None:
    """Write the measurement rows; raises as `write_rows` does."""
    write_rows(path, [row for result in results for row in result.rows])


def write_rows(path: Path, found: Sequence[Row]) -> None:
    """Write rows as a JSON list, NaN as null; the file appears whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    rows = json.loads(plain_json(list(found)))
    write_whole("--json", path, json.dumps(rows, indent=1) + "\n")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
