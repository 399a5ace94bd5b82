"""Contacts with half-plane walls."""

from __future__ import annotations

import numpy as np
import pytest
from nurbs_shapes_of_tests import peanut

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.nurbs.shapes import disk, ellipse

PRECISION = 1e-14


def test_disks_on_a_wall() -> None:
    """Overlap R - h, normal into the wall, point on the wall below the centre; grazing ones included."""
    rng = np.random.default_rng(1)
    n = 20_000
    radius = np.exp(rng.uniform(np.log(0.5), np.log(2.0), 16))
    shape = rng.integers(0, 16, n)
    r = radius[shape]
    depth = r * np.where(np.arange(n) % 2, 10.0 ** rng.uniform(-12.0, -1.0, n), rng.uniform(1e-3, 1.9, n))
    way = 0.7
    normal, along = np.array([np.cos(way), np.sin(way)]), np.array([-np.sin(way), np.cos(way)])
    x = (r - depth)[:, None] * normal + rng.uniform(-1.0, 1.0, n)[:, None] * along
    grains = NurbsGrains([disk(float(value)) for value in radius], shape)
    index, rows = grains.wall_contacts(x, rng.uniform(-np.pi, np.pi, n), (0.0, 0.0), normal)
    assert np.array_equal(index, np.arange(n))
    height = x @ normal
    assert np.abs((rows.overlap - (r - height)) / r).max() <= PRECISION
    assert np.abs(rows.normal + normal).max() <= 2.0**-52
    assert np.hypot(*((rows.point - (x - height[:, None] * normal)) / r[:, None]).T).max() <= PRECISION
    assert np.all(np.abs(0.25 * rows.chord**2 - (r - height) * (r + height)) <= 20.0 * PRECISION * r**2)


def test_ellipses_on_a_wall() -> None:
    """Overlap from the support function; the chord's middle lies on the diameter that is conjugate to the wall's direction."""
    a, b = 2.0, 0.7
    rng = np.random.default_rng(2)
    n = 2_000
    turn = rng.uniform(-np.pi, np.pi, n)
    support = np.hypot(a * np.sin(turn), b * np.cos(turn))
    height = support * (1.0 - 10.0 ** rng.uniform(-12.0, -0.1, n))
    x = np.column_stack([rng.uniform(-1.0, 1.0, n), height])
    index, rows = NurbsGrains([ellipse(a, b)], np.zeros(n, dtype=int)).wall_contacts(x, turn, (5.0, 0.0), (0.0, 1.0))
    assert np.array_equal(index, np.arange(n))
    assert np.abs(rows.overlap - (support - height)).max() <= PRECISION * a
    # The extreme point below is R(turn) (a^2 mx, b^2 my)/support for m the downward direction in the ellipse's frame.
    mx, my = -np.sin(turn), -np.cos(turn)
    px, py = a * a * mx / support, b * b * my / support
    lowest_x = np.cos(turn) * px - np.sin(turn) * py
    middle = x[:, 0] + lowest_x * height / support
    assert np.abs(rows.point[:, 0] - middle).max() <= PRECISION * a * a / b
    assert np.abs(rows.point[:, 1]).max() <= PRECISION


def test_a_waisted_grain_stands_on_two_feet() -> None:
    """Two contacts, the mirror images of each other; tilted, the lower foot is deeper by the tilt times their distance."""
    grains = NurbsGrains([peanut()], [0])
    points = peanut().evaluate(np.linspace(0.0, 20.0, 100_001))
    lowest = float(points[:, 1].min())
    index, rows = grains.wall_contacts([(0.0, -lowest - 0.01)], [0.0], (0.0, 0.0), (0.0, 1.0))
    assert index.tolist() == [0, 0]
    assert rows.overlap == pytest.approx([0.01, 0.01], abs=1e-8)  # the sampled minimum is above the true one by 1e-9
    assert rows.point[0, 0] == pytest.approx(
        -rows.point[1, 0], abs=1e-5
    )  # the fit is symmetric to its parameters' rounds
    assert abs(rows.point[0, 0]) > 0.4
    assert np.abs(rows.point[:, 1]).max() <= PRECISION
    tilt = 1e-3
    _, tilted = grains.wall_contacts([(0.0, -lowest - 0.01)], [tilt], (0.0, 0.0), (0.0, 1.0))
    feet = np.sort(rows.point[:, 0])
    gain = tilted.overlap[np.argsort(tilted.point[:, 0])] - 0.01
    assert gain == pytest.approx(-tilt * feet, rel=0.02)


def test_far_and_near_the_wall() -> None:
    grains = NurbsGrains([disk(1.0), peanut()], [0, 1])
    assert len(grains.wall_contacts([(0, 1.0 + 1e-11), (5, 3)], [0.1, 0.2], (0, 0), (0, 1))[0]) == 0
    with pytest.raises(InvalidSceneError, match="grain 0, at the wall, lies wholly inside"):
        grains.wall_contacts([(0, -1.0 - 1e-11), (5, 3)], [0.1, 0.2], (0, 0), (0, 1))


def test_one_wall_normal_serves_whatever_its_length() -> None:
    grains = NurbsGrains([disk(1.0)], [0])
    _, rows = grains.wall_contacts([(0.0, 0.9)], [0.0], (0.0, 0.0), (0.0, 5.0))
    assert rows.overlap[0] == pytest.approx(0.1, abs=PRECISION)
