"""Boxes of a scene: gaps and normals, which are geometry and come from no engine, and sums over the contacts of a pair."""

from __future__ import annotations

from typing import Any

import numpy as np

from ninedisk.core.history import Pair
from ninedisk.core.scene import SphereScene
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.boxes import box_reach, has_boxes, rotation_matrix

CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""Signs of the corners of a box along its axes, shape (8, 3)."""


def box_frame(
    scene: SphereScene, x: FloatArray, quaternion: FloatArray, point: FloatArray, normal: FloatArray, i: int, j: int
) -> tuple[FloatArray, float]:
    """Unit normal from body ``i`` to body ``j``, one of which at least is a box, and the smallest gap [m].

    Parameters
    ----------
    scene : SphereScene
    x, quaternion : array
        Centres [m] and orientations of the bodies, shapes (n, 3) and (n, 4).
    point, normal : array
        Walls' surface points [m] and normals, shape (m, 3).
    i, j : int
        A body, and a later one or a wall.
    """
    bodies = scene.spheres
    half, boxes, wall = bodies.half_sizes, bodies.boxes, j - len(bodies)
    if wall >= 0:
        reach = box_reach(half[i], rotation_matrix(quaternion[i]), normal[wall])
        return -normal[wall], float((x[i] - point[wall]) @ normal[wall] - reach)
    if boxes[i] and boxes[j]:
        return _two_boxes(scene, x, quaternion, i, j)
    box, ball = (i, j) if boxes[i] else (j, i)
    turned = rotation_matrix(quaternion[box])
    seen = turned.T @ (x[ball] - x[box])
    nearest = np.clip(seen, -half[box], half[box])
    away = seen - nearest
    distance = float(np.linalg.norm(away))
    if distance == 0.0:  # the centre lies in the box: it leaves by the nearest face
        depth = half[box] - np.abs(seen)
        face = int(np.argmin(depth))
        away, distance = np.zeros(3), -float(depth[face])
        away[face] = np.copysign(1.0, seen[face])
    else:
        away = away / distance
    outward = turned @ away
    return (outward if box == i else -outward), distance - float(bodies.radius[ball])


def _two_boxes(scene: SphereScene, x: FloatArray, quaternion: FloatArray, i: int, j: int) -> tuple[FloatArray, float]:
    from ninedisk.core.shapes import ConvexPolyhedron, find_contacts, pack, place

    bodies, both = scene.spheres, [i, j]
    solids = pack([ConvexPolyhedron.box(bodies.half_sizes[k]) for k in both])
    turns = quaternion[both] / np.linalg.norm(quaternion[both], axis=1)[:, None]
    placed = place(solids, x[both], turns, [0, 1])
    margin = float(np.linalg.norm(x[j] - x[i]) + bodies.radius[both].sum())
    found = find_contacts(solids, placed, [[0, 1]], margin)
    deepest = int(np.argmin(found.gap))
    return np.array(found.normal[deepest]), float(found.gap[deepest])


class ContactSums:
    """Impulses of a step on the first body of each touching pair, and of scenes with boxes their moments about its centre."""

    def __init__(self, scene: Any) -> None:
        self.size = scene.dimension
        self.impulses: dict[Pair, FloatArray] = {}
        self.moments: dict[Pair, FloatArray] | None = {} if has_boxes(scene) else None

    def add(
        self, one: int, two: int, on_one: FloatArray, place: FloatArray | None = None, centres: FloatArray | None = None
    ) -> None:
        """Add the impulse [N s] of a contact on body ``one``.

        Parameters
        ----------
        one, two : int
            Bodies of the contact, in either order.
        on_one : array
            Impulse on ``one`` [N s].
        place, centres : array, optional
            Place of the contact and centres of all bodies when it was found [m]; needed where the scene has boxes.
        """
        pair = (min(one, two), max(one, two))
        on_first = on_one if one < two else -on_one
        self.impulses[pair] = self.impulses.get(pair, np.zeros(self.size)) + on_first
        if self.moments is not None and place is not None and centres is not None:
            moment = np.cross(place - centres[pair[0]], on_first)
            self.moments[pair] = self.moments.get(pair, np.zeros(3)) + moment
