"""Kernels of prescribed wall motion: pose and velocity as exact functions of time."""

from __future__ import annotations

from math import cos, sin, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.pose import (
    DASHPOT_VX,
    DASHPOT_VY,
    NORMAL_X,
    NORMAL_Y,
    PIVOT_VX,
    PIVOT_VY,
    PIVOT_X,
    PIVOT_Y,
    POINT_X,
    POINT_Y,
    TURN_RATE,
)


class WallMotion(NamedTuple):
    """Motion of m walls as a table of s segments, each wall's last one being rest.

    Attributes
    ----------
    first : ndarray of int64, shape (m + 1,)
        Segments ``first[w] .. first[w+1]-1`` belong to wall ``w``.
    begin : ndarray, shape (s,)
        Time at which a segment begins [s].
    point, normal, pivot : ndarray, shape (s, 2)
        Surface point [m], unit normal [-] and pivot [m] at the segment's beginning.
    velocity : ndarray, shape (s, 2)
        Translation velocity [m/s].
    spin : ndarray, shape (s,)
        Rotation rate [rad/s].
    amplitude, tan_lever : ndarray, shape (s, 2)
        Coefficients of the harmonic and the tangent term [m].
    frequency, phase, tan_rate : ndarray, shape (s,)
        Angular frequency [rad/s], phase [rad] and rate of the tangent term [rad/s].
    """

    first: NDArray[np.int64]
    begin: NDArray[np.float64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    pivot: NDArray[np.float64]
    velocity: NDArray[np.float64]
    spin: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    frequency: NDArray[np.float64]
    phase: NDArray[np.float64]
    tan_lever: NDArray[np.float64]
    tan_rate: NDArray[np.float64]


@inline_kernel
def active_segment(motion: WallMotion, wall: int, t: float) -> int:
    """Index of the segment of ``wall`` that holds at time ``t`` [s]."""
    k = int(motion.first[wall + 1]) - 1
    while k > motion.first[wall] and motion.begin[k] > t:
        k -= 1
    return k


@inline_kernel
def displacement(motion: WallMotion, k: int, tau: float) -> tuple[float, float]:
    """Displacement [m] of the pivot of segment ``k`` at ``tau`` [s] after its beginning."""
    dx = motion.velocity[k, 0] * tau
    dy = motion.velocity[k, 1] * tau
    if motion.amplitude[k, 0] != 0.0 or motion.amplitude[k, 1] != 0.0:
        wave = sin(motion.frequency[k] * tau + motion.phase[k]) - sin(motion.phase[k])
        dx += motion.amplitude[k, 0] * wave
        dy += motion.amplitude[k, 1] * wave
    if motion.tan_rate[k] != 0.0:
        ramp = tan(motion.tan_rate[k] * tau)
        dx += motion.tan_lever[k, 0] * ramp
        dy += motion.tan_lever[k, 1] * ramp
    return dx, dy


@inline_kernel
def pose_at(motion: WallMotion, k: int, t: float) -> tuple[float, float, float, float, float, float]:
    """Surface point [m], normal [-] and pivot [m] of segment ``k`` at time ``t`` [s].

    The normal is turned from its value at the segment's beginning, so that a wall that does not rotate keeps its
    normal to the last bit.
    """
    tau = t - motion.begin[k]
    dx, dy = displacement(motion, k, tau)
    cx, cy = motion.pivot[k, 0] + dx, motion.pivot[k, 1] + dy
    ax, ay = motion.point[k, 0] - motion.pivot[k, 0], motion.point[k, 1] - motion.pivot[k, 1]
    nx, ny = motion.normal[k, 0], motion.normal[k, 1]
    if motion.spin[k] != 0.0:
        c, s = cos(motion.spin[k] * tau), sin(motion.spin[k] * tau)
        ax, ay = c * ax - s * ay, s * ax + c * ay
        nx, ny = c * nx - s * ny, s * nx + c * ny
    return cx + ax, cy + ay, nx, ny, cx, cy


@inline_kernel
def velocity_at(motion: WallMotion, k: int, t: float) -> tuple[float, float]:
    """Velocity [m/s] of the pivot of segment ``k`` at time ``t`` [s]."""
    tau = t - motion.begin[k]
    vx, vy = motion.velocity[k, 0], motion.velocity[k, 1]
    if motion.amplitude[k, 0] != 0.0 or motion.amplitude[k, 1] != 0.0:
        rate = motion.frequency[k] * cos(motion.frequency[k] * tau + motion.phase[k])
        vx += motion.amplitude[k, 0] * rate
        vy += motion.amplitude[k, 1] * rate
    if motion.tan_rate[k] != 0.0:
        c = cos(motion.tan_rate[k] * tau)
        rate = motion.tan_rate[k] / (c * c)
        vx += motion.tan_lever[k, 0] * rate
        vy += motion.tan_lever[k, 1] * rate
    return vx, vy


@kernel
def place_walls(motion: WallMotion, t: float, t_velocity: float, t_rate: float, wall: NDArray[np.float64]) -> None:
    """Fill the wall table for time ``t``, with velocities of the time ``t_velocity`` just before it.

    Parameters
    ----------
    motion : WallMotion
    t, t_velocity : float
        Times of the poses and of the velocities [s]. Pivot, velocity and rotation rate are those of the segment active at
        ``t_velocity``; the surface follows the segment active just before ``t``, so that a segment which ends between two
        steps ends there.
    t_rate : float
        Time at which dashpots see the walls' velocity [s], in the same segment.
    wall : ndarray, shape (m, 11)
        Out, columns above.
    """
    for w in range(wall.shape[0]):
        k = active_segment(motion, w, t_velocity)
        px, py, nx, ny, cx, cy = pose_at(motion, k, t)
        later = k
        while later + 1 < motion.first[w + 1] and motion.begin[later + 1] < t:
            later += 1
        if later != k:
            px, py, nx, ny, _, _ = pose_at(motion, later, t)
        vx, vy = velocity_at(motion, k, t_velocity)
        wall[w, POINT_X], wall[w, POINT_Y] = px, py
        wall[w, NORMAL_X], wall[w, NORMAL_Y] = nx, ny
        wall[w, PIVOT_X], wall[w, PIVOT_Y] = cx, cy
        wall[w, PIVOT_VX], wall[w, PIVOT_VY] = vx, vy
        wall[w, TURN_RATE] = motion.spin[k]
        wall[w, DASHPOT_VX], wall[w, DASHPOT_VY] = velocity_at(motion, k, t_rate)
