"""Cells: every way in which an engine can behave is a status, and the user's mistakes are errors."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from ninedisk.core.errors import InvalidSceneError, UnstableTimeStepError
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness import run_case, run_matrix
from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.engine import EngineError, EngineInfo, EngineRun, Stopwatch, Timings
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.api.registry import UnknownIdError
from ninedisk.harness.engines.dem.adapter import DemEngine
from ninedisk.harness.results.schema import CELL_COLUMNS, MEASUREMENT_COLUMNS, SERIES_COLUMNS
from ninedisk.harness.run.isolation import run_isolated
from ninedisk.harness.run.plan import plan_case, plan_matrix
from ninedisk.harness.run.runner import Patience, run_cell
from ninedisk.harness.run.timing import reference_seconds, timing_columns
from ninedisk.harness.run.workers import run_cells

pytestmark = pytest.mark.usefixtures("fakes")


@pytest.mark.parametrize(
    ("behaviour", "status", "said"),
    [
        ("good", "pass", ""),
        (
            "wrong",
            "fail",
            "x (analytic): found +0.081, expected +0.08: error 0.001 m exceeds the tolerance 5e-10; first beyond it at step 4",
        ),
        ("nan", "fail", "NaN at 1 of 11 compared steps, first at step 3"),
        ("blind", "fail", "the engine does not observe this quantity"),
        ("infinite", "error", "infinite x at step 2"),
        ("garbage", "error", "x of shape (10, 1, 2) instead of (11, 1, 2)"),
        ("crash", "error", "segmentation fault"),
        ("bug", "error", "ZeroDivisionError at ninedisk_fakes.py"),
        ("leaving", "error", "SystemExit"),
        ("eternal", "error", "the engine answered timings.advance = 1e+300 s, and its whole run took"),
        ("timeout", "timeout", "stopped after 3 s"),
        ("uninstalled", "not-installed", "its library is gone"),
        ("absent", "not-installed", "it was never built; install it with: pip install fake"),
        ("incapable", "unsupported", "it lacks gravity; weightless"),
        ("shy", "error", "RuntimeError at ninedisk_fakes.py"),
    ],
)
def test_every_behaviour_is_a_status(behaviour: str, status: str, said: str) -> None:
    result = run_case("fake/fall", engine=f"fake-{behaviour}")
    assert result.status == status
    assert said in result.reason
    assert set(result.cell) == set(CELL_COLUMNS)
    assert result.rows
    assert all(set(row) == set(MEASUREMENT_COLUMNS) for row in result.rows)
    if status not in ("pass", "fail"):
        assert [row["status"] for row in result.rows] == [status]
        assert math.isnan(result.rows[0]["value"])
        assert result.rows[0]["quantity"] == ""


def test_a_cell_reports_what_was_asked_and_what_is_declared() -> None:
    """Springs that regularise a rigid contact ask for both ways to express it, of which an engine has one."""
    cell = run_case("binary-collision", engine="pymunk").cell
    asked, declared = set(json.loads(cell["asked"])), set(json.loads(cell["capabilities"]))
    assert {Capability.LINEAR_CONTACT, Capability.RESTITUTION} <= asked
    assert Capability.GRAVITY not in asked
    assert Capability.LINEAR_CONTACT not in declared
    assert {Capability.RESTITUTION, Capability.GRAVITY} <= declared


def test_the_last_lines_of_a_crash_are_kept() -> None:
    reason = run_case("fake/fall", engine="fake-crash").reason.splitlines()
    assert reason[-2:] == ["line 99", "segmentation fault"]
    assert len(reason) == 12


def test_time_counts_only_where_the_physics_is_right() -> None:
    assert run_case("fake/fall", engine="fake-good").cell["advance_s"] == 0.3
    assert math.isnan(run_case("fake/fall", engine="fake-wrong").cell["advance_s"])
    assert math.isnan(run_case("fake/fall", engine="fake-nan").cell["advance_s"])


class _Clocked:
    """Runs with the CPU seconds of a list, one after the other; None: it cannot decide, and an error where the list ends."""

    def __init__(self, cpu: list[float | None]) -> None:
        self.left = list(cpu)

    def __call__(self) -> EngineRun:
        steps = np.array([0])
        history = History.empty(steps, steps * 1.0, n_disks=1, n_walls=0, pairs=())
        if not self.left:
            raise EngineError("it ran out")
        return EngineRun(history=history, timings=Timings(setup=0.0, warm_up=0.0, advance=9.0, cpu=self.left.pop(0)))


@pytest.mark.parametrize(
    ("cpu", "took", "least", "repeats"),
    [
        ([8e-3, 7e-3, 6e-3, 9e-3, 8e-3, 1e-3], 1e-3, 6e-3, 5),  # never a sixth
        ([8e-3, 7e-3], 1e-3, 7e-3, 2),  # a repeat that fails ends them
        ([4e-3, 1e-3], 1e-3, 4e-3, 1),  # too short to be compared
        ([8e-3, 7e-3], 0.4, 8e-3, 1),  # too long to be repeated
        ([None], 1e-3, math.nan, 1),
    ],
)
def test_cpu_time_is_the_least_of_repeats(cpu: list[float | None], took: float, least: float, repeats: int) -> None:
    run = _Clocked(cpu)
    found = timing_columns(run, run().timings, took, reference_seconds())
    assert found["cpu_s"] == pytest.approx(least, nan_ok=True)
    assert (found["repeats"], found["cpu_of"]) == (repeats, "" if math.isnan(least) else "stepping")
    assert 1e-5 < found["reference_s"] < 1.0


def test_waiting_is_no_cpu_time() -> None:
    with Stopwatch() as watch:
        time.sleep(0.05)
    assert watch.wall >= 0.05 > 10.0 * watch.cpu
    command = [sys.executable, "-c", "import time; time.sleep(0.3); sum(range(3_000_000))"]
    finished = run_isolated(command)
    assert 0.02 < finished.cpu < finished.seconds - 0.25


class _Silent(DemEngine):
    """The in-house DEM as an engine that reports no contact forces, and of some quantity of motion no numbers either."""

    def __init__(self, quantity: str) -> None:
        self.quantity = quantity

    def info(self) -> EngineInfo:
        return replace(super().info(), contact_forces="none")

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        run = super().run(scene, numerics, watch)
        unseen = {name: getattr(run.history, name) * np.nan for name in ("fn", "fs", "wall_force", self.quantity)}
        return replace(run, history=replace(run.history, **unseen))


@pytest.mark.parametrize(
    ("quantity", "status"), [("fn", "not-observed"), *((each, "fail") for each in ("x", "v", "omega", "gap"))]
)
def test_an_engine_without_forces_owes_its_motion(quantity: str, status: str) -> None:
    found = run_cell(plan_case("incline-block", _Silent(quantity), {"mu": 0.36}))
    rows = found.measurements
    assert set(rows[rows.quantity == "fn"].status) == {status}


def test_result_of_a_cell() -> None:
    result = run_case("fake/fall", engine="fake-good", params={"a": "200 cm/s^2", "steps": 30})
    assert list(result.measurements.columns) == list(MEASUREMENT_COLUMNS)
    assert list(result.series.columns) == list(SERIES_COLUMNS)
    series = result.series.set_index(["quantity", "step"])
    assert series.loc[("x", 30), "value"] == pytest.approx(9.0)
    assert series.loc[("x", 30), "expected"] == pytest.approx(9.0)
    assert set(series.loc["x", "truth"]) == {"analytic"}
    assert np.isnan(series.loc["v", "expected"]).all()
    assert set(series.loc["v", "truth"]) == {""}
    assert result.cell["variant"] == "a=2,steps=30"
    assert result.params == {"a": 2.0, "dt": 0.1, "steps": 30, "truth": "plain"}
    frames = json.loads(result.cell["frames"])
    assert frames["step"][0] == 0
    assert frames["step"][-1] == 30
    assert len(frames["step"]) == 12
    assert frames["angle"][0] == [None]
    assert json.loads(result.cell["setup"])["scene"]["gravity"] == [2.0, 0.0]
    assert json.loads(result.cell["settings"]) == {"kind": "fake"}
    assert result.history is not None
    assert result.setup is not None


@pytest.mark.parametrize(
    ("truth", "status"), [("gap", "gap-closed"), ("nan", "no-truth"), ("none", "no-truth"), ("broken", "error")]
)
def test_truths_of_all_kinds(truth: str, status: str) -> None:
    assert run_case("fake/fall", engine="fake-good", params={"truth": truth}).status == status


def test_a_gap_stays_known() -> None:
    result = run_case("fake/fall", engine="fake-wrong", params={"truth": "gap"})
    assert (result.status, result.reason) == ("known-gap", "x (analytic): planted gap (and 1 more)")


def test_matrix() -> None:
    seen: list[tuple[int, int, str]] = []
    results = run_matrix(
        ["fake/fall", "fake/spin"], ["fake-good", "fake-crash", "fake-broken"], progress=lambda *at: seen.append(at)
    )
    cells = [(r.cell["case"], r.cell["variant"], r.cell["engine"], r.status) for r in results]
    assert cells[:3] == [
        ("fake/fall", "a=1", "fake-good", "pass"),
        ("fake/fall", "a=1", "fake-crash", "error"),
        ("fake/fall", "a=1", "fake-broken", "error"),
    ]
    assert len(cells) == 9
    assert cells[-3][3] == "pass"
    assert "cannot be loaded" in results[2].reason
    assert seen[0] == (0, 9, "fake/fall[a=1] on fake-good")
    assert seen[-1] == (9, 9, "")


def test_an_override_replaces_the_matrix_and_merges_equal_variants() -> None:
    results = run_matrix(["fake/fall"], ["fake-good"], {"a": "3"})
    assert [r.cell["variant"] for r in results] == ["a=3"]
    results = run_matrix(["fake/fall"], ["fake-good"], {"steps": "5"})
    assert [r.cell["variant"] for r in results] == ["a=1,steps=5", "a=2,steps=5"]


def test_an_override_that_some_case_lacks_is_refused() -> None:
    with pytest.raises(UsageError, match=r"'a' is unknown to fake/spin: .*\(fake/fall\)"):
        run_matrix(["fake/fall", "fake/spin"], ["fake-good"], {"a": 1})
    with pytest.raises(UsageError, match=r"none of the 2 cases \(fake/fall, fake/spin\) has a parameter 'b'"):
        run_matrix(["fake/fall", "fake/spin"], ["fake-good"], {"b": 1})
    with pytest.raises(ParameterError, match="no parameter 'aa'"):
        run_matrix(["fake/fall"], ["fake-good"], {"aa": 1})


def test_mistakes_of_the_user_are_errors() -> None:
    with pytest.raises(UnknownIdError):
        run_case("fake/fal", engine="fake-good")
    with pytest.raises(UnknownIdError):
        run_case("fake/fall", engine="fake-god")
    with pytest.raises(ParameterError, match=r"a = -1 is not allowed: it must be a number >= 0"):
        run_case("fake/fall", engine="fake-good", params={"a": -1})
    with pytest.raises(InvalidSceneError, match=r"fake/fall \[a=200\]: a = 200 is too much"):
        run_case("fake/fall", engine="fake-good", params={"a": 200})
    with pytest.raises(UnstableTimeStepError, match="exceeds the critical step"):
        run_case("fake/fall", engine="fake-unstable", params={"dt": 1.0})


def test_an_unstable_step_is_a_status_where_other_cells_run() -> None:
    results = run_matrix(["fake/fall"], ["fake-unstable", "fake-good"], {"dt": 1.0, "a": 1.0})
    assert [r.status for r in results] == ["error", "pass"]
    assert "dt = 1 s exceeds the critical step 0.5 s" in results[0].reason
    with pytest.raises(UnstableTimeStepError):
        run_matrix(["fake/fall"], ["fake-unstable"], {"dt": 1.0, "a": 1.0})


def test_a_defect_of_a_case_is_no_mistake_of_the_user(fakes: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    def build(*_: object) -> None:
        raise InvalidSceneError("the case is wrong")

    monkeypatch.setattr(fakes.FallingDisk, "build", build)
    result = run_case("fake/fall", engine="fake-good")
    assert (result.status, result.reason) == ("error", "the case cannot be built: the case is wrong")


def test_reference_curves_are_kept_once() -> None:
    from ninedisk.harness.results.tables import distinct_curves

    results = run_matrix(["fake/fall"], ["fake-good", "fake-wrong"], {"a": 1})
    assert [len(result.reference_curves) for result in results] == [1, 1]
    (kept,) = distinct_curves(results)
    assert (len(kept["step"]), kept["quantity"], kept["label"]) == (11, "x", "analytic: mechanics")


def test_an_engine_that_hangs_is_given_up(fakes: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """After three cells in a row; what it does not support is said as ever, and others go on."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fakes.FallingDisk, "matrix", lambda _: [{"a": a} for a in (1, 2, 3, 4, 5)])
    cells = plan_matrix(["fake/fall"], ["fake-timeout", "fake-good"], {})
    for jobs in (0, 1):
        results = run_cells(cells, jobs=jobs)
        late = [result for result in results if result.cell["engine"] == "fake-timeout"]
        assert [result.status for result in late] == ["timeout"] * 5
        assert [result.reason for result in late[:3]] == ["stopped after 3 s"] * 3
        for result, a in zip(late[3:], (4, 5), strict=True):
            assert (
                "not run: the engine was stopped at its time limit in 3 cells in a row (fake/fall[a=1]" in result.reason
            )
            assert result.reason.endswith(f"ninedisk run fake/fall --engine fake-timeout --set a={a}")
        assert {result.status for result in results} - {"timeout"} == {"pass"}


def test_an_engine_that_is_late_now_and_then_is_not_given_up() -> None:
    patience = Patience()
    (late,) = (run_cell(cell) for cell in plan_matrix(["fake/fall"], ["fake-timeout"], {"a": 1}))
    (good,) = (run_cell(cell) for cell in plan_matrix(["fake/fall"], ["fake-good"], {"a": 1}))
    (unable,) = (run_cell(cell) for cell in plan_matrix(["fake/fall"], ["fake-incapable"], {"a": 1}))
    (cell,) = plan_matrix(["fake/fall"], ["fake-timeout"], {"a": 1})
    for result in (late, late, good, late, unable, late):
        patience.record_outcome(cell, result)
        assert not patience.given_up(cell)
    patience.record_outcome(cell, late)
    assert patience.given_up(cell)
