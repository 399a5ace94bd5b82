"""Outlines traced in images and fitted."""

from __future__ import annotations

import numpy as np
import pytest

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.mass import area_moments
from ninedisk.core.nurbs.shapes import fitted, traced


def ellipse_image(pixel: float) -> np.ndarray:
    """Half-axes 3 and 2, the centre at (4, 3), in an image of 8 by 6."""
    rows, columns = round(6.0 / pixel) + 1, round(8.0 / pixel) + 1
    y, x = np.mgrid[rows - 1 : -1 : -1, 0:columns] * pixel
    return np.asarray(((x - 4.0) / 3.0) ** 2 + ((y - 3.0) / 2.0) ** 2 < 1.0)


def enclosed(polyline: np.ndarray) -> float:
    x, y = polyline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@pytest.mark.parametrize("pixel", [0.2, 0.05])
def test_an_ellipse(pixel: float) -> None:
    """The polyline is as close as it says, and so is the fit; row 0 is the upper one."""
    points = traced(ellipse_image(pixel), pixel)
    assert enclosed(points) > 0.0
    # Distance to first order: the level function over its gradient.
    u, v = (points[:, 0] - 4.0) / 3.0, (points[:, 1] - 3.0) / 2.0
    off = np.abs(u * u + v * v - 1.0) / (2.0 * np.hypot(u / 3.0, v / 2.0))
    assert off.max() <= pixel / np.sqrt(2.0)
    fit = fitted(traced(ellipse_image(pixel), pixel), 16)
    assert fit.largest <= pixel
    moments = area_moments(fit.curve)
    assert np.hypot(*(moments.centroid - [4.0, 3.0])) <= 0.1 * pixel
    # On average the curve is off by less than a quarter of a pixel; its length is 15.9.
    assert abs(moments.area - 6.0 * np.pi) <= 0.25 * pixel * 15.9


def test_small_shapes_exactly() -> None:
    assert traced(np.ones((1, 1), dtype=bool), 2.0).tolist() == [[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]]
    corner = traced(np.array([[True, False], [True, True]]))
    # Three pixels of which each corner is cut by an eighth, and the inner one filled by as much.
    assert enclosed(corner) == 3.0 - 5.0 / 8.0 + 1.0 / 8.0
    assert corner[:, 1].max() == 1.5
    assert corner[np.argmax(corner[:, 1]), 0] == 0.0


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.eye(2, dtype=bool), "more than one boundary"),
        (np.pad(np.zeros((1, 1), dtype=bool), 1, constant_values=True), "enclose a hole"),
        (np.zeros((3, 3), dtype=bool), "no true pixel"),
        (np.ones((3, 3)), "image has shape .3, 3. and type float64"),
        (np.ones(3, dtype=bool), "image has shape .3,."),
    ],
)
def test_what_is_no_grain(image: np.ndarray, message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        traced(image)


def test_the_width_of_a_pixel() -> None:
    with pytest.raises(InvalidSceneError, match="pixel = 0"):
        traced(np.ones((2, 2), dtype=bool), 0)
