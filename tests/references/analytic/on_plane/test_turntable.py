"""The ball on a turntable, against equations of motion integrated with friction as the force that rules slip out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.on_plane.turntable import turntable


def test_motion_is_that_of_newton_and_euler() -> None:
    """The force F follows from no slip at every instant, solved for as an unknown: rates of all five momenta at once."""
    turn, k, m, radius, times = 2.0, 0.4, 1.7, 0.3, np.linspace(0.0, 4.0, 9)
    z, x, v = np.array([0.0, 0.0, 1.0]), np.array([1.0, 2.0, 0.0]), np.array([0.7, -0.2, 0.0])
    spin = np.cross(turn * np.cross(z, x) - v, z) / radius

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        v = state[3:6]
        unknown = np.zeros((3, 3))
        for axis in range(2):
            f = np.eye(3)[axis]
            alpha = -radius * np.cross(z, f) / (k * m * radius**2)
            unknown[:, axis] = f / m + np.cross(alpha, -radius * z)
        force = np.zeros(3)
        force[:2] = np.linalg.solve(unknown[:2, :2], (turn * np.cross(z, v))[:2])
        return np.concatenate([v, force / m, -radius * np.cross(z, force) / (k * m * radius**2)])

    found = solve_ivp(rates, (0.0, 4.0), np.concatenate([x, v, spin]), t_eval=times, rtol=1e-11, atol=1e-12)
    truth = turntable(start=x[:2], v=v[:2], turn=turn, t=times)
    np.testing.assert_allclose(truth.x, found.y[:2].T, atol=1e-9)
    np.testing.assert_allclose(truth.v, found.y[3:5].T, atol=1e-9)
    assert truth.rate == pytest.approx(turn * 2.0 / 7.0)
