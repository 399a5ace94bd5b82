"""Lengths of scenes that adapters share: how far walls must reach, what touches within round-off."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np

from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene, SphereScene
from ninedisk.harness.api.engine import EngineError

TOUCH_ULPS = 16.0
"""A gap is a sum of a few coordinates of bodies and walls, each rounded to half a unit in the last place."""


def wall_reach(scene: Scene | SphereScene, numerics: Numerics, engine: str) -> float:
    """Half-length [m] of a wall that no body can leave within the run: four times the scene's size and the displacement of its
    fastest body.

    Raises
    ------
    EngineError
        If that is no finite length; ``engine`` is the name in the message.
    """
    reach = 4.0 * (largest_extent(scene) + longest_path(scene, numerics))
    if not math.isfinite(reach):
        raise EngineError(
            f"{engine}: the bodies' way over the run is no finite length; reduce velocities, dt or n_steps"
        )
    return reach


def touch_length(scene: Scene | SphereScene, numerics: Numerics, engine: str) -> float:
    """Length [m] of a few units of round-off of the scene's coordinates: bodies that are no further apart touch.

    Raises
    ------
    EngineError
        If the bodies' way over the run is no finite length.
    """
    return TOUCH_ULPS * float(np.spacing(wall_reach(scene, numerics, engine)))


def largest_extent(scene: Scene | SphereScene) -> float:
    """Largest distance from the origin that bodies and walls' points reach at time 0 [m]."""
    far = [float(np.abs(scene.bodies.x).max() + scene.bodies.radius.max())] if len(scene.bodies) else []
    return max([*far, *(max(map(abs, wall.point)) for wall in scene.walls)], default=1.0)


def longest_path(scene: Scene | SphereScene, numerics: Numerics) -> float:
    """Path [m] of the fastest body over the run, were it free: walls must be longer than that."""
    t = numerics.dt * numerics.n_steps
    return top_speed(scene) * t + 0.5 * math.hypot(*scene.gravity) * t * t


def top_speed(scene: Scene | SphereScene) -> float:
    """Bound of the speeds [m/s] with which bodies' surfaces begin; what walls drive may be twice as fast as they."""
    bodies = scene.bodies
    speed = float(reduce(np.hypot, bodies.v.T).max(initial=0.0))
    spin = float(np.abs(bodies.omega.T * bodies.radius).max(initial=0.0))
    driven = max((abs(v) for wall in scene.walls for seg in wall.motion for v in seg.velocity), default=0.0)
    return speed + spin + 2.0 * driven
