"""Steps of one disk between planes: the closed recurrence of a permanent contact, and convergence to the impact's closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.spring_dashpot import restitution_of_beta
from ninedisk.references.exact_steps.normal_contact import Plane, normal_contact_central


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
