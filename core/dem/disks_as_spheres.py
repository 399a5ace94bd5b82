"""Disks as spheres of the same radii, masses and moments of inertia, whose centres stay in the plane z = 0.

Hertz' law is one of spheres; long cylinders side by side have no force that depends on their overlap alone. Programs that have it in 2D
keep spheres in a plane. So the law, its loop, energies and checkpoints are those of `ninedisk.core.dem.space`; here is what the two
scenes and histories have in common. By symmetry nothing leaves the plane, to the last bit.

In a periodic cell the loop of `ninedisk.core.dem.plane` has one law for all pairs, without cohesion and resistance to rolling. What has
more runs here, too, in a cell whose third edge nothing reaches across.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.array_types import FloatArray
from ninedisk.core.dem.counts import Counts
from ninedisk.core.dem.plane.grains import needs_outlines
from ninedisk.core.dem.space.arrays import nearest
from ninedisk.core.dem.space.session import SphereSession
from ninedisk.core.errors import InvalidSceneError
from ninedisk.core.history import History, Pair
from ninedisk.core.law import ContactLaw
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import BodyForce, Cell, PlaneSegment, PlaneWall, Scene, Spheres, SphereScene

CHOSEN = "disks.chosen"
"""Name in a checkpoint of the disks whose motion is reported; recorded are those of the watched contacts, too."""


DEPTH = 8.0
"""Third edge of a periodic cell over the largest radius: images along it are six radii apart, and never meet."""


class InPlane(SphereScene):
    """Spheres whose messages speak of disks, and whose linear dashpots do not pull."""

    dashpots_pull: ClassVar[bool] = False

    @property
    def noun(self) -> str:
        """What a body is called in messages."""
        return "disk"


def cannot_be_spheres(scene: Scene) -> str:
    """What a scene in 2D has that the DEM lacks beside Hertz' law, and the way out; "" if nothing."""
    if needs_outlines(scene):
        return "outlines other than circles with Hertz' law: give all contacts the linear law, or all bodies circles"
    if scene.walls and any(law.wall_velocity_at != "surface" for law in scene.laws_in_use):
        return "wall_velocity_at = 'mid-overlap' with Hertz' law: use 'surface'"
    if any(segment.tan_rate != 0.0 for wall in scene.walls for segment in wall.motion):
        return "a wall that moves by a tangent (tan_rate) with Hertz' law: leave it out, or use the linear law"
    return ""


def in_space(scene: Scene) -> InPlane:
    """The same scene in 3D.

    Raises
    ------
    InvalidSceneError
        If it has what the DEM lacks beside Hertz' law (`cannot_be_spheres`).
    """
    if missing := cannot_be_spheres(scene):
        raise InvalidSceneError(f"the DEM does not have {missing}")
    disks = scene.disks
    zero = np.zeros((len(disks), 1))
    spheres = Spheres(
        x=np.hstack([disks.x, zero]),
        v=np.hstack([disks.v, zero]),
        omega=np.hstack([zero, zero, disks.omega[:, None]]),
        radius=disks.radius,
        mass=disks.mass,
        inertia=disks.inertia,
        rotating=disks.rotating,
        held=np.hstack([disks.held, np.ones((len(disks), 1), dtype=bool)]),
        material=disks.material,
    )
    shear = {}
    for (i, j), force in scene.initial_shear.items():
        x, y = force * _tangents(_normal_of(scene, i, j))
        shear[i, j] = (float(x), float(y), 0.0)
    return InPlane(
        spheres=spheres,
        sphere_sphere=scene.disk_disk,
        walls=tuple(_upright(wall) for wall in scene.walls),
        gravity=(*scene.gravity, 0.0),
        laws=scene.laws,
        xi=scene.xi,
        initial_shear=shear,
        forces=tuple(
            BodyForce(
                disk=load.disk,
                force=(*load.force, 0.0),
                torque=(0.0, 0.0, float(load.torque)),  # type: ignore[arg-type]
                begin=load.begin,
                end=load.end,
            )
            for load in scene.forces
        ),
        cell=None if scene.cell is None else deep(scene.cell, DEPTH * float(disks.radius.max())),
    )


def deep(cell: Cell, depth: float) -> Cell:
    """The same cell in 3D, with a third edge of ``depth`` [m] along z that stays as it is."""
    return Cell(size=(*cell.size, depth), rate=(*((*row, 0.0) for row in cell.rate), (0.0, 0.0, 0.0)))


def _upright(wall: Any) -> PlaneWall:
    """A wall of the plane in space."""
    motion = tuple(
        PlaneSegment(
            duration=part.duration,
            velocity=(*part.velocity, 0.0),
            angular_velocity=(0.0, 0.0, part.angular_velocity),
            pivot=None if part.pivot is None else (*part.pivot, 0.0),
            amplitude=(*part.amplitude, 0.0),
            frequency=part.frequency,
            phase=part.phase,
        )
        for part in wall.motion
    )
    law: ContactLaw = wall.law
    return PlaneWall(
        name=wall.name,
        point=(*wall.point, 0.0),
        normal=(*wall.normal, 0.0),
        law=law,
        material=wall.material,
        motion=motion,
    )


def _normal_of(scene: Scene, i: int, j: int) -> FloatArray:
    """Normal of a pair of the scene at time 0; NaN where two centres coincide."""
    n = len(scene.disks)
    if j >= n:
        return -np.array(scene.walls[j - n].normal)
    with np.errstate(invalid="ignore"):
        return _units(_of_nearest_images(scene, scene.disks.x[j] - scene.disks.x[i], 0.0))


def _of_nearest_images(scene: Scene, apart: FloatArray, t: float | FloatArray) -> FloatArray:
    """In a periodic cell the vectors [m], shape (..., 2), to the nearest images of bodies that are ``apart`` at times t [s]."""
    if scene.cell is None:
        return apart
    cell = deep(scene.cell, 1.0)
    edges = np.eye(3) + np.multiply.outer(t, np.array(cell.rate))
    along = np.concatenate([apart, np.zeros((*apart.shape[:-1], 1))], axis=-1)
    return nearest(along, edges @ np.diag(cell.size))[..., :2]


def _units(vectors: FloatArray) -> FloatArray:
    found: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found


def _tangents(normals: FloatArray) -> FloatArray:
    """``t = (-n_y, n_x)``."""
    return np.stack([-normals[..., 1], normals[..., 0]], axis=-1)


class DisksAsSpheres:
    """A run of disks by the loop of spheres, for `DemSession`.

    The work of walls and of forces is reported with `Numerics.energy_budget` only.

    Parameters
    ----------
    scene : Scene
    numerics : Numerics
    pairs : sequence of pairs
        Contacts whose gap, ``fn`` and ``fs`` are recorded.
    chosen : ndarray of int
        Disks whose motion is reported; that of the contacts' disks is recorded as well.
    threads : int
    """

    def __init__(
        self, scene: Scene, numerics: Numerics, pairs: tuple[Pair, ...], chosen: NDArray[np.int64], *, threads: int
    ) -> None:
        self.scene, self.numerics, self.pairs, self.chosen = scene, numerics, pairs, chosen
        watched = [body for pair in pairs for body in pair if body < len(scene.disks)]
        self._recorded = np.unique(np.concatenate([chosen, np.array(watched, dtype=np.int64)]))
        self._solid = SphereSession(in_space(scene), numerics, pairs, self._recorded.tolist(), threads=threads)
        self.steps = self._solid.contact_dt, self._solid.critical_dt, self._solid.substeps

    def run(self, progress: Callable[[int, int], None] | None) -> History:
        """Run to the last step."""
        self._solid.run(progress)
        return self.history()

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` steps ``numerics.dt``, at most to the last one."""
        self._solid.advance(steps)

    def snapshot(self) -> tuple[float, dict[str, NDArray[np.float64]]]:
        """As `DemSession.snapshot`."""
        t, found = self._solid.snapshot()
        flat = {
            "x": found["x"][:, :2],
            "v": found["v"][:, :2],
            "angle": found["angle"][:, 2],
            "omega": found["omega"][:, 2],
        }
        return t, {name: np.ascontiguousarray(values) for name, values in flat.items()} | {"radius": found["radius"]}

    def shear_forces(self) -> dict[Pair, float]:
        """Shear forces ``fs`` [N] of all closed contacts that carry one, by body numbers: a scene's ``initial_shear``."""
        n, (t, now), normals = len(self.scene.disks), self.snapshot(), self._solid.plane_normals()
        found = {}
        for (i, j), force in self._solid.shear_forces().items():
            apart = _of_nearest_images(self.scene, now["x"][j] - now["x"][i], t) if j < n else -normals[j - n, :2]
            normal = _units(apart)
            found[i, j] = float(np.dot(force[:2], _tangents(normal)))
        return found

    @property
    def counts(self) -> Counts:
        """As `DemSession.counts`."""
        return self._solid.counts

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a checkpoint holds."""
        return {**self._solid.arrays(), CHOSEN: self.chosen}

    @staticmethod
    def asked(arrays: Mapping[str, NDArray[Any]]) -> tuple[list[Pair], list[int]]:
        """Watched contacts and reported disks of a checkpoint.

        Raises
        ------
        InvalidSceneError
            If it lacks them.
        """
        if CHOSEN not in arrays:
            raise InvalidSceneError(f"the checkpoint of a DEM run of disks as spheres lacks {CHOSEN}")
        return [(int(i), int(j)) for i, j in arrays["samples.pairs"]], arrays[CHOSEN].tolist()

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the state in a checkpoint."""
        self._solid.restore({name: array for name, array in arrays.items() if name != CHOSEN})

    def history(self) -> History:
        """What has been sampled so far."""
        solid, rows, n = self._solid.history(), self._solid.rows, len(self.scene.disks)
        column = {int(body): k for k, body in enumerate(self._recorded)}
        mine = [column[int(body)] for body in self.chosen]
        fs = np.zeros((rows, len(self.pairs)))
        for k, (i, j) in enumerate(self.pairs):
            between = solid.x[:rows, [column[i], column.get(j, 0)], :2]
            if j < n:
                normal = _units(_of_nearest_images(self.scene, between[:, 1] - between[:, 0], solid.t[:rows]))
            else:
                normal = -solid.wall_angle[:rows, j - n, :2]
            fs[:, k] = np.sum(solid.fs[:rows, k, :2] * _tangents(normal), axis=1)
        turn = solid.wall_angle[:rows]
        return History(
            step=solid.step[:rows],
            t=solid.t[:rows],
            pairs=self.pairs,
            particles=tuple(int(body) for body in self.chosen),
            x=solid.x[:rows, mine, :2],
            v=solid.v[:rows, mine, :2],
            angle=solid.angle[:rows, mine, 2],
            omega=solid.omega[:rows, mine, 2],
            gap=solid.gap[:rows],
            fn=solid.fn[:rows],
            fs=fs,
            wall_point=solid.wall_point[:rows, :, :2],
            wall_angle=np.arctan2(turn[..., 1], turn[..., 0]),
            wall_force=solid.wall_force[:rows, :, :2],
            force_meaning="instantaneous",
            energy=self._energies(solid, rows),
            stress=None
            if solid.stress is None
            else solid.stress[:rows, :, :2, :2] * DEPTH * self.scene.disks.radius.max(),
        )

    def _energies(self, solid: History, rows: int) -> dict[str, FloatArray]:
        """Energies [J] without those of fixed disks and of spins that nothing changes, which in 2D are none of the run's."""
        disks = self.scene.disks
        energy = {name: values[:rows].copy() for name, values in solid.energy.items()}
        energy["gravity"] += float(np.sum((disks.mass[:, None] * disks.x)[disks.fixed] @ np.array(self.scene.gravity)))
        spinning = 0.5 * float(np.sum((disks.inertia * disks.omega**2)[~disks.rotating]))
        for name in ("rotation", "kinetic"):
            energy[name] -= spinning
        if not (self.numerics.energy_budget or any(law.rolling is not None for law in self.scene.laws_in_use)):
            del energy["elastic_rolling"]
        return energy
