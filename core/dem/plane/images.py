"""Images of disks in a periodic cell: what a run begins with, and what it refuses."""

from __future__ import annotations

import numpy as np

from ninedisk.core.array_types import FloatArray, IntArray
from ninedisk.core.dem.neighbours import PAIRS_PER_DISK, check_crowd, empty_cells, empty_list, enlarged_list
from ninedisk.core.dem.plane.image_kernels import build_image_pairs, place_cell, sort_into_images
from ninedisk.core.dem.preload import check_preload
from ninedisk.core.dem.state import OK, DiskArrays, Images, NeighbourList
from ninedisk.core.errors import InvalidNumericsError, InvalidSceneError, NonFiniteStateError
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import AnyScene, Scene
from ninedisk.core.scene.cell import Cell


def first_images(cell: Cell, n: int, capacity: int, stripes: int) -> Images:
    """Images of n disks at time 0, with room for ``capacity`` pairs."""
    motion = np.array(cell.rate) @ np.diag(cell.size)
    now = np.zeros(6)
    now[3:6] = motion[0, 0], motion[0, 1], motion[1, 1]
    images = Images(
        size=np.array(cell.size),
        now=now,
        built=np.zeros(3),
        shift=np.zeros(2 * capacity),
        spare=np.zeros(2 * capacity),
        home=np.zeros((n, 2)),
        share=np.zeros((stripes, 5)),
        load=np.zeros(5),
        work=np.zeros(1),
    )
    place_cell(images, 0.0)
    return images


def with_more_pairs(images: Images, capacity: int, used: int) -> Images:
    """Copy with room for ``capacity`` pairs, of which ``used`` are in use."""
    shift = np.zeros(2 * capacity)
    shift[: 2 * used] = images.shift[: 2 * used]
    return images._replace(shift=shift, spare=np.zeros(2 * capacity))


def check_cell(scene: AnyScene, numerics: Numerics) -> None:
    """Refuse a cell that a disk does not fit into at some time of the run, and bodies with outlines.

    Raises
    ------
    InvalidSceneError, InvalidNumericsError
    """
    cell = scene.cell
    if cell is None:
        return
    if isinstance(scene, Scene) and np.any(scene.disks.outline >= 0):
        raise InvalidSceneError(
            f"body {int(np.argmax(scene.disks.outline >= 0))} has an outline, which the DEM does not have in a periodic cell: use disks, "
            "or leave out the cell"
        )
    least = float(scene.bodies.radius.max())
    end = numerics.dt * numerics.n_steps
    for axis, name in enumerate("xyz"[: cell.dimension]):
        size, rate = cell.size[axis], cell.rate[axis][axis]
        if size < least:
            raise InvalidSceneError(
                f"cell size[{axis}] = {size:g} m is not allowed: it must be at least the largest radius, {least:g} m; use a larger cell, "
                "or several periods of the same arrangement"
            )
        if size * (1.0 + rate * end) < least:
            last = (least / size - 1.0) / rate
            raise InvalidNumericsError(
                f"the cell's edge along {name}, {size:g} m long, shrinks at the rate {rate:g} /s below the largest radius, "
                f"{least:g} m, after {last:g} s: end the run before (n_steps up to {int(last / numerics.dt)} with dt = {numerics.dt:g} s), "
                "or deform it slower"
            )


def enter_image_preload(scene: Scene, disks: DiskArrays, pairs: NeighbourList, images: Images) -> None:
    """Write the scene's initial shear forces into the list, each into the contact with the nearest image.

    Raises
    ------
    InvalidSceneError
        If a pair does not touch, or its contact is smooth.
    """
    x, size = scene.disks.x, images.size
    row = np.repeat(np.arange(len(x)), np.diff(pairs.start))
    first, second = disks.name[row].astype(np.int64), disks.name[pairs.other[: len(row)]].astype(np.int64)
    d = x[second] - x[first] + images.shift[: 2 * len(row)].reshape(-1, 2) * size
    for (i, j), force in scene.initial_shear.items():
        apart = x[j] - x[i]
        check_preload(scene, i, j, force, apart - size * np.round(apart / size))
        listed = np.flatnonzero(((first == i) & (second == j)) | ((first == j) & (second == i)))
        pairs.shear[listed[np.argmin(np.hypot(*d[listed].T))]] = force


def close_images(scene: Scene, cell: Cell, reach: float, x: FloatArray, t: float) -> tuple[IntArray, FloatArray]:
    """Pairs of disks at ``x`` and images at time ``t`` with a gap below ``reach``, shape (k, 2), and ``d = x_j - x_i + h s``, shape (k, 2).

    Lengths are in m, ``t`` in s.

    Raises
    ------
    NonFiniteStateError
        If a position is no finite number.
    """
    radius, n = scene.disks.radius, len(scene.disks)
    found, cells, none = empty_list(n, int(PAIRS_PER_DISK * n) + 16), empty_cells(n), empty_list(n, 0)
    images = first_images(cell, n, found.other.shape[0], 1)
    place_cell(images, t)
    if not sort_into_images(x, 2.0 * float(radius.max()) + reach, images, cells):
        raise NonFiniteStateError("the position of a disk is no finite number: give finite ones")
    rows = np.arange(n, dtype=np.uint32)
    while build_image_pairs(x, radius, reach, images, cells, False, rows, none, found) != OK:
        check_crowd(found)
        found = enlarged_list(found)
        images = with_more_pairs(images, found.other.shape[0], 0)
        sort_into_images(x, 2.0 * float(radius.max()) + reach, images, cells)
    first = np.repeat(np.arange(n, dtype=np.int64), np.diff(found.start))
    second = found.other[: len(first)].astype(np.int64)
    shift = images.spare[: 2 * len(first)].reshape(-1, 2)
    return np.column_stack([first, second]), x[second] - x[first] + shift @ cell.edges(t).T
