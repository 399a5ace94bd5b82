"""Cooling gas: a restitution that is off, energy that is fed and a wrong rate must be seen, whatever becomes of the motion."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case
from ninedisk.harness.cases.impact.cooling import CASE, _wall_energy, haffs_law, law_at_end
from ninedisk.harness.cases.impact.gas import MASS, RADIUS
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.harness.selftest.setups import with_disks

FEW = {"rows": 5, "duration": 4.0}


@pytest.mark.parametrize("engine", [PYMUNK, CD], ids=lambda engine: engine.id)
def test_a_restitution_that_is_off_is_seen_in_each_collision(run_cell, engine):
    assert "loss" in run_cell(CASE, engine, FEW, law={"restitution": 0.7001}).seen


def test_walls_that_take_energy_too_are_seen_where_springs_have_dashpots(run_cell):
    """All contacts of the dashpot of e = 0.5, walls too: the loss of a pair, and the whole gas."""
    assert {"loss", "cooling", "ln_temperature"} <= run_cell(CASE, DEM, {"rows": 8}, law={"beta": 0.6}).seen


def test_energy_that_is_fed_is_seen(run_cell):
    def feed(history):
        history.v[200:] *= 1.001

    for engine, name in ((PYMUNK, "kinetic_rise"), (DEM, "energy_rise")):
        found = run_cell(CASE, engine, FEW, feed).seen
        assert found == {name} or (engine is DEM and found <= {name})
    assert run_cell(CASE, DEM, FEW, lambda history: history.v[200:].__imul__(1.02)).seen >= {"energy_rise"}


def test_disks_of_another_size_move_otherwise_and_a_gas_that_does_not_cool_is_none(run_cell):
    def smaller(scene):
        return with_disks(scene, radius=0.7 * scene.disks.radius)

    assert "kinetic" in run_cell(CASE, PYMUNK, {"seed": 2, "duration": 2.0}, scene=smaller).seen
    assert {"ln_temperature", "cooling"} <= run_cell(CASE, PYMUNK, {"rows": 8}, law={"restitution": 1.0}).seen


def test_spheres_that_lose_more_or_feed_energy_are_seen(run_cell):
    case = get_case("spheres/cooling")
    assert {"loss", "ln_temperature", "cooling"} <= run_cell(case, DEM, {"duration": 4.0}, law={"beta": 0.6}).seen
    assert run_cell(case, DEM, {}, lambda history: history.v[100:].__imul__(1.02)).seen >= {"energy_rise"}


class Of:
    """A finished cell of the claim's rule."""

    def __init__(self, cell):
        self.params, self.setup, self.observed = cell.params, cell.setup, cell.observed


@pytest.mark.long
def test_the_law_is_confirmed_over_seeds_and_contradicted_by_a_gas_that_cools_otherwise(run_cell):
    right = [Of(run_cell(CASE, PYMUNK, {"seed": seed})) for seed in (1, 2)]
    holds, text = haffs_law(right)
    assert holds, text
    wrong = [Of(run_cell(CASE, PYMUNK, {"seed": seed}, law={"restitution": 0.9})) for seed in (1, 2)]
    assert not haffs_law(wrong)[0]


def test_the_start_is_that_of_the_seed_and_the_law_that_of_the_box():
    one, two = (CASE.build(resolve(CASE, {"seed": seed}).params) for seed in (1, 2))
    assert not np.array_equal(one.scene.disks.v, two.scene.disks.v)
    law = law_at_end(resolve(CASE, {}).params, one)
    assert law.elapsed == pytest.approx(8.0 / law.time)
    assert 0.9 < law.elapsed < 1.1
    with pytest.raises(ParameterError, match="not allowed"):
        CASE.build(resolve(CASE, {"kn": 1e3}).params)


@pytest.mark.parametrize(("gap_of_wall", "fed"), [(0.0, 1.0), (1.0, 0.0)])
def test_what_newtons_law_feeds_at_a_wall_is_no_fault_and_away_from_walls_it_is(gap_of_wall, fed):
    """Two disks in contact in x, one of which touches the left wall or not; a third one, far off, feeds too and is not excused."""
    x = np.array([[RADIUS + gap_of_wall, 10.0], [3.0 * RADIUS + gap_of_wall, 10.0], [20.0, 20.0]])
    v = np.array([[[-1.0, 0.0], [-2.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [2.5, 0.0], [1.5, 0.0]]])
    history = SimpleNamespace(x=np.stack([x, x]), v=v, t=np.array([0.0, 0.01]))
    params = {"rows": 8, "spacing": 5.6}
    assert _wall_energy(params, history) == pytest.approx([0.0, fed * 0.5 * MASS * (2.5**2 - 2.0**2)])
