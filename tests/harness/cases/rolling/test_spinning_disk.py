"""Spinning disk: verdicts on engines, the carried-over exact steps, defects that must be seen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.rolling.spinning_disk import CASE
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK


def test_pymunk_rolls_at_a_third_and_keeps_a_third_of_the_energy(run_cell):
    values = run_cell(CASE, PYMUNK, {}).observed.scalars
    assert values["vx_final"][1] == pytest.approx(1 / 3, abs=1e-12)
    assert values["spin_final"][1] == pytest.approx(1 / 3, abs=1e-12)
    assert values["energy_kept"][1] == pytest.approx(1 / 3, abs=1e-12)


@pytest.mark.parametrize(("engine", "params"), [(PYMUNK, {}), (CD, {}), (CD, {"sliding": "coulomb"})])
def test_exact_steps_bind_their_schemes(run_cell, engine, params):
    cell = run_cell(CASE, engine, params)
    exact = {check.quantity for check in cell.checks if check.truth == "exact-step"}
    assert {"x", "vx", "spin"} <= exact
    assert ("gap" in exact) == (engine is CD and not params)

    def late(history):
        history.v[1:, 0, 0] += 3e-9

    assert "vx" in run_cell(CASE, engine, params, late).seen


def test_the_positions_of_another_scheme_are_seen(run_cell, judge_history):
    history = run_cell(CASE, PYMUNK, {}).history
    other = dataclasses.replace(PYMUNK.info(), scheme="semi-implicit-euler")
    cell = judge_history(CASE, other, {}, history)
    assert any(text.startswith("x (exact-step)") for text in cell.failures)
    assert not any(text.startswith("vx (exact-step)") for text in cell.failures)


def test_the_springs_overshoot_fills_its_tolerance(run_cell):
    for params in ({}, {"kn": 1e6}):
        assert 0.9 < run_cell(CASE, DEM, params).margin("vx", "analytic") <= 1.0


def test_a_sphere_s_inertia_is_seen(run_cell):
    def sphere(scene):
        return scene.replace(disks=dataclasses.replace(scene.disks, inertia=0.8 * scene.disks.inertia))

    assert {"vx_final", "spin_final", "energy_kept", "slip_end"} <= run_cell(CASE, PYMUNK, {}, scene=sphere).seen


@pytest.mark.parametrize(
    ("spoil", "quantities"),
    [
        (lambda h: h.omega.__imul__(-1.0), {"spin", "spin_final", "slip_end"}),
        (lambda h: h.v.__imul__(1 + 1e-9), {"vx", "vx_final"}),
        (lambda h: h.omega.__imul__(0.99), {"spin_final", "slip_final", "energy"}),
        (lambda h: h.gap.__iadd__(1e-11), {"gap"}),
        (lambda h: h.omega.__setitem__((..., 0), np.nan), {"spin", "slip_end", "energy_kept"}),
    ],
    ids=["sense", "speed", "spin", "gap", "missing"],
)
def test_defects_are_seen(run_cell, spoil, quantities):
    assert quantities <= run_cell(CASE, PYMUNK, {}, spoil).seen


def test_a_plane_too_soft_to_carry_the_disk_is_refused():
    with pytest.raises(ParameterError, match="kn = 20 N/m"):
        CASE.build(resolve(CASE, {"kn": 20}).params)
