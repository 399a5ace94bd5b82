"""Plane walls with their full orientation, which shows how their material moves along the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.dem.space.arrays import compile_motion
from ninedisk.core.dem.space.plane_kernels import place_planes
from ninedisk.core.dem.space.state import POSE_WIDTH
from ninedisk.core.scene import PlaneWall


class WallPoses:
    """Where walls are at a time.

    Parameters
    ----------
    walls : sequence of PlaneWall
    """

    def __init__(self, walls: Sequence[PlaneWall]) -> None:
        copies = []
        for wall in walls:
            normal = np.array(wall.normal)
            first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
            first /= np.linalg.norm(first)
            for axis in (normal, first, np.cross(normal, first)):
                # Without a pivot a segment turns about the wall's point, which the copies share.
                copies.append(replace(wall, normal=tuple(axis)))
        self._motion = compile_motion(copies)
        self._table = np.empty((3 * len(walls), POSE_WIDTH))

    def at(self, t: float) -> FloatArray:
        """Point [m], normal and two tangents of each wall's material at time ``t`` [s], shape (m, 4, 3)."""
        place_planes(self._motion, t, self._table)
        rows = self._table.reshape(-1, 3, POSE_WIDTH)
        return np.concatenate([rows[:, :1, :3], rows[:, :, 3:6]], axis=1)


def material_shift(place: FloatArray, wall: IntArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Displacement over a step [m] of the material of walls that is at these places at its end, shape (k, 3).

    Parameters
    ----------
    place : ndarray, shape (k, 3)
        Points [m].
    wall : ndarray of int64, shape (k,)
    before, after : ndarray, shape (m, 4, 3)
        Walls at both ends of the step (`WallPoses.at`).
    """
    arm = place - after[wall, 0]
    # The same combination of the material's axes; a wall that does not turn has the same axes to the last bit.
    same = np.all(before[:, 1:] == after[:, 1:], axis=(1, 2))[wall]
    along = np.einsum("kij,kj->ki", after[wall, 1:], arm)
    back = np.einsum("kij,ki->kj", before[wall, 1:], along)
    moved = after[wall, 0] - before[wall, 0]
    return np.asarray(np.where(same[:, None], moved, moved + arm - back))


def largest_displacement(x: FloatArray, before: FloatArray, after: FloatArray) -> float:
    """Bound on the displacement of a wall's surface near bodies at ``x``, shape (n, 3), between two poses [m]."""
    if not len(after):
        return 0.0
    moved = np.linalg.norm(after[:, 0] - before[:, 0], axis=1)
    turned = np.linalg.norm(after[:, 1:] - before[:, 1:], axis=(1, 2))
    # No body is farther from the wall's point than the far corner of the box around all of them.
    low, high = x.min(axis=0), x.max(axis=0)
    far = np.linalg.norm(np.maximum(high - after[:, 0], after[:, 0] - low), axis=1)
    return float((moved + turned * far).max())
