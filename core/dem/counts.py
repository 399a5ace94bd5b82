"""Counts of a DEM run: rebuilds of the lists, listed pairs, contacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ninedisk.core.compile import kernel
from ninedisk.core.dem.grain_state import COUNT, SIDE, Outlines
from ninedisk.core.dem.neighbour_kernels import NeighbourList
from ninedisk.core.dem.state import DiskArrays, WallArrays


class Counts(NamedTuple):
    """What a run has done and holds at present; the same for any number of threads.

    Attributes
    ----------
    rebuilds : int
        Rebuilds of the neighbour lists since time 0, not counting the lists that a session begins with; a checkpoint carries it on.
    pairs, wall_pairs : int
        Pairs of disks, and of a disk and a wall, that the present lists hold: those whose gap was below the skin at the last rebuild.
        Each costs in every step: a pair of disks as much as a contact, one with a wall a distance.
    contacts, wall_contacts : int
        Pairs of disks, and of a disk and a wall, that overlap at the present positions; of bodies with outlines the contacts of
        the last finished step, of which a pair can have several (before the first step those that carry a preload).
    """

    rebuilds: int
    pairs: int
    wall_pairs: int
    contacts: int
    wall_contacts: int


@kernel
def touching(disks: DiskArrays, pairs: NeighbourList) -> int:
    """Listed pairs of disks that overlap."""
    found = 0
    for i in range(disks.x.shape[0]):
        for k in range(pairs.start[i], pairs.start[i + 1]):
            j = pairs.other[k]
            dx, dy = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
            reach = disks.radius[i] + disks.radius[j]
            if dx * dx + dy * dy < reach * reach:
                found += 1
    return found


@kernel
def touching_walls(disks: DiskArrays, walls: WallArrays, pairs: NeighbourList) -> int:
    """Listed pairs of a disk and a wall that overlap."""
    found = 0
    for w in range(walls.now.shape[0]):
        px, py, ux, uy = walls.now[w, 0], walls.now[w, 1], walls.now[w, 2], walls.now[w, 3]
        for k in range(pairs.start[w], pairs.start[w + 1]):
            i = pairs.other[k]
            height = (disks.x[i, 0] - px) * ux + (disks.x[i, 1] - py) * uy
            if disks.radius[i] - height > 0.0:
                found += 1
    return found


def count(
    disks: DiskArrays,
    walls: WallArrays,
    pairs: NeighbourList,
    wall_pairs: NeighbourList,
    outlines: Outlines | None,
    rebuilds: int,
) -> Counts:
    """Counts of the present state; ``rebuilds`` is taken over."""
    if outlines is None:
        contacts, wall_contacts = int(touching(disks, pairs)), int(touching_walls(disks, walls, wall_pairs))
    else:
        contacts, wall_contacts = _of_outlines(outlines, len(disks.x))
    return Counts(rebuilds, int(pairs.start[-1]), int(wall_pairs.start[-1]), contacts, wall_contacts)


def _of_outlines(outlines: Outlines, n: int) -> tuple[int, int]:
    """Contacts in the memory of the last finished step, between bodies and with walls, which are bodies ``n`` and beyond."""
    memory = outlines.memory
    side = int(memory.mark[SIDE])
    second = memory.body[side, : int(memory.mark[COUNT + side]), 1]
    at_walls = int(np.count_nonzero(second >= n))
    return len(second) - at_walls, at_walls
