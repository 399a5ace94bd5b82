"""Geometry of contacts at the start of a step, against walls at its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.laws import LawTable

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Frames:
    """Contacts of c pairs: disks where they are at the start of the step, walls where they are at its end.

    A wall's end pose makes its gap exact: with the disk's displacement ``dx``, the gap after the step is
    ``gap + n_wall . dx`` whatever the wall did meanwhile. Between disks it is linear in ``dx`` and never above the true gap.

    Attributes
    ----------
    pairs : ndarray of int64, shape (c, 2)
        Body numbers.
    row : ndarray of int64, shape (c,)
        Row of the law table.
    normal : ndarray, shape (c, 2)
        Unit normal from body i to body j.
    gap : ndarray, shape (c,)
        Gap [m] if no disk moved.
    gap_before : ndarray, shape (c,)
        Gap at the start of the step [m]: walls at the start, too.
    shift : ndarray, shape (c,)
        Tangential displacement of i's surface against j's [m] if no disk moved: minus that of the wall.
    arms : ndarray, shape (c, 4)
        Rotation columns of the Jacobian [m].
    """

    pairs: IntArray
    row: IntArray
    normal: FloatArray
    gap: FloatArray
    gap_before: FloatArray
    shift: FloatArray
    arms: FloatArray

    def __len__(self) -> int:
        return len(self.pairs)

    def pick(self, which: NDArray[np.bool_]) -> Frames:
        """The contacts chosen by a mask, shape (c,)."""
        return Frames(*(column[which] for column in vars(self).values()))


def contact_frames(
    pairs: IntArray, x: FloatArray, radius: FloatArray, before: FloatArray, after: FloatArray, laws: LawTable
) -> Frames:
    """Frames of the pairs.

    Parameters
    ----------
    pairs : ndarray of int64, shape (c, 2)
        Body numbers, disks first.
    x : ndarray, shape (n, 2)
        Centres at the start of the step [m].
    radius : ndarray, shape (n,)
        Radii [m].
    before, after : ndarray, shape (m, 11)
        Walls at the start and at the end of the step.
    laws : LawTable

    Returns
    -------
    Frames
    """
    n, c = len(x), len(pairs)
    i, j = pairs[:, 0], pairs[:, 1]
    wall = j >= n
    normal, arms = np.empty((c, 2)), np.zeros((c, 4))
    gap, gap_before, shift = np.empty(c), np.empty(c), np.zeros(c)
    row = np.where(wall, j - n + 1, 0)
    a, b = i[~wall], j[~wall]
    apart = x[b] - x[a]
    distance = np.sqrt((apart * apart).sum(axis=1))
    normal[~wall] = apart / distance[:, None]
    gap[~wall] = gap_before[~wall] = distance - (radius[a] + radius[b])
    if wall.any():
        a, w = i[wall], j[wall] - n
        old, new = before[w], after[w]
        inward = new[:, 2:4]
        height = ((x[a] - new[:, 0:2]) * inward).sum(axis=1)
        normal[wall] = -inward
        gap[wall] = height - radius[a]
        gap_before[wall] = ((x[a] - old[:, 0:2]) * old[:, 2:4]).sum(axis=1) - radius[a]
        deep = laws.wall_mid[row[wall]] * 0.5 * np.maximum(0.0, -gap[wall])
        touch = x[a] - (height + deep)[:, None] * inward
        moved = _material_shift(touch, old, new)
        # t = (-n_y, n_x) of the contact's normal n = -inward.
        shift[wall] = -(moved[:, 0] * inward[:, 1] - moved[:, 1] * inward[:, 0])
    shorter = 0.5 * laws.arm_overlap[row] * np.maximum(0.0, -gap_before)
    arms[:, 2] = radius[i] - shorter
    arms[~wall, 3] = radius[j[~wall]] - shorter[~wall]
    return Frames(pairs, row, normal, gap, gap_before, shift, arms)


def _material_shift(point: FloatArray, old: FloatArray, new: FloatArray) -> FloatArray:
    """Displacement over the step [m] of the walls' material that is at ``point``, shape (c, 2), at its end."""
    cos = (old[:, 2] * new[:, 2] + old[:, 3] * new[:, 3])[:, None]
    sin = (new[:, 2] * old[:, 3] - new[:, 3] * old[:, 2])[:, None]
    # A wall that does not turn keeps its normal to the last bit: no round-off of a rotation by nothing.
    turned = ((old[:, 2:4] != new[:, 2:4]).any(axis=1))[:, None]
    arm = point - new[:, 0:2]
    back = np.where(turned, cos * arm + sin * np.column_stack([-arm[:, 1], arm[:, 0]]), arm)
    return new[:, 0:2] - old[:, 0:2] + arm - back
