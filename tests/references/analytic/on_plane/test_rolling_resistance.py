"""Rolling resistance: closed forms against the equations of motion integrated by themselves, energy, thresholds, and known numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.on_plane import rolling_resistance as rr

RNG = np.random.default_rng(7)
BODY = {"g": 9.81, "mass": 3.0, "radius": 0.7}


def test_numbers_of_a_disk_on_a_level_plane():
    """Derived by hand for k = 1/2, mu_r = 0.1, g = 10, v = 2: a = -2/3, 3 s, 3 m."""
    level = {"mu_r": 0.1, "angle": 0.0, "g": 10.0}
    assert rr.acceleration(**level) == pytest.approx(-2.0 / 3.0, rel=1e-15)
    assert rr.stop(**level, speed=2.0) == pytest.approx((3.0, 3.0), rel=1e-15)
    assert rr.against_viscous_torque(1.5, **level, speed=2.0).vx == pytest.approx(2.0 * math.exp(-1.0), rel=1e-15)
    swing = rr.oscillation(mu_r=0.1, kr=6.0, angle=0.0, g=10.0, mass=1.0, radius=0.5)
    assert swing == pytest.approx((4.0, 0.0, 0.1 * 0.5 * 10.0 / 6.0), rel=1e-15)


@pytest.mark.parametrize("excess", [-1e-6, 1e-6])
def test_an_incline_holds_up_to_its_threshold(excess):
    slope = {"mu_r": math.tan(0.2), "angle": 0.2 + excess, "g": 9.81}
    assert (rr.against_constant_torque(1.0, **slope, speed=0.0).vx == 0.0) == (excess < 0.0)
    if excess > 0.0:
        with pytest.raises(ValueError, match="angle"):
            rr.stop(**slope, speed=0.0)


def test_a_spring_that_does_not_yield_holds_the_disk_turned_by_its_weight():
    slope = {"mu_r": 1.0, "angle": 0.2, "kr": 100.0}
    found = rr.against_spring(np.array([50.0]), **slope, beta=0.3, speed=0.0, **BODY)
    assert found.x[0] == pytest.approx(3.0 * 9.81 * 0.7**2 * math.sin(0.2) / 100.0, rel=1e-12)


def integrated(model, t, *, mu_r, angle, g, mass, radius, speed, kr=1.0, beta=0.0, ratio=0.5):
    """Newton and Euler for the rolling disk in steps of a high-order method, the spring's plastic flow as an event-free projection."""
    inertia, normal = (1.0 + ratio) * mass * radius**2, mass * g * math.cos(angle)
    limit, drive = mu_r * radius * normal, mass * g * radius * math.sin(angle)

    def rates(_, state):
        spin, torque = state[1], state[2]
        if model == "viscous":
            return [spin, (drive - limit * abs(spin) * radius * np.sign(spin)) / inertia, 0.0]
        yields = abs(torque) >= limit and torque * spin > 0.0
        total = torque if yields else torque + 2.0 * beta * math.sqrt(inertia * kr) * spin
        return [spin, (drive - total) / inertia, 0.0 if yields else kr * spin]

    def cut(_, state):
        return abs(state[2]) - limit

    def back(_, state):
        return state[1]

    cut.terminal, cut.direction, back.terminal, back.direction = True, 1.0, True, -1.0
    state, begin, found = [0.0, speed / radius, 0.0], 0.0, []
    plastic = False
    t = np.asarray(t)
    while begin < t[-1]:
        event = None if model == "viscous" else back if plastic else cut
        run = solve_ivp(
            rates, (begin, t[-1]), state, method="DOP853", rtol=1e-12, atol=1e-14, events=event, dense_output=True
        )
        ends = run.t[-1]
        now = (t >= begin) & ((t < ends) | (ends >= t[-1]))
        found.append(run.sol(t[now]))
        state, begin = list(run.y[:, -1]), ends
        if run.status == 1 and not plastic:
            plastic, state[2] = True, math.copysign(limit * (1.0 + 1e-15), state[2])
        elif run.status == 1:
            plastic, state[1] = False, 0.0
            state[2] *= 1.0 - 1e-13
    states = np.concatenate(found, axis=1)
    return radius * states[0], radius * states[1]


@pytest.mark.parametrize("model", ["viscous", "spring"])
@pytest.mark.parametrize("angle", [0.0, 0.05, 0.3])
def test_closed_forms_solve_the_equations_of_motion(model, angle):
    for _ in range(3):
        mu_r, speed, ratio = RNG.uniform(0.05, 0.2), RNG.uniform(0.0, 2.0), RNG.uniform(0.3, 1.0)
        given = {"mu_r": mu_r, "angle": angle, "speed": speed, "inertia_ratio": ratio}
        t = np.linspace(0.0, 3.0, 61)
        own = {}
        if model == "viscous":
            found = rr.against_viscous_torque(t, **given, g=9.81)
        else:
            own = {"kr": RNG.uniform(20.0, 200.0), "beta": RNG.choice([0.0, 0.4])}
            found = rr.against_spring(t, **given, **own, **BODY)
        given["ratio"] = given.pop("inertia_ratio")
        x, vx = integrated(model, t, **given, **own, **BODY)
        assert found.x == pytest.approx(x, rel=1e-8, abs=1e-8)
        assert found.vx == pytest.approx(vx, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("angle", [0.0, 0.05, 0.3])
def test_accelerations_are_those_of_the_velocities_and_these_of_the_path(angle):
    h, at = 1e-5, np.linspace(0.1, 2.0, 39)
    t = np.concatenate([at - h, at, at + h])
    for curve in (
        rr.against_constant_torque(t, mu_r=0.1, angle=angle, g=9.81, speed=1.0),
        rr.against_viscous_torque(t, mu_r=0.1, angle=angle, g=9.81, speed=1.0),
        rr.against_spring(t, mu_r=0.1, angle=angle, speed=1.0, kr=50.0, beta=0.2, **BODY),
    ):
        x, vx, ax = (np.reshape(values, (3, -1)) for values in curve)
        assert (x[2] - x[0]) / (2.0 * h) == pytest.approx(vx[1], abs=1e-8)
        assert (vx[2] - vx[0]) / (2.0 * h) == pytest.approx(ax[1], abs=1e-3)


def test_two_disks_pressed_together_are_one_that_rolls():
    """Numbers by hand: unlike disks under 50 N, a constant torque 0.3/6 of it, and a spring with a dashpot by its own equations."""
    pair = {"radius_1": 0.5, "radius_2": 0.25, "mass_1": 2.0, "mass_2": 0.5, "inertia_1": 0.25, "inertia_2": 1.0 / 64.0}
    disk = rr.equivalent_disk(**pair, force=50.0)
    given = {"mu_r": 0.3, "angle": 0.0, "g": disk.g, "speed": disk.radius * 1.5, "inertia_ratio": disk.inertia_ratio}
    slowing = 0.3 * (1.0 / 6.0) * 50.0 * (4.0 + 64.0)
    assert rr.against_constant_torque(5e-3, **given).vx / disk.radius == pytest.approx(1.5 - slowing * 5e-3, rel=1e-13)
    found = rr.against_spring(0.3, **given, kr=2.0, beta=0.4 * disk.damping, mass=disk.mass, radius=disk.radius)
    drag = 2.0 * 0.4 * math.sqrt(2.0 / (1.0 / (0.25 + 0.5) + 1.0 / (1.0 / 64.0 + 1.0 / 32.0)))
    run = solve_ivp(
        lambda _, y: [y[1], -68.0 * (2.0 * y[0] + drag * y[1])], (0.0, 0.3), [0.0, 1.5], method="DOP853", rtol=1e-12, atol=1e-14
    )  # fmt: skip
    assert (found.x / disk.radius, found.vx / disk.radius) == pytest.approx((run.y[0, -1], run.y[1, -1]), rel=1e-8)


def test_bad_arguments():
    with pytest.raises(ValueError, match="beta"):
        rr.against_spring(0.0, mu_r=0.1, angle=0.1, speed=1.0, kr=50.0, beta=1.0, **BODY)
