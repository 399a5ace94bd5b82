"""Symmetry of 2D scenes: where a mirror image alone keeps every disk from turning, or every contact from slipping."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ninedisk.core.scene import Scene, Wall
from ninedisk.core.validate import FloatArray
from ninedisk.harness.api.capabilities import Capability

OF_SLIP = frozenset(
    {
        Capability.FRICTION,
        Capability.SHEAR_SPRING,
        Capability.LEVER_ARM_RADIUS,
        Capability.LEVER_ARM_OVERLAP,
        Capability.SLIP_MIDDLE,
        Capability.SLIP_END,
    }
)
"""What no engine needs where no contact can slip."""

TOLERANCE = 1e-12
"""Of the scene's size, or of a quantity's largest value: round-off of coordinates that were given as decimals."""


def no_disk_can_turn(scene: Scene) -> bool:
    """Whether every disk's centre lies on a line in which the whole scene is its own mirror image.

    A reflection turns spins round; a disk on the mirror therefore has a spin equal to its own opposite, zero, as long as the
    motion keeps the symmetry of its beginning and its loads. Neither inertia nor lever arms then matter.
    """
    if any(scene.initial_shear.values()):
        return False
    valid: list[tuple[FloatArray, FloatArray]] = []
    for centre in scene.disks.x:
        if any(_on_line(scene, centre, mirror) for mirror in valid):
            continue
        found = next((mirror for mirror in _candidates(scene, centre) if _is_mirror(scene, *mirror)), None)
        if found is None:
            return False
        valid.append(found)
    return True


def _size(scene: Scene) -> float:
    return float(np.abs(scene.disks.x).max() + scene.disks.radius.max())


def _on_line(scene: Scene, point: FloatArray, mirror: tuple[FloatArray, FloatArray]) -> bool:
    foot, normal = mirror
    return bool(abs((point - foot) @ normal) <= TOLERANCE * _size(scene))


def _candidates(scene: Scene, centre: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Lines (point, normal) through a disk's centre: a mirror passes through the centroid of the centres, too."""
    arm = scene.disks.x.mean(axis=0) - centre
    length = float(np.hypot(*arm))
    if length > TOLERANCE * _size(scene):
        yield centre, np.array([-arm[1], arm[0]]) / length
        return
    directions = [wall.normal for wall in scene.walls] + [scene.gravity, (1.0, 0.0), *map(tuple, scene.disks.v)]
    for dx, dy in directions:
        length = float(np.hypot(dx, dy))
        if length > 0.0:
            yield centre, np.array([dx, dy]) / length
            yield centre, np.array([-dy, dx]) / length


def _is_mirror(scene: Scene, foot: FloatArray, normal: FloatArray) -> bool:
    disks, size = scene.disks, _size(scene)

    def vector(values: object) -> FloatArray:
        array = np.asarray(values, dtype=float)
        return array - 2.0 * (array @ normal)[..., None] * normal

    image = foot + vector(disks.x - foot)
    far = np.hypot(*(image[:, None, :] - disks.x[None, :, :]).transpose(2, 0, 1))
    partner = far.argmin(axis=1)
    if (far[np.arange(len(partner)), partner] > TOLERANCE * size).any() or len(set(partner.tolist())) < len(partner):
        return False
    if any((values != values[partner]).any() for values in (disks.radius, disks.mass, disks.inertia, disks.rotating)):
        return False
    if not (_same(vector(disks.v), disks.v[partner]) and _same(-disks.omega, disks.omega[partner])):
        return False
    if not _same(vector(scene.gravity), np.asarray(scene.gravity)):
        return False
    return all(any(_images(wall, other, foot, normal, size) for other in scene.walls) for wall in scene.walls)


def _images(one: Wall, two: Wall, foot: FloatArray, normal: FloatArray, size: float) -> bool:
    """Whether the mirror takes one wall, its law and its motion to the other; walls that turn are none of its business."""

    def vector(values: tuple[float, float]) -> FloatArray:
        array = np.asarray(values)
        return np.asarray(array - 2.0 * (array @ normal) * normal)

    place = foot + vector((one.point[0] - foot[0], one.point[1] - foot[1]))
    facing = vector(one.normal)
    if not _same(facing, np.asarray(two.normal)) or one.law != two.law or len(one.motion) != len(two.motion):
        return False
    if abs((place - np.asarray(two.point)) @ facing) > TOLERANCE * size:
        return False
    for a, b in zip(one.motion, two.motion, strict=True):
        if a.angular_velocity or b.angular_velocity:
            return False
        if (a.duration, a.frequency, a.phase, a.tan_rate) != (b.duration, b.frequency, b.phase, b.tan_rate):
            return False
        ways = [(getattr(a, key), getattr(b, key)) for key in ("velocity", "amplitude", "tan_lever")]
        if not all(_same(vector(way), np.asarray(other)) for way, other in ways):
            return False
    return True


def _same(one: FloatArray, two: FloatArray) -> bool:
    return bool((np.abs(one - two) <= TOLERANCE * float(np.abs(two).max(initial=0.0))).all())


def no_contact_can_slip(scene: Scene) -> bool:
    """Whether symmetry alone keeps every contact from slipping, whatever the friction between disks.

    Equal disks at rest on a full rectangular lattice along x and y, smooth walls along x or y that move along their
    normals, no gravity: with x a function of the column and y one of the row, contacts lie in rows and columns and their
    forces depend on the column, or the row, alone. The motion therefore keeps that form, and no contact ever slips.
    """
    disks = scene.disks
    if len(disks) == 0 or any(scene.gravity) or np.any(disks.v) or np.any(disks.omega):
        return False
    if any(np.ptp(values) for values in (disks.radius, disks.mass)):
        return False
    columns, rows = np.unique(disks.x[:, 0]), np.unique(disks.x[:, 1])
    if len(columns) * len(rows) != len(disks) or len(np.unique(disks.x, axis=0)) != len(disks):
        return False
    for wall in scene.walls:
        if wall.law.mu > 0.0 or 0.0 not in wall.normal:
            return False
        along = 0 if wall.normal[0] == 0.0 else 1
        for segment in wall.motion:
            sideways = (segment.velocity[along], segment.amplitude[along], segment.tan_lever[along])
            if segment.angular_velocity or any(sideways):
                return False
    return True
