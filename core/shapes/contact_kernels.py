"""Bodies placed in the scene, and the contacts of all pairs."""

from __future__ import annotations

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.shapes.convex_kernels import convex_convex
from ninedisk.core.shapes.round_kernels import convex_plane, sphere_convex, sphere_plane, sphere_sphere
from ninedisk.core.shapes.state import SPHERE, Contacts, Floats, Integers, Placed, Solids, Vector, Work
from ninedisk.core.shapes.vector_kernels import cross, plus, put, row


@inline_kernel
def turned(p: Vector, w: float, q: Vector, twice: float) -> Vector:
    """``p`` turned by the quaternion ``(w, q)``, ``twice`` being 2 over its squared size."""
    arm = cross(q, p)
    return plus(plus(p, twice * w, arm), twice, cross(q, arm))


@kernel
def place_bodies(quaternion: Floats, solids: Solids, placed: Placed) -> None:
    """Turn the vertices and normals of all bodies into the axes of the scene.

    Parameters
    ----------
    quaternion : ndarray, shape (b, 4)
        ``(w, x, y, z)`` of the rotation from each body's frame; its size has no effect.
    placed : Placed
        Out: ``vertex`` and ``normal``; the rest is given.
    """
    for body in range(placed.x.shape[0]):
        shape = placed.shape[body]
        if shape == SPHERE:
            continue
        w = quaternion[body, 0]
        q = (quaternion[body, 1], quaternion[body, 2], quaternion[body, 3])
        twice = 2.0 / (w * w + q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
        for v in range(solids.first_vertex[shape + 1] - solids.first_vertex[shape]):
            p = turned(row(solids.vertex, solids.first_vertex[shape] + v), w, q, twice)
            put(placed.vertex, placed.first_vertex[body] + v, p)
        for f in range(solids.first_face[shape + 1] - solids.first_face[shape]):
            p = turned(row(solids.normal, solids.first_face[shape] + f), w, q, twice)
            put(placed.normal, placed.first_face[body] + f, p)


@kernel
def find_all(
    solids: Solids,
    placed: Placed,
    plane: Floats,
    pairs: Integers,
    margin: float,
    work: Work,
    contacts: Contacts,
) -> int:
    """Contacts of all pairs within the margin, in the order of the pairs.

    Parameters
    ----------
    plane : ndarray, shape (m, 6)
        A point of each plane [m] and its unit normal, out of the half-space behind it.
    pairs : ndarray of int64, shape (k, 2)
        Bodies i and j, or a body i and b + the number of a plane.
    margin : float
        Largest gap of a contact [m].
    contacts : Contacts
        Out.

    Returns
    -------
    int
        Number of contacts. If it is above the number of rows, the arrays are too short and the contacts must be found again; that many
        rows are then enough.
    """
    bodies, count = placed.x.shape[0], 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if j >= bodies:
            if placed.shape[i] == SPHERE:
                count = sphere_plane(placed, i, plane, j - bodies, margin, contacts, count)
            else:
                count = convex_plane(solids, placed, work, i, plane, j - bodies, margin, contacts, count)
        elif placed.shape[i] == SPHERE and placed.shape[j] == SPHERE:
            count = sphere_sphere(placed, i, j, margin, contacts, count)
        elif placed.shape[i] == SPHERE or placed.shape[j] == SPHERE:
            count = sphere_convex(solids, placed, i, j, margin, contacts, count)
        else:
            count = convex_convex(solids, placed, work, i, j, margin, contacts, count)
    return count
