"""Allocation of the arrays of a DEM run."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.dem.constants import law_row
from ninedisk.core.dem.lists import PAIRS_PER_DISK, empty_list
from ninedisk.core.dem.neighbour_kernels import NeighbourList
from ninedisk.core.dem.pair_kernels import SCRATCH, note_pairs
from ninedisk.core.dem.state import DiskArrays, Samples, Team, Views, WallArrays
from ninedisk.core.motion import wall_poses
from ninedisk.core.motion_kernels import WallMotion
from ninedisk.core.scene import Scene
from ninedisk.core.threads import PAD

SORT_FROM = 2_000
"""Number of disks from which they are kept in the order of the cells: a smaller scene fits into the fast caches anyway, and the
order of its disks stays the scene's."""

STRIPES = 64
"""Most stripes of a sorted run, whatever the number of threads."""

LINE = 64
"""Bytes of a line of the caches."""

ENERGIES = ("translation", "rotation", "elastic_normal", "elastic_shear", "gravity")


class Lists(NamedTuple):
    """Neighbour lists in use and their spares, for disks and walls."""

    disks: NeighbourList
    walls: NeighbourList
    spare: NeighbourList
    wall_spare: NeighbourList


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """Copy that begins with a line of the caches, so that no vector of numbers lies across two of them."""
    room = np.zeros(values.nbytes + LINE, dtype=np.uint8)
    first = -room.ctypes.data % LINE
    found = room[first : first + values.nbytes].view(values.dtype).reshape(values.shape)
    found[...] = values
    return found


def disk_arrays(scene: Scene, lagged: bool) -> DiskArrays:
    """State of the disks at time 0, in the scene's order; ``lagged``: dashpots see the velocity of half a step before."""
    disks, n = scene.disks, len(scene.disks)
    damped = not lagged and any(law.beta > 0.0 for law in (scene.disk_disk, *(wall.law for wall in scene.walls)))
    arrays = DiskArrays(
        x=disks.x,
        v=disks.v,
        angle=np.zeros(n),
        omega=disks.omega,
        radius=disks.radius,
        inv_mass=np.where(disks.fixed, 0.0, 1.0 / disks.mass),
        inv_inertia=np.where(disks.rotating, 1.0 / disks.inertia, 0.0),
        force=np.zeros((n, 2)),
        torque=np.zeros(n),
        v_now=disks.v if damped else np.zeros((0, 2)),
        moved=np.zeros((n, 2), dtype=np.float32),
        name=np.arange(n, dtype=np.uint32),
        place=np.arange(n, dtype=np.uint32),
        listed=np.arange(n, dtype=np.uint32),
    )
    return DiskArrays(*(aligned(array) for array in arrays))


def disk_views(disks: DiskArrays, lists: Lists, law: NDArray[np.float64]) -> Views:
    """Views of the disks, and rows and dashpots of the listed pairs.

    These stay where a rebuild puts the new list until it copies it: it notes them anew afterwards.
    """
    seen = disks.v_now if len(disks.v_now) else disks.v
    views = Views(
        x=disks.x.reshape(-1),
        v=disks.v.reshape(-1),
        seen=seen.reshape(-1),
        force=disks.force.reshape(-1),
        moved=disks.moved.reshape(-1),
        row=lists.spare.other,
        damping=lists.spare.shear,
    )
    note_pairs(disks, views, lists.disks, law)
    return views


def wall_arrays(scene: Scene, motion: WallMotion, stripes: int) -> WallArrays:
    """State of the walls at time 0."""
    m = len(scene.walls)
    poses = wall_poses(motion, 0.0)
    return WallArrays(
        now=poses,
        built=poses.copy(),
        middle=poses.copy(),
        extent=np.zeros(m),
        law=np.array([law_row(wall.law) for wall in scene.walls]).reshape(m, 8),
        load=np.zeros((m, 3)),
        load_before=np.zeros((m, 3)),
        share=np.zeros((stripes, m, 3)),
        behind=np.zeros((stripes, 3)),
        passed=np.zeros(1, dtype=np.int64),
    )


def team_arrays(stripes: int, threads: int) -> Team:
    """Shared arrays of the threads; the stripes are set by the first rebuild."""
    return Team(
        stripe=np.zeros(stripes + 1, dtype=np.int64),
        border=np.zeros(stripes, dtype=np.int64),
        flags=np.zeros(threads * PAD, dtype=np.int64),
        far=np.zeros(threads * PAD),
        code=np.zeros(1, dtype=np.int64),
        scratch=np.zeros((threads, SCRATCH + 2 * PAD)),
    )


def first_lists(n: int, m: int) -> Lists:
    """Empty lists for n disks and m walls."""
    room, wall_room = int(PAIRS_PER_DISK * n) + 16, n // 64 + 16
    return Lists(empty_list(n, room), empty_list(m, wall_room), empty_list(n, room), empty_list(m, wall_room))


def sample_arrays(at: NDArray[np.int64], chosen: NDArray[np.int64], pairs: NDArray[np.int64], n_walls: int) -> Samples:
    """Room for the samples at the contact steps ``at``."""
    s, k, c, m = len(at), len(chosen), len(pairs), n_walls
    return Samples(
        at=at,
        chosen=chosen,
        pairs=pairs,
        x=np.empty((s, k, 2)),
        v=np.empty((s, k, 2)),
        angle=np.empty((s, k)),
        omega=np.empty((s, k)),
        gap=np.empty((s, c)),
        fn=np.empty((s, c)),
        fs=np.empty((s, c)),
        wall_point=np.empty((s, m, 2)),
        wall_angle=np.empty((s, m)),
        wall_force=np.empty((s, m, 2)),
        energy=np.empty((s, len(ENERGIES))),
        wall_work=np.empty(s),
    )
