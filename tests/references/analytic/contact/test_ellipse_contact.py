"""Overlap of ellipses: circles, mirror images, and 40 digits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.contact.ellipse_contact import Ellipse, ellipse_overlap, ellipse_separation


def circle(radius: float, x: float, y: float) -> Ellipse:
    return Ellipse(radius, radius, (x, y), 0.3 * radius)


@pytest.mark.parametrize("depth", [1e-11, 1e-6, 1e-3, 0.2])
@pytest.mark.parametrize("path", [0.0, 0.7, 2.9, -1.6])
def test_circles(depth: float, path: float) -> None:
    d = 1.5 - depth
    x, y = d * math.cos(path), d * math.sin(path)
    expected = 1.5 - math.hypot(x, y)
    assert ellipse_overlap(circle(1.0, 0.0, 0.0), circle(0.5, x, y)) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("depth", [1e-9, 1e-4, 0.1])
def test_mirror_images(depth: float) -> None:
    """The chord of an ellipse and its mirror image lies on the mirror: the overlap is twice what sticks out beyond it."""
    a, b, turn = 1.0, 0.5, 0.6
    reach = math.hypot(a * math.cos(turn), b * math.sin(turn))
    one = Ellipse(a, b, (0.0, 0.0), turn)
    two = Ellipse(a, b, (2.0 * reach - depth, 0.0), math.pi - turn)
    assert ellipse_overlap(one, two) == pytest.approx(2.0 * reach - two.centre[0], abs=1e-15)


def test_forty_digits() -> None:
    """Against the same equations in 40 digits, solved by another method: Newton's, for both points of intersection at once."""
    mp = pytest.importorskip("mpmath")
    mp.mp.dps = 40
    rng = np.random.default_rng(3)
    for depth in (1e-3, 0.02, 0.08):
        a, b, c, d, s = (float(v) for v in rng.uniform(0.5, 1.0, 5))
        one, two = Ellipse(a, b, (0.0, 0.0), s), Ellipse(c, d, (0.0, 0.0), -2.0 * s)
        n = np.array([0.6, 0.8])
        reach = one.support(n) + two.support(n)
        # Extreme points along n do not face each other: shift until they do.
        foot = [_extreme(e, sign * n) for e, sign in ((one, 1.0), (two, -1.0))]
        two = Ellipse(c, d, tuple(foot[0] - foot[1] - depth * n), -2.0 * s)
        assert reach > depth

        def level(e: Ellipse, x: object, y: object) -> object:
            cos, sin = mp.cos(mp.mpf(e.angle)), mp.sin(mp.mpf(e.angle))
            dx, dy = x - mp.mpf(e.centre[0]), y - mp.mpf(e.centre[1])
            return ((cos * dx + sin * dy) / e.a) ** 2 + ((cos * dy - sin * dx) / e.b) ** 2 - 1

        half = math.sqrt(depth)
        middle, t = foot[0] - 0.5 * depth * n, np.array([-n[1], n[0]])
        pair = (one, two)

        def both(x: object, y: object, pair: tuple[Ellipse, Ellipse] = pair) -> tuple[object, object]:
            return level(pair[0], x, y), level(pair[1], x, y)

        ends = [mp.findroot(both, tuple(float(v) for v in middle + path * half * t)) for path in (-0.5, 0.5)]
        cx, cy = ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]
        length = mp.sqrt(cx**2 + cy**2)
        assert length > half / 2
        nx, ny = cy / length, -cx / length

        def support(e: Ellipse) -> object:
            cos, sin = mp.cos(mp.mpf(e.angle)), mp.sin(mp.mpf(e.angle))
            return mp.sqrt((e.a * (cos * nx + sin * ny)) ** 2 + (e.b * (cos * ny - sin * nx)) ** 2)  # noqa: B023

        expected = support(one) + support(two) - abs(two.centre[0] * nx + two.centre[1] * ny)
        assert abs(float(expected - mp.mpf(ellipse_overlap(one, two)))) <= 4e-16


def _extreme(e: Ellipse, n: np.ndarray) -> np.ndarray:
    c, s = math.cos(e.angle), math.sin(e.angle)
    p, q = e.a**2 * (c * n[0] + s * n[1]), e.b**2 * (c * n[1] - s * n[0])
    return np.array([c * p - s * q, s * p + c * q]) / e.support(n)


def test_refusals() -> None:
    one = Ellipse(1.0, 0.5, (0.0, 0.0), 0.0)
    for two in (
        Ellipse(1.0, 0.5, (3.0, 0.0), 0.0),
        Ellipse(1.0, 0.5, (0.0, 0.0), 1.57),
        Ellipse(9.0, 9.0, (0.0, 0.0), 0.0),
    ):
        with pytest.raises(ValueError, match="do not intersect in two points"):
            ellipse_overlap(one, two)
    with pytest.raises(ValueError, match=r"a = 0\.0 is not allowed"):
        Ellipse(0.0, 1.0, (0.0, 0.0), 0.0)


def test_the_separation_is_that_of_circles_and_of_a_line_along_an_axis() -> None:
    """Circles: centre distance less radii; ellipses whose centres lie on a common axis: as far as their vertices are."""
    assert ellipse_separation(Ellipse(1.0, 1.0, (0.0, 0.0), 0.4), Ellipse(2.0, 2.0, (3.0, 4.0), 0.0)) == pytest.approx(
        2.0
    )
    turned = Ellipse(2.0, 1.2, (0.0, 0.0), 0.7)
    along = (5.0 * math.cos(0.7), 5.0 * math.sin(0.7))
    assert ellipse_separation(turned, Ellipse(1.5, 1.0, along, 0.7)) == pytest.approx(1.5)
    touching = (3.5 * math.cos(0.7), 3.5 * math.sin(0.7))
    assert abs(ellipse_separation(turned, Ellipse(1.5, 1.0, touching, 0.7))) < 1e-12
    assert ellipse_separation(turned, Ellipse(0.5, 0.4, (0.1, 0.0), 0.2)) < -1.0
