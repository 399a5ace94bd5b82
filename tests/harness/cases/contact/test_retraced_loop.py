"""Contacts that retrace a path: either place of the slip, what installed engines do, defects that must be seen."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.engine import SupportLevel
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.contact.retraced_loop import CASE, predicted_drift
from ninedisk.harness.engines.cd.adapter import ENGINE as CD
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.kratos.adapter import ENGINE as KRATOS
from ninedisk.harness.engines.lammps.adapter import ENGINE as LAMMPS
from ninedisk.harness.engines.liggghts.adapter import ENGINE as LIGGGHTS
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.harness.engines.yade.adapter import ENGINE as YADE

KINDS = ("pair", "wall")


def drift(cell):
    return cell.observed.scalars["drift"][1]


def predicted(cell):
    params = cell.params
    return predicted_drift(params, params["steps"], mid=params["arm"] == "overlap") / params["amplitude"]


@pytest.mark.parametrize("params", CASE.matrix(), ids=lambda params: resolve(CASE, params).id)
def test_the_matrix_passes(run_cell, params):
    cell = run_cell(CASE, DEM, params)
    assert cell.failures == []
    assert len(cell.checks) == 3


@pytest.mark.parametrize("params", CASE.matrix(), ids=lambda params: resolve(CASE, params).id)
def test_the_matrix_passes_on_contact_dynamics(run_cell, params):
    cell = run_cell(CASE, CD, params)
    assert cell.failures == []
    assert len(cell.checks) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_contact_dynamics_keeps_one_step_s_error_whatever_the_number_of_cycles(run_cell, kind):
    kept = []
    for cycles in (2, 8):
        cell = run_cell(CASE, CD, {"kind": kind, "cycles": cycles})
        assert cell.failures == []
        kept.append(cycles * abs(drift(cell)))
    assert kept[1] < 1.1 * kept[0] < 2e-5


@pytest.mark.parametrize("kind", KINDS)
def test_the_middle_keeps_no_shear_and_the_end_drifts_as_predicted(run_cell, kind):
    for cycles in (1, 5):
        middle = run_cell(CASE, DEM, {"kind": kind, "steps": 400, "cycles": cycles})
        assert abs(drift(middle)) < 1e-9
        end = run_cell(CASE, DEM, {"kind": kind, "slip_at": "end", "steps": 400, "cycles": cycles})
        assert drift(end) == pytest.approx(predicted(end), rel=1e-4)
        assert abs(predicted(end)) > 1e-4


@pytest.mark.parametrize("arm", ["radius", "overlap"])
@pytest.mark.parametrize("kind", KINDS)
def test_scenes_that_are_reported_another_place_of_the_slip_are_seen(run_cell, kind, arm):
    """What an engine does that ignores ``slip_at``."""
    for asked, has in (("middle", "end"), ("end", "middle")):
        names = {"middle": {"shear", "astray", "drift"}, "end": {"shear"}}[asked]
        params = {"kind": kind, "slip_at": asked, "arm": arm}
        assert names <= run_cell(CASE, DEM, params, law={"slip_at": has}).seen


@pytest.mark.parametrize(
    ("spoil", "names"),
    [
        (lambda h: h.fs.__imul__(-1.0), {"shear", "astray"}),
        (lambda h: h.fs.__imul__(1.0 + 1e-5), {"shear"}),
        (lambda h: h.fs.__iadd__(1e-20 * h.t[:, None] / h.t[-1]), {"shear", "drift"}),
        (lambda h: h.fs.__setitem__(slice(None), math.nan), {"shear", "astray", "drift"}),
        # A sample taken half a cycle late is another place on the path.
        (lambda h: h.fs.__setitem__(slice(10, None), h.fs[:-10].copy()), {"shear", "astray"}),
    ],
    ids=["sign", "scale", "creep", "nan", "half-a-cycle"],
)
@pytest.mark.parametrize("kind", KINDS)
def test_defects_are_seen(run_cell, kind, spoil, names):
    assert names <= run_cell(CASE, DEM, {"kind": kind}, spoil).seen


def test_an_engine_is_judged_by_its_own_form_and_its_drift_is_reported(run_cell, judge_history, scheme_info):
    """An engine without the middle passes with the end's steps, and not with the middle's; nor does one that claims what it is not."""
    ours = run_cell(CASE, DEM, {"slip_at": "end"})
    known = DEM.info().capabilities
    without = dataclasses.replace(
        scheme_info("central-difference", "spring"), capabilities=known - {Capability.SLIP_MIDDLE}
    )
    judged = judge_history(CASE, without, {"slip_at": "middle"}, ours.history)
    assert judged.failures == []
    assert drift(judged) == drift(ours) != 0.0
    claiming = dataclasses.replace(without, capabilities=known)
    assert judge_history(CASE, claiming, {"slip_at": "middle"}, ours.history).seen == {"shear", "astray", "drift"}


@pytest.mark.long
@pytest.mark.parametrize(
    ("engine", "params"),
    [
        (YADE, {"slip_at": "end"}),
        (YADE, {"kind": "wall", "slip_at": "end", "arm": "overlap", "rotation": "free"}),
        (LAMMPS, {"slip_at": "end"}),
        (LAMMPS, {"kind": "wall", "slip_at": "end"}),
        (LIGGGHTS, {"slip_at": "end"}),
        (KRATOS, {"slip_at": "end", "arm": "overlap", "rotation": "free"}),
    ],
    ids=lambda value: getattr(value, "id", None) or value.get("kind", "pair"),
)
def test_other_engines_have_the_form_of_the_end(run_cell, engine, params):
    if not engine.info().installed:
        pytest.skip(f"{engine.id} is not installed")
    cell = run_cell(CASE, engine, params)
    assert cell.failures == []
    # A fiftieth: shear forces that are turned to first order.
    assert drift(cell) == pytest.approx(predicted(cell), rel=0.02)


def test_engines_without_shear_springs_or_turning_walls_say_so():
    def reported(engine, params):
        setup = CASE.build(resolve(CASE, params).params)
        answer = engine.supports(setup.scene, setup.numerics)
        assert answer.level is SupportLevel.NO
        return set(answer.missing)

    assert Capability.SHEAR_SPRING in reported(PYMUNK, {})
    assert reported(LIGGGHTS, {"kind": "wall", "slip_at": "end"}) == {Capability.ROTATING_WALLS}


def test_the_end_goes_on_to_the_friction_limit():
    """Far more cycles than the case allows: a contact without net slip resists with all its friction, or not at all."""
    largest = {}
    for slip_at in ("middle", "end"):
        setup = CASE.build(resolve(CASE, {"slip_at": slip_at, "amplitude": 0.04, "steps": 20, "cycles": 1}).params)
        numerics = setup.numerics.replace(n_steps=400 * setup.numerics.n_steps, sample_every=20)
        history = DEM.run(setup.scene, numerics, setup.watch).history
        largest[slip_at] = float(np.abs(history.fs / history.fn).max())
        assert history.gap.max() < 0.0
    # Samples are at the oscillation's beginning but for the period that steps lengthen: there the amplitude has a part in the force.
    assert largest["middle"] < 0.5
    assert largest["end"] == pytest.approx(1.0, rel=1e-12)


def test_a_cycle_that_the_samples_do_not_divide_is_refused():
    with pytest.raises(ParameterError, match="steps = 110 is not allowed"):
        CASE.build(resolve(CASE, {"steps": 110}).params)
    with pytest.raises(ParameterError, match="to the friction limit; the drift must stay below"):
        CASE.build(resolve(CASE, {"steps": 20, "cycles": 1000}).params)
