"""Compile the prescribed motion of walls into the table that the kernels read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.pose import NORMAL_X, PIVOT_X, POINT_X, POSE
from ninedisk.core.scene import Wall, WallSegment
from ninedisk.core.scene.motion_kernels import WallMotion, place_walls


def compile_motion(walls: Sequence[Wall]) -> WallMotion:
    """Table of all segments, each wall closed by an endless segment of rest.

    Parameters
    ----------
    walls : sequence of Wall

    Returns
    -------
    WallMotion
        Every segment begins exactly where the one before it ends.
    """
    first, rows = [0], []
    for wall in walls:
        begin, point, normal = 0.0, np.array(wall.point), np.array(wall.normal)
        segments = (*wall.motion, WallSegment())
        for segment in segments:
            rows.append((begin, point, normal, segment))
            if not np.isfinite(segment.duration):
                break
            single = _table([0, 1], [(begin, point, normal, segment)])
            end = begin + segment.duration
            pose = np.empty((1, POSE))
            place_walls(single, end, begin, begin, pose)
            begin, point, normal = end, pose[0, POINT_X:NORMAL_X].copy(), pose[0, NORMAL_X:PIVOT_X].copy()
        first.append(len(rows))
    return _table(first, rows)


def wall_poses(motion: WallMotion, t: float) -> NDArray[np.float64]:
    """Wall table at time ``t``, shape (m, 11), columns of `ninedisk.core.scene.motion_kernels`."""
    table = np.empty((len(motion.first) - 1, POSE))
    place_walls(motion, t, t, t, table)
    return table


def _table(
    first: list[int], rows: list[tuple[float, NDArray[np.float64], NDArray[np.float64], WallSegment]]
) -> WallMotion:
    def column(values: list[object], width: int) -> NDArray[np.float64]:
        return np.array(values, dtype=np.float64).reshape((len(rows), width) if width > 1 else len(rows))

    segments = [segment for *_, segment in rows]
    return WallMotion(
        first=np.array(first, dtype=np.int64),
        begin=column([begin for begin, *_ in rows], 1),
        point=column([point for _, point, _, _ in rows], 2),
        normal=column([normal for _, _, normal, _ in rows], 2),
        pivot=column([point if seg.pivot is None else seg.pivot for _, point, _, seg in rows], 2),
        velocity=column([seg.velocity for seg in segments], 2),
        spin=column([seg.angular_velocity for seg in segments], 1),
        amplitude=column([seg.amplitude for seg in segments], 2),
        frequency=column([seg.frequency for seg in segments], 1),
        phase=column([seg.phase for seg in segments], 1),
        tan_lever=column([seg.tan_lever for seg in segments], 2),
        tan_rate=column([seg.tan_rate for seg in segments], 1),
    )
