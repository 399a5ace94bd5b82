"""Contacts of bodies in space in a step: frames, gaps and how motions change them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.cd.contact_kernels import ROUND_OFF
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.space.walls import largest_displacement, material_shift
from ninedisk.core.scene import Spheres
from ninedisk.core.shapes import Contacts, ConvexPolyhedron, find_contacts, near_pairs, pack, place

FEATURES = 1024
"""Numbers of features of a body: more than `ninedisk.core.shapes.state.WHOLE`."""


class Frames(NamedTuple):
    """Contacts of c points: bodies where they are at the start of the step, walls where they are at its end.

    Attributes
    ----------
    pairs : ndarray of int64, shape (c, 2)
        Body numbers, bodies first.
    key : ndarray of int64, shape (c,)
        One number for each pair of features that touch.
    row : ndarray of int64, shape (c,)
        Row of the law table.
    axes : ndarray, shape (c, 3, 3)
        Normal from body i to body j and two tangents.
    arm : ndarray, shape (c, 3)
        Point on body i from its centre [m].
    gap, gap_before : ndarray, shape (c,)
        Gap [m] if no body moved, and with walls where they are at the start.
    shift : ndarray, shape (c, 2)
        Tangential displacement of i's surface against j's [m] if no body moved: minus that of the wall.
    motion : ndarray, shape (c, 2, 3, 6)
        Contact velocities ``(u_n, u_t)`` of a unit velocity or spin of i and j: ``u_n`` opens, ``u_t`` is i's against j's; 0 for a wall.
    """

    pairs: IntArray
    key: IntArray
    row: IntArray
    axes: FloatArray
    arm: FloatArray
    gap: FloatArray
    gap_before: FloatArray
    shift: FloatArray
    motion: FloatArray

    @property
    def size(self) -> int:
        """Number of contact points, c."""
        return len(self.gap)

    def pick(self, which: NDArray[np.bool_]) -> Frames:
        """The contacts chosen by a mask."""
        columns: list[Any] = [column[which] for column in self]
        return Frames(*columns)

    def relative(self, motion: FloatArray) -> FloatArray:
        """Opening and slip, shape (c, 3), of velocities or displacements of the bodies, shape (n, 6)."""
        n = len(motion)
        found = np.einsum("kab,kb->ka", self.motion[:, 0], motion[self.pairs[:, 0]])
        of_body = self.pairs[:, 1] < n
        found[of_body] += np.einsum("kab,kb->ka", self.motion[of_body, 1], motion[self.pairs[of_body, 1]])
        return np.asarray(found)


@dataclass(frozen=True)
class Place:
    """Bodies at the start of a step, walls at both its ends.

    Attributes
    ----------
    x : ndarray, shape (n, 3)
        Centres [m].
    quaternion : ndarray, shape (n, 4)
    before, after : ndarray, shape (m, 4, 3)
        Walls (`ninedisk.core.cd.space.walls.WallPoses.at`).
    """

    x: FloatArray
    quaternion: FloatArray
    before: FloatArray
    after: FloatArray


class ContactSearch:
    """Finds the contacts of the bodies of a scene.

    Parameters
    ----------
    spheres : Spheres
    laws : LawTable

    Attributes
    ----------
    smallest_radius : float
        [m]
    """

    def __init__(self, spheres: Spheres, laws: LawTable) -> None:
        self._laws, self._radius, self._fixed = laws, spheres.radius, spheres.fixed
        self.smallest_radius = float(spheres.radius.min())
        self._round = ~spheres.boxes
        self._shape = np.full(len(spheres), -1)
        kinds = list(dict.fromkeys(map(tuple, spheres.half_sizes[spheres.boxes].tolist())))
        self._solids = pack([ConvexPolyhedron.box(kind) for kind in kinds])
        numbers = {kind: k for k, kind in enumerate(kinds)}
        for i in np.flatnonzero(spheres.boxes):
            self._shape[i] = numbers[tuple(spheres.half_sizes[i].tolist())]

    def round_off(self, where: Place) -> float:
        """Error of a gap [m] that the rounding of coordinates explains."""
        largest = max(float(np.abs(where.x).max()), float(self._radius.max()))
        return ROUND_OFF * max(largest, float(np.abs(where.after[:, 0]).max(initial=0.0)))

    def surface_displacement(self, dx: FloatArray) -> float:
        """Largest displacement of a point of a body [m], under displacements and turns of shape (n, 6)."""
        moved, turned = np.linalg.norm(dx[:, :3], axis=1), np.linalg.norm(dx[:, 3:], axis=1)
        return float((moved + self._radius * turned).max())

    def wall_displacement(self, where: Place) -> float:
        """Bound on the displacement of a wall's surface near the bodies in the step [m]."""
        return largest_displacement(where.x, where.before, where.after)

    def within(self, where: Place, reach: float) -> Frames:
        """Contacts with a gap up to ``reach`` [m], sorted by their pairs."""
        contacts = self._contacts(where, self._pairs(where, reach), reach)
        return self._frames(where, contacts)

    def gaps(self, x: FloatArray, quaternion: FloatArray, walls: FloatArray, pairs: IntArray) -> FloatArray:
        """Smallest gap [m] of each pair, negative where it overlaps, shape (k,)."""
        where, n = Place(x, quaternion, walls, walls), len(x)
        gaps = np.empty(len(pairs))
        for k, (i, j) in enumerate(pairs.tolist()):
            far = np.linalg.norm(x[j] - x[i]) if j < n else abs((x[i] - walls[j - n, 0]) @ walls[j - n, 1])
            gaps[k] = self._contacts(where, np.array([[i, j]]), 1.01 * float(far)).gap.min()
        return gaps

    def _pairs(self, where: Place, reach: float) -> IntArray:
        n = len(where.x)
        found = [near_pairs(where.x, self._radius, reach)]
        found[0] = found[0][~(self._fixed[found[0]].all(axis=1))]
        for w, wall in enumerate(where.after):
            height = (where.x - wall[0]) @ wall[1]
            near = np.flatnonzero((height - self._radius <= reach) & ~self._fixed)
            found.append(np.column_stack([near, np.full(len(near), n + w)]))
        pairs = np.concatenate(found)
        return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))])

    def _contacts(self, where: Place, pairs: IntArray, reach: float) -> Contacts:
        placed = place(self._solids, where.x, where.quaternion, self._shape, self._radius)
        planes = where.after[:, :2].reshape(-1, 6) if len(where.after) else None
        return find_contacts(self._solids, placed, pairs, reach, planes)

    def _frames(self, where: Place, contacts: Contacts) -> Frames:
        n, pairs, normal = len(where.x), contacts.body, contacts.normal
        i, j = pairs.T
        row = self._laws.rows(pairs)
        of_wall = np.flatnonzero(j >= n)
        w = j[of_wall] - n
        axes = np.stack([normal, *tangents(normal)], axis=1)
        gap_before, moved = contacts.gap.copy(), np.zeros_like(normal)
        if len(of_wall):
            point, inward = where.before[w, 0], where.before[w, 1]
            x, arm = where.x[i[of_wall]], contacts.arm_i[of_wall]
            on_round = np.sum((x - point) * inward, axis=1) - self._radius[i[of_wall]]
            on_corner = np.sum((x + arm - point) * inward, axis=1)
            gap_before[of_wall] = np.where(self._round[i[of_wall]], on_round, on_corner)
            foot = where.after[w, 0] + contacts.arm_j[of_wall]
            moved[of_wall] = material_shift(foot, w, where.before, where.after)
        # Where the law's arm ends in the middle of the overlap.
        shorter = 0.5 * self._laws.arm_overlap[row] * np.maximum(0.0, -gap_before)
        first, second = contacts.arm_i - shorter[:, None] * normal, contacts.arm_j + shorter[:, None] * normal
        motion = np.zeros((len(normal), 2, 3, 6))
        for a, sign in ((0, -1.0), (1, 1.0), (2, 1.0)):
            motion[:, 0, a, :3], motion[:, 1, a, :3] = sign * axes[:, a], -sign * axes[:, a]
            motion[:, 0, a, 3:] = sign * np.cross(first, axes[:, a])
            motion[:, 1, a, 3:] = -sign * np.cross(second, axes[:, a])
        # Through the centre the normal has no arm: rounding would turn spheres.
        motion[self._round[i], 0, 0, 3:] = 0.0
        between = np.flatnonzero(j < n)
        motion[between[self._round[j[between]]], 1, 0, 3:] = 0.0
        motion[of_wall, 1] = 0.0
        features = contacts.feature
        key = ((i * (n + len(where.after)) + j) * FEATURES + features[:, 0]) * FEATURES + features[:, 1]
        shift = -np.einsum("kaj,kj->ka", axes[:, 1:], moved)
        return Frames(pairs, key, row, axes, contacts.arm_i, contacts.gap, gap_before, shift, motion)


def tangents(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors that make right-handed frames with unit normals, shape (c, 3) each.

    The first one is across the axis of the scene that is the farthest from the normal.
    """
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(normal, first)
