"""A pushed box: thresholds, moments, work and energy, Newton's law at the edge."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.on_plane.pushed_box import push_start, toppling_box

G = 9.81
BOX = {"half_length": 0.2, "half_height": 0.5, "inertia": 0.11, "g": G}
TIPS = G * 0.2 / 0.9
"""The push 0.9 m above the plane from which on the box topples."""


@pytest.mark.parametrize(
    ("push", "mu", "mode"),
    [
        (0.999 * TIPS, 0.5, "stands"),
        (1.001 * TIPS, 0.5, "topples"),
        (0.101 * G, 0.1, "slides"),
        (0.099 * G, 0.1, "stands"),
        (0.6 * G, 0.1, "slides and topples"),
    ],
)
def test_both_sides_of_each_threshold(push: float, mu: float, mode: str) -> None:
    found = push_start(push=push, height=0.9, mu=mu, **BOX)
    assert found.mode == mode
    if mode != "slides and topples":
        # Newton along and Euler about the centre of mass.
        assert found.acceleration == pytest.approx(push - found.fs, abs=1e-12)
        moment = push * (0.9 - 0.5) + found.fs * 0.5 - found.fn * found.centre
        assert moment == pytest.approx(0.11 * found.toppling, abs=1e-12)


def test_work_is_energy_and_the_edge_bears_what_newton_asks() -> None:
    push, t = 3.0, np.linspace(0.0, 0.4, 4001)
    found = toppling_box(t, push=push, height=0.9, **BOX)
    x = 0.5 * np.sin(found.angle) - 0.2 * np.cos(found.angle)
    z = 0.5 * np.cos(found.angle) + 0.2 * np.sin(found.angle)
    vx, vz = np.gradient(x, t), np.gradient(z, t)
    inner = slice(2, -2)
    kinetic = 0.5 * (vx**2 + vz**2 + 0.11 * found.spin**2)
    work = push * (x - x[0]) - G * (z - z[0]) + push * 0.4 * found.angle
    np.testing.assert_allclose(kinetic[inner], work[inner], atol=2e-6)
    fs, fn = push - np.gradient(vx, t), G + np.gradient(vz, t)
    np.testing.assert_allclose(found.needed[inner], np.abs(fs / fn)[inner], atol=2e-5)
    start = push_start(push=push, height=0.9, mu=0.5, **BOX)
    assert found.spin[1] == pytest.approx(start.toppling * t[1], rel=1e-6)
    assert found.needed[0] == pytest.approx(abs(start.fs) / start.fn, rel=1e-9)


def test_what_stands_or_has_fallen_is_refused() -> None:
    with pytest.raises(ValueError, match="does not topple"):
        toppling_box([0.0], push=0.99 * TIPS, height=0.9, **BOX)
    with pytest.raises(ValueError, match="has fallen long before"):
        toppling_box([1e3], push=2.0 * TIPS, height=0.9, **BOX)
    assert math.isnan(push_start(push=50.0, height=0.9, mu=0.1, **BOX).toppling)
