"""Commands that take an engine by its command, like any other engine, and what they print to be repeated."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from ninedisk.harness.bench import flow
from ninedisk.harness.bench.flow import FlowProblem
from ninedisk.harness.cli.app import app
from ninedisk.harness.wire.command import CommandEngine

BAD = Path(__file__).parent / "bad_engine.py"
SPRINGS = Path(__file__).resolve().parents[3] / "docs" / "examples" / "spring_dem.py"


pytestmark = pytest.mark.usefixtures("here")


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


def command(*words: object) -> list[str]:
    return ["--engine-cmd", shlex.join([sys.executable, *map(str, words)])]


def test_check_engine_reports_how_to_see_what_fails(tmp_path: Path) -> None:
    """The engine lets every disk fly on: what it says of gravity, which it does not declare, is refused, of impacts it is found out."""
    wrong = tmp_path / "an engine.py"
    wrong.write_text(BAD.read_text().replace('"restitution"]', '"restitution", "gravity"]'))
    done = ninedisk("check-engine", *command(wrong, "good"))
    assert done.exit_code == 1, done.output
    line = next(line for line in done.output.splitlines() if line.startswith("  again: "))
    again = ninedisk(*shlex.split(line.partition(": ")[2])[1:], "--json", "found.json")
    assert again.exit_code == 1, again.output
    (found,) = json.loads(Path("found.json").read_text())["findings"]
    assert found["status"] == "fail"
    assert found["check"] in line


def test_check_engine_gives_up_an_engine_that_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NINEDISK_TIME_LIMIT", "1.5")  # for the description, on a machine that may be busy
    arguments = command(BAD, "late")
    done = ninedisk("check-engine", *arguments, "--json", "found.json")
    assert done.exit_code == 1
    found = [each["found"] for each in json.loads(Path("found.json").read_text())["findings"]]
    assert any("not run: the engine was stopped at its time limit 3 times in a row" in text for text in found), found


def test_converge() -> None:
    """Its contact step is halved, as that of any engine with springs."""
    done = ninedisk("converge", "impact/oblique", *command(SPRINGS), "--halvings", "3", "--json", "orders.json")
    assert done.exit_code in (0, 1), done.output
    record = json.loads(Path("orders.json").read_text())
    assert (record["engine"], record["step"]) == ("spring-dem", "contact_dt")
    assert record["steps"][0] == pytest.approx(8.0 * record["steps"][3], rel=1e-12)
    assert "exact" in {row["verdict"] for row in record["rows"]}


def test_request_says_where_a_run_would_not_ask() -> None:
    done = ninedisk("request", "nine-disk/compression", *command(BAD, "good"))
    assert done.exit_code == 0
    assert "note: a run does not ask bad for this: it lacks Coulomb friction, " in done.stderr
    assert json.loads(done.stdout)["scene"]["disks"]["mass"]
    assert "note" not in ninedisk("request", "binary-collision", *command(BAD, "good")).stderr


def test_bench_flow() -> None:
    """An engine that was brought is measured beside ours, one that computes another flow gets no time."""
    from ninedisk.core import packings
    from ninedisk.harness.api.registry import get_engine

    scene = flow.without_contacts(packings.drum(12, turns_per_second=0.0))
    problem = FlowProblem(name="fall-12", scene=scene, steps=8)
    engines = {"cd": get_engine("cd")} | {
        each.id: each for each in (CommandEngine(command(SPRINGS)[1]), CommandEngine(command(BAD, "good")[1]))
    }
    chosen = [
        each
        for each in flow.entries(lambda _: False, ["spring-dem", "bad"])
        if each.name in (flow.BASE, "spring-dem", "bad")
    ]
    (rows,) = flow.run_problem(lambda: problem, chosen, engines, repeats=1, time_limit=60.0, notify=lambda _: None)
    ours, springs, bad = rows
    assert (ours["status"], springs["status"], bad["status"]) == ("pass", "pass", "unsupported"), rows
    assert springs["median_s"] > 0.0
    assert "gravity" in bad["reason"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["check-engine"], "give one engine: its id, or --engine-cmd COMMAND"),
        (["check-engine", "dem", *command(BAD, "good")], "give one engine"),
        (["check-engine", *command(BAD, "about-exit")], "no licence found"),
        (["converge", "binary-collision", "-e", "dem", *command(BAD, "good")], "exclude each other"),
        (["bench", "harness", *command(BAD, "good")], "--engine-cmd is for the suite flow"),
        (["bench", "flow", *command(BAD, "about-taken")], "calls itself 'dem', and so does a known engine"),
    ],
)
def test_wrong_usage(arguments: list[str], said: str) -> None:
    done = ninedisk(*arguments)
    assert done.exit_code == 2, done.output
    assert said in done.output
