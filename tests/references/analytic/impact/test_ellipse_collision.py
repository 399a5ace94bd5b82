"""Work of the chord's force: nothing on circles and in mirror-symmetric collisions, the same whichever body comes first."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ninedisk.references.analytic.impact.ellipse_collision import (
    MovingEllipse,
    chord_work,
    gap_and_direction,
    touching_time,
)

ONE = MovingEllipse(1.0, 0.6, 2.0, 0.7, (-1.3, 0.0), (0.5, 0.1), 0.5, 0.3)
TWO = MovingEllipse(0.9, 0.5, 1.5, 0.4, (1.2, 0.25), (-0.5, 0.1), -0.9, -0.2)
GIVEN = {"kn": 1e4, "until": 2.0}


def test_circles_keep_their_energy_and_touch_when_they_should():
    one, two = (replace(body, a=0.6, b=0.6) for body in (ONE, TWO))
    assert chord_work(one, two, **GIVEN).change == 0.0
    t = touching_time(one, two, 2.0)
    assert np.hypot(*(two.centre(t) - one.centre(t))) == pytest.approx(1.2, rel=1e-12)


def test_neither_body_comes_first():
    """Nor does a turn of the whole scene, or its mirror image, matter."""
    work = chord_work(ONE, TWO, **GIVEN)
    assert chord_work(TWO, ONE, **GIVEN) == pytest.approx(work, rel=1e-9)
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, s], [-s, c]])
    turned = [
        replace(body, x=np.array(body.x) @ turn, v=np.array(body.v) @ turn, angle=body.angle + 0.7)
        for body in (ONE, TWO)
    ]
    assert chord_work(*turned, **GIVEN) == pytest.approx(work, rel=1e-9)
    flip = np.array([1.0, -1.0])
    mirror = [
        replace(body, x=np.array(body.x) * flip, v=np.array(body.v) * flip, angle=-body.angle, spin=-body.spin)
        for body in (ONE, TWO)
    ]
    assert chord_work(*mirror, **GIVEN) == pytest.approx(work, rel=1e-9)
    assert abs(work.change) > 1e-4


def test_work_and_depth_fall_as_the_root_of_the_stiffness():
    soft, stiff = (np.array(chord_work(ONE, TWO, kn=kn, until=2.0)) for kn in (1e3, 4e3))
    assert soft / stiff == pytest.approx(2.0, rel=1e-12)


def test_curvature_and_its_slope_are_those_of_the_outline():
    phi, step = 0.8, 1e-5
    k, slope = ONE.curvature(phi, 0.0)
    before, after = (ONE.curvature(phi + off, 0.0)[0] for off in (-step, step))
    assert slope == pytest.approx((after - before) / (2.0 * step) * k, rel=1e-8)
    height = [float(ONE.support(np.array(phi + off), 0.0)[0]) for off in (-1e-4, 0.0, 1e-4)]
    assert 1.0 / k == pytest.approx(height[1] + (height[0] - 2.0 * height[1] + height[2]) / 1e-8, rel=1e-6)


def test_ellipses_that_do_not_meet_are_refused():
    gap, phi = gap_and_direction(ONE, TWO, 0.0)
    assert gap > 0.0
    assert abs(phi) < 1.0
    with pytest.raises(ValueError, match="touch before"):
        chord_work(ONE, TWO, kn=1.0, until=1e-3)
