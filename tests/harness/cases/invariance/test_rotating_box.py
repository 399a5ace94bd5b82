"""Sheared disk in a turning box: both lever arms, shear forces that stay behind are seen."""

from __future__ import annotations

import math

import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.invariance.rotating_box import CASE
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.lammps.adapter import ENGINE as LAMMPS
from ninedisk.harness.engines.yade.adapter import ENGINE as YADE


@pytest.mark.parametrize("params", CASE.matrix(), ids=lambda params: params["arm"])
def test_forces_turn_with_the_box(run_cell, params):
    for engine in (DEM, CD):
        cell = run_cell(CASE, engine, params)
        assert cell.failures == [], engine.id
        assert cell.history.wall_angle[-1, 0] == pytest.approx(math.pi, abs=1e-9)
    assert run_cell(CASE, DEM, params).margin("fs_top", "analytic") < 0.1


def test_the_chord_of_contact_dynamics_is_of_second_order(run_cell):
    spins = []
    for steps in (500, 1000):
        cell = run_cell(CASE, CD, {"steps": steps, "dt": 0.1 / steps})
        assert cell.failures == []
        spins.append(abs(cell.observed.series["spin"][1][-1] - 5.0 * math.pi))
    assert math.log2(spins[0] / spins[1]) == pytest.approx(2.0, abs=0.3)


@pytest.mark.skipif(not YADE.info().installed, reason="yade is not installed")
def test_yade_s_shear_forces_grow_by_half_the_square_of_a_step_s_rotation(run_cell):
    cell = run_cell(CASE, YADE, {})
    assert cell.failures == []
    growth = cell.observed.scalars["shear"][1] / 20.0 - 1.0
    assert growth == pytest.approx(math.expm1((0.5 * math.pi) ** 2 / 8000.0), rel=1e-3)


def test_lammps_cannot_stretch_a_loop():
    for params in CASE.matrix():
        setup = CASE.build(resolve(CASE, params).params)
        reported = LAMMPS.supports(setup.scene, setup.numerics)
        assert reported.level is SupportLevel.NO
        assert any("loop" in note for note in reported.notes)


@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.fs.__imul__(1 + 1e-7 * h.t[:, None] / h.t[-1]), {"fs_top", "shear"}),
        (lambda h: h.fs.__imul__(-1), {"fs_bottom", "fs_left"}),
        (lambda h: h.fn.__imul__(1 + 1e-8), {"fn_right"}),
        (lambda h: h.x.__iadd__(1e-11), {"way"}),
        (lambda h: h.omega.__imul__(1 + 1e-3), {"spin"}),
    ],
    ids=["growth", "sign", "normal", "drift", "spin"],
)
def test_defects_are_seen(run_cell, spoil, seen):
    assert seen <= run_cell(CASE, DEM, {}, spoil).seen


def test_slipping_preload_is_refused():
    with pytest.raises(ParameterError, match="below mu fn"):
        CASE.build(resolve(CASE, {"fs": 60.0}).params)
