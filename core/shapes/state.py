"""Arrays of the contact geometry in space, as kernels see them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Vector = tuple[float, float, float]

VERTICES = 64
"""Vertices that a polyhedron may have."""
EDGES, FACES = 3 * VERTICES - 6, 2 * VERTICES - 4
"""Edges and faces that it then has at most (Euler)."""

SPHERE = -1
"""Shape number of a sphere."""

KIND = 256
"""Feature number of the first edge; see `Contacts.feature`."""
VERTEX, EDGE, FACE, WHOLE = 0, KIND, 2 * KIND, 3 * KIND
"""Feature numbers of the first vertex, the first edge and the first face of a polyhedron, and that of a sphere or a plane."""

STEEP = 0.1
"""Cosine of the angle between the normal of a contact and that of a face below which the face takes no part in it, unless the closest
points are on it."""

COINCIDE = 1e-9
"""Distance across the normal, over the smaller bounding radius of a pair, within which a vertex is on a vertex or an edge of the other.

It is far above rounding (1e-16, or 1e-12 for bodies 1e4 radii from the origin) and far below anything that is resolved in a shape. A
support polygon is right within it, and to rounding where no feature is so close to another."""

SLACK = 7.105427357601002e-15
"""Rounding of a gap over the sum of both bounding radii and the distance of the centres: 32 units in the last place.

A gap is a sum of six products of turned coordinates, of which each has up to five roundings."""


class Solids(NamedTuple):
    """Convex polyhedra one after another, in the frames of their bodies.

    Parameters
    ----------
    vertex : ndarray, shape (v, 3)
        Vertices about the centre of mass [m].
    normal : ndarray, shape (f, 3)
        Outward unit normals of faces.
    offset : ndarray, shape (f,)
        Distances of the faces from the centre of mass [m].
    loop : ndarray of int64, shape (l,)
        Vertices of the faces, counter-clockwise from outside; numbers within the polyhedron.
    first_loop : ndarray of int64, shape (f + 1,)
        Where the loop of each face starts.
    edge : ndarray of int64, shape (e, 4)
        First vertex, second vertex, face to the left and face to the right, seen from outside; numbers within the polyhedron.
    first_vertex, first_face, first_edge : ndarray of int64, shape (s + 1,)
        Where each polyhedron starts.

    Examples
    --------
    >>> pack([ConvexPolyhedron.box([1.0, 2.0, 3.0])]).offset
    array([1., 3., 2., 3., 2., 1.])
    """

    vertex: Floats
    normal: Floats
    offset: Floats
    loop: Integers
    first_loop: Integers
    edge: Integers
    first_vertex: Integers
    first_face: Integers
    first_edge: Integers


class Placed(NamedTuple):
    """Bodies where they are, their polyhedra turned into the axes of the scene.

    Parameters
    ----------
    x : ndarray, shape (b, 3)
        Centres of mass [m].
    shape : ndarray of int64, shape (b,)
        Number of the polyhedron, or `SPHERE`.
    radius : ndarray, shape (b,)
        Radius of a sphere, bounding radius of a polyhedron about its centre of mass [m].
    vertex, normal : ndarray, shape (v, 3), (f, 3)
        Vertices about the centre of mass of their body [m] and normals of faces, body after body.
    first_vertex, first_face : ndarray of int64, shape (b,)
        Where those of each body start.

    Examples
    --------
    >>> solids = pack([ConvexPolyhedron.box([1.0, 2.0, 2.0])])
    >>> placed = place(solids, [[0.0, 0.0, 2.0], [0.0, 0.0, 4.5]], [[1.0, 0.0, 0.0, 0.0]] * 2, [0, -1], [0.0, 0.5])
    >>> placed.radius
    array([3. , 0.5])
    """

    x: Floats
    shape: Integers
    radius: Floats
    vertex: Floats
    normal: Floats
    first_vertex: Integers
    first_face: Integers


class Contacts(NamedTuple):
    """Contacts, sorted as their pairs are.

    Parameters
    ----------
    body : ndarray of int64, shape (c, 2)
        Bodies i and j; plane w has the number b + w, b the number of bodies.
    arm_i, arm_j : ndarray, shape (c, 3)
        Contact points on i from its centre of mass, on j from its own; on a plane from the plane's point [m]. Both points differ by
        ``gap normal``, and across the normal by `COINCIDE` of the smaller radius at most.
    normal : ndarray, shape (c, 3)
        Normal from i to j, a unit vector; that of all contacts of a pair is the same.
    gap : ndarray, shape (c,)
        Distance along the normal [m]; negative: overlap.
    feature : ndarray of int64, shape (c, 2)
        What touches on i and on j: a vertex, 256 + an edge, 512 + a face, or 768 for a sphere or a plane.

    Examples
    --------
    A ball on the face of a cube that looks along z, which is face 3:

    >>> cube = pack([ConvexPolyhedron.box([1.0, 1.0, 1.0])])
    >>> placed = place(cube, [[0.0, 0.0, 1.0], [0.5, 0.0, 2.25]], [[1.0, 0.0, 0.0, 0.0]] * 2, [0, -1], [0.0, 0.25])
    >>> contacts = find_contacts(cube, placed, [[0, 1]], 0.0)
    >>> contacts.gap, contacts.arm_i, contacts.feature
    (array([0.]), array([[0.5, 0. , 1. ]]), array([[515, 768]]))
    """

    body: Integers
    arm_i: Floats
    arm_j: Floats
    normal: Floats
    gap: Floats
    feature: Integers


class Work(NamedTuple):
    """Scratch of one thread; the first axis, where it is 2, is the body of a pair.

    Attributes
    ----------
    place : ndarray, shape (2, VERTICES, 3)
        Vertices: two coordinates across a normal and the height along it [m].
    facing : ndarray of int64, shape (2, FACES)
        Whether a face looks at the other body.
    up : ndarray of int64, shape (2, VERTICES)
        Whether a vertex is of such a face.
    vertex, edge, face : ndarray of int64, shape (2, VERTICES), (2, EDGES), (2, FACES)
        Lists of what can touch.
    listed : ndarray of int64, shape (2, 3)
        Lengths of these lists.
    length : ndarray, shape (2, EDGES)
        Lengths of the listed edges across the normal [m].
    along : ndarray, shape (FACES,)
        Products of an edge and the normals of faces [m].
    """

    place: Floats
    facing: Integers
    up: Integers
    vertex: Integers
    edge: Integers
    face: Integers
    listed: Integers
    length: Floats
    along: Floats
