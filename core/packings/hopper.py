"""A hopper: half-planes cannot enclose a funnel, so it is made of fixed disks in two inclined rows that touch each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.packings.parts import (
    DENSITY,
    GRAVITY,
    MOST_DISKS,
    SPREAD,
    checked_count,
    contact_law,
    random_generator,
)
from ninedisk.core.scene import Scene
from ninedisk.core.scene.bodies import Disks
from ninedisk.core.scene.walls import Wall, WallSegment
from ninedisk.core.validate import kind_of, within

FUNNEL = 0.5
"""Radius of the funnel's disks [m]: that of a mean grain, and no grain fits between two of them that touch."""

PITCH = 1.3
"""Lattice from which the grains fall [m]: the widest ones and the displacements of two neighbours have room in it."""

MOST_OUTLET, LEAST_ANGLE = 1_000.0, 0.01
"""Mean diameters, and radians: the rows of a wider or steeper funnel would have more disks than it holds grains."""

LOOSE = 0.8
"""Part of the plane that settled disks cover, at least."""


def hopper(
    n: int,
    *,
    outlet: float = 10.0,
    half_angle: float = math.pi / 4.0,
    mu: float = 0.5,
    aspect: float = 1.0,
    seed: int = 0,
) -> Scene:
    """Disks about to fall into a funnel whose outlet a plug closes.

    Parameters
    ----------
    n : int
        Number of grains, >= 1; the funnel's fixed disks come after them.
    outlet : float
        Clear width between the lowest disks of the two rows, in mean diameters (of 1 m), 1.5 .. `MOST_OUTLET`.
    half_angle : float
        Angle between the funnel's sides and the vertical [rad], `LEAST_ANGLE` .. pi/2; pi/2 is a silo with a flat bottom.
    mu : float
        Friction coefficient of all contacts, >= 0.
    aspect : float
        Height of the filling over the width of the bin, about, in [1/n, n].
    seed : int
        Of the radii and of small displacements.

    Returns
    -------
    Scene
        Walls "left" and "right" of the bin, which the rows reach, and the "plug", the half-plane under the lowest disks.
        `settle` brings it to rest, `discharge` opens it.

    Raises
    ------
    InvalidSceneError
        If a value is out of range.
    """
    n = checked_count("n", n)
    aspect = within("aspect", aspect, 1.0 / n, n)
    outlet = within("outlet", outlet, 1.5, MOST_OUTLET)
    half_angle = within("half_angle", half_angle, LEAST_ANGLE, math.pi / 2.0)
    wide = max(math.sqrt(n / aspect), outlet + 4.0)
    first = 0.5 * outlet + FUNNEL
    links = max(1, 1 + math.ceil((0.5 * wide - first) / (2.0 * FUNNEL * math.sin(half_angle))))
    if links > MOST_DISKS:
        raise InvalidSceneError(
            f"aspect = {aspect:g} with half_angle = {half_angle:g} is not allowed: each side of the "
            f"funnel would have {links} disks; raise one of them"
        )
    along = 2.0 * FUNNEL * np.arange(links)
    side = np.column_stack([first + along * math.sin(half_angle), along * math.cos(half_angle)])
    half = float(side[-1, 0]) + FUNNEL
    rows = np.concatenate([side * (-1.0, 1.0), side])
    rng = random_generator(seed)
    x = _places(n, half, first, half_angle) + rng.uniform(-0.05, 0.05, (n, 2))
    radius = np.concatenate([rng.uniform(*SPREAD, n), np.full(len(rows), FUNNEL)])
    is_fixed = np.arange(n + len(rows)) >= n
    law = contact_law(0.85 * float(x[:, 1].max() + FUNNEL), mu=mu)
    disks = Disks(
        x=np.concatenate([x, rows]),
        radius=radius,
        mass=DENSITY * math.pi * radius**2,
        rotating=~is_fixed,
        held=np.column_stack([is_fixed, is_fixed]),
    )
    walls = (
        Wall(name="left", point=(-half, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(half, 0.0), normal=(-1.0, 0.0), law=law),
        Wall(name="plug", point=(0.0, -FUNNEL), normal=(0.0, 1.0), law=law),
    )
    return Scene(disks=disks, disk_disk=law, walls=walls, gravity=(0.0, -GRAVITY))


def discharge(scene: Scene) -> Scene:
    """A settled hopper whose plug falls away, faster than the grains, and stays as a floor where the heap has room.

    Parameters
    ----------
    scene : Scene
        One of `hopper`.

    Raises
    ------
    InvalidSceneError
        If it has no wall "plug".
    """
    kind_of("scene", scene, Scene)
    plug = scene.walls[scene.wall_index("plug") - len(scene.disks)]
    left, right = (scene.walls[scene.wall_index(name) - len(scene.disks)].point[0] for name in ("left", "right"))
    grains = ~scene.disks.fixed
    area = math.pi * float((scene.disks.radius[grains] ** 2).sum())
    depth = area / (LOOSE * (right - left)) + 0.5 * (right - left)  # a heap that slopes by less than 45 degrees
    # Grains have fallen g t^2/2 when the plug has fallen speed t: a quarter of the depth when it gets there.
    speed = math.sqrt(2.0 * math.hypot(*scene.gravity) * depth)
    fall = (WallSegment(duration=depth / speed, velocity=(0.0, -speed)), WallSegment())
    walls = tuple(replace(wall, motion=fall) if wall is plug else wall for wall in scene.walls)
    return scene.replace(walls=walls)


def _places(n: int, half: float, first: float, half_angle: float) -> FloatArray:
    """The lowest n points of a lattice inside bin and funnel, shape (n, 2)."""
    columns = max(1, math.floor((2.0 * half - 0.1) / PITCH))
    across = PITCH * (np.arange(columns) - 0.5 * (columns - 1))
    # Rows of the funnel hold fewer; those of the bin that are added are enough for all.
    height = np.arange(math.ceil(n / columns) + math.ceil(half / math.tan(half_angle) / PITCH) + 1)
    grid: FloatArray = np.array([(i, PITCH * (j + 0.5) - FUNNEL + 0.1) for j in height for i in across])
    # Distance from the line through the funnel's centres, on either side.
    inside = (first - np.abs(grid[:, 0])) * math.cos(half_angle) + grid[:, 1] * math.sin(half_angle)
    return grid[inside > FUNNEL + 0.5 * PITCH][:n]
