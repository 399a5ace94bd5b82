"""Outlines: points and derivatives, what is refused, polygons, fits, images, areas and moments."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from nurbs_shapes_of_tests import outline, periodic, ring
from scipy.interpolate import BSpline

from ninedisk.core import InvalidSceneError
from ninedisk.core.nurbs.curve import NurbsCurve, homogeneous, inserted
from ninedisk.core.nurbs.mass import area_moments, centred, farthest, uniform_grain
from ninedisk.core.nurbs.shapes import (
    EXACT_WEIGHTS,
    QUARTERS,
    SQUARE,
    disk,
    ellipse,
    fitted,
    polygon,
    regular_polygon,
    traced,
)
from ninedisk.references.analytic.on_plane.rolling_grain import RoundedPolygon

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


@cache
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
    """And the new control points are those of geomdl where it can (it wants clamped knots)."""
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


@pytest.mark.parametrize(("faces", "roundness"), [(3, 0.0), (3, 0.4), (4, 0.0), (4, 0.1), (6, 0.5), (12, 0.95)])
def test_regular_polygons(faces: int, roundness: float) -> None:
    """Area, inertia and reach are the closed forms'; every point is where its face or its arc is."""
    curve, shape = regular_polygon(faces, 0.7, roundness=roundness), RoundedPolygon(faces, 0.7, roundness)
    grain = uniform_grain(curve, 2.0)
    assert area_moments(curve).area == pytest.approx(shape.area, rel=1e-14)
    # A rounding of the corner's distance.
    assert area_moments(curve).centroid == pytest.approx((0.0, 0.0), abs=np.finfo(float).eps * shape.corner)
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
    with pytest.raises(InvalidSceneError, match="2 different corners"):
        polygon([(0.0, 0.0), (1.0, 0.0)])
    with pytest.raises(InvalidSceneError, match="clockwise"):
        polygon([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)])
    with pytest.raises(InvalidSceneError, match="faces = 2"):
        regular_polygon(2, 1.0)
    with pytest.raises(InvalidSceneError, match="roundness = 1"):
        regular_polygon(5, 1.0, roundness=1.0)
    with pytest.raises(InvalidSceneError, match="apothem"):
        regular_polygon(5, 0.0)


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


def test_the_first_vertex_may_close_the_outline_and_no_other_may_be_repeated() -> None:
    corners = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)])
    for closing in (corners[:1], corners[:1] + 2.0 * UNIT):  # the second: cos(2 pi r) with the rounding of an angle
        np.testing.assert_array_equal(polygon(np.concatenate([corners, closing])).points, polygon(corners).points)
    flower = ring(40, 4)
    closed = fitted(np.concatenate([flower, flower[:1]]), 12)
    np.testing.assert_array_equal(closed.curve.points, fitted(flower, 12).curve.points)
    with pytest.raises(
        InvalidSceneError, match=r"vertices\[2\] = \(2, 0\) repeats vertices\[1\]: give each vertex once"
    ):
        polygon(corners[[0, 1, 1, 2, 3]])
    with pytest.raises(InvalidSceneError, match="2 different corners"):
        polygon(corners[[0, 1, 0]])
    with pytest.raises(InvalidSceneError, match="finite"):
        polygon([(0.0, 0.0), (1.0, np.nan), (1.0, 1.0)])


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
        (np.repeat(outline(flower, 10), 2, axis=0), 8, r"outline\[1\] = .* repeats outline\[0\]"),
        (outline(flower)[::-1], 20, "clockwise"),
    ],
)
def test_outlines_that_cannot_be_fitted(points: np.ndarray, n: int, message: str) -> None:
    with pytest.raises(InvalidSceneError, match=message):
        fitted(points, n)


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
