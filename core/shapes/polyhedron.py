"""Convex polyhedra: faces, edges and mass from vertices."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.shapes.state import VERTICES
from ninedisk.core.validate import finite, rows_of

FLAT = 1e-9
"""Distance over the size of a polyhedron within which vertices are in one plane, on one edge or the same."""

LARGEST, SMALLEST = 1e60, 1e-60
"""Sizes [m] of polyhedra: moments of inertia are fifth powers."""

ROUNDING = 64 * float(np.finfo(np.float64).eps)
"""Rounding of sums over all tetrahedra of a polyhedron, over the sum of their sizes."""


@dataclass(frozen=True, eq=False)
class ConvexPolyhedron:
    """Solid convex polyhedron of uniform density, in a frame of its body with the centre of mass at the origin.

    The order in which vertices are given has no effect: they are sorted by x, then y, then z. Volume, first and second moments are sums
    over tetrahedra with closed forms (Tonon, J. Math. Stat. 1, 8-11, 2004).

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Corners [m], 4 to 64, in any axes about any origin.

    Attributes
    ----------
    vertices : ndarray, shape (v, 3)
        Sorted corners about the centre of mass [m].
    faces : tuple of tuple of int
        Vertices of each face, counter-clockwise from outside, the lowest one first.
    normals : ndarray, shape (f, 3)
        Outward unit normals of the faces.
    offsets : ndarray, shape (f,)
        Distances of the faces from the centre of mass [m].
    edges : ndarray of int64, shape (e, 4)
        Two vertices, the lower one first, and the faces to the left and to the right, seen from outside.
    directions : ndarray, shape (d, 3)
        Directions of the edges as unit vectors, one for parallel edges; the first component that is not 0 is positive.
    volume : float
        Volume [m^3].
    centre : ndarray, shape (3,)
        Centre of mass in the axes of the vertices that were given [m].
    inertia : ndarray, shape (3, 3)
        Inertia tensor about the centre of mass over the density [m^5].
    moments : ndarray, shape (3,)
        Principal moments of inertia over the density [m^5].
    axes : ndarray, shape (3, 3)
        Principal axes as columns, right-handed; the unit matrix if the tensor is diagonal.
    radius : float
        Largest distance of a vertex from the centre of mass [m].

    Raises
    ------
    InvalidSceneError
        If the vertices are not finite, too few or too many, in one plane within 1e-9 of their size, or not all corners of their hull.

    Examples
    --------
    The corner of a cube, cut off by its diagonals, has an area of sqrt(3)/2 opposite to the right angles:

    >>> corner = ConvexPolyhedron([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> corner.centre
    array([0.25, 0.25, 0.25])
    >>> round(6.0 * corner.volume, 12), len(corner.faces), len(corner.edges)
    (1.0, 4, 6)
    >>> ConvexPolyhedron([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    Traceback (most recent call last):
    ninedisk.core.errors.InvalidSceneError: the vertices of a polyhedron are in one plane within 1e-09 of their size: ...
    """

    vertices: FloatArray
    faces: tuple[tuple[int, ...], ...] = field(init=False)
    normals: FloatArray = field(init=False)
    offsets: FloatArray = field(init=False)
    edges: IntArray = field(init=False)
    directions: FloatArray = field(init=False)
    volume: float = field(init=False)
    centre: FloatArray = field(init=False)
    inertia: FloatArray = field(init=False)
    moments: FloatArray = field(init=False)
    axes: FloatArray = field(init=False)
    radius: float = field(init=False)

    __hash__ = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        given = _checked(self.vertices)
        order = np.lexsort(given.T[::-1])
        points = given[order]
        # A scale that is a power of 2 rounds nothing, and keeps fifth powers in range.
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        size = float(np.abs(points - middle).max())
        scale = 2.0 ** np.ceil(np.log2(size)) if size > 0.0 else 1.0
        points = (points - middle) / scale
        _refuse_flat(points)
        near = np.linalg.norm(points[:, None] - points[None], axis=2) <= FLAT
        _refuse_inner(np.triu(near, 1).any(axis=0), order)
        faces, normals = _faces(points)
        _refuse_inner(np.bincount([each for loop in faces for each in loop], minlength=len(order)) < 3, order)
        edges = _edges(faces)
        volume, centroid, inertia = _mass(points, faces)
        points = points - centroid
        moments, axes = _principal(inertia)
        found = {
            "vertices": points * scale,
            "faces": faces,
            "normals": normals,
            "offsets": (points @ normals.T).max(axis=0) * scale,
            "edges": edges,
            "directions": _directions(points, edges),
            "volume": volume * scale**3,
            "centre": middle + centroid * scale,
            "inertia": inertia * scale**5,
            "moments": moments * scale**5,
            "axes": axes,
            "radius": float(np.linalg.norm(points, axis=1).max()) * float(scale),
        }
        for name, value in found.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, float(value) if name == "volume" else value)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ConvexPolyhedron):
            return NotImplemented
        return np.array_equal(self.vertices, other.vertices) and np.array_equal(self.centre, other.centre)

    @classmethod
    def box(cls, half_extents: ArrayLike) -> ConvexPolyhedron:
        """Make a box whose edges are along the axes of its body.

        Parameters
        ----------
        half_extents : array_like, shape (3,)
            Half the lengths of the edges along x, y and z [m], > 0.

        Raises
        ------
        InvalidSceneError
            If a length is not allowed.

        Examples
        --------
        Of mass m, a box has the moment of inertia ``m (a^2 + b^2)/3`` about an axis at right angles to half extents a and b:

        >>> box = ConvexPolyhedron.box([1.0, 2.0, 3.0])
        >>> box.volume, box.radius**2
        (48.0, 14.0)
        >>> np.round(3.0 * box.moments / box.volume, 12)
        array([13., 10.,  5.])
        """
        half = finite("half_extents", half_extents, (3,))
        if not np.all(half > 0.0):
            raise InvalidSceneError(f"half_extents = {half.tolist()} is not allowed: all three must be > 0")
        signs = np.array([[i, j, k] for i in (-1.0, 1.0) for j in (-1.0, 1.0) for k in (-1.0, 1.0)])
        return cls(signs * half)


def _checked(vertices: ArrayLike) -> FloatArray:
    points = rows_of("vertices", vertices, 3)
    if not 4 <= len(points) <= VERTICES:
        raise InvalidSceneError(
            f"a polyhedron of {len(points)} vertices is not allowed: it must have 4 to {VERTICES}; leave out vertices"
        )
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InvalidSceneError(f"vertex {bad[0]} = {points[bad[0]].tolist()} is not allowed: it must be finite")
    if np.abs(points).max() > LARGEST or 0.0 < np.ptp(points, axis=0).max() < SMALLEST:
        raise InvalidSceneError(
            f"a polyhedron with coordinates up to {np.abs(points).max():g} and a size of {np.ptp(points, axis=0).max():g} is not "
            f"allowed: they must lie between {SMALLEST:g} and {LARGEST:g}; change units"
        )
    return points


def _refuse_flat(points: FloatArray) -> None:
    """Refuse points, of size 1, that have no thickness."""
    widths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if widths[2] <= FLAT * max(1.0, widths[0]):
        raise InvalidSceneError(
            f"the vertices of a polyhedron are in one plane within {FLAT:g} of their size: give a solid one"
        )


def _faces(points: FloatArray) -> tuple[tuple[tuple[int, ...], ...], FloatArray]:
    """Loops and unit normals of the faces of the hull of points of size 1.

    Each plane through three points that has all the others behind it is that of a face. Of the triples of a face the one with the
    largest area decides which points are in it.
    """
    triple = np.array(list(combinations(range(len(points)), 3)))
    first, a, b = points[triple[:, 0]], points[triple[:, 1]], points[triple[:, 2]]
    normal = np.cross(a - first, b - first)
    area = np.linalg.norm(normal, axis=1)
    longest = np.max([np.linalg.norm(side, axis=1) for side in (a - first, b - first, b - a)], axis=0)
    keep = area > FLAT * longest  # the height of the triangle
    triple, first, normal, area = triple[keep], first[keep], normal[keep] / area[keep, None], area[keep]
    height = normal @ points.T - np.sum(normal * first, axis=1)[:, None]
    below, above = height.max(axis=1) <= FLAT, height.min(axis=1) >= -FLAT
    members: list[NDArray[np.bool_]] = []
    planes = np.flatnonzero(below | above)
    for k in planes[np.argsort(-area[planes], kind="stable")]:
        if not any(inside[triple[k]].all() for inside in members):
            members.append(np.abs(height[k]) <= FLAT)
    found = sorted(_loop(points, np.flatnonzero(inside)) for inside in members)
    normals = np.array([_newell(points[list(loop)]) for loop in found]).reshape(-1, 3)
    return tuple(found), normals / np.linalg.norm(normals, axis=1)[:, None]


def _newell(loop: FloatArray) -> FloatArray:
    """Twice the area of a loop, as a vector along its normal."""
    arms = loop - loop[0]
    total: FloatArray = np.cross(arms[1:-1], arms[2:]).sum(axis=0)
    return total


def _loop(points: FloatArray, members: IntArray) -> tuple[int, ...]:
    """Order the members of a face counter-clockwise from outside, the lowest first."""
    centre = points[members].mean(axis=0)
    arms = points[members] - centre
    _, _, frame = np.linalg.svd(arms)
    angle = np.arctan2(arms @ frame[1], arms @ frame[0])
    order = members[np.argsort(angle)]
    if _newell(points[order]) @ (centre - points.mean(axis=0)) < 0.0:
        order = order[::-1]
    order = np.roll(order, -int(np.argmin(order)))
    return tuple(int(each) for each in order)


def _refuse_inner(found: NDArray[np.bool_], order: IntArray) -> None:
    """Refuse points that are no corners, by their numbers among those that were given."""
    inner = sorted(int(each) for each in order[found])
    if inner:
        many = len(inner) > 1
        raise InvalidSceneError(
            f"{'vertices' if many else 'vertex'} {', '.join(map(str, inner))} {'are no corners' if many else 'is no corner'} of the "
            f"polyhedron: inside it, on a face or an edge, or on another vertex within {FLAT:g} of its size; leave out "
            f"{'those' if many else 'it'}"
        )


def _edges(faces: tuple[tuple[int, ...], ...]) -> IntArray:
    """Edges of closed loops, each with its two faces."""
    side: dict[tuple[int, int], int] = {}
    twice = False
    for f, loop in enumerate(faces):
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            twice = twice or (a, b) in side
            side[a, b] = f
    if twice or any((b, a) not in side for a, b in side):
        raise InvalidSceneError(
            f"faces of the polyhedron meet at angles too small for their size: planes and vertices within {FLAT:g} of its size are "
            "the same; leave out vertices that are nearly in the plane of others"
        )
    return np.array([(a, b, side[a, b], side[b, a]) for a, b in sorted(side) if a < b], dtype=np.int64)


def _directions(points: FloatArray, edges: IntArray) -> FloatArray:
    """Give unit vectors along edges, each once."""
    along = points[edges[:, 1]] - points[edges[:, 0]]
    along = along / np.linalg.norm(along, axis=1)[:, None]
    kept: list[FloatArray] = []
    for each in along:
        # Between unit vectors the sine of the angle, as a vector product has it to rounding.
        if all(np.linalg.norm(np.cross(each, other)) > FLAT for other in kept):
            lead = each[np.argmax(np.abs(each) > FLAT)]
            kept.append(np.sign(lead) * each + 0.0)
    return np.array(kept)


def _mass(points: FloatArray, faces: tuple[tuple[int, ...], ...]) -> tuple[float, FloatArray, FloatArray]:
    """Volume, centroid and inertia tensor about the centroid, of density 1."""
    corners = np.array([(loop[0], b, c) for loop in faces for b, c in pairwise(loop[1:])])
    a, b, c = (points[corners[:, k]] for k in range(3))
    volumes = np.sum(a * np.cross(b, c), axis=1) / 6.0
    volume = float(volumes.sum())
    centroid = (volumes @ (a + b + c)) / (4.0 * volume)
    # The middle of the box around a body with a centre of symmetry is the centroid: no rounding moves its vertices.
    centroid[np.abs(centroid) <= ROUNDING] = 0.0
    a, b, c = a - centroid, b - centroid, c - centroid
    volumes = np.sum(a * np.cross(b, c), axis=1) / 6.0
    total = a + b + c
    second = sum(np.einsum("t,ti,tj->ij", volumes, each, each) for each in (a, b, c, total)) / 20.0
    inertia: FloatArray = -0.5 * (second + second.T)
    x, y, z = np.diag(second)
    np.fill_diagonal(inertia, [y + z, x + z, x + y])  # no difference with the trace: that of a needle would lose digits
    return volume, centroid, inertia


def _principal(inertia: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal moments and axes; those of the body's frame where the tensor is diagonal to rounding."""
    diagonal = np.diag(inertia).copy()
    if np.abs(inertia - np.diag(diagonal)).max() <= ROUNDING * diagonal.sum():
        return diagonal, np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    lead = np.argmax(np.abs(axes) > 0.5, axis=0)  # of three components of a unit vector one is above 0.57
    axes = axes * np.sign(axes[lead, np.arange(3)])
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return moments, axes
