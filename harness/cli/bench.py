"""``ninedisk bench``: the command and its work."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ninedisk.harness.cli.support import INTERRUPTED, CellProgress, Commands, fail, guarded

if TYPE_CHECKING:
    from ninedisk.harness.results.schema import Row
SUITES = ("dem", "spheres", "cd", "coulomb", "coulomb3d", "flow", "harness")
FAILED, BROKEN = 1, 3
LONGEST = 1e9
"""Time limit [s]: thirty years are none."""
ONE_THREAD = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables that keep numerical libraries on the one core that a measurement is given."""


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("bench", short_help="Compare speed and memory with other engines.")(bench)


@guarded
def bench(
    suites: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SUITE",
            help="dem, spheres, cd, coulomb, coulomb3d, flow or harness. None: all except coulomb3d.",
        ),
    ] = None,
    problem: Annotated[
        list[str] | None,
        typer.Option("--problem", metavar="GLOB", help="Only problems whose name matches; repeat for several."),
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            "--engine", "-e", metavar="NAME", help="Only these besides ours (name or pattern); repeat for several."
        ),
    ] = None,
    engine_cmd: Commands = None,
    size: Annotated[
        list[int] | None,
        typer.Option(
            "--size",
            metavar="N",
            min=4,
            max=1_000_000,
            help="Numbers of disks or spheres instead of the usual ones; repeat.",
        ),
    ] = None,
    large: Annotated[
        bool, typer.Option("--large", help="Also 100,000 (dem: and 1,000,000) disks or spheres: hours, not minutes.")
    ] = False,
    repeats: Annotated[
        int | None,
        typer.Option(
            "--repeats", metavar="N", min=1, help="Repeats of each measurement; None: 5, coulomb 2, coulomb3d 3."
        ),
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(
            "--time-limit",
            metavar="S",
            help="Seconds for one engine on one problem, all repeats; None: 120. Suites coulomb, coulomb3d: for one answer; None: 2, 5.",
        ),
    ] = None,
    files: Annotated[
        Path | None,
        typer.Option("--files", metavar="DIR", help="Folder of contact problems in 3D, for the suite coulomb3d."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the records.")] = Path("bench"),
) -> None:
    """Measure our engines and others on the same problems: same scene, same contact parameters, same step count.

    \b
    Suites:
      dem      settled packings, a flowing one and the nine disks, these also with finer steps, error beside time:
               ours with 1, 2, .. threads, LAMMPS, YADE and all engines with springs that know the variant
      spheres  settled boxes of 1,000 and 10,000 spheres, Hertz-Mindlin, also with large ones of 5 to 20 radii:
               ours with 1, 2, .. threads, LAMMPS; YADE in the short ones
      cd       contact problems of packings, a tall column and a lattice to residual AND duality gap 1e-4 .. 1e-10,
               cold and warm: our solvers, Clarabel, PIQP, Siconos
      coulomb  the open set of `ninedisk cd-problems make`, some 160 problems of 10, 30 and 100 disks (--size: 300,
               1000 and 3000, too), shares solved to 1e-3 .. 1e-12 as an independent judge sees it, and performance
               profiles: ours, Siconos' NSGS, Lemke and CPG; of the associated rule ours, Clarabel and PIQP
      coulomb3d  problems in space out of the files in --files: ours, Siconos' NSGS, Newton's method and ADMM
      flow     a drum, a hopper and a collapsing column stepped in time, time per simulated second beside the
               penetration and the error of friction: contact dynamics, the DEM at three stiffnesses, pymunk, Box2D,
               Bullet, MuJoCo with more and more iterations, engines by their commands
      harness  `ninedisk run` on dem, cd and pymunk: the appendix's cases (kernels cached, and not), and all cases

    Physics is checked first: an engine that computes something else gets no time. Repeats are interleaved (A B A B)
    on one core for one thread; the ratio to ours, repeat by repeat, is the result, absolute times stand beside it.
    Packings settle once (minutes for 10,000 disks) and are kept in the cache folder of the user.

    \b
    Examples:
      ninedisk bench dem
      ninedisk bench dem --size 1000 --repeats 3 --problem 'settled-*'
      ninedisk bench spheres --problem settled-10000-short
      ninedisk bench cd --time-limit 60 --engine clarabel --engine piqp
      ninedisk bench dem cd --large --repeats 9 --out figures
      ninedisk bench coulomb --size 300 --problem 'drum-*' --time-limit 10
      ninedisk bench coulomb3d --files problems
      ninedisk bench harness
      ninedisk bench flow --problem 'collapse-*' --engine-cmd 'node my-engine.mjs'

    \b
    Exit codes:
      0  every engine passed its check or is excused (not installed, target not reached in time)
      1  complete, but an engine failed its check
      2  wrong usage
      3  an engine failed or crashed
      130  interrupted; the record and the page hold what was measured until then
    """
    from ninedisk.harness.api.errors import UsageError, close_matches
    from ninedisk.harness.bench.plan import Request, run_suites
    from ninedisk.harness.bench.records import prepare_folder, print_rows, write_records
    from ninedisk.harness.results.store import new_run_id
    from ninedisk.harness.run.provenance import command_line, provenance
    from ninedisk.harness.wire.command import engines_given
    from ninedisk.reports.bench import write_bench

    if files is not None and suites is None:
        suites = ["coulomb3d"]
    suites, commands = suites or [each for each in SUITES if each != "coulomb3d"], engine_cmd or []
    for suite in suites:
        if suite not in SUITES:
            near = close_matches(suite, SUITES)
            raise UsageError(f"there is no suite {suite!r}: use {', '.join(SUITES)}{near and '.'}{near}")
    if time_limit is not None and not 0.0 < time_limit <= LONGEST:
        raise UsageError(f"--time-limit {time_limit:g} is not allowed: it must be in (0, {LONGEST:g}] s")
    if commands and "flow" not in suites:
        raise UsageError("--engine-cmd is for the suite flow: add it, or leave the command out")
    if files is not None and "coulomb3d" not in suites:
        raise UsageError("--files is for the suite coulomb3d: add it, or leave the folder out")
    request = Request(
        suites=tuple(dict.fromkeys(suites)),
        problem_wanted=_matcher(problem or []),
        engine_wanted=_matcher(engine or []),
        brought=tuple(each for each in engines_given([], commands) if not isinstance(each, str)) if commands else (),
        sizes=tuple(dict.fromkeys(size or [])),
        large=large,
        repeats=repeats,
        time_limit=time_limit,
        files=files,
    )
    prepare_folder(out)
    run_id = new_run_id()
    rows: list[Row] = []
    facts: dict[str, Any] = {"provenance": provenance(), "argv": command_line()}
    page = out / f"{run_id}.html"
    try:
        with one_thread(), CellProgress() as progress:
            for batch in run_suites(request, lambda text, done=0, total=0: progress(done, total, text)):
                rows += batch
                facts["versions"] = _versions(rows)
                paths = write_records(out, run_id, facts, rows)
    except KeyboardInterrupt:
        if not rows:
            raise
        fail(f"interrupted: {str(paths[0])!r} holds what was measured until then", INTERRUPTED)
    finally:  # hours of measurements are worth a page even if the last one is interrupted
        if rows:
            write_bench({"run_id": run_id, **facts, "rows": rows}, page)
    if not rows:
        raise UsageError(
            "nothing to measure: no problem matches --problem, --size and the suites; leave one of them out"
        )
    print_rows(rows, [*paths, page])
    found = {row["status"] for row in rows}
    raise typer.Exit(BROKEN if "error" in found else FAILED if "fail" in found else 0)


@contextmanager
def one_thread() -> Iterator[None]:
    """Numerical libraries loaded from here on, in this process and in those it starts, use one thread."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _matcher(globs: list[str]) -> Callable[[str], bool]:
    return lambda name: not globs or any(fnmatchcase(name, glob) for glob in globs)


def _versions(rows: list[Row]) -> dict[str, str]:
    return {row["engine"]: row["engine_version"] for row in rows if row["engine_version"]}
