"""Compiled loops over pairs of bodies: those that are near each other, those whose paths could touch, and the groups that they form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import kernel

Ints = NDArray[np.int64]
ROUNDED = 1.0 + 2.0**-50
"""Squares of distances are widened by it, so that rounding loses no pair."""


@kernel
def sort_into_cells(
    x: FloatArray, low: FloatArray, size: float, shape: Ints, cells: Ints, start: Ints, order: Ints
) -> None:
    """Order bodies by the cell of a grid, x running fastest.

    ``x`` has the shape (n, d), d = 2 or 3; ``shape`` (3,) are the cells along each axis, 1 for one that is not there. ``cells`` (n,) is
    the cell of each body, ``start`` (number of cells + 1) where each cell starts in ``order``.
    """
    n, d = x.shape
    start[:] = 0
    for k in range(n):
        cell = 0
        for axis in range(d - 1, -1, -1):
            at = int((x[k, axis] - low[axis]) / size)
            cell = cell * shape[axis] + min(max(at, 0), shape[axis] - 1)
        cells[k] = cell
        start[cell + 1] += 1
    for cell in range(len(start) - 1):
        start[cell + 1] += start[cell]
    for k in range(n - 1, -1, -1):
        start[cells[k] + 1] -= 1
        order[start[cells[k] + 1]] = k
    # Now start[cell + 1] is where the cell starts.
    for cell in range(len(start) - 1):
        start[cell] = start[cell + 1]
    start[len(start) - 1] = n


@kernel
def near_pairs(x: FloatArray, reach: FloatArray, shape: Ints, start: Ints, order: Ints, pairs: Ints) -> int:
    """Write pairs whose distance is at most the sum of their reaches, as many as there is room for; how many there are.

    Bodies are in the order of `sort_into_cells`, whose cells are no smaller than two reaches; ``order`` gives their numbers. The first
    of a pair has the lower number.
    """
    d = x.shape[1]
    found = 0
    nx, ny, nz = shape[0], shape[1], shape[2]
    for cz in range(nz):
        for cy in range(ny):
            for cx in range(nx):
                cell = (cz * ny + cy) * nx + cx
                begin, end = start[cell], start[cell + 1]
                if begin == end:
                    continue
                for row in range(5):
                    # The rest of this row; the next row of this plane; three rows of the next plane.
                    ry = cy if row == 0 else cy + 1 if row == 1 else cy + row - 3
                    rz = cz if row < 2 else cz + 1
                    if ry < 0 or ry >= ny or rz >= nz:
                        continue
                    first = (rz * ny + ry) * nx
                    from_here = start[first + (cx if row == 0 else max(cx - 1, 0))]
                    to = start[first + min(cx + 1, nx - 1) + 1]
                    for p in range(begin, end):
                        for q in range(p + 1 if row == 0 else from_here, to):
                            square = 0.0
                            for axis in range(d):
                                square += (x[p, axis] - x[q, axis]) ** 2
                            both = reach[p] + reach[q]
                            if square <= both * both * ROUNDED:
                                if found < len(pairs):
                                    i, j = order[p], order[q]
                                    pairs[found, 0], pairs[found, 1] = min(i, j), max(i, j)
                                found += 1
    return found


@kernel
def touching_pairs(
    pairs: Ints, shift: FloatArray, x0: FloatArray, x1: FloatArray, R: FloatArray, bow: FloatArray, use: NDArray[np.bool_],
    kept: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Mark pairs that come nearer than their radii and bows on straight paths from ``x0`` to ``x1``, if one of them is used.

    ``shift`` (k, d) is added to the place of the second.
    """
    d = x0.shape[1]
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        kept[k] = False
        if not (use[i] or use[j]):
            continue
        along = length = 0.0
        for axis in range(d):
            d0 = x0[j, axis] + shift[k, axis] - x0[i, axis]
            way = x1[j, axis] + shift[k, axis] - x1[i, axis] - d0
            along -= d0 * way
            length += way * way
        share = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
        square = 0.0
        for axis in range(d):
            d0 = x0[j, axis] + shift[k, axis] - x0[i, axis]
            way = x1[j, axis] + shift[k, axis] - x1[i, axis] - d0
            square += (d0 + share * way) ** 2
        kept[k] = np.sqrt(square) - R[i] - R[j] <= bow[i] + bow[j]


@kernel
def pair_depths(pairs: Ints, shift: FloatArray, x: FloatArray, R: FloatArray, depth: FloatArray) -> None:
    """Sum of the radii less the distance of each pair; ``shift`` as in `touching_pairs`."""
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        square = 0.0
        for axis in range(x.shape[1]):
            square += (x[j, axis] + shift[k, axis] - x[i, axis]) ** 2
        depth[k] = R[i] + R[j] - np.sqrt(square)


@kernel
def pair_groups(pairs: Ints, joined: NDArray[np.bool_], label: Ints) -> int:
    """Number groups of bodies that ``joined`` pairs connect, in the order of their first bodies; how many there are."""
    n = len(label)
    for k in range(n):
        label[k] = k
    for k in range(len(pairs)):
        if not joined[k]:
            continue
        i, j = pairs[k, 0], pairs[k, 1]
        while label[i] != i:
            label[i] = label[label[i]]
            i = label[i]
        while label[j] != j:
            label[j] = label[label[j]]
            j = label[j]
        label[max(i, j)] = min(i, j)
    groups = 0
    for k in range(n):
        # What a body points to has a lower number and is a group by now.
        if label[k] == k:
            label[k] = groups
            groups += 1
        else:
            label[k] = label[label[k]]
    return groups
