"""Points of outlines that touch before a smooth part does: convex corners, and the ends of straight parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.nurbs.curve_kernels import ShapeTable, sample

FloatArray = NDArray[np.float64]

STRAIGHT = 1e-9
"""Turning of the tangent [rad] up to which a piece counts as straight: rounding of its control points."""

CORNER = 1e-6
"""Turning between two pieces [rad] from which there is a corner: a fitted outline with continuous tangents stays far below."""

PLACES = 5
"""Points of a piece at which its curvature is looked at."""


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

    first: NDArray[np.int64]
    place: FloatArray
    point: FloatArray
    cone: FloatArray
    straight: NDArray[np.bool_]


def vertices_of(table: ShapeTable) -> Vertices:
    """Vertices of all shapes; corners that point inwards touch nothing before their neighbours do and are none."""
    straight = np.zeros(len(table.piece_span), dtype=np.bool_)
    counts: list[int] = []
    rows: list[list[float]] = []
    for shape in range(len(table.degree)):
        pieces = range(int(table.first_piece[shape]), int(table.first_piece[shape + 1]))
        ends = {k: _ends(table, shape, k) for k in pieces}
        for k in pieces:
            straight[k] = ends[k][2]
        before = len(rows)
        for k, last in zip(pieces, [pieces[-1], *pieces[:-1]], strict=True):
            (_, normal, _), here = ends[last], ends[k]
            turn = np.arctan2(normal[0] * here[0][5] - normal[1] * here[0][4], normal @ here[0][4:6])
            if turn > CORNER or (abs(turn) <= CORNER and straight[k] != straight[last]):
                rows.append([here[0][0], *here[0][1:3], *normal, *here[0][4:6]])
        counts.append(len(rows) - before)
    found = np.array(rows, dtype=np.float64).reshape(len(rows), 7)
    return Vertices(
        first=np.cumsum([0, *counts]).astype(np.int64),
        place=found[:, 0].copy(),
        point=found[:, 1:3].copy(),
        cone=found[:, 3:7].copy(),
        straight=straight,
    )


def _ends(table: ShapeTable, shape: int, k: int) -> tuple[FloatArray, FloatArray, bool]:
    """Place, point, 0 and normal at the start of a piece; the normal at its end; whether it is straight."""
    u = np.linspace(table.piece_range[k, 0], table.piece_range[k, 1], PLACES)
    out = np.empty((PLACES, 6))
    sample(table, shape, np.full(PLACES, table.piece_span[k]), u, out)
    speed = np.hypot(out[:, 2], out[:, 3])
    turning = np.abs(out[:, 2] * out[:, 5] - out[:, 3] * out[:, 4]) / speed**2 * (u[-1] - u[0])
    normal = np.column_stack([out[:, 3], -out[:, 2]]) / speed[:, None]
    start = np.array([table.piece_span[k] + u[0] + 0.5, out[0, 0], out[0, 1], 0.0, *normal[0]])
    return start, normal[-1], bool(turning.max() <= STRAIGHT)
