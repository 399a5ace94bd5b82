"""Writes the samples of a contact-dynamics run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.cd.laws import LawTable
from ninedisk.core.cd.memory import ContactMemory
from ninedisk.core.cd.place import Place
from ninedisk.core.history import History, Pair
from ninedisk.core.numerics import Numerics
from ninedisk.core.scene import Scene

if TYPE_CHECKING:
    from ninedisk.core.cd.grain_frames import GrainFrames
FloatArray = NDArray[np.float64]

ENERGIES = (
    "translation",
    "rotation",
    "kinetic",
    "elastic_normal",
    "elastic_shear",
    "elastic",
    "gravity",
    "wall_work",
    "impact_gain",
)


class Recorder:
    """History of a run in the making.

    Contact forces are those at the end of a step where all contacts are elastic ("instantaneous"), else the impulses of the
    step over its length ("step-mean"), which have no value before the first step.
    """

    def __init__(
        self,
        scene: Scene,
        numerics: Numerics,
        laws: LawTable,
        pairs: tuple[Pair, ...],
        chosen: NDArray[np.int64],
        grains: GrainFrames | None = None,
    ) -> None:
        self._scene, self._laws, self._chosen, self._grains = scene, laws, chosen, grains
        steps = numerics.sampled_steps()
        self._at = {int(step): row for row, step in enumerate(steps)}
        used = laws.elastic if len(scene.disks) > 1 else laws.elastic[1:]
        self.elastic = bool(used.all())
        history = History.empty(
            steps,
            np.multiply(steps, numerics.dt, dtype=np.float64),
            n_disks=len(chosen),
            n_walls=len(scene.walls),
            pairs=pairs,
            force_meaning="instantaneous" if self.elastic else "step-mean",
            energies=ENERGIES,
        )
        self.history = History(**{**vars(history), "particles": tuple(int(i) for i in chosen)})
        self._pairs = np.array(pairs, dtype=np.int64).reshape(len(pairs), 2)

    def stops(self, last: int) -> list[int]:
        """Steps after which there is something to do: those sampled, and the last one; not step 0."""
        return sorted({*self._at, last} - {0})

    def sample(
        self,
        step: int,
        x: FloatArray,
        v: FloatArray,
        wall: FloatArray,
        memory: ContactMemory,
        wall_work: float,
        impact_gain: float,
    ) -> None:
        """Write the state after ``step`` if it is a sampled one.

        Parameters
        ----------
        step : int
        x, v : ndarray, shape (n, 3)
            Centre and angle [m], [m], [rad], and their rates.
        wall : ndarray, shape (m, 11)
            Walls at this time.
        memory : ContactMemory
            Contact forces of the step that ends here.
        wall_work : float
            Work of the walls on the disks since time 0 [J].
        impact_gain : float
            Energy that impacts under Newton's law fed since time 0 [J]: none without friction.
        """
        row = self._at.get(step)
        if row is None:
            return
        history, chosen = self.history, self._chosen
        history.x[row], history.v[row] = x[chosen, :2], v[chosen, :2]
        history.angle[row], history.omega[row] = x[chosen, 2], v[chosen, 2]
        history.wall_point[row] = wall[:, 0:2]
        history.wall_angle[row] = np.arctan2(wall[:, 3], wall[:, 2])
        history.gap[row] = self._gaps(x, wall)
        self._energies(row, x, v, memory, wall_work, impact_gain)
        if step > 0 or self.elastic:
            forces = memory.of(self._pairs) if self._grains is None else memory.sums(self._pairs)
            history.fn[row], history.fs[row] = forces[:, 0], forces[:, 1]
            history.wall_force[row] = self._wall_forces(x, wall, memory)

    def _gaps(self, x: FloatArray, wall: FloatArray) -> FloatArray:
        if self._grains is None or not len(self._pairs):
            return np.array([self._gap(i, j, x, wall) for i, j in self._pairs.tolist()])
        disks = self._scene.disks
        place = Place(x[:, :2].copy(), disks.angle + x[:, 2], disks.radius, wall, wall)
        return self._grains.gaps(place, self._pairs)

    def _gap(self, i: int, j: int, x: FloatArray, wall: FloatArray) -> float:
        radius, w = self._scene.disks.radius, j - len(x)
        if w >= 0:
            return float((x[i, :2] - wall[w, 0:2]) @ wall[w, 2:4] - radius[i])
        return float(np.hypot(*(x[j, :2] - x[i, :2])) - (radius[i] + radius[j]))

    def _wall_forces(self, x: FloatArray, wall: FloatArray, memory: ContactMemory) -> FloatArray:
        """Force of the disks on each wall, shape (m, 2): ``p n - q t`` with n pointing into the wall."""
        total = np.zeros((len(wall), 2))
        of_wall = memory.pairs[:, 1] >= len(x)
        w = memory.pairs[of_wall, 1] - len(x)
        p, q = memory.forces[of_wall].T
        normal = -wall[w, 2:4]
        force = p[:, None] * normal - q[:, None] * np.column_stack([-normal[:, 1], normal[:, 0]])
        np.add.at(total, w, force)
        return total

    def _energies(
        self, row: int, x: FloatArray, v: FloatArray, memory: ContactMemory, wall_work: float, impact_gain: float
    ) -> None:
        disks, laws, energy = self._scene.disks, self._laws, self.history.energy
        of = np.where(memory.pairs[:, 1] >= len(x), memory.pairs[:, 1] - len(x) + 1, 0)
        soft = laws.elastic[of]
        p, q = memory.forces[soft].T
        kn, ks = laws.kn[of[soft]], laws.ks[of[soft]]
        shear = np.divide(q * q, ks, out=np.zeros_like(q), where=ks > 0.0)
        values = {
            "translation": 0.5 * float((disks.mass * (v[:, 0] ** 2 + v[:, 1] ** 2)).sum()),
            "rotation": 0.5 * float((disks.inertia * v[:, 2] ** 2).sum()),
            "elastic_normal": 0.5 * float((p * p / kn).sum()),
            "elastic_shear": 0.5 * float(shear.sum()),
            "gravity": -float((disks.mass * (x[:, :2] @ np.array(self._scene.gravity))).sum()),
            "wall_work": wall_work,
            "impact_gain": impact_gain,
        }
        values["kinetic"] = values["translation"] + values["rotation"]
        values["elastic"] = values["elastic_normal"] + values["elastic_shear"]
        for name, value in values.items():
            energy[name][row] = value
