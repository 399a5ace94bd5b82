"""Curves, their derivatives and knot insertion against scipy and geomdl, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from nurbs_shapes_of_tests import periodic, ring
from scipy.interpolate import BSpline

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.curve import NurbsCurve, homogeneous, inserted
from ninedisk.core.nurbs.shapes import EXACT_WEIGHTS, QUARTERS, SQUARE, disk, ellipse

UNIT = 2.0**-52


def round_off(degree: int, order: int = 0) -> float:
    """What two algorithms may differ by, over the largest value: of the order of 20 roundings, and powers about a span's middle
    amplify each by up to 3^degree (de Boor's recursion does not); a derivative multiplies by the degree."""
    return 20.0 * UNIT * 3.0**degree * (degree + 1.0) ** order


def clamped(degree: int, seed: int) -> NurbsCurve:
    """Closed curve with uneven, partly repeated knots and uneven weights."""
    rng = np.random.default_rng(seed)
    points = ring(11, seed)
    points = np.concatenate([points, points[:1]])
    inner = np.sort(rng.uniform(0.0, 3.0, len(points) - degree - 1))
    if degree > 1:
        inner[1] = inner[0]
    knots = np.concatenate([np.zeros(degree + 1), inner, np.full(degree + 1, 3.0)])
    weights = rng.uniform(0.5, 2.0, len(points))
    return NurbsCurve(degree=degree, knots=knots, points=points, weights=weights)


def curves() -> list[NurbsCurve]:
    made = [clamped(degree, seed) for degree in (1, 2, 3, 4, 5) for seed in (1, 2)]
    weights = np.random.default_rng(3).uniform(0.5, 2.0, 20)
    return [*made, periodic(ring(20, 4), 3, weights), periodic(ring(9, 5), 2), disk(1.0), ellipse(2.0, 0.5)]


@pytest.mark.parametrize("curve", curves(), ids=lambda c: f"degree{c.degree}-{len(c.points)}points")
def test_points_and_derivatives_equal_those_of_scipy(curve: NurbsCurve) -> None:
    at = np.random.default_rng(0).uniform(curve.breaks[0], curve.breaks[-1], 500)
    homogeneous = np.column_stack([curve.points * curve.weights[:, None], curve.weights])
    spline = BSpline(curve.knots, homogeneous, curve.degree)
    value, slope, twice = (spline(at, nu=k) if k <= curve.degree else np.zeros((500, 3)) for k in range(3))
    point = value[:, :2] / value[:, 2:]
    first = (slope[:, :2] - point * slope[:, 2:]) / value[:, 2:]
    second = (twice[:, :2] - 2.0 * first * slope[:, 2:] - point * twice[:, 2:]) / value[:, 2:]
    for order, expected in enumerate((point, first, second)):
        scale = max(1.0, float(np.abs(expected).max()))
        assert np.abs(curve.evaluate(at, order) - expected).max() <= round_off(curve.degree, order) * scale


@pytest.mark.parametrize("curve", curves(), ids=lambda c: f"degree{c.degree}-{len(c.points)}points")
def test_points_and_derivatives_equal_those_of_geomdl(curve: NurbsCurve) -> None:
    nurbs = pytest.importorskip("geomdl.NURBS")
    other = nurbs.Curve(normalize_kv=False)
    other.degree = curve.degree
    other.ctrlpts = curve.points.tolist()
    other.weights = curve.weights.tolist()
    other.knotvector = curve.knots.tolist()
    at = np.random.default_rng(0).uniform(curve.breaks[0], curve.breaks[-1], 20)
    expected = np.array([other.derivatives(float(u), order=min(2, curve.degree)) for u in at])
    for order in range(expected.shape[1]):
        scale = max(1.0, float(np.abs(expected[:, order]).max()))
        error = np.abs(curve.evaluate(at, order) - expected[:, order]).max()
        assert error <= round_off(curve.degree, order) * scale


@pytest.mark.parametrize("curve", curves(), ids=lambda c: f"degree{c.degree}-{len(c.points)}points")
def test_a_knot_more_leaves_the_curve_as_it_was(curve: NurbsCurve) -> None:
    """And the new control points are those of geomdl where it can tell (it wants clamped knots)."""
    low, high = curve.breaks[0], curve.breaks[-1]
    value = low + 0.37 * (high - low)
    knots, points = inserted(curve.knots, homogeneous(curve.points, curve.weights), curve.degree, value)
    finer = NurbsCurve(degree=curve.degree, knots=knots, points=points[:, :2] / points[:, 2:], weights=points[:, 2])
    assert len(finer.points) == len(curve.points) + 1
    at = np.linspace(low, high, 300)
    assert np.abs(finer.evaluate(at) - curve.evaluate(at)).max() <= round_off(curve.degree)
    if curve.knots[0] != low:
        return
    nurbs, operations = pytest.importorskip("geomdl.NURBS"), pytest.importorskip("geomdl.operations")
    other = nurbs.Curve(normalize_kv=False)
    other.degree = curve.degree
    other.ctrlpts = curve.points.tolist()
    other.weights = curve.weights.tolist()
    other.knotvector = curve.knots.tolist()
    operations.insert_knot(other, [value], [1])
    assert np.abs(finer.points - np.array(other.ctrlpts)).max() <= round_off(curve.degree)
    assert np.abs(finer.weights - np.array(other.weights)).max() <= round_off(curve.degree)


def test_the_disk_is_exact() -> None:
    """Weights and control points are binary numbers: points are off by the rounding of one evaluation, 4 units."""
    points = disk(1.0).evaluate(np.random.default_rng(0).uniform(0.0, 4.0, 10_000))
    assert np.abs(np.hypot(*points.T) - 1.0).max() <= 4.0 * 2.0**-52


def test_parameters_out_of_range_are_refused() -> None:
    with pytest.raises(InvalidSceneError, match=r"0 \.\. 4"):
        disk(1.0).evaluate([4.5])
    with pytest.raises(InvalidSceneError, match="order"):
        disk(1.0).evaluate([1.0], 3)


def changed(**new: object) -> dict[str, object]:
    return {"degree": 2, "knots": QUARTERS, "points": SQUARE, "weights": EXACT_WEIGHTS, **new}


def edited(array: object, k: object, value: object) -> object:
    copy = np.array(array, dtype=float)
    copy[k] = value
    return copy


EIGHT = np.array([[0, 0], [2, -2], [2, 2], [-1, -1], [-1, 1], [0, 0]], dtype=float)
"""A figure eight of two unequal loops."""


@pytest.mark.parametrize(
    ("new", "message"),
    [
        ({"points": edited(SQUARE, -1, (1.1, 0.2))}, "open"),
        ({"weights": edited(EXACT_WEIGHTS, 3, -1.0)}, r"weights\[3\] = -1"),
        ({"weights": edited(EXACT_WEIGHTS, 3, 0.0)}, r"weights\[3\] = 0"),
        ({"weights": [1.0]}, "weights has shape"),
        ({"knots": QUARTERS[:-1]}, "11 knots"),
        ({"knots": edited(QUARTERS, 5, 0.5)}, "must not decrease"),
        ({"knots": np.array([0, 0, 0, 1, 1, 1, 2, 3, 3, 4, 4, 4.0])}, "occurs 3 times"),
        ({"knots": np.zeros(12)}, "is empty"),
        ({"knots": edited(QUARTERS, 3, np.nan)}, "finite"),
        ({"points": SQUARE[::-1]}, "clockwise"),
        ({"points": SQUARE * [1.0, 0.0]}, "zero area|stands still"),
        ({"points": SQUARE * 0.0}, "zero area"),
        ({"points": SQUARE[:, :1]}, "shape"),
        ({"degree": 0}, "degree = 0"),
        ({"degree": 9}, r"1 \.\. 8"),
        ({"degree": 2.0}, "degree = 2.0"),
        (
            {"degree": 1, "knots": np.array([0, 0, 1, 2, 3, 4, 5, 5.0]), "points": EIGHT, "weights": None},
            "crosses itself",
        ),
        (
            {
                "degree": 1,
                "knots": np.array([0, 0, 1, 2, 3, 4, 4.0]),
                "points": [[0, 0], [1, 0], [2, 0], [1, 0], [0, 0]],
                "weights": None,
            },
            "zero area",
        ),
        ({"points": edited(SQUARE, 1, SQUARE[0])}, "stands still"),
    ],
)
def test_degenerate_input_is_refused_by_name(new: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        NurbsCurve(**changed(**new))  # type: ignore[arg-type]


def test_a_smooth_loop_is_found() -> None:
    """A limacon's inner loop: every control point turns the same way round the origin."""
    angle = 2.0 * np.pi * np.arange(24) / 24
    radius = 0.5 + np.cos(angle)
    with pytest.raises(InvalidSceneError, match="crosses itself"):
        periodic(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), 3)
