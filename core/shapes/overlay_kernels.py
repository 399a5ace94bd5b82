"""Contact points of two convex polyhedra along a given normal.

Both bodies are projected along the normal. Above a place of the plane of projection, body i ends at the height of its upper surface,
body j starts at that of its lower surface. The difference of the heights is the gap; it is linear wherever neither surface has an edge.
Its corners are therefore vertices of one body over a vertex, an edge or a face of the other, and crossings of two edges. Those within
the margin are the contacts.

Clipping an incident face against the sides of a reference face (Sutherland-Hodgman) gives the same points for two faces, but has to
choose both faces. The choice jumps where two faces have the same angle with the normal, and depends on which body is first. Here faces,
edges and vertices of both bodies have the same part, and nothing is chosen. Only steep faces are left out (`STEEP`): the sides of a box
that rests on a face are over a strip as wide as its angle is small, where gaps grow from the first to the last within the margin.
"""

from __future__ import annotations

from math import inf, sqrt

from ninedisk.core.compile import inline_kernel
from ninedisk.core.shapes.state import EDGE, FACE, STEEP, VERTEX, Contacts, Placed, Solids, Vector, Work
from ninedisk.core.shapes.vector_kernels import dot, minus, plus, put, row, scaled, tangents


@inline_kernel
def record(
    contacts: Contacts,
    k: int,
    i: int,
    j: int,
    ends: tuple[Vector, Vector],
    n: Vector,
    gap: float,
    what: tuple[int, int],
) -> int:
    """Write contact k unless the arrays are full, and give the number of the next one."""
    if k < contacts.gap.shape[0]:
        contacts.body[k, 0], contacts.body[k, 1] = i, j
        put(contacts.arm_i, k, ends[0])
        put(contacts.arm_j, k, ends[1])
        put(contacts.normal, k, n)
        contacts.gap[k] = gap
        contacts.feature[k, 0], contacts.feature[k, 1] = what
    return k + 1


@inline_kernel
def project(
    solids: Solids,
    placed: Placed,
    work: Work,
    side: int,
    body: int,
    shift: Vector,
    frame: tuple[Vector, Vector, Vector],
) -> None:
    """Coordinates of a body's vertices in a frame ``(n, t1, t2)`` to ``work.place[side]``, ``shift`` being the body's centre."""
    n, first, second = frame
    shape, start = placed.shape[body], placed.first_vertex[body]
    high, across, along = dot(n, shift), dot(first, shift), dot(second, shift)
    for v in range(solids.first_vertex[shape + 1] - solids.first_vertex[shape]):
        p = row(placed.vertex, start + v)
        work.place[side, v, 0] = dot(first, p) + across
        work.place[side, v, 1] = dot(second, p) + along
        work.place[side, v, 2] = dot(n, p) + high


@inline_kernel
def reach(solids: Solids, placed: Placed, work: Work, side: int, body: int) -> float:
    """Height of the upper end of body i (side 0), or of the lower end of body j (side 1)."""
    shape = placed.shape[body]
    sign = 1.0 - 2.0 * side
    top = -inf
    for v in range(solids.first_vertex[shape + 1] - solids.first_vertex[shape]):
        top = max(top, sign * work.place[side, v, 2])
    return sign * top


@inline_kernel
def list_features(
    solids: Solids,
    placed: Placed,
    work: Work,
    side: int,
    body: int,
    n: Vector,
    level: float,
    near: float,
    surface: bool,
) -> None:
    """List the vertices, edges and faces above a level (side 0) or below it (side 1).

    An edge or a face counts if one of its vertices does. With ``surface`` only what looks at the other body is listed: faces less steep
    than `STEEP`, their edges and vertices, and what is within ``near`` of the body's end.
    """
    shape = placed.shape[body]
    sign = 1.0 - 2.0 * side
    first_vertex, first_face, first_edge = (
        solids.first_vertex[shape],
        solids.first_face[shape],
        solids.first_edge[shape],
    )
    count = solids.first_vertex[shape + 1] - first_vertex
    end = reach(solids, placed, work, side, body)
    for v in range(count):
        last = sign * (work.place[side, v, 2] - end) >= -near
        work.up[side, v] = 2 if last else 0 if surface else 1
    faces = 0
    for f in range(solids.first_face[shape + 1] - first_face):
        facing = not surface or sign * dot(n, row(placed.normal, placed.first_face[body] + f)) > STEEP
        work.facing[side, f] = 1 if facing else 0
        if facing:
            listed = False
            for k in range(solids.first_loop[first_face + f], solids.first_loop[first_face + f + 1]):
                v = solids.loop[k]
                work.up[side, v] = max(1, work.up[side, v])
                listed = listed or sign * (work.place[side, v, 2] - level) >= 0.0
            if listed:
                work.face[side, faces] = f
                faces += 1
    vertices = 0
    for v in range(count):
        if work.up[side, v] > 0 and sign * (work.place[side, v, 2] - level) >= 0.0:
            work.vertex[side, vertices] = v
            vertices += 1
    edges = 0
    for e in range(solids.first_edge[shape + 1] - first_edge):
        k = first_edge + e
        a, b = solids.edge[k, 0], solids.edge[k, 1]
        facing = work.facing[side, solids.edge[k, 2]] + work.facing[side, solids.edge[k, 3]]
        if facing == 0 and work.up[side, a] + work.up[side, b] < 4:
            continue
        high = max(sign * (work.place[side, a, 2] - level), sign * (work.place[side, b, 2] - level))
        if high >= 0.0:
            dx = work.place[side, b, 0] - work.place[side, a, 0]
            dy = work.place[side, b, 1] - work.place[side, a, 1]
            work.edge[side, edges] = e
            work.length[side, edges] = sqrt(dx * dx + dy * dy)
            edges += 1
    work.listed[side, 0], work.listed[side, 1], work.listed[side, 2] = vertices, edges, faces


@inline_kernel
def list_near(
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
    surface: bool,
) -> None:
    """List what of the bodies i and j can be within the margin of the other one, which is within it of the other's end along ``n``."""
    first, second = tangents(n)
    for side in range(2):
        body, shift = (i, (0.0, 0.0, 0.0)) if side == 0 else (j, t)
        project(solids, placed, work, side, body, shift, (n, first, second))
    for side in range(2):
        body, other = (i, j) if side == 0 else (j, i)
        end = reach(solids, placed, work, 1 - side, other)
        level = end - (margin + slack) * (1.0 - 2.0 * side)
        list_features(solids, placed, work, side, body, n, level, near, surface)


@inline_kernel
def over_edge(work: Work, side: int, v: int, a: int, b: int) -> tuple[float, float]:
    """Where on the edge from vertex a to b of the other body vertex v of a side is, as a share of it, and the squared distance there."""
    px, py = work.place[side, v, 0], work.place[side, v, 1]
    ax, ay = work.place[1 - side, a, 0], work.place[1 - side, a, 1]
    dx, dy = work.place[1 - side, b, 0] - ax, work.place[1 - side, b, 1] - ay
    length = dx * dx + dy * dy
    share = 0.0
    if length > 0.0:
        share = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / length))
    wx, wy = px - ax - share * dx, py - ay - share * dy
    return share, wx * wx + wy * wy


@inline_kernel
def over_face(solids: Solids, work: Work, side: int, v: int, start: int, end: int) -> bool:
    """Whether vertex v of a side is strictly inside a face of the other body, whose loop is given by its range."""
    px, py = work.place[side, v, 0], work.place[side, v, 1]
    sign = 2.0 * side - 1.0  # faces of body i are seen from outside, those of body j from inside
    last = solids.loop[end - 1]
    inside = True
    for k in range(start, end):
        now = solids.loop[k]
        ax, ay = work.place[1 - side, last, 0], work.place[1 - side, last, 1]
        dx, dy = work.place[1 - side, now, 0] - ax, work.place[1 - side, now, 1] - ay
        inside = inside and sign * (dx * (py - ay) - dy * (px - ax)) > 0.0
        last = now
    return inside


@inline_kernel
def vertices_over(
    solids: Solids,
    placed: Placed,
    work: Work,
    side: int,
    i: int,
    j: int,
    t: Vector,
    n: Vector,
    near: float,
    margin: float,
    contacts: Contacts,
    count: int,
    least: float,
    lowest: float,
) -> tuple[int, float, float]:
    """Contacts of the listed vertices of one side; see `overlay`. Pairs of vertices are written for side 0 only."""
    body, other = (i, j) if side == 0 else (j, i)
    solid = placed.shape[other]
    own, theirs = placed.first_vertex[body], placed.first_vertex[other]
    sign = 1.0 - 2.0 * side
    to_other = scaled(t, sign)
    for k in range(work.listed[side, 0]):
        v = work.vertex[side, k]
        p = row(placed.vertex, own + v)
        seen = minus(p, to_other)  # from the centre of the other body
        what, gap, apart = -1, inf, 0.0
        end = seen
        for m in range(work.listed[1 - side, 0]):
            w = work.vertex[1 - side, m]
            dx = work.place[side, v, 0] - work.place[1 - side, w, 0]
            dy = work.place[side, v, 1] - work.place[1 - side, w, 1]
            far = dx * dx + dy * dy
            high = sign * (work.place[1 - side, w, 2] - work.place[side, v, 2])
            if far <= near * near and high < gap:
                what, gap, apart, end = VERTEX + w, high, far, row(placed.vertex, theirs + w)
        if what >= 0 and side == 1:
            continue
        if what < 0:
            for m in range(work.listed[1 - side, 1]):
                e = work.edge[1 - side, m]
                r = solids.first_edge[solid] + e
                a, b = solids.edge[r, 0], solids.edge[r, 1]
                share, far = over_edge(work, side, v, a, b)
                low, up = work.place[1 - side, a, 2], work.place[1 - side, b, 2]
                high = sign * (low + share * (up - low) - work.place[side, v, 2])
                if far <= near * near and high < gap:
                    begin = row(placed.vertex, theirs + a)
                    what, gap, apart = EDGE + e, high, far
                    end = plus(begin, share, minus(row(placed.vertex, theirs + b), begin))
        if what < 0:
            for m in range(work.listed[1 - side, 2]):
                f = work.face[1 - side, m]
                r = solids.first_face[solid] + f
                if over_face(solids, work, side, v, solids.first_loop[r], solids.first_loop[r + 1]):
                    m_f = row(placed.normal, placed.first_face[other] + f)
                    on = row(placed.vertex, theirs + solids.loop[solids.first_loop[r]])
                    high = dot(m_f, minus(on, seen)) / (sign * dot(m_f, n))
                    if high < gap:
                        what, gap = FACE + f, high
            if what >= 0:
                end = plus(seen, sign * gap, n)
        if what >= 0:
            least, lowest = min(least, sqrt(gap * gap + apart)), min(lowest, gap)
            if gap <= margin:
                if side == 0:
                    count = record(contacts, count, i, j, (p, end), n, gap, (VERTEX + v, what))
                else:
                    count = record(contacts, count, i, j, (end, p), n, gap, (what, VERTEX + v))
    return count, least, lowest


@inline_kernel
def line_side(work: Work, side: int, v: int, other: int, a: int, b: int) -> float:
    """Vector product of the edge from a to b of a side with the arm to vertex v of another one, in the plane of projection."""
    ax, ay = work.place[other, a, 0], work.place[other, a, 1]
    dx, dy = work.place[other, b, 0] - ax, work.place[other, b, 1] - ay
    across: float = dx * (work.place[side, v, 1] - ay) - dy * (work.place[side, v, 0] - ax)
    return across


@inline_kernel
def separates(one: float, two: float, limit: float) -> bool:
    """Whether two numbers are beyond a limit with different signs."""
    return (one > limit and two < -limit) or (one < -limit and two > limit)


@inline_kernel
def edges_cross(
    solids: Solids,
    placed: Placed,
    work: Work,
    i: int,
    j: int,
    t: Vector,
    n: Vector,
    near: float,
    margin: float,
    contacts: Contacts,
    count: int,
    least: float,
    lowest: float,
) -> tuple[int, float, float]:
    """Contacts where listed edges cross; see `overlay`.

    Both ends of each edge are farther than ``near`` from the line of the other one. Otherwise one of them is a contact on its own, and
    the polygon between the contacts is right within ``near``.
    """
    solid_i, solid_j = placed.shape[i], placed.shape[j]
    for k in range(work.listed[0, 1]):
        e = work.edge[0, k]
        a, b = solids.edge[solids.first_edge[solid_i] + e, 0], solids.edge[solids.first_edge[solid_i] + e, 1]
        for m in range(work.listed[1, 1]):
            g = work.edge[1, m]
            c, d = solids.edge[solids.first_edge[solid_j] + g, 0], solids.edge[solids.first_edge[solid_j] + g, 1]
            at_a, at_b = line_side(work, 0, a, 1, c, d), line_side(work, 0, b, 1, c, d)
            if not separates(at_a, at_b, near * work.length[1, m]):
                continue
            at_c, at_d = line_side(work, 1, c, 0, a, b), line_side(work, 1, d, 0, a, b)
            if not separates(at_c, at_d, near * work.length[0, k]):
                continue
            share_i, share_j = at_a / (at_a - at_b), at_c / (at_c - at_d)
            begin_i, begin_j = (
                row(placed.vertex, placed.first_vertex[i] + a),
                row(placed.vertex, placed.first_vertex[j] + c),
            )
            end_i, end_j = (
                row(placed.vertex, placed.first_vertex[i] + b),
                row(placed.vertex, placed.first_vertex[j] + d),
            )
            one = plus(begin_i, share_i, minus(end_i, begin_i))
            two = plus(begin_j, share_j, minus(end_j, begin_j))
            gap = dot(n, plus(minus(two, one), 1.0, t))
            least, lowest = min(least, abs(gap)), min(lowest, gap)
            if gap <= margin:
                count = record(contacts, count, i, j, (one, two), n, gap, (EDGE + e, EDGE + g))
    return count, least, lowest


@inline_kernel
def overlay(
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
    contacts: Contacts,
    count: int,
) -> tuple[int, float, float]:
    """Contacts of the convex bodies i and j along a unit normal.

    Parameters
    ----------
    t : tuple
        From the centre of i to that of j [m].
    n : tuple
        Unit normal from i to j.
    near : float
        Distance across the normal of features that are at the same place [m].
    slack : float
        Rounding of a height [m].
    margin : float
        Largest gap of a contact [m].
    contacts : Contacts
        Out, from row ``count``; what does not fit is counted only.

    Returns
    -------
    count : int
        Row after the last contact.
    least, lowest : float
        Smallest distance of the two points of a contact, and smallest gap [m]; inf if there is none.
    """
    list_near(solids, placed, work, i, j, t, n, near, slack, margin, True)
    least, lowest = inf, inf
    for side in range(2):
        count, least, lowest = vertices_over(
            solids, placed, work, side, i, j, t, n, near, margin, contacts, count, least, lowest
        )
    return edges_cross(solids, placed, work, i, j, t, n, near, margin, contacts, count, least, lowest)
