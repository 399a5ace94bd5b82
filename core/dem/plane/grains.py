"""What a DEM session does for bodies with outlines: allocate and grow their arrays, restore them, give back shear forces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.dem.state import CODE, COUNT, FIRST, FS, ROOM, SECOND, SIDE, Memory, Outlines
from ninedisk.core.errors import NonFiniteStateError
from ninedisk.core.history import Pair
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.intersect import REASONS
from ninedisk.core.nurbs.mass import area_moments
from ninedisk.core.nurbs.shapes import body_shapes
from ninedisk.core.nurbs.state import MOST_ROOTS, contact_rows, workspace
from ninedisk.core.scene import Scene

CONTACTS_PER_BODY = 3
"""First guess of contacts a body: a packing of convex grains has 2, each shared by two."""


def first_outlines(scene: Scene) -> Outlines | None:
    """Arrays of the outlines at time 0; None if all bodies are disks with the disks' law."""
    return outline_arrays(scene) if needs_outlines(scene) else None


def with_more_capacity(outlines: Outlines, scene: Scene, step: int, dt: float) -> Outlines:
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


def restored_outlines(outlines: Outlines | None, arrays: Mapping[str, NDArray[Any]]) -> Outlines | None:
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


def needs_outlines(scene: Scene) -> bool:
    """Whether contacts are those of outlines: a body has one, or a law is that of the common area."""
    laws = [scene.disk_disk, *(wall.law for wall in scene.walls), *scene.laws.values()]
    return bool(np.any(scene.disks.outline >= 0)) or any(law.contact == "area" for law in laws)


def outline_arrays(scene: Scene) -> Outlines:
    """Outlines of all bodies, disks being given exact circles, and an empty memory."""
    disks, n = scene.disks, len(scene.disks)
    table, shape, radii = body_shapes(scene.outlines, disks.outline, disks.radius)
    laws = [scene.disk_disk, *(wall.law for wall in scene.walls)]
    return Outlines(
        table=table,
        shape=shape,
        round=disks.outline < 0,
        angle=disks.angle.copy(),
        size=np.concatenate([equal_radii(scene.outlines), radii])[shape],
        area=np.array([law.contact == "area" for law in laws]),
        turn=np.zeros((n, 2)),
        spin=np.zeros(n),
        carried=np.zeros(MOST_ROOTS // 2),
        arc=np.zeros((MOST_ROOTS // 2, 4)),
        before=np.zeros((MOST_ROOTS // 2, 4)),
        work=workspace(table),
        found=contact_rows(MOST_ROOTS // 2),
        memory=empty_memory(disks.omega, CONTACTS_PER_BODY * n + len(scene.initial_shear) + 16),
    )


def equal_radii(outlines: tuple[NurbsCurve, ...]) -> FloatArray:
    """Radii of the disks of the same area as each outline [m]."""
    return np.array([np.sqrt(area_moments(curve).area / np.pi) for curve in outlines])


def empty_memory(spin: FloatArray, capacity: int) -> Memory:
    """A memory without contacts, with room for ``capacity`` of them; ``spin`` [rad/s] at time 0."""
    n = len(spin)
    return Memory(
        contact=np.zeros((2, capacity, 12)),
        body=np.zeros((2, capacity, 3), dtype=np.int64),
        head=np.full((2, n), -1, dtype=np.int64),
        mark=np.zeros(6, dtype=np.int64),
        spin=spin.copy(),
    )


def larger_memory(memory: Memory) -> Memory:
    """Copy of a memory with one and a half times its room."""
    capacity = memory.contact.shape[1]
    larger = empty_memory(memory.spin, capacity + capacity // 2 + 16)
    larger.contact[:, :capacity], larger.body[:, :capacity] = memory.contact, memory.body
    larger.head[:], larger.mark[:] = memory.head, memory.mark
    return larger
