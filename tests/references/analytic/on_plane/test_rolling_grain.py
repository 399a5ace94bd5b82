"""Rolling grains: closed forms against integrals over the shape, the motion against Lagrange's equation integrated in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ninedisk.references.analytic.on_plane.rolling_grain import (
    EllipseShape,
    RoundedPolygon,
    energy_gained,
    forces_at,
    kinetic_of,
    spin_at,
    time_to,
    tipping_slope,
)

SHAPES = [RoundedPolygon(6, 0.5, 0.1), RoundedPolygon(4, 1.3, 0.0), RoundedPolygon(3, 0.8, 0.6), EllipseShape(0.6, 0.4)]
G = 9.81


def outline(shape, k=4000):
    """Points of the whole outline, from the support function alone: ``p n + p' n'``."""
    if isinstance(shape, EllipseShape):
        phi = np.linspace(0.0, 2.0 * np.pi, k, endpoint=False)
        p, q = shape.height(phi), shape.ahead(phi)
        turn = phi
    else:
        corner = np.linspace(0.0, 2.0 * np.pi / shape.faces, k // shape.faces)
        p, q = (np.tile(values, shape.faces) for values in (shape.height(corner), shape.ahead(corner)))
        turn = (corner + (2.0 * np.pi / shape.faces) * np.arange(shape.faces)[:, None]).ravel()
    return np.column_stack([p * np.cos(turn) - q * np.sin(turn), p * np.sin(turn) + q * np.cos(turn)])


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_area_and_gyration_are_the_outline_s(shape):
    x, y = outline(shape).T
    dx, dy = np.roll(x, -1), np.roll(y, -1)
    cross = x * dy - dx * y
    area = 0.5 * cross.sum()
    second = (cross * (x * x + x * dx + dx * dx + y * y + y * dy + dy * dy)).sum() / 12.0
    assert shape.area == pytest.approx(area, rel=3e-6)
    assert shape.gyration == pytest.approx(second / area, rel=3e-6)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_slopes_are_derivatives_and_the_start_is_the_steepest(shape):
    at, step = shape.start + np.linspace(0.1, 0.6, 7), 1e-5
    assert shape.ahead(at) == pytest.approx((shape.height(at + step) - shape.height(at - step)) / (2 * step), rel=1e-8)
    assert shape.bend(at) == pytest.approx((shape.ahead(at + step) - shape.ahead(at - step)) / (2 * step), rel=1e-8)
    every = np.linspace(0.0, 0.9, 9001)
    assert tipping_slope(shape) == pytest.approx((shape.ahead(every) / shape.height(every)).max(), rel=1e-6)


def test_closed_forms_of_the_slope_that_tips():
    for m, r in ((3, 0.0), (4, 0.25), (9, 0.5)):
        assert tipping_slope(RoundedPolygon(m, 0.7, r)) == pytest.approx((1.0 - r) * math.tan(math.pi / m), rel=1e-14)
    assert tipping_slope(EllipseShape(0.6, 0.4)) == pytest.approx((0.36 - 0.16) / 0.48, rel=1e-14)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_motion_is_lagrange_s(shape):
    """``d/dt (M omega) = dL/dphi`` of ``L = M omega^2/2 + g (x sin - p cos)``, M and its slope by differences of the outline's support."""
    angle, start = math.atan(1.2 * tipping_slope(shape)), shape.start + 1e-3
    end = start + (0.4 if isinstance(shape, RoundedPolygon) else 1.5)

    def inertia(phi):
        return shape.gyration + shape.height(phi) ** 2 + shape.ahead(phi) ** 2

    def rates(_, state):
        phi, spin = state
        step = 1e-5
        change = (inertia(phi + step) - inertia(phi - step)) / (2 * step)
        lift = (shape.height(phi + step) - shape.height(phi - step)) / (2 * step)
        pull = G * (math.sin(angle) * shape.height(phi) - math.cos(angle) * lift)
        return [spin, (pull - 0.5 * change * spin**2) / inertia(phi)]

    def reached(_, state):
        return state[0] - end

    reached.terminal = True
    run = solve_ivp(rates, (0.0, 20.0), [start, 0.0], events=reached, rtol=1e-11, atol=1e-13)
    given = {"start": start, "angle": angle, "g": G}
    assert time_to(shape, end, **given) == pytest.approx(float(run.t_events[0][0]), rel=1e-8)
    assert spin_at(shape, run.y[0, 1:], **given) == pytest.approx(run.y[1, 1:], rel=1e-7)
    assert kinetic_of(shape, run.y[0], run.y[1]) == pytest.approx(
        energy_gained(shape, run.y[0], **given), rel=1e-6, abs=1e-10
    )


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_forces_are_those_of_the_centroid_s_acceleration(shape):
    angle, start = math.atan(1.2 * tipping_slope(shape)), shape.start + 1e-3
    given = {"start": start, "angle": angle, "g": G}
    at, step = start + np.linspace(0.05, 0.4, 5), 1e-5

    def velocity(phi):
        return np.stack([shape.height(phi), shape.ahead(phi)]) * spin_at(shape, phi, **given)

    along, off = (velocity(at + step) - velocity(at - step)) / (2 * step) * spin_at(shape, at, **given)
    fn, fs = forces_at(shape, at, **given)
    assert fn == pytest.approx(math.cos(angle) + off / G, rel=1e-7)
    assert fs == pytest.approx(math.sin(angle) - along / G, rel=1e-6)


def test_a_round_polygon_is_a_disk():
    """It rolls with 2/3 g sin: the shear force is a third of the weight's part."""
    shape = RoundedPolygon(7, 0.5, 1.0 - 1e-9)
    fn, fs = forces_at(shape, np.array(0.3), start=0.0, angle=0.2, g=G)
    assert fs == pytest.approx(math.sin(0.2) / 3.0, rel=1e-6)
    assert fn == pytest.approx(math.cos(0.2), rel=1e-6)
    assert shape.gyration == pytest.approx(0.5 * 0.5**2, rel=1e-8)


def test_wrong_input_is_refused():
    for wrong in ((2, 1.0, 0.1), (5, 0.0, 0.1), (5, 1.0, 1.0)):
        with pytest.raises(ValueError, match="not allowed"):
            RoundedPolygon(*wrong)
    with pytest.raises(ValueError, match="not allowed"):
        EllipseShape(0.4, 0.4)
