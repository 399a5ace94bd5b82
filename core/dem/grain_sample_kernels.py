"""Kernels that write what a sample says of contacts when bodies have outlines: watched pairs and elastic energies."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.dem.grain_state import COUNT, ENERGY, FN, FS, OVERLAP, SIDE, Outlines
from ninedisk.core.dem.state import KS, DiskArrays, Samples, WallArrays
from ninedisk.core.nurbs.curve_kernels import Pose
from ninedisk.core.nurbs.nurbs_gap_kernels import gap_of_shapes, reach_of_shape


@inline_kernel
def contacts_between(outlines: Outlines, a: int, b: int) -> tuple[float, float, float]:
    """Largest overlap [m], and the sums of normal and shear forces [N], of all contacts of bodies a and b; zeros if there is none."""
    memory = outlines.memory
    side = memory.mark[SIDE]
    row = memory.head[side, a]
    overlap, fn, fs = 0.0, 0.0, 0.0
    while row >= 0:
        if memory.body[side, row, 1] == b:
            overlap = max(overlap, memory.contact[side, row, OVERLAP])
            fn += memory.contact[side, row, FN]
            fs += memory.contact[side, row, FS]
        row = memory.body[side, row, 2]
    return overlap, fn, fs


@inline_kernel
def pair_gap(disks: DiskArrays, outlines: Outlines, a: int, b: int) -> float:
    """Smallest distance [m] of two bodies that do not touch."""
    i, j = int(disks.place[a]), int(disks.place[b])
    dx, dy = disks.x[j, 0] - disks.x[i, 0], disks.x[j, 1] - disks.x[i, 1]
    if outlines.round[a] and outlines.round[b]:
        return float(sqrt(dx * dx + dy * dy) - (disks.radius[i] + disks.radius[j]))
    c, s, p, q = outlines.turn[a, 0], outlines.turn[a, 1], outlines.turn[b, 0], outlines.turn[b, 1]
    pose = Pose(c * p + s * q, c * q - s * p, c * dx + s * dy, c * dy - s * dx)
    return gap_of_shapes(outlines.table, outlines.shape[a], outlines.shape[b], pose)


@inline_kernel
def wall_gap(disks: DiskArrays, walls: WallArrays, outlines: Outlines, a: int, w: int) -> float:
    """Smallest distance [m] of a body from a wall, negative where it is deeper than the wall's surface."""
    i = int(disks.place[a])
    ux, uy = walls.now[w, 2], walls.now[w, 3]
    height = (disks.x[i, 0] - walls.now[w, 0]) * ux + (disks.x[i, 1] - walls.now[w, 1]) * uy
    if outlines.round[a]:
        return float(height - disks.radius[i])
    c, s = outlines.turn[a, 0], outlines.turn[a, 1]
    reach = reach_of_shape(outlines.table, outlines.shape[a], -c * ux - s * uy, s * ux - c * uy)
    return float(height - reach)


@kernel
def record_contacts(
    disks: DiskArrays,
    walls: WallArrays,
    law: NDArray[np.float64],
    outlines: Outlines,
    samples: Samples,
    row: int,
) -> None:
    """Write watched pairs and elastic energies to row ``row`` of ``samples``, in the place of what `record` takes them to be on disks.

    A pair's gap is the smallest one: the negative of the largest overlap of its contacts, or the distance of its outlines; its forces are
    the sums over its contacts, each along its own normal and tangent.
    """
    n = disks.x.shape[0]
    for c in range(samples.pairs.shape[0]):
        a, b = int(samples.pairs[c, 0]), int(samples.pairs[c, 1])
        overlap, fn, fs = contacts_between(outlines, a, b)
        gap = -overlap
        if overlap == 0.0:
            gap = pair_gap(disks, outlines, a, b) if b < n else wall_gap(disks, walls, outlines, a, b - n)
        samples.gap[row, c], samples.fn[row, c], samples.fs[row, c] = gap, fn, fs
    memory = outlines.memory
    side = memory.mark[SIDE]
    normal, shear = 0.0, 0.0
    for k in range(memory.mark[COUNT + side]):
        b, fs = memory.body[side, k, 1], memory.contact[side, k, FS]
        ks = law[KS] if b < n else walls.law[b - n, KS]
        normal += memory.contact[side, k, ENERGY]
        if ks > 0.0:
            shear += 0.5 * fs * fs / ks
    samples.energy[row, 2], samples.energy[row, 3] = normal, shear
