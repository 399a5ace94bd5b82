"""Polygons as outlines: corners, faces, areas, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.mass import area_moments, farthest, uniform_grain
from ninedisk.core.nurbs.shapes import polygon, regular_polygon
from ninedisk.references.analytic.rolling_grain import RoundedPolygon


@pytest.mark.parametrize(("faces", "roundness"), [(3, 0.0), (3, 0.4), (4, 0.0), (4, 0.1), (6, 0.5), (12, 0.95)])
def test_regular_polygons(faces: int, roundness: float) -> None:
    """Area, inertia and reach are the closed forms'; every point is where its face or its arc is."""
    curve, shape = regular_polygon(faces, 0.7, roundness=roundness), RoundedPolygon(faces, 0.7, roundness)
    grain = uniform_grain(curve, 2.0)
    assert area_moments(curve).area == pytest.approx(shape.area, rel=1e-14)
    assert area_moments(curve).centroid == pytest.approx((0.0, 0.0), abs=1e-16)
    assert grain.inertia == pytest.approx(2.0 * shape.area * shape.gyration, rel=1e-14)
    assert farthest(curve) == pytest.approx(shape.corner + 0.7 * roundness, rel=1e-15)
    points = curve.evaluate(np.linspace(*curve.breaks[[0, -1]], 997))
    half = np.pi / faces
    angle = (np.arctan2(points[:, 1], points[:, 0]) + 0.5 * np.pi + half) % (2.0 * half) - half
    distance = np.hypot(*points.T)
    x, y = np.abs(distance * np.sin(angle)), distance * np.cos(angle)
    side, inner = shape.corner * np.sin(half), shape.corner * np.cos(half)
    off = np.where(x <= side, y - inner, np.hypot(x - side, y - inner)) - 0.7 * roundness
    assert np.abs(off).max() < 4e-15  # some last places of the coordinates, in the point and in its angle


def test_polygon_has_its_vertices() -> None:
    vertices = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.5, 0.5), (0.0, 1.0)]
    curve = polygon(vertices)
    assert curve.evaluate(np.arange(5.0)) == pytest.approx(np.array(vertices), abs=1e-15)
    assert area_moments(curve).area == pytest.approx(1.5, rel=1e-15)


def test_what_is_refused() -> None:
    with pytest.raises(InvalidSceneError, match=r"shape \(2, 2\)"):
        polygon([(0.0, 0.0), (1.0, 0.0)])
    with pytest.raises(InvalidSceneError, match="clockwise"):
        polygon([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)])
    with pytest.raises(InvalidSceneError, match="faces = 2"):
        regular_polygon(2, 1.0)
    with pytest.raises(InvalidSceneError, match="roundness = 1"):
        regular_polygon(5, 1.0, roundness=1.0)
    with pytest.raises(InvalidSceneError, match="apothem"):
        regular_polygon(5, 0.0)
