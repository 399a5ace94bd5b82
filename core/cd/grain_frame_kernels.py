"""Kernels of the contact frames of bodies with outlines, and of what such contacts hand from step to step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.compile import inline_kernel, kernel
from ninedisk.core.cd.contact_kernels import Floats, Laws, material_shift

FARTHEST = 0.1
"""Way along an outline, over its length, that a contact is followed in one step; a strictly convex pair's one contact always is."""


@kernel
def complete_frames(
    pairs: NDArray[np.int64],
    row: NDArray[np.int64],
    x: Floats,
    first: Floats,
    second: Floats,
    tip: Floats,
    before: Floats,
    after: Floats,
    laws: Laws,
    normal: Floats,
    gap: Floats,
    gap_before: Floats,
    shift: Floats,
    arms: Floats,
) -> None:
    """Fill ``gap_before``, ``shift`` and ``arms`` of contacts whose normals and gaps are known.

    The point of body i is at ``first``, shape (c, 2), from its centre, that of j at ``second``; a wall's is measured from i's centre. With
    ``r`` one of them, a normal force has the arm ``r.t`` about i and ``-r.t`` about j, a shear force ``r.n + tip`` and ``-r.n + tip``, less
    half the overlap where the law says so. ``tip``, shape (c, 2), moves the points along the normal to the extreme points of the outlines.
    """
    n = x.shape[0]
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        nx, ny = normal[k, 0], normal[k, 1]
        rx, ry, sx, sy = first[k, 0], first[k, 1], second[k, 0], second[k, 1]
        gap_before[k], shift[k] = gap[k], 0.0
        if j >= n:
            w = j - n
            # The material point of the body that is deepest, seen from the wall as it was. Where the wall turns, see `gaps_before`.
            px, py = x[i, 0] + rx + tip[k, 0] * nx, x[i, 1] + ry + tip[k, 0] * ny
            gap_before[k] = (px - before[w, 0]) * before[w, 2] + (py - before[w, 1]) * before[w, 3]
            deep = laws.wall_mid[row[k]] * 0.5 * max(0.0, -gap[k])
            mx, my = material_shift(x[i, 0] + sx + deep * nx, x[i, 1] + sy + deep * ny, w, before, after)
            shift[k] = mx * ny - my * nx
        shorter = 0.5 * laws.arm_overlap[row[k]] * max(0.0, -gap_before[k])
        arms[k, 0], arms[k, 2] = nx * ry - ny * rx, nx * rx + ny * ry + tip[k, 0] - shorter
        arms[k, 1], arms[k, 3] = 0.0, 0.0
        if j < n:
            arms[k, 1], arms[k, 3] = ny * sx - nx * sy, tip[k, 1] - nx * sx - ny * sy - shorter


@inline_kernel
def turns_apart(one: float, other: float, spans: float) -> float:
    """Distance of two places along a closed outline over its length in spans, the shorter way; 0 where there is no outline."""
    if spans <= 0.0:
        return 0.0
    ahead = (one - other) % spans
    return min(ahead, spans - ahead) / spans


@kernel
def gaps_before(
    keys: NDArray[np.int64],
    place: Floats,
    near_keys: NDArray[np.int64],
    near_place: Floats,
    near_gap: Floats,
    spans: Floats,
    gap_before: Floats,
) -> None:
    """Gap before a wall turned: that of the nearest feature which the same pair then had; all keys ascend.

    ``spans``, shape (c,), are those of the outline. A contact without such a feature keeps what it has.
    """
    begin = 0
    for k in range(keys.shape[0]):
        while begin < near_keys.shape[0] and near_keys[begin] < keys[k]:
            begin += 1
        least, m = FARTHEST, begin
        while m < near_keys.shape[0] and near_keys[m] == keys[k]:
            off = turns_apart(place[k, 0], near_place[m, 0], spans[k])
            if off <= least:
                least, gap_before[k] = off, near_gap[m]
            m += 1


@kernel
def carry_over(
    old_keys: NDArray[np.int64],
    old_place: Floats,
    old_forces: Floats,
    keys: NDArray[np.int64],
    place: Floats,
    spans: Floats,
    single: NDArray[np.bool_],
    forces: Floats,
) -> None:
    """Give each contact of the last step's forces to the nearest contact of the same pair, to ``forces``, shape (c, 2).

    Keys of pairs, shape (k,) and (c,), ascend. ``spans``, shape (c, 2), are the numbers of spans of both outlines of each new contact, 0
    on disks and walls; ``single``, shape (c,), says that its pair never has two. Contacts that merge add their forces; one that would have
    moved by more than `FARTHEST` along each of its outlines has opened.
    """
    forces[:] = 0.0
    begin = 0
    for m in range(old_keys.shape[0]):
        while begin < keys.shape[0] and keys[begin] < old_keys[m]:
            begin += 1
        best, least, k = -1, 1e300, begin
        while k < keys.shape[0] and keys[k] == old_keys[m]:
            off_a = turns_apart(place[k, 0], old_place[m, 0], spans[k, 0])
            off_b = turns_apart(place[k, 1], old_place[m, 1], spans[k, 1])
            followed = (
                single[k] or (spans[k, 0] > 0.0 and off_a <= FARTHEST) or (spans[k, 1] > 0.0 and off_b <= FARTHEST)
            )
            if followed and off_a + off_b < least:
                best, least = k, off_a + off_b
            k += 1
        if best >= 0:
            forces[best, 0] += old_forces[m, 0]
            forces[best, 1] += old_forces[m, 1]


@kernel
def mark_covered(
    keys: NDArray[np.int64],
    place: Floats,
    gap: Floats,
    chord_keys: NDArray[np.int64],
    chord_place: Floats,
    spans: Floats,
    covered: NDArray[np.bool_],
) -> None:
    """Mark the features, of c pairs' keys, that overlap on the arc of a chord of the same pair; both sorts of keys ascend.

    ``chord_place``, shape (k, 4), begins with where the first outline enters the common area and holds where it leaves it in column 2;
    ``spans``, shape (k,), are the spans of that outline.
    """
    begin = 0
    for m in range(chord_keys.shape[0]):
        while begin < keys.shape[0] and keys[begin] < chord_keys[m]:
            begin += 1
        k = begin
        while k < keys.shape[0] and keys[k] == chord_keys[m]:
            inside = (place[k, 0] - chord_place[m, 0]) % spans[m] <= (chord_place[m, 2] - chord_place[m, 0]) % spans[m]
            covered[k] = covered[k] or (inside and gap[k] <= 0.0)
            k += 1
