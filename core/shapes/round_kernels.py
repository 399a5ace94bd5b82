"""Contacts of spheres and planes with each other and with convex polyhedra."""

from __future__ import annotations

from math import inf, sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.shapes.convex_kernels import to_segment
from ninedisk.core.shapes.overlay_kernels import list_features, project, record
from ninedisk.core.shapes.state import (
    COINCIDE,
    EDGE,
    FACE,
    SLACK,
    VERTEX,
    WHOLE,
    Contacts,
    Floats,
    Placed,
    Solids,
    Vector,
    Work,
)
from ninedisk.core.shapes.vector_kernels import cross, dot, minus, plus, row, scaled, tangents


@inline_kernel
def sphere_sphere(placed: Placed, i: int, j: int, margin: float, contacts: Contacts, count: int) -> int:
    """Contact of two spheres; of concentric ones the normal is the x axis."""
    t = minus(row(placed.x, j), row(placed.x, i))
    far = sqrt(dot(t, t))
    gap = far - placed.radius[i] - placed.radius[j]
    if not gap <= margin:
        return count
    n = scaled(t, 1.0 / far) if far > 0.0 else (1.0, 0.0, 0.0)
    ends = (scaled(n, placed.radius[i]), scaled(n, -placed.radius[j]))
    return record(contacts, count, i, j, ends, n, gap, (WHOLE, WHOLE))


@inline_kernel
def sphere_plane(placed: Placed, i: int, plane: Floats, w: int, margin: float, contacts: Contacts, count: int) -> int:
    """Contact of a sphere with the half-space behind plane ``w``, whose row has a point and the unit normal out of it."""
    t = minus(row(placed.x, i), (plane[w, 0], plane[w, 1], plane[w, 2]))
    out = (plane[w, 3], plane[w, 4], plane[w, 5])
    high = dot(t, out)
    gap = high - placed.radius[i]
    if not gap <= margin:
        return count
    ends = (scaled(out, -placed.radius[i]), plus(t, -high, out))
    return record(contacts, count, i, placed.x.shape[0] + w, ends, scaled(out, -1.0), gap, (WHOLE, WHOLE))


@inline_kernel
def convex_plane(
    solids: Solids,
    placed: Placed,
    work: Work,
    i: int,
    plane: Floats,
    w: int,
    margin: float,
    contacts: Contacts,
    count: int,
) -> int:
    """Contacts of the vertices of a convex polyhedron with the half-space behind plane ``w``."""
    t = minus(row(placed.x, i), (plane[w, 0], plane[w, 1], plane[w, 2]))
    out = (plane[w, 3], plane[w, 4], plane[w, 5])
    high = dot(t, out)
    if not high - placed.radius[i] <= margin:
        return count
    n = scaled(out, -1.0)
    first, second = tangents(n)
    project(solids, placed, work, 0, i, (0.0, 0.0, 0.0), (n, first, second))
    slack = SLACK * (placed.radius[i] + abs(high))
    list_features(solids, placed, work, 0, i, n, high - margin - slack, COINCIDE * placed.radius[i], True)
    for k in range(work.listed[0, 0]):
        v = work.vertex[0, k]
        p = row(placed.vertex, placed.first_vertex[i] + v)
        gap = dot(plus(t, 1.0, p), out)
        if gap <= margin:
            ends = (p, plus(plus(t, 1.0, p), -gap, out))
            count = record(contacts, count, i, placed.x.shape[0] + w, ends, n, gap, (VERTEX + v, WHOLE))
    return count


@inline_kernel
def nearest_to_centre(solids: Solids, placed: Placed, body: int, c: Vector, limit: float) -> tuple[float, Vector, int]:
    """Signed distance of a point from a polyhedron, the unit normal out of it there, and the feature; inf if it is above the limit.

    Parameters
    ----------
    c : tuple
        The point, from the centre of the polyhedron [m].
    """
    shape = placed.shape[body]
    start, first = placed.first_vertex[body], solids.first_face[shape]
    deepest, axis, feature = -inf, (1.0, 0.0, 0.0), FACE
    best, n, what = inf, (1.0, 0.0, 0.0), FACE
    for f in range(solids.first_face[shape + 1] - first):
        m = row(placed.normal, placed.first_face[body] + f)
        high = dot(m, c) - solids.offset[first + f]
        if high > limit:
            return inf, m, FACE + f
        if high > deepest:
            deepest, axis, feature = high, m, FACE + f
        if high > 0.0:
            inside = True
            last = row(placed.vertex, start + solids.loop[solids.first_loop[first + f + 1] - 1])
            for q in range(solids.first_loop[first + f], solids.first_loop[first + f + 1]):
                now = row(placed.vertex, start + solids.loop[q])
                inside = inside and dot(cross(minus(now, last), minus(c, last)), m) > 0.0
                last = now
            if inside:
                return high, m, FACE + f  # the plane of a face separates: nothing of the body is closer
    if deepest <= 0.0:
        return deepest, axis, feature
    edge_start = solids.first_edge[shape]
    for k in range(edge_start, solids.first_edge[shape + 1]):
        a, b = solids.edge[k, 0], solids.edge[k, 1]
        p = row(placed.vertex, start + a)
        d = minus(row(placed.vertex, start + b), p)
        w = scaled(to_segment(c, p, d), -1.0)
        far = sqrt(dot(w, w))
        if far < best:
            share = dot(minus(c, p), d) / dot(d, d)
            best, n = far, w
            what = VERTEX + a if share <= 0.0 else VERTEX + b if share >= 1.0 else EDGE + k - edge_start
    if best <= deepest + SLACK * placed.radius[body]:
        # On the edge of a face to rounding: its normal is better than a difference of two points that are nearly the same.
        return deepest, axis, what
    return best, scaled(n, 1.0 / best), what


@inline_kernel
def sphere_convex(solids: Solids, placed: Placed, i: int, j: int, margin: float, contacts: Contacts, count: int) -> int:
    """Contact of a sphere with a convex polyhedron, whichever of them is i."""
    flipped = placed.shape[i] >= 0
    sphere, body = (j, i) if flipped else (i, j)
    radius = placed.radius[sphere]
    c = minus(row(placed.x, sphere), row(placed.x, body))
    far, out, what = nearest_to_centre(solids, placed, body, c, margin + radius)
    gap = far - radius
    if not gap <= margin:
        return count
    on_sphere, on_body = scaled(out, -radius), plus(c, -far, out)
    if flipped:
        return record(contacts, count, i, j, (on_body, on_sphere), out, gap, (what, WHOLE))
    return record(contacts, count, i, j, (on_sphere, on_body), scaled(out, -1.0), gap, (WHOLE, what))
