"""Areas, centroids and moments of inertia against closed forms, and the error that a fit states."""

from __future__ import annotations

import numpy as np
import pytest
from nurbs_shapes_of_tests import outline, periodic, ring

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import area_moments, centred
from ninedisk.core.nurbs.shapes import ellipse, fitted

ROUND_OFF = 1e-14
"""Sums of 512 terms near 1: fifty roundings."""


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (2.0, 1.0), (1.0, 5.0), (0.3, 0.02)])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (3.0, -7.0)])
def test_moments_of_ellipses(a: float, b: float, shift: tuple[float, float]) -> None:
    moments = area_moments(ellipse(a, b).moved(shift=shift, angle=0.7))
    # Away from the origin the coordinates themselves are rounded, by the distance over the size.
    room = ROUND_OFF * (1.0 + np.hypot(*shift) / min(a, b))
    assert moments.area == pytest.approx(np.pi * a * b, rel=room)
    assert np.abs(moments.centroid - shift).max() <= room * max(a, b)
    assert moments.second_moment == pytest.approx(np.pi * a * b * (a * a + b * b) / 4.0, rel=room)


def test_moments_of_a_polygon() -> None:
    """A right-angled triangle as a curve of degree 1; the polar moment is b h (b^2 + h^2)/36."""
    b, h = 3.0, 2.0
    triangle = NurbsCurve(degree=1, knots=[0, 0, 1, 2, 3, 3], points=[(0, 0), (b, 0), (0, h), (0, 0)])
    moments = area_moments(triangle)
    assert moments.area == pytest.approx(b * h / 2.0, rel=ROUND_OFF)
    assert moments.centroid == pytest.approx([b / 3.0, h / 3.0], rel=ROUND_OFF)
    assert moments.second_moment == pytest.approx(b * h * (b * b + h * h) / 36.0, rel=ROUND_OFF)


def test_quadrature_has_converged_on_rational_curves() -> None:
    weights = np.random.default_rng(1).uniform(0.4, 2.5, 12)
    curve = periodic(ring(12, 2), 4, weights)
    coarse, usual, fine = (area_moments(curve, nodes) for nodes in (4, 16, 32))
    assert usual.area == pytest.approx(fine.area, rel=ROUND_OFF)
    assert usual.second_moment == pytest.approx(fine.second_moment, rel=ROUND_OFF)
    assert abs(coarse.second_moment / fine.second_moment - 1.0) > 1e-13


def test_centred_outline_has_its_centroid_at_the_origin() -> None:
    curve = periodic(ring(12, 2) + np.array([5.0, -3.0]), 3)
    assert np.abs(area_moments(centred(curve)).centroid).max() <= ROUND_OFF * 6.0


def flower(angle: np.ndarray) -> np.ndarray:
    return 1.0 + 0.15 * np.cos(3.0 * angle) + 0.05 * np.sin(5.0 * angle)


def distance_from(polyline: np.ndarray, point: np.ndarray) -> float:
    """Distance of a point from the segments next to the nearest vertex."""
    k = int(np.argmin(np.hypot(*(polyline - point).T)))
    best = np.inf
    for low, high in ((k - 1, k), (k, (k + 1) % len(polyline))):
        along = polyline[high] - polyline[low]
        part = np.clip((point - polyline[low]) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        best = min(best, float(np.hypot(*(polyline[low] + part * along - point))))
    return best


FLOWER_AREA = np.pi * (1.0 + (0.15**2 + 0.05**2) / 2.0)


@pytest.mark.parametrize("n", [20, 40])
def test_fit_of_an_outline_is_as_close_as_it_says(n: int) -> None:
    """No point of the outline, those between the vertices included, is farther from the curve than stated; area and inertia follow.

    With an error e everywhere the area can be off by e times the perimeter, the polar moment by e r^2 times it.
    """
    fit = fitted(outline(flower), n)
    fine = fit.curve.evaluate(np.linspace(0.0, n, 20_001))
    truth = outline(flower, 4_000)
    distance = max(distance_from(fine, point) for point in truth[::41])
    assert distance <= 1.05 * fit.largest + 1e-7  # the fine polyline's own chords
    assert 0.0 < fit.rms <= fit.largest
    moments = area_moments(fit.curve)
    assert abs(moments.area - FLOWER_AREA) <= fit.largest * 2.0 * np.pi * 1.1
    angle = 2.0 * np.pi * np.arange(4_000) / 4_000
    about_origin = float(np.mean(flower(angle) ** 4)) * np.pi / 2.0
    arm = 2.0 * np.pi / 3.0 * np.array([np.mean(flower(angle) ** 3 * f(angle)) for f in (np.cos, np.sin)]) / FLOWER_AREA
    polar = about_origin - FLOWER_AREA * float(arm @ arm)
    assert abs(moments.second_moment - polar) <= fit.largest * 2.0 * np.pi * 1.2**3


def test_fit_converges_with_the_fourth_power_of_the_spacing() -> None:
    errors = [fitted(outline(flower), n).rms for n in (30, 60)]
    assert 3.5 <= np.log2(errors[0] / errors[1]) <= 5.0


@pytest.mark.parametrize(
    ("points", "n", "message"),
    [
        (np.zeros((10, 3)), 5, "shape"),
        (outline(flower), 3, "n = 3"),
        (outline(flower, 10), 10, "n = 10"),
        (np.repeat(outline(flower, 10), 2, axis=0), 8, "repeated"),
        (outline(flower)[::-1], 20, "clockwise"),
    ],
)
def test_outlines_that_cannot_be_fitted(points: np.ndarray, n: int, message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        fitted(points, n)
