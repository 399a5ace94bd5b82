"""Vectors of two or three components, pairs of bodies in a periodic cell or none, and cones of impulses: one code for both dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray

EDGES = 24
"""Rays that replace a cone of friction in space, drawn around it: 0.9 % wider than the cone at most, so that none inside is accused."""

SMALL = 500
"""Vectors up to which NumPy's own loops are as fast as compiled ones."""
CELLS = 8
"""Cells of a grid for each body up to which one is used."""
PAIRS = 4
"""Pairs for each body for which there is memory before they are counted."""


def norm(array: Any) -> Any:
    """Lengths of vectors, the last axis."""
    array = np.asarray(array)
    if array.ndim == 2 and len(array) > SMALL:
        from ninedisk.harness.audit.sums import row_lengths

        found = np.empty(len(array))
        row_lengths(np.ascontiguousarray(array, dtype=float), found)
        return found
    return np.sqrt(np.einsum("...i,...i->...", array, array))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Moment of ``b`` at the arm ``a``: one component in the plane, three in space."""
    if np.shape(a)[-1] == 2:
        return np.asarray(a[..., :1] * b[..., 1:] - a[..., 1:] * b[..., :1])
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def turning(rate: FloatArray, arm: FloatArray) -> FloatArray:
    """Velocity at an arm of what turns at a rate (one component in the plane, three in space)."""
    if np.shape(arm)[-1] == 2:
        return np.stack([-rate[..., 0] * arm[..., 1], rate[..., 0] * arm[..., 0]], axis=-1)
    return cross(np.broadcast_to(rate, np.shape(arm)), arm)


def close_pairs(
    x: FloatArray, reach: FloatArray, cell: FloatArray | None = None
) -> tuple[NDArray[np.int64], FloatArray]:
    """Pairs whose distance is at most the sum of their reaches; few that reach far do not slow the rest.

    Parameters
    ----------
    x, reach : ndarray, shape (n, d) and (n,)
    cell : ndarray, shape (p, d), or None
        Edges along which everything repeats.

    Returns
    -------
    ndarray, shape (k, 2), and ndarray, shape (k, d)
        Numbers, and what is to be added to the second's place to be the nearest to the first.
    """
    d = x.shape[1]
    if len(x) < 2 and cell is None:
        return np.empty((0, 2), dtype=np.int64), np.empty((0, d))
    if cell is None or not len(cell):
        pairs = _plain_pairs(x, reach)
        return pairs, np.zeros((len(pairs), d))
    offset = np.floor(x @ np.linalg.pinv(cell)) @ cell
    home = x - offset
    share = home @ np.linalg.pinv(cell)
    # Heights of the cell above each of its faces, along which a reach is a share.
    heights = 1.0 / norm(np.linalg.pinv(cell).T)
    near = np.minimum(2.0 * float(reach.max()) / heights, 1.0)
    places, owners, shifts = [home], [np.arange(len(x))], [np.zeros((len(x), d))]
    for steps in product((-1, 0, 1), repeat=len(cell)):
        if not any(steps):
            continue
        image = share + steps
        inside = ((image > -near) & (image < 1.0 + near)).all(axis=1)
        at = np.flatnonzero(inside)
        move = np.asarray(steps, dtype=float) @ cell
        places.append(home[at] + move)
        owners.append(at)
        shifts.append(np.broadcast_to(move, (len(at), d)))
    owner, shift = np.concatenate(owners), np.concatenate(shifts)
    found = _plain_pairs(np.concatenate(places), reach[owner])
    found = found[found[:, 0] < len(x)]
    i, j, move = owner[found[:, 0]], owner[found[:, 1]], shift[found[:, 1]]
    kept = (i < j) | ((found[:, 1] < len(x)) & (i != j))
    i, j, move = i[kept], j[kept], move[kept]
    return np.column_stack([i, j]), move - offset[j] + offset[i]


def _plain_pairs(x: FloatArray, reach: FloatArray) -> NDArray[np.int64]:
    if len(x) < 2:
        return np.empty((0, 2), dtype=np.int64)
    common = 3.0 * float(reach.min())
    if float(reach.max()) > common:
        common = 3.0 * float(np.median(reach))
    far = np.flatnonzero(reach > common)
    if not len(far):
        return _usual_pairs(x, reach)
    usual = np.flatnonzero(reach <= common)
    pairs = usual[_usual_pairs(x[usual], reach[usual])].reshape(-1, 2)
    everyone = np.arange(len(x))
    extra = []
    for i in far:
        others = everyone[norm(x - x[i]) <= reach + reach[i]]
        extra.append(np.column_stack([np.full(len(others) - 1, i), others[others != i]]))
    return np.unique(np.sort(np.vstack([pairs, *extra]), axis=1), axis=0)


def _usual_pairs(x: FloatArray, reach: FloatArray) -> NDArray[np.int64]:
    """Pairs of bodies whose reaches differ little."""
    from ninedisk.harness.audit.kernels import near_pairs, sort_into_cells

    n = len(x)
    if n < 2:
        return np.empty((0, 2), dtype=np.int64)
    size = 2.0 * float(reach.max()) * (1.0 + 1e-9)
    low, high = (np.array([end(column) for column in x.T]) for end in (np.min, np.max))
    shape = np.ones(3)
    shape[: x.shape[1]] = np.floor((high - low) / size) + 1.0 if size > 0.0 else np.inf
    if not shape.prod() <= CELLS * n + 1000:
        return _tree_pairs(x, reach)
    counts = shape.astype(np.int64)
    cells, order = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    start = np.empty(int(counts.prod()) + 1, dtype=np.int64)
    sort_into_cells(np.ascontiguousarray(x), low, size, counts, cells, start, order)
    sorted_x, sorted_reach = x[order], reach[order]
    pairs = np.empty((PAIRS * n, 2), dtype=np.int64)
    found = near_pairs(sorted_x, sorted_reach, counts, start, order, pairs)
    if found > len(pairs):
        pairs = np.empty((found, 2), dtype=np.int64)
        near_pairs(sorted_x, sorted_reach, counts, start, order, pairs)
    return pairs[:found]


def _tree_pairs(x: FloatArray, reach: FloatArray) -> NDArray[np.int64]:
    """The same of bodies that are so far apart that most cells of a grid would be empty."""
    from scipy.spatial import cKDTree

    tree = cKDTree(x, balanced_tree=False, compact_nodes=False)
    pairs = tree.query_pairs(2.0 * float(reach.max()), output_type="ndarray")
    close: NDArray[np.bool_] = norm(x[pairs[:, 0]] - x[pairs[:, 1]]) <= reach[pairs[:, 0]] + reach[pairs[:, 1]]
    return np.asarray(pairs[close], dtype=np.int64)


def tangents(normal: FloatArray) -> FloatArray:
    """One (in the plane) or two unit vectors across a normal."""
    if len(normal) == 2:
        return np.array([[-normal[1], normal[0]]])
    least = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, least)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])


def friction_rays(normal: FloatArray, mu: float | None) -> FloatArray:
    """Rays whose sums are the impulses that a wall can give: exact in the plane, around the cone in space; no mu: the half-space."""
    across = tangents(normal)
    if mu is None:
        return np.vstack([normal, across, -across])
    if len(normal) == 2:
        return np.vstack([normal + mu * across[0], normal - mu * across[0]])
    if mu == 0.0:
        return np.asarray(normal[None])
    angle = 2.0 * np.pi * np.arange(EDGES) / EDGES
    ring = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    return np.asarray(normal + mu / np.cos(np.pi / EDGES) * ring)


@dataclass(frozen=True, eq=False)
class Cone:
    """Sums of rays with factors >= 0.

    Attributes
    ----------
    rays : ndarray, shape (r, d)
    wall : (ndarray, float or None) or None
        Normal and mu where it is the cone of one wall, whose distance has a closed form.
    """

    rays: FloatArray
    wall: tuple[FloatArray, float | None] | None = None

    @cached_property
    def whole(self) -> bool:
        """Whether every vector is inside."""
        d = self.rays.shape[1]
        return self.wall is None and all(
            self._nearest(sign * axis)[1] < 1e-9 for axis in np.eye(d) for sign in (1.0, -1.0)
        )

    def _nearest(self, vector: FloatArray) -> tuple[FloatArray, float]:
        from scipy.optimize import nnls

        size = float(np.linalg.norm(vector))
        if size == 0.0:
            return vector, 0.0
        factors, off = nnls(self.rays.T, vector / size)
        return np.asarray(factors @ self.rays * size), float(off * size)

    def distance(self, vectors: FloatArray) -> FloatArray:
        """Distances of vectors (k, d), 0 inside."""
        if self.wall is None:
            return np.array([self._nearest(each)[1] if np.isfinite(each).all() else np.inf for each in vectors])
        normal, mu = self.wall
        up = vectors @ normal
        if mu is None:
            return np.asarray(np.maximum(-up, 0.0))
        along = norm(vectors - up[:, None] * normal)
        ray = np.maximum((up + mu * along) / (1.0 + mu * mu), 0.0)
        return np.where(along <= mu * up, 0.0, np.hypot(up - ray, along - mu * ray))

    def nearest(self, vector: FloatArray) -> FloatArray:
        """The vector of the cone that is nearest."""
        if self.distance(vector[None])[0] == 0.0:
            return vector
        return self._nearest(vector)[0]


def joined(cones: Sequence[Cone]) -> Cone:
    """The cone of the sums of members of several."""
    if len(cones) == 1:
        return cones[0]
    return Cone(np.unique(np.vstack([cone.rays for cone in cones]).round(12), axis=0))
