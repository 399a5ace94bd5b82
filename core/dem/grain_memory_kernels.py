"""Kernels that follow contacts of outlines from step to step, so that each keeps its own shear force.

Two grains, or a grain and a wall, can touch at several places. A contact is known by the two arcs that bound its common area, one on
either outline, which roll and slide along the outlines by little in a step. The rule: the shear force of a contact of the step
before goes to that contact of the same pair whose arcs' middles are nearest (distances along both outlines, each over the outline's
length, summed), if on one outline at least the middles are no farther apart than the sum of both arcs' lengths; otherwise the
contact has opened. Contacts that merge add their shear forces; of a contact that divides the nearest part inherits. A pair of
strictly convex bodies has one contact at most, which needs no such condition: as on disks, it is the same as long as
it is closed. With its shear force a contact inherits the normal and the arms of the step before.
"""

from __future__ import annotations

from ninedisk.core.compile import inline_kernel
from ninedisk.core.dem.grain_state import (
    ARM_A,
    ARM_B,
    COUNT,
    ENERGY,
    FN,
    FS,
    LENGTH_A,
    LENGTH_B,
    MIDDLE_A,
    MIDDLE_B,
    NORMAL_X,
    NORMAL_Y,
    OVERLAP,
    SIDE,
    Outlines,
)


@inline_kernel
def around(difference: float, ring: float) -> float:
    """Distance of two places along a closed outline of ``ring`` spans, the shorter way."""
    ahead = difference % ring
    return min(ahead, ring - ahead)


@inline_kernel
def arcs_of(outlines: Outlines, count: int, ring_a: float, ring_b: float) -> None:
    """Middles and lengths of the arcs of ``count`` found contacts; ``ring_b`` is 0 for a wall.

    On the first outline the arc runs forward from the entering to the leaving intersection, on the second one back again.
    """
    place, arc = outlines.found.place, outlines.arc
    for m in range(count):
        arc[m, 1] = (place[m, 2] - place[m, 0]) % ring_a
        arc[m, 0] = (place[m, 0] + 0.5 * arc[m, 1]) % ring_a
        arc[m, 2], arc[m, 3] = 0.0, 0.0
        if ring_b > 0.0:
            arc[m, 3] = (place[m, 1] - place[m, 3]) % ring_b
            arc[m, 2] = (place[m, 3] + 0.5 * arc[m, 3]) % ring_b


@inline_kernel
def inherit(outlines: Outlines, a: int, b: int, count: int, ring_a: float, ring_b: float, single: bool) -> None:
    """What the ``count`` found contacts of bodies a and b inherit: shear forces [N] to ``outlines.carried``, geometry to ``before``."""
    memory, arc, carried, before = outlines.memory, outlines.arc, outlines.carried, outlines.before
    old = memory.mark[SIDE]
    for m in range(count):
        carried[m] = 0.0
        for c in range(4):
            before[m, c] = 0.0
    row = memory.head[old, a]
    while row >= 0:
        if memory.body[old, row, 1] == b:
            contact = memory.contact[old, row]
            best, least = 0 if single else -1, 1e300
            for m in range(0 if single else count):
                off_a = around(arc[m, 0] - contact[MIDDLE_A], ring_a)
                near, distance = off_a <= arc[m, 1] + contact[LENGTH_A], off_a / ring_a
                if ring_b > 0.0:
                    off_b = around(arc[m, 2] - contact[MIDDLE_B], ring_b)
                    near = near or off_b <= arc[m, 3] + contact[LENGTH_B]
                    distance += off_b / ring_b
                if near and distance < least:
                    best, least = m, distance
            if best >= 0:
                carried[best] += contact[FS]
                for c in range(4):
                    before[best, c] = contact[NORMAL_X + c]
        row = memory.body[old, row, 2]


@inline_kernel
def remember(
    outlines: Outlines, a: int, b: int, m: int, fs: float, fn: float, energy: float, arm_a: float, arm_b: float
) -> bool:
    """Write found contact ``m`` of bodies a and b to the side of this step; False if there is no room."""
    memory = outlines.memory
    new = 1 - memory.mark[SIDE]
    row = memory.mark[COUNT + new]
    if row >= memory.contact.shape[1]:
        return False
    contact = memory.contact[new, row]
    contact[FS], contact[FN], contact[OVERLAP], contact[ENERGY] = fs, fn, outlines.found.overlap[m], energy
    contact[MIDDLE_A], contact[LENGTH_A] = outlines.arc[m, 0], outlines.arc[m, 1]
    contact[MIDDLE_B], contact[LENGTH_B] = outlines.arc[m, 2], outlines.arc[m, 3]
    contact[NORMAL_X], contact[NORMAL_Y] = outlines.found.normal[m, 0], outlines.found.normal[m, 1]
    contact[ARM_A], contact[ARM_B] = arm_a, arm_b
    memory.body[new, row, 0], memory.body[new, row, 1], memory.body[new, row, 2] = a, b, memory.head[new, a]
    memory.head[new, a] = row
    memory.mark[COUNT + new] = row + 1
    return True
