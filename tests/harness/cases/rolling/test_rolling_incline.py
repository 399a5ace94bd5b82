"""Disk on an incline: both branches on engines, exact steps of each scheme, defects that must be seen."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.rolling.incline_disk import CASE, MASS, RADIUS
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.references.exact_steps.rolling import associated_rolling

ANGLE = math.radians(20)
ROLLS, SLIDES = {"mu": 0.3}, {"mu": 0.1}


def test_both_branches_have_the_textbook_rates(run_cell):
    rolls = run_cell(CASE, DEM, ROLLS).observed.scalars
    assert rolls["acceleration"][1] == pytest.approx(2 / 3 * 10 * math.sin(ANGLE), rel=1e-6)
    assert rolls["fs_mean"][1] == pytest.approx(MASS * 10 * math.sin(ANGLE) / 3, rel=1e-6)
    slides = run_cell(CASE, DEM, SLIDES).observed.scalars
    assert slides["spin_rate"][1] == pytest.approx(2 * 0.1 * 10 * math.cos(ANGLE) / RADIUS, rel=1e-6)
    assert "dilation" not in rolls
    assert abs(slides["dilation"][1]) < 1e-6
    assert run_cell(CASE, CD, SLIDES).observed.scalars["dilation"][1] == pytest.approx(1.0, abs=1e-8)


def history_of(params, steps) -> History:
    setup = CASE.build(resolve(CASE, params).params)
    taken = setup.numerics.sampled_steps()
    history = History.empty(taken, taken * 0.01, n_disks=1, n_walls=1, pairs=setup.watch, force_meaning="step-mean")
    history.x[:, 0, 0], history.v[:, 0, 0], history.omega[:, 0] = steps.x, steps.vx, -steps.spin
    history.gap[:, 0], history.fn[:, 0], history.fs[:, 0] = steps.gap, steps.fn, -steps.fs
    return history


@pytest.mark.parametrize("params", [ROLLS, SLIDES], ids=["rolls", "slides"])
def test_a_sphere_is_no_disk(judge_history, scheme_info, params):
    info = scheme_info("theta", "cd")
    thrown = {"mu": params["mu"], "g": 10 * math.cos(ANGLE), "pull": 10 * math.sin(ANGLE), "mass": MASS}
    thrown |= {"radius": RADIUS, "speed": 0.0, "dt": 0.01, "n_steps": 100}
    disk = associated_rolling(**thrown, inertia_ratio=0.5)
    assert judge_history(CASE, info, params, history_of(params, disk)).failures == []
    sphere = judge_history(CASE, info, params, history_of(params, associated_rolling(**thrown, inertia_ratio=0.4)))
    assert {"spin", "spin_final", "spin_rate"} <= sphere.seen


@pytest.mark.parametrize("params", [ROLLS, SLIDES], ids=["rolls", "slides"])
@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.v.__imul__(1 + 1e-5), {"vx", "slip"}),
        (lambda h: h.omega.__imul__(1 + 1e-4), {"spin", "slip", "spin_rate"}),
        (lambda h: h.omega.__imul__(-1), {"spin", "slip"}),
        (lambda h: h.fs.__imul__(1 + 1e-5), {"fs", "fs_mean"}),
        (lambda h: h.fn.__imul__(1 + 1e-8), {"fn", "fn_mean"}),
        (lambda h: h.gap.__isub__(1e-11), {"gap"}),
        (lambda h: h.x.__setitem__((..., 0), h.x[..., 0] + 1e-4), {"x"}),
        (lambda h: h.fn.__setitem__((50, 0), np.nan), {"fn"}),
    ],
    ids=["velocity", "spin", "sign", "shear", "normal", "gap", "shift", "missing"],
)
def test_defects_are_seen(run_cell, spoil, seen, params):
    for engine in (PYMUNK, DEM):
        assert seen <= run_cell(CASE, engine, params, spoil).seen, engine.id
