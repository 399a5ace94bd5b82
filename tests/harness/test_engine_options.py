"""Settings of engines from the command line and from Python: checked, recorded, and part of the variant's id."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from ninedisk.core.errors import InvalidNumericsError
from ninedisk.harness import run_case
from ninedisk.harness.cli import app
from ninedisk.harness.engine import Option
from ninedisk.harness.errors import UsageError
from ninedisk.harness.plan import plan_matrix
from ninedisk.harness.registry import UnknownIdError, engine_table, get_engine
from ninedisk.harness.store import run_ids


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
        ({"dem.skin": "1"}, "no option 'skin'.* Its options: none"),
    ],
)
def test_options_that_nobody_has_are_refused_with_the_way_out(options: dict[str, str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        plan_matrix(["slip-to-roll"], ["pymunk", "dem"], {}, options)


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


def test_the_page_of_an_engine_teaches_its_options() -> None:
    shown = ninedisk("list", "engines", "siconos").stdout
    assert "siconos.theta" in shown
    assert "a number in [0.5, 1]" in shown
    assert "one of nsgs, lemke" in shown
    assert "--option siconos.theta=0.5" in shown
    assert "It has no options" in ninedisk("list", "engines", "dem").stdout
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
    assert (info.softness is None) or (info.contact == "soft" and 0.0 < info.softness < 1.0 and info.softness_why)
