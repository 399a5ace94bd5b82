"""Prescribed motions of two spheres: values worked out by hand, paths whose rates are their velocities, forces against integration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.contact.two_sphere_motions import END, MOTIONS, RAMP, pair_forces, pair_path

SIZE = {"radius": 1.0, "overlap": 0.05}
LAW = {**SIZE, "kn": 1e7, "ks": 5e6, "mu": 0.5, "dashpot": 2e6}


@pytest.mark.parametrize("motion", MOTIONS)
def test_velocities_are_rates_of_the_paths(motion: str) -> None:
    t, h = np.linspace(0.01, END - 0.01, 997), 1e-5
    t = t[np.abs(t - RAMP) > 2 * h]
    ends = [pair_path(motion=motion, t=t + shift, **SIZE) for shift in (-h, h)]
    path = pair_path(motion=motion, t=t, **SIZE)
    assert (ends[1].x - ends[0].x) / (2 * h) == pytest.approx(path.v, abs=1e-9)
    assert (ends[1].angle - ends[0].angle) / (2 * h) == pytest.approx(path.spin, abs=1e-9)


def at(motion: str, t: float, **conventions: object) -> tuple[float, list[float]]:
    forces = pair_forces(motion=motion, t=[t], **{**LAW, **conventions})  # type: ignore[arg-type]
    return float(forces.fn[0]), forces.shear[0].tolist()


def test_values_by_hand() -> None:
    quarter = math.pi / 2
    assert at("shear-elastic", 0.0) == (pytest.approx(5e5), [0.0, 0.0, 0.0])
    # Beyond friction: mu kn (2 R - r), along the tangent (L, 0, -u)/r.
    r = math.hypot(1.95, 0.08)
    fn, shear = at("shear-plastic", quarter)
    assert fn == pytest.approx(1e7 * (2 - r))
    assert shear == pytest.approx([0.5 * fn * 1.95 / r, 0.0, -0.5 * fn * 0.08 / r])
    # Back in the middle, the spring has lost what slipped; one that was not cut has none left.
    back = 5e6 * (0.5 * 1e7 * (2 - r) / 5e6 - 1.95 * math.asinh(0.08 / 1.95))
    assert at("shear-plastic", math.pi)[1][0] == pytest.approx(back)
    assert at("shear-plastic", math.pi, spring_cut=False)[1][0] == pytest.approx(0.0, abs=1e-6)
    # Half a turn in the plane of shear reverses the force; a spring kept in space shows the same.
    size = 5e6 * 1.95 * math.asinh(0.02 / 1.95)
    e = np.array([1.95, 0.0, -0.02]) / math.hypot(1.95, 0.02)
    assert at("rotation-in-plane", END)[1] == pytest.approx((-size * e).tolist(), abs=1e-6)
    assert at("twist", END)[1] == pytest.approx((-size * e).tolist(), abs=1e-6)
    assert at("twist", END, spring_twisted=False)[1] == pytest.approx((size * e).tolist(), abs=1e-6)
    assert at("rotation-in-plane", END, spring_turned=False)[1][0] > 0.99 * size
    assert at("spin", quarter)[1][0] == pytest.approx(-5e6 * 2 * 0.975 * 0.01)
    assert at("spin", quarter, slip_arm="radius")[1][0] == pytest.approx(-5e6 * 2 * 0.01)
    # kn (0.05 + 0.05 sin t) + c 0.05 cos t; at 5.5 it would pull.
    expected = 5e5 * (1 + math.sin(5.0)) + 1e5 * math.cos(5.0)
    assert at("viscous", 5.0)[0] == pytest.approx(expected)
    pull = 5e5 * (1 + math.sin(4.6)) + 1e5 * math.cos(4.6)
    assert pull < 0
    assert at("viscous", 4.6)[0] == 0.0
    assert at("viscous", 4.6, tension=True)[0] == pytest.approx(pull)
    # Opened by 0.03 m: mu kn of what is left; and it stays so.
    left = 0.5 * 1e7 * (2 - math.hypot(1.95, 0.04) - 0.03)
    assert math.hypot(*at("unloading", 3.5 * math.pi)[1]) == pytest.approx(left)
    assert math.hypot(*at("unloading", END)[1]) == pytest.approx(left)
    assert math.hypot(*at("unloading", END, spring_cut=False)[1]) == pytest.approx(5e6 * 1.95 * math.asinh(0.04 / 1.95))


@pytest.mark.parametrize("arm", ["overlap", "radius"])
@pytest.mark.parametrize("motion", ["shear-plastic", "rotation-in-plane", "rotation-out-of-plane", "twist", "spin"])
def test_forces_agree_with_integration(motion: str, arm: str) -> None:
    steps = 12_000
    t = np.linspace(0.0, END, steps + 1)
    path = pair_path(motion=motion, t=t, **SIZE)
    middle = pair_path(motion=motion, t=0.5 * (t[1:] + t[:-1]), **SIZE)
    spring, worst = np.zeros(3), 0.0
    expected = pair_forces(motion=motion, t=t, slip_arm=arm, **LAW).shear
    for k in range(steps):
        d = float(np.linalg.norm(middle.x[k]))
        n = middle.x[k] / d
        lever = 1.0 if arm == "radius" else 0.5 * d
        slip = middle.v[k] - (middle.v[k] @ n) * n - np.cross(2 * lever * middle.spin[k], n)
        ends = [path.x[k + each] / np.linalg.norm(path.x[k + each]) for each in (0, 1)]
        h = t[k + 1] - t[k]
        turn = np.cross(*ends) + h * (middle.spin[k] @ n) * n
        # The midpoint rule: a turn of the spring by its mean.
        half = spring + 0.5 * (np.cross(turn, spring) + h * slip)
        spring = spring + np.cross(turn, half) + h * slip
        spring = spring - (spring @ ends[1]) * ends[1]
        limit = 0.5 * 1e7 * (2.0 - float(np.linalg.norm(path.x[k + 1]))) / 5e6
        spring = spring * min(1.0, limit / max(float(np.linalg.norm(spring)), 1e-300))
        worst = max(worst, float(np.linalg.norm(5e6 * spring - expected[k + 1])))
    # First order where the spring slides and its limit turns it, second elsewhere.
    assert worst < 2e-3 * float(np.linalg.norm(expected, axis=1).max())
