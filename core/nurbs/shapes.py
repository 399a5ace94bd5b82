"""Basic outlines: exact disk and ellipse, polygons, fits of a polyline or an image; the table of all bodies of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin, tan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve import MOST_DEGREE, MOST_POINTS, NurbsCurve
from ninedisk.core.nurbs.curve_kernels import ShapeTable
from ninedisk.core.nurbs.table import joined_tables, table_of_circles
from ninedisk.core.validate import at_least, numbers, real, short_repr, whole

QUARTERS = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0])
MOST_ROUNDS = 1_000
"""Rounds of a fit; parameters have settled after some ten."""
SAME_POINT = 1e-14
"""Distance of two points, over the largest coordinate, that is the rounding of their coordinates."""
SQUARE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=np.float64)
EXACT_WEIGHTS = np.array([1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0])
"""Weights of a full circle in four quadratic quarters, alternately ``((1 - t^2), 2 t)/(1 + t^2)`` and its mirror image.

The usual weights, 1 and sqrt(1/2) in turn, cannot be written in binary numbers: their curve is off the circle by round-off.
With these, weights and control points are exact, and so is the circle."""

MOST_FACES = MOST_POINTS // 4 - 1
"""A rounded polygon has four control points a face."""

STEPS = {1: "bl", 2: "rb", 3: "rl", 4: "tr", 6: "tb", 7: "tl", 8: "lt", 9: "bt", 11: "rt", 12: "lr", 13: "br", 14: "lb"}
"""Sides (left, bottom, right, top) where the boundary enters and leaves a cell whose corners, counter-clockwise from below left, are bits
1, 2, 4, 8 if inside; it runs with the inside on its left. Cells 5 and 10, with two opposite corners inside, have two parts each: pixels
touching at a corner only are not connected."""

SADDLES = {5: ("bl", "tr"), 10: ("rb", "lt")}

MIDDLES = {"l": (0, 1), "b": (1, 0), "r": (2, 1), "t": (1, 2)}
"""Middles of a cell's sides, in halves of a pixel from below left."""


def disk(radius: float) -> NurbsCurve:
    """Circle of ``radius`` [m] about the origin, exact, in four quadratic spans."""
    return ellipse(radius, radius)


def ellipse(a: float, b: float) -> NurbsCurve:
    """Ellipse of half-axes ``a`` along x and ``b`` along y [m], exact, about the origin, in four quadratic spans."""
    half_axes = np.array([at_least("a", a, 0.0, strict=True), at_least("b", b, 0.0, strict=True)])
    return NurbsCurve(degree=2, knots=QUARTERS, points=SQUARE * half_axes, weights=EXACT_WEIGHTS)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A curve through points and how far it is from them.

    Parameters
    ----------
    curve : NurbsCurve
    largest, rms : float
        Largest and root-mean-square distance [m] of the points from the curve.
    """

    curve: NurbsCurve
    largest: float
    rms: float


def fitted(outline: ArrayLike, n: int, *, degree: int = 3, rounds: int = 8) -> Fit:
    """Least-squares fit of a closed polyline by a smooth periodic B-spline.

    Parameters
    ----------
    outline : array_like, shape (k, 2)
        Vertices [m], counter-clockwise; k > n. The first may be repeated at the end.
    n : int
        Number of different control points, > degree.
    degree : int
    rounds : int
        Parameters begin as the polyline's length; each round moves them to the points of the curve that are nearest and fits
        anew, so that the distances and not the parameters are fitted. At most `MOST_ROUNDS`.

    Returns
    -------
    Fit

    Raises
    ------
    InvalidSceneError
        If there are too few points, or the fitted curve is no outline (see `NurbsCurve`).
    """
    points = _vertices("outline", outline)
    degree = whole("degree", degree, 1, MOST_DEGREE, error=InvalidSceneError)
    n = whole("n", n, 1, MOST_POINTS - degree, error=InvalidSceneError)
    rounds = whole("rounds", rounds, 0, MOST_ROUNDS, error=InvalidSceneError)
    if not degree < n < len(points):
        raise InvalidSceneError(
            f"n = {n} is not allowed: it must be > {degree}, the degree, and < {len(points)}, the points"
        )
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    parameter = n * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()

    def free(at: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.lstsq(_periodic_basis(at, n, degree), points, rcond=None)[0], dtype=np.float64)

    for _ in range(rounds):
        parameter = _feet(free(parameter), degree, points, parameter)
    control = free(parameter)
    for _ in range(4):
        parameter = _feet(control, degree, points, parameter)
    distance = np.linalg.norm(_periodic_basis(parameter, n, degree) @ control - points, axis=1)
    curve = NurbsCurve(
        degree=degree,
        knots=np.arange(-degree, n + degree + 1, dtype=np.float64),
        points=np.concatenate([control, control[:degree]]),
    )
    return Fit(curve=curve, largest=float(distance.max()), rms=float(np.sqrt(np.mean(distance**2))))


def _vertices(name: str, given: ArrayLike) -> FloatArray:
    """Vertices of a closed polyline, shape (k, 2), without a last one that closes it.

    Raises
    ------
    InvalidSceneError
        If they are no finite points, or two neighbours are the same but for `SAME_POINT`.
    """
    points = numbers(name, given)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise InvalidSceneError(f"{name} has shape {points.shape}; it must be finite numbers of shape (k, 2)")
    if not len(points):
        return points
    near = SAME_POINT * float(np.abs(points).max())
    if len(points) > 1 and np.abs(points[-1] - points[0]).max() <= near:
        points = points[:-1]
    repeated = np.abs(points[1:] - points[:-1]).max(axis=1, initial=0.0) <= near
    if repeated.any():
        k = int(np.argmax(repeated))
        raise InvalidSceneError(
            f"{name}[{k + 1}] = ({points[k + 1, 0]:g}, {points[k + 1, 1]:g}) repeats {name}[{k}]: give each vertex once; only the "
            "first may be repeated at the end"
        )
    return points


def _feet(control: FloatArray, degree: int, points: FloatArray, parameter: FloatArray) -> FloatArray:
    """Parameters after a Newton step towards the nearest points of the curve, at most a quarter of a span long."""
    n = len(control)
    change = np.roll(control, -1, axis=0) - control
    off = _periodic_basis(parameter, n, degree) @ control - points
    first = _periodic_basis(parameter, n, degree - 1) @ change
    second = _periodic_basis(parameter, n, max(degree - 2, 0)) @ (np.roll(change, -1, axis=0) - change)
    if degree == 1:
        second = np.zeros_like(second)
    slope, square = np.sum(off * first, axis=1), np.sum(first**2, axis=1)
    bend = square + np.sum(off * second, axis=1)
    # Beyond the centre of curvature Newton would climb: the Gauss-Newton step never does.
    step = slope / np.where(bend > 0.0, bend, square)
    moved: FloatArray = (parameter - np.clip(step, -0.25, 0.25)) % n
    return moved


def _periodic_basis(at: FloatArray, n: int, degree: int) -> FloatArray:
    """Uniform periodic B-splines of period ``n`` at the parameters ``at``, shape (len(at), n)."""
    span = np.minimum(np.floor(at).astype(np.int64), n - 1)
    t = at - span
    values = [np.ones_like(t)]
    for p in range(1, degree + 1):  # de Boor's recursion; values[j] belongs to the basis function span - p + j
        grown = [np.zeros_like(t) for _ in range(p + 1)]
        for j, value in enumerate(values):
            right = (j + 1 - t) / p
            grown[j] = grown[j] + right * value
            grown[j + 1] = grown[j + 1] + (1.0 - right) * value
        values = grown
    matrix = np.zeros((len(at), n))
    for j, value in enumerate(values):
        matrix[np.arange(len(at)), (span + j) % n] = value
    return matrix


def polygon(vertices: ArrayLike) -> NurbsCurve:
    """The polygon with these corners [m], counter-clockwise, shape (k, 2), k >= 3: a curve of degree 1.

    The first corner may be repeated at the end.

    Raises
    ------
    InvalidSceneError
        If they are no such points, or the polygon is no outline (see `NurbsCurve`).
    """
    corners = _vertices("vertices", vertices)
    if len(corners) < 3:
        raise InvalidSceneError(f"vertices has {len(corners)} different corners; it must have at least 3")
    knots = np.concatenate([[0.0], np.arange(len(corners) + 1.0), [len(corners)]])
    return NurbsCurve(degree=1, knots=knots, points=np.concatenate([corners, corners[:1]]))


def regular_polygon(faces: int, apothem: float, *, roundness: float = 0.0) -> NurbsCurve:
    """Regular polygon about the origin that stands on a face: at its angle 0 one outward normal is (0, -1).

    Parameters
    ----------
    faces : int
        3 .. `MOST_FACES`.
    apothem : float
        Distance of the faces from the centre [m], > 0.
    roundness : float
        Radius of the arcs that round the corners, over the apothem, in [0, 1): 0 is sharp, 1 would be the inscribed circle. The
        arcs are exact, and the faces' lines are those of the sharp polygon.

    Raises
    ------
    InvalidSceneError
        If a value is out of its range.
    """
    m = whole("faces", faces, 3, MOST_FACES, error=InvalidSceneError)
    height, part = at_least("apothem", apothem, 0.0, strict=True), real(roundness)
    if not 0.0 <= part < 1.0:
        raise InvalidSceneError(
            f"roundness = {short_repr(roundness)} is not allowed: it must be in [0, 1); 1 is a disk"
        )
    half = pi / m
    directions = -0.5 * pi + 2.0 * half * np.arange(m, dtype=np.float64)  # of the faces' outward normals
    normal, along = _directions(directions), _directions(directions + 0.5 * pi)
    reach = height * (1.0 - part) * tan(half)
    end = height * normal + reach * along
    if part == 0.0:
        return polygon(end)
    # Each face and the arc behind it, in quadratic arcs: the face's start, its middle, its end, where its line meets the next one's.
    start = height * normal - reach * along
    crossing = height / cos(half) * _directions(directions + half)
    points = np.stack([start, height * normal, end, crossing], axis=1).reshape(-1, 2)
    weights = np.tile([1.0, 1.0, 1.0, sin(0.5 * pi - half)], m)
    knots = np.concatenate([[0.0], np.repeat(np.arange(2.0 * m + 1.0), 2), [2.0 * m]])
    return NurbsCurve(
        degree=2, knots=knots, points=np.concatenate([points, points[:1]]), weights=np.concatenate([weights, [1.0]])
    )


def _directions(angle: FloatArray) -> FloatArray:
    return np.column_stack([np.cos(angle), np.sin(angle)])


def traced(image: ArrayLike, pixel: float = 1.0) -> FloatArray:
    """Boundary of the true pixels of an image, as a closed polyline.

    Parameters
    ----------
    image : array_like of bool, shape (rows, columns)
        True inside the grain; row 0 is at the top.
    pixel : float
        Width of a pixel [m], > 0.

    Returns
    -------
    ndarray, shape (k, 2)
        Vertices [m], counter-clockwise, each once: middles between the centre of a pixel inside and that of a neighbour outside. The
        lower left pixel's centre is the origin. The boundary of the body of which the image shows the pixel centres
        is within ``pixel/sqrt(2)`` of the polyline wherever it is smooth on the scale of a pixel.

    Raises
    ------
    InvalidSceneError
        If the image is no 2-D array of truth values, is empty, or has several parts or a hole.
    """
    try:
        given = np.empty(()) if np.ma.is_masked(image) else np.asarray(image)
    except Exception as error:  # rows of unequal length, or whatever an object does that is asked to be an array
        raise InvalidSceneError(f"image must be truth values in rows and columns, not {short_repr(image)}") from error
    width = at_least("pixel", pixel, 0.0, strict=True)
    if given.dtype != np.bool_ or given.ndim != 2:
        raise InvalidSceneError(
            f"image has shape {given.shape} and type {given.dtype}; it must be truth values in rows and columns (image > threshold)"
        )
    if not given.any():
        raise InvalidSceneError("image has no true pixel: there is no grain in it")
    inside = np.pad(given[::-1], 1).astype(np.int64)
    kind = inside[:-1, :-1] + 2 * inside[:-1, 1:] + 4 * inside[1:, 1:] + 8 * inside[1:, :-1]
    following: dict[tuple[int, int], tuple[int, int]] = {}
    for row, column in zip(*np.nonzero((kind > 0) & (kind < 15)), strict=True):
        code = int(kind[row, column])
        for sides in SADDLES.get(code, (STEPS.get(code, ""),)):
            places = [(2 * int(column) + MIDDLES[side][0], 2 * int(row) + MIDDLES[side][1]) for side in sides]
            following[places[0]] = places[1]
    first = min(following)
    loop, at = [first], following[first]
    while at != first:
        loop.append(at)
        at = following[at]
    if len(loop) != len(following):
        raise InvalidSceneError(
            "image has more than one boundary: its true pixels form several parts (pixels that touch at a corner only are not connected) "
            "or enclose a hole; keep one part and fill its holes"
        )
    polyline: FloatArray = (0.5 * np.array(loop, dtype=np.float64) - 1.0) * width
    return polyline


def body_shapes(
    outlines: Sequence[NurbsCurve], outline: NDArray[np.int64], radius: FloatArray
) -> tuple[ShapeTable, NDArray[np.int64], FloatArray]:
    """Table of the shapes of n bodies.

    Parameters
    ----------
    outlines : sequence of NurbsCurve
    outline : ndarray of int64, shape (n,)
        Number of each body's outline, -1 for a disk.
    radius : ndarray, shape (n,)
        Radii of the disks [m]; those of other bodies are not read.

    Returns
    -------
    table : ShapeTable
        The outlines in their order, then the circles.
    shape : ndarray of int64, shape (n,)
        Row of each body.
    radii : ndarray
        Radii of the circles [m].
    """
    is_disk = outline < 0
    radii, circle = np.unique(radius[is_disk], return_inverse=True)
    tables = [curve.table for curve in outlines]
    tables += [table_of_circles(_unit_disk().table, radii)] if len(radii) else []
    shape = outline.copy()
    shape[is_disk] = len(outlines) + circle
    return joined_tables(tables), shape, radii


@cache
def _unit_disk() -> NurbsCurve:
    """Its own table takes longer to make than those of a pack's circles."""
    return disk(1.0)
