"""Friction of a pyramid: its law, Coulomb's law where the slip is along the velocity, and sizes of a known difference that bound it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ninedisk.harness.api.engine import Difference
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case, get_engine
from ninedisk.harness.cases.pyramid import axes_of, pyramid_impulse, slide_sphere, throw_sphere
from ninedisk.references.analytic.on_plane.ball_on_plane import slide_and_roll

SAPIEN = get_engine("sapien")
needs_sapien = pytest.mark.skipif(not SAPIEN.info().installed, reason="SAPIEN is not installed")
UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("seed", range(20))
def test_each_axis_sticks_or_bears_its_whole_bound_against_the_slip(seed):
    draw = np.random.default_rng(seed)
    root = draw.normal(size=(3, 3))
    response, mu = 0.05 * root @ root.T + np.eye(3), 0.4
    before = np.array([*draw.normal(size=2), -1.0])
    centre = draw.normal(size=3)
    p = pyramid_impulse(response, before, rebound=0.3, mu=mu, centre=centre)
    after = before + response @ p
    assert after[2] == pytest.approx(0.3, abs=1e-12)
    for axis in axes_of(centre, UP):
        slip, push = after @ axis, p @ axis
        assert abs(push) <= mu * p[2] * (1.0 + 1e-9)
        assert abs(slip) < 1e-12 or push == pytest.approx(-np.copysign(mu * p[2], slip), rel=1e-9)


def test_what_slips_along_its_velocity_is_braked_as_coulomb_says():
    v = throw_sphere([0.6, 0.8, 0.0], [0.0, 0.0, 5.0], radius=0.5, pull=3.0, dt=1e-3, n_steps=60)
    truth = slide_and_roll(1e-3 * np.arange(61), mu=0.3, g=10.0, radius=0.5, velocity=(0.6, 0.8), spin=(0.0, 0.0, 5.0))
    np.testing.assert_allclose(v[:, :2], truth.v, atol=1e-12)


def test_what_slips_aside_is_braked_by_both_axes():
    """Slip at 45 degrees to the velocity: 1.41 times the bound, along it; nearly along the velocity it is still that much."""
    start, pull, dt = np.array([1.0, 0.0, 0.0]), 3.0, 1e-3
    for angle in (10.0, 45.0):
        slip = 2.0 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
        spin = np.cross(UP, start - slip) / 0.5
        np.testing.assert_allclose(start - 0.5 * np.cross(spin, UP), slip, atol=1e-12)
        v, _ = slide_sphere(start, spin, np.zeros(3), UP, radius=0.5, pull=pull, dt=dt)
        np.testing.assert_allclose(v - start, [-pull * dt, -pull * dt, 0.0], atol=1e-12)


def judged(judge_history, case_id, params, mu=1.0, spoil=None):
    """The cell of SAPIEN with friction that is by this factor another, or answers that are spoilt."""
    case = get_case(case_id)
    setup = case.build(resolve(case, params).params)
    scene = setup.scene.with_laws(lambda law: replace(law, mu=mu * law.mu))
    history = SAPIEN.run(scene, setup.numerics, setup.watch).history
    return judge_history(case, SAPIEN.info(), params, spoil(history) if spoil else history)


@needs_sapien
@pytest.mark.parametrize(
    ("case_id", "params"),
    [
        ("box/corner-drop", {}),
        ("box/corner-drop", {"approach": "turns", "restitution": 0.5}),
        ("box/corner-drop", {"approach": "falls", "mu": 0.2}),
        ("box/corner-drop", {"size": 0.1}),
        ("spheres/top", {"kind": "thrown"}),
    ],
)
def test_the_pyramid_explains_what_physx_does_and_a_hundredth_more_friction_is_beyond_it(
    judge_history, case_id, params
):
    known = judged(judge_history, case_id, params)
    assert known.failures == []
    assert set(known.known.values()) == {"sapien/friction-pyramid"}
    assert judged(judge_history, case_id, params, mu=1.01).failures


@needs_sapien
def test_without_the_difference_the_same_history_fails(judge_history):
    case, info = get_case("spheres/top"), SAPIEN.info()
    cell = judged(judge_history, "spheres/top", {"kind": "thrown"})
    others = {each: why for each, why in info.differences.items() if each is not Difference.FRICTION_PYRAMID}
    plain = judge_history(case, replace(info, differences=others), {"kind": "thrown"}, cell.history)
    assert {"vx", "vy", "spin_x", "spin_y"} <= plain.seen


@needs_sapien
def test_a_heap_that_leans_by_more_than_one_leg_explains_is_found(judge_history):
    def lean(history):
        x = history.x.copy()
        x[-1, -1, 0] += 0.012
        return replace(history, x=x)

    params = {"heap": "tetrahedron", "share": 0.8}
    assert judged(judge_history, "spheres/stack", params).failures == []
    assert "aside" in judged(judge_history, "spheres/stack", params, spoil=lean).seen


@needs_sapien
def test_a_box_may_turn_by_what_rounding_of_two_corners_explains_alone(judge_history):
    def turned(history):
        half = 0.5 * 3e-4 / history.t[-1] * history.t
        q = history.quaternion.copy()
        w, z = history.quaternion[:, 0, 0], history.quaternion[:, 0, 3]
        q[:, 0, 0], q[:, 0, 3] = w * np.cos(half) - z * np.sin(half), z * np.cos(half) + w * np.sin(half)
        return replace(history, quaternion=q)

    params = {"direction_deg": 70.0}
    known = judged(judge_history, "box/stop", params)
    assert (known.failures, known.known) == ([], {"turned": "sapien/box-turns-as-it-slides"})
    assert judged(judge_history, "box/stop", params, spoil=turned).seen == {"turned"}
    assert judged(judge_history, "box/stop", {"direction_deg": 0.0}, spoil=turned).seen == {"turned"}


@needs_sapien
def test_forces_that_no_other_contact_has_are_found(judge_history):
    def doubled(history):
        return replace(history, fn=2.0 * history.fn)

    params = {"arrangement": "pyramid", "start": "touching"}
    known = judged(judge_history, "static/stack", params)
    assert known.failures == []
    assert set(known.known.values()) == {"sapien/impulses-of-other-contacts"}
    assert {"fn_floor_left", "fn_floor_right"} <= judged(judge_history, "static/stack", params, spoil=doubled).seen


@needs_sapien
def test_a_rocking_box_that_turns_aside_by_a_fiftieth_is_found(judge_history):
    def aside(history):
        omega = history.omega.copy()
        omega[1:, 0, 2] += 0.05
        return replace(history, omega=omega)

    assert judged(judge_history, "box/rocking", {}).failures == []
    assert "turning" in judged(judge_history, "box/rocking", {}, spoil=aside).seen


@needs_sapien
def test_a_spin_may_end_sooner_by_the_corner_of_the_pyramid_alone(judge_history):
    """Friction that is half as strong again stops a box before the pyramid's strongest one does."""
    known = judged(judge_history, "box/spin", {})
    assert (known.failures, set(known.known.values())) == ([], {"sapien/friction-pyramid"})
    assert {"spin", "turned"} <= judged(judge_history, "box/spin", {}, mu=1.5).seen
    assert {"spin", "turned"} <= judged(judge_history, "box/spin", {}, mu=0.5).seen


@needs_sapien
def test_a_tower_may_rock_but_not_creep(judge_history):
    def creeps(history):
        x = history.x.copy()
        x[-1, 1, 0] += 0.004
        return replace(history, x=x)

    params = {"slope_deg": 15.0}
    known = judged(judge_history, "box/stack", params)
    assert [each for each in known.failures if "NaN" not in each] == []  # PhysX reports no friction
    assert set(known.known.values()) == {"sapien/boxes-rock"}
    assert "creep" in judged(judge_history, "box/stack", params, spoil=creeps).seen
