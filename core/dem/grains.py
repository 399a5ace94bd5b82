"""What a DEM session does for bodies with outlines: begin, mend, restore, tell shear forces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.dem.grain_arrays import larger_memory, needs_outlines, outline_arrays
from ninedisk.core.dem.grain_state import CODE, COUNT, FIRST, FS, ROOM, SECOND, SIDE, Memory, Outlines
from ninedisk.core.errors import NonFiniteStateError
from ninedisk.core.history import Pair
from ninedisk.core.nurbs.intersect import REASONS
from ninedisk.core.scene import Scene


def first_outlines(scene: Scene) -> Outlines | None:
    """Arrays of the outlines at time 0; None if all bodies are disks with the disks' law."""
    return outline_arrays(scene) if needs_outlines(scene) else None


def mended(outlines: Outlines, scene: Scene, step: int, dt: float) -> Outlines:
    """The same with more room for contacts, if that is what stopped the contact step ``step`` of length ``dt`` [s].

    Raises
    ------
    NonFiniteStateError
        If a contact stopped it that no chord defines.
    """
    mark = outlines.memory.mark
    if mark[CODE] == ROOM:
        return outlines._replace(memory=larger_memory(outlines.memory))
    first, second = (scene.body_name(int(mark[entry])) for entry in (FIRST, SECOND))
    raise NonFiniteStateError(
        f"{first}, near {second}, {REASONS[int(mark[CODE])]} (contact step {step}, t = {step * dt:g} s): raise kn, or reduce speeds "
        "or contact_dt, or move apart what overlaps at the start"
    )


def restored(outlines: Outlines | None, arrays: Mapping[str, NDArray[Any]]) -> Outlines | None:
    """The same with the memory of a checkpoint, whose room may be another one."""
    if outlines is None:
        return None
    return outlines._replace(memory=Memory(*(np.array(arrays[f"grains.{field}"]) for field in Memory._fields)))


def shear_of_grains(outlines: Outlines) -> dict[Pair, float]:
    """Shear forces [N] of all pairs that carry one, summed over a pair's contacts."""
    memory = outlines.memory
    side = int(memory.mark[SIDE])
    found: dict[Pair, float] = {}
    for row in range(int(memory.mark[COUNT + side])):
        pair, force = (int(memory.body[side, row, 0]), int(memory.body[side, row, 1])), memory.contact[side, row, FS]
        if force != 0.0:
            found[pair] = found.get(pair, 0.0) + float(force)
    return dict(sorted(found.items()))
