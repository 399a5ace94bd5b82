"""Arrays that the kernels of NURBS contacts read and fill."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.nurbs.curve_kernels import ShapeTable

MOST_ROOTS = 128
"""Intersections of two outlines that are kept."""

STACK = 256
"""Boxes that wait in the subdivision: two for each halving of either curve, far below this."""

ENCLOSED, CROSSED, UNDECIDED, FULL = -1, -2, -3, -4
"""What a pair can be instead of a number of contacts: one outline inside the other; an intersection with more than two corners
whose chords cancel; intersections that could not be distinguished (boundaries that coincide); no room in the output."""

PARALLEL = -6
"""Intersections of straight lines, or at corners, that a small shift can distinguish: tried by `intersect_kernels.placed_contacts`."""

TOO_DEEP = -5
"""A grain that is deeper in a wall, or in another grain, than features are followed."""


class Workspace(NamedTuple):
    """Scratch memory of one thread.

    Attributes
    ----------
    near_a, near_b : ndarray of int64, shape (most pieces of a shape,)
        Pieces that can take part.
    centre : ndarray, shape (most pieces of a shape, 2)
        Centres of the circles of ``near_b`` in the frame of the first shape [m].
    box : ndarray, shape (STACK, 4)
        Ranges of ``u`` on both pieces.
    root : ndarray, shape (MOST_ROOTS, 5)
        Intersections: span and ``u`` on either outline; +1 where the first outline enters the second (or the wall), -1 where it
        leaves.
    """

    near_a: IntArray
    near_b: IntArray
    centre: FloatArray
    box: FloatArray
    root: FloatArray


class ContactRows(NamedTuple):
    """Contacts, one a row.

    Attributes
    ----------
    point : ndarray, shape (k, 2)
        Middle of the chord [m].
    normal : ndarray, shape (k, 2)
        Unit vector at right angles to the chord, from the first body to the second.
    overlap : ndarray, shape (k,)
        Extent of the common area along the normal [m].
    beyond : ndarray, shape (k,)
        How far the first body's outline reaches beyond the chord along the normal [m]; the second one's reaches the rest of the overlap
        to the other side. A wall's surface is the chord's line.
    chord : ndarray, shape (k,)
        Length of the chord [m].
    corners : ndarray of int64, shape (k,)
        Corners of the common area, where the outlines intersect: 2, or more where both cut each other's corners off; ``place`` is
        then that of the first outline's longest chord.
    place : ndarray, shape (k, 4)
        Where the outlines intersect, as span + u + 1/2: the first one entering, the second one there; the first one leaving, the
        second one there. For walls the second ones are NaN.
    """

    point: FloatArray
    normal: FloatArray
    overlap: FloatArray
    beyond: FloatArray
    chord: FloatArray
    corners: IntArray
    place: FloatArray


class FeatureRows(NamedTuple):
    """Places where two bodies are nearest, one a row.

    Attributes
    ----------
    first, second : ndarray, shape (k, 2)
        From the first body's position to the point of its outline, and the same for the second [m]; a wall's point is measured from the
        body's position.
    normal : ndarray, shape (k, 2)
        Unit vector from the first body to the second.
    gap : ndarray, shape (k,)
        Distance of the points along the normal [m], negative where the bodies overlap.
    place : ndarray, shape (k, 2)
        Places on the outlines, span + u + 1/2; 0 on a wall.
    """

    first: FloatArray
    second: FloatArray
    normal: FloatArray
    gap: FloatArray
    place: FloatArray


def workspace(table: ShapeTable) -> Workspace:
    """Scratch memory for the shapes of ``table``."""
    most = int(np.diff(table.first_piece).max())
    return Workspace(
        near_a=np.zeros(most, dtype=np.int64),
        near_b=np.zeros(most, dtype=np.int64),
        centre=np.zeros((most, 2)),
        box=np.zeros((STACK, 4)),
        root=np.zeros((MOST_ROOTS, 5)),
    )


def contact_rows(k: int) -> ContactRows:
    """Room for ``k`` contacts."""
    return ContactRows(
        point=np.zeros((k, 2)),
        normal=np.zeros((k, 2)),
        overlap=np.zeros(k),
        beyond=np.zeros(k),
        chord=np.zeros(k),
        corners=np.zeros(k, dtype=np.int64),
        place=np.zeros((k, 4)),
    )


def feature_rows(k: int) -> FeatureRows:
    """Room for ``k`` features."""
    return FeatureRows(
        first=np.zeros((k, 2)),
        second=np.zeros((k, 2)),
        normal=np.zeros((k, 2)),
        gap=np.zeros(k),
        place=np.zeros((k, 2)),
    )


class Vertices(NamedTuple):
    """Vertices of the shapes of a table, n of them, and which of its m pieces are straight.

    Attributes
    ----------
    first : ndarray of int64, shape (s + 1,)
        Vertices ``first[k] .. first[k+1]-1`` belong to shape ``k``.
    place : ndarray, shape (n,)
        Place on the outline, span + u + 1/2.
    point : ndarray, shape (n, 2)
        In the shape's frame [m].
    cone : ndarray, shape (n, 4)
        Outward unit normals before and after the vertex; equal ones at the end of a straight part that goes on smoothly.
    straight : ndarray of bool, shape (m,)
    """

    first: IntArray
    place: FloatArray
    point: FloatArray
    cone: FloatArray
    straight: NDArray[np.bool_]
