"""Block on an incline: verdicts on engines, every scheme's exact steps, defects that must be seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.incline.block import CASE
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.references.exact_steps.incline import (
    associated_incline,
    coulomb_incline_theta,
    position_first_euler_incline,
    semi_implicit_euler_incline,
)

NORMAL, DRIVING = 7.854 * 10 * math.cos(math.radians(20)), 7.854 * 10 * math.sin(math.radians(20))


@pytest.mark.parametrize(("dt", "x"), [(0.01, 0.018467459), (0.005, 0.018560729), (0.0025, 0.018607364)])
def test_pymunk_lags_by_a_first_order_offset(run_cell, dt, x):
    cell = run_cell(CASE, PYMUNK, {"mu": 0.36, "dt": dt})
    assert cell.observed.scalars["x_final"][1] == pytest.approx(x, abs=1e-9)
    assert cell.margin("x", "analytic") == pytest.approx(1.0, abs=1e-6)
    assert cell.margin("x", "exact-step") < 1e-2


@pytest.mark.parametrize("mu", [0.36, 0.4])
def test_signs_and_sizes_of_the_forces(run_cell, mu):
    for engine in (PYMUNK, DEM):
        values = run_cell(CASE, engine, {"mu": mu}).observed.scalars
        assert values["fn_final"][1] == pytest.approx(NORMAL, rel=1e-9)
        assert values["fs_final"][1] == pytest.approx(min(mu * NORMAL, DRIVING), rel=1e-9)


def test_a_stuck_block_does_not_creep(run_cell):
    for engine in (PYMUNK, DEM):
        assert abs(run_cell(CASE, engine, {"mu": 0.4}).observed.scalars["creep_rate"][1]) < 1e-15


def test_without_preload_the_velocity_offset_scales_as_one_over_sqrt_k(run_cell):
    offsets = []
    for kn in (1e6, 1e8):
        cell = run_cell(CASE, DEM, {"mu": 0.3, "preload": False, "kn": kn})
        offsets.append(cell.observed.scalars["vx_final"][1] - 10 * (DRIVING - 0.3 * NORMAL) / 78.54)
        assert cell.failures == []
    assert offsets[0] / offsets[1] == pytest.approx(10.0, rel=0.02)


def test_preload_is_the_springs_equilibrium():
    setup = CASE.build(resolve(CASE, {"mu": 0.4, "kn": 1e7}).params)
    assert 0.5 - setup.scene.disks.x[0, 1] == pytest.approx(NORMAL / 1e7, rel=1e-9)
    assert setup.scene.initial_shear[(0, 1)] == pytest.approx(-DRIVING)
    bare = CASE.build(resolve(CASE, {"mu": 0.4, "kn": 1e7, "preload": False}).params)
    assert bare.scene.disks.x[0, 1] == 0.5
    assert not bare.scene.initial_shear


def _history(params, steps) -> History:
    setup = CASE.build(resolve(CASE, params).params)
    taken = setup.numerics.sampled_steps()
    history = History.empty(
        taken, taken * setup.numerics.dt, n_disks=1, n_walls=1, pairs=setup.watch, force_meaning="step-mean"
    )
    history.x[:, 0, 0], history.v[:, 0, 0] = steps.x, steps.vx
    history.gap[:, 0], history.fn[:, 0], history.fs[:, 0] = steps.gap, steps.fn, -steps.fs
    return history


SCHEMES = {
    "associated": ("theta", {}, associated_incline, {}),
    "coulomb": ("theta", {"sliding": "coulomb", "theta": 0.6}, coulomb_incline_theta, {"theta": 0.6}),
    "position-first": ("position-first-euler", {}, position_first_euler_incline, {}),
    "semi-implicit": ("semi-implicit-euler", {}, semi_implicit_euler_incline, {}),
}


@pytest.mark.parametrize("mu", [0.36, 0.4, 0.1])
@pytest.mark.parametrize("name", SCHEMES)
def test_each_scheme_passes_on_its_own_exact_steps_only(judge_history, scheme_info, name, mu):
    scheme, extra, solution, options = SCHEMES[name]
    params = {"mu": mu, **extra}
    info = scheme_info(scheme, "cd" if scheme == "theta" else "impulse")
    block = {"mu": mu, "angle": math.radians(20), "g": 10.0, "mass": 7.854, "dt": 0.01, "n_steps": 100}
    steps = solution(**block, **options)
    cell = judge_history(CASE, info, params, _history(params, steps))
    assert cell.failures == []
    assert any(check.truth == "exact-step" for check in cell.checks)
    if mu < 0.364:
        late = solution(**{**block, "mu": mu * (1 + 1e-8)}, **options)
        failures = judge_history(CASE, info, params, _history(params, late)).failures
        assert any("exact-step" in text for text in failures)


def test_dilation_is_no_coulomb_friction(judge_history, scheme_info):
    block = {"mu": 0.36, "angle": math.radians(20), "g": 10.0, "mass": 7.854, "dt": 0.01, "n_steps": 100}
    params = {"mu": 0.36, "sliding": "coulomb"}
    cell = judge_history(CASE, scheme_info("theta", "cd"), params, _history(params, associated_incline(**block)))
    assert {"gap", "gap_final"} <= cell.seen


def test_a_sliding_contact_that_opens_is_a_known_difference_of_that_size_and_no_more(judge_history, scheme_info):
    block = {"mu": 0.36, "angle": math.radians(20), "g": 10.0, "mass": 7.854, "dt": 0.01, "n_steps": 100}
    info = replace(scheme_info("unheard-of", "impulse"), dilates=True)
    history = _history({"mu": 0.36}, associated_incline(**block))
    cell = judge_history(CASE, info, {"mu": 0.36}, history)
    assert cell.failures == []
    assert cell.known["gap"] == cell.known["vx"] == "imaginary/sliding-lifts"
    assert judge_history(CASE, replace(info, dilates=False), {"mu": 0.36}, history).seen >= {"gap", "vx"}
    history.v[:, 0, 0] += 0.5
    assert "vx" in judge_history(CASE, info, {"mu": 0.36}, history).seen


@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.v.__imul__(1 + 1e-8), {"vx"}),
        (lambda h: h.x.__setitem__((..., 0), h.x[..., 0] + 1e-9), {"x", "x_final"}),
        (lambda h: h.fn.__imul__(1 + 1e-8), {"fn", "fn_final"}),
        (lambda h: h.fs.__imul__(-1.0), {"fs", "mu_crit"}),
        (lambda h: h.gap.__isub__(1e-11), {"gap"}),
        (lambda h: h.fn.__setitem__((50, 0), np.nan), {"fn"}),
    ],
    ids=["velocity", "shift", "normal", "sign", "gap", "missing"],
)
def test_defects_are_seen(run_cell, spoil, seen):
    for engine in (PYMUNK, DEM):
        names = run_cell(CASE, engine, {"mu": 0.36}, spoil).seen
        assert seen <= names, engine.id


def test_creep_is_seen(run_cell):
    def creep(history):
        history.x[:, 0, 0] += 1e-9 * history.t

    for engine in (PYMUNK, DEM):
        names = run_cell(CASE, engine, {"mu": 0.4}, creep).seen
        assert {"creep_rate", "x"} <= names
