"""Cases of boxes: an engine that runs them passes, each check can fail, and planted defects are found."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ninedisk.core.history import History
from ninedisk.core.scene import SphereScene
from ninedisk.harness.api.case import Case, ParameterError
from ninedisk.harness.api.engine import Engine
from ninedisk.harness.api.params import resolve
from ninedisk.harness.api.registry import get_case, get_engine
from ninedisk.harness.cases.box.corner import VELOCITIES, _impact
from ninedisk.harness.cases.box.incline import start_of
from ninedisk.harness.run.judge import headline_row

MUJOCO, CD = get_engine("mujoco"), get_engine("cd")
needs_mujoco = pytest.mark.skipif(not MUJOCO.info().installed, reason="MuJoCo is not installed")

CASES = (
    "box/incline",
    "box/stop",
    "box/free",
    "box/corner-drop",
    "box/rocking",
    "box/carries-balls",
    "box/stack",
    "box/domino",
    "box/spin",
)
LEAST = {
    "box/incline": 4,
    "box/stop": 5,
    "box/free": 4,
    "box/corner-drop": 6,
    "box/rocking": 5,
    "box/carries-balls": 9,
    "box/stack": 16,
    "box/domino": 5,
    "box/spin": 5,
}


@pytest.mark.parametrize("case_id", CASES)
@pytest.mark.parametrize("engine_id", ["mujoco", "bullet", "dart", "drake-sap", "drake-lagged", "cd"])
def test_every_check_of_every_variant_can_fail(judge_history: Any, case_id: str, engine_id: str) -> None:
    case, engine = get_case(case_id), get_engine(engine_id)
    for params in case.matrix():
        blank = judge_history(case, engine.info(), params, None)
        assert len(blank.failures) == len(blank.checks) >= LEAST[case_id], params


def spheres(**changes: Callable[[Any], Any]) -> Callable[[SphereScene], SphereScene]:
    """A scene whose bodies are changed, by name."""

    def change(scene: SphereScene) -> SphereScene:
        made = {name: how(getattr(scene.spheres, name)) for name, how in changes.items()}
        return scene.replace(spheres=replace(scene.spheres, **made))

    return change


def friction(factor: float) -> Callable[[SphereScene], SphereScene]:
    """A scene with another friction."""
    return lambda scene: scene.with_laws(lambda law: replace(law, mu=factor * law.mu))


def as_square(half: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """As high as before, and as long as it is wide."""
    return np.array([[half[0, 1], half[0, 1], half[0, 2]]])


def reported(**changes: Callable[[Any], Any]) -> Callable[[History], History]:
    """A history whose arrays are changed, by name."""
    return lambda history: replace(history, **{name: how(getattr(history, name)) for name, how in changes.items()})


def as_at_the_begin(history: History) -> History:
    """The impulse of a corner whose friction, of the same size, is against the slip before the impact."""
    mass, v = 3.0, history.v
    impulse = mass * (v[1:, 0] - v[0, 0])
    before = v[0, 0, :2] / np.hypot(*v[0, 0, :2])
    impulse[:, :2] = -np.hypot(*impulse[:, :2].T)[:, None] * before
    return replace(history, v=np.concatenate([v[:1], v[:1] + impulse[:, None] / mass]))


def same(it: Any) -> Any:
    """No change."""
    return it


BALLS = {"rows": 2, "direction_deg": 0.0}
PUSHED = {"share": 0.9, "mu": 0.15}
SLIDES, TIPS, STOPS, TURNS = {"mu": 0.35}, {"mu": 0.5, "slope_deg": 30.0, "aspect": 0.4}, {"mu": 0.7}, {}
SLIPS = {"approach": "turns"}
EXACT = ("box/corner-drop", "box/rocking", "box/carries-balls", "box/stack", "box/domino", "box/spin")
"""Cases of impacts, which a soft contact does not do in one step, and of several bodies."""

DEFECTS: dict[str, tuple[str, Mapping[str, Any], Callable[..., Any], Callable[..., Any]]] = {
    "a tenth less friction": ("box/incline", {"mu": 0.38}, friction(0.9), same),
    "a force on the box that is a hundredth larger": (
        "box/carries-balls",
        BALLS,
        lambda scene: scene.replace(forces=(replace(scene.forces[0], force=(151.5, 0.0, 0.0)),)),
        same,
    ),
    "friction of a pyramid": ("box/carries-balls", {"rows": 2}, friction(math.sqrt(2.0)), same),
    "smooth balls": (
        "box/carries-balls",
        BALLS,
        lambda scene: replace(scene, sphere_sphere=replace(scene.sphere_sphere, mu=0.0)),
        same,
    ),
    "moments of inertia of hollow balls": (
        "box/carries-balls",
        BALLS,
        spheres(inertia=lambda i: np.concatenate([i[:1], 5.0 / 3.0 * i[1:]])),
        same,
    ),
    "a push that moves what should rest": (
        "box/carries-balls",
        {"rows": 2, "push": 130.0},
        friction(0.9),
        same,
    ),
    "balls that roll the other way": ("box/carries-balls", BALLS, same, reported(omega=lambda w: -w)),
    "a ball that lags": (
        "box/carries-balls",
        BALLS,
        same,
        reported(v=lambda v: v * np.array([1.0, 1.0, 1.0, 0.99, 1.0])[:, None]),
    ),
    "a box that drifts aside": (
        "box/carries-balls",
        BALLS,
        same,
        reported(x=lambda x: x + 0.01 * (x - x[0])[..., [1, 0, 2]]),
    ),
    "a box that turns": (
        "box/carries-balls",
        BALLS,
        same,
        reported(omega=lambda w: w + np.array([0.0, 0.0, 1e-6])),
    ),
    "a box that sinks": ("box/carries-balls", BALLS, same, reported(gap=lambda gap: gap - 1e-8)),
    "a tower that slides": ("box/stack", {}, friction(0.4), same),
    "a box of the tower that is slightly heavier": (
        "box/stack",
        {},
        spheres(mass=lambda m: m * [1.0, 1.0, 1.00001]),
        same,
    ),
    "boxes of the tower in another place": (
        "box/stack",
        {},
        spheres(x=lambda x: np.add(x, [[0.0], [0.0], [1e-5]])),
        same,
    ),
    "masses in another order": ("box/stack", {}, spheres(mass=lambda m: m[[0, 2, 1]], inertia=lambda _: None), same),
    "friction the other way": ("box/stack", {}, same, reported(fs=lambda fs: -fs)),
    "friction of a box on the one above": (
        "box/stack",
        {},
        same,
        reported(fs=lambda fs: fs * [[[1.0], [-1.0], [1.0]]]),
    ),
    "moments that are slightly off": (
        "box/stack",
        {},
        same,
        reported(moment=lambda m: m + np.array([0.0, 1e-4, 0.0])),
    ),
    "forces of the step before last": (
        "box/stack",
        {},
        same,
        reported(fn=lambda fn: np.concatenate([fn[:1], 0.0 * fn[1:2], fn[2:]])),
    ),
    "a tower that creeps": ("box/stack", {}, same, reported(x=lambda x: x + 1e-8 * np.arange(len(x))[:, None, None])),
    "a box of the tower that moves": ("box/stack", {}, same, reported(v=lambda v: np.add(v, [[[0.0], [1e-7], [0.0]]]))),
    "a box of the tower that turns": (
        "box/stack",
        {},
        same,
        reported(omega=lambda w: np.add(w, [[[0.0], [0.0], [1e-6]]])),
    ),
    "a gap in the tower": ("box/stack", {}, same, reported(gap=lambda gap: np.add(gap, [0.0, 1e-8, 0.0]))),
    "a push at the centre": (
        "box/domino",
        {},
        lambda scene: scene.replace(forces=(replace(scene.forces[0], torque=(0.0, 0.0, 0.0)),)),
        same,
    ),
    "a push that is a thousandth larger": (
        "box/domino",
        {},
        lambda scene: scene.replace(
            forces=(replace(scene.forces[0], force=tuple(1.001 * f for f in scene.forces[0].force)),)
        ),
        same,
    ),
    "friction that ends too early": ("box/domino", {"share": 0.95}, friction(0.3), same),
    "slightly more friction": ("box/domino", PUSHED, friction(1.001), same),
    "a box that topples too early": (
        "box/domino",
        {"share": 0.95},
        spheres(half_sizes=lambda half: half * [0.9, 1.0, 1.0], inertia=lambda _: None, radius=lambda _: None),
        same,
    ),
    "moments of inertia of another box": ("box/domino", {}, spheres(inertia=lambda i: 1.01 * i), same),
    "a pushed box that drifts aside": (
        "box/domino",
        PUSHED,
        same,
        reported(x=lambda x: x + 0.01 * (x - x[0])[..., [1, 0, 2]]),
    ),
    "a pushed box that rises": ("box/domino", PUSHED, same, reported(gap=lambda gap: gap + 1e-8)),
    "a pushed box that gains energy": (
        "box/domino",
        {"share": 0.95},
        same,
        reported(v=lambda v: v + np.array([0.0, 0.0, 1e-4])),
    ),
    "a toppling that turns aside": (
        "box/domino",
        {},
        same,
        reported(omega=lambda w: w + np.array([0.0, 0.0, 1e-6])),
    ),
    "a toppling that ends": ("box/domino", {}, same, reported(omega=lambda w: np.where(w > 0.15, 0.15, w))),
    "a pressure of the other side": ("box/domino", {"share": 0.95}, same, reported(moment=lambda m: -m)),
    "forces of the step after": ("box/domino", PUSHED, same, reported(fn=lambda fn: fn * (1.0 + 1e-6))),
    "friction of a smaller face": (
        "box/spin",
        {},
        spheres(half_sizes=lambda half: half * [0.99, 1.0, 1.0], inertia=same, radius=lambda _: None),
        same,
    ),
    "friction of a spin that is slightly less": ("box/spin", {}, friction(1.0 - 1e-6), same),
    "a turn the other way round": ("box/spin", {}, same, reported(quaternion=lambda q: q[::-1])),
    "a spin that does not end": ("box/spin", {}, same, reported(omega=lambda w: np.maximum(w, 1e-6))),
    "a spin with a resultant": (
        "box/spin",
        {},
        same,
        reported(x=lambda x: x + 1e-7 * np.arange(len(x))[:, None, None]),
    ),
    "a spin that tilts": ("box/spin", {}, same, reported(omega=lambda w: w + np.array([1e-5, 0.0, 0.0]))),
    "a spin that lifts": ("box/spin", {}, same, reported(gap=lambda gap: gap + 1e-6)),
    "slightly less friction": ("box/incline", SLIDES, friction(0.99), same),
    "a longer box": (
        "box/incline",
        TIPS,
        spheres(half_sizes=as_square, radius=lambda _: None, inertia=lambda _: None),
        same,
    ),
    "moments of inertia of other axes": ("box/incline", TIPS, spheres(inertia=lambda i: i[:, [1, 0, 2]]), same),
    "orientation that is ignored": ("box/incline", TIPS, spheres(quaternion=lambda _: None), same),
    "moments of the second body": (
        "box/incline",
        {"mu": 0.38},
        same,
        reported(moment=lambda m: m + np.array([0.0, 0.6, 0.0])),
    ),
    "friction of another size": ("box/stop", STOPS, friction(1.02), same),
    "a path that bends": ("box/stop", STOPS, same, reported(x=lambda x: x + 0.01 * (x - x[0])[..., [1, 0, 2]])),
    "a restitution that is added": (
        "box/corner-drop",
        SLIPS,
        lambda scene: scene.with_laws(lambda law: replace(law, restitution=0.1)),
        same,
    ),
    "friction of an impact that is slightly less": ("box/corner-drop", SLIPS, friction(0.999), same),
    "friction against the slip at the begin": ("box/corner-drop", SLIPS, same, as_at_the_begin),
    "moments of inertia that are swapped": ("box/corner-drop", SLIPS, spheres(inertia=lambda i: i[:, [1, 0, 2]]), same),
    "a box that is a tenth wider": (
        "box/rocking",
        {},
        spheres(half_sizes=lambda half: half * [1.1, 1.0, 1.0], x=same, radius=lambda _: None, inertia=lambda _: None),
        same,
    ),
    "an impact that keeps slightly more": (
        "box/rocking",
        {},
        same,
        reported(omega=lambda w: np.concatenate([w[:1], w[1:2] + 1e-6, w[2:]])),
    ),
    "a spin that is a sixth faster": (
        "box/rocking",
        {},
        same,
        reported(omega=lambda w: 7.0 / 6.0 * w),
    ),
    "orientation that stays": ("box/free", TURNS, same, reported(quaternion=lambda q: np.broadcast_to(q[0], q.shape))),
    "spins of the body's axes": ("box/free", TURNS, same, reported(omega=lambda w: w[..., [1, 2, 0]])),
    "moments of inertia in another order": ("box/free", TURNS, spheres(inertia=lambda i: i[:, [1, 2, 0]]), same),
    "quaternions with w last": ("box/free", TURNS, same, reported(quaternion=lambda q: q[..., [1, 2, 3, 0]])),
}


def judged(
    judge_history: Any, case: Case, engine: Engine, params: Mapping[str, Any], defect: Any = (same, same)
) -> Any:
    """The judged cell of an engine that runs a changed scene, or answers otherwise."""
    before, after = defect
    setup = case.build(resolve(case, params).params)
    history = engine.run(before(setup.scene), setup.numerics, setup.watch).history
    return judge_history(case, engine.info(), params, after(history))


@needs_mujoco
@pytest.mark.parametrize("defect", DEFECTS)
def test_a_planted_defect_is_found(judge_history: Any, defect: str) -> None:
    case_id, params, *changes = DEFECTS[defect]
    case = get_case(case_id)
    engine = CD if case_id in EXACT else MUJOCO
    assert judged(judge_history, case, engine, params, changes).failures


@needs_mujoco
@pytest.mark.parametrize(
    ("case_id", "params"), [("box/incline", SLIDES), ("box/incline", TIPS), ("box/stop", STOPS), ("box/free", TURNS)]
)
def test_an_engine_passes_and_is_near_the_physics(judge_history: Any, case_id: str, params: Mapping[str, Any]) -> None:
    case = get_case(case_id)
    assert judged(judge_history, case, MUJOCO, params).failures == []
    resolved = resolve(case, params).params
    setup = case.build(resolved)
    observed = case.observe(resolved, setup, MUJOCO.run(setup.scene, setup.numerics, setup.watch).history)
    for headline in case.headlines(resolved, setup, observed):
        error = headline_row({}, headline, observed)["rel_error"]
        assert np.isnan(headline.expected) or error < 0.01, headline.name


@pytest.mark.skipif(not get_engine("sapien").info().installed, reason="SAPIEN is not installed")
def test_exact_steps_in_single_precision_see_less_than_a_thousandth_of_friction(judge_history: Any) -> None:
    """Their share of rounding is below that: the truth in continuous time is off by more, and passes both."""
    case, engine, params = get_case("box/stop"), get_engine("sapien"), {"direction_deg": 0.0}
    assert judged(judge_history, case, engine, params).failures == []
    failures = judged(judge_history, case, engine, params, (friction(0.9997), same)).failures
    assert [failure.split(":")[0] for failure in failures] == ["distance (exact-step)", "speed (exact-step)"]


@pytest.mark.parametrize(
    "params",
    [
        {"mu": 0.41, "aspect": 0.4, "slope_deg": 45.0},
        {"mu": 0.8, "aspect": 0.5, "turned_deg": 60.0, "slope_deg": 40.0},
        {"mu": 0.45, "slope_deg": 30.0, "aspect": 0.4, "duration": 3.0},
        {"duration": 0.01},
    ],
)
def test_what_has_no_closed_form_is_refused(params: Mapping[str, Any]) -> None:
    case = get_case("box/incline")
    with pytest.raises(ParameterError):
        case.build(resolve(case, params).params)


@pytest.mark.parametrize(
    ("case_id", "params"), [(case_id, params) for case_id in EXACT for params in get_case(case_id).matrix()]
)
def test_impacts_are_those_of_the_closed_form(judge_history: Any, case_id: str, params: Mapping[str, Any]) -> None:
    assert judged(judge_history, get_case(case_id), CD, params).failures == []


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"mu": 0.3}, r"mu = 0\.3 is not allowed: the edge would slip"),
        ({"duration": 1.0}, r"duration = 1 s is not allowed: the box lands at 0\.56"),
    ],
)
def test_rocking_that_slips_or_lands_is_refused(params: Mapping[str, Any], said: str) -> None:
    case = get_case("box/rocking")
    with pytest.raises(ParameterError, match=said):
        case.build(resolve(case, params).params)


@pytest.mark.parametrize(
    ("case_id", "params", "said"),
    [
        ("box/carries-balls", {"push": 900.0}, r"push = 900 N is not allowed with mu = 0\.4: the balls would slip"),
        ("box/carries-balls", {"duration": 2.0}, r"duration = 2 s is not allowed .* would move by 1\.06 m and leave"),
        (
            "box/domino",
            {"share": 1.5, "mu": 0.15},
            r"share = 1\.5 is not allowed with mu = 0\.15: .* slide while it topples",
        ),
        ("box/domino", {"duration": 2.0}, r"duration = 2 s is not allowed .* would have fallen"),
        ("box/stack", {"mu": 0.2}, r"slope_deg = 15 is not allowed with mu = 0\.2: the tower would slide"),
    ],
)
def test_balls_that_slip_and_towers_that_slide_and_boxes_that_fall_are_refused(
    case_id: str, params: Mapping[str, Any], said: str
) -> None:
    case = get_case(case_id)
    with pytest.raises(ParameterError, match=said):
        case.build(resolve(case, params).params)


def test_corners_stick_and_slip_and_turn_around() -> None:
    case = get_case("box/corner-drop")
    resolved = [resolve(case, params).params for params in case.matrix()]
    impacts = [_impact(params, case.build(params)) for params in resolved]
    assert [each.mode for each in impacts].count("sticks") == 1
    turned = [
        np.array(VELOCITIES[p["approach"]])[:2] @ i.slip[:2] < 0.0 for p, i in zip(resolved, impacts, strict=True)
    ]
    assert any(turned)


@pytest.mark.parametrize("mu", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("approach", VELOCITIES)
def test_a_corner_has_one_answer_in_the_whole_range(approach: str, mu: float) -> None:
    case = get_case("box/corner-drop")
    for restitution in (0.0, 0.5, 1.0):
        case.build(resolve(case, {"mu": mu, "approach": approach, "restitution": restitution}).params)


def test_the_matrix_has_both_sides_of_each_threshold() -> None:
    case = get_case("box/incline")
    modes = [start_of(resolve(case, params).params).mode for params in case.matrix()]
    assert {mode: modes.count(mode) for mode in modes} == {"slides": 3, "stands": 3, "tips": 2}
