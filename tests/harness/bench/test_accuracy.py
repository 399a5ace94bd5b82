"""Accuracy against cost: the limit is the case's converged table, errors fall with the step, other physics gets no time."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.harness.bench import accuracy
from ninedisk.harness.bench.accuracy import DIVISIONS, Limit, limit_of
from ninedisk.harness.bench.nine_disks import CASE, parameters
from ninedisk.harness.engine import EngineRun
from ninedisk.harness.registry import get_engine
from ninedisk.harness.results import Row
from ninedisk.references.converged_tables import load_converged


def run(engines: dict[str, Any]) -> dict[tuple[str, int], Row]:
    (rows,) = accuracy.run(["overlap"], engines, repeats=1, time_limit=60.0, tell=lambda *_: None)
    return {(row["engine"], row["steps"]): row for row in rows}


class Wrong:
    """The core under another name, told another friction between the disks."""

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
    assert limit.constant / accuracy.FINER < 1e-6


def test_errors_fall_with_the_step_and_other_physics_is_not_timed() -> None:
    rows = run({"same": Wrong(1.0), "other": Wrong(1.01)})
    own = [rows["dem", 5500 * k] for k in DIVISIONS]
    assert [row["status"] for row in own] == ["pass"] * 3
    errors = np.array([row["check_value"] for row in own])
    orders = -np.diff(np.log2(errors))
    assert (orders > 0.8).all(), "friction leaves the scheme the first order"
    assert (orders < 1.3).all()
    for k in DIVISIONS:
        same, other = rows["same", 5500 * k], rows["other", 5500 * k]
        assert same["status"] == "pass"
        assert same["check_value"] == rows["dem", 5500 * k]["check_value"]
        assert same["ratio"] > 0.0
        assert math.isfinite(same["rate"])
        assert (other["status"], math.isnan(other["median_s"])) == ("fail", True)


@pytest.mark.skipif(not get_engine("yade").info().installed, reason="YADE is not installed")
def test_an_external_engine_has_the_error_of_its_scheme(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accuracy, "DIVISIONS", (1,))
    row = run({"yade": get_engine("yade")})["yade", 5500]
    assert row["status"] == "pass", row["reason"]
    assert row["check_value"] > 0.1 * row["check_bound"]
    assert row["ratio"] > 1.0


def test_no_number_is_no_small_error() -> None:
    limit = Limit(np.array([1.0, 0.0, 0.0, 0.0]), 1.0, 1e-5)
    assert limit.error(np.array([1.0, np.nan, 0.0, 0.0])) == math.inf
    assert limit.error(np.array([1.0, 1e-3, 0.0, 0.0])) == pytest.approx(1e-3)
