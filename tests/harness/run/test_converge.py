"""Orders of convergence: the rule on made-up errors, the engines' own orders, and defects that must be found."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ninedisk.core.history import Pair
from ninedisk.core.law import SlipAt
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene
from ninedisk.harness.api.capabilities import SLIP_AT
from ninedisk.harness.api.engine import EngineInfo, EngineRun
from ninedisk.harness.api.errors import UsageError
from ninedisk.harness.cases.matched import with_slip_at
from ninedisk.harness.cli.app import app
from ninedisk.harness.engines.cd.adapter import CdEngine
from ninedisk.harness.engines.dem.adapter import DemEngine
from ninedisk.harness.results.statuses import VERDICTS
from ninedisk.harness.run.converge import ObservedOrder, converge, judge_order

SMALL = {"settle_cycles": 0, "cycles": 60}
HISTORIES = ("fn_disk_disk_centre", "fn_disk_disk_edge", "fn_wall_mid", "fn_wall_corner")


def judged(
    errors: Sequence[float], *, expected: float | None = 2.0, floor: float = 1e-12, tolerance: float = math.inf
) -> ObservedOrder:
    """Verdict on signed errors of a quantity whose truth is zero."""
    differences = [abs(a - b) for a, b in pairwise(errors)]
    return judge_order([abs(e) for e in errors], differences, floor=floor, expected=expected, tolerance=tolerance)


def powers(order: float, *, levels: int = 6, more: float = 0.0, offset: float = 0.0) -> list[float]:
    return [offset + 2.0 ** (-order * k) + more * 2.0 ** (-(order + 1.0) * k) for k in range(levels)]


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0, 3.0])
def test_a_clean_order_is_found(order: float) -> None:
    found = judged(powers(order), expected=order)
    assert found.verdict == "converges"
    assert found.order == pytest.approx(order, abs=1e-12)
    assert found.uncertainty < 1e-12


def test_an_order_too_low_is_wrong_and_one_too_high_is_not() -> None:
    assert judged(powers(1.0), expected=2.0).verdict == "wrong order"
    assert judged(powers(1.5), expected=2.0).verdict == "wrong order"
    assert judged(powers(2.0), expected=1.0).verdict == "converges"
    assert judged([1.0] * 6, expected=1.0, tolerance=2.0).verdict == "step-independent"


def test_a_scheme_that_does_not_converge_is_wrong() -> None:
    assert judged([1.0, -1.0, 1.0, -1.0, 1.0, -1.0], expected=1.0).verdict == "wrong order"


def test_coarse_levels_before_the_asymptotic_range_are_left_out() -> None:
    found = judged(powers(1.0, more=-0.9), expected=1.0)
    assert found.verdict == "converges"
    assert found.used[0] > 0
    assert found.order - found.uncertainty < 1.0 < found.order + found.uncertainty


def test_levels_below_round_off_are_left_out() -> None:
    errors = [1e-8 * 4.0**-k + 3e-12 * (-1) ** k for k in range(9)]
    found = judged(errors, floor=1e-11)
    assert found.used == (0, 1, 2, 3, 4)
    assert found.verdict == "converges"
    assert judged([1e-13, -2e-13, 1e-13, 3e-13]).verdict == "exact"


def test_another_limit_than_the_truths_is_reported_and_held_against_the_tolerance() -> None:
    inside = judged(powers(2.0, offset=3.0), tolerance=4.0)
    assert (inside.verdict, inside.by) == ("converges", "difference")
    assert "levels off" in inside.reason
    assert judged(powers(2.0, offset=3.0), tolerance=2.0).verdict == "wrong limit"
    assert judged([3.0] * 6, tolerance=2.0).verdict == "wrong limit"


def test_noise_is_undecided() -> None:
    assert judged([1.0, 0.1, 0.12, 0.01, 0.02, 0.001], expected=1.0).verdict == "undecided"
    assert judged([1.0, 0.25, math.nan, 0.01]).verdict == "undecided"
    assert judged([1.0, 0.25, 1e-14, 1e-14, 1e-14]).verdict == "undecided"  # two levels make no order


def test_the_core_dem_is_of_second_order() -> None:
    rows = {row["quantity"]: row for row in converge("nine-disk/compression", params=SMALL)["rows"]}
    for name in HISTORIES:
        assert rows[name]["verdict"] == "converges"
        assert rows[name]["truth"] == "analytic"
        assert rows[name]["order"] == pytest.approx(2.0, abs=0.05)  # (omega dt)^2 = 0.018 at the coarsest level
    assert {row["verdict"] for row in rows.values()} <= {"converges", "exact", "not judged"}


def test_contact_dynamics_is_of_first_order() -> None:
    told: list[str] = []
    params = {"sliding": "coulomb", "dt": 0.02}
    record = converge("incline-block", engine="cd", params=params, halvings=4, progress=lambda *at: told.append(at[2]))
    assert ["left" in label for label in told] == [False, True, True, True, True, False], (
        "an estimate from the first level on"
    )
    rows = {row["quantity"]: row for row in record["rows"]}
    assert (record["step"], record["expected"]) == ("dt", 1.0)
    assert rows["x"]["order"] == pytest.approx(1.0, abs=1e-6)  # the error is exactly a t dt/2
    assert rows["x"]["errors"][0] == pytest.approx(16.0 * rows["x"]["errors"][-1], rel=1e-6)
    assert rows["vx"]["verdict"] == "exact"


def test_friction_leaves_the_core_dem_of_second_order_where_slip_is_that_of_mid_step() -> None:
    orders = {}
    for slip_at in ("middle", "end"):
        record = converge("contact/retraced-loop", params={"slip_at": slip_at}, halvings=4)
        rows = {row["quantity"]: row for row in record["rows"]}
        orders[slip_at] = record["expected"], rows["shear"]["order"], rows["astray"]["order"]
        assert "wrong order" not in {row["verdict"] for row in record["rows"]}
    assert orders["middle"] == pytest.approx((2.0, 2.0, 2.0), abs=0.1)
    # A cycle's swing is of second order still, what it leaves of first.
    assert (orders["end"][0], orders["end"][2]) == pytest.approx((1.0, 1.0), abs=0.1)
    assert orders["end"][1] < 1.7


@pytest.mark.parametrize(("lacking", "has", "order"), [("middle", "end", 1.0), ("end", "middle", 2.0)])
def test_the_order_is_that_of_the_slip_that_an_engine_can_measure(lacking: SlipAt, has: SlipAt, order: float) -> None:
    class One(DemEngine):
        def info(self) -> EngineInfo:
            return replace(super().info(), capabilities=super().info().capabilities - {SLIP_AT[lacking]})

        def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair] = ()) -> EngineRun:
            return super().run(with_slip_at(scene, has), numerics, watch)

    record = converge("contact/retraced-loop", engine=One(), params={"slip_at": lacking}, halvings=3)
    assert record["expected"] == order
    assert "wrong order" not in {row["verdict"] for row in record["rows"]}


def test_no_more_than_first_order_is_asked_where_contacts_begin_to_slip() -> None:
    record = converge("nine-disk/distortion", halvings=4)
    assert record["expected"] == 1.0
    rows = {row["quantity"]: row for row in record["rows"]}
    assert {rows[name]["verdict"] for name in ("fn_right", "fs_right", "fs_up")} == {"converges"}


def test_the_step_of_increments_is_compared_at_the_same_displacement() -> None:
    rows = {row["quantity"]: row for row in converge("sliding/quasistatic", engine="cd", halvings=3)["rows"]}
    assert rows["x"]["verdict"] == "exact"
    assert rows["gap"]["order"] == pytest.approx(1.0, abs=1e-6)  # lift = mu times the increment


class Lagging(DemEngine):
    """Says central differences with central damping, and damps by the velocity of half a step before."""

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        return super().run(scene, numerics.replace(damping_form="lagged"), watch)


class Stiffer(DemEngine):
    """Solves another problem: kn is a thousandth too large."""

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        law = replace(scene.disk_disk, kn=1.001 * scene.disk_disk.kn)
        walls = tuple(replace(wall, law=replace(wall.law, kn=1.001 * wall.law.kn)) for wall in scene.walls)
        return super().run(replace(scene, disk_disk=law, walls=walls), numerics, watch)


class Stuck(CdEngine):
    """Takes the coarsest step whatever it is given: an error that does not shrink."""

    def run(self, scene: Scene, numerics: Numerics, watch: Sequence[Pair]) -> EngineRun:
        finer = round(0.02 / numerics.dt)
        coarse = super().run(scene, numerics.replace(dt=0.02, n_steps=numerics.n_steps // finer), watch).history
        whole = super().run(scene, numerics, watch)
        whole.history.x[::finer] = coarse.x
        return whole


@pytest.mark.parametrize(("engine", "verdict"), [(Lagging(), "wrong order"), (Stiffer(), "wrong limit")])
def test_planted_defects_of_a_second_order_engine_are_found(engine: DemEngine, verdict: str) -> None:
    rows = {row["quantity"]: row for row in converge("nine-disk/compression", engine=engine, params=SMALL)["rows"]}
    assert {rows[name]["verdict"] for name in HISTORIES} == {verdict}


def test_an_error_that_does_not_shrink_with_the_step_is_found() -> None:
    params = {"sliding": "coulomb", "dt": 0.02}
    rows = {r["quantity"]: r for r in converge("incline-block", engine=Stuck(), params=params, halvings=3)["rows"]}
    assert rows["x"]["verdict"] == "wrong limit"  # the finest level's tolerance is a sixteenth of the error


def test_what_cannot_be_refined_is_refused() -> None:
    with pytest.raises(UsageError, match="halvings = 2"):
        converge("nine-disk/compression", halvings=2)
    with pytest.raises(UsageError, match="no step that could be halved"):
        converge("nine-disk/compression", engine="pymunk")


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["converge", *arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    return result.exit_code, result.output


def test_command_writes_table_json_and_a_page_without_network(tmp_path: Path) -> None:
    record, page = tmp_path / "orders.json", tmp_path / "orders.html"
    code, output = run("incline-block", "-e", "pymunk", "--halvings", "3", "--json", str(record), "--html", str(page))
    assert code == 0, output
    assert re.search(r"converges +x +m +analytic +error .* 1\.00 ± ", output)
    rows = {row["quantity"]: row for row in json.loads(record.read_text())["rows"]}
    assert rows["x"]["order"] == pytest.approx(1.0, abs=1e-6)
    html = page.read_text()
    for word, meaning in VERDICTS["converge"].items():
        assert f"<dt>{word}</dt><dd>{meaning}" in html.replace("&#39;", "'")
    assert '<figure class="chart"' in html
    assert not re.search(r"(?:src|href)=\"(?!data:|#)", html)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["orders.html", "orders.json"]


def test_command_fails_where_an_order_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ninedisk.harness.engines.dem.adapter.ENGINE", Lagging())
    code, output = run("nine-disk/compression", "--set", "settle_cycles=0", "--set", "cycles=60", "--halvings", "3")
    assert code == 1, output
    assert "wrong order" in output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("no-such-case",), "there is no case 'no-such-case'"),
        (("incline-block", "-e", "nobody"), "there is no engine 'nobody'"),
        (("incline-block", "--halvings", "1"), "halvings = 1 is not allowed: use 3 to 12"),
        (("incline-block", "--set", "dt=-1"), "dt = -1 is not allowed"),
        (("incline-block", "--set", "colour=red"), "no parameter 'colour'"),
        (("incline-block", "--json", "."), "--json '.' is a folder"),
        (("nine-disk/compression", "-e", "pymunk"), "no step that could be halved"),
    ],
)
def test_mistakes_are_named(arguments: tuple[str, ...], said: str) -> None:
    code, output = run(*arguments)
    assert code == 2
    assert said in output
    assert "Traceback" not in output
