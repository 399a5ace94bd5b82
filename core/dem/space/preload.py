"""Shear forces that contacts of spheres carry at time 0."""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.dem.preload import check_preload
from ninedisk.core.dem.space import state as columns
from ninedisk.core.dem.space.arrays import nearest
from ninedisk.core.dem.space.state import Contacts, Images, State
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.history import Pair
from ninedisk.core.scene import SphereScene

ACROSS = 1e-6
"""Largest part of a preload along the normal: what a force that was written with seven digits may have."""


def enter_preload(
    scene: SphereScene, laws: FloatArray, pairs: Contacts, at_planes: Contacts, state: State, images: Images | None
) -> None:
    """Write the scene's initial shear forces into the memory of the lists, in a periodic cell each into the contact with the nearest image.

    Raises
    ------
    InvalidSceneError
        If a pair does not touch, its contact is smooth, or the force is not at right angles to the normal.
    """
    n, place = len(scene.spheres), np.argsort(state.name)
    for (i, j), given in scene.initial_shear.items():
        force = np.array(given)
        apart = scene.spheres.x[j] - scene.spheres.x[i] if j < n else -np.array(scene.walls[j - n].normal)
        if images is not None:
            apart = nearest(apart, images.now)
        check_preload(scene, i, j, given, apart if j < n else None)
        normal = apart / np.linalg.norm(apart)
        size, along = float(np.linalg.norm(force)), float(force @ normal)
        if abs(along) > ACROSS * size:
            raise InvalidSceneError(
                f"the initial shear force of {scene.body_name(i)} and {scene.body_name(j)} has {along:g} N along their normal, of "
                f"{size:g} N: it must be at right angles to it; leave out that part"
            )
        row, other = (int(place[i]), int(place[j])) if j < n else (j - n, int(place[i]))
        contacts, side = pairs if j < n else at_planes, 1.0
        listed = _entries(contacts, row, other)
        if len(listed) == 0:
            row, other, side = other, row, -1.0
            listed = _entries(contacts, row, other)
        if images is not None:
            shifts = contacts.notes[listed, columns.IMAGE : columns.IMAGE + 3] @ images.now.T
            between = scene.spheres.x[other] - scene.spheres.x[row] + shifts
            listed = listed[[int(np.argmin(np.linalg.norm(between, axis=1)))]]
        k, law = int(listed[0]), laws[contacts.law[listed[0]]]
        if law[columns.STICKS] > 0.0:
            contacts.notes[k, columns.NECK] = abs(contacts.notes[k, columns.NECK])
        value = side * (force - along * normal)
        if law[columns.HERTZ] > 0.0 and law[columns.UNLOADING] != columns.FORCE:
            value = value / _shear_stiffness(scene, law, contacts, k, (i, j), float(np.linalg.norm(apart)))
        contacts.memory[k, columns.SHEAR : columns.SHEAR + 3] = value


def _entries(contacts: Contacts, row: int, other: int) -> IntArray:
    """Entries of a row with this partner."""
    listed = np.arange(int(contacts.start[row]), int(contacts.start[row + 1]))
    found: IntArray = listed[contacts.other[listed] == other]
    return found


def _shear_stiffness(
    scene: SphereScene, law: FloatArray, contacts: Contacts, k: int, pair: Pair, apart: float
) -> float:
    """``8 G* a`` [N/m] of the listed pair k, whose centres are ``apart`` [m]."""
    (i, j), n, x, radius = pair, len(scene.spheres), scene.spheres.x, scene.spheres.radius
    if law[columns.STICKS] > 0.0:
        raise InvalidSceneError(
            f"the initial shear force of {scene.body_name(i)} and {scene.body_name(j)} is not allowed with surface = 'jkr' and an "
            "unloading other than 'force': choose unloading = 'force', or drop the entry"
        )
    if j < n:
        overlap = radius[i] + radius[j] - apart
    else:
        wall = scene.walls[j - n]
        overlap = radius[i] - (x[i] - np.array(wall.point)) @ np.array(wall.normal)
    return float(law[columns.KS] * np.sqrt(contacts.memory[k, columns.REDUCED] * overlap))


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
    n = len(name)
    found: dict[Pair, tuple[float, ...]] = {}
    for (a, b), fs in zip(bodies.tolist(), force[:, 1:], strict=True):
        if fs.any():
            i, j = int(name[a]), int(name[b]) if b < n else b
            side = 1.0 if i < j else -1.0
            if (min(i, j), max(i, j)) in found or i == j:
                raise InvalidSceneError(
                    f"spheres {i} and {j} touch through two images of the periodic cell, so that their shear forces have no common "
                    "name: save a checkpoint to go on from here, or use a larger cell"
                )
            found[min(i, j), max(i, j)] = tuple((side * fs).tolist())
    return found
