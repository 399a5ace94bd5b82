"""``ninedisk audit``: does a trajectory obey mechanics?"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from ninedisk.harness.cli.support import CellProgress, guarded
from ninedisk.harness.terminal import console, table

WRONG = 1


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("audit", short_help="Check conservation laws and friction in a trajectory file.")(audit)


@guarded
def audit(
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="The trajectory; not needed with --example.")
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(
            "--scene",
            metavar="FILE",
            help="The TOML. None: FILE with the ending .toml, or audit.toml beside or in it; else what FILE shows.",
        ),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write every verdict with its numbers."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Also write a page with figures; of a former page, the folder is replaced."
        ),
    ] = None,
    write_scene: Annotated[
        Path | None,
        typer.Option(
            "--write-scene",
            metavar="FILE",
            help="Also write a TOML with what the trajectory shows, to complete. A file that is there is kept, and named.",
        ),
    ] = None,
    example: Annotated[
        Path | None,
        typer.Option("--example", metavar="DIR", help="Write a trajectory and a TOML that pass, to start from."),
    ] = None,
) -> None:
    """Check conservation laws and friction in a trajectory of any program: momentum, angular momentum, energy, overlaps, the friction
    cone, jumps, lost bodies. Each gets a verdict: it holds, it is violated (where, by how much), or it cannot be decided, and why.

    FILE is a LAMMPS or LIGGGHTS dump in text (.gz, .zst as well), YAML or netCDF, a GSD, H5MD, VTKHDF or extended XYZ file, MercuryDPM's
    .data, a table (.csv, .parquet) with a row for each body and frame, or an .npz of whole arrays (t, x, v, omega). It may also be a
    .pvd, or a folder of frame-*.npz, *.vtk, *.vtp, *.vtu, *.pvtp, *.pvtu or of YADE's text exports. Disks in the plane need x and y,
    spheres in space x, y and z. Optional columns are id, type, vx, vy, vz, omega or omegax, omegay, omegaz, angle, radius or
    diameter, mass.

    The TOML gives what the file lacks: other names of columns, masses, walls and their motion, mu, kn, gravity, the step. Vectors of
    three numbers make it a scene in space. Without a TOML the command prints one with what the file shows, and names what it lacks.

    An allowance has three parts, and each verdict names those that count: the printed digits, contacts at unknown instants between
    two frames, and the error of a sound scheme's step. The more is given (dt, kn, ks, mu) and the denser the frames, the more can be
    decided. Bodies that may have touched form a group. A group away from walls keeps momentum and angular momentum. The impulse of a
    wall lies in its cone of friction. A group gains energy only from moving walls.

    A --json file has dimension, checks, totals over time, digits, and what was given. Checks are listed worst first. Each has id,
    verdict, said, judged, undecided, first and series of [t, value, allowance]. Its worst has value, allowance, parts, step, t, disks.

    \b
    Examples:
      ninedisk audit --example sample
      ninedisk audit sample/trajectory.csv
      ninedisk audit dump.lammpstrj
      ninedisk audit dump.lammpstrj --write-scene run.toml
      ninedisk audit dump.lammpstrj --scene run.toml --out audit
      ninedisk audit frames/ --scene run.toml --json audit.json

    \b
    Exit codes:
      0  nothing is violated; the table says what could not be decided
      1  something is violated
      2  wrong usage, or a file that cannot be read: file, line and column are named
      130  interrupted; nothing was written
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.text import one_line
    from ninedisk.harness.audit.example import write_example
    from ninedisk.harness.audit.infer import infer_scene
    from ninedisk.harness.audit.run import VIOLATED
    from ninedisk.harness.audit.run import audit as audited
    from ninedisk.harness.audit.scene_file import read_scene, scene_of_text
    from ninedisk.harness.results.tables import plain_json
    from ninedisk.harness.results.whole_file import (
        check_folder,
        check_no_input,
        check_same_text,
        check_writable,
        write_whole,
    )
    from ninedisk.reports.audit import write_audit

    if (file is None) == (example is None):
        raise UsageError("give a trajectory to audit, or --example DIR to write one: one of the two")
    if example is not None:
        for flag, given in (("--scene", scene), ("--json", json_file), ("--out", out), ("--write-scene", write_scene)):
            if given is not None:
                raise UsageError(f"--example audits nothing: take {flag} {str(given)!r} away, or give a trajectory")
        check_folder("--example", example)
        typer.echo(f"written: {', '.join(str(path) for path in write_example(example))}")
        typer.echo(f"next: ninedisk audit {example / 'trajectory.csv'}")
        raise typer.Exit(0)
    assert file is not None
    given = scene or _companion_file(file)
    inputs = [each for each in (file, given) if each is not None]
    if json_file is not None:
        check_writable("--json", json_file)
        check_no_input("--json", json_file, inputs)
    if out is not None:
        check_folder("--out", out)
    if write_scene is not None:
        check_writable("--write-scene", write_scene)
        check_no_input("--write-scene", write_scene, [file])
        if json_file is not None and write_scene.resolve() == json_file.resolve():
            raise UsageError(f"--write-scene and --json both name {str(json_file)!r}: give two files")
    if given is None or write_scene is not None:
        inferred = infer_scene(file)
        if write_scene is not None:
            check_same_text("--write-scene", write_scene, inferred.text)
            write_whole("--write-scene", write_scene, inferred.text)
            typer.echo(f"written: {write_scene}")
        if given is None:
            typer.echo(f"# There is no TOML beside {one_line(str(file))}. What it shows:\n{inferred.text}")
            if inferred.lacking:
                wanted = "".join(f"\n  {each}" for each in inferred.lacking)
                place = write_scene or file.with_suffix(".toml")
                hint = "" if write_scene is not None else f" (--write-scene {place} starts it)"
                raise UsageError(
                    f"an audit of {str(file)!r} needs what the file does not show; write in {place}{hint}:{wanted}"
                )
    reported = (
        read_scene(given) if given is not None else scene_of_text(inferred.text, f"TOML inferred from {file.name}")
    )
    if json_file is not None:
        more = [*(each.path for each in reported.contacts), reported.reverse, reported.data]
        check_no_input("--json", json_file, [each for each in more if each is not None])
    with CellProgress() as progress:
        record = audited(file, reported, progress)
    if json_file is not None:
        write_whole("--json", json_file, plain_json(record) + "\n")
    _show(record)
    if out is not None:
        typer.echo(f"page: {write_audit(record, out)}")
    raise typer.Exit(WRONG if any(check["verdict"] == VIOLATED for check in record["checks"]) else 0)


def _companion_file(file: Path) -> Path | None:
    from ninedisk.harness.api.errors import UsageError

    tried = [file.parent / "audit.toml"]
    if file.name:  # of ".", none
        tried = [file.with_suffix(".toml"), file.with_suffix("").with_suffix(".toml"), *tried]
    for path in [*tried, file / "audit.toml"] if file.is_dir() else tried:
        if path.is_file():
            return path
    if not file.exists():
        raise UsageError(f"there is no {str(file)!r}: give a trajectory; `ninedisk audit --example DIR` writes one")
    return None


def _show(record: Mapping[str, Any]) -> None:
    from ninedisk.harness.api.text import count_noun, one_line

    out = console()
    digits = ", ".join(
        f"{name} {reported}" for name, reported in record["digits"].items() if name in ("t", "x", "vx", "omega")
    )
    begin, end = record["t"]
    out.print(
        one_line(
            f"{record['file']} ({record['form']}): {count_noun(record['disks'], record['noun'])}, {count_noun(record['frames'], 'frame')} "
            f"from t = {begin:.4g} to {end:.4g} s, "
            f"{record['interval'][0]:.4g} s apart; {digits}"
        )
    )
    if record["dt"] is None:
        out.print("time.dt, the engine's own step, is not given: taken as the interval, which allows more")
    for remark in record["remarks"]:
        out.print(one_line(f"read: {remark}"))
    shown = table("", "check", "verdict")
    for check in record["checks"]:
        sign = {"violated": "✗", "holds": "✓"}.get(check["verdict"], "?")
        shown.add_row(sign, f"{check['id']}: {check['title']}", one_line(textwrap.shorten(check["said"], 900)))
    out.print(shown)
    verdicts = [check["verdict"] for check in record["checks"]]
    early = [check for check in record["checks"] if check["verdict"] == "violated"]
    if len(early) > 1:
        # A time that is no number is None in a record.
        timed = [check for check in early if check["first"]["t"] is not None]
        if timed:
            first = min(timed, key=lambda check: float(check["first"]["t"]))
            out.print(
                f"violated first: {first['id']}, at t = {first['first']['t']:.4g} s; later violations may follow from it"
            )
    out.print(
        f"{verdicts.count('violated')} violated, {verdicts.count('holds')} hold, {verdicts.count('not decidable')} not decidable."
    )
