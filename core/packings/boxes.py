"""Disks in a box: packings, biaxial compression, a column that collapses."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.law import ContactLaw
from ninedisk.core.packings.parts import (
    GRAVITY,
    LEAST_OVERLAP,
    MOST_DISKS,
    SPREAD,
    checked_count,
    checked_positive,
    contact_law,
    random_generator,
    settle,
    uniform_disks,
)
from ninedisk.core.scene import Scene
from ninedisk.core.scene.walls import Wall, WallSegment
from ninedisk.core.validate import kind_of, short_repr, within


def poured(columns: int, rows: int, *, seed: int = 0, mu: float = 0.5, overlap: float = 0.005) -> Scene:
    """Disks on a loose lattice between three walls, about to fall.

    Parameters
    ----------
    columns, rows : int
        Disks along and across the floor, >= 1.
    seed : int
        Of the radii and of small displacements.
    mu : float
        Friction coefficient, >= 0.
    overlap : float
        Overlap over diameter that the weight causes at the floor, in [1e-9, 0.1].

    Returns
    -------
    Scene

    Raises
    ------
    InvalidSceneError
        If a value is out of range.
    """
    columns = checked_count("columns", columns)
    rows = checked_count("rows", rows, high=MOST_DISKS // columns)
    overlap = within("overlap", overlap, LEAST_OVERLAP, 0.1)
    rng = random_generator(seed)
    pitch = 2.0 * SPREAD[1]
    grid = np.array([(i, j) for j in range(rows) for i in range(columns)], dtype=np.float64)
    x = pitch * (grid + 0.5) + rng.uniform(-0.05, 0.05, grid.shape)
    x[:, 0] += 0.1
    x[:, 1] += 0.1
    radius = rng.uniform(*SPREAD, len(x)) * 0.9
    law = contact_law(0.85 * pitch * rows, overlap=overlap, mu=mu)
    return Scene(
        disks=uniform_disks(x, radius), disk_disk=law, walls=_box(pitch * columns + 0.2, law), gravity=(0.0, -GRAVITY)
    )


def settled_packing(
    n: int, *, seed: int = 0, aspect: float = 1.0, progress: Callable[[int, int], None] | None = None, threads: int = 1
) -> Scene:
    """A settled packing of about ``n`` disks, ``aspect`` times as high as wide.

    Parameters
    ----------
    n : int
        Number of disks, >= 1; rounded to a whole lattice.
    seed : int
    aspect : float
        Height over width, in [1/n, n]: from a row to a column; 50 makes a tall column.
    progress, threads
        As in `settle`.
    """
    n = checked_count("n", n)
    aspect = within("aspect", aspect, 1.0 / n, n)
    columns = max(1, round(math.sqrt(n / aspect)))
    return settle(poured(columns, max(1, round(n / columns)), seed=seed), progress=progress, threads=threads)


def side_by_side(scene: Scene, copies: int) -> Scene:
    """``copies`` of a box scene next to each other, without the walls between: size without another settling.

    Shear forces at walls start anew.

    Raises
    ------
    InvalidSceneError
        If the scene is not one of `poured`'s boxes.
    """
    kind_of("scene", scene, Scene)
    copies = checked_count("copies", copies, high=MOST_DISKS // max(len(scene.disks), 1))
    if [wall.name for wall in scene.walls] != ["left", "right", "bottom"]:
        raise InvalidSceneError(
            f"side_by_side takes a box with the walls left, right, bottom, not scene = {short_repr(scene)}"
        )
    disks, width = scene.disks, scene.walls[1].point[0]
    n = len(disks)
    x = np.concatenate([disks.x + np.array([k * width, 0.0]) for k in range(copies)])
    tiled = uniform_disks(x, np.tile(disks.radius, copies), np.tile(disks.mass, copies))
    shear = {
        (i + k * n, j + k * n): force for k in range(copies) for (i, j), force in scene.initial_shear.items() if j < n
    }
    return scene.replace(disks=tiled, walls=_box(copies * width, scene.disk_disk), initial_shear=shear)


def biaxial(columns: int, rows: int, *, seed: int = 0, strain: float = 0.02, duration: float = 10.0) -> Scene:
    """Disks without gravity between four walls of which top and bottom close in.

    Parameters
    ----------
    columns, rows : int
        Disks along the sides, >= 1.
    seed : int
    strain : float
        Part of the height by which each of the two walls moves in, in (0, 0.3].
    duration : float
        Time that they take [s], > 0.
    """
    strain = within("strain", strain, 0.0, 0.3, open_low=True)
    duration = checked_positive("duration", duration)
    base = poured(columns, rows, seed=seed)
    height = 2.0 * SPREAD[1] * rows + 0.2
    law = base.disk_disk
    speed = strain * height / duration
    bottom = (WallSegment(duration=duration, velocity=(0.0, speed)),)
    top = (WallSegment(duration=duration, velocity=(0.0, -speed)),)
    walls = (
        *base.walls[:2],
        Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=law, motion=bottom),
        Wall(name="top", point=(0.0, height), normal=(0.0, -1.0), law=law, motion=top),
    )
    return base.replace(walls=walls, gravity=(0.0, 0.0), xi=1.0)


def collapse(scene: Scene, *, speed: float = 20.0) -> Scene:
    """A settled box whose right wall is pulled away: the collapse of a column.

    Parameters
    ----------
    scene : Scene
        One of `settled_packing`.
    speed : float
        Speed of the wall [m/s], > 0; faster than the grains fall.
    """
    kind_of("scene", scene, Scene)
    speed = checked_positive("speed", speed)
    scene.wall_index("right")
    walls = [
        Wall(
            name=wall.name,
            point=wall.point,
            normal=wall.normal,
            law=wall.law,
            motion=(WallSegment(velocity=(speed, 0.0)),),
        )
        if wall.name == "right"
        else wall
        for wall in scene.walls
    ]
    return scene.replace(walls=tuple(walls))


def _box(width: float, law: ContactLaw) -> tuple[Wall, ...]:
    return (
        Wall(name="left", point=(0.0, 0.0), normal=(1.0, 0.0), law=law),
        Wall(name="right", point=(width, 0.0), normal=(-1.0, 0.0), law=law),
        Wall(name="bottom", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),
    )
