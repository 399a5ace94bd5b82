"""Theta-scheme collisions against rational stepping of both disks."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from ninedisk.references.analytic.impact.collision import final_velocities
from ninedisk.references.exact_steps.impact import collision_step_theta, effective_restitution

NAMES = ("x_1", "x_2", "vx_1", "vx_2", "gap", "fn")


def rational_steps(*, gap, speed, dt, theta, n_steps, mass_1, mass_2) -> dict[str, np.ndarray]:
    """``Mbar dx = M v0/(theta dt) -+ p`` with ``gap + dx_2 - dx_1 >= 0``, p its multiplier."""
    gap, dt, theta, mass_1, mass_2 = map(Fraction, (gap, dt, theta, mass_1, mass_2))
    x_1 = x_2 = v_2 = Fraction(0)
    v_1 = Fraction(speed)
    rows = [(x_1, x_2, v_1, v_2, gap, Fraction(0))]
    for _ in range(n_steps):
        soft_1, soft_2 = theta * dt**2 / mass_1, theta * dt**2 / mass_2
        p = max(v_1 * dt - v_2 * dt - gap, Fraction(0)) / (soft_1 + soft_2)
        dx_1, dx_2 = v_1 * dt - soft_1 * p, v_2 * dt + soft_2 * p
        v_1, v_2 = (dx_1 / dt - (1 - theta) * v_1) / theta, (dx_2 / dt - (1 - theta) * v_2) / theta
        x_1, x_2, gap = x_1 + dx_1, x_2 + dx_2, gap + dx_2 - dx_1
        rows.append((x_1, x_2, v_1, v_2, gap, p))
    columns = np.array([[float(value) for value in row] for row in rows]).T
    return dict(zip(NAMES, columns, strict=True))


@pytest.mark.parametrize("theta", [0.5, 0.6, 0.75, 1.0])
def test_effective_restitution_over_the_phases_of_a_step(theta: float) -> None:
    gaps = np.linspace(0.0, 0.02, 51)
    ours = effective_restitution(gap=gaps, speed=0.7, dt=0.01, theta=theta)
    for gap, e in zip(gaps, ours, strict=True):
        exact = rational_steps(gap=gap, speed=0.7, dt=0.01, theta=theta, n_steps=8, mass_1=2.0, mass_2=3.0)
        assert e == pytest.approx((exact["vx_2"][-1] - exact["vx_1"][-1]) / 0.7, abs=2e-15)


@pytest.mark.parametrize("theta", [0.5, 0.6, 0.75, 1.0])
@pytest.mark.parametrize("gap", [0.0, 0.03, 0.031, 0.036, 0.0399999])
def test_every_step_of_a_collision(theta: float, gap: float) -> None:
    keys = {"gap": gap, "speed": 1.0, "dt": 0.01, "theta": theta, "n_steps": 10, "mass_1": math.pi, "mass_2": 2.0}
    ours, exact = collision_step_theta(**keys), rational_steps(**keys)
    for name in NAMES:
        first = 1 if name == "fn" else 0
        scale = max(np.abs(exact[name]).max(), 1e-2)
        # gap/(v dt) is exact to 1e-18, the phase is multiplied by at most 2/theta.
        assert np.abs(getattr(ours, name)[first:] - exact[name][first:]).max() <= 1e-15 * scale, name
    assert math.isnan(ours.fn[0])
    assert ours.momentum_x == pytest.approx(math.pi, rel=1e-15)


@pytest.mark.parametrize("theta", [0.5, 0.6, 0.75, 1.0])
def test_whole_number_of_steps_is_approached_from_both_sides(theta: float) -> None:
    e = effective_restitution(gap=[0.05 - 1e-12, 0.05, 0.05 + 1e-12], speed=1.0, dt=0.01, theta=theta)
    # Slopes up to 1/theta in the phase, which moved by 1e-10.
    assert e == pytest.approx((1.0 - theta) / theta, abs=3e-10)


def test_midpoint_rule_has_the_triangle_of_phases() -> None:
    phase = np.linspace(0.0, 0.99, 34)
    e = effective_restitution(gap=phase * 0.01, speed=1.0, dt=0.01, theta=0.5)
    assert e == pytest.approx(np.abs(1.0 - 2.0 * phase), abs=1e-14)


@pytest.mark.parametrize(("theta", "e", "impulse"), [(0.5, 1.0, math.pi), (1.0, 0.0, math.pi / 2.0)])
def test_collision_of_the_source(theta: float, e: float, impulse: float) -> None:
    steps = collision_step_theta(gap=0.5, speed=1.0, dt=0.01, theta=theta, n_steps=60, mass_1=math.pi, mass_2=math.pi)
    after = final_velocities(v_1=1.0, v_2=0.0, mass_1=math.pi, mass_2=math.pi, restitution=e)
    assert (steps.vx_1[-1], steps.vx_2[-1]) == pytest.approx(after, abs=1e-13)
    # 0.5/(1.0 * 0.01) of the decimal inputs is 50 to 1e-17: the force acts in step 51, or all except 1e-15 of it.
    assert np.nansum(steps.fn) * 0.01 == pytest.approx(impulse, rel=1e-13)
    assert steps.fn[51] * 0.01 == pytest.approx(impulse, rel=1e-13)
    assert steps.energy[0] == pytest.approx(math.pi / 2.0)
    assert steps.energy[-1] == pytest.approx(math.pi / 2.0 if e else math.pi / 4.0, rel=1e-13)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gap": -0.1}, "gap = -0.1"),
        ({"speed": 0.0}, "speed = 0.0"),
        ({"theta": 0.3}, "theta = 0.3"),
        ({"dt": 0.0}, "dt"),
    ],
)
def test_bad_values_are_named(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        effective_restitution(**{"gap": 0.1, "speed": 1.0, "dt": 0.01, "theta": 0.5, **change})
