"""Lines that report how to do a cell again are complete commands: they are run here unchanged."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ninedisk.harness import run_case
from ninedisk.harness.api.registry import BUILTIN_CASES
from ninedisk.harness.cli.app import app
from ninedisk.harness.cli.support import parse_settings
from ninedisk.harness.run.plan import Cell, plan_case, plan_matrix, request_command, run_command
from ninedisk.harness.wire.command import CommandEngine, engines_given

BAD = Path(__file__).parents[1] / "wire" / "bad_engine.py"


def values(words: list[str], flag: str) -> list[str]:
    return [after for word, after in pairwise(words) if word == flag]


def planned(command: str) -> list[Cell]:
    """The cells that `ninedisk run` would run for this command."""
    words = shlex.split(command)
    assert words[:2] == ["ninedisk", "run"]
    engines = engines_given(values(words, "--engine"), values(words, "--engine-cmd"))
    options = parse_settings(values(words, "--option"), flag="--option")
    return plan_matrix([words[2]], engines, parse_settings(values(words, "--set")), options)


@pytest.mark.parametrize("case_id", BUILTIN_CASES)
def test_the_command_of_each_variant_runs_that_one_alone(case_id: str) -> None:
    for cell in plan_matrix([case_id], ["dem"], {}):
        (again,) = planned(run_command(cell))
        assert (again.name, again.variant.params) == (cell.name, cell.variant.params)


def test_options_that_are_texts_are_reported_as_they_are() -> None:
    cell = plan_case("binary-collision", "cd", {"kind": "plastic"}, {"cd.save_failed": "some/folder/x y.npz"})
    (again,) = planned(run_command(cell))
    assert not isinstance(again.setup, Exception)
    assert again.setup.numerics.options == {"cd.save_failed": "some/folder/x y.npz"}


def test_options_of_the_engine_are_part_of_it() -> None:
    cell = plan_case("binary-collision", "pymunk", {"kind": "plastic"}, {"pymunk.iterations": 7})
    (again,) = planned(run_command(cell))
    assert again.name == cell.name
    assert not isinstance(again.setup, Exception)
    assert again.setup.numerics.options == {"pymunk.iterations": 7}


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.fixture
def engine_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Engines behind commands with words that a shell would take apart, in a folder that they are relative to."""
    (tmp_path / "an engine.py").write_text(BAD.read_text())
    monkeypatch.chdir(tmp_path)
    return lambda mode: CommandEngine(shlex.join([sys.executable, "an engine.py", mode]))


def test_an_engine_behind_a_command_is_run_again_by_it(engine_of, tmp_path: Path) -> None:
    cell = plan_case("binary-collision", engine_of("good"), {"kind": "plastic"}, {"bad.effort": 5})
    done = shell(f"{run_command(cell)} --json rows.json", tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert {(row["case"], row["variant"], row["engine"]) for row in rows} == {(cell.case.id, cell.variant.id, "bad")}


@pytest.mark.usefixtures("engine_of")
def test_what_a_run_says_to_do_again_gives_the_same(tmp_path: Path) -> None:
    """The worst cell, through a shell: with the engine's command, its option, and what was set."""
    engine = shlex.join([sys.executable, "an engine.py", "good"])
    given = ["--engine-cmd", engine, "--set", "kind=elastic", "--option", "bad.effort=5", "--engine", "pymunk"]
    first = shell(shlex.join(["ninedisk", "run", "binary-collision", *given, "--json", "first.json"]), tmp_path)
    line = next(line for line in first.stdout.splitlines() if line.startswith("to repeat the first cell that failed: "))
    again = shell(f"{line.partition(': ')[2]} --json again.json", tmp_path)
    assert (first.returncode, again.returncode) == (1, 1), again.stdout + again.stderr
    rows, more = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("again", "first"))
    assert rows
    assert all(row in more for row in rows)


def test_the_example_of_an_engine_behind_a_command_runs_it(engine_of) -> None:
    done = CliRunner().invoke(app, ["list", "engines", "--engine-cmd", engine_of("good").command_line])
    line = next(line for line in done.output.splitlines() if line.startswith("example: "))
    words = shlex.split(line.removeprefix("example: "))
    cells = planned(shlex.join([*words[:2], "binary-collision", *words[2:]]))
    assert {(cell.engine_id, cell.setup.numerics.options["bad.effort"]) for cell in cells} == {("bad", 3)}


def test_how_to_see_a_failure_by_hand_shows_that_failure(engine_of, tmp_path: Path) -> None:
    result = run_case(
        "binary-collision", engine=engine_of("loud"), params={"kind": "plastic"}, options={"bad.effort": 5}
    )
    line = result.reason.splitlines()[-1]
    done = shell(line.removeprefix("to see it by hand: "), tmp_path)
    assert done.returncode == 3
    assert "no licence found" in done.stderr


def test_the_request_by_hand_is_the_one_that_the_engine_got(engine_of, tmp_path: Path) -> None:
    cell = plan_case("binary-collision", engine_of("good"), {"kind": "plastic"}, {"bad.effort": 5})
    asked = shell(request_command(cell).rpartition(" | ")[0], tmp_path)
    assert not isinstance(cell.setup, Exception)
    request = json.loads(asked.stdout)
    assert request["numerics"]["options"] == {"bad.effort": 5}
    scene, numerics = cell.engine.asked(cell.setup.scene, cell.setup.numerics)  # type: ignore[union-attr]
    assert (request["scene"], request["numerics"]) == (scene.to_dict(), numerics.to_dict())


@pytest.mark.parametrize(
    ("mode", "more", "said"),
    [
        ("about-exit", [], "gives no description of the engine"),
        ("", ["--option", "bad.effort=5"], "add --engine ID or --engine-cmd COMMAND"),
    ],
)
def test_a_request_that_cannot_be_made_says_why(tmp_path: Path, mode: str, more: list[str], said: str) -> None:
    engine = ["--engine-cmd", shlex.join([sys.executable, str(BAD), mode])] if mode else []
    done = shell(shlex.join(["ninedisk", "request", "binary-collision", *engine, *more]), tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert "Traceback" not in done.stderr
