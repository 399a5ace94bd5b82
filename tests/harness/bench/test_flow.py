"""The suite ``flow``: overlaps are measured as they are, other flows are not timed, what is not expressed is said."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ninedisk.core import packings
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Disks, Scene
from ninedisk.harness.api.engine import EngineInfo, EngineRun, Support
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.bench import flow
from ninedisk.harness.bench.flow import FlowProblem, relative_gaps, without_contacts
from ninedisk.harness.results.schema import Row


@pytest.fixture(scope="module")
def problem() -> FlowProblem:
    """Disks that fall against each other and the sides of a drum."""
    scene = packings.drum(40, turns_per_second=0.5)
    v = np.random.default_rng(1).normal(0.0, 3.0, (40, 2))
    disks = Disks(x=scene.disks.x, v=v, radius=scene.disks.radius, mass=scene.disks.mass)
    return FlowProblem(name="drum-40", scene=without_contacts(scene.replace(disks=disks)), steps=16)


def rows_of(problem: FlowProblem, chosen: list[flow.Entry], engines: dict[str, Any]) -> list[Row]:
    (rows,) = flow.run_problem(lambda: problem, chosen, engines, repeats=1, time_limit=60.0, notify=lambda _: None)
    return rows


class Drifting:
    """The DEM on a scene whose gravity is turned: other physics."""

    id = "dem"

    def info(self) -> EngineInfo:
        return get_engine("dem").info()

    def supports(self, scene: Scene, numerics: Numerics) -> Support:
        return get_engine("dem").supports(scene, numerics)

    def run(self, scene: Scene, numerics: Numerics, watch: tuple[Pair, ...]) -> EngineRun:
        return get_engine("dem").run(scene.replace(gravity=(500.0, 0.0)), numerics, watch)


def test_gaps_of_a_scene_in_closed_form() -> None:
    scene = packings.drum(3, sides=4)
    law = scene.disk_disk
    x = np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 5.0]])
    disks = Disks(x=x, radius=[1.0, 1.0, 0.1], mass=1.0)
    wall = scene.walls[0]
    turned = scene.replace(disks=disks, walls=(), disk_disk=law)
    assert relative_gaps(turned, x, 0.0) == pytest.approx([-0.25], abs=1e-15)
    near = np.array([[wall.point[0] - 0.5, 0.0], [-9.0, 0.0], [-9.0, -5.0]])
    walled = turned.replace(walls=(wall,), disks=Disks(x=near, radius=[1.0, 1.0, 0.1], mass=1.0))
    assert relative_gaps(walled, near, 0.0) == pytest.approx([-0.5], abs=1e-12)
    assert -relative_gaps(without_contacts(walled), near, 0.0).min(initial=0.0) == 0.0
    # A quarter of a turn later the wall stands above: the disk at its old place is far from it.
    quarter = 0.25 / (wall.motion[0].angular_velocity / (2.0 * math.pi))
    assert len(relative_gaps(walled, near, quarter)) == 0


def test_rows_of_ours_and_of_another_flow(problem: FlowProblem) -> None:
    chosen = [each for each in flow.entries(lambda _: False) if each.name in (flow.BASE, "dem, kn x 1")]
    engines = {"cd": get_engine("cd"), "dem": get_engine("dem")}
    rows = rows_of(problem, chosen, engines)
    ours, springs = rows
    assert [row["status"] for row in rows] == ["pass", "pass"]
    assert ours["penetration"] < 1e-5 < springs["penetration"], "springs overlap, rigid contacts hardly"
    assert 0.0 <= ours["natural_map"] <= flow.TOLERANCE
    assert ours["missed"] == 0
    assert ours["equal_ratio"] == ours["equal_friction_ratio"] == pytest.approx(1.0)
    assert 0.0 <= ours["friction_error"] < 1e-2
    assert math.isnan(springs["friction_error"]), "springs have no rigid law"
    assert math.isnan(springs["equal_friction_ratio"])
    assert springs["missed"] == -1
    assert ours["rate"] == pytest.approx(ours["median_s"] / problem.seconds)

    other = rows_of(problem, chosen, engines | {"dem": Drifting()})[1]
    assert other["status"] == "fail"
    assert not math.isfinite(other["median_s"])
    assert "another flow" in other["reason"]


def test_what_an_engine_lacks_is_said(problem: FlowProblem) -> None:
    chosen = [flow.entries(lambda _: False)[0]]
    chosen += [each for each in flow.entries(lambda name: name == "mujoco") if each.engine == "mujoco"]
    engines = {"cd": get_engine("cd"), "mujoco": get_engine("mujoco")}
    row = rows_of(problem, chosen, engines)[1]
    assert row["status"] in ("unsupported", "not-installed")
    assert row["reason"]


def test_energy_gained_in_closed_form(problem: FlowProblem) -> None:
    scene = problem.scene.replace(walls=())
    n, t = len(scene.disks), np.linspace(0.0, 1.0, 5)
    history = History.empty(range(5), t, n_disks=n, n_walls=0, pairs=(), force_meaning="step-mean", energies=())
    g = np.array(scene.gravity)
    history.x[:] = (0.5 * g * t[:, None] ** 2)[:, None]
    history.v[:] = (g * t[:, None])[:, None]
    history.omega[:] = 0.0
    assert abs(flow.energy_gained(history, scene)) < 1e-14, "free fall keeps its energy"
    history.v[3] *= 1.1
    gained = 0.5 * (1.1**2 - 1.0) * 0.75**2 / (0.5 * 1.0)
    assert flow.energy_gained(history, scene) == pytest.approx(gained, rel=1e-12)
    assert math.isnan(flow.energy_gained(history, problem.scene)), "the drum's sides work, and nobody tells how much"


@pytest.mark.parametrize(
    ("size", "expected"), [(1e-3, 5.0 / 4.0), (1e-2, 5.0 / 2.0), (1e-1, 5.0 / 1.0), (1.0, 5.0), (1e-5, math.nan)]
)
def test_ratio_at_equal_error_in_closed_form(size: float, expected: float) -> None:
    ladder = [
        {"friction_error": 1e-3, "median_s": 4.0},
        {"friction_error": 1e-1, "median_s": 1.0},
        {"friction_error": 1e-9, "median_s": math.nan},
        {"friction_error": math.nan, "median_s": 2.0},
    ]
    row = {"friction_error": size, "median_s": 5.0}
    assert flow.time_at_equal("friction_error", row, ladder, 1e-8) == pytest.approx(expected, rel=1e-12, nan_ok=True)
    assert math.isnan(flow.time_at_equal("friction_error", row | {"median_s": math.nan}, ladder, 1e-8))
    assert math.isnan(flow.time_at_equal("friction_error", row | {"friction_error": math.nan}, ladder, 1e-8))


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-4])
def test_errors_that_cannot_be_distinguished_from_none_meet_the_fastest_rung_without_any(size: float) -> None:
    ladder = [{"penetration": error, "median_s": each} for error, each in ((0.0, 9.0), (1e-5, 3.0), (1e-2, 1.0))]
    row = {"penetration": size, "median_s": 6.0}
    assert flow.time_at_equal("penetration", row, ladder, 1e-4) == pytest.approx(2.0)
