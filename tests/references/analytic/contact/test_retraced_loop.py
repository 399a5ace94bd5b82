"""Shear along retraced paths against quadrature, and the first-order drift against sums of ends of steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.contact.retraced_loop import (
    passing_drift,
    passing_shear,
    turning_wall_drift,
    turning_wall_shear,
)

AHEAD, ASIDE = 0.2, -0.55
WALL = {"path": 0.03, "angle": 0.07}


def test_shear_of_a_passing_centre_is_the_integral_of_r_dphi():
    path = np.linspace(-0.1, 0.1, 200001)
    left = AHEAD - path
    r, phi = np.hypot(left, ASIDE), np.arctan2(ASIDE, left)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * np.diff(phi))])
    found = passing_shear(path, ahead=AHEAD, aside=ASIDE)
    np.testing.assert_allclose(found - found[0], integral, atol=1e-12)
    assert found[100000] == 0.0
    assert passing_shear(0.02, ahead=AHEAD, aside=-ASIDE) == -passing_shear(0.02, ahead=AHEAD, aside=ASIDE)


def test_the_drift_of_two_small_oscillations():
    """Distance ``r0 + a sin(w t)`` and angle ``b sin(w t)`` drift by ``-(pi/2) a b w dt``: here to first order of the amplitude."""
    amplitude, frequency, dt, r = 1e-5, 7.0, 1e-3, math.hypot(AHEAD, ASIDE)
    a, b = -amplitude * AHEAD / r, amplitude * ASIDE / r**2
    found = passing_drift(amplitude=amplitude, frequency=frequency, ahead=AHEAD, aside=ASIDE, dt=dt)
    assert found == pytest.approx(-0.5 * math.pi * a * b * frequency * dt, rel=1e-8)


@pytest.mark.parametrize("mid", [False, True])
def test_shear_on_a_turning_wall_is_the_integral_of_its_velocity(mid):
    s = np.linspace(0.0, 1.0, 100001)
    radius, overlap = 0.5, 0.05
    c, phi = np.column_stack([0.0 * s, WALL["path"] * s]), WALL["angle"] * s
    u = np.column_stack([-np.sin(phi), np.cos(phi)])
    surface = c - (radius - overlap) * u
    height = -(surface * u).sum(axis=1)
    # The wall's point at the disk's foot, or deeper by half the overlap.
    depth = height + (0.5 * (radius - height) if mid else 0.0)
    arm = -depth[:, None] * u - c
    velocity = np.column_stack([-arm[:, 1], WALL["path"] / WALL["angle"] + arm[:, 0]]) * WALL["angle"]
    rate = velocity[:, 0] * u[:, 1] - velocity[:, 1] * u[:, 0]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(s))])
    found = turning_wall_shear(s, radius=radius, overlap=overlap, mid_overlap=mid, **WALL)
    np.testing.assert_allclose(found, integral, atol=1e-11)


def test_arguments_out_of_range_are_refused():
    with pytest.raises(ValueError, match="aside = 0"):
        passing_shear(0.1, ahead=0.2, aside=0.0)
    with pytest.raises(ValueError, match="dt"):
        passing_drift(amplitude=0.1, frequency=1.0, ahead=0.2, aside=0.1, dt=0.0)
    with pytest.raises(ValueError, match="path"):
        turning_wall_shear(0.1, radius=0.5, overlap=0.1, path=-1.0, angle=0.1, mid_overlap=False)
    with pytest.raises(ValueError, match="period"):
        turning_wall_drift(path=0.1, angle=0.1, period=math.nan, dt=0.1, mid_overlap=False)
