"""Outlines to begin with: exact disk and ellipse, and the fit of a closed polyline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve import MOST_DEGREE, MOST_POINTS, NurbsCurve
from ninedisk.core.validate import FloatArray, at_least, numbers, whole

QUARTERS = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0])
MOST_ROUNDS = 1_000
"""Rounds of a fit; parameters have settled after some ten."""
SQUARE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=np.float64)
EXACT_WEIGHTS = np.array([1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0])
"""Weights of a full circle in four quadratic quarters, alternately ``((1 - t^2), 2 t)/(1 + t^2)`` and its mirror image.

The usual weights, 1 and sqrt(1/2) in turn, cannot be written in binary numbers: their curve is off the circle by round-off.
With these, weights and control points are exact, and so is the circle."""


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
        Vertices [m], counter-clockwise, each once; k > n.
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
    points = numbers("outline", outline)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise InvalidSceneError(f"outline has shape {points.shape}; it must be finite numbers of shape (k, 2)")
    degree = whole("degree", degree, 1, MOST_DEGREE, error=InvalidSceneError)
    n = whole("n", n, 1, MOST_POINTS - degree, error=InvalidSceneError)
    rounds = whole("rounds", rounds, 0, MOST_ROUNDS, error=InvalidSceneError)
    if not degree < n < len(points):
        raise InvalidSceneError(
            f"n = {n} is not allowed: it must be > {degree}, the degree, and < {len(points)}, the points"
        )
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    if steps.min() == 0.0:
        raise InvalidSceneError(f"outline[{int(np.argmin(steps))}] is repeated: each vertex may occur once")
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
