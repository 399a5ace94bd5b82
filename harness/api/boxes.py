"""Boxes in space: their rotations, as unit quaternions (w, x, y, z), and how far they reach."""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.scene import Scene, SphereScene


def has_boxes(scene: Scene | SphereScene) -> bool:
    """Whether some body of the scene is a box."""
    return isinstance(scene, SphereScene) and bool(scene.spheres.boxes.any())


def rotation_matrix(quaternion: FloatArray) -> FloatArray:
    """Matrix from the body's frame to the scene's of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def quaternion_product(one: FloatArray, two: FloatArray) -> FloatArray:
    """Product of two quaternions (w, x, y, z): the rotation ``two``, then ``one``."""
    scalar = one[0] * two[0] - one[1:] @ two[1:]
    return np.concatenate([[scalar], one[0] * two[1:] + two[0] * one[1:] + np.cross(one[1:], two[1:])])


def box_reach(half_sizes: FloatArray, rotation: FloatArray, normal: FloatArray) -> float:
    """How far a box reaches from its centre along a direction [m]."""
    return float(half_sizes @ np.abs(rotation.T @ normal))
