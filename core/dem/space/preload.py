"""Shear forces that contacts of spheres carry at time 0."""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.dem.preload import check_preload
from ninedisk.core.dem.space import state as columns
from ninedisk.core.dem.space.state import Contacts, State
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.history import Pair
from ninedisk.core.scene import SphereScene

ACROSS = 1e-6
"""Largest part of a preload along the normal: what a force that was written with seven digits may have."""


def enter_preload(scene: SphereScene, laws: FloatArray, pairs: Contacts, at_planes: Contacts, state: State) -> None:
    """Write the scene's initial shear forces into the memory of the lists.

    Raises
    ------
    InvalidSceneError
        If a pair does not touch, its contact is smooth, or the force is not at right angles to the normal.
    """
    n, place = len(scene.spheres), np.argsort(state.name)
    for (i, j), given in scene.initial_shear.items():
        force = np.array(given)
        apart = scene.spheres.x[j] - scene.spheres.x[i] if j < n else -np.array(scene.walls[j - n].normal)
        check_preload(scene, i, j, given, apart if j < n else None)
        normal = apart / np.linalg.norm(apart)
        size, along = float(np.linalg.norm(force)), float(force @ normal)
        if abs(along) > ACROSS * size:
            raise InvalidSceneError(
                f"the initial shear force of {scene.body_name(i)} and {scene.body_name(j)} has {along:g} N along their normal, of "
                f"{size:g} N: it must be at right angles to it; leave out that part"
            )
        row, other = (int(place[i]), int(place[j])) if j < n else (j - n, int(place[i]))
        side = 1.0
        if j < n and row > other:
            row, other, side = other, row, -1.0
        contacts = pairs if j < n else at_planes
        listed = slice(int(contacts.start[row]), int(contacts.start[row + 1]))
        k = listed.start + int(np.flatnonzero(contacts.other[listed] == other)[0])
        _enter(scene, laws[contacts.law[k]], contacts, k, side * (force - along * normal), (i, j))


def _enter(scene: SphereScene, law: FloatArray, contacts: Contacts, k: int, force: FloatArray, pair: Pair) -> None:
    """Write one shear force, or the displacement that has it."""
    if law[columns.STICKS] > 0.0:
        contacts.notes[k, columns.NECK] = abs(contacts.notes[k, columns.NECK])
    if law[columns.HERTZ] > 0.0 and law[columns.UNLOADING] != columns.FORCE:
        if law[columns.STICKS] > 0.0:
            raise InvalidSceneError(
                f"the initial shear force of bodies {pair[0]} and {pair[1]} is not allowed with surface = 'jkr' and an unloading other "
                "than 'force': choose unloading='force', or drop the entry"
            )
        x, n, (i, j) = scene.spheres.x, len(scene.spheres), pair
        if j < n:
            overlap = scene.spheres.radius[[i, j]].sum() - np.linalg.norm(x[j] - x[i])
        else:
            wall = scene.walls[j - n]
            overlap = scene.spheres.radius[i] - (x[i] - np.array(wall.point)) @ np.array(wall.normal)
        force = force / (law[columns.KS] * np.sqrt(contacts.memory[k, columns.REDUCED] * overlap))
    contacts.memory[k, columns.SHEAR : columns.SHEAR + 3] = force


def shear_by_pair(bodies: IntArray, force: FloatArray, name: IntArray) -> dict[Pair, tuple[float, ...]]:
    """Shear forces [N] that are not zero, by body numbers of the scene.

    Parameters
    ----------
    bodies : ndarray of int, shape (k, 2)
        Rows of the state, and numbers of planes from n on.
    force : ndarray, shape (k, 4)
        ``fn``, and ``fs`` on the first of them [N].
    name : ndarray of int, shape (n,)
        Numbers in the scene by rows.
    """
    n, found = len(name), {}
    for (a, b), fs in zip(bodies.tolist(), force[:, 1:], strict=True):
        if fs.any():
            i, j = int(name[a]), int(name[b]) if b < n else b
            side = 1.0 if i < j else -1.0
            found[min(i, j), max(i, j)] = tuple((side * fs).tolist())
    return found
