"""Shear forces that contacts carry at time 0."""

from __future__ import annotations

from typing import Any

import numpy as np

from ninedisk.core.array_types import FloatArray
from ninedisk.core.dem.state import COUNT, MIDDLE_A, DiskArrays, NeighbourList, Outlines
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.history import Pair
from ninedisk.core.nurbs.intersect import NurbsGrains
from ninedisk.core.scene import AnyScene, Scene


def enter_preload(scene: Scene, disks: DiskArrays, pairs: NeighbourList, wall_pairs: NeighbourList) -> None:
    """Write the scene's initial shear forces into the lists.

    Raises
    ------
    InvalidSceneError
        If a pair does not touch, or its contact is smooth.
    """
    n = len(scene.disks)
    for (i, j), force in scene.initial_shear.items():
        check_preload(scene, i, j, force, scene.disks.x[j] - scene.disks.x[i] if j < n else None)
        row, other = int(disks.place[i]), int(disks.place[j]) if j < n else 0
        if j < n:
            _enter(pairs, min(row, other), max(row, other), force)
        else:
            _enter(wall_pairs, j - n, row, force)


def enter_grain_preload(scene: Scene, outlines: Outlines) -> None:
    """Write the scene's initial shear forces into the empty memory of the outlines' contacts.

    Raises
    ------
    InvalidSceneError
        If a pair does not touch, or at several places, or its contact is smooth.
    """
    grains = NurbsGrains.of_table(outlines.table, outlines.shape)
    x, angle, n, memory = scene.disks.x, scene.disks.angle, len(scene.disks), outlines.memory
    spans = np.diff(outlines.table.first_span)[outlines.shape]
    for (i, j), force in scene.initial_shear.items():
        check_rough(scene, i, j, force)
        if j < n:
            _, rows = grains.pair_contacts(x, angle, [(i, j)])
            places = rows.place
        else:
            wall = scene.walls[j - n]
            touching, rows = grains.wall_contacts(x, angle, wall.point, wall.normal)
            places = rows.place[touching == i]
        if len(places) != 1:
            touch = "do not touch" if len(places) == 0 else f"touch at {len(places)} places"
            raise InvalidSceneError(
                f"the initial shear force {force:g} N belongs to {scene.body_name(i)} and {scene.body_name(j)}, which {touch}: give "
                "them one contact or drop the entry"
            )
        # As `grain_kernels.arcs_of` has them.
        start, other_end, end, other_start = places[0]
        arc = [*_arc(start, end, spans[i]), *(_arc(other_start, other_end, spans[j]) if j < n else (0.0, 0.0))]
        row = int(memory.mark[COUNT])
        memory.contact[0, row, : MIDDLE_A + 4] = [force, 0.0, 0.0, 0.0, *arc]
        memory.body[0, row] = i, j, memory.head[0, i]
        memory.head[0, i], memory.mark[COUNT] = row, row + 1


def _arc(start: float, end: float, ring: int) -> tuple[float, float]:
    """Middle and length of the arc that runs forward between two places on an outline of ``ring`` spans."""
    length = (end - start) % ring
    return (start + 0.5 * length) % ring, length


def check_preload(scene: AnyScene, i: int, j: int, force: Any, apart: FloatArray | None) -> None:
    """Raise `InvalidSceneError` unless bodies i and j, ``apart`` [m] or j a wall (None), touch and their contact is rough."""
    x, radius, n = scene.bodies.x, scene.bodies.radius, len(scene.bodies)
    if apart is not None:
        gap = float(np.linalg.norm(apart) - radius[i] - radius[j])
    else:
        wall = scene.walls[j - n]
        gap = float((x[i] - np.array(wall.point)) @ np.array(wall.normal) - radius[i])
    if gap >= 0.0:
        raise InvalidSceneError(
            f"the initial shear force {_shown(force)} N belongs to {scene.body_name(i)} and {scene.body_name(j)}, which do not touch "
            f"(gap {gap:g} m): give them an overlap or drop the entry"
        )
    check_rough(scene, i, j, force)


def check_rough(scene: AnyScene, i: int, j: int, force: Any) -> None:
    """Raise `InvalidSceneError` if the contact of bodies i and j is smooth and the force is not 0."""
    law = scene.law((i, j))
    name, stiffness = ("g_star", law.g_star) if law.hertz else ("ks", law.ks)
    if np.any(force) and (law.mu == 0.0 or stiffness == 0.0):
        raise InvalidSceneError(
            f"the initial shear force {_shown(force)} N belongs to {scene.body_name(i)} and {scene.body_name(j)}, whose contact is smooth "
            f"(mu = {law.mu:g}, {name} = {stiffness:g}): give it mu > 0 and {name} > 0 or drop the entry"
        )


def _shown(force: Any) -> str:
    return f"({', '.join(f'{each:g}' for each in force)})" if isinstance(force, tuple) else f"{force:g}"


def _enter(pairs: NeighbourList, row: int, other: int, force: float) -> None:
    for k in range(int(pairs.start[row]), int(pairs.start[row + 1])):
        if pairs.other[k] == other:
            pairs.shear[k] = force


def shear_by_pair(disks: DiskArrays, pairs: NeighbourList, wall_pairs: NeighbourList) -> dict[Pair, float]:
    """Shear forces [N] of the lists that are not zero, by body numbers of the scene: the inverse of `enter_preload`."""
    name, n = disks.name.astype(np.int64), len(disks.name)
    found: dict[Pair, float] = {}
    for listed, of_walls in ((pairs, False), (wall_pairs, True)):
        row = np.repeat(np.arange(len(listed.start) - 1), np.diff(listed.start))
        used = np.flatnonzero(listed.shear[: len(row)])
        other = name[listed.other[used].astype(np.int64)]
        first, second = (other, n + row[used]) if of_walls else (name[row[used]], other)
        for i, j, force in zip(first.tolist(), second.tolist(), listed.shear[used].tolist(), strict=True):
            if (min(i, j), max(i, j)) in found or i == j:
                raise InvalidSceneError(
                    f"disks {i} and {j} touch through two images of the periodic cell, so that their shear forces have no common name: "
                    "save a checkpoint to go on from here, or use a larger cell"
                )
            found[min(i, j), max(i, j)] = force
    return found
