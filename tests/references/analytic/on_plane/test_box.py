"""A box on a plane: thresholds of standing, sliding and tipping, and what they meet at."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.on_plane.box import box_start, stopping_box, tipping_box

B, H, G = 0.2, 0.5, 10.0
INERTIA = (B * B + H * H) / 3.0
BOX = {"half_length": B, "half_height": H, "inertia": INERTIA, "g": G}


@pytest.mark.parametrize(
    ("mu", "tangent", "mode"),
    [
        (0.3, 0.29, "stands"), (0.3, 0.31, "slides"), (0.39, 0.45, "slides"), (0.8, 0.39, "stands"), (0.8, 0.41, "tips"),
        (0.41, 0.9, "slides and tips"),
    ],
)  # fmt: skip
def test_mode(mu: float, tangent: float, mode: str) -> None:
    assert box_start(mu=mu, angle=math.atan(tangent), **BOX).mode == mode


def test_forces_and_accelerations_obey_newton_and_euler() -> None:
    for mu, tangent in ((0.3, 0.2), (0.3, 0.5), (0.8, 0.5), (0.41, 0.9)):
        angle = math.atan(tangent)
        found = box_start(mu=mu, angle=angle, **BOX)
        assert found.acceleration == pytest.approx(G * math.sin(angle) - found.fs)
        assert found.fn - G * math.cos(angle) == pytest.approx(B * found.tipping)
        # About the centre of mass: the pressure's centre turns back, friction over.
        assert H * found.fs - found.centre * found.fn == pytest.approx(INERTIA * found.tipping, abs=1e-12)
        assert found.fs <= mu * found.fn * (1.0 + 1e-12)


def test_a_box_that_tips_keeps_its_energy() -> None:
    angle, t = math.radians(30.0), np.linspace(0.0, 0.5, 11)
    found = tipping_box(t, angle=angle, **BOX)
    about_edge = INERTIA + B * B + H * H
    turned = angle + found.angle
    height = H * np.cos(turned) + B * np.sin(turned)
    energy = 0.5 * about_edge * found.spin**2 + G * height
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    first = box_start(mu=1.0, angle=angle, **BOX)
    assert found.spin[1] == pytest.approx(first.tipping * t[1], rel=1e-2)
    assert found.needed[0] == pytest.approx(first.fs / first.fn, rel=1e-12)


def test_stop() -> None:
    path, speed = stopping_box([0.0, 0.25, 0.5, 9.0], mu=0.3, speed=1.5, g=G)
    np.testing.assert_allclose(path, [0.0, 0.28125, 0.375, 0.375], rtol=1e-14)
    np.testing.assert_allclose(speed, [1.5, 0.75, 0.0, 0.0], atol=1e-15)
