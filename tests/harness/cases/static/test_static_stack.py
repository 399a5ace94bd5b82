"""Stack at rest: both arrangements on engines, the network's numbers, defects that must be seen."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.options import Option
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.static.stack import CASE, TILT, contact_network, stack_bounds
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.kratos.adapter import ENGINE as KRATOS
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.harness.engines.siconos.adapter import ENGINE as SICONOS
from ninedisk.harness.run.judge import blank_history
from ninedisk.references.analytic.assembly.stack import pyramid_forces

PYRAMID, AT_REST = {"arrangement": "pyramid"}, {"start": "equilibrium"}


def test_the_pyramid_presses_its_walls_apart(run_cell):
    values = run_cell(CASE, PYMUNK, PYRAMID).observed.scalars
    assert values["fn_wall_left_rest"][1] == pytest.approx(5.0 * math.tan(TILT), rel=1e-9)
    assert values["fn_floor_right_rest"][1] == pytest.approx(15.0, rel=1e-9)
    soft = run_cell(CASE, DEM, {**PYRAMID, "kn": 1e4})
    assert soft.failures == []
    assert soft.observed.scalars["fn_wall_left_rest"][1] == pytest.approx(5.0 * math.tan(TILT), rel=3e-3)
    assert soft.observed.scalars["fn_wall_left_rest"][1] != pytest.approx(5.0 * math.tan(TILT), rel=1e-4)


@pytest.mark.skipif(not SICONOS.info().installed, reason="siconos is not installed")
def test_siconos_keeps_a_contact_that_its_solver_lets_creep(run_cell):
    """Velocities of 1e-13 m/s that pass as the solver's residual open a gap; the contact must not be lost for that."""
    assert run_cell(CASE, SICONOS, PYRAMID).failures == []


@pytest.mark.skipif(not KRATOS.info().installed, reason="kratos is not installed")
def test_kratos_counts_the_energy_of_smooth_tilted_contacts(run_cell):
    assert run_cell(CASE, KRATOS, {**PYRAMID, **AT_REST}).failures == []


def test_sweeps_and_softness_of_a_column():
    network = contact_network(CASE.build(resolve(CASE, {}).params), 10.0)
    assert network.sweep == pytest.approx(math.cos(math.pi / 8) ** 2)  # of the chain of four that the floor holds
    assert network.softened == pytest.approx(440.0)  # 4*4 + 2 (3*3 + 2*2 + 1*1) weights of 10 N


def test_few_sweeps_are_allowed_for_where_the_engine_reports_their_option() -> None:
    """Whatever that option is called; an engine that does not report is held to the whole load in each step."""
    params = resolve(CASE, {}).params
    setup = CASE.build(params)
    observed = CASE.observe(params, setup, blank_history(setup))

    def allowed(**facts: Any) -> float:
        engine = replace(PYMUNK.info(), options={"passes": Option(default=20, why="", whole=True)}, **facts)
        return stack_bounds(params, setup, observed, engine).step_force

    left = contact_network(setup, params["g"]).sweep ** 20 * float(setup.scene.disks.mass.sum()) * params["g"]
    assert allowed(sweeps="passes") - allowed(sweeps="") == pytest.approx(left)


@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.fn[:, :1].__imul__(1 + 1e-6), {"fn_floor_rest", "fn_side_left_rest"}),
        (lambda h: h.fn.__setitem__((slice(-5, None), 1), np.nan), {"fn_layer_1_rest", "fn_side_right_rest"}),
        (lambda h: h.gap.__isub__(1e-9), {"gap_layer_1_final", "gap_wall_left_final"}),
        (lambda h: h.x.__setitem__((-1, 0), h.x[-1, 0] - 1e-3), {"motion_final"}),
        (lambda h: h.wall_force.__imul__(1.001), {"base"}),
    ],
    ids=["weight", "missing", "penetration", "fall", "base"],
)
@pytest.mark.parametrize("arrangement", ["column", "pyramid"])
def test_defects_are_seen(run_cell, spoil, seen, arrangement):
    for engine in (PYMUNK, DEM):
        cell = run_cell(CASE, engine, {"arrangement": arrangement}, spoil)
        expected = seen & {check.quantity for check in cell.checks}
        assert expected
        assert expected <= cell.seen, engine.id


def test_springs_close_to_the_rigid_pyramid_with_order_one():
    rigid = pyramid_forces(weight=10.0, chord=1.0, half_width=0.5).wall
    errors = [pyramid_forces(weight=10.0, chord=1.0, half_width=0.5, kn=kn).wall - rigid for kn in (1e5, 1e6)]
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=1e-2)
    with pytest.raises(ValueError, match="falls through"):
        pyramid_forces(weight=10.0, chord=1.0, half_width=0.99, kn=100.0)
