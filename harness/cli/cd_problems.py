"""``ninedisk cd-problems``: contact problems as files, from a run or from seeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ninedisk.harness.cli.support import CellProgress, Group, guarded, parse_settings

if TYPE_CHECKING:
    from ninedisk.core.cd.problem_files import Form

Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files and problems.json.")]
FormOption = Annotated[
    str, typer.Option("--form", metavar="FORM", help="npz, fc2d (Siconos' text) or fclib (HDF5, needs h5py).")
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(cls=Group, no_args_is_help=True, help="Save or make contact problems as files.")
    group.command("collect", short_help="Save the contact problems of a run.")(collect)
    group.command("make", short_help="Make the open set of contact problems.")(make)
    app.add_typer(group, name="cd-problems")


@guarded
def collect(
    case: Annotated[str, typer.Argument(metavar="CASE", help="One case by its id.")],
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="As in ninedisk run.")
    ] = None,
    options: Annotated[
        list[str] | None, typer.Option("--option", metavar="cd.NAME=VALUE", help="A setting of the engine cd.")
    ] = None,
    every: Annotated[int, typer.Option("--every", metavar="N", help="Of each N-th step; failed ones always.")] = 1,
    form: FormOption = "npz",
    out: Out = Path("problems"),
) -> None:
    """Run one variant of a case by contact dynamics and save the contact problem of its steps.

    \b
    Examples:
      ninedisk cd-problems collect nine-disk/compression --every 100
      ninedisk cd-problems collect incline-block --set sliding=coulomb --form fclib --out incline
    """
    from ninedisk.core.scene import SphereScene
    from ninedisk.harness.api.errors import UsageError
    from ninedisk.harness.api.support import without_spring_preload
    from ninedisk.harness.bench import problem_set
    from ninedisk.harness.results.whole_file import check_folder
    from ninedisk.harness.run.plan import plan_case

    if every < 1:
        raise UsageError(f"--every {every} is not allowed: give a whole number >= 1")
    check_folder("--out", out)
    kind = _file_form(form)
    chosen = parse_settings(options or [], flag="--option", example="cd.tolerance=1e-10")
    setup = plan_case(case, "cd", parse_settings(settings or []), chosen).setup
    if isinstance(setup, Exception):
        raise setup
    if isinstance(setup.scene, SphereScene):
        raise UsageError(f"{case!r} is a case of spheres, and contact dynamics has the plane alone: give one of disks")
    with CellProgress() as progress:
        count = problem_set.collect(
            without_spring_preload(setup.scene),
            setup.numerics,
            out,
            every=every,
            form=kind,
            facts={"case": case},
            progress=progress,
        )
    typer.echo(f"{count} contact problems in {out}")


@guarded
def make(
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of radii and places; >= 0.")] = 0,
    disks: Annotated[
        int, typer.Option("--disks", metavar="N", help="Of the largest states, about half their contacts.")
    ] = 300,
    family: Annotated[
        list[str] | None, typer.Option("--family", metavar="NAME", help="Only this one; repeat it.")
    ] = None,
    form: FormOption = "npz",
    out: Out = Path("problems"),
) -> None:
    """Make contact problems of the plane from seeds: settling, packing, column, collapse, drum, hopper, biaxial, pyramid and lattice.

    Each family starts at 10 disks. Friction goes from 0 to 2; contacts are rigid and elastic in turn. States come from the in-house DEM,
    none from a contact solver. problems.json gives for each problem its origin, its size and a hash of its numbers. On the same kind of
    processor the numbers are always the same. With --disks 3000 there are some 320 problems.

    \b
    Examples:
      ninedisk cd-problems make --disks 100
      ninedisk cd-problems make --disks 3000 --seed 1 --out set-1
      ninedisk cd-problems make --family pyramid --form fclib
    """
    from ninedisk.harness.api.errors import UsageError, not_one_of
    from ninedisk.harness.bench import problem_set
    from ninedisk.harness.results.whole_file import check_folder

    wanted = tuple(family or problem_set.FAMILIES)
    unknown = [name for name in wanted if name not in problem_set.FAMILIES]
    if unknown:
        raise UsageError(not_one_of("--family", unknown[0], problem_set.FAMILIES))
    if seed < 0 or not problem_set.SIZES[0] <= disks <= problem_set.SIZES[-1]:
        raise UsageError(
            f"--seed {seed} --disks {disks} is not allowed: a seed >= 0, disks {problem_set.SIZES[0]} .. {problem_set.SIZES[-1]}"
        )
    check_folder("--out", out)
    kind = _file_form(form)
    with CellProgress() as progress:
        count, left_out = problem_set.make_set(
            out, seed=seed, largest=disks, form=kind, families=wanted, notify=lambda *reported: progress(*reported)
        )
    for each in left_out:
        typer.echo(f"left out: {each}", err=True)
    typer.echo(f"{count} contact problems in {out}")


def _file_form(text: str) -> Form:
    from ninedisk.harness.api.errors import UsageError, not_one_of

    forms: dict[str, Form] = {"npz": "npz", "fc2d": "fc2d", "fclib": "fclib"}
    if text not in forms:
        raise UsageError(not_one_of("--form", text, forms))
    return forms[text]
