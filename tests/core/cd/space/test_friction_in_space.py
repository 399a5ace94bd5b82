"""Blocks and spheres on planes: stick, slip in every direction, tipping, rolling."""

from __future__ import annotations

import numpy as np
import pytest
from solids import G, on_floor, rigid, slope, steps, turn_about

from ninedisk.core import simulate

DIRECTIONS = [0.0, 0.4, 0.25 * np.pi, 2.5, -1.9]
FLAT = {"x": [[0.0, 0.0, 0.2]], "half_sizes": [[0.5, 0.6, 0.2]], "mass": 3.0}


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_block_slides_down_a_slope_or_sticks(direction: float) -> None:
    angle, dt, n = np.radians(20.0), 0.01, np.arange(51)
    along = np.array([np.cos(direction), np.sin(direction), 0.0])
    for mu in (0.3, 0.4):
        scene = on_floor(rigid(mu=mu), slope(angle, direction), **FLAT)
        history = simulate(scene, steps(dt, 50), [(0, 1)], method="cd")
        a = max(G * (np.sin(angle) - mu * np.cos(angle)), 0.0)
        assert np.abs(history.v[:, 0] - np.outer(a * n * dt, along)).max() < 1e-7
        assert np.abs(history.x[:, 0] - history.x[0, 0] - np.outer(0.5 * a * dt**2 * n * (n + 1), along)).max() < 1e-7
        assert np.abs(history.omega).max() < 1e-7
        assert history.fn[1:, 0] == pytest.approx(3.0 * G * np.cos(angle), rel=1e-6)
        assert np.abs(history.fs[1:, 0] + min(mu * np.cos(angle), np.sin(angle)) * 3.0 * G * along).max() < 1e-5


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_block_stops_after_its_path_and_does_not_turn(direction: float) -> None:
    """``v_n = v0 - mu g n dt``, in the last step 0: friction is the same in all directions, that of a circular cone."""
    mu, speed, dt = 0.35, 1.7, 0.02
    along = np.array([np.cos(direction), np.sin(direction), 0.0])
    turn = turn_about([0.0, 0.0, 1.0], 0.3)
    scene = on_floor(rigid(mu=mu), **FLAT, v=[speed * along], quaternion=[turn])
    history = simulate(scene, steps(dt, 40), method="cd")
    v = np.maximum(speed - mu * G * dt * np.arange(41), 0.0)
    assert np.abs(history.v[:, 0] - np.outer(v, along)).max() < 1e-7
    path = np.linalg.norm(history.x[-1, 0] - history.x[0, 0])
    assert path == pytest.approx(dt * v[1:].sum(), abs=1e-7)
    assert path == pytest.approx(speed**2 / (2.0 * mu * G), rel=0.08)
    assert np.abs(history.omega).max() < 1e-6


@pytest.mark.parametrize("sliding", ["associated", "coulomb"])
def test_a_box_tips_where_the_slope_exceeds_its_base_over_its_height(sliding: str) -> None:
    """The first step about the lower edge: ``w = dt m g (h sin - b cos)/(I + m (b^2 + h^2))``."""
    b, h, mass = 0.2, 0.5, 2.0
    moment = mass * (b * b + h * h) / 3.0
    for ratio in (0.99, 1.01, 1.3):
        angle = np.arctan(ratio * b / h)
        scene = on_floor(rigid(mu=3.0), slope(angle, 0.0), x=[[0.0, 0.0, h]], half_sizes=[[b, 0.3, h]], mass=mass)
        history = simulate(scene, steps(1e-3, 5, sliding=sliding), method="cd")
        drive = mass * G * (h * np.sin(angle) - b * np.cos(angle))
        rate = max(drive / (moment + mass * (b * b + h * h)), 0.0)
        assert history.omega[1, 0] == pytest.approx([0.0, 1e-3 * rate, 0.0], abs=1e-9)
        if ratio < 1.0:
            assert np.abs(history.v).max() < 1e-9


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_sphere_slides_until_it_rolls_at_five_sevenths(direction: float) -> None:
    mu, speed, radius, dt = 0.25, 2.0, 0.3, 0.01
    along = np.array([np.cos(direction), np.sin(direction), 0.0])
    scene = on_floor(rigid(mu=mu), x=[[0.0, 0.0, radius]], radius=radius, mass=1.5, v=[speed * along])
    history = simulate(scene, steps(dt, 40), method="cd")
    v = np.maximum(speed - mu * G * dt * np.arange(41), 5.0 / 7.0 * speed)
    assert np.abs(history.v[:, 0] - np.outer(v, along)).max() < 1e-7
    rolling = np.cross([0.0, 0.0, 1.0], along) * 5.0 / 7.0 * speed / radius
    assert history.omega[-1, 0] == pytest.approx(rolling, abs=1e-6)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_under_the_associated_rule_a_sliding_block_lifts_by_mu_times_its_slip(direction: float) -> None:
    """From rest on a slope, with ``r = mu^2/(1 + mu^2)``: ``v_n = a dt (n - mu^2 (1 - r^n))`` and the gap is ``mu dt v_n``."""
    mu, dt, angle, n = 0.3, 0.01, np.radians(20.0), np.arange(31)
    history = simulate(
        on_floor(rigid(mu=mu), slope(angle, direction), **FLAT),
        steps(dt, 30, sliding="associated"),
        [(0, 1)],
        method="cd",
    )
    r, a = mu**2 / (1.0 + mu**2), G * (np.sin(angle) - mu * np.cos(angle))
    v = a * dt * (n - mu**2 * (1.0 - r**n))
    along = np.array([np.cos(direction), np.sin(direction)])
    assert np.abs(history.v[:, 0, :2] - np.outer(v, along)).max() < 1e-7
    assert np.abs(history.gap[:, 0] - mu * dt * v).max() < 1e-8
    assert np.abs(history.v[:, 0, 2] - mu * a * dt * (1.0 - r**n)).max() < 1e-7
