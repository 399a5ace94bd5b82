"""The origin of a run's own coordinates: near the disks, so that the rounding of coordinates is that of their distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.scene import Scene, Wall

FAR = 64.0
"""Distance from the scene's origin, over the size of the packing, beyond which coordinates get another one."""


def origin_near(scene: Scene) -> FloatArray:
    """A point near all disks, shape (2,) [m]; a component is 0 where the scene's own origin is near enough.

    Differences to it are exact: no coordinate differs from it by more than a part in `FAR`.
    """
    disks = scene.disks
    low, high = disks.x.min(axis=0), disks.x.max(axis=0)
    size = float((high - low).max() + disks.radius.max())
    return np.where(np.abs(disks.x).min(axis=0) > FAR * size, 0.5 * (low + high), 0.0)


def about(scene: Scene, origin: FloatArray) -> tuple[Scene, FloatArray]:
    """The scene in coordinates relative to ``origin`` [m], and what its walls' points need to be those of the scene again, shape (m, 2).

    The point of a wall that never turns moves along its surface to the origin's foot: far away its rounding would count as a gap's.
    """
    if not origin.any():
        return scene, np.zeros((len(scene.walls), 2))
    walls, back = list[Wall](), np.zeros((len(scene.walls), 2))
    for w, wall in enumerate(scene.walls):
        point, normal = np.array(wall.point) - origin, np.array(wall.normal)
        if not any(segment.angular_velocity for segment in wall.motion):
            point = (point @ normal) * normal
        back[w] = np.array(wall.point) - point
        motion = tuple(
            segment if segment.pivot is None else replace(segment, pivot=tuple(np.array(segment.pivot) - origin))
            for segment in wall.motion
        )
        walls.append(replace(wall, point=tuple(point), motion=motion))
    return scene.replace(disks=replace(scene.disks, x=scene.disks.x - origin), walls=tuple(walls)), back
