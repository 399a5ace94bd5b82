"""Allocation of what a DEM run of bodies with outlines needs."""

from __future__ import annotations

import numpy as np

from ninedisk.core.dem.grain_state import Memory, Outlines
from ninedisk.core.nurbs.curve import NurbsCurve
from ninedisk.core.nurbs.mass import area_moments
from ninedisk.core.nurbs.nurbs_bodies import body_shapes
from ninedisk.core.nurbs.state import MOST_ROOTS, contact_rows, workspace
from ninedisk.core.scene import Scene
from ninedisk.core.validate import FloatArray

CONTACTS_PER_BODY = 3
"""First guess of contacts a body: a packing of convex grains has 2, each shared by two."""


def needs_outlines(scene: Scene) -> bool:
    """Whether contacts are those of outlines: a body has one, or a law is that of the common area."""
    laws = [scene.disk_disk, *(wall.law for wall in scene.walls)]
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


def empty_memory(spin: FloatArray, room: int) -> Memory:
    """A memory without contacts, with room for ``room`` of them; ``spin`` [rad/s] at time 0."""
    n = len(spin)
    return Memory(
        contact=np.zeros((2, room, 12)),
        body=np.zeros((2, room, 3), dtype=np.int64),
        head=np.full((2, n), -1, dtype=np.int64),
        mark=np.zeros(6, dtype=np.int64),
        spin=spin.copy(),
    )


def larger_memory(memory: Memory) -> Memory:
    """Copy of a memory with one and a half times its room."""
    room = memory.contact.shape[1]
    larger = empty_memory(memory.spin, room + room // 2 + 16)
    larger.contact[:, :room], larger.body[:, :room] = memory.contact, memory.body
    larger.head[:], larger.mark[:] = memory.head, memory.mark
    return larger
