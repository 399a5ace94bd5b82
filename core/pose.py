"""Columns of the poses of walls in 2D."""

from __future__ import annotations

POINT_X, POINT_Y, NORMAL_X, NORMAL_Y, PIVOT_X, PIVOT_Y, PIVOT_VX, PIVOT_VY, TURN_RATE, DASHPOT_VX, DASHPOT_VY = range(
    11
)
"""Columns of a wall's pose: a point of its surface [m], the normal into the free side, the pivot [m] and its velocity [m/s], rotation
rate [rad/s], and the pivot's velocity that dashpots see [m/s]."""

POSE = 11
"""Number of columns of a pose."""
