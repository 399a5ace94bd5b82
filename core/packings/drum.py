"""A rotating drum."""

from __future__ import annotations

import math

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.packings.parts import GRAVITY, SPREAD, checked_count, contact_law, random_generator, uniform_disks
from ninedisk.core.scene import Scene
from ninedisk.core.scene.walls import Wall, WallSegment
from ninedisk.core.validate import LARGEST, finite, within

MOST_SIDES = 1_000
"""Walls are compared with each other, and every disk with every wall."""


def drum(n: int, *, seed: int = 0, turns_per_second: float = 0.05, sides: int = 24, fill: float = 0.4) -> Scene:
    """Disks in a rotating polygon, about to fall to its bottom.

    Parameters
    ----------
    n : int
        Number of disks, >= 1.
    seed : int
    turns_per_second : float
        Rate of rotation [1/s], counter-clockwise.
    sides : int
        Sides of the drum, 3 .. `MOST_SIDES`.
    fill : float
        Part of the drum that the disks fill, in [0.001, 0.6].
    """
    n, sides = checked_count("n", n), checked_count("sides", sides, low=3, high=MOST_SIDES)
    fill = within("fill", fill, 1e-3, 0.6)
    turns_per_second = float(finite("turns_per_second", turns_per_second, (), most=LARGEST))
    rng = random_generator(seed)
    pitch = 2.0 * SPREAD[1]
    inner = max(2.0 * pitch, pitch * math.sqrt(n / (fill * math.pi)))
    side = math.ceil(2.0 * inner / pitch)
    grid = np.array([(i, j) for j in range(side) for i in range(side)], dtype=np.float64)
    places = pitch * (grid - 0.5 * (side - 1))
    places = places[np.hypot(places[:, 0], places[:, 1]) < inner - pitch][:n]
    if len(places) < n:
        raise InvalidSceneError(
            f"fill = {fill:g} is not allowed: the drum holds only {len(places)} of n = {n} disks on a lattice; fill less"
        )
    law = contact_law(inner)
    spin = 2.0 * math.pi * turns_per_second
    walls = []
    for k in range(sides):
        angle = 2.0 * math.pi * k / sides
        out = (math.cos(angle), math.sin(angle))
        motion = (WallSegment(angular_velocity=spin, pivot=(0.0, 0.0)),) if spin else ()
        walls.append(
            Wall(
                name=f"side {k}",
                point=(inner * out[0], inner * out[1]),
                normal=(-out[0], -out[1]),
                law=law,
                motion=motion,
            )
        )
    x = places + rng.uniform(-0.05, 0.05, places.shape)
    return Scene(
        disks=uniform_disks(x, rng.uniform(*SPREAD, n) * 0.9),
        disk_disk=law,
        walls=tuple(walls),
        gravity=(0.0, -GRAVITY),
    )
