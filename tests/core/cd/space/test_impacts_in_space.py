"""Impacts of spheres and boxes: exact in discrete time, flat and on a corner."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from solids import G, matrix, on_floor, rigid, steps, turn_about

from ninedisk.core import Spheres, SphereScene, simulate

FINE = {"cd.tolerance": 1e-12}
BALL = {"x": [[0.0, 0.0, 0.93]], "radius": 0.5, "mass": 2.0}
BOX = {"x": [[0.0, 0.0, 0.93]], "half_sizes": [[0.4, 0.3, 0.5]], "mass": 2.0}


def heights(z: float, lowest: float, dt: float, count: int, theta: float, e: float | None) -> np.ndarray[Any, Any]:
    """Heights and speeds of a body that bounces, by the scheme's own recurrence."""
    v, rows = 0.0, [(z, 0.0)]
    for _ in range(count):
        free, gap = v - G * dt, z - lowest
        end = free
        if e is None:
            end = max(free, -(gap / dt + (1.0 - theta) * v) / theta)
        elif gap + dt * (theta * free + (1.0 - theta) * v) < 1e-14:
            end = max(free, -e * v if v < 0.0 else -v)
        z, v = z + dt * (theta * end + (1.0 - theta) * v), end
        rows.append((z, v))
    return np.array(rows)


@pytest.mark.parametrize("body", [BALL, BOX])
@pytest.mark.parametrize(("theta", "e"), [(1.0, None), (0.5, None), (0.7, None), (1.0, 0.6), (0.5, 1.0), (1.0, 0.0)])
def test_a_body_falls_and_rebounds_as_the_scheme_has_it(body: dict[str, Any], theta: float, e: float | None) -> None:
    impact: Any = "theta" if e is None else "newton"
    history = simulate(
        on_floor(rigid(e=e), **body), steps(0.01, 90, theta=theta, impact=impact, options=FINE), [(0, 1)], method="cd"
    )
    exact = heights(0.93, 0.5, 0.01, 90, theta, e)
    assert np.abs(history.x[:, 0, 2] - exact[:, 0]).max() < 1e-10
    assert np.abs(history.v[:, 0, 2] - exact[:, 1]).max() < 1e-8
    assert np.abs(history.omega).max() < 1e-8
    impulses = 2.0 * (np.diff(exact[:, 1]) / 0.01 + G)
    assert np.abs(history.fn[1:, 0] - impulses).max() < 1e-5
    assert np.abs(history.wall_force[1:, 0, 2] + impulses).max() < 1e-5


@pytest.mark.parametrize("mu", [0.0, 0.1, 5.0])
@pytest.mark.parametrize("e", [0.0, 0.7])
def test_a_corner_hits_the_floor(mu: float, e: float) -> None:
    """The impulse P of one contact: ``m dv = P``, ``dL = r x P``, Newton's law along the normal, Coulomb's law across it."""
    half, mass, turn = np.array([0.3, 0.4, 0.6]), 2.0, turn_about([1.0, 0.4, -0.3], 0.8)
    frame = matrix(turn)
    corners = frame @ (half[:, None] * np.array(list(product((-1.0, 1.0), repeat=3))).T)
    arm = corners[:, int(np.argmin(corners[2]))]
    moments = mass * (half @ half - half**2) / 3.0
    v = np.array([0.9, -0.4, -2.0])
    scene = on_floor(
        rigid(mu=mu, e=e),
        (0.0, 0.0, 0.0),
        x=[[0.0, 0.0, -arm[2]]],
        half_sizes=[half],
        mass=mass,
        quaternion=[turn],
        v=[v],
    )
    history = simulate(scene, steps(1e-3, 1, impact="newton"), [(0, 1)], method="cd")
    assert history.quaternion is not None
    assert history.moment is not None
    impulse = mass * (history.v[1, 0] - v)
    after = matrix(history.quaternion[1, 0])
    momentum = after @ (moments * (after.T @ history.omega[1, 0]))
    assert momentum == pytest.approx(np.cross(arm, impulse), abs=1e-12)
    assert history.moment[1, 0] * 1e-3 == pytest.approx(np.cross(arm, impulse), abs=1e-9)
    spin = frame @ ((frame.T @ momentum) / moments)
    u = history.v[1, 0] + np.cross(spin, arm)
    assert u[2] == pytest.approx(2.0 * e, abs=1e-8)
    friction = impulse[:2]
    if mu == 5.0:
        mobility = np.array(
            [each / mass + np.cross(frame @ ((frame.T @ np.cross(arm, each)) / moments), arm) for each in np.eye(3)]
        ).T
        assert impulse == pytest.approx(np.linalg.solve(mobility, [-v[0], -v[1], 2.0 * (1.0 + e)]), abs=1e-7)
    else:
        assert np.linalg.norm(friction) == pytest.approx(mu * impulse[2], abs=1e-8)
        assert friction == pytest.approx(-mu * impulse[2] * u[:2] / np.linalg.norm(u[:2]), abs=1e-7)


def test_two_spheres_off_centre_exchange_momentum_and_spin() -> None:
    """Stick under a large mu: at the contact the velocities are equal, and the pair keeps momentum and angular momentum."""
    x = np.array([[0.0, 0.0, 0.0], [0.8, 0.5, 0.331662479]])
    normal = (x[1] - x[0]) / np.linalg.norm(x[1] - x[0])
    x[1] = x[0] + normal
    v, omega = np.array([[1.0, 0.2, 0.0], [-0.5, 0.0, 0.3]]), np.array([[0.0, 1.0, 0.0], [2.0, 0.0, -1.0]])
    mass, moment = np.array([1.0, 3.0]), np.array([0.1, 0.4])
    spheres = Spheres(x=x, v=v, omega=omega, mass=mass, inertia=moment, radius=[0.4, 0.6])
    history = simulate(SphereScene(spheres=spheres, sphere_sphere=rigid(mu=9.0)), steps(1e-3, 1), [(0, 1)], method="cd")
    w, spin = history.v[1], history.omega[1]
    between = w[1] - np.cross(spin[1], 0.6 * normal) - w[0] - np.cross(spin[0], 0.4 * normal)
    assert np.abs(between).max() < 1e-8
    assert mass @ w == pytest.approx(mass @ v, abs=1e-13)

    def angular(v: Any, omega: Any) -> Any:
        return (moment[:, None] * omega + mass[:, None] * np.cross(x, v)).sum(axis=0)

    assert angular(w, spin) == pytest.approx(angular(v, omega), abs=1e-13)
    force = -mass[0] * (w[0] - v[0]) / 1e-3
    assert history.fn[1, 0] == pytest.approx(force @ normal, rel=1e-9)
    assert history.fs[1, 0] == pytest.approx(-(force - (force @ normal) * normal), rel=1e-7)
