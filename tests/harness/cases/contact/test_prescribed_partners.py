"""Driven walls, held and fixed disks: springs, rigid and soft contacts see defects of a few per cent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ninedisk.harness.api.case import headlines_of
from ninedisk.harness.cases.contact.driven_wall import CASE as DRIVEN
from ninedisk.harness.cases.impact.held_disk import CASE as HELD
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.results.schema import USES
from ninedisk.harness.run.judge import headline_row
from ninedisk.harness.selftest.declared import Declared
from ninedisk.harness.selftest.setups import with_disks, with_motion

SHAKE, TURN, FIXED, PUSHED = {"motion": "shake"}, {"motion": "turn"}, {"partner": "fixed"}, {"partner": "held"}
ENGINES = (DEM, CD, Declared("soft"))


def of_walls(**factor):
    def change(segment):
        return replace(segment, **{name: np.multiply(by, getattr(segment, name)) for name, by in factor.items()})

    return lambda scene: with_motion(scene, change)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.id)
@pytest.mark.parametrize(
    ("case", "params", "scene", "names"),
    [
        (DRIVEN, SHAKE, of_walls(amplitude=1.05), {"x", "vx", "fs", "wall_x"}),
        (DRIVEN, SHAKE, lambda scene: with_disks(scene, mass=1.05 * scene.disks.mass), {"fn", "fs"}),
        (DRIVEN, TURN, of_walls(angular_velocity=1.05), {"vy", "vy_final", "wall_angle"}),
        (DRIVEN, TURN, of_walls(angular_velocity=-1.0), {"vy_final", "y", "t_struck"}),
        (DRIVEN, TURN, lambda scene: with_disks(scene, radius=1.05 * scene.disks.radius), {"y", "t_struck"}),
        (HELD, FIXED, lambda scene: with_disks(scene, held=False), {"vx", "vy", "partner_x", "partner_y", "partner_vx"}),
        (HELD, FIXED, lambda scene: with_disks(scene, radius=1.05 * scene.disks.radius), {"vx_final", "x", "y"}),
    ],
    ids=["amplitude", "mass", "rate", "sense", "radius", "not-held", "larger"],
)  # fmt: skip
def test_defects_are_seen(run_cell, engine, case, params, scene, names):
    assert names <= run_cell(case, engine, params, scene=scene).seen


def test_restitution_and_a_spin_are_seen(run_cell):
    assert {"vy", "vy_final"} <= run_cell(DRIVEN, CD, TURN, law={"restitution": 0.55}).seen
    assert {"vx", "vx_final", "vy_final"} <= run_cell(HELD, CD, PUSHED, law={"restitution": 0.55}).seen
    assert run_cell(DRIVEN, CD, TURN, lambda h: h.omega.__iadd__(1e-6)).seen == {"spin"}


@pytest.mark.parametrize(("case", "params"), [(DRIVEN, SHAKE), (DRIVEN, TURN), (HELD, FIXED), (HELD, PUSHED)])
def test_headlines_are_errors_of_the_continuous_problem(run_cell, case, params):
    (good,) = (headline for headline in headlines_of(case, *cell_of(run_cell(case, CD, params))))
    assert good.use in USES
    errors = []
    for dt in (2e-3, 1e-3, 5e-4):
        cell = run_cell(case, CD, {**params, "dt": dt})
        errors += [headline_row({}, each, cell.observed)["rel_error"] for each in headlines_of(case, *cell_of(cell))]
    assert all(error < 5e-3 for error in errors)
    assert errors[2] < max(0.9 * errors[0], 1e-12)


def cell_of(cell):
    return cell.params, cell.setup, cell.observed
