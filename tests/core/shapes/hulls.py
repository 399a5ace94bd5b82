"""Independent truths about convex bodies: hulls of Qhull, distances by Lawson and Hanson's method, surfaces of gaps by half-spaces."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog, nnls
from scipy.spatial import ConvexHull, HalfspaceIntersection

EPS = float(np.finfo(float).eps)


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """Matrix of a unit quaternion (w, x, y, z), column by column from the products of quaternions."""
    w, v = quaternion[0], np.asarray(quaternion[1:])
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Quaternion of the rotation q followed by p."""
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def about(axis: object, angle: float) -> np.ndarray:
    """Quaternion of a rotation about an axis."""
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return np.array([np.cos(0.5 * angle), *(np.sin(0.5 * angle) * unit)])


def random_turn(rng: np.random.Generator) -> np.ndarray:
    """Uniformly random unit quaternion."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_corners(rng: np.random.Generator, count: int) -> np.ndarray:
    """Corners of a random polyhedron: points of an ellipsoid, none of them nearly in the plane of others."""
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1)[:, None] * rng.uniform(0.4, 1.0, size=3)


def least_norm(normals: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Point of the polytope ``normals x <= offsets`` that is nearest to the origin.

    Least distance programming by non-negative least squares (Lawson and Hanson, Solving Least Squares Problems, chapter 23), then the
    projection on the planes that are found active.
    """
    g, h = -normals, -offsets
    e = np.vstack([g.T, h])
    u, _ = nnls(e, np.array([0.0, 0.0, 0.0, 1.0]), maxiter=100 * e.shape[1])
    r = e @ u - np.array([0.0, 0.0, 0.0, 1.0])
    x = -r[:3] / r[3]
    active = u > 1e-9 * u.max()
    solution, *_ = np.linalg.lstsq(normals[active], offsets[active], rcond=1e-10)
    return solution if np.linalg.norm(solution - x) < 1e-6 * np.linalg.norm(x) else x


def separation(one: np.ndarray, two: np.ndarray) -> tuple[float, np.ndarray]:
    """Distance of the hulls of two sets of points, or less the depth of their overlap; and the vector from the first to the second.

    Of the hull of all differences: the point nearest to the origin, or the nearest facet if the origin is inside.
    """
    differences = (two[:, None] - one[None]).reshape(-1, 3)
    planes = ConvexHull(differences).equations
    normals, offsets = planes[:, :3], -planes[:, 3]
    if offsets.min() >= 0.0:
        k = int(np.argmin(offsets))
        return -float(offsets[k]), -normals[k]
    x = least_norm(normals, offsets)
    return float(np.linalg.norm(x)), x / np.linalg.norm(x)


def gap_corners(one: np.ndarray, two: np.ndarray, n: np.ndarray, margin: float) -> np.ndarray:
    """Corners, below the margin, of the surface of gaps of two convex sets over their common projection along ``n``.

    Rows (u, w, gap) in the frame of `plane_frame`. The surface is the lower end of ``h >= lower plane of two - upper plane of one`` for
    all pairs of faces, within both projections; Qhull intersects the half-spaces.
    """
    frame = plane_frame(n)
    upper, lower = ConvexHull(one).equations, ConvexHull(two).equations
    upper, lower = upper[upper[:, :3] @ n > 1e-12], lower[lower[:, :3] @ n < -1e-12]

    def heights(planes: np.ndarray) -> np.ndarray:
        """Coefficients of u, w and 1 in the height of each plane along n."""
        along = planes[:, :3] @ n
        return np.column_stack(
            [-planes[:, :3] @ frame[0] / along, -planes[:, :3] @ frame[1] / along, -planes[:, 3] / along]
        )

    rows = [np.array([[0.0, 0.0, 1.0, -margin]])]
    for points in (one, two):
        rim = ConvexHull(np.column_stack([points @ frame[0], points @ frame[1]])).equations
        rows.append(np.column_stack([rim[:, 0], rim[:, 1], np.zeros(len(rim)), rim[:, 2]]))
    difference = (heights(lower)[:, None] - heights(upper)[None]).reshape(-1, 3)
    rows.append(np.column_stack([difference[:, 0], difference[:, 1], -np.ones(len(difference)), difference[:, 2]]))
    half = np.vstack(rows)
    inside = chebyshev(half)
    if inside is None:
        return np.empty((0, 3))
    corners = HalfspaceIntersection(half, inside).intersections
    corners = corners[corners[:, 2] < margin - 1e-9]
    return distinct(corners, 1e-8)


def chebyshev(half: np.ndarray) -> np.ndarray | None:
    """Centre of the largest ball in an intersection of half-spaces; None if it is empty or has no inside."""
    norm = np.linalg.norm(half[:, :3], axis=1)
    found = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.column_stack([half[:, :3], norm]),
        b_ub=-half[:, 3],
        bounds=[(None, None)] * 3 + [(0.0, 10.0)],
    )
    return found.x[:3] if found.status == 0 and found.x[3] > 1e-7 else None


def distinct(points: np.ndarray, distance: float) -> np.ndarray:
    """Points, those within a distance of each other once."""
    kept: list[np.ndarray] = []
    for each in points:
        if all(np.linalg.norm(each - other) > distance for other in kept):
            kept.append(each)
    return np.array(kept).reshape(-1, points.shape[1])


def plane_frame(n: np.ndarray) -> np.ndarray:
    """Two unit vectors across ``n``, as rows."""
    first = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(n, first)])


def matched(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest distance of two sets of as many points, each found one paired with the nearest one wanted; inf if that is no pairing."""
    if len(found) != len(wanted):
        return np.inf
    if not len(found):
        return 0.0
    far = np.linalg.norm(found[:, None] - wanted[None], axis=2)
    nearest = far.argmin(axis=1)
    return float(far.min(axis=1).max()) if len(set(nearest)) == len(wanted) else np.inf
