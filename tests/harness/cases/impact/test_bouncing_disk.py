"""Bouncing disk: verdicts on engines, order of the errors, defects that must be seen."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.impact.bouncing import CASE
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK


@pytest.mark.parametrize(
    "params", [{"restitution": 0.8, "height": 0.3}, {"restitution": 0.3, "bounces": 2}, {"restitution": 0.95, "g": 5.0}]
)
def test_other_drops_pass(run_cell, params):
    for engine in (PYMUNK, DEM):
        assert run_cell(CASE, engine, params).failures == []
    for impact in ("theta", "newton"):
        assert run_cell(CASE, CD, {**params, "impact": impact, "dt": 8e-3}).failures == []


def errors(run_cell, engine, names, steps, heights):
    """Mean errors of numbers over drops from several heights, for each step."""
    means = []
    for step in steps:
        found = []
        for height in heights:
            cell = run_cell(CASE, engine, {"height": height, **step})
            assert cell.failures == []
            expected = {c.quantity: c.expected for c in cell.checks}
            found.append([abs(cell.observed.scalars[name][1] - expected[name]) for name in names])
        means.append(np.mean(found, axis=0))
    return means


HEIGHTS = 0.4 + np.array([0.0, 0.0077, 0.0151, 0.0239, 0.0331, 0.0423])


@pytest.mark.long
def test_rigid_bounces_are_first_order(run_cell):
    means = errors(run_cell, PYMUNK, ["apex_time_2", "apex_2"], [{"dt": 2e-3}, {"dt": 5e-4}], HEIGHTS)
    orders = np.log2(means[0] / means[1]) / 2.0
    assert ((orders > 0.7) & (orders < 1.4)).all(), orders


def test_damped_springs_are_first_order_and_elastic_ones_second(run_cell):
    for e, low, high in ((0.5, 0.6, 1.4), (1.0, 1.4, 2.5)):
        steps = [{"restitution": e, "contact_dt": dt, "bounces": 1} for dt in (2e-4, 2.5e-5)]
        means = errors(run_cell, DEM, ["apex_1"], steps, np.linspace(0.4, 0.45, 12))
        assert low < np.log2(means[0] / means[1]) / 3.0 < high


def test_contact_dynamics_is_followed_until_rounding_has_grown(run_cell):
    params = {"restitution": 1.0}
    cell = run_cell(CASE, CD, params)
    spoken = {c.quantity: np.isfinite(c.expected).mean() for c in cell.checks}
    assert all(0.4 < part < 0.9 for part in spoken.values())
    late = run_cell(CASE, CD, params, lambda h: h.v[160:].__imul__(1 + 1e-6))
    assert "vy" in late.seen


def test_wrong_laws_are_seen(run_cell):
    assert {"apex_1", "apex_time_2", "gap"} <= run_cell(CASE, PYMUNK, {"dt": 1e-3}, law={"restitution": 0.53}).seen
    pulled = run_cell(CASE, PYMUNK, {"dt": 5e-4}, scene=lambda scene: scene.replace(gravity=(0.0, -9.81)))
    assert {"apex_time_1", "energy"} <= pulled.seen
    gains = run_cell(CASE, PYMUNK, {"restitution": 1.0, "dt": 5e-4}, law={"restitution": 0.99})
    assert {"apex_1", "apex_3", "energy"} <= gains.seen


@pytest.mark.parametrize(
    ("spoil", "quantities"),
    [
        (lambda h: h.gap.__iadd__(0.05), {"gap_final", "apex_1", "gap"}),
        (lambda h: h.v.__imul__(1.4), {"vy", "energy"}),
        (lambda h: h.gap.__setitem__((-1, 0), np.nan), {"gap_final", "rest_time"}),
        (lambda h: h.v.__setitem__((..., 1), -1.0), {"apex_1", "apex_time_3", "vy"}),
    ],
    ids=["gap", "speed", "missing", "no-flight"],
)
def test_defects_are_seen(run_cell, spoil, quantities):
    assert quantities <= run_cell(CASE, PYMUNK, {}, spoil).seen


@pytest.mark.parametrize(("kept", "fails"), [(1.0, False), (0.973, True)])
def test_height_that_an_elastic_disk_loses_at_each_bounce_is_seen(run_cell, kept, fails):
    """2.7 % of it: a step's own gravity may take 1.3 % of the height from a bounce."""
    cell = run_cell(CASE, PYMUNK, {"restitution": 1.0}, law={"restitution": kept**0.5})
    assert ("height_lost" in cell.seen) == fails


def test_an_exact_drop_sees_a_defect_of_the_dem(run_cell):
    def higher(history):
        history.gap[history.t > 0.32] *= 1.01

    cell = run_cell(CASE, DEM, {"restitution": 1.0}, higher)
    assert {"apex_1", "gap"} <= cell.seen


def test_impossible_variants_are_refused():
    with pytest.raises(ParameterError, match="kn = 20 N/m"):
        CASE.build(resolve(CASE, {"kn": 20}).params)
    with pytest.raises(ParameterError, match="duration"):
        CASE.build(resolve(CASE, {"duration": 0.2}).params)
