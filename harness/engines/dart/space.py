"""Spheres in space in DART: what of them it has."""

from __future__ import annotations

from ninedisk.harness.api.capabilities import Capability

IN_SPACE = frozenset(
    {
        Capability.SPHERES,
        Capability.FRICTION,
        Capability.RESTITUTION,
        Capability.MOVING_WALLS,
        Capability.ROTATING_WALLS,
        Capability.CURVED_WALL_MOTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
        Capability.FIXED_DISKS,
        Capability.HELD_MOTION,
    }
)
