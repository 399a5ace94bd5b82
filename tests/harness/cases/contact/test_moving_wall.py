"""A disk at a moving wall: the matrix on both in-house engines, defects that must be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.contact.moving_wall import CASE
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.selftest.setups import with_motion

PUSH, SHAKE = {"motion": "push"}, {"motion": "shake"}


def test_the_other_form_of_damping_is_of_first_order(run_cell):
    for params in (PUSH, SHAKE):
        assert run_cell(CASE, DEM, {**params, "damping_form": "lagged"}).failures == []


def test_errors_fall_with_the_square_of_the_step(run_cell):
    """Elastic contacts; a floor that shakes, as an impact's begin falls anywhere in a step."""
    errors = []
    for dt, steps in ((1e-4, 300), (5e-5, 600), (2.5e-5, 1200)):
        params = {**SHAKE, "beta": 0.0, "dt": dt, "steps": steps}
        cell = run_cell(CASE, DEM, params)
        (truth,) = [c for c in cell.checks if (c.quantity, c.truth) == ("fn", "analytic")]
        errors.append(np.abs(cell.observed.series["fn"][1] - truth.expected).max())
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("params", [PUSH, SHAKE], ids=["push", "shake"])
@pytest.mark.parametrize(
    ("spoil", "names"),
    [
        (lambda h: h.wall_force.__imul__(-1.0), {"load_wall"}),
        (lambda h: h.wall_point.__setitem__(slice(1, None), h.wall_point[:-1].copy()), {"wall_place"}),
        (lambda h: h.wall_angle.__iadd__(1e-6), {"wall_angle"}),
        (lambda h: [series.__imul__(2.0) for series in h.energy.values()], {"energy_kinetic", "energy_elastic"}),
        (lambda h: h.v.__imul__(1.0 + 1e-6), {"vy"}),
        (lambda h: h.fn.__setitem__((300, 0), np.nan), {"fn"}),
    ],
    ids=["load", "late", "turned", "energies", "speed", "missing"],
)
def test_defects_are_seen(run_cell, params, spoil, names):
    assert names <= run_cell(CASE, DEM, params, spoil).seen


def test_a_wall_that_shakes_the_other_direction_and_another_dashpot_are_seen_by_the_closed_forms_too(run_cell):
    def turned(scene):
        return with_motion(scene, lambda s: replace(s, amplitude=(0.0, -s.amplitude[1])))

    def of_closed_forms(params, **change):
        return {text.split()[0] for text in run_cell(CASE, DEM, params, **change).failures if "(analytic)" in text}

    assert {"fn", "y", "vy", "wall_place"} <= of_closed_forms(SHAKE, scene=turned)
    assert {"fn", "y", "vy"} <= of_closed_forms(SHAKE, law={"beta": 0.0})
    assert {"fn", "y", "vy", "vy_final"} <= of_closed_forms(PUSH, law={"beta": 0.0})


def test_what_the_closed_forms_do_not_cover_is_refused():
    with pytest.raises(ParameterError, match="the shaken disk would lift"):
        CASE.build(resolve(CASE, {**SHAKE, "kn": 1.2e5}).params)
    with pytest.raises(ParameterError, match=r"dt = 0\.001 s is not allowed"):
        CASE.build(resolve(CASE, {"dt": 1e-3}).params)
