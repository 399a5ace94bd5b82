"""Wall poses and velocities at every contact step, for engines that cannot evaluate prescribed motion themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.scene import Scene, WallSegment


def moving_until(scene: Scene) -> float:
    """Return the time [s] after which every wall rests.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    float
        [s]; 0 if no wall ever moves, inf if one never stops.

    Examples
    --------
    A floor that rises at 0.5 m/s for 2 s:

    >>> law = ContactLaw(kn=1e6)
    >>> rise = WallSegment(duration=2.0, velocity=(0.0, 0.5))
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=[rise])
    >>> scene = Scene(disks=Disks(x=[[0.0, 5.0]], radius=0.5, mass=1.0), disk_disk=law, walls=[floor])
    >>> moving_until(scene)
    2.0
    """
    end = 0.0
    for wall in scene.walls:
        begin = 0.0
        for segment in wall.motion:
            begin += segment.duration
            if _is_moving(segment):
                end = max(end, begin)
    return end


def wall_path(scene: Scene, dt: float, n_steps: int) -> NDArray[np.float64]:
    """Return wall tables of the steps ``0 .. k``, after which no wall moves any more (``k <= n_steps``).

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

    Examples
    --------
    A floor that rises at 0.5 m/s for 2 s:

    >>> law = ContactLaw(kn=1e6)
    >>> rise = WallSegment(duration=2.0, velocity=(0.0, 0.5))
    >>> floor = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=[rise])
    >>> scene = Scene(disks=Disks(x=[[0.0, 5.0]], radius=0.5, mass=1.0), disk_disk=law, walls=[floor])
    >>> path = wall_path(scene, dt=0.5, n_steps=10)
    >>> path[:, 0, 1].tolist(), path[1, 0, 7].item()
    ([0.0, 0.25, 0.5, 0.75, 1.0, 1.0], 0.5)
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


def _is_moving(segment: WallSegment) -> bool:
    wave = any(segment.amplitude) and segment.frequency != 0.0
    ramp = any(segment.tan_lever) and segment.tan_rate != 0.0
    return any(segment.velocity) or segment.angular_velocity != 0.0 or wave or ramp
