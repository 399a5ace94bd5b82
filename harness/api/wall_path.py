"""Wall poses and velocities at every contact step, for engines that cannot evaluate prescribed motion themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.scene import Scene, WallSegment


def moving_until(scene: Scene) -> float:
    """Time [s] after which every wall rests; 0 if none ever moves, inf if one never stops."""
    end = 0.0
    for wall in scene.walls:
        begin = 0.0
        for segment in wall.motion:
            begin += segment.duration
            if _moves(segment):
                end = max(end, begin)
    return end


def wall_path(scene: Scene, dt: float, n_steps: int) -> NDArray[np.float64]:
    """Wall tables of the steps ``0 .. k``, after which no wall moves any more (``k <= n_steps``).

    Parameters
    ----------
    scene : Scene
        m walls.
    dt : float
        Step [s].
    n_steps : int
        Last step of the run.

    Returns
    -------
    ndarray, shape (k + 1, m, 9)
        Row ``n``: surface point x, y [m]; normal x, y [-]; pivot x, y [m] at ``n dt``; pivot velocity x, y [m/s] and rotation
        rate [rad/s] at ``(n - 1/2) dt``, the middle of the step that ends there. The last row has no velocity if the
        motion ends before the run does.
    """
    from ninedisk.core.scene.motion import compile_motion
    from ninedisk.core.scene.motion_kernels import place_walls

    end = moving_until(scene)
    last = n_steps if not np.isfinite(end) else min(n_steps, int(np.ceil(end / dt)) + 1)
    motion = compile_motion(scene.walls)
    path = np.empty((last + 1, len(scene.walls), 11))
    for step in range(last + 1):
        middle = max(0.0, (step - 0.5) * dt)
        place_walls(motion, step * dt, middle, middle, path[step])
    return np.ascontiguousarray(path[:, :, :9])


def _moves(segment: WallSegment) -> bool:
    wave = any(segment.amplitude) and segment.frequency != 0.0
    ramp = any(segment.tan_lever) and segment.tan_rate != 0.0
    return any(segment.velocity) or segment.angular_velocity != 0.0 or wave or ramp
