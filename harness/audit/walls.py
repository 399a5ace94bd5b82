"""Walls of an audit at one instant: half-planes and half-spaces in the same arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.harness.audit.geometry import turning


class WallPoses(NamedTuple):
    """Of m walls: a point, the normal, the pivot, its velocity (m, d) each, and the rate of turning (m, 1) or (m, 3)."""

    point: FloatArray
    normal: FloatArray
    pivot: FloatArray
    velocity: FloatArray
    rate: FloatArray

    def heights(self, x: FloatArray) -> FloatArray:
        """Heights of points above the walls, shape (n, m)."""
        return np.asarray(x @ self.normal.T - (self.point * self.normal).sum(axis=1))

    def mark_low(self, x: FloatArray, slack: FloatArray, marks: NDArray[np.bool_]) -> None:
        """Mark in ``marks`` (n, m) what is no higher above a wall than ``slack`` (n,)."""
        from ninedisk.harness.audit.kernels import mark_low

        offset = (self.point * self.normal).sum(axis=1)
        mark_low(np.ascontiguousarray(x), np.ascontiguousarray(self.normal), offset, slack, marks)

    def surface_velocity(self, wall: int, points: FloatArray) -> FloatArray:
        """Velocity of a wall's material at points (n, d)."""
        return np.asarray(self.velocity[wall] + turning(self.rate[wall], points - self.pivot[wall]))


class WallTrack:
    """Prescribed motion of walls of one dimension."""

    def __init__(self, walls: Sequence[Any], dimension: int) -> None:
        self.walls, self.dimension = walls, dimension
        self._motion: Any = None
        self._resting: WallPoses | None = None
        if not walls:
            return
        if not any(wall.motion for wall in walls):
            point, normal = (np.array([getattr(wall, name) for wall in walls]) for name in ("point", "normal"))
            turns = np.zeros((len(walls), 1 if dimension == 2 else 3))
            self._resting = WallPoses(point, normal, point, np.zeros_like(point), turns)
            return
        if dimension == 2:
            from ninedisk.core.scene.motion import compile_motion

            self._motion = compile_motion(walls)
        else:
            from ninedisk.core.dem.space.arrays import compile_motion as compile_planes

            self._motion = compile_planes(walls)

    def at(self, t: float) -> WallPoses:
        """Poses at a time [s]."""
        if not self.walls:
            d = self.dimension
            none = np.empty((0, d))
            return WallPoses(none, none, none, none, np.empty((0, 1 if d == 2 else 3)))
        return self._resting if self._resting is not None else self._at(t)

    def _at(self, t: float) -> WallPoses:
        if self.dimension == 2:
            from ninedisk.core.scene.motion import wall_poses

            table = wall_poses(self._motion, t)
            return WallPoses(table[:, :2], table[:, 2:4], table[:, 4:6], table[:, 6:8], table[:, 8:9])
        from ninedisk.core.dem.space.plane_kernels import place_planes
        from ninedisk.core.dem.space.state import POSE_WIDTH

        table = np.empty((len(self.walls), POSE_WIDTH))
        place_planes(self._motion, t, table)
        return WallPoses(*(table[:, 3 * k : 3 * k + 3] for k in range(5)))
