"""An impact on a corner: the laws of contact, limits, and an independent way to the same impulse."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ninedisk.harness.api.boxes import rotation_matrix
from ninedisk.references.analytic.impact.corner_impact import CornerImpact, corner_impact

TURN = np.array([0.9, 0.25, -0.3, 0.2]) / math.sqrt(1.0025)
BODY: dict[str, Any] = {
    "mass": 3.0,
    "inertia": np.array([0.16, 0.29, 0.37]),
    "axes": rotation_matrix(TURN),
    "arm": np.array([-0.1, -0.27, -0.57]),
    "spin": np.array([0.3, -0.2, 0.5]),
}
VELOCITIES = [(3.0, -2.0, -1.0), (-0.4, 0.6, -1.0), (0.0, 0.0, -1.0), (0.2, 1.5, -0.3)]


def response() -> np.ndarray[Any, Any]:
    """What an impulse does to the velocity of the point, by the motion of the body."""
    inverse = np.linalg.inv(BODY["axes"] @ np.diag(BODY["inertia"]) @ BODY["axes"].T)
    arm = BODY["arm"]
    columns = [each / BODY["mass"] + np.cross(inverse @ np.cross(arm, each), arm) for each in np.eye(3)]
    return np.stack(columns, axis=1)


def before(velocity: Any) -> np.ndarray[Any, Any]:
    return np.array(velocity) + np.cross(BODY["spin"], BODY["arm"])


@pytest.mark.parametrize("dilates", [False, True])
@pytest.mark.parametrize("restitution", [0.0, 0.6])
@pytest.mark.parametrize("mu", [0.0, 0.2, 0.4, 0.9])
@pytest.mark.parametrize("velocity", VELOCITIES)
def test_both_laws_hold(velocity: Any, mu: float, restitution: float, dilates: bool) -> None:
    found = corner_impact(**BODY, velocity=velocity, mu=mu, restitution=restitution, dilates=dilates)
    slip, friction, pressed = found.slip[:2], found.impulse[:2], found.impulse[2]
    np.testing.assert_allclose(found.slip, before(velocity) + response() @ found.impulse, atol=1e-13)
    np.testing.assert_allclose(found.velocity + np.cross(found.spin, BODY["arm"]), found.slip, atol=1e-13)
    speed = float(np.hypot(*slip))
    parting = -restitution * before(velocity)[2] + (mu * speed if dilates and found.mode == "slides" else 0.0)
    assert found.slip[2] == pytest.approx(parting, abs=1e-13)
    assert np.hypot(*friction) <= mu * pressed * (1.0 + 1e-13)
    if found.mode == "sticks":
        np.testing.assert_allclose(slip, 0.0, atol=1e-13)
    else:
        np.testing.assert_allclose(friction * speed, -mu * pressed * slip, atol=1e-12)


def projected(velocity: Any, mu: float, restitution: float) -> np.ndarray[Any, Any]:
    """The same by projections onto the cone's section, without an angle."""
    w, p = response(), np.zeros(3)
    target = np.array([0.0, 0.0, -restitution * before(velocity)[2]])
    step = 0.5 / np.linalg.eigvalsh(w).max()
    for _ in range(20_000):
        off = p - step * (before(velocity) + w @ p - target)
        off[2] = max(off[2], 0.0)
        size = float(np.hypot(off[0], off[1]))
        off[:2] *= min(1.0, mu * off[2] / size) if size else 1.0
        p = off
    return p


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_projections_come_to_the_same(velocity: Any) -> None:
    found = corner_impact(**BODY, velocity=velocity, mu=0.25, restitution=0.4)
    np.testing.assert_allclose(found.impulse, projected(velocity, 0.25, 0.4), atol=1e-10)


def impact(**given: Any) -> CornerImpact:
    return corner_impact(**(BODY | {"velocity": (1.0, 0.5, -1.0), "mu": 0.3, "restitution": 0.5} | given))


def test_a_sphere_rolls_or_slides_as_known() -> None:
    ball = {"inertia": [0.4 * 3.0] * 3, "arm": [0.0, 0.0, -1.0], "spin": [0.0, 0.0, 0.0], "velocity": (0.7, 0.0, -1.0)}
    rolls, slides = impact(**ball, mu=0.3), impact(**ball, mu=0.1)
    np.testing.assert_allclose(rolls.velocity, [0.7 * 5.0 / 7.0, 0.0, 0.5], atol=1e-14)
    np.testing.assert_allclose(slides.velocity, [0.7 - 0.1 * 1.5, 0.0, 0.5], atol=1e-14)
    np.testing.assert_allclose(slides.spin, [0.0, 0.15 / 0.4, 0.0], atol=1e-14)


def test_energy_is_kept_without_friction_by_an_elastic_impact() -> None:
    found = impact(mu=0.0, restitution=1.0)
    inertia = BODY["axes"] @ np.diag(BODY["inertia"]) @ BODY["axes"].T

    def energy(v: Any, w: Any) -> float:
        return float(0.5 * BODY["mass"] * np.dot(v, v) + 0.5 * w @ inertia @ w)

    assert energy(found.velocity, found.spin) == pytest.approx(energy((1.0, 0.5, -1.0), BODY["spin"]), rel=1e-13)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"velocity": (0.0, 0.0, 1.0)}, "must approach the plane"),
        ({"axes": np.diag([1.0, 1.0, 1.1])}, "must be a rotation"),
        ({"mu": 4.0, "velocity": (30.0, 40.0, -1.0)}, "mu = 4.0 is not allowed"),
        ({"restitution": 1.1}, "restitution = 1.1"),
    ],
)
def test_what_has_no_answer_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        impact(**given)
