"""Grains that are not convex: several contacts a pair, found as a polygon clip finds them."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from nurbs_shapes_of_tests import peanut, periodic, placed, ring

from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.intersect_kernels import contacts_of_pairs
from ninedisk.core.nurbs.mass import centred
from ninedisk.core.nurbs.shapes import disk, ellipse
from ninedisk.core.nurbs.state import UNDECIDED, contact_rows, workspace


def test_two_waisted_grains_side_by_side_touch_twice() -> None:
    grains = NurbsGrains([peanut()], [0, 0])
    points = peanut().evaluate(np.linspace(0.0, 20.0, 100_001))
    height = float(points[:, 1].max() - points[:, 1].min())
    index, rows = grains.pair_contacts([(0.0, 0.0), (0.0, height - 0.02)], [0.0, 0.0], [(0, 1)])
    assert index.tolist() == [0, 0]
    assert rows.overlap == pytest.approx([0.02, 0.02], abs=1e-4)
    assert np.abs(rows.normal[:, 1] - 1.0).max() < 1e-3
    feet = np.sort(rows.point[:, 0])
    assert feet[0] < -0.4
    assert feet[1] > 0.4
    assert rows.point[:, 1] == pytest.approx(0.5 * (height - 0.02), abs=1e-3)


def crossings_of_polygons(p: np.ndarray, q: np.ndarray) -> int:
    """Number of proper crossings of two closed polygons."""
    d, e = np.roll(p, -1, axis=0) - p, np.roll(q, -1, axis=0) - q
    start = q[None] - p[:, None]
    cross = d[:, None, 0] * e[None, :, 1] - d[:, None, 1] * e[None, :, 0]
    s = (start[..., 0] * e[None, :, 1] - start[..., 1] * e[None, :, 0]) / cross
    t = (start[..., 0] * d[:, None, 1] - start[..., 1] * d[:, None, 0]) / cross
    return int(np.count_nonzero((s >= 0) & (s < 1) & (t >= 0) & (t < 1)))


def grains_of_tests() -> list[NurbsCurve]:
    weights = np.random.default_rng(8).uniform(0.5, 2.0, 20)
    made = [periodic(ring(20, seed, spread=0.25), 3) for seed in (11, 12)]
    made += [periodic(ring(20, 13, spread=0.25), 2, weights), periodic(ring(9, 14, spread=0.3), 1), peanut()]
    return [centred(curve) for curve in made]


def test_contacts_of_random_grains_are_those_of_fine_polygons() -> None:
    """Each contact has two intersections: their number, from polygons of 800 sides, is twice the contacts' unless the grains are crossed.

    Polygons miss intersections closer than a chord's sagitta; 1 % of the pairs may differ for that.
    """
    rng = np.random.default_rng(21)
    curves = grains_of_tests()
    n = 150
    shape = rng.integers(0, len(curves), 2 * n)
    grains = NurbsGrains(curves, shape)
    turn = rng.uniform(-np.pi, np.pi, 2 * n)
    way, distance = rng.uniform(-np.pi, np.pi, n), rng.uniform(1.5, 2.3, n)
    x = np.zeros((2 * n, 2))
    x[1::2] = distance[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    pairs = np.arange(2 * n).reshape(-1, 2)
    count, out = np.zeros(n, dtype=np.int64), contact_rows(4 * n)
    turned = np.column_stack([np.cos(turn), np.sin(turn)])
    total = contacts_of_pairs(grains.table, grains.shape, x, turned, pairs, workspace(grains.table), count, out)
    polygons = [curve.evaluate(np.linspace(*curve.breaks[[0, -1]], 801)[:-1]) for curve in curves]
    differ, several = 0, 0
    for k in range(n):
        p, q = (polygons[shape[i]] @ np.array([turned[i], [-turned[i, 1], turned[i, 0]]]) + x[i] for i in pairs[k])
        found = crossings_of_polygons(p, q)
        several += count[k] > 1
        differ += found != 2 * count[k] if count[k] >= 0 else found < 4
    assert differ <= 0.01 * n
    assert several >= 3
    assert total == count[count > 0].sum()
    assert np.all(out.overlap[:total] > 0.0)
    assert np.abs(np.hypot(*out.normal[:total].T) - 1.0).max() <= 2.0**-51


def test_intersections_lie_on_both_outlines_and_the_normal_points_to_the_second() -> None:
    curves = grains_of_tests()[:2]
    grains = NurbsGrains(curves, [0, 1])
    rng = np.random.default_rng(4)
    seen = 0
    for _ in range(100):
        turn, way = rng.uniform(-np.pi, np.pi, 2), float(rng.uniform(-np.pi, np.pi))
        x = np.array([[0.0, 0.0], [1.85 * np.cos(way), 1.85 * np.sin(way)]])
        _, rows = grains.pair_contacts(x, turn, [(0, 1)])
        for row in range(len(rows.overlap)):
            ends = np.array([placed(curves[k], rows.place[row, [k, k + 2]] % 20.0, x[k], turn[k]) for k in (0, 1)])
            assert np.abs(ends[0] - ends[1]).max() <= 1e-12
            along = ends[0, 1] - ends[0, 0]
            assert abs(along @ rows.normal[row]) <= 1e-12
            assert rows.chord[row] == pytest.approx(np.hypot(*along), abs=1e-12)
            assert rows.point[row] == pytest.approx(ends[0].mean(axis=0), abs=1e-12)
            if rows.overlap[row] < 0.1:
                assert rows.normal[row] @ x[1] > 0.0
            seen += 1
    assert seen > 50


def test_corner_of_a_square_in_a_disk() -> None:
    """A corner 0.1 deep: the chord is that of the corner's two sides with the circle; the overlap ends in the corner itself."""
    square = NurbsCurve(degree=1, knots=[0, 0, 1, 2, 3, 4, 4], points=[(0, -1), (1, 0), (0, 1), (-1, 0), (0, -1)])
    grains = NurbsGrains([square, disk(1.0)], [0, 1])
    for turn in (0.0, 1.0, -2.5):
        c, s = np.cos(turn), np.sin(turn)
        x = np.array([(0.0, 0.0), (1.9 * c, 1.9 * s)])
        _, rows = grains.pair_contacts(x, [turn, 0.3], [(0, 1)])
        assert rows.overlap == pytest.approx([0.1], abs=1e-14)
        assert rows.normal[0] == pytest.approx([c, s], abs=1e-14)
        # On the side y = 1 - x and the circle about (1.9, 0): 2 x^2 - 5.8 x + 3.61 = 0.
        foot = (5.8 - np.sqrt(5.8**2 - 8.0 * 3.61)) / 4.0
        assert rows.point[0] == pytest.approx([foot * c, foot * s], abs=1e-14)
        assert rows.chord[0] == pytest.approx(2.0 * (1.0 - foot), abs=1e-14)


def test_rows_are_made_as_needed() -> None:
    """Every pair of a wall of waisted grains has two contacts: more than the first guess has room for."""
    n = 40
    grains = NurbsGrains([peanut()], np.zeros(2 * n, dtype=int))
    x = np.zeros((2 * n, 2))
    x[1::2, 1] = 1.4
    index, rows = grains.pair_contacts(x, np.zeros(2 * n), np.tile(np.arange(2 * n).reshape(-1, 2), (3, 1)))
    assert np.array_equal(index, np.repeat(np.arange(3 * n), 2))
    assert np.ptp(rows.overlap) <= 1e-14


def test_order_of_two_dented_grains_does_not_matter() -> None:
    """Deep and shallow pairs of unlike grains: the same contacts, turned round, to round-off (as for disks, see there).

    The room for normals and points is ten times that of disks: chords of corners and waists are conditioned by their angle.
    """
    rng = np.random.default_rng(7)
    curves = [*grains_of_tests(), ellipse(1.0, 0.1), disk(0.7)]
    n = 200 if numba.config.DISABLE_JIT else 5_000
    grains = NurbsGrains(curves, rng.integers(0, len(curves), 2 * n))
    way, distance = rng.uniform(-np.pi, np.pi, n), rng.uniform(0.3, 2.4, n)
    x = np.zeros((2 * n, 2))
    x[1::2] = distance[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    turn = rng.uniform(-np.pi, np.pi, 2 * n)
    turned = np.column_stack([np.cos(turn), np.sin(turn)])
    found = []
    for pairs in (np.arange(2 * n).reshape(-1, 2), np.arange(2 * n).reshape(-1, 2)[:, ::-1].copy()):
        count, out = np.zeros(n, dtype=np.int64), contact_rows(4 * n)
        total = contacts_of_pairs(grains.table, grains.shape, x, turned, pairs, workspace(grains.table), count, out)
        found.append((count, *(column[:total] for column in out)))
    (count, point, normal, overlap, *_), (other, its_point, its_normal, its_overlap, *_) = found
    assert np.array_equal(count, other)
    assert not np.any(count == UNDECIDED)
    single = np.repeat(count, np.maximum(count, 0)) == 1
    assert np.count_nonzero(single) > 0.5 * n
    assert np.abs(overlap - its_overlap)[single].max() <= 1e-14
    assert np.abs(normal + its_normal)[single].max() <= 1e-13
    assert np.abs(point - its_point)[single].max() <= 1e-13
