"""What a DEM run of spheres begins with: rows of laws, segments of planes' motion, lists of pairs, arrays of vectors."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.dem.arrays import aligned
from ninedisk.core.dem.space import state as columns
from ninedisk.core.dem.space.neighbour_kernels import Materials
from ninedisk.core.dem.space.plane_kernels import place_planes
from ninedisk.core.dem.space.registers import WIDE
from ninedisk.core.dem.space.scratch_kernels import CHUNK
from ninedisk.core.dem.space.state import Contacts, Images, Losses, Motion, Pushes
from ninedisk.core.dem.space.step_kernels import BATCH, Batch, Damping
from ninedisk.core.law import Rolling, SphereLaw
from ninedisk.core.scene import Cell, PlaneSegment, PlaneWall, SphereScene
from ninedisk.core.thread_kernels import PAD

RULES = {"none": columns.KEEPS, "force": columns.FORCE, "rescale": columns.RESCALE}
MODELS = {"constant": columns.CONSTANT, "viscous": columns.VISCOUS, "elastic-plastic": columns.SPRING}


def vector_rows(rows: NDArray[Any]) -> NDArray[np.float64]:
    """Vectors as the kernels have them, from rows of three."""
    found = np.zeros((len(rows), WIDE))
    found[:, :3] = rows
    return aligned(found.ravel())


def xyz_rows(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors of the kernels as rows of three, shape (n, 3)."""
    return values.reshape(-1, WIDE)[:, :3]


def empty_list(rows: int, capacity: int, notes: int, memory: int) -> Contacts:
    """A list of ``rows`` empty rows with ``capacity`` for pairs, with so many columns of both."""
    return list_of(
        {
            "start": np.zeros(rows + 1, dtype=np.int64),
            **{name: np.zeros(capacity, dtype=np.uint32) for name in ("row", "other", "law")},
            "notes": np.zeros((capacity, notes)),
            "memory": np.zeros((capacity, memory)),
            "force": np.zeros((capacity, 4)),
        }
    )


def batch_arrays(stripes: int, planes: int, threads: int, scratch: int) -> Batch:
    """What so many threads share, and a scratch of so many numbers for each of them."""
    return Batch(
        stripe=np.zeros(stripes + 1, dtype=np.int64),
        flags=np.zeros(threads * PAD, dtype=np.int64),
        done=np.zeros(threads * PAD, dtype=np.int64),
        far=np.zeros(threads * PAD),
        pose=np.zeros((BATCH, 3, planes, columns.POSE_WIDTH)),
        scratch=aligned(np.zeros((threads, scratch + 2 * PAD))),
        picked=np.zeros((threads, CHUNK + PAD), dtype=np.int64),
    )


def no_losses(stripes: int, planes: int) -> Losses:
    """Nothing lost so far."""
    return Losses(
        contacts=np.zeros((stripes, 5)),
        before=np.zeros((stripes, 5)),
        torque=np.zeros((BATCH * stripes, planes, 3)),
        loads=np.zeros((planes, 2, 6)),
        fed=np.zeros(BATCH * stripes),
        work=np.zeros(1),
        force_work=np.zeros(1),
    )


def image_arrays(cell: Cell, n: int, widest: float) -> Images:
    """Images of n spheres at time 0."""
    return Images(
        size=np.array(cell.size),
        rate=np.array(cell.rate) @ np.diag(cell.size),
        now=cell.edges(0.0),
        built=cell.edges(0.0),
        home=np.zeros((n, 3)),
        widest=np.array([widest]),
        share=np.zeros(10),
        power=np.zeros(1),
        work=np.zeros(1),
        boxes=np.ones(3, dtype=np.int64),
        scratch=np.zeros(3),
    )


def nearest(apart: NDArray[np.float64], edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shortest of the vectors [m] to the images of bodies ``apart`` [m], shape (..., 3), in cells whose edges are columns of upper
    triangular matrices, shape (..., 3, 3).

    Of the layers of images the nearest ones are beside the one that rounding finds, or are that one; along the first edge it is that one.
    """

    def moved(vector: NDArray[np.float64], axis: int, more: float = 0.0) -> NDArray[np.float64]:
        count = np.round(vector[..., axis] / edges[..., axis, axis]) + more
        return vector - count[..., None] * edges[..., :, axis]

    best = apart
    for above in (-1.0, 0.0, 1.0):
        one = moved(apart, 2, above)
        for aside in (-1.0, 0.0, 1.0):
            two = moved(moved(one, 1, aside), 0)
            closer = np.linalg.norm(two, axis=-1) < np.linalg.norm(best, axis=-1)
            best = np.where(closer[..., None], two, best)
    return best


def list_of(arrays: dict[str, NDArray[Any]]) -> Contacts:
    """The list with these arrays, each memory in as few lines of the caches as it can be."""
    return Contacts(**{name: aligned(array) for name, array in arrays.items()})


def enlarged_list(contacts: Contacts) -> Contacts:
    """An empty list like the one that was too small, with 1.2 times its room."""
    capacity = contacts.other.shape[0]
    rows = contacts.start.shape[0] - 1
    return empty_list(rows, capacity + capacity // 5 + 16, contacts.notes.shape[1], contacts.memory.shape[1])


def push_arrays(scene: SphereScene) -> Pushes:
    """Forces and torques on single spheres, by the scene's numbers."""
    return Pushes(
        row=np.array([each.disk for each in scene.forces], dtype=np.int64),
        load=np.array([np.append(each.force, each.torque) for each in scene.forces]).reshape(-1, 6),
        time=np.array([[each.begin, each.end] for each in scene.forces]).reshape(-1, 2),
    )


def dampings(xi: float, dt: float, *, central: bool) -> tuple[Damping, Damping]:
    """Global damping of the half kick from ``t_0`` and of all later ones (`ninedisk.core.dem.plane.kick_kernels`)."""
    a = 0.5 * xi * dt
    first = Damping(keep=1.0 - a, gain=0.5 * dt, ahead=1.0, drag=a, seen=0.0, mean=1.0)
    if central:
        return first, Damping((1.0 - a) / (1.0 + a), dt / (1.0 + a), 0.5, 2.0 * a, 0.5, 0.5)
    return first, Damping(1.0 - 2.0 * a, dt, 0.5, 2.0 * a, 0.0, 0.5)


def in_rows(pushes: Pushes, name: NDArray[np.int64]) -> Pushes:
    """The same by the rows in which spheres are that have these numbers in the scene; those of one sphere in the scene's order."""
    rows = np.argsort(name)[pushes.row]
    order = np.argsort(rows, kind="stable")
    return Pushes(rows[order], pushes.load[order], pushes.time[order])


def law_tables(scene: SphereScene) -> tuple[NDArray[np.float64], Materials]:
    """Laws as rows, and which of them each pair has."""
    names = sorted(set(scene.spheres.material))
    name = np.array([names.index(each) for each in scene.spheres.material], dtype=np.int64)
    first = {each: scene.spheres.material.index(each) for each in names}
    known: list[SphereLaw] = []

    def number(law: SphereLaw) -> int:
        if law not in known:
            known.append(law)
        return known.index(law)

    pair = np.zeros((len(names), len(names)), dtype=np.int64)
    for a, one in enumerate(names):
        for b, two in enumerate(names):
            low, high = sorted((one, two))
            pair[a, b] = number(scene.laws.get((low, high), scene.sphere_sphere))
    n = len(scene.spheres)
    plane = np.array(
        [[number(scene.law((first[each], n + w))) for each in names] for w in range(len(scene.walls))], dtype=np.int64
    ).reshape(len(scene.walls), len(names))
    moves = np.array([bool(wall.motion) for wall in scene.walls], dtype=np.int64)
    materials = Materials(name, scene.spheres.fixed.astype(np.int64), pair, plane, moves)
    return np.array([law_row(law, pulls=scene.dashpots_pull) for law in known]), materials


def law_row(law: SphereLaw, *, pulls: bool = True) -> list[float]:
    """Columns of a law, as `ninedisk.core.dem.space.state` names them; ``pulls``: whether dashpots of linear laws may."""
    row = [
        float(law.hertz),
        4.0 / 3.0 * law.e_star if law.hertz else law.kn,
        8.0 * law.g_star if law.hertz else law.ks,
        law.mu,
        law.beta,
        float(law.lever_arm != "radius"),
        float(law.lever_arm == "overlap"),
        float(law.slip_at == "middle"),
        float(RULES[law.unloading]),
        0.0 if law.sticks else 4.0 * pi * law.surface_energy if law.hertz else law.cohesion,
    ]
    for resistance in (law.rolling, law.twisting):
        given = resistance or Rolling(model="constant", mu=0.0)
        row += [float(MODELS[given.model]) if resistance else 0.0, given.mu, given.kr, given.beta]
    # JKR's pull is part of its force, DMT's is beside Hertz' force.
    held = 3.0 * law.friction_pull if law.sticks else 4.0 * (law.friction_pull - 1.0)
    neck = (0.25 * pi * law.surface_energy / law.e_star) ** (2.0 / 3.0) if law.sticks else 0.0
    least = -np.inf if pulls or law.hertz or law.cohesion > 0.0 else 0.0
    return [*row, held * pi * law.surface_energy, neck, least]


def compile_motion(walls: Sequence[PlaneWall]) -> Motion:
    """Table of all segments, each plane closed by an endless segment of rest that begins exactly where the last one ends."""
    first, rows = [0], []
    for wall in walls:
        begin, point, normal = 0.0, np.array(wall.point), np.array(wall.normal)
        for segment in (*wall.motion, PlaneSegment()):
            pivot = point if segment.pivot is None else np.array(segment.pivot)
            row = [
                *(begin, *point, *normal, *pivot, *segment.velocity, *segment.angular_velocity, *segment.amplitude),
                *(segment.frequency, segment.phase),
            ]
            rows.append(row)
            if not np.isfinite(segment.duration):
                break
            begin += segment.duration
            pose = np.empty((1, columns.POSE_WIDTH))
            place_planes(Motion(np.array([0, 1]), np.array([row])), begin, pose)
            point, normal = pose[0, :3].copy(), pose[0, 3:6].copy()
        first.append(len(rows))
    return Motion(
        np.array(first, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(len(rows), columns.SEGMENT_WIDTH)
    )
