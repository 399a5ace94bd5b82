"""Bodies that roll off round ones, against Newton and Euler integrated with contact forces, and against published rates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.on_plane.rolling_off import fall_time, falling, rolled_off, saddle

RATES = {1: 27.180, 2: 31.942, 3: 34.090, 5: 35.790, 10: 35.994, 20: 33.996, 50: 29.390, 100: 25.489}
"""Size ratio and growth rate [1/s] of a grain on spheres of 1 cm under 9.81 m/s^2, to the digits given."""


@pytest.mark.parametrize(("ratio", "rate"), RATES.items())
def test_growth_rates_of_the_published_scene(ratio: int, rate: float) -> None:
    found = saddle(radius=0.005 / ratio, held_radius=0.005)
    assert math.sqrt(9.81 * found.arm / found.inertia) == pytest.approx(rate, abs=6e-4)


def test_a_grain_in_a_groove_falls_as_newton_and_euler_say() -> None:
    """Free vectors in space with two contacts that do not slip: their forces follow from the accelerations they must allow."""
    r, big, g, start = 0.3, 1.1, 9.81, 0.2
    found = saddle(radius=r, held_radius=big)
    centres = np.array([[-big, 0.0, 0.0], [big, 0.0, 0.0]])

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        """Two contact forces of three components; their points on the body are at rest, so are accelerations along the surface."""
        x, v, w = state[:3], state[3:6], state[6:9]
        rows, right = [], []
        jacobian = []
        for centre in centres:
            n = (x - centre) / np.linalg.norm(x - centre)
            arm = -r * n
            skew = np.array([[0.0, arm[2], -arm[1]], [-arm[2], 0.0, arm[0]], [arm[1], -arm[0], 0.0]])
            jacobian.append(np.hstack([np.eye(3), skew]))
            # d/dt (v - r w x n) = 0 with n' = (v - (v.n) n)/(R + r)
            turning = (v - (v @ n) * n) / (big + r)
            right.append(r * np.cross(w, turning))
            rows.append(n)
        system = np.vstack(jacobian)
        inverse_mass = np.diag([1.0] * 3 + [1.0 / (0.4 * r**2)] * 3)
        weight = np.concatenate([[0.0, 0.0, -g], np.zeros(3)])
        force = np.linalg.lstsq(system @ inverse_mass @ system.T, np.concatenate(right) - system @ weight, rcond=None)[
            0
        ]
        change = weight + inverse_mass @ system.T @ force
        return np.concatenate([v, change])

    place = found.arm * np.array([0.0, math.sin(start), math.cos(start)])
    rate = math.sqrt(g * found.arm / found.inertia)
    end = float(fall_time(reached=0.9, start=start)) / rate
    times = np.linspace(0.0, end, 9)
    run = solve_ivp(rates, (0.0, end), np.concatenate([place, np.zeros(6)]), t_eval=times, rtol=1e-11, atol=1e-12)
    seen = np.arctan2(run.y[1], run.y[2])
    np.testing.assert_allclose(seen, falling(t=times, rate=rate, start=start), atol=1e-8)
    assert seen[-1] == pytest.approx(0.9, abs=1e-8)


@pytest.mark.parametrize("start", [math.radians(1.0), 0.5])
def test_time_and_angle_are_inverse_and_solve_the_pendulum(start: float) -> None:
    times = np.linspace(0.0, float(fall_time(reached=1.2, start=start)) / 3.0, 8)
    angles = falling(t=times, rate=3.0, start=start)
    run = solve_ivp(
        lambda _, y: [y[1], 9.0 * math.sin(y[0])], (0.0, times[-1]), [start, 0.0], t_eval=times, rtol=1e-12, atol=1e-14
    )
    np.testing.assert_allclose(angles, run.y[0], rtol=1e-8)
    np.testing.assert_allclose(fall_time(reached=angles[1:], start=start), 3.0 * times[1:], rtol=1e-7)
    assert fall_time(reached=0.9 * start, start=start) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("k", "cosine"), [(0.5, 4.0 / 7.0), (0.4, 10.0 / 17.0)])
def test_without_slip_it_leaves_where_books_say(k: float, cosine: float) -> None:
    """At mu = 100 it still slides a little before it leaves."""
    left = rolled_off(mu=100.0, inertia_ratio=k, arm=1.3, g=10.0)
    assert math.cos(left.leaves) == pytest.approx(cosine, abs=3e-4)
    assert left.turned == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(("mu", "k", "start"), [(0.3, 0.5, 0.0), (2.0, 0.4, 0.1), (10.0, 20.0, 0.0)])
def test_rolling_sliding_and_leaving_against_the_equations_integrated(mu: float, k: float, start: float) -> None:
    p, g = 1.3, 10.0
    left = rolled_off(mu=mu, inertia_ratio=k, arm=p, g=g, start=start)

    def load(angle: float, rate: float) -> float:
        return g * math.cos(angle) - p * rate**2

    def rolls(_: float, y: np.ndarray) -> list[float]:
        return [y[1], g * math.sin(y[0]) / ((1.0 + k) * p)]

    def slides(_: float, y: np.ndarray) -> list[float]:
        """The last is the spin's arm times the spin [m/s]."""
        force = load(y[0], y[1])
        return [y[1], (g * math.sin(y[0]) - mu * force) / p, mu * force / k]

    def slips(_: float, y: np.ndarray) -> float:
        return mu * load(y[0], y[1]) - k / (1.0 + k) * g * math.sin(y[0])

    def leaves(_: float, y: np.ndarray) -> float:
        return load(y[0], y[1])

    slips.terminal = leaves.terminal = True  # type: ignore[attr-defined]
    begin = start + 0.1
    first = [begin, math.sqrt(2.0 * g * (math.cos(start) - math.cos(begin)) / ((1.0 + k) * p))]
    one = solve_ivp(rolls, (0.0, 9.0), first, events=slips, rtol=1e-12, atol=1e-13)
    angle, rate = one.y[:, -1]
    two = solve_ivp(slides, (0.0, 9.0), [angle, rate, rate * p], events=leaves, rtol=1e-12, atol=1e-13)
    end, fast, rim = two.y[:, -1]
    np.testing.assert_allclose(left, [angle, end, fast, rim / (fast * p), two.t[-1]], rtol=1e-8)


def test_one_that_slips_at_once_is_refused() -> None:
    with pytest.raises(ValueError, match=r"slips at once"):
        rolled_off(mu=0.01, inertia_ratio=0.5, arm=1.0, g=10.0, start=0.5)
