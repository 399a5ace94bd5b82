"""The nine disks: times, and errors against the limit of the case's converged table; other physics gets no time."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import chain
from typing import Any

import numpy as np
import pytest

from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.engine import EngineRun
from ninedisk.harness.api.registry import get_engine
from ninedisk.harness.bench import nine_disks
from ninedisk.harness.bench.nine_disks import CASE, DIVISIONS, Limit, parameters
from ninedisk.harness.cases.matched import with_slip_at
from ninedisk.harness.results.schema import Row
from ninedisk.references.converged_tables import load_converged

pytestmark = pytest.mark.xdist_group("nine-disks")  # they share the limit
limit = nine_disks.limit_of
NEEDS_YADE = pytest.mark.skipif(not get_engine("yade").info().installed, reason="YADE is not installed")


@cache
def limit_of(arm: str) -> Limit:
    """The limit for all `DIVISIONS`, whichever a test has left of them."""
    with pytest.MonkeyPatch.context() as whole:
        whole.setattr(nine_disks, "DIVISIONS", DIVISIONS)
        return limit(arm)


@pytest.fixture(autouse=True)
def one_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nine_disks, "limit_of", limit_of)


def run(engines: dict[str, Any]) -> dict[tuple[str, int], Row]:
    (rows,) = nine_disks.run_accuracy("overlap", engines, repeats=1, time_limit=60.0, notify=lambda _: None)
    return {(row["engine"], row["steps"]): row for row in rows}


class Wrong:
    """The core under another name, given another friction between the disks."""

    def __init__(self, factor: float) -> None:
        self.factor, self.core = factor, get_engine("dem")
        self.info, self.supports = self.core.info, self.core.supports

    def run(self, scene: Any, numerics: Any, watch: Any) -> EngineRun:
        law = replace(scene.disk_disk, mu=self.factor * scene.disk_disk.mu)
        return self.core.run(scene.replace(disk_disk=law), numerics, watch)


def test_the_limit_is_that_of_the_converged_table() -> None:
    """Table: 128 contact steps a cycle, with the difference from 64 as its uncertainty; here the limit that both point to."""
    limit, table = limit_of("overlap"), load_converged(CASE, parameters("overlap"))
    assert table is not None
    names = ("fn_up", "fn_right", "fs_up", "fs_right")
    for force, name in zip(limit.forces, names, strict=True):
        assert abs(force - table.quantities[name][-1]) <= table.uncertainty[name]
    assert limit.trust < 1e-8


def test_errors_fall_with_the_step_and_other_physics_is_not_timed() -> None:
    rows = run({"same": Wrong(1.0), "other": Wrong(1.01)})
    own = [rows["dem", 5500 * k] for k in DIVISIONS]
    assert [row["status"] for row in own] == ["pass"] * 3
    for k in DIVISIONS:
        same, other = rows["same", 5500 * k], rows["other", 5500 * k]
        assert same["status"] == "pass"
        assert same["check_value"] == rows["dem", 5500 * k]["check_value"]
        assert same["ratio"] > 0.0
        assert math.isfinite(same["rate"])
        assert (other["status"], math.isnan(other["median_s"])) == ("fail", True)


def test_orders_are_those_of_where_slip_is_measured() -> None:
    """Both places have one limit.

    Whichever part of a step contacts begin to slip in, it makes another factor on ``k^-2``, up to 4 here: 0.5 of the order over 4 halvings.
    """
    limit, dem = limit_of("overlap"), get_engine("dem")
    end = [limit.error(nine_disks._forces(dem, "overlap", k, "end")[0]) for k in (1, 2, 4, 8, 16)]
    assert -np.diff(np.log2(end)) == pytest.approx([1.0] * 4, abs=0.1)
    coarse, fine = (limit.error(nine_disks._forces(dem, "overlap", k)[0]) for k in (1, 16))
    assert np.log2(coarse / fine) / 4.0 == pytest.approx(2.0, abs=0.5)


def test_errors_of_the_end_are_too_large_for_the_middle(monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine that claims slip of the middle and has that of the end gets no time; one that says what it does has one."""
    core = get_engine("dem")

    class Ends(Wrong):
        def run(self, scene: Any, numerics: Any, watch: Any) -> EngineRun:
            return self.core.run(with_slip_at(scene, "end"), numerics, watch)

    monkeypatch.setattr(nine_disks, "DIVISIONS", (4,))
    claims, says = Ends(1.0), Ends(1.0)
    without = replace(core.info(), capabilities=core.info().capabilities - {Capability.SLIP_MIDDLE})
    says.info = lambda: without
    rows = run({"claims": claims, "says": says})
    assert rows["claims", 22000]["status"] == "fail"
    assert rows["says", 22000]["status"] == "pass"


@NEEDS_YADE
def test_an_external_engine_has_the_error_of_its_scheme(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nine_disks, "DIVISIONS", (1,))
    row = run({"yade": get_engine("yade")})["yade", 5500]
    assert row["status"] == "pass", row["reason"]
    assert row["check_value"] > 0.1 * row["check_bound"]
    assert row["ratio"] > 1.0


def test_no_number_is_no_small_error() -> None:
    limit = Limit(np.array([1.0, 0.0, 0.0, 0.0]), 1.0, 1e-5, {})
    assert limit.error(np.array([1.0, np.nan, 0.0, 0.0])) == math.inf
    assert limit.error(np.array([1.0, 1e-3, 0.0, 0.0])) == pytest.approx(1e-3)


def test_nine_disks_are_timed_on_the_core() -> None:
    rows = list(chain.from_iterable(nine_disks.run("overlap", {}, repeats=1, time_limit=60.0, notify=lambda _: None)))
    assert {row["status"] for row in rows} == {"pass"}, [row["reason"] for row in rows]
    names = [(row["problem"], row["engine"]) for row in rows]
    assert ("nine-disks-overlap", nine_disks.ALONE) in names
    assert ("nine-disks-overlap, last state only", "dem") in names
    by_name = dict(zip(names, rows, strict=True))
    assert (
        by_name["nine-disks-overlap", nine_disks.ALONE]["median_s"] > by_name["nine-disks-overlap", "dem"]["median_s"]
    )


@NEEDS_YADE
def test_nine_disks_with_other_walls_are_not_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = get_engine("yade")
    params = nine_disks.parameters("overlap")
    right = engine.run

    def other(scene: Any, numerics: Any, watch: Any) -> Any:
        return right(scene.replace(xi=1.01 * scene.xi), numerics, watch)

    monkeypatch.setattr(engine, "run", other)
    with pytest.raises(Exception, match="not timed"):
        nine_disks._run_last(engine, params, 60.0)
