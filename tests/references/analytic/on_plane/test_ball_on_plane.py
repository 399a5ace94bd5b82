"""A ball on a plane against Newton's and Euler's equations, integrated with vectors and moments as they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.on_plane.ball_on_plane import (
    against_twisting,
    slide_and_roll,
    slide_time,
    slip_of,
    twist_time,
)

Z = np.array([0.0, 0.0, 1.0])


def ball(force_of, t, *, radius, mass, x, v, w):  # type: ignore[no-untyped-def]
    """Newton and Euler for a force at the lowest point, which may depend on place, velocity and that point's velocity."""
    inertia = 0.4 * mass * radius**2

    def rate(_, y):  # type: ignore[no-untyped-def]
        r, v, w = y[:3], y[3:6], y[6:]
        force = force_of(r, v, v + np.cross(w, -radius * Z))
        return np.concatenate([v, force / mass, np.cross(-radius * Z, force) / inertia])

    found = solve_ivp(rate, (0.0, t), [*x, *v, *w], rtol=1e-11, atol=1e-12, method="DOP853")
    return found.y[:3, -1], found.y[3:6, -1], found.y[6:, -1]


def test_a_thrown_ball_against_its_equations_of_motion():
    mu, g, radius, mass = 0.3, 9.81, 0.4, 1.7
    velocity, spin = (1.0, 0.4), (-3.0, 2.0, 5.0)
    end = slide_time(slip=float(np.hypot(*slip_of(velocity, spin, radius))), mu=mu, g=g)

    def friction(_, __, u):  # type: ignore[no-untyped-def]
        return -mu * mass * g * np.array([*u[:2], 0.0]) / np.hypot(*u[:2])

    for part in (0.3, 0.9):
        x, v, w = ball(friction, part * end, radius=radius, mass=mass, x=(0, 0, 0), v=(*velocity, 0.0), w=spin)
        found = slide_and_roll(part * end, mu=mu, g=g, radius=radius, velocity=velocity, spin=spin)
        np.testing.assert_allclose(found.x, x[:2], atol=1e-9)
        np.testing.assert_allclose(found.v, v[:2], atol=1e-9)
        np.testing.assert_allclose(found.spin, w, atol=1e-8)
        np.testing.assert_allclose(found.slip, slip_of(v[:2], w, radius), atol=1e-8)
    late = slide_and_roll([end, 2.0 * end], mu=mu, g=g, radius=radius, velocity=velocity, spin=spin)
    for k in range(2):
        np.testing.assert_allclose(slip_of(late.v[k], late.spin[k], radius), 0.0, atol=1e-14)
    np.testing.assert_allclose(late.x[1] - late.x[0], end * late.v[0], rtol=1e-14)
    assert late.spin[-1, 2] == 5.0


def test_five_sevenths_after_two_sevenths():
    thrown = slide_and_roll([2.0 / (7.0 * 0.3 * 10.0), 1.0], mu=0.3, g=10.0, radius=0.5, velocity=(1.0, 0.0))
    np.testing.assert_allclose(thrown.v[:, 0], 5.0 / 7.0, rtol=1e-15)
    np.testing.assert_allclose(thrown.spin[:, 1], 10.0 / 7.0, rtol=1e-15)


def test_twisting_takes_the_angular_momentum():
    given = {"mu_t": 0.05, "g": 10.0, "radius": 0.5}
    end = twist_time(spin=-4.0, **given)
    mass = 3.0
    torque = 0.05 * 0.5 * mass * 10.0
    assert end == pytest.approx(0.4 * mass * 0.25 * 4.0 / torque)
    np.testing.assert_allclose(
        against_twisting([0.0, 0.25 * end, end, 2 * end], spin=-4.0, **given), [-4.0, -3.0, 0.0, 0.0], atol=1e-14
    )
    assert not against_twisting([0.0, 1.0], spin=0.0, **given).any()


@pytest.mark.parametrize(
    ("call", "given", "word"),
    [
        (slide_and_roll, {"t": 1.0, "mu": 0.0, "g": 1.0, "radius": 1.0, "velocity": (1.0, 0.0)}, "mu"),
        (twist_time, {"mu_t": -1.0, "spin": 1.0, "g": 1.0, "radius": 1.0}, "mu_t"),
    ],
)
def test_what_is_out_of_range_is_named(call, given, word):  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=word):
        call(**given)
