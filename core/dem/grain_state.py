"""Arrays of a DEM run whose bodies have outlines, grouped as the kernels read them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.nurbs.curve_kernels import ShapeTable
from ninedisk.core.nurbs.state import ContactRows, Workspace

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

FS, FN, OVERLAP, ENERGY, MIDDLE_A, LENGTH_A, MIDDLE_B, LENGTH_B, NORMAL_X, NORMAL_Y, ARM_A, ARM_B = range(12)
"""Columns of a contact: shear and normal force [N], overlap [m], energy of the normal force [J], the arcs of the first and of the second
outline that bound the common area: middle and length, in spans; the normal, and the arms [m] of the two bodies' own outlines."""

SIDE, COUNT, CODE, FIRST, SECOND = 0, 1, 3, 4, 5
"""Entries of `Memory.mark`: which of the two sides holds the last finished step; contacts of either side (2 entries); what stopped
the step that is not finished, a code of `nurbs_state` or `ROOM`, and the two bodies."""

ROOM = -5
"""No room for another contact in the memory."""


class Memory(NamedTuple):
    """What the contacts of one step leave to the next, for n bodies; two sides, which take turns.

    Everything is by the scene's numbers of the bodies: rebuilds of the lists and the order of the disks do not touch it. The first
    body of a contact is the one with the smaller number; a wall w is body n + w.

    Attributes
    ----------
    contact : ndarray, shape (2, room, 12)
        Columns above.
    body : ndarray of int64, shape (2, room, 3)
        First body, second body, next contact of the same first body or -1.
    head : ndarray of int64, shape (2, n)
        Newest contact of each first body, or -1.
    mark : ndarray of int64, shape (6,)
        Entries above.
    spin : ndarray, shape (n,)
        Spin at the step before [rad/s], from which that at ``t_n`` is extrapolated.
    """

    contact: FloatArray
    body: IntArray
    head: IntArray
    mark: IntArray
    spin: FloatArray


class Outlines(NamedTuple):
    """Outlines of n bodies, by the scene's numbers; m walls.

    Attributes
    ----------
    table : ShapeTable
        The scene's outlines and circles of the disks' radii.
    shape : ndarray of int64, shape (n,)
        Row of the table.
    round : ndarray of bool, shape (n,)
        Whether the body is a disk by itself, not by its outline.
    angle : ndarray, shape (n,)
        Angles at time 0 [rad].
    size : ndarray, shape (n,)
        Radius of the disk of the same area [m].
    area : ndarray of bool, shape (1 + m,)
        Whether the law between disks, and that of each wall, has the energy of the common area.
    turn : ndarray, shape (n, 2)
        Cosine and sine of the present angle.
    spin : ndarray, shape (n,)
        Spin that contact dashpots see [rad/s].
    carried : ndarray, shape (MOST_ROOTS / 2,)
        Shear forces that the contacts of one pair inherit [N].
    arc : ndarray, shape (MOST_ROOTS / 2, 4)
        Their arcs: these four columns of a contact.
    before : ndarray, shape (MOST_ROOTS / 2, 4)
        Normal and arms that they had a step before, the last four columns of a contact; zeros where there was none.
    work : Workspace
    found : ContactRows
        Contacts of one pair, in the frame that has the first body's position as its origin and the scene's axes.
    memory : Memory
    """

    table: ShapeTable
    shape: IntArray
    round: NDArray[np.bool_]
    angle: FloatArray
    size: FloatArray
    area: NDArray[np.bool_]
    turn: FloatArray
    spin: FloatArray
    carried: FloatArray
    arc: FloatArray
    before: FloatArray
    work: Workspace
    found: ContactRows
    memory: Memory
