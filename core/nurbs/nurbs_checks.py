"""What a NURBS outline must fulfil to be the boundary of a grain."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.curve_kernels import ShapeTable
from ninedisk.core.nurbs.table import outline_points
from ninedisk.core.validate import FloatArray, finite, numbers

SEGMENTS = 12
"""Straight segments into which a piece, turning by 0.6 rad at most, is divided to look for crossings."""

FLAT = 1e-9
"""Enclosed area over squared perimeter below which an outline is taken as having no area; a disk has 1/(4 pi)."""


def check_weights(weights: ArrayLike, n: int) -> FloatArray:
    """Read-only weights, one for each of the ``n`` control points and all > 0, or `InvalidSceneError`."""
    checked = finite("weights", numbers("weights", weights), (n,))
    if checked.min() <= 0.0:
        k = int(np.argmin(checked))
        raise InvalidSceneError(f"weights[{k}] = {checked[k]:g} is not allowed: it must be > 0")
    return checked


def check_knots(knots: ArrayLike, n: int, degree: int) -> FloatArray:
    """Read-only knots of ``n`` control points, or `InvalidSceneError`."""
    given = numbers("knots", knots)
    if given.shape != (n + degree + 1,):
        raise InvalidSceneError(
            f"there are {given.size} knots; {n} control points of degree {degree} need {n + degree + 1} (points + degree + 1)"
        )
    checked = finite("knots", given, (n + degree + 1,))
    falling = np.flatnonzero(np.diff(checked) < 0.0)
    if len(falling):
        k = int(falling[0])
        raise InvalidSceneError(f"knots must not decrease: knots[{k + 1}] = {checked[k + 1]:g} follows {checked[k]:g}")
    low, high = checked[degree], checked[n]
    if not low < high:
        raise InvalidSceneError(f"knots[{degree}] .. knots[{n}], the curve's range, is empty: both are {low:g}")
    inner, times = np.unique(checked[(checked > low) & (checked < high)], return_counts=True)
    if len(inner) and times.max() > degree:
        k = int(np.argmax(times))
        raise InvalidSceneError(
            f"knot {inner[k]:g} occurs {times[k]} times; more than degree = {degree} would tear the curve"
        )
    return checked


def check_outline(table: ShapeTable) -> None:
    """Raise `InvalidSceneError` unless the one shape of ``table`` moves on everywhere, runs counter-clockwise and is simple.

    Crossings are sought on the polygon of `SEGMENTS` points a piece: passages narrower than its distance from the curve, about
    1e-3 of a piece's length, cannot be told from crossings.
    """
    points = []
    for k in range(len(table.piece_span)):
        low, high = table.piece_range[k]
        u = np.linspace(low, high, SEGMENTS + 1)
        span = int(table.piece_span[k])
        place, slope, _ = outline_points(table.coef[span : span + 1], u)
        if np.linalg.norm(slope[0], axis=1).min() <= 1e-9 * table.radius[0]:
            raise InvalidSceneError(
                f"the curve stands still near ({place[0, 0, 0]:g}, {place[0, 0, 1]:g}): "
                "make a corner by a knot repeated degree times, not by repeated control points"
            )
        points.append(place[0, :-1])
    polygon = np.concatenate(points)
    following = np.roll(polygon, -1, axis=0)
    area = 0.5 * float(np.sum(polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]))
    perimeter = float(np.linalg.norm(following - polygon, axis=1).sum())
    crossing = first_crossing(polygon)
    if abs(area) <= FLAT * perimeter**2:
        raise InvalidSceneError(f"the outline has zero area ({area:g} m^2 at a perimeter of {perimeter:g} m)")
    if crossing is not None:
        raise InvalidSceneError(
            f"the outline crosses itself near ({crossing[0]:g}, {crossing[1]:g}): a grain's boundary is simple"
        )
    if area < 0.0:
        raise InvalidSceneError(
            f"the outline runs clockwise (area {area:g} m^2): reverse its control points, weights and knots"
        )


def first_crossing(polygon: FloatArray) -> FloatArray | None:
    """A point where two segments of a closed polygon, not neighbours, meet; None if there is none."""
    n = len(polygon)
    along = np.roll(polygon, -1, axis=0) - polygon
    low, high = np.minimum(polygon, polygon + along), np.maximum(polygon, polygon + along)
    x, y = ((low[:, None, k] <= high[None, :, k]) & (low[None, :, k] <= high[:, None, k]) for k in (0, 1))
    i, j = np.nonzero(np.triu(x & y, 2))
    apart = (i > 0) | (j < n - 1)
    i, j = i[apart], j[apart]
    start = polygon[j] - polygon[i]
    cross = along[i, 0] * along[j, 1] - along[i, 1] * along[j, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        mine = (start[:, 0] * along[j, 1] - start[:, 1] * along[j, 0]) / cross
        its = (start[:, 0] * along[i, 1] - start[:, 1] * along[i, 0]) / cross
    met = np.flatnonzero((cross != 0.0) & (mine >= 0.0) & (mine <= 1.0) & (its >= 0.0) & (its <= 1.0))
    if not len(met):
        return None
    meeting: FloatArray = polygon[i[met[0]]] + mine[met[0]] * along[i[met[0]]]
    return meeting
