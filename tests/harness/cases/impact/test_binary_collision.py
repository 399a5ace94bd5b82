"""Binary collision: verdicts on engines, sharpness of the tolerances, defects that must be seen."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.harness.api.case import ParameterError
from ninedisk.harness.api.params import resolve
from ninedisk.harness.cases.impact.binary import CASE, PLASTIC_BETA, impact_settings
from ninedisk.harness.engines.dem.adapter import ENGINE as DEM
from ninedisk.harness.engines.pymunk.adapter import ENGINE as PYMUNK
from ninedisk.references.analytic.impact.spring_dashpot import restitution_of_beta
from ninedisk.references.exact_steps.impact import collision_step_theta


@pytest.mark.parametrize(("kind", "after"), [("elastic", (0.0, 1.0)), ("plastic", (0.5, 0.5))])
def test_pymunk_gives_the_source_s_velocities_to_1e_12(run_cell, kind, after):
    v = run_cell(CASE, PYMUNK, {"kind": kind}).history.v[-1, :, 0]
    np.testing.assert_allclose(v, after, rtol=0, atol=1e-12)


def test_the_tolerance_of_the_elastic_spring_is_the_error_s_own_bound(run_cell):
    # Touch and parting fall anywhere in a contact step: the gap sets one phase, the stiffness (contact of some 160 steps) the
    # other. No combination is beyond the bound, the worst is close to it.
    contact_dt = 0.01 / 128
    margins = [
        run_cell(CASE, DEM, {"kn": kn, "gap": 0.02 + phase * contact_dt, "contact_dt": contact_dt}).margin(
            "restitution_effective", "analytic"
        )
        for kn in 1e5 * np.linspace(0.99, 1.01, 8)
        for phase in np.linspace(0.0, 1.0, 8, endpoint=False)
    ]
    assert 0.9 < max(margins) <= 1.0


@pytest.mark.parametrize("beta", [0.05, 0.5, 1.0, 3.0])
def test_damped_contacts_keep_to_their_first_order_bound(run_cell, beta):
    cells = [run_cell(CASE, DEM, {"beta": beta, "gap": gap, "kn": 1e5}) for gap in np.linspace(0.02, 0.0203, 15)]
    assert [cell.failures for cell in cells] == [[]] * len(cells)
    assert max(cell.margin("restitution_effective", "analytic") for cell in cells) > 0.1


def test_momentum_is_conserved_to_1e_13(run_cell):
    drift = run_cell(CASE, DEM, {"kind": "plastic"}).observed.scalars["momentum_drift"][1]
    assert drift <= 1e-13 * np.pi


@pytest.mark.parametrize(
    ("params", "restitution", "beta", "theta"),
    [
        ({"kind": "elastic"}, 1.0, 0.0, 0.5),
        ({"kind": "plastic"}, 0.0, PLASTIC_BETA, 1.0),
        ({"kind": "plastic", "restitution": 1.0}, 1.0, 0.0, 0.5),
        ({"kind": "elastic", "theta": 0.8}, 0.25, None, 0.8),
        ({"kind": "elastic", "beta": 1.0}, np.exp(-2.0), 1.0, 1.0 / (1.0 + np.exp(-2.0))),
        ({"kind": "plastic", "theta": 0.6}, 2.0 / 3.0, None, 0.6),
        ({"restitution": 0.5, "theta": 0.9, "beta": 0.2}, 0.5, 0.2, 0.9),
    ],
)
def test_what_each_engine_is_reported(params, restitution, beta, theta):
    reported = impact_settings(resolve(CASE, params).params)
    assert reported.restitution == pytest.approx(restitution, rel=1e-14, abs=0)
    assert reported.theta == pytest.approx(theta, rel=1e-14)
    if beta is None:
        assert restitution_of_beta(reported.beta) == pytest.approx(restitution, rel=1e-12)
    else:
        assert reported.beta == pytest.approx(beta)


def _theta_history(params, *, spoil=0.0) -> History:
    """A history that follows the theta scheme's exact steps."""
    full = resolve(CASE, params).params
    setup = CASE.build(full)
    numerics = setup.numerics
    steps = collision_step_theta(
        gap=full["gap"], speed=full["speed"], dt=numerics.dt, theta=numerics.theta, n_steps=numerics.n_steps,
        mass_1=full["mass"], mass_2=full["mass"],
    )  # fmt: skip
    taken = numerics.sampled_steps()
    history = History.empty(
        taken, taken * numerics.dt, n_disks=2, n_walls=0, pairs=setup.watch, force_meaning="step-mean"
    )
    history.v[...] = 0.0
    history.v[:, 0, 0], history.v[:, 1, 0] = steps.vx_1, steps.vx_2 * (1.0 + spoil)
    return history


@pytest.mark.parametrize("gap", [0.5, 0.5025, 0.507])
def test_the_theta_scheme_is_held_to_its_exact_steps(judge_history, scheme_info, gap):
    params, info = {"kind": "elastic", "gap": gap}, scheme_info("theta", "cd")
    assert judge_history(CASE, info, params, _theta_history(params)).failures == []
    spoiled = judge_history(CASE, info, params, _theta_history(params, spoil=1e-9)).failures
    assert any("vx_2 (exact-step)" in text for text in spoiled)


def test_newton_s_law_does_not_depend_on_the_gap(judge_history, scheme_info):
    params = {"kind": "elastic", "gap": 0.5025, "impact": "newton"}
    cell = judge_history(CASE, scheme_info("theta", "cd"), params, _theta_history({"kind": "elastic", "gap": 0.5025}))
    assert any(text.startswith("restitution_effective (analytic): fail") for text in cell.failures)


@pytest.mark.parametrize(
    ("spoil", "seen"),
    [
        (lambda h: h.v.__setitem__((slice(None), 0, 0), h.v[:, 0, 0] + 3e-12), {"vx_1", "momentum_drift"}),
        (lambda h: h.v.__setitem__((slice(70, None), 1, 1), 2e-13), {"vy_2"}),
        (lambda h: h.v.__setitem__((40, 1, 0), 1e-6), {"vx_2", "momentum_x"}),
        (lambda h: h.v.__setitem__((-1, 0, 0), np.nan), {"vx_1_final", "restitution_effective", "momentum_drift"}),
        (lambda h: h.v.__setitem__((slice(None), slice(None), 0), h.v[:, ::-1, 0]), {"vx_1", "vx_2"}),
    ],
    ids=["bias", "sideways", "one-sample", "missing", "swapped"],
)
def test_defects_are_seen(run_cell, spoil, seen):
    failures = run_cell(CASE, PYMUNK, {"kind": "elastic"}, spoil).failures
    assert seen <= {text.split()[0] for text in failures}


def test_an_engine_that_ignores_the_restitution_fails(run_cell):
    cell = run_cell(CASE, PYMUNK, {"kind": "elastic"}, law={"restitution": 0.99})
    assert "restitution_effective" in cell.seen


@pytest.mark.parametrize("params", [{"duration": 0.3}, {"gap": 2.0, "duration": 2.0}])
def test_a_run_that_ends_before_the_collision_is_refused(params):
    with pytest.raises(ParameterError, match="duration"):
        CASE.build(resolve(CASE, params).params)


def test_contact_steps_divide_the_step_and_resolve_the_contact():
    for params in ({}, {"kind": "plastic"}, {"dt": 0.003, "kn": 3.3e5}, {"beta": 4.0}):
        full = resolve(CASE, params).params
        setup = CASE.build(full)
        contact_dt = setup.numerics.contact_dt
        assert setup.numerics.substeps(contact_dt) >= 1
        phase = np.sqrt(2.0 * full["kn"] / full["mass"]) * contact_dt
        assert phase <= 0.02 * (1 + 1e-9)
        assert phase * setup.scene.disk_disk.beta <= 0.05 * (1 + 1e-9)


def test_a_user_s_contact_step_is_taken():
    assert CASE.build(resolve(CASE, {"contact_dt": "0.01 ms"}).params).numerics.contact_dt == 1e-5


def test_other_speeds_and_steps_pass(run_cell):
    for engine in (PYMUNK, DEM):
        assert run_cell(CASE, engine, {"dt": 0.02, "speed": 3.0, "mass": 0.5}).failures == []
