"""Geometry of contacts at the start of a step, against walls at its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.contact_kernels import measure_frames
from ninedisk.core.cd.laws import LawTable
from ninedisk.core.errors import NonFiniteStateError

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
    place : ndarray, shape (c, 2)
        Where on both outlines the contact is (span + u + 1/2); 0 on disks and walls.
    """

    pairs: IntArray
    row: IntArray
    normal: FloatArray
    gap: FloatArray
    gap_before: FloatArray
    shift: FloatArray
    arms: FloatArray
    place: FloatArray

    def __len__(self) -> int:
        return len(self.pairs)

    def pick(self, which: NDArray[np.bool_] | IntArray) -> Frames:
        """The contacts chosen by a mask, shape (c,), or by their numbers."""
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

    Raises
    ------
    NonFiniteStateError
        If the centres of two disks coincide: their contact has no normal.
    """
    n, c = len(x), len(pairs)
    row = np.where(pairs[:, 1] >= n, pairs[:, 1] - n + 1, 0)
    normal, arms = np.empty((c, 2)), np.empty((c, 4))
    gap, gap_before, shift = np.empty(c), np.empty(c), np.empty(c)
    same = measure_frames(pairs, row, x, radius, before, after, laws.arrays, normal, gap, gap_before, shift, arms)
    if same >= 0:
        (i, j), (px, py) = pairs[same], x[pairs[same, 0], :2]
        raise NonFiniteStateError(
            f"the centres of disks {i} and {j} coincide at ({px:g}, {py:g}): their contact has no normal"
        )
    return Frames(pairs, row, normal, gap, gap_before, shift, arms, np.zeros((c, 2)))
