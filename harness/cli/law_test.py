"""``ninedisk law-test``: does a contact law give the forces that it should, by files alone?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ninedisk.harness.cli.support import Group, guarded
from ninedisk.harness.terminal import console, table

WRONG = 1


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(cls=Group, no_args_is_help=True, help="Test a contact law by prescribed motions, in files.")
    group.command("write", short_help="Write motions of two spheres to follow.")(write)
    group.command("judge", short_help="Judge the forces that a code returned.")(judge)
    app.add_typer(group, name="law-test")


@guarded
def write(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder for the motions, law.toml and README.md; made if missing.")
    ],
) -> None:
    """Write eight motions of two spheres as CSV, the law's parameters as law.toml, and a README.md with the columns to give back.

    The motions are shear within and beyond friction, rotation of the pair in and out of plane, twist, spins, a dashpot, unloading.
    A law.toml that is there is kept, and the paths follow its radius and overlap.

    \b
    Examples:
      ninedisk law-test write law
    """
    from ninedisk.harness.audit.law_test import write_law_test
    from ninedisk.harness.results.whole_file import check_folder

    check_folder("DIR", folder)
    files = write_law_test(folder)
    typer.echo(f"written: {len(files)} files in {folder}; {folder / 'README.md'} says what to give back")
    typer.echo(f"next: ninedisk law-test judge {folder}")


@guarded
def judge(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder, with NAME.forces.csv beside NAME.csv.")],
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every verdict with its numbers.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Also write a page with figures; of a former page, the folder is replaced."
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="MOTION", help="Judge this motion, as its file is named; may be repeated. None: all."
        ),
    ] = None,
) -> None:
    """Hold forces and torques that a code returned against closed forms, and name the conventions that fit.

    Conventions are the arms of torque and slip, whether the shear spring turns with the normal and about it, whether it is cut where
    friction limits the force, and whether the dashpot pulls. law.toml may declare them; the code is then held to them.

    A --json file has law, checks, conventions, motions and missing. Each of checks has id, verdict, said, value, allowance and t. Each
    of conventions has declared, accepted, found and said. Motions are listed worst first, each with ratio, the error over its
    allowance, and curves. missing names the motions without forces.

    \b
    Examples:
      ninedisk law-test judge law
      ninedisk law-test judge law --json law.json --out law-page
      ninedisk law-test judge law --only shear-elastic --only spin

    \b
    Exit codes:
      0  nothing is violated
      1  something is violated
      2  wrong usage, a file that cannot be read (file, line and column are named), or motions without forces that --only does not leave out
    """
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.text import one_line
    from ninedisk.harness.audit.law_test import HOLDS, UNDECIDED, VIOLATED, judge_law_test
    from ninedisk.harness.results.tables import plain_json
    from ninedisk.harness.results.whole_file import check_folder, check_no_input, check_writable, write_whole
    from ninedisk.reports.law_test import write_law_page

    if json_file is not None:
        check_writable("--json", json_file)
        check_no_input("--json", json_file, [folder / "law.toml", *folder.glob("*.csv")])
    if out is not None:
        check_folder("--out", out)
    record = judge_law_test(folder, only or ())
    if json_file is not None:
        write_whole("--json", json_file, plain_json(record) + "\n")
    shown = table("", "check", "verdict")
    for check in record["checks"]:
        sign = {VIOLATED: "✗", HOLDS: "✓"}.get(check["verdict"], "?")
        shown.add_row(sign, check["id"], one_line(check["said"]))
    screen = console()
    screen.print(shown)
    conventions = table("convention", "found", "declared")
    for name, given in record["conventions"].items():
        declared = "" if given["declared"] is None else str(given["declared"]).lower()
        conventions.add_row(name, given["said"], declared)
    screen.print(conventions)
    verdicts = [check["verdict"] for check in record["checks"]]
    screen.print(
        f"{verdicts.count(VIOLATED)} violated, {verdicts.count(HOLDS)} hold, {verdicts.count(UNDECIDED)} not decidable."
    )
    if out is not None:
        typer.echo(f"page: {write_law_page(record, out)}")
    if VIOLATED in verdicts:
        raise typer.Exit(WRONG)
    if record["missing"]:
        raise UsageError(
            f"no forces for {', '.join(record['missing'])}: write {record['missing'][0]}.forces.csv and so on, or name the motions to "
            "judge by --only"
        )
