"""A tower of boxes: forces and moments on each box cancel."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ninedisk.references.analytic.assembly.box_tower import tower_forces

MASS, HALF = [3.0, 1.0, 2.5], [0.2, 0.3, 0.1]
PLACE = np.array([[0.0, 0.0], [0.07, -0.02], [-0.05, 0.04]])
G = 9.81


@pytest.mark.parametrize("angle", [0.0, 0.2, 1.1])
def test_forces_and_moments_on_each_box_cancel(angle: float) -> None:
    found = tower_forces(MASS, HALF, PLACE, angle=angle, g=G)
    height = 0.0
    for k, (mass, half) in enumerate(zip(MASS, HALF, strict=True)):
        middle = np.array([*PLACE[k], height + half])
        below, above = np.array([-found.fs[k], 0.0, found.fn[k]]), np.zeros(3)
        moment = np.cross(np.array([*found.centre[k], height]) - middle, below)
        if k + 1 < len(MASS):
            above = -np.array([-found.fs[k + 1], 0.0, found.fn[k + 1]])
            moment += np.cross(np.array([*found.centre[k + 1], height + 2.0 * half]) - middle, above)
        weight = mass * G * np.array([math.sin(angle), 0.0, -math.cos(angle)])
        np.testing.assert_allclose(below + above + weight, 0.0, atol=1e-13)
        np.testing.assert_allclose(moment, 0.0, atol=1e-13)
        height += 2.0 * half


def test_one_box_presses_where_its_weight_points() -> None:
    found = tower_forces([3.0], [0.5], [[0.2, -0.1]], angle=math.atan(0.4), g=10.0)
    np.testing.assert_allclose(found.centre, [[0.4, -0.1]], rtol=1e-14)
    assert math.hypot(found.fn[0], found.fs[0]) == pytest.approx(30.0, rel=1e-14)


@pytest.mark.parametrize(("half", "place"), [([0.1], PLACE), (HALF, PLACE[:2])])
def test_numbers_of_boxes_must_agree(half: list[float], place: np.ndarray) -> None:
    with pytest.raises(ValueError, match="each box needs"):
        tower_forces(MASS, half, place, angle=0.1, g=G)
