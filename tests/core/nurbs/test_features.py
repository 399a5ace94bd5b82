"""Features of outlines: all nearest places are found, gaps pass through 0 smoothly, straight parts meet at their vertices."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from nurbs_shapes_of_tests import peanut, periodic, ring
from scipy.ndimage import minimum_filter

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.curve_kernels import sample
from ninedisk.core.nurbs.features import NurbsFeatures
from ninedisk.core.nurbs.features_kernels import DEEPEST
from ninedisk.core.nurbs.shapes import disk, ellipse
from ninedisk.core.nurbs.state import FeatureRows
from ninedisk.core.nurbs.table import joined_tables

FloatArray = NDArray[np.float64]

SQUARE = periodic(np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]), 1)
TRIANGLE = periodic(np.array([[1.0, 0.0], [-0.5, 0.8], [-0.5, -0.8]]), 1)
SHAPES = (disk(1.0), ellipse(1.0, 0.6), peanut(), periodic(ring(20, 3), 3), SQUARE, TRIANGLE)
TABLE = joined_tables([curve.table for curve in SHAPES])
PAIR = np.array([[0, 1]])
DISK, ELLIPSE, PEANUT, WAVY, BLOCK, WEDGE = range(6)
REACH = 0.3


def between(a: int, b: int, x: FloatArray, angle: FloatArray, reach: float = REACH) -> FeatureRows:
    return NurbsFeatures(TABLE, np.array([a, b])).of_pairs(x, angle, PAIR, reach)[1]


def points(shape: int, x: FloatArray, angle: float, k: int = 1200) -> FloatArray:
    """Points of an outline, among them all its corners."""
    spans = int(TABLE.first_span[shape + 1] - TABLE.first_span[shape])
    at, out = np.arange(k) * spans / k, np.empty((k, 6))
    sample(TABLE, shape, at.astype(np.int64), at - np.floor(at) - 0.5, out)
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(out[:, :2] @ np.array([[c, s], [-s, c]]) + x)


def random_pairs(seed: int, n: int) -> list[tuple[int, int, FloatArray, FloatArray]]:
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(n):
        way, angle = rng.uniform(0.0, 6.3), rng.uniform(0.0, 6.3, 2)
        x = np.array([[3.0, -2.0], [3.0, -2.0] + rng.uniform(1.2, 2.6) * np.array([np.cos(way), np.sin(way)])])
        found.append((*(int(k) for k in rng.integers(0, len(SHAPES), 2)), x, angle))
    return found


def missed(pairs: list[tuple[int, int, FloatArray, FloatArray]]) -> tuple[int, int]:
    """Local minima of the distance over all pairs of 1200 points a side, and how many of them have no feature nearby."""
    total = lost = 0
    for a, b, x, angle in pairs:
        one, other = points(a, x[0], angle[0]), points(b, x[1], angle[1])
        distance = np.hypot(one[:, None, 0] - other[None, :, 0], one[:, None, 1] - other[None, :, 1])
        if distance.min() < 0.02:
            continue
        rows = between(a, b, x, angle)
        lowest = (distance == minimum_filter(distance, size=9, mode="wrap")) & (distance < 0.97 * REACH)
        for i, j in zip(*np.nonzero(lowest), strict=True):
            total += 1
            off = np.hypot(*(rows.first + x[0] - one[i]).T) + np.hypot(*(rows.second + x[1] - other[j]).T)
            # Two steps of 2 pi/1200 a side, and the flatness of a minimum: a feature elsewhere is 0.1 and more away.
            lost += not len(off) or bool(off.min() > 0.05)
    return total, lost


def test_no_nearest_place_is_missed() -> None:
    total, lost = missed(random_pairs(1, 150))
    assert total > 30
    assert lost == 0


def test_the_search_for_missed_places_sees_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted: without vertices, corners are missed."""
    first = NurbsFeatures.__init__

    def without(self: NurbsFeatures, *given: object) -> None:
        first(self, *given)  # type: ignore[arg-type]
        self.vertices = self.vertices._replace(first=np.zeros_like(self.vertices.first))

    monkeypatch.setattr(NurbsFeatures, "__init__", without)
    assert missed(random_pairs(1, 150))[1] > 2


def test_disks_have_the_gap_of_circles() -> None:
    """Four roundings of coordinates near 3."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        way, d = rng.uniform(0.0, 6.3), rng.uniform(1.96, 2.29)
        n = np.array([np.cos(way), np.sin(way)])
        x = np.array([[3.0, 1.0], [3.0, 1.0] + d * n])
        rows = between(DISK, DISK, x, rng.uniform(0.0, 6.3, 2))
        assert rows.gap == pytest.approx([np.hypot(*(x[1] - x[0])) - 2.0], abs=3e-15)
        assert rows.normal[0] == pytest.approx(n, abs=2e-15)
        assert rows.first[0] == pytest.approx(n, abs=2e-15)
        assert rows.second[0] == pytest.approx(-n, abs=2e-15)


@pytest.mark.parametrize(
    "shapes", [(ELLIPSE, ELLIPSE), (ELLIPSE, WAVY), (PEANUT, ELLIPSE), (BLOCK, ELLIPSE), (BLOCK, WEDGE)]
)
def test_gaps_pass_through_zero(shapes: tuple[int, int]) -> None:
    """Along the normal a feature stays where it is and its gap changes by the way: apart, touching, overlapping."""
    rng = np.random.default_rng(3)
    seen = 0
    while seen < 6:
        angle, way = rng.uniform(0.0, 6.3, 2), rng.uniform(0.0, 6.3)
        x = np.array([[0.0, 0.0], [2.2 * np.cos(way), 2.2 * np.sin(way)]])
        rows = between(*shapes, x, angle, 0.6)
        if not len(rows.gap):
            continue
        seen += 1
        k = int(np.argmin(rows.gap))
        for gap in (1e-3, 1e-12, 0.0, -1e-12, -1e-3):
            moved = x.copy()
            moved[1] += (gap - rows.gap[k]) * rows.normal[k]
            found = between(*shapes, moved, angle)
            m = int(np.argmin(np.abs(found.gap - gap) + np.hypot(*(found.first - rows.first[k]).T)))
            assert found.gap[m] == pytest.approx(gap, abs=1e-14)
            # Where both curvatures are small, 1e-16 of a coordinate moves the point by the square root of its ratio to them at most.
            assert found.first[m] == pytest.approx(rows.first[k], abs=1e-7)
            assert found.normal[m] == pytest.approx(rows.normal[k], abs=1e-7)


def test_a_face_on_a_face_has_two_ends() -> None:
    """Blocks of 2 x 2 [m], the upper one shifted by 0.6 m: a vertex of either is the end of the common face."""
    for gap in (0.1, 0.0, -1e-9):
        rows = between(BLOCK, BLOCK, np.array([[0.0, 0.0], [0.6, 2.0 + gap]]), np.zeros(2))
        low = np.isclose(rows.normal[:, 1], 1.0)
        assert sorted(rows.first[low, 0]) == pytest.approx([-0.4, 1.0], abs=1e-12)
        assert rows.gap[low] == pytest.approx(gap, abs=1e-15)
        assert low.all() or gap > 0.0


def test_a_vertex_beyond_the_end_of_a_face_is_not_inside() -> None:
    """The upper block has its left side along the right side of the lower one, and a corner 0.02 m below the lower one's top."""
    rows = between(BLOCK, BLOCK, np.array([[0.0, 0.0], [2.0 + 1e-10, 1.98]]), np.zeros(2))
    assert rows.gap == pytest.approx([1e-10, 1e-10], abs=1e-14)
    assert rows.normal == pytest.approx(np.array([[1.0, 0.0]] * 2), abs=1e-15)


def test_corner_to_corner() -> None:
    """Two blocks turned by 45 degrees: the corners face each other along the line of centres."""
    rows = between(BLOCK, BLOCK, np.array([[0.0, 0.0], [2.0 * np.sqrt(2.0) + 0.1, 0.0]]), np.full(2, np.pi / 4.0))
    assert rows.gap == pytest.approx([0.1], abs=1e-14)
    assert rows.normal[0] == pytest.approx([1.0, 0.0], abs=1e-14)


@pytest.mark.parametrize("shape", range(len(SHAPES)))
def test_walls_meet_every_valley(shape: int) -> None:
    features, rng = NurbsFeatures(TABLE, np.array([shape])), np.random.default_rng(4)
    for _ in range(20):
        angle, normal = rng.uniform(0.0, 6.3), rng.uniform(0.0, 6.3)
        n = np.array([np.cos(normal), np.sin(normal)])
        outline = points(shape, np.zeros(2), angle)
        height = outline @ n
        wall = np.zeros((1, 11))
        wall[0, :2], wall[0, 2:4] = n * (height.min() - 0.05), n
        _, rows = features.of_walls(np.zeros((1, 2)), np.array([angle]), np.array([[0, 1]]), wall, REACH)
        valleys = (height == minimum_filter(height, size=9, mode="wrap")) & (
            height - height.min() + 0.05 < 0.97 * REACH
        )
        for p in outline[valleys]:
            assert np.hypot(*(rows.first - p).T).min() < 0.02
        # The lowest of the points is a step of 0.007 m at most away from the lowest place, where the curvature is below 15/m.
        assert rows.gap.min() == pytest.approx(0.05, abs=1e-4)
        assert rows.normal == pytest.approx(np.tile(-n, (len(rows.gap), 1)), abs=1e-15)


def test_too_deep() -> None:
    x = np.array([[0.0, 0.0], [2.0 - 1.5 * DEEPEST, 0.0]])
    with pytest.raises(InvalidSceneError, match=r"grain 0 and grain 1 overlap by more than 0\.05 of a radius"):
        between(DISK, DISK, x, np.zeros(2))
    wall = np.zeros((1, 11))
    wall[0, 1], wall[0, 3] = 0.1, 1.0
    features = NurbsFeatures(TABLE, np.array([DISK]))
    with pytest.raises(InvalidSceneError, match="grain 0 and wall 0 overlap"):
        features.of_walls(np.array([[0.0, 1.0]]), np.zeros(1), np.array([[0, 1]]), wall, REACH)
