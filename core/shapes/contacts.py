"""Contacts of spheres, convex polyhedra and planes in space, from checked arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ninedisk.core.array_types import IntArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.shapes.contact_kernels import find_all, place_bodies
from ninedisk.core.shapes.polyhedron import ConvexPolyhedron
from ninedisk.core.shapes.state import EDGES, FACES, SPHERE, VERTICES, Contacts, Placed, Solids, Work
from ninedisk.core.validate import LARGEST, all_of_kind, at_least, finite, numbers, rows_of

PER_PAIR = 4
"""Contacts per pair for which memory is taken at first."""

UNIT = 1e-6
"""How far the size of a quaternion or of a normal may be from 1: what is farther is a mistake, not rounding."""


def pack(shapes: Sequence[ConvexPolyhedron]) -> Solids:
    """Put polyhedra into flat arrays, one after another.

    Parameters
    ----------
    shapes : sequence of ConvexPolyhedron

    Returns
    -------
    Solids

    Raises
    ------
    InvalidSceneError
        If one is no polyhedron.

    Examples
    --------
    >>> pack([ConvexPolyhedron.box([1.0, 1.0, 1.0])] * 2).first_face
    array([ 0,  6, 12])
    """
    solids = all_of_kind("shapes", shapes, ConvexPolyhedron)
    loops = [loop for solid in solids for loop in solid.faces]
    return Solids(
        vertex=np.concatenate([np.empty((0, 3)), *(solid.vertices for solid in solids)]),
        normal=np.concatenate([np.empty((0, 3)), *(solid.normals for solid in solids)]),
        offset=np.concatenate([np.empty(0), *(solid.offsets for solid in solids)]),
        loop=np.array([each for loop in loops for each in loop], dtype=np.int64),
        first_loop=_starts([len(loop) for loop in loops]),
        edge=np.concatenate([np.empty((0, 4), dtype=np.int64), *(solid.edges for solid in solids)]),
        first_vertex=_starts([len(solid.vertices) for solid in solids]),
        first_face=_starts([len(solid.faces) for solid in solids]),
        first_edge=_starts([len(solid.edges) for solid in solids]),
    )


def _starts(sizes: Sequence[int] | IntArray) -> IntArray:
    return np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]).astype(np.int64)


def place(
    solids: Solids, x: ArrayLike, quaternion: ArrayLike, shape: ArrayLike, radius: ArrayLike | None = None
) -> Placed:
    """Place bodies: turn their polyhedra into the axes of the scene.

    Parameters
    ----------
    solids : Solids
        From `pack`.
    x : array_like, shape (b, 3)
        Centres of mass [m].
    quaternion : array_like, shape (b, 4)
        Rotations from the frames of the bodies as unit quaternions ``(w, x, y, z)``.
    shape : array_like of int, shape (b,)
        Numbers of the polyhedra; -1 for a sphere.
    radius : array_like, shape (b,), optional
        Radii of the spheres [m]; ignored for polyhedra. It may be left out where there are no spheres.

    Returns
    -------
    Placed

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.

    Examples
    --------
    A quarter turn about z:

    >>> half = np.sqrt(0.5)
    >>> box = pack([ConvexPolyhedron.box([1.0, 2.0, 3.0])])
    >>> placed = place(box, [[0.0, 0.0, 5.0]], [[half, 0.0, 0.0, half]], [0])
    >>> np.round(np.abs(placed.vertex).max(axis=0), 12)
    array([2., 1., 3.])
    """
    centres = rows_of("x", x, 3)
    count = len(centres)
    centres = finite("x", centres, (count, 3), most=LARGEST)
    turns = finite("quaternion", quaternion, (count, 4))
    off = np.abs(np.linalg.norm(turns, axis=1) - 1.0) > UNIT
    if np.any(off):
        k = int(np.argmax(off))
        raise InvalidSceneError(f"quaternion[{k}] = {turns[k].tolist()} is not allowed: its size must be 1")
    number = finite("shape", shape, (count,))
    known = len(solids.first_vertex) - 1
    bad = np.flatnonzero((number != np.floor(number)) | (number < SPHERE) | (number >= known))
    if len(bad):
        raise InvalidSceneError(
            f"shape[{bad[0]}] = {number[bad[0]]:g} is not allowed: it must be the number of one of {known} polyhedra, or {SPHERE} "
            "for a sphere"
        )
    kind = number.astype(np.int64)
    spheres = kind == SPHERE
    if radius is None and np.any(spheres):
        raise InvalidSceneError(f"radius is missing and body {int(np.argmax(spheres))} is a sphere: give the radii")
    radii = np.zeros(count) if radius is None else finite("radius", radius, (count,), most=LARGEST).copy()
    if np.any(radii[spheres] <= 0.0):
        k = int(np.flatnonzero(spheres)[np.argmax(radii[spheres] <= 0.0)])
        raise InvalidSceneError(f"radius[{k}] = {radii[k]:g} is not allowed: that of a sphere must be > 0")
    sizes = np.sqrt(np.sum(solids.vertex**2, axis=1))
    bounding = np.array([sizes[a:b].max() for a, b in zip(solids.first_vertex, solids.first_vertex[1:], strict=False)])
    radii[~spheres] = bounding[kind[~spheres]]
    vertices, faces = np.diff(solids.first_vertex), np.diff(solids.first_face)
    each_vertex, each_face = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    each_vertex[~spheres], each_face[~spheres] = vertices[kind[~spheres]], faces[kind[~spheres]]
    first_vertex, first_face = _starts(each_vertex), _starts(each_face)
    placed = Placed(
        x=np.array(centres),
        shape=kind,
        radius=radii,
        vertex=np.empty((first_vertex[-1], 3)),
        normal=np.empty((first_face[-1], 3)),
        first_vertex=first_vertex[:-1].copy(),
        first_face=first_face[:-1].copy(),
    )
    place_bodies(np.array(turns), solids, placed)
    return placed


def find_contacts(
    solids: Solids, placed: Placed, pairs: ArrayLike, margin: float, planes: ArrayLike | None = None
) -> Contacts:
    """Find the contacts of pairs of bodies, and of bodies with planes, within a margin.

    Parameters
    ----------
    solids, placed
        From `pack` and `place`.
    pairs : array_like of int, shape (k, 2)
        Bodies i and j, as `near_pairs` gives them, or body i and b + the number of a plane.
    margin : float
        Largest gap of a contact [m]; it may be negative.
    planes : array_like, shape (m, 6), optional
        A point of each plane [m] and its unit normal, out of the half-space behind it.

    Returns
    -------
    Contacts
        Contacts of each pair in turn. Those of two polyhedra are all corners of the surface of gaps over the common projection along
        the normal, so those of a face on a face are the corners of the support polygon, and the smallest gap is the distance, or
        less the length of the shortest displacement that separates the bodies.

    Raises
    ------
    InvalidSceneError
        If a shape or value is not allowed.

    Examples
    --------
    A cube on a cube that is turned by 45 degrees: the support polygon is a regular octagon.

    >>> cube = pack([ConvexPolyhedron.box([1.0, 1.0, 1.0])])
    >>> turn = [np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8)]
    >>> placed = place(cube, [[0.0, 0.0, 1.0], [0.0, 0.0, 3.0]], [[1.0, 0.0, 0.0, 0.0], turn], [0, 0])
    >>> contacts = find_contacts(cube, placed, [[0, 1]], 0.01)
    >>> len(contacts.gap), contacts.normal[0]
    (8, array([0., 0., 1.]))
    >>> np.round(contacts.arm_i[:, :2]**2 @ [1.0, 1.0], 12)
    array([1.17157288, 1.17157288, 1.17157288, 1.17157288, 1.17157288,
           1.17157288, 1.17157288, 1.17157288])
    """
    bodies = len(placed.x)
    plane = finite(
        "planes",
        np.empty((0, 6)) if planes is None else planes,
        (0 if planes is None else len(numbers("planes", planes)), 6),
    )
    off = np.abs(np.linalg.norm(plane[:, 3:], axis=1) - 1.0) > UNIT
    if np.any(off):
        k = int(np.argmax(off))
        raise InvalidSceneError(f"the normal {plane[k, 3:].tolist()} of plane {k} is not allowed: its size must be 1")
    listed = _checked_pairs(pairs, bodies, len(plane))
    margin = at_least("margin", margin, -LARGEST)
    work = scratch()
    contacts = rows(PER_PAIR * len(listed))
    while True:
        count = int(find_all(solids, placed, np.array(plane), listed, margin, work, contacts))
        if count <= len(contacts.gap):
            return Contacts(
                body=contacts.body[:count],
                arm_i=contacts.arm_i[:count],
                arm_j=contacts.arm_j[:count],
                normal=contacts.normal[:count],
                gap=contacts.gap[:count],
                feature=contacts.feature[:count],
            )
        contacts = rows(count)


def _checked_pairs(pairs: ArrayLike, bodies: int, planes: int) -> IntArray:
    given = rows_of("pairs", pairs, 2)
    bad = (
        (given != np.floor(given)).any(axis=1)
        | (given < 0).any(axis=1)
        | (given[:, 0] >= bodies)
        | (given[:, 1] >= bodies + planes)
        | (given[:, 0] == given[:, 1])
    )
    if np.any(bad):
        k = int(np.argmax(bad))
        raise InvalidSceneError(
            f"pairs[{k}] = {given[k].tolist()} is not allowed: it must be two of {bodies} bodies, or a body and {bodies} + the number "
            f"of one of {planes} planes"
        )
    return given.astype(np.int64)


def rows(count: int) -> Contacts:
    """Arrays for a number of contacts."""
    return Contacts(
        body=np.empty((count, 2), dtype=np.int64),
        arm_i=np.empty((count, 3)),
        arm_j=np.empty((count, 3)),
        normal=np.empty((count, 3)),
        gap=np.empty(count),
        feature=np.empty((count, 2), dtype=np.int64),
    )


def scratch() -> Work:
    """Scratch of one thread."""
    return Work(
        place=np.empty((2, VERTICES, 3)),
        facing=np.empty((2, FACES), dtype=np.int64),
        up=np.empty((2, VERTICES), dtype=np.int64),
        vertex=np.empty((2, VERTICES), dtype=np.int64),
        edge=np.empty((2, EDGES), dtype=np.int64),
        face=np.empty((2, FACES), dtype=np.int64),
        listed=np.empty((2, 3), dtype=np.int64),
        length=np.empty((2, EDGES)),
        along=np.empty(FACES),
    )
