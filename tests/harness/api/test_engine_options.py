"""Settings of engines from the command line and from Python: checked, recorded, and part of the variant's id."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.core.numerics import Numerics
from ninedisk.core.options import Option
from ninedisk.harness import run_case
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.registry import UnknownIdError, engine_table, get_engine
from ninedisk.harness.cli.app import app
from ninedisk.harness.results.reader import run_ids
from ninedisk.harness.run.plan import plan_matrix


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


def test_an_option_reaches_its_engine_and_no_other() -> None:
    cells = plan_matrix(["slip-to-roll"], ["pymunk", "dem"], {"dt": "0.01"}, {"pymunk.iterations": "7"})
    for cell in cells:
        own = cell.engine_id == "pymunk"
        assert cell.setup.numerics.options == ({"pymunk.iterations": 7} if own else {})
        assert cell.variant.id.endswith(",pymunk.iterations=7") is own


def test_the_default_said_aloud_is_the_same_variant() -> None:
    plain, said = (
        [cell.variant.id for cell in plan_matrix(["slip-to-roll"], ["pymunk"], {}, options)]
        for options in ({}, {"pymunk.iterations": "100"})
    )
    assert plain == said


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"iterations": "7"}, "names no engine: write ENGINE.NAME"),
        ({"pymunk.iteration": "7"}, "no option 'iteration'. Did you mean 'iterations'.*pymunk.collision_bias"),
        ({"siconos.theta": "1"}, "is not run: add --engine siconos"),
        ({"lammps.skin": "1"}, "no option 'skin'.* Its options: none"),
    ],
)
def test_options_that_nobody_has_are_refused_with_the_remedy(options: dict[str, str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        plan_matrix(["slip-to-roll"], ["pymunk", "lammps"], {}, options)


def test_an_unknown_engine_is_named() -> None:
    with pytest.raises(UnknownIdError, match=r"no engine 'pymonk'\. Did you mean 'pymunk'"):
        plan_matrix(["slip-to-roll"], ["pymunk"], {}, {"pymonk.iterations": "7"})


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("0", "a whole number in"),
        ("2.5", "a whole number in"),
        ("many", "= many is not allowed"),
        ("nan", "not allowed"),
    ],
)
def test_values_out_of_range_are_refused(value: str, words: str) -> None:
    with pytest.raises(InvalidNumericsError, match=words):
        plan_matrix(["slip-to-roll"], ["pymunk"], {}, {"pymunk.iterations": value})


def test_from_the_command_line_it_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pandas as pd

    monkeypatch.chdir(tmp_path)
    done = ninedisk("run", "slip-to-roll", "-e", "pymunk", "--set", "dt=0.01", "--option", "pymunk.iterations=7")
    assert done.exit_code == 0, done.output
    (run,) = run_ids(tmp_path / "results")
    cells = pd.read_parquet(tmp_path / "results" / "runs" / run / "cells.parquet")
    ran = cells[cells.status == "pass"]
    assert len(ran)
    for row in ran.itertuples():
        assert row.variant.endswith("pymunk.iterations=7")
        assert json.loads(row.settings)["pymunk.iterations"] == 7
        assert json.loads(row.setup)["numerics"]["options"] == {"pymunk.iterations": 7}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--option", "pymunk.iterations"), "--option 'pymunk.iterations' is not allowed: write NAME=VALUE"),
        (("--option", "pymunk.iterations=0"), "pymunk.iterations = 0.0 is not allowed"),
        (("--option", "pymunk.slop=1"), "no option 'slop'"),
        (("--option", "pymunk.iterations=1", "--option", "pymunk.iterations=2"), "gives 'pymunk.iterations' twice"),
    ],
)
def test_mistakes_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = ninedisk("run", "slip-to-roll", "-e", "pymunk", *arguments)
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.split())
    assert not (tmp_path / "results").exists()


GIVEN = {
    "cd.tolerance": ("1e-13", 1e-13),
    "cd.max_iterations": ("400", 400),
    "cd.time_limit": ("30", 30.0),
    "cd.accept": ("0.001", 1e-3),
    "cd.relaxation": ("1.25", 1.25),
    "cd.threads": ("2", 2),
    "cd.contacts": ("rigid", "rigid"),
    "cd.save_failed": ("failed.npz", "failed.npz"),
}


@pytest.mark.long
def test_contact_dynamics_takes_all_its_options_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pandas as pd

    assert {f"cd.{name}" for name in get_engine("cd").info().options} == set(GIVEN)
    monkeypatch.chdir(tmp_path)
    told = [part for name, (text, _) in GIVEN.items() for part in ("--option", f"{name}={text}")]
    done = ninedisk("run", "binary-collision", "-e", "cd", "--set", "kind=elastic", *told)
    assert done.exit_code == 0, done.output
    (run,) = run_ids(tmp_path / "results")
    cells = pd.read_parquet(tmp_path / "results" / "runs" / run / "cells.parquet")
    ran = cells[cells.status == "pass"]
    assert len(ran)
    for row in ran.itertuples():
        settings = json.loads(row.settings)
        assert {name: settings[name] for name in GIVEN} == {name: value for name, (_, value) in GIVEN.items()}


def test_contact_dynamics_takes_options_from_python_and_by_the_wire() -> None:
    result = run_case("binary-collision", engine="cd", options={"cd.tolerance": 1e-9, "cd.max_iterations": None})
    assert result.status == "pass"
    assert result.setup is not None
    assert result.setup.numerics.options == {"cd.tolerance": 1e-9, "cd.max_iterations": None}
    sent = Numerics.from_dict(json.loads(json.dumps(result.setup.numerics.to_dict())))
    run = get_engine("cd").run(result.setup.scene, sent, ())
    assert run.settings["cd.tolerance"] == 1e-9
    with pytest.raises(
        InvalidNumericsError, match=r"cd\.tolerance = 2 is not allowed: it must be a number in \(0, 1\)"
    ):
        get_engine("cd").run(result.setup.scene, sent.replace(options={"cd.tolerance": 2}), ())


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("cd.tolerance=0", "a number in (0, 1)"),
        ("cd.max_iterations=1.5", "a whole number in [1, 1e+15], or none (each solver's own)"),
        ("cd.max_iterations=nan", "a whole number in [1, 1e+15], or none (each solver's own)"),
        ("cd.threads=65", "a whole number in [1, 64]"),
        ("cd.contacts=soft", "one of auto, rigid, elastic"),
        ("cd.tolerence=1e-3", "Did you mean 'tolerance'"),
        ("dem.skin=1", "belongs to an engine that is not run"),
    ],
)
def test_mistakes_in_options_of_contact_dynamics(option: str, words: str) -> None:
    done = ninedisk("run", "binary-collision", "-e", "cd", "--option", option)
    assert done.exit_code == 2
    assert words in " ".join(done.stderr.split())


def test_the_dem_takes_threads_and_nothing_else() -> None:
    setup = run_case("binary-collision", engine="dem", options={"dem.threads": "2"}).setup
    assert setup is not None
    with pytest.raises(InvalidNumericsError, match=r"the option 'dem\.skin' is unknown: use one of dem\.threads"):
        get_engine("dem").run(setup.scene, setup.numerics.replace(options={"dem.skin": 0.1}), ())


def test_names_of_options_are_texts() -> None:
    with pytest.raises(
        InvalidNumericsError, match=r"options = \{3: 1.0\} is not allowed: they must be a mapping from names"
    ):
        Numerics(dt=0.1, n_steps=1, options={3: 1.0})  # type: ignore[dict-item]


def test_the_page_of_contact_dynamics_shows_ranges_and_defaults() -> None:
    shown = " ".join(ninedisk("list", "engines", "cd").stdout.split())
    assert all(name in shown for name in GIVEN)
    assert "1e-12" in shown
    assert "number in (0, 1)" in shown
    assert "--option cd.tolerance=1e-12" in shown


def test_the_page_of_an_engine_teaches_its_options() -> None:
    shown = ninedisk("list", "engines", "siconos").stdout
    assert "siconos.theta" in shown
    assert "a number in [0.5, 1]" in shown
    assert "one of nsgs, lemke" in shown
    assert "--option siconos.theta=0.5" in shown
    assert "It has no options" in ninedisk("list", "engines", "yade").stdout
    scope = ninedisk("list", "engines", "mujoco").stdout
    assert "out of scope by its own documentation: https://mujoco" in " ".join(scope.split())


def test_what_is_out_of_scope_says_so_in_the_empty_cell() -> None:
    result = run_case("nine-disk/compression", engine="pymunk")
    assert result.status == "unsupported"
    assert "it lacks" in result.reason
    assert "out of scope by its own documentation (https://" in result.reason


@pytest.mark.parametrize("engine_id", engine_table())
def test_announced_options_are_those_that_the_engine_reads(engine_id: str) -> None:
    info = get_engine(engine_id).info()
    for name, option in info.options.items():
        assert isinstance(option, Option)
        assert option.checked(name, option.default) == option.default
        assert option.why
    assert not set(info.out_of_scope) & info.capabilities
    assert all(link.startswith("https://") for link in info.out_of_scope.values())
    assert (info.contact == "soft") == (info.softness is not None)
    assert info.softness is None or info.softness_why
