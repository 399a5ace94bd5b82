"""Ellipses against an oracle of 40 digits that shares nothing with the kernels.

The oracle finds the intersections as roots of one ellipse's implicit equation along the other's trigonometric
parametrisation, and the extents from the support function ``sqrt(a^2 nx^2 + b^2 ny^2)``.
"""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.shapes import ellipse

mp = pytest.importorskip("mpmath")

AXES = ((1.0, 0.5), (1.5, 1.0), (0.8, 0.75), (2.0, 0.5))
"""Half-axes of the shapes."""


class Oracle:
    """Contact of two ellipses in ``mpmath`` numbers; the rotations are those of the rounded cosines and sines."""

    def __init__(self, shapes: tuple[int, int], x: np.ndarray, turn: np.ndarray) -> None:
        mp.mp.dps = 40
        self.axes = [tuple(mp.mpf(float(h)) for h in AXES[k]) for k in shapes]
        self.x = [tuple(mp.mpf(float(c)) for c in row) for row in x]
        self.turn = [(mp.mpf(float(np.cos(a))), mp.mpf(float(np.sin(a)))) for a in turn]

    def point(self, k: int, angle: object) -> tuple[object, object]:
        (a, b), (c, s), (x, y) = self.axes[k], self.turn[k], self.x[k]
        p, q = a * mp.cos(angle), b * mp.sin(angle)
        return c * p - s * q + x, s * p + c * q + y

    def outside(self, k: int, q: tuple[object, object]) -> object:
        """Negative inside ellipse k; its rotation matrix is (c, s) over c^2 + s^2, which rounding left off 1."""
        (a, b), (c, s), (x, y) = self.axes[k], self.turn[k], self.x[k]
        dx, dy, square = q[0] - x, q[1] - y, c * c + s * s
        return ((c * dx + s * dy) / square / a) ** 2 + ((c * dy - s * dx) / square / b) ** 2 - 1

    def support(self, k: int, n: tuple[object, object]) -> object:
        (a, b), (c, s) = self.axes[k], self.turn[k]
        return mp.sqrt((a * (c * n[0] + s * n[1])) ** 2 + (b * (c * n[1] - s * n[0])) ** 2)

    def contact(self, near: float) -> tuple[object, object, object]:
        """Point, normal and overlap; ``near`` is an angle on ellipse 0 inside the other."""
        ends = []
        for phi in (-1, 1):
            inside, step = mp.mpf(near), mp.mpf(1) / 10**8
            while self.outside(1, self.point(0, near + phi * step)) < 0:
                inside, step = near + phi * step, 2 * step
            outside = near + phi * step
            for _ in range(130):
                middle = (inside + outside) / 2
                if self.outside(1, self.point(0, middle)) < 0:
                    inside = middle
                else:
                    outside = middle
            ends.append(self.point(0, inside))
        (ax, ay), (bx, by) = ends
        length = mp.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        n = ((by - ay) / length, (ax - bx) / length)
        far = (self.x[1][0] - self.x[0][0]) * n[0] + (self.x[1][1] - self.x[0][1]) * n[1]
        overlap = self.support(0, n) + self.support(1, n) - far
        return ((ax + bx) / 2, (ay + by) / 2), n, overlap


def touching(shapes: tuple[int, int], turn: np.ndarray, phi: float, depth: float) -> tuple[np.ndarray, float]:
    """Positions where the extreme points in direction ``phi`` overlap by ``depth``, and the angle of that point on ellipse 0."""
    n = np.array([np.cos(phi), np.sin(phi)])
    places = []
    for k in (0, 1):
        a, b = AXES[shapes[k]]
        c, s = np.cos(turn[k]), np.sin(turn[k])
        mx, my = (c * n[0] + s * n[1]) * (1 - 2 * k), (c * n[1] - s * n[0]) * (1 - 2 * k)
        h = np.hypot(a * mx, b * my)
        px, py = a * a * mx / h, b * b * my / h
        places.append((np.array([c * px - s * py, s * px + c * py]), np.arctan2(a * my, b * mx)))
        if k == 0:
            near = float(np.arctan2(b * my, a * mx))
    return np.array([[0.0, 0.0], places[0][0] - places[1][0] - depth * n]), near


def test_contact_equals_the_oracle() -> None:
    """50 pairs, overlaps of 1e-11 to 0.1.

    Overlap, normal and point are conditioned like a disk's of the radii of curvature, which here go down to b^2/a = 1/8 and up to
    a^2/b = 8: coordinates near 1, known to round-off, move the middle of the chord by up to 8 times 8 times more.
    """
    rng = np.random.default_rng(5)
    worst = np.zeros(3)
    for _ in range(50):
        shapes = tuple(int(k) for k in rng.integers(0, len(AXES), 2))
        turn = rng.uniform(-np.pi, np.pi, 2)
        depth = 10.0 ** rng.uniform(-11.0, -1.0)
        x, near = touching(shapes, turn, float(rng.uniform(-np.pi, np.pi)), depth)
        oracle = Oracle(shapes, x, turn)
        point, normal, overlap = oracle.contact(near)
        grains = NurbsGrains([ellipse(*AXES[k]) for k in shapes], [0, 1]) if shapes not in CACHE else CACHE[shapes]
        CACHE[shapes] = grains
        _, rows = grains.pair_contacts(x, turn, [(0, 1)])
        assert len(rows.overlap) == 1
        assert abs(float(mp.mpf(float(rows.overlap[0])) - overlap)) <= 1e-14
        off_normal = max(abs(float(mp.mpf(float(rows.normal[0, k])) - normal[k])) for k in (0, 1))
        off_point = max(abs(float(mp.mpf(float(rows.point[0, k])) - point[k])) for k in (0, 1))
        worst = np.maximum(worst, [0.0, off_normal, off_point])
    assert worst[1] <= 2e-14
    assert worst[2] <= 64e-15


CACHE: dict[tuple[int, ...], NurbsGrains] = {}


def test_chord_normal_differs_from_the_common_normal_in_proportion_to_the_overlap() -> None:
    """The law's own property on ellipses: at contact of curvatures that change along the curve the chord tilts by O(overlap)."""
    grains = NurbsGrains([ellipse(1.0, 0.5), ellipse(2.0, 0.5)], [0, 1])
    turn, phi = np.array([0.4, 1.3]), 0.2
    tilt = []
    for depth in (1e-3, 1e-4, 1e-5):
        x, _ = touching((0, 3), turn, phi, depth)
        _, rows = grains.pair_contacts(x, turn, [(0, 1)])
        tilt.append(abs(float(rows.normal[0] @ [-np.sin(phi), np.cos(phi)])))
    orders = np.log10(np.array(tilt[:-1]) / np.array(tilt[1:]))
    assert np.all(np.abs(orders - 1.0) < 0.05)


def test_crossed_ellipses_have_no_chord() -> None:
    grains = NurbsGrains([ellipse(2.0, 0.5)], [0, 0])
    with pytest.raises(InvalidSceneError, match="more than two corners"):
        grains.pair_contacts([(0, 0), (0, 0)], [0.0, 0.5 * np.pi], [(0, 1)])
