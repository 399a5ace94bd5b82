"""Contacts of two convex polyhedra: their normal, then the points along it.

The normal is the direction in which the bodies are farthest apart, or overlap least. Where they overlap, and where a face or two edges
decide, it is the best of the axes of the separating axis theorem: normals of faces of both bodies, and products of edges whose arcs
cross on the sphere of normals (Gregorius, "The Separating Axis Test between Convex Polyhedra", GDC 2013). A separated pair whose
closest points are a vertex and an edge, or two vertices, is farther apart than any of those axes shows. Its normal is along the closest
points. All of this is a finite search: unlike GJK and EPA it has no tolerance of convergence, and no start on which its answer depends.
"""

from __future__ import annotations

from math import inf, sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.shapes.overlay_kernels import list_near, overlay
from ninedisk.core.shapes.state import COINCIDE, SLACK, Contacts, Placed, Solids, Vector, Work
from ninedisk.core.shapes.vector_kernels import cross, dot, minus, plus, row, scaled


@inline_kernel
def highest(placed: Placed, body: int, count: int, n: Vector) -> float:
    """Largest ``n . v`` of the vertices of a body."""
    top = -inf
    start = placed.first_vertex[body]
    for v in range(start, start + count):
        top = max(top, dot(n, row(placed.vertex, v)))
    return top


@inline_kernel
def along_faces(
    solids: Solids, placed: Placed, body: int, other: int, to_other: Vector, margin: float
) -> tuple[float, Vector]:
    """Largest distance of another body from a face of a body, and the face's normal; whatever is larger than the margin ends the search."""
    shape = placed.shape[body]
    first, own = solids.first_face[shape], placed.first_face[body]
    count = solids.first_vertex[placed.shape[other] + 1] - solids.first_vertex[placed.shape[other]]
    best, axis = -inf, (0.0, 0.0, 0.0)
    for f in range(solids.first_face[shape + 1] - first):
        n = row(placed.normal, own + f)
        from_face = dot(n, to_other) - solids.offset[first + f]
        if from_face <= best:
            continue  # the centre of mass is not nearer than the nearest vertex
        apart = from_face - highest(placed, other, count, scaled(n, -1.0))
        if apart > best:
            best, axis = apart, n
            if best > margin:
                break
    return best, axis


@inline_kernel
def along_edges(
    solids: Solids, placed: Placed, work: Work, i: int, j: int, t: Vector, least: float, margin: float
) -> tuple[float, Vector]:
    """Largest distance of j from i along a product of two edges, if it is larger than ``least``, and the axis from i to j."""
    solid_i, solid_j = placed.shape[i], placed.shape[j]
    own, theirs = placed.first_vertex[i], placed.first_vertex[j]
    face_i, face_j = placed.first_face[i], placed.first_face[j]
    count_i = solids.first_vertex[solid_i + 1] - solids.first_vertex[solid_i]
    count_j = solids.first_vertex[solid_j + 1] - solids.first_vertex[solid_j]
    best, axis = least, (0.0, 0.0, 0.0)
    for k in range(solids.first_edge[solid_i], solids.first_edge[solid_i + 1]):
        edge = minus(row(placed.vertex, own + solids.edge[k, 1]), row(placed.vertex, own + solids.edge[k, 0]))
        a, b = row(placed.normal, face_i + solids.edge[k, 2]), row(placed.normal, face_i + solids.edge[k, 3])
        for f in range(solids.first_face[solid_j + 1] - solids.first_face[solid_j]):
            work.along[f] = -dot(row(placed.normal, face_j + f), edge)
        for m in range(solids.first_edge[solid_j], solids.first_edge[solid_j + 1]):
            # The arcs from a to b and from -c to -d cross where the ends of each are on both sides of the other's plane, and both
            # are on the same half of the sphere. Where an end only touches, the axis is the normal of a face.
            c_e, d_e = work.along[solids.edge[m, 2]], work.along[solids.edge[m, 3]]
            if not c_e * d_e < 0.0:
                continue
            other = minus(
                row(placed.vertex, theirs + solids.edge[m, 1]), row(placed.vertex, theirs + solids.edge[m, 0])
            )
            a_e, b_e = dot(a, other), dot(b, other)
            if not (a_e * b_e < 0.0 and c_e * b_e > 0.0):
                continue
            n = cross(edge, other)
            size = dot(n, n)
            if not size > 0.0:
                continue
            # The axis points out of i.
            n = scaled(n, (1.0 if dot(n, a) + dot(n, b) > 0.0 else -1.0) / sqrt(size))
            apart = dot(n, t) - highest(placed, j, count_j, scaled(n, -1.0)) - highest(placed, i, count_i, n)
            if apart > best:
                best, axis = apart, n
                if best > margin:
                    return best, axis
    return best, axis


@inline_kernel
def to_segment(p: Vector, q: Vector, e: Vector) -> Vector:
    """Shortest vector from a point to the segment from ``q`` to ``q + e``."""
    w = minus(q, p)
    size = dot(e, e)
    share = min(1.0, max(0.0, -dot(w, e) / size)) if size > 0.0 else 0.0
    return plus(w, share, e)


@inline_kernel
def shorter(best: Vector, found: Vector) -> Vector:
    """The shorter one of two vectors, the first of equal ones."""
    return found if dot(found, found) < dot(best, best) else best


@inline_kernel
def between_segments(p: Vector, d: Vector, q: Vector, e: Vector) -> Vector:
    """Shortest vector from the segment from ``p`` to ``p + d`` to that from ``q`` to ``q + e``.

    It is between two inner points, or starts or ends at an end of a segment. Nearly parallel segments need no rule: an inner pair that
    rounding spoils is longer than the one at an end.
    """
    best = to_segment(p, q, e)
    best = shorter(best, to_segment(plus(p, 1.0, d), q, e))
    best = shorter(best, scaled(to_segment(q, p, d), -1.0))
    best = shorter(best, scaled(to_segment(plus(q, 1.0, e), p, d), -1.0))
    w = minus(q, p)
    n = cross(d, e)
    size = dot(n, n)
    if size > 0.0:
        at_d, at_e = dot(cross(w, e), n) / size, dot(cross(w, d), n) / size
        if 0.0 < at_d < 1.0 and 0.0 < at_e < 1.0:
            best = shorter(best, plus(plus(w, at_e, e), -at_d, d))
    return best


@inline_kernel
def vertices_to_faces(
    solids: Solids, placed: Placed, work: Work, side: int, body: int, other: int, to_other: Vector, best: Vector
) -> Vector:
    """Shortest vector from listed vertices of a body to the inside of listed faces of another one, or ``best``."""
    solid = placed.shape[other]
    for k in range(work.listed[side, 0]):
        p = minus(row(placed.vertex, placed.first_vertex[body] + work.vertex[side, k]), to_other)
        for m in range(work.listed[1 - side, 2]):
            f = work.face[1 - side, m]
            r = solids.first_face[solid] + f
            n = row(placed.normal, placed.first_face[other] + f)
            start, end = solids.first_loop[r], solids.first_loop[r + 1]
            high = dot(n, minus(p, row(placed.vertex, placed.first_vertex[other] + solids.loop[start])))
            if high <= 0.0 or high * high >= dot(best, best):
                continue
            inside = True
            last = row(placed.vertex, placed.first_vertex[other] + solids.loop[end - 1])
            for q in range(start, end):
                now = row(placed.vertex, placed.first_vertex[other] + solids.loop[q])
                inside = inside and dot(cross(minus(now, last), minus(p, last)), n) > 0.0
                last = now
            if inside:
                best = scaled(n, -high)
    return best


@inline_kernel
def closest(
    solids: Solids,
    placed: Placed,
    work: Work,
    i: int,
    j: int,
    t: Vector,
    n: Vector,
    near: float,
    slack: float,
    margin: float,
) -> Vector:
    """Shortest vector from body i to body j, which are separated along ``n``; one longer than the margin if they are farther apart.

    Points within the margin of each other are within it along ``n``: only what is so close to the other body's end is tried.
    """
    list_near(solids, placed, work, i, j, t, n, near, slack, margin, False)
    best = (inf, 0.0, 0.0)
    for side in range(2):
        body, other, sign = (i, j, 1.0) if side == 0 else (j, i, -1.0)
        best = vertices_to_faces(solids, placed, work, side, body, other, scaled(t, sign), scaled(best, sign))
        best = scaled(best, sign)
    solid_i, solid_j = placed.shape[i], placed.shape[j]
    for k in range(work.listed[0, 1]):
        r = solids.first_edge[solid_i] + work.edge[0, k]
        p = row(placed.vertex, placed.first_vertex[i] + solids.edge[r, 0])
        d = minus(row(placed.vertex, placed.first_vertex[i] + solids.edge[r, 1]), p)
        for m in range(work.listed[1, 1]):
            r = solids.first_edge[solid_j] + work.edge[1, m]
            q = row(placed.vertex, placed.first_vertex[j] + solids.edge[r, 0])
            e = minus(row(placed.vertex, placed.first_vertex[j] + solids.edge[r, 1]), q)
            best = shorter(best, between_segments(p, d, plus(q, 1.0, t), e))
    return best


@inline_kernel
def convex_convex(
    solids: Solids,
    placed: Placed,
    work: Work,
    i: int,
    j: int,
    margin: float,
    contacts: Contacts,
    count: int,
) -> int:
    """Contacts of two convex polyhedra, to ``contacts`` from row ``count``; gives the row after the last one.

    Of separated bodies one gap is the distance, of bodies that overlap the length of the shortest displacement that separates them.
    """
    t = minus(row(placed.x, j), row(placed.x, i))
    centres = sqrt(dot(t, t))
    radius_i, radius_j = placed.radius[i], placed.radius[j]
    if not centres - radius_i - radius_j <= margin:
        return count
    size = radius_i + radius_j + centres
    slack = SLACK * size
    near = COINCIDE * min(radius_i, radius_j) + slack
    apart, n = -inf, (0.0, 0.0, 0.0)
    for side in range(2):
        body, other, sign = (i, j, 1.0) if side == 0 else (j, i, -1.0)
        found, axis = along_faces(solids, placed, body, other, scaled(t, sign), margin)
        if found > margin:
            return count
        if found > apart:
            apart, n = found, scaled(axis, sign)
    # Where faces are parallel to rounding their normals are better than products of edges that are parallel to rounding.
    found, axis = along_edges(solids, placed, work, i, j, t, apart + slack, margin)
    if found > margin:
        return count
    if found > apart + slack:
        apart, n = found, axis
    end = count
    for attempt in range(2):
        end, least, lowest = overlay(solids, placed, work, i, j, t, n, near, slack, margin, contacts, count)
        if attempt == 1 or apart <= 0.0 or least <= apart + slack:
            break
        w = closest(solids, placed, work, i, j, t, n, near, slack, margin)
        far = sqrt(dot(w, w))
        if far > margin:
            return count
        if lowest <= apart + slack and far <= apart + slack:
            break  # the closest points are at a place that counts as another one; the axis is better than their difference
        n = scaled(w, 1.0 / far)
    return end
