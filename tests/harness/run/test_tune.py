"""What to change in an engine for an accuracy: the choice on made-up numbers, the search, the command on an engine with a closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.knobs import Knob
from ninedisk.harness.cli.app import app
from ninedisk.harness.run.runner import run_case
from ninedisk.harness.run.tune import STUDY, Point, Search, Setting, cheapest, tune

NAN = math.nan


def points(*rows: tuple[int, dict[str, Any], float, float]) -> dict[Setting, Point]:
    """Points of (halvings, changed, error, seconds)."""
    found = {}
    for halvings, changed, error, seconds in rows:
        setting = Setting(halvings, tuple(changed.items()))
        found[setting] = Point(setting=setting, step=1.0 / 2**halvings, error=error, seconds=seconds)
    return found


SWEEPS = {"sweeps": 100}


@pytest.mark.parametrize(
    ("rows", "chosen"),
    [
        ([(0, {}, 0.5, 1.0), (1, {}, 0.4, 2.0)], None),  # none reaches
        ([(0, {}, 0.001, 1.0), (1, {}, 0.0005, 2.0)], (0, {})),  # all reach: the engine's own
        ([(0, {}, NAN, NAN), (1, {}, NAN, NAN)], None),  # crashes and no numbers
        ([(0, {}, 0.5, 1.0), (1, {}, 0.0099, 2.0)], (1, {})),
        ([(0, {}, 0.01004, 1.0), (1, {}, 0.005, 2.0)], (0, {})),  # what is shown as 1 %
        ([(0, {}, 0.001, 1.0), (1, {}, 0.3, 2.0)], None),  # the truth is crossed by chance
        ([(0, {}, 0.001, 1.0), (1, {}, NAN, NAN)], (0, {})),  # half the step crashes: no word against it
        ([(0, {}, 0.001, 1.0)], None),  # half the step was not measured
        ([(0, SWEEPS, 0.001, 9.0), (1, SWEEPS, 0.001, 18.0), (1, {}, 0.002, 2.0)], (1, {})),  # the cheaper
        ([(0, SWEEPS, 0.001, 1.1), (1, SWEEPS, 0.001, 2.0), (1, {}, 0.002, 2.0)], (0, SWEEPS)),
        # The same with a knob more is never the answer, whatever one run's clock says.
        ([(1, {}, 0.001, 5.0), (1, SWEEPS, 0.001, 0.5), (0, SWEEPS, 0.5, 0.3)], (1, {})),
        ([(1, {}, 0.001, NAN)], (1, {})),  # no time is known
    ],
)
def test_the_choice(rows: list[Any], chosen: Any) -> None:
    found = cheapest(points(*rows), 0.01, finest=1)
    assert (found and (found.setting.halvings, dict(found.setting.changed))) == chosen


class Made:
    """An engine with knobs and nothing else."""

    id = "made-stock"
    knobs = {  # noqa: RUF012
        "sweeps": Knob(default=10, low=1, why="", ladder=(30, 100), dear=True),
        "slop": Knob(default=0.1, why="", ladder=(0.01, 0.0)),
        "idle": Knob(default="on", choices=("on", "off"), why="", ladder=("off",)),
    }


def searched(monkeypatch: pytest.MonkeyPatch, error: Any, target: float = 0.01) -> tuple[Point | None, Search]:
    """The search on an engine of this error(step, sweeps, slop), whose steps take as long as it sweeps."""
    engine: Any = Made()
    search = Search(engine, lambda *_: None, [1.0 / 2**k for k in range(5)])  # type: ignore[arg-type, return-value]
    monkeypatch.setattr(Search, "run", lambda _self, setting: setting)

    def point(_self: Search, setting: Setting, step: float, _result: Any) -> Point:
        knobs = {"sweeps": 10, "slop": 0.1, **dict(setting.changed)}
        return Point(
            setting=setting,
            step=step,
            error=error(step, knobs["sweeps"], knobs["slop"]),
            seconds=knobs["sweeps"] / step,
        )

    monkeypatch.setattr(Search, "point", point)
    return search.search(target), search


def test_the_search_changes_what_it_takes_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    found, search = searched(
        monkeypatch, lambda step, sweeps, slop: 0.02 * step + slop + (0.005 if sweeps < 30 else 0.0)
    )
    assert found is not None
    # Slop 0 and a quarter of the step leave 0.5 % of each: with 30 sweeps half the step would do, at one and a half times the time.
    assert (found.setting.halvings, dict(found.setting.changed)) == (2, {"slop": 0.0})
    assert len(search.points) < 40


def test_a_knob_that_harms_beside_others_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    # At its best the slop makes bodies rattle; between, it helps.
    found, _ = searched(monkeypatch, lambda step, _sweeps, slop: 0.001 * step + {0.1: 0.1, 0.01: 0.005, 0.0: 0.3}[slop])
    assert found is not None
    assert dict(found.setting.changed) == {"slop": 0.01}


def test_no_setting_reaches(monkeypatch: pytest.MonkeyPatch) -> None:
    assert searched(monkeypatch, lambda *_: 0.5)[0] is None
    assert searched(monkeypatch, lambda *_: NAN)[0] is None


def test_pymunks_answer_is_that_of_its_scheme() -> None:
    pytest.importorskip("pymunk")
    # Positions lag by half a step's gain of speed per step: the way down an incline is short by dt/T, T = 1 s.
    record = tune("incline-block", engine="pymunk", headline="distance down the incline", targets=(0.01, 0.001))
    for point in record["points"]:
        assert point["error"] == pytest.approx(point["step"], rel=1e-6)
    assert [(each["reached"], each["step"], each["changed"]) for each in record["answers"]] == [
        (True, 0.01, {}),
        (True, 0.000625, {}),
    ]
    assert record["answers"][1]["times"] > 2.0
    assert record["tuned"]["error"] == pytest.approx(0.01)


def test_the_command(tmp_path: Path) -> None:
    pytest.importorskip("pymunk")
    out = tmp_path / "all.json"
    asked = ["tune", "incline-block", "-e", "pymunk", "--headline", "distance down the incline", "--halvings", "2"]
    found = CliRunner().invoke(app, [*asked, "--target", "0.01", "--json", str(out)])
    assert found.exit_code == 0, found.output
    assert "10 ms" in found.output
    assert json.loads(out.read_text())[0]["answers"][0]["step"] == 0.01
    missed = CliRunner().invoke(app, [*asked, "--target", "1e-4"])
    assert missed.exit_code == 1
    assert "no setting" in missed.output


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["incline-block", "-e", "dem"], "dem has no stock settings here"),
        (["incline-block", "-e", "pymunc"], "pymunk"),
        (["incline-block", "-e", "pymunk", "--target", "2"], "target = 2 is not allowed"),
        (["incline-block", "-e", "pymunk", "--halvings", "0"], "halvings = 0 is not allowed: use 1 to 10"),
        (["incline-block", "-e", "pymunk", "--headline", "speed"], "use one of 'distance down the incline'"),
        (["incline-block", "-e", "pymunk", "--set", "mu=-1"], "mu"),
        (["box/incline", "-e", "pymunk"], "it lacks"),
        ([], "give one case, or --all"),
        (["--all", "--set", "mu=1"], "drop --headline and --set"),
    ],
)
def test_mistakes_are_named(asked: list[str], said: str, tmp_path: Path) -> None:
    pytest.importorskip("pymunk")
    found = CliRunner().invoke(app, ["tune", *asked, "--store", str(tmp_path)])
    assert found.exit_code == 2
    assert said in found.output


@pytest.mark.parametrize(("case_id", "params", "headline"), STUDY)
def test_the_study_names_headlines_that_have_numbers(case_id: str, params: dict[str, Any], headline: str) -> None:
    rows = {row["headline"]: row for row in run_case(case_id, engine="cd", params={**params, "dt": 0.02}).headlines}
    assert math.isfinite(rows[headline]["rel_error"])


def test_an_unknown_engine_is_refused() -> None:
    with pytest.raises(UsageError):
        tune("incline-block", engine="nobody")
