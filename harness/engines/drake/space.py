"""Spheres in space in Drake's discrete plants: what of them they have."""

from __future__ import annotations

from ninedisk.harness.api.capabilities import Capability

IN_SPACE = frozenset(
    {
        Capability.SPHERES,
        Capability.FRICTION,
        Capability.GRAVITY,
        Capability.BLOCKED_ROTATION,
    }
)
"""Planes rest: in the solver's tolerance, part of all momenta together, those of a wall too heavy to be moved would hide the spheres'."""
