"""Steps of one disk between planes: the closed recurrence of a permanent contact, and convergence to the impact's closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.impact.spring_dashpot import restitution_of_beta
from ninedisk.references.exact_steps.normal_contact import Plane, normal_contact_central, normal_contact_theta


def test_a_permanent_contact_turns_by_the_arc_of_half_the_phase():
    """Central differences of an oscillator: cos(n a), sin(a/2) = omega dt/2."""
    n, dt, kn = 400, 1e-3, 1e4
    rest = np.zeros(n + 1)
    found = normal_contact_central((Plane(1, rest, rest, kn),), mass=1.0, g=10.0, y=-2e-3, vy=0.0, dt=dt, n_steps=n)
    turn = 2.0 * math.asin(0.5 * math.sqrt(kn) * dt)
    np.testing.assert_allclose(found.y, -1e-3 - 1e-3 * np.cos(turn * np.arange(n + 1)), atol=1e-14)
    np.testing.assert_allclose(found.fn[:, 0], -kn * found.y, rtol=1e-15)


@pytest.mark.parametrize(("beta", "order"), [(0.0, 2.0), (0.2, 1.0)])
def test_impacts_converge(beta, order):
    """A dashpot's force jumps at the begin, anywhere in a step: first order at least; elastic impacts to second order."""
    errors = []
    for steps in (1000, 4000, 16000):
        dt = 0.1 / steps
        rest = np.zeros(steps + 1)
        found = normal_contact_central(
            (Plane(-1, rest, rest, 1e4, beta),), mass=1.0, g=0.0, y=-0.0123, vy=1.0, dt=dt, n_steps=steps
        )
        errors.append(abs(found.vy[-1] + restitution_of_beta(beta)))
    assert errors[-1] < 2.0 * errors[0] / 16.0**order


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_a_permanent_contact_in_the_theta_scheme(theta):
    """One step as a matrix, from eliminating fn."""
    n, dt, kn, beta, g = 300, 1e-3, 1e4, 0.1, 10.0
    rest = np.zeros(n + 1)
    found = normal_contact_theta(
        (Plane(1, rest, rest, kn, beta),), mass=1.0, g=g, y=-2e-3, vy=0.0, dt=dt, n_steps=n, theta=theta
    )
    c, sag = 2.0 * beta * math.sqrt(kn), g / kn
    # Unknowns (y_1 + sag, v_1): y_1 - theta dt v_1 = y_0 + (1 - theta) dt v_0 and v_1 + (dt kn + c) y_1 = v_0 + c y_0.
    left = np.array([[1.0, -theta * dt], [dt * kn + c, 1.0]])
    right = np.array([[1.0, (1.0 - theta) * dt], [c, 1.0]])
    state = np.array([-2e-3 + sag, 0.0])
    for k in range(n + 1):
        assert (found.y[k] + sag, found.vy[k]) == pytest.approx(state, abs=1e-15)
        state = np.linalg.solve(left, right @ state)


@pytest.mark.parametrize("beta", [0.0, 0.2])
def test_impacts_converge_in_the_theta_scheme(beta):
    errors = []
    for steps in (4000, 8000, 16000):
        rest = np.zeros(steps + 1)
        plane = Plane(-1, rest, rest, 1e4, beta)
        found = normal_contact_theta(
            (plane,), mass=1.0, g=0.0, y=-0.0123, vy=1.0, dt=0.1 / steps, n_steps=steps, theta=0.7
        )
        errors.append(abs(found.vy[-1] + restitution_of_beta(beta)))
    assert errors[0] < 0.01
    assert errors[2] == pytest.approx(errors[0] / 4.0, rel=0.1)


def test_two_planes_bear_at_once_and_one_catches_up():
    """Pressed from both sides the forces balance at rest; a plane that comes nearer meets the disk in the step in which it reaches it."""
    n, dt = 400, 1e-3
    up = np.linspace(-0.01, 0.01, n + 1)
    planes = (Plane(1, up, np.full(n + 1, 0.05), 1e4, 1.0), Plane(-1, np.zeros(n + 1), np.zeros(n + 1), 2e4, 1.0))
    found = normal_contact_theta(planes, mass=1.0, g=0.0, y=-1e-4, vy=0.0, dt=dt, n_steps=n, theta=1.0)
    assert (found.fn[:198] == 0.0).all()
    assert (found.fn[210:] > 0.0).all()
    # The springs share the plane's path, 0.05 m/s, by their compliances; the dashpot of the one at rest feels its own share alone.
    assert found.y[-1] == pytest.approx(1e4 * 0.01 / 3e4, rel=0.1)
    np.testing.assert_allclose(np.diff(found.y)[-1] / dt, 0.05 / 3.0, rtol=1e-3)
    balance = found.fn[1:, 0] - found.fn[1:, 1] - np.diff(found.vy) / dt
    assert np.abs(balance).max() <= 1e-10


def test_a_moving_plane_is_a_plane_at_rest_for_an_observer_on_it():
    n, dt = 300, 1e-3
    t = np.arange(n + 1) * dt
    rest = np.zeros(n + 1)
    common = {"mass": 1.0, "g": 0.0, "dt": dt, "n_steps": n}
    one = normal_contact_central((Plane(1, rest, rest, 1e4, 0.3),), y=0.05, vy=-1.0, **common)
    other = normal_contact_central((Plane(1, t, rest + 1.0, 1e4, 0.3),), y=0.05, vy=0.0, **common)
    np.testing.assert_allclose(other.y - t, one.y, atol=1e-14)
    np.testing.assert_allclose(other.fn, one.fn, atol=1e-9)


def test_arguments_out_of_range_are_refused():
    with pytest.raises(ValueError, match="dt"):
        normal_contact_central((), mass=1.0, g=0.0, y=0.0, vy=0.0, dt=0.0, n_steps=1)
