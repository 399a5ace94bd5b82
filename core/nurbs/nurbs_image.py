"""The outline of a grain from an image: marching squares, then a fitted curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.nurbs.shapes import Fit, fitted
from ninedisk.core.validate import FloatArray, at_least, shown

STEPS = {1: "bl", 2: "rb", 3: "rl", 4: "tr", 6: "tb", 7: "tl", 8: "lt", 9: "bt", 11: "rt", 12: "lr", 13: "br", 14: "lb"}
"""Sides (left, bottom, right, top) where the boundary enters and leaves a cell whose corners, counter-clockwise from below left, are bits
1, 2, 4, 8 if inside; it runs with the inside on its left. Cells 5 and 10, with two opposite corners inside, have two parts each: pixels
touching at a corner only are not connected."""

SADDLES = {5: ("bl", "tr"), 10: ("rb", "lt")}

MIDDLES = {"l": (0, 1), "b": (1, 0), "r": (2, 1), "t": (1, 2)}
"""Middles of a cell's sides, in halves of a pixel from below left."""


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
        raise InvalidSceneError(f"image must be truth values in rows and columns, not {shown(image)}") from error
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


def fitted_image(image: ArrayLike, n: int, *, pixel: float = 1.0, degree: int = 3) -> Fit:
    """Smooth outline of the true pixels of an image (see `traced`), with ``n`` different control points.

    Returns
    -------
    Fit
        Its ``largest`` is the largest distance of the traced vertices from the curve [m]; the traced polyline itself is as far off as
        `traced` says.
    """
    return fitted(traced(image, pixel), n, degree=degree)
