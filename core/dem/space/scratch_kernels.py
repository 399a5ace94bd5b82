"""The contacts of a chunk in the fastest cache: where each of their numbers is, by rows for what bodies have, by columns for the law."""

from __future__ import annotations

import numpy as np

from ninedisk.core.compile import fused_inline_kernel, inline_kernel
from ninedisk.core.dem.space.registers import INTERPRETED, WIDE, scale, transpose
from ninedisk.core.dem.space.state import DRAG, ROLL_DRAG, TWIST_DRAG, Contacts, Floats, Index, Vector

LANES = 1 if INTERPRETED else 8
"""Numbers in the widest vectors of processors; `CHUNK` is a multiple."""
CHUNK = 64
"""Contacts that go through the loops together."""


# Columns of the scratch, `WIDE` for each vector of the contacts: differences of their bodies as in `Touch`; springs, with the
# reduced radius; force on the first body, n x fs, fs with fn; for resistances spins of the first body relative to the second one, torque
# on the latter, rolling torque with the twisting one.
D, DV, ROLLS, SPINS, SPRINGS, DASHPOT_DV, D_BEFORE, PUSH, CROSSED, FS, TURNS, MOMENT, ROLLED = (
    np.uint64(c * WIDE * CHUNK) for c in range(13)
)
# And of numbers: sum of the radii, dashpots, repulsive part of fn, loss of the arms.
REACH, ITS_DRAG, REPULSIVE, ARM_LOSS, ITS_ROLL_DRAG, ITS_TWIST_DRAG = (
    np.uint64((13 * WIDE + c) * CHUNK) for c in range(6)
)
# Vectors row by row, as they come from the bodies (some of those above) and go to them.
D_ROWS, DV_ROWS, ROLLS_ROWS, SPINS_ROWS, SPRINGS_ROWS, DASHPOT_ROWS, TURNS_ROWS, ROLLED_ROWS = (
    np.uint64((13 * WIDE + 6) * CHUNK // WIDE + c * CHUNK) for c in range(8)
)
PUSH_ROWS, CROSSED_ROWS, MOMENT_ROWS = D_ROWS, DV_ROWS, ROLLS_ROWS
ITS_NECK = np.uint64((13 * WIDE + 6 + 8 * WIDE) * CHUNK)
# Spins of the first body relative to the second one, as dashpots see them.
DASHPOT_TURNS = np.uint64((13 * WIDE + 7 + 8 * WIDE) * CHUNK)
DASHPOT_TURNS_ROWS = np.uint64((13 * WIDE + 7 + 9 * WIDE) * CHUNK // WIDE)
SCRATCH = (13 * WIDE + 7 + 10 * WIDE) * CHUNK
OLD_SPRINGS, OLD_ROLLED = np.uint64(SCRATCH), np.uint64(SCRATCH + WIDE * CHUNK)
SCRATCH_COUNTED = SCRATCH + 2 * WIDE * CHUNK
"""Room with what contacts remembered before the step, which losses are counted from."""
ONE, TWO, LAST, FOUR, NEXT = (np.uint64(c) for c in (1, 2, 3, WIDE, CHUNK))


@fused_inline_kernel
def xyz(values: Floats, at: np.uint64) -> Vector:
    """A vector of a sphere, or of a row of the scratch."""
    first = FOUR * at
    return values[first], values[first + ONE], values[first + TWO]


@fused_inline_kernel
def vector(scratch: Floats, at: np.uint64) -> Vector:
    """A vector of the scratch's columns."""
    return scratch[at], scratch[at + NEXT], scratch[at + TWO * NEXT]


@fused_inline_kernel
def get_extra(scratch: Floats, at: np.uint64) -> float:
    """The number beside a vector."""
    return float(scratch[at + LAST * NEXT])


@fused_inline_kernel
def put_vector(scratch: Floats, at: np.uint64, a: Vector) -> None:
    """Write a vector into the scratch's columns."""
    scratch[at], scratch[at + NEXT], scratch[at + TWO * NEXT] = a


@inline_kernel
def to_columns(scratch: Floats, column: np.uint64, rows: np.uint64, count: np.uint64) -> None:
    """Vectors of ``count`` contacts from rows to columns."""
    for q in range(np.uint64(0), count, FOUR):
        transpose(scratch, column + q, NEXT, FOUR * (rows + q), FOUR)


@inline_kernel
def to_rows(scratch: Floats, rows: np.uint64, column: np.uint64, count: np.uint64) -> None:
    """Vectors of ``count`` contacts from columns to rows."""
    for q in range(np.uint64(0), count, FOUR):
        transpose(scratch, FOUR * (rows + q), FOUR, column + q, NEXT)


@inline_kernel
def keep_memories(resisted: bool, scratch: Floats) -> None:
    """What contacts remember, before the laws replace it."""
    for c in range(np.uint64(WIDE * CHUNK)):
        scratch[OLD_SPRINGS + c] = scratch[SPRINGS + c]
    if resisted:
        for c in range(np.uint64(WIDE * CHUNK)):
            scratch[OLD_ROLLED + c] = scratch[ROLLED + c]


@inline_kernel
def recall(contacts: Contacts, k: np.uint64, q: Index, resisted: bool, scratch: Floats) -> None:
    """Notes and memory of the listed pair k into the scratch, the latter into rows."""
    notes, memory = contacts.notes, contacts.memory
    scratch[ITS_DRAG + q] = notes[k, DRAG]
    if resisted:
        scale(scratch, SPRINGS_ROWS + q, 1.0, memory, TWO * k)
        scale(scratch, ROLLED_ROWS + q, 1.0, memory, TWO * k + ONE)
        scratch[ITS_ROLL_DRAG + q], scratch[ITS_TWIST_DRAG + q] = notes[k, ROLL_DRAG], notes[k, TWIST_DRAG]
    else:
        scale(scratch, SPRINGS_ROWS + q, 1.0, memory, k)


@inline_kernel
def remember(contacts: Contacts, k: np.uint64, q: Index, resisted: bool, keep: bool, scratch: Floats) -> None:
    """The listed pair's memory out of rows of the scratch; its force too if it is to be kept."""
    memory, force = contacts.memory, contacts.force
    if resisted:
        scale(memory, TWO * k, 1.0, scratch, SPRINGS_ROWS + q)
        scale(memory, TWO * k + ONE, 1.0, scratch, ROLLED_ROWS + q)
    else:
        scale(memory, k, 1.0, scratch, SPRINGS_ROWS + q)
    if keep:
        force[k, 0] = get_extra(scratch, FS + q)
        force[k, 1], force[k, 2], force[k, 3] = vector(scratch, FS + q)


@inline_kernel
def memories_to_columns(scratch: Floats, resisted: bool, count: np.uint64) -> None:
    """What ``count`` contacts remember, from rows."""
    to_columns(scratch, SPRINGS, SPRINGS_ROWS, count)
    if resisted:
        to_columns(scratch, ROLLED, ROLLED_ROWS, count)


@inline_kernel
def results_to_rows(scratch: Floats, resisted: bool, count: np.uint64) -> None:
    """What the laws have found of ``count`` contacts, to rows."""
    to_rows(scratch, SPRINGS_ROWS, SPRINGS, count)
    to_rows(scratch, PUSH_ROWS, PUSH, count)
    to_rows(scratch, CROSSED_ROWS, CROSSED, count)
    if resisted:
        to_rows(scratch, MOMENT_ROWS, MOMENT, count)
        to_rows(scratch, ROLLED_ROWS, ROLLED, count)
